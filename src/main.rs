//! The `pliant` program.

use std::process::ExitCode;

fn main() -> ExitCode {
    keep_freed_memory();
    pliant::cli::main()
}

/// Lets the C allocator keep what is freed: the compressor of results takes and frees a quarter of a megabyte for each small chunk, and
/// giving that back to the system every time slows down all threads, the solver's by a tenth.
fn keep_freed_memory() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    // SAFETY: called before there is another thread; a setting that is refused changes nothing
    unsafe {
        libc::mallopt(libc::M_TRIM_THRESHOLD, 256 << 20);
        libc::mallopt(libc::M_MMAP_THRESHOLD, 32 << 20);
    }
}
