//! The examples at the end of each command's help do what they say.

use std::path::Path;

use crate::guide::{scratch, surgescope};

/// Commands whose examples write what others read, in this order.
const FIRST: [&str; 6] = ["demo", "record", "export", "calibrate", "creep", "watch"];

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

/// The lines below `Examples:` at the end of a command's help.
fn examples(folder: &Path, command: &[String]) -> Vec<String> {
    let words: Vec<&str> = command.iter().map(String::as_str).chain(["--help"]).collect();
    let help = String::from_utf8(surgescope(folder, &words).stdout).unwrap();
    let (_, end) = help.split_once("\nExamples:\n").unwrap_or_else(|| panic!("{command:?} has no examples"));
    end.lines().map(|line| line.trim().to_owned()).collect()
}

#[test]
fn every_help_ends_with_two_examples_that_run() {
    let folder = scratch();
    for (name, degc, tau1_s) in [("cold", "15.0", "0.181"), ("warm", "30.0", "0.0525")] {
        let rig = std::fs::read_to_string(folder.path().join("rigs/demo-hdpe.toml")).unwrap();
        let rig: String = rig
            .lines()
            .map(|l| {
                if l.starts_with("temperature_degC") {
                    format!("temperature_degC = {degc}\n")
                } else {
                    format!("{l}\n")
                }
            })
            .collect();
        std::fs::write(folder.path().join("rig.toml"), rig).unwrap();
        let test = format!(
            "record --rig rig.toml --simulate --speed 0 --rate 200 --duration 6 --effects viscoelastic-wall:1 --set J1_per_GPa=0.12 \
             tau1_s={tau1_s} -o {name}.mcap"
        );
        let output = surgescope(folder.path(), &test.split(' ').collect::<Vec<_>>());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    }
    let mut all = commands(folder.path(), &[]);
    assert!(all.len() > 30, "{all:?}");
    all.sort_by_key(|c| FIRST.iter().position(|first| *first == c[0]).unwrap_or(FIRST.len()));
    for command in all {
        let examples = examples(folder.path(), &command);
        assert_eq!(examples.len(), 2, "{command:?}: {examples:?}");
        for example in examples {
            let words: Vec<&str> = example.split(' ').collect();
            assert_eq!(words[0], "surgescope", "{example}");
            assert_eq!(words[1..=command.len()], command[..], "{example} is of its command");
            let began = std::time::Instant::now();
            let output = surgescope(folder.path(), &words[1..]);
            let said = String::from_utf8_lossy(&output.stderr).into_owned();
            eprintln!("{:>6.1} s  {:?}  {example}", began.elapsed().as_secs_f64(), output.status.code());
            assert!(output.status.success(), "{example}\n{said}");
        }
    }
}
