//! The examples at the end of each command's help do what they say.

use std::collections::BTreeMap;
use std::path::Path;

use tempfile::TempDir;

use crate::guide::{scratch, surgescope};

/// Every command, as one types it.
fn commands(folder: &Path, command: &[&str]) -> Vec<Vec<String>> {
    let help = String::from_utf8(surgescope(folder, &[command, &["--help"]].concat()).stdout).unwrap();
    let listed = help.lines().take_while(|l| *l != "Options:").filter_map(|l| l.strip_prefix("  "));
    let names = listed.filter(|l| l.starts_with(|c: char| c.is_ascii_lowercase()));
    let mut found = Vec::new();
    for name in names.filter_map(|l| l.split(' ').next()).filter(|name| command.is_empty() || *name != "help") {
        let path = [command, &[name]].concat();
        found.push(path.iter().map(|word| (*word).to_owned()).collect());
        found.extend(commands(folder, &path));
    }
    found
}

/// The lines below `Examples:` at the end of a command's help, and those that it says to run first.
fn examples(folder: &Path, command: &[String]) -> (Vec<String>, Vec<String>) {
    let words: Vec<&str> = command.iter().map(String::as_str).chain(["--help"]).collect();
    let help = String::from_utf8(surgescope(folder, &words).stdout).unwrap();
    let (before, end) = help.split_once("\nExamples:\n").unwrap_or_else(|| panic!("{command:?} has no examples"));
    let first = before.split_once("\nFirst:\n").map_or("", |(_, first)| first);
    let lines = |text: &str| text.lines().map(|line| line.trim().to_owned()).collect();
    (lines(end), lines(first))
}

/// Runs a line of a help.
fn run(folder: &Path, line: &str) {
    let words: Vec<&str> = line.split(' ').collect();
    assert_eq!(words[0], "surgescope", "{line}");
    let began = std::time::Instant::now();
    let output = surgescope(folder, &words[1..]);
    eprintln!("{:>6.1} s  {:?}  {line}", began.elapsed().as_secs_f64(), output.status.code());
    assert!(output.status.success(), "{line}\n{}", String::from_utf8_lossy(&output.stderr));
}

/// Nothing else has been run in the folder than what the help says to run first.
#[test]
#[ignore = "takes 60 s; CI runs it at night"]
fn every_help_ends_with_two_examples_that_run() {
    let mut folders: BTreeMap<Vec<String>, TempDir> = BTreeMap::new();
    let ships = scratch();
    let all = commands(ships.path(), &[]);
    assert!(all.len() > 30, "{all:?}");
    for command in all {
        let (examples, first) = examples(ships.path(), &command);
        assert_eq!(examples.len(), 2, "{command:?}: {examples:?}");
        let folder = folders.entry(first).or_insert_with_key(|first| {
            let folder = scratch();
            first.iter().for_each(|line| run(folder.path(), line));
            folder
        });
        for example in examples {
            let words: Vec<&str> = example.split(' ').collect();
            assert_eq!(words[1..=command.len()], command[..], "{example} is of its command");
            run(folder.path(), &example);
        }
    }
}
