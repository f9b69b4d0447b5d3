//! Commands that programs of `lab/` provide, in the same way as git's subcommands. The program `headrace` itself thus
//! needs neither an SQL engine nor the reference computations of `headrace cost`.

use std::ffi::OsStr;
use std::io::ErrorKind;
use std::path::PathBuf;
use std::process::Command;

use crate::cli::ExternalArguments;
use crate::failure::{self, Failure};

/// A program of `lab/`, and the Cargo package from which it is built.
pub(crate) struct Program {
    name: &'static str,
    package: &'static str,
}

/// Program for `headrace campaign` and `headrace batch`.
pub(crate) const CAMPAIGN: Program = Program { name: "headrace-campaign", package: "headrace_campaign" };
/// Program for `headrace cost`.
pub(crate) const COST: Program = Program { name: "headrace-cost", package: "headrace_cost" };

/// Runs a program of `lab/` with `arguments` after `first`, and returns its exit code.
///
/// The program is searched for in three places: next to this one, in the build folder of `lab/` in the same clone, and
/// on PATH.
///
/// Errors: there is no such program, or it can't be started. If there is no such program, the error names the command
/// that builds it.
pub(crate) fn run(program: &Program, first: Option<&str>, args: &ExternalArguments) -> Result<u8, Failure> {
    let Program { name, package } = program;
    let own = std::env::current_exe().ok();
    let folder = own.as_deref().and_then(|own| own.parent());
    let built = folder.map(|folder| folder.join("../../lab/target/release").join(name));
    let places = [folder.map(|folder| folder.join(name)), built];
    let found = places.into_iter().flatten().find(|path| path.is_file());
    let arguments = first.map(OsStr::new).into_iter().chain(args.arguments.iter().map(OsStr::new));
    match Command::new(found.unwrap_or_else(|| PathBuf::from(name))).args(arguments).status() {
        // If a signal ended the program, it has no exit code.
        Ok(status) => Ok(status.code().and_then(|code| u8::try_from(code).ok()).unwrap_or(failure::FAILED)),
        Err(error) if error.kind() == ErrorKind::NotFound => Err(Failure::Usage(format!(
            "{name} is neither beside this program, nor in lab/target/release, nor on PATH; build it with: \
             cargo build --release --manifest-path lab/Cargo.toml -p {package}"
        ))),
        Err(source) => Err(Failure::System { what: "starting a program of lab/", source }),
    }
}
