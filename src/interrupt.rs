//! Handles signals, so that a dive ends in an orderly way and only on request.

use std::io::Read as _;
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use signal_hook::consts::{
    SIGALRM, SIGHUP, SIGINT, SIGTERM, SIGTSTP, SIGUSR1, SIGUSR2, SIGVTALRM, SIGXCPU, SIGXFSZ,
};

use crate::failure::Failure;

/// Signals that would end or stop the program by default, but must not affect a dive.
///
/// They come from a closed terminal (a lost connection must not end the dive), Ctrl-Z, limits, timers and
/// users. A write beyond the limit of file sizes is then an ordinary error, like a full disk.
const PASSED_OVER: [i32; 8] = [SIGHUP, SIGTSTP, SIGUSR1, SIGUSR2, SIGXFSZ, SIGXCPU, SIGALRM, SIGVTALRM];

/// Time within which several requests to end the program count as one.
///
/// `timeout -s INT` signals the program and then its process group, and a key that is held down repeats.
const ONE_REQUEST: Duration = Duration::from_secs(1);
/// Stack size of the thread that waits for signals. The thread has no deep calls.
const STACK_BYTES: usize = 64 << 10;

/// Distinguishes a second request to end the program from a repetition of the first.
#[derive(Debug, Default)]
pub(crate) struct Requests {
    first: Option<Instant>,
}

impl Requests {
    /// Counts a request to end the program that arrives now. Returns whether it is a second request, rather than a
    /// repetition of the first.
    #[expect(clippy::disallowed_methods, reason = "how long somebody waits to ask again is wall time")]
    pub(crate) fn is_second_now(&mut self) -> bool {
        self.is_second(Instant::now())
    }

    /// Counts a request to end the program at the time `now`. Returns true for a second request, which ends
    /// the program at once.
    fn is_second(&mut self, now: Instant) -> bool {
        now.duration_since(*self.first.get_or_insert(now)) >= ONE_REQUEST
    }
}

/// Flag set by SIGINT, SIGTERM or a closed terminal.
///
/// A second SIGINT or SIGTERM, over a second later, ends the program at once.
pub(crate) fn flag() -> Result<Arc<AtomicBool>, Failure> {
    let flag = ending()?;
    on(SIGHUP, &flag)?;
    // Without a handler of SIGXFSZ, a write beyond the limit of file sizes would end the program. The handler is also
    // needed for a dive from a log or a simulation.
    on(SIGXFSZ, &Arc::default())?;
    Ok(flag)
}

/// Flag set by SIGINT or SIGTERM, for a dive on ports. Such a dive continues without a terminal.
pub(crate) fn flag_of_a_dive() -> Result<Arc<AtomicBool>, Failure> {
    let flag = ending()?;
    for signal in PASSED_OVER {
        on(signal, &Arc::default())?;
    }
    Ok(flag)
}

/// Whether the thread that reads keys handles a second signal. That thread restores the terminal before the
/// program ends.
static LEFT_TO_KEYS: AtomicBool = AtomicBool::new(false);

/// Leaves a second SIGINT or SIGTERM to the thread that reads the stream which [`seconds`] creates. That thread ends
/// the program.
pub(crate) fn leave_second_to_keys() {
    LEFT_TO_KEYS.store(true, Ordering::Relaxed);
}

/// Creates a stream that receives a byte for every SIGINT and SIGTERM.
pub(crate) fn seconds() -> std::io::Result<UnixStream> {
    let (read, write) = UnixStream::pair()?;
    signal_hook::low_level::pipe::register(SIGINT, write.try_clone()?)?;
    signal_hook::low_level::pipe::register(SIGTERM, write)?;
    Ok(read)
}

fn ending() -> Result<Arc<AtomicBool>, Failure> {
    let flag = Arc::new(AtomicBool::new(false));
    let ends_at_once = Arc::new(AtomicBool::new(false));
    let is_ours = !LEFT_TO_KEYS.load(Ordering::Relaxed);
    for signal in [SIGINT, SIGTERM] {
        if is_ours {
            let armed = Arc::clone(&ends_at_once);
            signal_hook::flag::register_conditional_shutdown(signal, 1, armed).map_err(failed)?;
        }
        on(signal, &flag)?;
    }
    if is_ours {
        arm_later(ends_at_once)?;
    }
    Ok(flag)
}

/// Sets `armed` once repetitions of the first request have ended, so that another request to end the program counts as
/// a second one.
fn arm_later(armed: Arc<AtomicBool>) -> Result<(), Failure> {
    let mut signals = seconds().map_err(failed)?;
    let wait = move || {
        if signals.read_exact(&mut [0]).is_ok() {
            thread::sleep(ONE_REQUEST);
            armed.store(true, Ordering::Relaxed);
        }
    };
    let thread = thread::Builder::new().name("signals".to_owned()).stack_size(STACK_BYTES).spawn(wait);
    thread.map(drop).map_err(failed)
}

fn on(signal: i32, flag: &Arc<AtomicBool>) -> Result<(), Failure> {
    signal_hook::flag::register(signal, Arc::clone(flag)).map(|_| ()).map_err(failed)
}

fn failed(source: std::io::Error) -> Failure {
    Failure::System { what: "installing the signal handlers", source }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[expect(clippy::disallowed_methods, reason = "any moment will do")]
    fn stop_requests_within_a_second_count_as_one() {
        let (begun, mut requests) = (Instant::now(), Requests::default());
        let is_second = [0, 1, 300, 999, 1000, 1500]
            .map(|at_ms| requests.is_second(begun + Duration::from_millis(at_ms)));
        assert_eq!(is_second, [false, false, false, false, true, true]);
    }
}
