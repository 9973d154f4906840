//! The `surgescope` program: parse, dispatch, exit code.

use std::process::ExitCode;

fn main() -> ExitCode {
    surgescope::cli::main()
}
