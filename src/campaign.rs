//! `headrace campaign` and `headrace batch`: done by a program of its own, so that this one stays without an engine.

use std::ffi::OsStr;
use std::io::ErrorKind;
use std::path::PathBuf;
use std::process::Command;

use crate::cli::Campaign;
use crate::failure::{self, Failure};

const PROGRAM: &str = "headrace-campaign";

/// Runs `headrace-campaign`, beside this program or on PATH, with the arguments; returns its exit code.
pub(crate) fn campaign(args: &Campaign, first: Option<&str>) -> Result<u8, Failure> {
    let beside = std::env::current_exe().ok().map(|own| own.with_file_name(PROGRAM));
    let beside = beside.filter(|path| path.is_file());
    let program = beside.clone().unwrap_or_else(|| PathBuf::from(PROGRAM));
    let arguments = first.map(OsStr::new).into_iter().chain(args.arguments.iter().map(OsStr::new));
    match Command::new(&program).args(arguments).status() {
        // Ended by a signal.
        Ok(status) => Ok(status.code().and_then(|code| u8::try_from(code).ok()).unwrap_or(failure::FAILED)),
        Err(error) if error.kind() == ErrorKind::NotFound => Err(Failure::Usage(format!(
            "{PROGRAM} is neither beside this program nor on PATH; build it with: cd campaign && cargo build --release"
        ))),
        Err(source) => Err(Failure::System { what: "running headrace-campaign", source }),
    }
}
