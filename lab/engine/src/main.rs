//! `headrace-campaign`: see `docs/how-to/replay-many-dives.md`.

mod cli;

use std::process::ExitCode;

use clap::Parser as _;

fn main() -> ExitCode {
    let arguments = cli::Arguments::parse();
    match cli::run(&arguments) {
        Ok(code) => ExitCode::from(code),
        Err(error) => {
            eprintln!("headrace-campaign: {error}");
            ExitCode::from(cli::exit_code(&error))
        }
    }
}
