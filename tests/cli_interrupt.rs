//! Ctrl-C: the run ends in order, and everything up to there is in the results file and in the recording.
#![cfg(all(unix, feature = "hdf5", feature = "rerun"))]

use std::error::Error;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

type Tested = Result<(), Box<dyn Error>>;

/// How long anything here may take at most.
const PATIENCE: Duration = Duration::from_secs(60);

/// Times on the timeline of the recording that have a mesh.
fn recorded_frames(file: &Path) -> Result<usize, Box<dyn Error>> {
    let mut frames = 0;
    for message in rerun::external::re_log_encoding::DecoderApp::decode_eager(std::io::BufReader::new(std::fs::File::open(file)?))? {
        if let rerun::external::re_log_types::LogMsg::ArrowMsg(_, message) = message? {
            let chunk = rerun::log::Chunk::from_arrow_msg(&message)?;
            if chunk.entity_path().to_string() == "/world/panel_left/mesh" && !chunk.is_static() {
                frames += chunk.num_rows();
            }
        }
    }
    Ok(frames)
}

#[test]
fn an_interrupted_run_loses_nothing_of_what_it_computed() -> Tested {
    let folder = tempfile::tempdir()?;
    let (results, recording) = (folder.path().join("run.h5"), folder.path().join("run.rrd"));
    let mut run = Command::new(env!("CARGO_BIN_EXE_pliant"))
        .args(["run", "--duration", "1e5", "--json", "--out"])
        .arg(&results)
        .arg("--rrd")
        .arg(&recording)
        .current_dir(folder.path())
        .env("HDF5_USE_FILE_LOCKING", "FALSE")
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()?;
    // some blocks of results and some frames on disk, so that the run is in full swing
    let begin = Instant::now();
    let length = |file: &Path| std::fs::metadata(file).map_or(0, |m| m.len());
    while length(&results) < 300_000 || length(&recording) < 300_000 {
        assert!(begin.elapsed() < PATIENCE && run.try_wait()?.is_none(), "the run wrote nothing");
        std::thread::sleep(Duration::from_millis(5));
    }
    assert!(Command::new("kill").args(["-INT", &run.id().to_string()]).status()?.success());
    let done = run.wait_with_output()?;
    let message = String::from_utf8(done.stderr)?;
    assert_eq!(done.status.code(), Some(3), "{message}");
    assert!(message.contains("interrupted at t = ") && message.contains("what was computed is kept"), "{message}");

    let report: serde_json::Value = serde_json::from_slice(&done.stdout)?;
    let end = report["simulated_s"].as_f64().ok_or("no end")?;
    let rate = 30.0;
    // the output times of the last step are shown before it ends
    let expected = (end * rate * (1.0 + 1e-12)).floor() as u64 + 1;
    for kind in ["results", "viewer"] {
        let file = report["files"].as_array().into_iter().flatten().find(|f| f["kind"] == kind).ok_or("a file is missing")?;
        assert_eq!((file["frames"].as_u64(), &file["problem"]), (Some(expected), &serde_json::Value::Null), "{report}");
    }
    let file = hdf5::File::open(&results)?;
    let times = file.dataset("time")?.read_raw::<f64>()?;
    assert_eq!(times.len() as u64, expected);
    assert!(times.windows(2).all(|t| (t[1] - t[0] - 1.0 / rate).abs() < 1e-9 * end));
    assert_eq!(file.dataset("hinges/drive_left/load_moment")?.shape(), [times.len(), 3]);
    assert_eq!((file.attr("completed")?.read_scalar::<u8>()?, file.attr("end_time")?.read_scalar::<f64>()?), (0, end));
    assert_eq!(recorded_frames(&recording)? as u64, expected);
    Ok(())
}
