//! Signals: a dive ends in good order, and nothing else ends it.

use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use signal_hook::consts::{
    SIGALRM, SIGHUP, SIGINT, SIGTERM, SIGTSTP, SIGUSR1, SIGUSR2, SIGVTALRM, SIGXCPU, SIGXFSZ,
};

use crate::failure::Failure;

/// What would end or stop the program by default and says nothing about a dive: a terminal that was closed (whoever loses his
/// connection must not lose the dive), Ctrl-Z, limits, timers and signals of one's own. A write beyond the limit of file sizes
/// is then an error like that of a full disk.
const PASSED_OVER: [i32; 8] = [SIGHUP, SIGTSTP, SIGUSR1, SIGUSR2, SIGXFSZ, SIGXCPU, SIGALRM, SIGVTALRM];

/// A flag set by SIGINT, SIGTERM or a closed terminal; a second SIGINT or SIGTERM ends the program at once.
pub(crate) fn flag() -> Result<Arc<AtomicBool>, Failure> {
    let flag = ending()?;
    on(SIGHUP, &flag)?;
    // For what is recorded from a log or a simulation.
    on(SIGXFSZ, &Arc::default())?;
    Ok(flag)
}

/// The same for a dive on ports, which goes on without a terminal.
pub(crate) fn flag_of_a_dive() -> Result<Arc<AtomicBool>, Failure> {
    let flag = ending()?;
    for signal in PASSED_OVER {
        on(signal, &Arc::default())?;
    }
    Ok(flag)
}

/// Who puts the terminal in order before a second signal ends the program.
static LEFT_TO_KEYS: AtomicBool = AtomicBool::new(false);

/// From now on a second SIGINT or SIGTERM doesn't end the program: whoever reads [`seconds`] does.
pub(crate) fn leave_second_to_keys() {
    LEFT_TO_KEYS.store(true, Ordering::Relaxed);
}

/// A byte for every SIGINT and SIGTERM.
pub(crate) fn seconds() -> std::io::Result<UnixStream> {
    let (read, write) = UnixStream::pair()?;
    signal_hook::low_level::pipe::register(SIGINT, write.try_clone()?)?;
    signal_hook::low_level::pipe::register(SIGTERM, write)?;
    Ok(read)
}

fn ending() -> Result<Arc<AtomicBool>, Failure> {
    let flag = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM] {
        if !LEFT_TO_KEYS.load(Ordering::Relaxed) {
            signal_hook::flag::register_conditional_shutdown(signal, 1, Arc::clone(&flag)).map_err(failed)?;
        }
        on(signal, &flag)?;
    }
    Ok(flag)
}

fn on(signal: i32, flag: &Arc<AtomicBool>) -> Result<(), Failure> {
    signal_hook::flag::register(signal, Arc::clone(flag)).map(|_| ()).map_err(failed)
}

fn failed(source: std::io::Error) -> Failure {
    Failure::System { what: "installing the signal handlers", source }
}
