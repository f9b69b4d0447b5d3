//! Ctrl-C and termination: a dive ends in good order.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use signal_hook::consts::{SIGINT, SIGTERM};

use crate::failure::Failure;

/// A flag set by SIGINT or SIGTERM; a second signal ends the program at once.
pub(crate) fn flag() -> Result<Arc<AtomicBool>, Failure> {
    let failed = |source| Failure::System { what: "installing the signal handlers", source };
    let flag = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM] {
        signal_hook::flag::register_conditional_shutdown(signal, 1, Arc::clone(&flag)).map_err(failed)?;
        signal_hook::flag::register(signal, Arc::clone(&flag)).map_err(failed)?;
    }
    Ok(flag)
}
