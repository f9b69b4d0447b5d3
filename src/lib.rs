//! The `headrace` command as a library: command line and configuration.
//!
//! Other crates do the work. A custom binary calls only [`main`].

mod calibrate;
mod check;
mod cli;
mod commands;
mod deliver;
mod dive;
mod dives;
mod emulate;
mod expect;
mod explain;
mod export;
mod external_commands;
mod failure;
mod feeds;
mod files;
mod follower;
mod followers;
#[cfg(feature = "foxglove")]
mod foxglove_live;
pub mod import;
mod interrupt;
mod interruption;
mod inventory;
mod keyboard;
mod live;
mod logging;
mod manual;
mod mavlink_out;
mod memory;
mod notes;
mod other_targets;
mod output;
mod outputs;
mod page;
mod phase;
mod plan;
mod play;
mod printer;
mod progress;
mod recording_state;
mod recordings;
mod recover;
mod report_output;
mod resume;
mod screen;
mod sensor_lines;
mod service;
mod setup;
mod simulate;
mod smooth;
mod summary;
mod terminal;
mod trim;
mod tui;
mod tunnel_option;
mod vehicle_file;
mod verify;
mod watch;

use std::io::IsTerminal as _;
use std::process::ExitCode;

use clap::{ColorChoice, CommandFactory as _, FromArgMatches as _};

pub use recordings::InRecordings;

use cli::{Cli, Command};

/// Parses the command line and runs the command.
///
/// Returns the exit code. 0: success. 1: the command failed, or results differ. 2: a file or an argument is
/// wrong. 3: the command finished, but data was lost. 4: the replay differs from the dive.
pub fn main() -> ExitCode {
    let cli = parse();
    logging::start(&cli.verbosity);
    if matches!(cli.command, Command::Run(_) | Command::Demo(_)) {
        logging::never_wait();
    }
    terminal::be_quiet(cli.verbosity.is_quiet());
    terminal::be_verbose(cli.verbosity.is_verbose());
    // A command fails if its output is lost, with two exceptions: a dive never fails for this reason, and no command
    // fails because its terminal was closed.
    let needs_output = !matches!(cli.command, Command::Run(_)) && !std::io::stdout().is_terminal();
    let result = match cli.command {
        Command::Demo(demo) => commands::demo(&demo),
        Command::Run(run) => commands::run(&run),
        Command::Replay(replay) => commands::replay(&replay),
        Command::Export(args) => export::export(&args),
        Command::Deliver(args) => deliver::deliver(&args),
        Command::Dives(args) => dives::dives(&args),
        Command::Notes(args) => notes::notes(&args),
        Command::Verify(args) => verify::verify(&args),
        Command::Recover(args) => recover::recover(&args),
        Command::Trim(args) => trim::trim(&args),
        Command::Simulate(simulate) => simulate::simulate(&simulate),
        Command::Import(args) => import::import(&args),
        Command::Cost(args) => external_commands::run(&external_commands::COST, None, &args),
        Command::Plan(args) => plan::plan(&args),
        Command::Calibrate(args) => calibrate::calibrate(&args),
        Command::Emulate(args) => emulate::emulate(&args),
        Command::Devices(args) => inventory::devices(&args),
        Command::Check(args) => check::check(&args),
        Command::Setup(args) => setup::setup(&args),
        Command::Campaign(args) => external_commands::run(&external_commands::CAMPAIGN, None, &args),
        Command::Batch(args) => external_commands::run(&external_commands::CAMPAIGN, Some("--batch"), &args),
        Command::Completions(args) => manual::completions(&args),
        Command::Man(args) => manual::man(&args),
    };
    tracing::info!(most_kib = memory::most_kib(), "memory at the most");
    let code = result.unwrap_or_else(|failure| {
        for line in failure.lines() {
            logging::complain(&format!("headrace: {line}"));
        }
        failure.exit_code()
    });
    let code = if needs_output { with_output(code) } else { code };
    logging::end();
    ExitCode::from(code)
}

/// Exit code of a command with essential output: 1 instead of 0 if some output couldn't be written.
fn with_output(code: u8) -> u8 {
    let Some(why) = output::lost() else { return code };
    logging::complain(&format!("headrace: {why}"));
    if code == failure::OK { failure::FAILED } else { code }
}

/// Parses the command line. After help or an error, the program ends.
fn parse() -> Cli {
    let colour = if terminal::allows_colour() { ColorChoice::Auto } else { ColorChoice::Never };
    let matches = Cli::command().color(colour).try_get_matches();
    matches.and_then(|matches| Cli::from_arg_matches(&matches)).unwrap_or_else(|error| end_with(&error))
}

/// Ends the program with an error of the command line, or with the requested help.
fn end_with(answer: &clap::Error) -> ! {
    if answer.use_stderr() {
        answer.exit();
    }
    let code = output::deliver_help(answer).map_or_else(
        |failure| {
            logging::complain(&format!("headrace: {failure}"));
            failure.exit_code()
        },
        |()| failure::OK,
    );
    std::process::exit(code.into())
}
