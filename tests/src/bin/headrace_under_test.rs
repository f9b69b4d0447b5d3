//! The program under test: the package's own build of it, since only binaries of this package are built for its tests.

use std::process::ExitCode;

fn main() -> ExitCode {
    headrace::main()
}
