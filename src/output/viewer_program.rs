//! The viewer program: whether one listens, and how one is started. A port is probed before anything connects.

use super::viewer::{VIEWER_PORT, ViewerError};
use std::net::{SocketAddr, TcpListener, TcpStream, ToSocketAddrs};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// How long a probe of a port takes at most (s).
const PROBE: Duration = Duration::from_secs(2);
/// How long a viewer may take to start (s).
const START: Duration = Duration::from_secs(20);

/// The address in full, after making sure that somebody listens there.
///
/// # Errors
/// If the address cannot be read or nobody listens.
pub fn probe(url: &str) -> Result<String, ViewerError> {
    let address = |cause: &str| ViewerError::Address { url: url.to_owned(), cause: cause.to_owned() };
    let (full, authority) = match url.split_once("://") {
        Some((_, rest)) => (url.to_owned(), rest.split('/').next().unwrap_or_default().to_owned()),
        None => {
            let host = url.trim_end_matches('/');
            let authority = if host.contains(':') { host.to_owned() } else { format!("{host}:{VIEWER_PORT}") };
            (format!("rerun+http://{authority}/proxy"), authority)
        }
    };
    let authority = if authority.rsplit_once(':').is_some_and(|(_, port)| port.parse::<u16>().is_ok()) {
        authority
    } else if authority.is_empty() || authority.contains(':') {
        return Err(address("no host and port in it"));
    } else {
        format!("{authority}:{VIEWER_PORT}")
    };
    let addresses = authority.to_socket_addrs().map_err(|e| address(&e.to_string()))?;
    let mut cause = "no such host".to_owned();
    for at in addresses {
        match TcpStream::connect_timeout(&at, PROBE) {
            Ok(_) => return Ok(full),
            Err(e) => cause = e.to_string(),
        }
    }
    Err(ViewerError::NoListener { url: full, cause })
}

/// Makes sure that a port of this machine is free.
///
/// # Errors
/// If it is not.
pub fn free_port(port: u16) -> Result<(), ViewerError> {
    TcpListener::bind(("127.0.0.1", port)).map(drop).map_err(|e| ViewerError::Port { port, cause: e.to_string() })
}

/// Starts a viewer unless one listens already; returns its address.
///
/// # Errors
/// If there is no viewer to start, or it does not come to listen.
pub fn spawn(executable: Option<&Path>) -> Result<String, ViewerError> {
    let at = SocketAddr::from(([127, 0, 0, 1], VIEWER_PORT));
    let listens = || TcpStream::connect_timeout(&at, PROBE).is_ok();
    let url = format!("rerun+http://127.0.0.1:{VIEWER_PORT}/proxy");
    if executable.is_none() && listens() {
        return Ok(url);
    }
    let executable = find_viewer(executable)?;
    let mut command = Command::new(&executable);
    command.args(["--port", &VIEWER_PORT.to_string(), "--expect-data-soon", "--hide-welcome-screen"]);
    // the viewer outlives the run, and its chatter does not mix with results on standard output
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    #[cfg(unix)]
    std::os::unix::process::CommandExt::process_group(&mut command, 0);
    let not_ready = |cause: String| ViewerError::NotReady { executable: executable.clone(), cause };
    let mut child = command.spawn().map_err(|e| not_ready(format!("cannot be started: {e}")))?;
    let begin = Instant::now();
    while begin.elapsed() < START {
        if listens() {
            return Ok(url);
        }
        if let Ok(Some(status)) = child.try_wait() {
            return Err(not_ready(format!("ended at once ({status})")));
        }
        std::thread::sleep(Duration::from_millis(100));
    }
    Err(not_ready(format!("does not listen on port {VIEWER_PORT} after {} s", START.as_secs())))
}

/// The viewer's executable: the one given, that on PATH, or that of `.venv/bin`.
fn find_viewer(given: Option<&Path>) -> Result<PathBuf, ViewerError> {
    if let Some(given) = given {
        let missing = || ViewerError::NoExecutable { tried: format!("\"{}\" is no file", given.display()) };
        return if given.is_file() { Ok(given.to_owned()) } else { Err(missing()) };
    }
    let name = format!("rerun{}", std::env::consts::EXE_SUFFIX);
    let path = std::env::var_os("PATH").unwrap_or_default();
    let folders = std::env::split_paths(&path).chain([PathBuf::from(".venv/bin")]);
    let found = folders.map(|folder| folder.join(&name)).find(|file| file.is_file());
    found.ok_or_else(|| ViewerError::NoExecutable { tried: format!("`{name}` is neither on PATH nor in .venv/bin") })
}
