//! The `surgescope` program: parse, dispatch, exit code.

use std::process::ExitCode;

fn main() -> ExitCode {
    let arguments: Vec<_> = std::env::args_os().collect();
    ExitCode::from(surgescope::cli::run(&arguments))
}
