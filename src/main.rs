//! The `headrace` binary.
fn main() -> std::process::ExitCode {
    headrace::main()
}
