//! The program under test, and a temporary folder in which it runs. The folder is removed after use.

use std::path::PathBuf;
use std::process::Command;
use std::sync::atomic::{AtomicU32, Ordering};

use serde_json::Value;

use crate::short_dive::{SCENE, VEHICLE};

/// Length of a live dive after which a test gives up, s. A test repeats a dive, each time four times as long, until the
/// report is as expected.
const LONG_S: u32 = 100;

/// The program under test, ready for arguments.
pub fn program() -> Command {
    // Cargo passes the program's path to tests. A test that runs without Cargo, as in `tests/vm`, searches the target
    // folder.
    Command::new(std::env::var_os("CARGO_BIN_EXE_headrace_under_test").map_or_else(built, PathBuf::from))
}

fn built() -> PathBuf {
    let test = std::env::current_exe().unwrap();
    let folder = test.ancestors().nth(2).unwrap();
    folder.join(format!("headrace_under_test{}", std::env::consts::EXE_SUFFIX))
}

/// A new folder for one test. The folder is removed with its content after the test. Commands run in this folder, so
/// that their messages contain bare file names.
pub struct Folder(PathBuf);

/// Result of a run of the program.
pub struct Answer {
    /// Exit code; `None` if a signal ended the program.
    pub code: Option<i32>,
    /// Standard output.
    pub stdout: String,
    /// Standard error.
    pub stderr: String,
}

impl Folder {
    /// Creates an empty folder in the system's temporary folder.
    pub fn new() -> Self {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let name = format!("headrace-test-{}-{}", std::process::id(), COUNT.fetch_add(1, Ordering::Relaxed));
        let path = std::env::temp_dir().join(name);
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    /// A folder with the short dive: `vehicle.toml`, `scene.toml` and `dive.mcap`.
    pub fn with_dive() -> Self {
        let folder = Self::new();
        folder.write("vehicle.toml", VEHICLE);
        folder.write("scene.toml", SCENE);
        folder.simulate("scene.toml", "dive.mcap");
        folder
    }

    /// Path of a file in this folder.
    pub fn path(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    /// Writes a file in this folder.
    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        std::fs::write(self.path(name), content).unwrap();
    }

    /// Reads a file in this folder.
    pub fn read(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.path(name)).unwrap()
    }

    /// Runs the program in this folder.
    pub fn headrace(&self, arguments: &[&str]) -> Answer {
        let output = program().args(arguments).current_dir(&self.0).output().unwrap();
        let text = |bytes| String::from_utf8(bytes).unwrap();
        Answer { code: output.status.code(), stdout: text(output.stdout), stderr: text(output.stderr) }
    }

    /// Repeats a live dive with these arguments of `run` until `is_enough` accepts its report.
    ///
    /// The first dive takes 3 s, and each further dive takes four times as long as the previous one, because a busy
    /// machine may need more time. The log is `dive.mcap`. Returns the last answer and the last report.
    pub fn dive_until(&self, arguments: &[&str], is_enough: impl Fn(&Value) -> bool) -> (Answer, Value) {
        let mut seconds = 3;
        loop {
            let time = seconds.to_string();
            drop(std::fs::remove_file(self.path("dive.mcap")));
            let answer =
                self.headrace(&[&["run"], arguments, &["--report", "report.json", "--for", &time]].concat());
            let report: Value = serde_json::from_slice(&self.read("report.json")).unwrap();
            if is_enough(&report) || seconds > LONG_S {
                return (answer, report);
            }
            seconds *= 4;
        }
    }

    /// Simulates a scene and checks that the command succeeds.
    pub fn simulate(&self, scene: &str, log: &str) {
        let answer = self.headrace(&["simulate", scene, "-o", log]);
        assert_eq!(answer.code, Some(0), "{}", answer.stderr);
    }

    /// Runs the log `from` as a live dive of `vehicle.toml`, as fast as possible, and records it to the log `to`.
    #[track_caller]
    pub fn record(&self, from: &str, to: &str, further: &[&str]) -> Answer {
        let arguments = ["run", "vehicle.toml", "--source", from, "--record", to, "--speed", "max"];
        let answer = self.headrace(&[&arguments[..], further].concat());
        assert_eq!(answer.code, Some(0), "{}", answer.stderr);
        answer
    }

    /// Checks that `scene.toml` is refused with exit code 2 and these words on stderr, and that no log is written.
    #[track_caller]
    pub fn refuses_scene(&self, words: &[&str]) {
        let answer = self.headrace(&["simulate", "scene.toml", "-o", "dive.mcap"]);
        assert_eq!(answer.code, Some(2), "{}", answer.stderr);
        for word in words {
            assert!(answer.stderr.contains(word), "{word:?} is not in {}", answer.stderr);
        }
        assert!(!self.path("dive.mcap").exists(), "a refused scene leaves no log");
    }

    /// Runs `replay LOG --json` with the arguments `further`. Returns exit code and report.
    pub fn replay(&self, log: &str, further: &[&str]) -> (Option<i32>, Value) {
        let answer = self.headrace(&[&["replay", log, "--json"], further].concat());
        let report = serde_json::from_str(&answer.stdout)
            .unwrap_or_else(|error| panic!("{log}: {error}: {}", answer.stderr));
        (answer.code, report)
    }

    /// Digest of the results of a log's replay, which must report no loss or other finding.
    pub fn digest(&self, log: &str, further: &[&str]) -> String {
        let (code, report) = self.replay(log, further);
        assert_eq!(code, Some(0), "{log} {further:?}: {:?}", report["log"]["losses"]);
        report["digest"].as_str().unwrap().to_owned()
    }
}

impl Default for Folder {
    fn default() -> Self {
        Self::new()
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        if let Err(error) = std::fs::remove_dir_all(&self.0) {
            eprintln!("removing {}: {error}", self.0.display());
        }
    }
}
