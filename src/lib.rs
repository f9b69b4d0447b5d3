//! The `headrace` command as a library: command line, configuration, list of device kinds. The work is done in the other
//! crates; a binary of its own only calls [`main`].

mod calibrate;
mod cli;
mod commands;
pub mod devices;
mod dive;
mod emulate;
mod expect;
mod failure;
mod files;
pub mod import;
mod inventory;
mod live;
mod logging;
mod output;
mod phase;
mod plan;
mod play;
mod printer;
mod progress;
mod recover;
mod report_output;
mod screen;
mod simulate;
mod smooth;
mod summary;
mod transient;
mod trim;
mod vehicle_file;
mod verify;
mod watch;

use std::process::ExitCode;

use clap::Parser;

use cli::{Cli, Command};

/// Parses the command line and runs the command.
///
/// Returns the exit code: 0 success, 1 failed or differs, 2 wrong file or argument, 3 finished but data was lost, 4 the
/// replay differs from the dive.
pub fn main() -> ExitCode {
    let cli = Cli::parse();
    logging::start(&cli.verbosity);
    let result = match cli.command {
        Command::Demo(demo) => commands::demo(&demo),
        Command::Run(run) => commands::run(&run),
        Command::Replay(replay) => commands::replay(&replay),
        Command::Verify(args) => verify::verify(&args),
        Command::Recover(args) => recover::recover(&args),
        Command::Trim(args) => trim::trim(&args),
        Command::Simulate(simulate) => simulate::simulate(&simulate),
        Command::Import(args) => import::import(&args),
        Command::Plan(args) => plan::plan(&args),
        Command::Calibrate(args) => calibrate::calibrate(&args),
        Command::Emulate(args) => emulate::emulate(&args),
        Command::Devices(args) => inventory::devices(&args),
        Command::Check(check) => commands::check(&check),
    };
    match result {
        Ok(code) => ExitCode::from(code),
        Err(failure) => {
            eprintln!("headrace: {failure}");
            ExitCode::from(failure.exit_code())
        }
    }
}
