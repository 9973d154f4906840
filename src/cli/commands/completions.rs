//! `surgescope completions`: what a shell needs to complete commands and options.

use clap::Command;
use clap_complete::Shell;
use serde_json::json;

use crate::cli::console::document::say_document;
use crate::cli::console::outcome::{CommandResult, Outcome};
use crate::cli::console::print::say_text;

/// Print what a shell needs to complete commands and options with Tab.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The shell.
    shell: Shell,
}

/// Runs it.
///
/// # Errors
/// Standard output that cannot be written.
pub fn run(args: &Args, mut command: Command, json: bool) -> CommandResult {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut command, env!("CARGO_PKG_NAME"), &mut script);
    let script = String::from_utf8(script)?;
    if json {
        say_document(json!({ "shell": args.shell.to_string(), "script": script }))?;
    } else {
        say_text!(script);
    }
    Ok(Outcome::Done)
}
