//! The house rules of the source tree: imports point down, and no file grows beyond what fits in a head.

use std::fs;
use std::path::{Path, PathBuf};

/// The rooms from the cellar up. A room may use what stands before it, with the exceptions below.
const ROOMS: [&str; 22] = [
    "units",
    "robust",
    "rig",
    "recording",
    "signal",
    "align",
    "model",
    "sensitivity",
    "fit",
    "valve",
    "creep",
    "temperature",
    "diagnose",
    "storage",
    "record",
    "simulate",
    "results",
    "study",
    "report",
    "replay",
    "watch",
    "cli",
];

/// Arrows down that are forbidden all the same. That the physics knows no file, clock or wire follows from its package.
const STRANGERS: [(&str, &[&str]); 3] = [
    ("storage", &["signal", "model", "fit", "diagnose"]),
    ("record", &["model", "fit", "diagnose"]),
    ("report", &["storage", "record"]),
];

fn sources() -> Vec<PathBuf> {
    fn walk(folder: &Path, found: &mut Vec<PathBuf>) {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                walk(&path, found);
            } else if path.extension().is_some_and(|e| e == "rs") {
                found.push(path);
            }
        }
    }
    let mut found = Vec::new();
    walk(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src"), &mut found);
    found
}

fn room(path: &Path) -> String {
    let inside = path.strip_prefix(Path::new(env!("CARGO_MANIFEST_DIR")).join("src")).unwrap();
    let inside = inside.strip_prefix("core").unwrap_or(inside);
    inside.iter().next().unwrap().to_string_lossy().trim_end_matches(".rs").to_owned()
}

/// The rooms named after `crate::` in a line of code.
fn named(line: &str) -> Vec<String> {
    line.split("crate::")
        .skip(1)
        .flat_map(|rest| {
            let list = rest.strip_prefix('{').map_or(rest, |inside| inside.split('}').next().unwrap_or(inside));
            let many = rest.starts_with('{');
            let names = if many { list.split(',').collect::<Vec<_>>() } else { vec![list] };
            names
                .into_iter()
                .map(|n| n.trim().chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>())
                .collect::<Vec<_>>()
        })
        .collect()
}

#[test]
fn imports_point_down() {
    let place = |name: &str| ROOMS.iter().position(|r| *r == name);
    let mut arrows = 0;
    for path in sources() {
        let own = room(&path);
        let Some(own_place) = place(&own) else {
            assert!(["lib", "main"].contains(&own.as_str()), "{} stands in no room of ROOMS", path.display());
            continue;
        };
        let text = fs::read_to_string(&path).unwrap();
        for (number, line) in text.lines().enumerate().filter(|(_, l)| !l.trim_start().starts_with("//")) {
            for target in named(line) {
                let Some(target_place) = place(&target) else { continue };
                arrows += 1;
                let at = format!("{}:{}: {}", path.display(), number + 1, line.trim());
                assert!(target_place <= own_place, "an arrow runs up, from {own} to {target}: {at}");
                let forbidden = STRANGERS.iter().any(|(from, to)| *from == own && to.contains(&target.as_str()));
                assert!(!forbidden, "{own} must not know {target}: {at}");
            }
        }
    }
    assert!(arrows > 50, "only {arrows} imports found: the test no longer reads them");
}

#[test]
fn the_physics_sees_no_clock_file_or_runtime() {
    for path in sources().iter().filter(|p| ["signal", "model", "sensitivity", "fit"].contains(&room(p).as_str())) {
        let text = fs::read_to_string(path).unwrap();
        let code = text.split("#[cfg(test)]").next().unwrap();
        for word in ["std::fs", "std::time", "tokio", "Instant", "SystemTime"] {
            assert!(!code.contains(word), "{} uses {word}", path.display());
        }
    }
}

/// `println!` and its kin panic where nobody reads any more, in the middle of a recording.
#[test]
fn nothing_prints_but_by_the_macros_of_the_command_line() {
    for path in sources() {
        let text = fs::read_to_string(&path).unwrap();
        for (number, line) in text.lines().enumerate().filter(|(_, l)| !l.trim_start().starts_with("//")) {
            for word in ["print!(", "println!(", "dbg!("] {
                assert!(!line.contains(word), "{}:{}: {word} may panic: say!, tell!", path.display(), number + 1);
            }
        }
    }
}

#[test]
fn files_fit_in_a_head() {
    for path in sources() {
        let lines = fs::read_to_string(&path).unwrap().lines().count();
        assert!(lines <= 550, "{} has {lines} lines: does it still hold one idea?", path.display());
    }
}
