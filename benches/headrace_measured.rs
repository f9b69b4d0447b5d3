//! The program whose replays are measured: this package's own build of it.

use std::process::ExitCode;

fn main() -> ExitCode {
    headrace::main()
}
