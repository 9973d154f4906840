//! `surgescope man`: a manual page for each command.

use std::path::PathBuf;

use clap::Command;
use clap_mangen::Man;
use serde_json::json;

use crate::cli::console::document::say_document;
use crate::cli::console::outcome::{CommandResult, Outcome};
use crate::cli::console::print::say;
use crate::shown::Shown as _;
use crate::storage::output;
use crate::storage::sink::program;

/// Write a manual page for each command.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder for the pages; it is made where it does not exist.
    folder: PathBuf,
    /// Replace existing pages.
    #[arg(long)]
    overwrite: bool,
}

/// Runs it.
///
/// # Errors
/// A folder that cannot be made or written, a page that exists already.
pub fn run(args: &Args, command: Command, json: bool) -> CommandResult {
    let folder = args.folder.shown();
    std::fs::create_dir_all(&args.folder).map_err(|e| format!("cannot make the folder {folder}: {e}"))?;
    let mut pages = Vec::new();
    // `help` explains what these pages explain: it needs none.
    let mut command = command.mut_subcommand("help", |help| help.hide(true));
    command.build();
    add_pages(command, &mut pages)?;
    // All or none: no folder is left with pages of two versions.
    for (name, _) in &pages {
        output::check_new(&args.folder.join(name), args.overwrite)?;
    }
    for (name, page) in &pages {
        output::write_new(&args.folder.join(name), page, args.overwrite)?;
    }
    if json {
        let names: Vec<&String> = pages.iter().map(|(name, _)| name).collect();
        say_document(json!({ "folder": args.folder, "pages": names }))?;
    } else {
        say!("{} manual pages in {folder}; read one with `man -l {folder}/{}`", pages.len(), pages[0].0);
    }
    Ok(Outcome::Done)
}

/// File name and text of the page of a command, and of all below it.
fn add_pages(
    command: Command,
    pages: &mut Vec<(String, String)>,
) -> Result<(), Box<dyn std::error::Error + Send + Sync>> {
    let below: Vec<Command> = command.get_subcommands().filter(|c| !c.is_hide_set()).cloned().collect();
    let page = Man::new(command).source(program()).manual("surgescope");
    let mut text = Vec::new();
    page.render(&mut text)?;
    pages.push((page.get_filename(), String::from_utf8(text)?));
    below.into_iter().try_for_each(|command| add_pages(command, pages))
}
