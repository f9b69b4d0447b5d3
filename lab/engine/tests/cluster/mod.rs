//! Campaigns on a cluster of processes on this machine. The script `lab/try-cluster` tests killed executors and
//! measures speed.

use std::net::{SocketAddr, TcpListener, TcpStream};
use std::process::{Child, Stdio};

use super::*;

/// Processes that are killed when this value is dropped.
struct Cluster {
    address: String,
    processes: Vec<Child>,
}

impl Drop for Cluster {
    fn drop(&mut self) {
        for process in &mut self.processes {
            process.kill().unwrap();
            process.wait().unwrap();
        }
    }
}

impl Cluster {
    /// Starts a scheduler and two executors. Each executor has one thread and uses the cache at `cache`.
    fn start(cache: &Path) -> Self {
        let free = || TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
        let address = free();
        let mut cluster = Self { address: address.to_string(), processes: Vec::new() };
        cluster.process(cache, &["--schedule"], address);
        for _ in 0..2 {
            let executor = ["--executor", &address.to_string(), "--threads", "1"];
            cluster.process(cache, &executor, free());
        }
        cluster
    }

    fn process(&mut self, cache: &Path, arguments: &[&str], address: SocketAddr) {
        let mut command = Command::new(env!("CARGO_BIN_EXE_headrace-campaign"));
        command.args(arguments).arg("--listen").arg(address.to_string()).arg("--cache").arg(cache);
        // Files left by a killed process are removed with the cache's folder.
        command.env("TMPDIR", cache.parent().unwrap());
        let mut child = command.stderr(Stdio::null()).spawn().unwrap();
        while TcpStream::connect(address).is_err() {
            assert!(child.try_wait().unwrap().is_none(), "{command:?} ended");
            std::thread::sleep(Duration::from_millis(20));
        }
        self.processes.push(child);
    }
}

#[test]
fn executors_give_the_same_tables_and_answers_as_threads() {
    let (folder, scratch) = (dives(), tempfile::tempdir().unwrap());
    // A log that can't be read becomes a row of `dives` with the error.
    std::fs::write(folder.path().join("nothing.mcap"), "nothing").unwrap();
    let (here, there) = (scratch.path().join("here"), scratch.path().join("there"));
    let cluster = Cluster::start(&there);
    let scheduler = ["--scheduler", cluster.address.as_str()];

    let local = run(folder.path(), &here, &[]);
    let remote = run(folder.path(), &there, &scheduler);
    assert_eq!(local.status.code(), Some(3), "{}", stderr(&local));
    assert_eq!(remote.status.code(), Some(3), "{}", stderr(&remote));
    assert_eq!(stderr(&remote), stderr(&local));
    let all = files(&here);
    assert_eq!(all.len(), 5 * 8);
    assert!(files(&there) == all, "executors and threads make different files");
    assert_eq!(finished(&there), 5);

    for sql in [
        "SELECT * FROM dives ORDER BY log",
        "SELECT verdict, count(*) AS n, max(d_m) AS d FROM sections GROUP BY verdict ORDER BY verdict",
        "SELECT d.log, s.chainage_m, s.verdict FROM sections s JOIN dives d ON s.dive = d.dive ORDER BY d.log, s.chainage_m",
        "SELECT count(*) AS n FROM before_sections",
        "SELECT dive, verdict, count(*) AS n FROM replay('*', 'target_m=0.3') GROUP BY dive, verdict ORDER BY dive, verdict",
        "SELECT log, error FROM replay('*', 'target_m=0.3', 'dives') ORDER BY log",
    ] {
        let (expected, _) = ask(folder.path(), &here, sql, &[]);
        let (answer, summary) = ask(folder.path(), &there, sql, &scheduler);
        assert!(!expected.is_empty());
        assert_eq!(answer, expected, "{sql}");
        // Every run tries the unreadable log again.
        assert!(summary.contains(" 1 replayed, 5 from the cache"), "{summary}");
    }
    assert!(files(&there) == files(&here), "with another target, executors and threads make different files");
}

#[test]
fn cache_not_shared_with_executors_is_reported() {
    let (folder, scratch) = (dives(), tempfile::tempdir().unwrap());
    let cluster = Cluster::start(&scratch.path().join("theirs"));
    let output = run(folder.path(), &scratch.path().join("ours"), &["--scheduler", &cluster.address]);
    assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
    assert!(stderr(&output).contains("all machines must share one --cache folder"), "{}", stderr(&output));
}

#[test]
fn missing_scheduler_is_reported() {
    let (folder, cache) = (dives(), tempfile::tempdir().unwrap());
    for (scheduler, code, why) in
        [("nowhere", 2, "--scheduler nowhere: expected HOST:PORT"), ("127.0.0.1:9", 1, "127.0.0.1:9")]
    {
        let output = run(folder.path(), cache.path(), &["--scheduler", scheduler]);
        assert_eq!(output.status.code(), Some(code), "{}", stderr(&output));
        assert!(stderr(&output).contains(why), "{}", stderr(&output));
    }
}
