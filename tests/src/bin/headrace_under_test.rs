//! Builds the program as a binary of this package, since tests only get binaries of their own package.

use std::process::ExitCode;

fn main() -> ExitCode {
    headrace::main()
}
