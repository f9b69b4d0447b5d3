//! The program under test. It is built as a binary of this package, because Cargo gives tests only the binaries of
//! their own package.

use std::process::ExitCode;

fn main() -> ExitCode {
    headrace::main()
}
