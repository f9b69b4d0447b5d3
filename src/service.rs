//! A dive as a service of systemd: tells systemd when the dive has begun, and its status, progress and end.
//!
//! Source: `sd_notify(3)`. The watchdog is fed by the loop's ticks, so systemd restarts a program whose loop hangs, even
//! if its other threads go on.

use std::thread::{self, JoinHandle};

use crossbeam::channel::{Receiver, Sender, bounded};
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_monitor::run::Loop;
use sd_notify::NotifyState;

use crate::failure::Failure;
use crate::follower::Follower;
use crate::recording_state::RecordingState;
use crate::watch::state_line;

/// Environment variable with the socket on which systemd listens. It is set only for services of the type "notify".
const SOCKET: &str = "NOTIFY_SOCKET";
/// Longest interval between messages to systemd.
const LONGEST: DurNs = DurNs(1_000_000_000);
/// Number of messages within one interval of the watchdog, so that a single late message does no harm.
const PER_WATCHDOG: i64 = 4;
/// Maximum number of messages in the queue. Old messages in a longer queue would feed the watchdog although the loop
/// hangs.
const WAITING: usize = 2;

/// Message to systemd.
enum Message {
    /// The loop has made progress since the last message.
    Progress {
        is_first: bool,
        status: String,
    },
    Stopping,
}

/// Follower that tells systemd the state of the dive.
pub(crate) struct Service {
    messages: Option<Sender<Message>>,
    thread: Option<JoinHandle<()>>,
    every: DurNs,
    sent: Option<MonoNs>,
    recorded: RecordingState,
}

impl Service {
    /// Starts to tell systemd the state of the dive; `None` if the program isn't a service that systemd listens to.
    ///
    /// Errors: the thread can't be created.
    pub(crate) fn start() -> Result<Option<Self>, Failure> {
        if std::env::var_os(SOCKET).is_none() {
            return Ok(None);
        }
        let (sender, messages) = bounded(WAITING);
        let send = move || send_all(&messages);
        let thread = thread::Builder::new()
            .name("service".to_owned())
            .spawn(send)
            .map_err(|source| Failure::System { what: "starting the messages to systemd", source })?;
        Ok(Some(Self {
            messages: Some(sender),
            thread: Some(thread),
            every: interval(),
            sent: None,
            recorded: RecordingState::default(),
        }))
    }

    /// Tells systemd at `now`, if it is time to, that the loop has made progress.
    fn progress(&mut self, now: MonoNs, status: impl FnOnce(&RecordingState) -> String) {
        if self.sent.is_some_and(|sent| now.since(sent) < self.every) {
            return;
        }
        let is_first = self.sent.replace(now).is_none();
        self.send(Message::Progress { is_first, status: status(&self.recorded) });
    }

    /// Hands a message to the sending thread. If the queue is full, systemd doesn't read, and the message is dropped.
    fn send(&self, message: Message) {
        if let Some(messages) = &self.messages {
            messages.try_send(message).ok();
        }
    }
}

impl Follower for Service {
    /// Reports progress to systemd. The first tick comes after the recorders and the ports' threads have started.
    fn tick(&mut self, dive: &Loop) {
        self.progress(headrace_ports::now(), |recorded| state_line(dive, recorded).text());
    }

    fn recorded(&mut self, state: &RecordingState) {
        self.recorded = *state;
    }

    fn ending(&mut self) {
        self.send(Message::Stopping);
    }

    fn end(&mut self, _: &Loop) {}
}

impl Drop for Service {
    fn drop(&mut self) {
        drop(self.messages.take());
        if let Some(thread) = self.thread.take()
            && thread.join().is_err()
        {
            tracing::error!("the messages to systemd have ended early");
        }
    }
}

/// Interval between messages, from the watchdog's interval that systemd demands.
fn interval() -> DurNs {
    let demanded = sd_notify::watchdog_enabled().and_then(|demanded| i64::try_from(demanded.as_nanos()).ok());
    demanded.map_or(LONGEST, |demanded| LONGEST.min(DurNs(demanded / PER_WATCHDOG)))
}

/// Sends messages as they come.
fn send_all(messages: &Receiver<Message>) {
    let mut is_failing = false;
    for message in messages {
        let sent = match &message {
            Message::Progress { is_first: true, status } => {
                sd_notify::notify(&[NotifyState::Ready, NotifyState::Watchdog, NotifyState::Status(status)])
            }
            Message::Progress { is_first: false, status } => {
                sd_notify::notify(&[NotifyState::Watchdog, NotifyState::Status(status)])
            }
            Message::Stopping => sd_notify::notify(&[NotifyState::Stopping]),
        };
        if let Err(error) = &sent
            && !is_failing
        {
            tracing::warn!(%error, "systemd can't be told the state of the dive; retrying");
        }
        is_failing = sent.is_err();
    }
}

#[cfg(test)]
mod tests {
    use std::io::ErrorKind;
    use std::os::unix::net::UnixDatagram;
    use std::process::{Child, Command};
    use std::time::Duration;

    use super::*;

    /// Environment variable that makes the test below act as the service. Its value is the number of ticks that the
    /// loop makes.
    const TICKS: &str = "HEADRACE_TEST_TICKS";
    /// Interval between the ticks of a loop.
    const TICK: DurNs = DurNs(20_000_000);

    /// The service of the other tests, which is a process of its own, because systemd addresses a process by its
    /// environment.
    #[test]
    fn service_makes_ticks_then_ends() {
        let Some(ticks) = std::env::var(TICKS).ok().and_then(|ticks| ticks.parse().ok()) else { return };
        let mut service = Service::start().unwrap().unwrap();
        for tick in 0_u64..ticks {
            let now = MonoNs(1) + DurNs(TICK.0 * tick as i64);
            service.progress(now, |recorded| format!("tick {tick}, fails {:?}", recorded.fails));
            service.recorded(&RecordingState { fails: Some(false), ..RecordingState::default() });
            // The ticks of the test follow each other quickly, and a full queue would lose messages. The pause prevents
            // this.
            thread::sleep(Duration::from_millis(2));
        }
        service.ending();
    }

    fn socket(name: &str) -> (UnixDatagram, std::path::PathBuf) {
        let path = std::env::temp_dir().join(format!("headrace-{name}-{}", std::process::id()));
        std::fs::remove_file(&path).ok();
        let socket = UnixDatagram::bind(&path).unwrap();
        socket.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
        (socket, path)
    }

    fn service(ticks: u64, path: &std::path::Path, watchdog_us: Option<u64>) -> Child {
        let mut command = Command::new(std::env::current_exe().unwrap());
        command.args(["--exact", "service::tests::service_makes_ticks_then_ends"]);
        command.env(TICKS, ticks.to_string()).env(SOCKET, path).stdout(std::process::Stdio::null());
        if let Some(watchdog_us) = watchdog_us {
            command.env("WATCHDOG_USEC", watchdog_us.to_string());
        }
        command.spawn().unwrap()
    }

    /// The messages of a service that makes this number of ticks.
    fn messages(name: &str, ticks: u64, watchdog_us: Option<u64>) -> Vec<String> {
        let (socket, path) = socket(name);
        let mut child = service(ticks, &path, watchdog_us);
        let mut messages = Vec::new();
        let mut bytes = [0; 4096];
        loop {
            let length = socket.recv(&mut bytes).unwrap();
            let message = String::from_utf8(bytes[..length].to_vec()).unwrap();
            let is_last = message == "STOPPING=1\n";
            messages.push(message);
            if is_last {
                break;
            }
        }
        assert!(child.wait().unwrap().success());
        std::fs::remove_file(path).unwrap();
        socket.set_nonblocking(true).unwrap();
        assert_eq!(socket.recv(&mut bytes).unwrap_err().kind(), ErrorKind::WouldBlock);
        messages
    }

    #[test]
    fn first_tick_is_readiness_and_each_second_of_ticks_is_progress() {
        assert_eq!(
            messages("ready", 101, None),
            [
                "READY=1\nWATCHDOG=1\nSTATUS=tick 0, fails None\n",
                "WATCHDOG=1\nSTATUS=tick 50, fails Some(false)\n",
                "WATCHDOG=1\nSTATUS=tick 100, fails Some(false)\n",
                "STOPPING=1\n",
            ]
        );
    }

    #[test]
    fn watchdog_of_two_seconds_is_fed_every_half_second() {
        let sent = messages("watchdog", 101, Some(2_000_000));
        assert_eq!(sent.len(), 6, "{sent:?}");
        assert!(sent[..5].iter().all(|message| message.contains("WATCHDOG=1\n")), "{sent:?}");
    }

    #[test]
    fn loop_without_ticks_is_never_ready_and_feeds_no_watchdog() {
        assert_eq!(messages("hung", 0, Some(2_000_000)), ["STOPPING=1\n"]);
    }
}
