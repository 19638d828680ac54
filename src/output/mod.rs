//! What leaves a run: records, peaks, the results file and the viewer stream.

pub mod evaluation;

pub use evaluation::Evaluation;
