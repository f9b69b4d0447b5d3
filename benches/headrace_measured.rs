//! The program whose replays are timed: this package's own build of it.

use std::process::ExitCode;

fn main() -> ExitCode {
    headrace::main()
}
