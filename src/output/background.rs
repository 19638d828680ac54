//! Threads that stand back behind the solver's.
//!
//! A recording takes about as much processor time as a short run itself, on several threads; at equal priority they push the solver off its
//! core now and then.

/// Nice value of such threads: a tenth of the solver's share where there is not enough for all.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
const NICE: i32 = 10;

/// Makes the calling thread, and those that it starts from now on, stand back. Nothing happens where the system has no such thing.
pub fn stand_back() {
    // On Linux the priority of a "process" 0 is that of the calling thread alone; a refusal leaves it as it is.
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    // SAFETY: takes numbers only
    unsafe {
        libc::setpriority(libc::PRIO_PROCESS, 0, NICE);
    }
}

/// Runs `work` on a thread that stands back, so that the threads it starts do too; none if there is no thread for it.
pub fn in_background<T: Send>(work: impl FnOnce() -> T + Send) -> Option<T> {
    std::thread::scope(|scope| {
        let standing_back = || {
            stand_back();
            work()
        };
        std::thread::Builder::new().spawn_scoped(scope, standing_back).ok()?.join().ok()
    })
}

#[cfg(all(test, target_os = "linux", target_env = "gnu"))]
mod tests {
    use super::*;

    fn nice() -> i32 {
        // SAFETY: takes numbers only
        unsafe { libc::getpriority(libc::PRIO_PROCESS, 0) }
    }

    #[test]
    fn threads_started_in_the_background_stand_back_and_the_solver_does_not() {
        let before = nice();
        let inherited = in_background(|| std::thread::spawn(nice).join().ok()).flatten();
        assert_eq!(inherited, Some(before.max(NICE)));
        assert_eq!(nice(), before);
    }
}
