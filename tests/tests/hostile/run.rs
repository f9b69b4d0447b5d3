//! Runs the program on input that might block it for ever.

use std::process::{Child, Stdio};
use std::time::Duration;

use headrace_geometry::time::DurNs;
use headrace_ports::now;
use headrace_tests::{Folder, program};

/// Time limit of a run. Runs usually take seconds, so a longer run is taken to hang for ever.
const HANGS_AFTER: DurNs = DurNs::from_millis(120_000);

/// Result of a run of the program.
pub(crate) struct Ran {
    pub(crate) code: Option<i32>,
    pub(crate) stdout: String,
    /// Lines of stderr, except the program's own log messages.
    pub(crate) stderr: String,
    /// All of stderr.
    pub(crate) log: String,
    /// Peak resident memory, MiB.
    pub(crate) most_mib: u64,
    /// Duration of the run, s. It is printed in tables, but no test checks it.
    pub(crate) took_s: f64,
}

/// Runs the program in a folder and measures the program's memory. The program must end by itself.
#[track_caller]
pub(crate) fn run(folder: &Folder, arguments: &[&str]) -> Ran {
    let files = ["out", "err"].map(|name| folder.path(name));
    let [out, err] = files.each_ref().map(|path| std::fs::File::create(path).unwrap());
    let begun = now();
    let mut command = program();
    command.args(arguments).current_dir(folder.path("")).env("RUST_LOG", "headrace=info");
    let mut child = command.stdin(Stdio::null()).stdout(out).stderr(err).spawn().unwrap();
    let code = wait(&mut child, arguments);
    let took_s = now().since(begun).as_secs_f64();
    let [stdout, log] = files.map(|path| String::from_utf8(std::fs::read(path).unwrap()).unwrap());
    let kib = log.rsplit_once("most_kib=").map(|(_, rest)| rest.lines().next().unwrap_or_default());
    let kib: u64 = kib.unwrap_or_else(|| panic!("{arguments:?} died: {code:?} {log}")).parse().unwrap();
    let mut stderr = String::new();
    for line in log.lines().filter(|line| line.starts_with("headrace: ")) {
        stderr.push_str(line);
        stderr.push('\n');
    }
    Ran { code, stdout, stderr, log, most_mib: kib >> 10, took_s }
}

#[track_caller]
fn wait(child: &mut Child, arguments: &[&str]) -> Option<i32> {
    let begun = now();
    loop {
        if let Some(status) = child.try_wait().unwrap() {
            return status.code();
        }
        if now().since(begun) > HANGS_AFTER {
            child.kill().unwrap();
            child.wait().unwrap();
            panic!("{arguments:?} doesn't end");
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}
