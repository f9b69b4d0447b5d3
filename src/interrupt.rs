//! Signals: a dive ends in good order, and nothing else ends it.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

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

fn ending() -> Result<Arc<AtomicBool>, Failure> {
    let flag = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM] {
        signal_hook::flag::register_conditional_shutdown(signal, 1, Arc::clone(&flag)).map_err(failed)?;
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
