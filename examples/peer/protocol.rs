//! The line protocol: requests from standard input, batches timed by the CPU time of the thread, one answer per line.

use cpu_time::ThreadTime;
use std::error::Error;
use std::io::{BufRead, Write};

/// One model, ready to be evaluated.
pub trait Case {
    /// One evaluation; `call` varies the state by next to nothing, so that no call repeats the one before. False if `op` is not known.
    ///
    /// # Errors
    /// If the evaluation has no answer.
    fn call(&mut self, op: &str, call: u32) -> Result<bool, Box<dyn Error>>;

    /// A number that other programs must find as well.
    fn check(&self) -> f64;

    /// The answer to an op that asks for numbers instead of times.
    ///
    /// # Errors
    /// If the evaluation has no answer.
    fn numbers(&mut self, op: &str) -> Result<Option<Vec<f64>>, Box<dyn Error>>;
}

/// A batch takes at least this long (s), so that reading the clock costs nothing.
const BATCH: f64 = 5e-4;

/// Answers `<model> <n> <op> <seconds>` until the input ends; `build` gives none for a model that it does not have.
pub fn serve<C: Case>(mut build: impl FnMut(&str, usize) -> Result<Option<C>, Box<dyn Error>>) -> Result<(), Box<dyn Error>> {
    let mut kept: Option<((String, usize), Option<C>)> = None;
    for line in std::io::stdin().lock().lines() {
        let line = line?;
        let [model, n, op, seconds] = line.split_whitespace().collect::<Vec<_>>()[..] else {
            return Err(format!("request \"{line}\" is not <model> <n> <op> <seconds>").into());
        };
        let (key, seconds): (_, f64) = ((model.to_owned(), n.parse()?), seconds.parse()?);
        if kept.as_ref().is_none_or(|(of, _)| *of != key) {
            // the old one goes first: two large ones at a time may not fit
            drop(kept.take());
            let case = build(&key.0, key.1)?;
            kept = Some((key, case));
        }
        let case = kept.as_mut().and_then(|(_, case)| case.as_mut());
        println!("{}", answer(case, op, seconds)?);
        std::io::stdout().flush()?;
    }
    Ok(())
}

fn answer<C: Case>(case: Option<&mut C>, op: &str, seconds: f64) -> Result<String, Box<dyn Error>> {
    let Some(case) = case else { return Ok("skip".into()) };
    if let Some(numbers) = case.numbers(op)? {
        return Ok(numbers.iter().map(|x| format!("{x:e}")).collect::<Vec<_>>().join(" "));
    }
    if !case.call(op, 0)? {
        return Ok("skip".into());
    }
    let check = case.check();
    let (mut batch, mut spent, mut ns) = (1_u32, 0.0, Vec::new());
    while spent < seconds || ns.len() < 3 {
        let start = ThreadTime::now();
        for call in 0..batch {
            case.call(op, call & 7)?;
        }
        let taken = start.elapsed().as_secs_f64();
        spent += taken;
        if taken < BATCH && ns.is_empty() {
            batch *= 2;
        } else {
            ns.push(1e9 * taken / f64::from(batch));
        }
    }
    ns.sort_by(f64::total_cmp);
    Ok(format!("{:.3} {:.3} {check:.9e}", ns[0], ns[ns.len() / 2]))
}
