//! Where a viewer stream goes, what can be wrong with it, and the thread behind a bounded channel that feeds it.
//!
//! The solver hands over small snapshots, which wait in memory of bounded size. If the viewer is so slow that it fills up, the solver waits
//! for room, at most [`PATIENCE`]; after that the stream is given up, the run goes on and the report says so. Nothing waits
//! without bound: closing has a time limit.

use super::background::stand_back;
use super::picture::Snapshot;
use crossbeam_channel::{Receiver, RecvTimeoutError, SendTimeoutError, Sender, bounded};
use std::path::PathBuf;
use std::time::{Duration, Instant};
use thiserror::Error;

/// Version of the viewer that understands the stream.
pub const VIEWER_VERSION: &str = "0.36.3";
/// Port on which viewers listen unless told otherwise.
pub const VIEWER_PORT: u16 = 9876;
/// How long the solver waits for room (s).
pub const PATIENCE: Duration = Duration::from_secs(10);
/// How long the end of a run waits for the viewer (s).
const CLOSING: Duration = Duration::from_secs(30);
/// How long a thread that ended takes to say why (s).
const LAST_WORD: Duration = Duration::from_secs(2);
/// Memory (bytes) for snapshots on their way to the thread.
const ROOM: usize = 32 << 20;
/// Batches that it is divided into: waking the thread costs the solver more than a snapshot.
const BATCHES: usize = 64;
/// Most snapshots in a batch, and how long the first of them waits for the others: less than a picture of a screen.
const BATCH: usize = 64;
const HAND_OVER: Duration = Duration::from_millis(8);

/// Where the stream goes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ViewerTarget {
    /// A recording on disk.
    Save(PathBuf),
    /// A viewer of its own; found on PATH or in `.venv/bin` of the current directory if no executable is named.
    Spawn {
        /// The viewer to start.
        executable: Option<PathBuf>,
    },
    /// A viewer that listens, as `rerun+http://HOST:PORT/proxy`, `HOST:PORT` or `HOST`.
    Connect {
        /// Address.
        url: String,
    },
    /// A page served by this process, and by nothing else: it lasts as long as the process.
    Web {
        /// Port of the page.
        port: u16,
        /// Port of the data.
        grpc_port: u16,
    },
}

/// Why there is no stream, or no longer.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
pub enum ViewerError {
    /// Nobody listens.
    #[error(
        "no viewer listens at {url} ({cause}); start one with `rerun` (version {VIEWER_VERSION}: pip install rerun-sdk=={VIEWER_VERSION}) and check \
         host and port, or save a recording instead"
    )]
    NoListener {
        /// Address.
        url: String,
        /// What the system says.
        cause: String,
    },
    /// An address that cannot be.
    #[error(
        "viewer address \"{url}\": {cause}; write rerun+http://HOST:PORT/proxy, for example rerun+http://127.0.0.1:{VIEWER_PORT}/proxy"
    )]
    Address {
        /// As given.
        url: String,
        /// What is wrong.
        cause: String,
    },
    /// No viewer to start.
    #[error(
        "no viewer to start: {tried}; install version {VIEWER_VERSION} with pip install rerun-sdk=={VIEWER_VERSION}, name the executable, or \
         save a recording instead"
    )]
    NoExecutable {
        /// Where it was looked for.
        tried: String,
    },
    /// A viewer that started but does not listen.
    #[error("the viewer \"{}\" {cause}; on a machine without a display save a recording or serve the web viewer instead", executable.display())]
    NotReady {
        /// What was started.
        executable: PathBuf,
        /// What it did.
        cause: String,
    },
    /// A port that is taken.
    #[error("port {port} on this machine cannot be used: {cause}; choose another port")]
    Port {
        /// The port.
        port: u16,
        /// What the system says.
        cause: String,
    },
    /// A recording that cannot be made.
    #[error("recording \"{}\": cannot be created: {cause}; name a file in a folder that exists and may be written", file.display())]
    Create {
        /// Path.
        file: PathBuf,
        /// What the system says.
        cause: String,
    },
    /// The viewer's library refused.
    #[error("the viewer stream could not be set up: {cause}")]
    Setup {
        /// What it says.
        cause: String,
    },
    /// The stream ended early.
    #[error("the stream to {target} was lost with {frames} output times handed over: {cause}; {remedy}")]
    Lost {
        /// Path or address.
        target: String,
        /// Output times handed over.
        frames: u64,
        /// What happened.
        cause: String,
        /// What to do.
        remedy: &'static str,
    },
}

impl ViewerError {
    /// Output times that were handed over before the error.
    #[must_use]
    pub fn frames(&self) -> u64 {
        if let Self::Lost { frames, .. } = self { *frames } else { 0 }
    }
}

/// What a stream did.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ViewerSummary {
    /// Output times that reached the file or viewer.
    pub frames: u64,
}

/// What the thread does with snapshots.
pub trait FrameLog: Send + 'static {
    /// Logs one output time, now or at the next [`Self::flush`].
    ///
    /// # Errors
    /// What went wrong, in words.
    fn frame(&mut self, snapshot: &Snapshot) -> Result<(), String>;
    /// Logs a line at a time (s).
    ///
    /// # Errors
    /// As [`Self::frame`].
    fn note(&mut self, time: f64, text: &str) -> Result<(), String>;
    /// How long [`Self::frame`] may hold an output time back to pass it on with others.
    fn patience(&self) -> Duration;
    /// Passes on what [`Self::frame`] holds back.
    ///
    /// # Errors
    /// As [`Self::frame`].
    fn flush(&mut self) -> Result<(), String>;
    /// Brings everything to file or viewer.
    ///
    /// # Errors
    /// As [`Self::frame`].
    fn close(self) -> Result<(), String>;
}

#[derive(Debug)]
enum Message {
    Frame(Snapshot),
    Note(f64, String),
}

/// A stream that is fed.
#[derive(Debug)]
pub struct ViewerStream {
    target: String,
    remedy: &'static str,
    hinges: Vec<usize>,
    closures: Vec<usize>,
    sender: Option<Sender<Vec<Message>>>,
    /// Messages that are not yet handed over, since when, and how many there may be.
    batch: Vec<Message>,
    since: Instant,
    most: usize,
    done: Receiver<(u64, Result<(), String>)>,
    sent: u64,
    lost: Option<ViewerError>,
}

impl ViewerStream {
    /// Starts the thread. `remedy` is what to do if the stream is lost; `log` shows the loads of the hinges that carry the bodies `hinges`,
    /// and those of `closures`; a snapshot takes `snapshot_bytes`.
    ///
    /// # Errors
    /// If the system gives no thread.
    pub fn start(
        mut log: impl FrameLog,
        target: String,
        remedy: &'static str,
        hinges: Vec<usize>,
        closures: Vec<usize>,
        snapshot_bytes: usize,
    ) -> Result<Self, ViewerError> {
        let most = (ROOM / BATCHES / snapshot_bytes.max(1)).clamp(1, BATCH);
        // snapshots so large that single ones fill the room: a few all the same
        let (sender, receiver) = bounded::<Vec<Message>>((ROOM / (most * snapshot_bytes.max(1))).clamp(4, BATCHES));
        let (finished, done) = bounded(1);
        let work = move || {
            stand_back();
            let mut frames = 0;
            let result = feed(&receiver, &mut log, &mut frames).and_then(|()| log.close());
            // nobody listens any more if the run gave the stream up
            let _ = finished.send((frames, result));
        };
        let thread = std::thread::Builder::new().name("viewer".into()).spawn(work);
        thread.map_err(|e| ViewerError::Setup { cause: e.to_string() })?;
        let (batch, since) = (Vec::new(), Instant::now());
        Ok(Self { target, remedy, hinges, closures, sender: Some(sender), batch, since, most, done, sent: 0, lost: None })
    }

    /// Path or address.
    #[must_use]
    pub fn target(&self) -> &str {
        &self.target
    }

    /// Bodies whose hinge loads a snapshot holds.
    #[must_use]
    pub fn hinges(&self) -> &[usize] {
        &self.hinges
    }

    /// Closures whose loads a snapshot holds.
    #[must_use]
    pub fn closures(&self) -> &[usize] {
        &self.closures
    }

    /// Takes one output time.
    pub fn send(&mut self, snapshot: Snapshot) {
        self.batch.push(Message::Frame(snapshot));
        if self.batch.len() >= self.most {
            self.hand_over();
        } else {
            self.pass_on();
        }
    }

    /// Hands over what has waited long enough: to be called often, or the last output times wait for the next one.
    pub fn pass_on(&mut self) {
        if !self.batch.is_empty() && self.since.elapsed() >= HAND_OVER {
            self.hand_over();
        }
    }

    /// Hands over a line.
    pub fn note(&mut self, time: f64, text: &str) {
        self.batch.push(Message::Note(time, text.to_owned()));
        self.hand_over();
    }

    fn hand_over(&mut self) {
        let batch = std::mem::take(&mut self.batch);
        let Some(sender) = &self.sender else { return };
        let frames = batch.iter().filter(|m| matches!(m, Message::Frame(_))).count() as u64;
        let sent = sender.send_timeout(batch, PATIENCE);
        self.since = Instant::now();
        match sent {
            Ok(()) => {
                self.sent += frames;
                return;
            }
            Err(SendTimeoutError::Timeout(_)) => {
                let cause = format!("it took no data for {} s", PATIENCE.as_secs());
                self.lost = Some(self.lost_by(self.sent, cause));
            }
            Err(SendTimeoutError::Disconnected(_)) => {
                let (frames, cause) = match self.done.recv_timeout(LAST_WORD) {
                    Ok((frames, Err(cause))) => (frames, cause),
                    _ => (self.sent, "its thread ended".to_owned()),
                };
                self.lost = Some(self.lost_by(frames, cause));
            }
        }
        self.sender = None;
    }

    fn lost_by(&self, frames: u64, cause: String) -> ViewerError {
        ViewerError::Lost { target: self.target.clone(), frames, cause, remedy: self.remedy }
    }

    /// Waits, within bounds, until everything has reached file or viewer.
    ///
    /// # Errors
    /// If something did not.
    pub fn finish(mut self) -> Result<ViewerSummary, ViewerError> {
        self.hand_over();
        self.sender = None;
        if let Some(lost) = self.lost.take() {
            return Err(lost);
        }
        match self.done.recv_timeout(CLOSING) {
            Ok((frames, Ok(()))) => Ok(ViewerSummary { frames }),
            Ok((frames, Err(cause))) => Err(self.lost_by(frames, cause)),
            Err(RecvTimeoutError::Timeout) => {
                Err(self.lost_by(self.sent, format!("it did not take the rest within {} s", CLOSING.as_secs())))
            }
            Err(RecvTimeoutError::Disconnected) => Err(self.lost_by(self.sent, "its thread ended".into())),
        }
    }
}

/// Logs messages until the sender is gone; output times are held back a little, so that they can be passed on together.
fn feed(receiver: &Receiver<Vec<Message>>, log: &mut impl FrameLog, frames: &mut u64) -> Result<(), String> {
    let mut held: Option<Instant> = None;
    let patience = log.patience();
    loop {
        let batch = match held {
            None => receiver.recv().map_err(|_| RecvTimeoutError::Disconnected),
            Some(since) => receiver.recv_timeout(patience.saturating_sub(since.elapsed())),
        };
        match batch {
            Ok(batch) => {
                held.get_or_insert_with(Instant::now);
                for message in batch {
                    match message {
                        Message::Frame(snapshot) => {
                            log.frame(&snapshot)?;
                            *frames += 1;
                        }
                        Message::Note(time, text) => log.note(time, &text)?,
                    }
                }
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return Ok(()),
        }
        if held.is_some_and(|since| since.elapsed() >= patience) {
            log.flush()?;
            held = None;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::{Arc, Mutex};

    /// Keeps times of frames, and of the frames that were passed on; takes its time.
    #[derive(Clone, Default)]
    struct Kept {
        held: Arc<Mutex<Vec<f64>>>,
        passed: Arc<Mutex<Vec<f64>>>,
    }

    impl FrameLog for Kept {
        fn frame(&mut self, snapshot: &Snapshot) -> Result<(), String> {
            std::thread::sleep(Duration::from_millis(1));
            self.held.lock().map_err(|e| e.to_string())?.push(snapshot.time);
            Ok(())
        }

        fn note(&mut self, _time: f64, _text: &str) -> Result<(), String> {
            Ok(())
        }

        fn patience(&self) -> Duration {
            Duration::from_millis(5)
        }

        fn flush(&mut self) -> Result<(), String> {
            let mut held = self.held.lock().map_err(|e| e.to_string())?;
            self.passed.lock().map_err(|e| e.to_string())?.append(&mut held);
            Ok(())
        }

        fn close(mut self) -> Result<(), String> {
            self.flush()
        }
    }

    fn at(time: f64) -> Snapshot {
        Snapshot { time, ..Snapshot::default() }
    }

    #[test]
    fn a_slow_viewer_gets_everything_in_order_through_the_smallest_room() -> Result<(), Box<dyn std::error::Error>> {
        let log = Kept::default();
        let mut stream = ViewerStream::start(log.clone(), "test".into(), "none", vec![], vec![], usize::MAX / BATCHES)?;
        let times: Vec<f64> = (0..100).map(f64::from).collect();
        times.iter().for_each(|&time| stream.send(at(time)));
        assert_eq!(stream.finish()?, ViewerSummary { frames: 100 });
        assert_eq!(*log.passed.lock().map_err(|e| e.to_string())?, times);
        Ok(())
    }

    #[test]
    fn what_is_held_back_is_passed_on_while_the_run_goes_on() -> Result<(), Box<dyn std::error::Error>> {
        let log = Kept::default();
        let mut stream = ViewerStream::start(log.clone(), "test".into(), "none", vec![], vec![], 1)?;
        std::thread::sleep(2 * HAND_OVER);
        stream.send(at(0.5));
        let begin = Instant::now();
        while log.passed.lock().map_err(|e| e.to_string())?.is_empty() {
            assert!(begin.elapsed() < PATIENCE, "nothing was passed on");
            std::thread::sleep(Duration::from_millis(1));
        }
        assert_eq!(stream.finish()?, ViewerSummary { frames: 1 });
        Ok(())
    }
}
