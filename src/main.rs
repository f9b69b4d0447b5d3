//! The `headrace` binary: command line, configuration, list of plugins; the work is done in the libraries.

mod calibrate;
mod cli;
mod commands;
mod devices;
mod dive;
mod emulate;
mod expect;
mod failure;
mod files;
mod import;
mod inventory;
mod live;
mod output;
mod plan;
mod play;
mod progress;
mod recover;
mod simulate;
mod smooth;
mod summary;
mod trim;
mod verify;
mod watch;

use std::process::ExitCode;

use clap::Parser;

use cli::{Cli, Command};

fn main() -> ExitCode {
    tracing_subscriber::fmt().with_writer(std::io::stderr).with_max_level(tracing::Level::WARN).init();
    let result = match Cli::parse().command {
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
