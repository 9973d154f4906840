//! The house rules of the source tree: imports point down, between rooms, between the floors of a room and between
//! files; no circles.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// The rooms from the cellar up. A room may use what stands before it, with the exceptions below.
const ROOMS: [&str; 35] = [
    "units",
    "interned",
    "number",
    "shown",
    "text_file",
    "robust",
    "extent",
    "golden",
    "wide",
    "product",
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
    "draft",
    "record",
    "own_host",
    "live",
    "simulate",
    "results",
    "study",
    "report",
    "replay",
    "watch",
    "campaign",
    "web",
    "cli",
];

/// The floors of the large rooms, from the lowest up.
const FLOORS: [(&str, &[&str]); 5] = [
    ("fit", &["numeric", "data", "problem", "outcome", "inference", "search", "posterior", "validate"]),
    ("record", &["wire", "clock", "devices", "health", "session"]),
    (
        "report",
        &[
            "text",
            "view",
            "svg",
            "html",
            "calibration",
            "diagnosis",
            "creep",
            "temperature",
            "history",
            "frequency",
            "sensitivity",
            "prediction",
            "pest",
        ],
    ),
    ("web", &["session", "view", "server"]),
    ("cli", &["console", "args", "commands"]),
];

/// Arrows down that are forbidden all the same. That the physics knows no file, clock or wire follows from its package.
const STRANGERS: [(&str, &[&str]); 3] = [
    ("storage", &["signal", "model", "fit", "diagnose"]),
    ("record", &["model", "fit", "diagnose"]),
    ("report", &["storage", "record"]),
];

type Module = Vec<String>;

/// A source file, without comments, strings and its tests.
struct File {
    path: PathBuf,
    code: String,
}

/// Both packages as one tree of modules: the names of their rooms are unique.
fn house() -> BTreeMap<Module, File> {
    fn walk(folder: &Path, module: &Module, found: &mut BTreeMap<Module, File>) {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let stem = path.file_stem().unwrap().to_string_lossy().into_owned();
            if path.is_dir() {
                let inner = if module.is_empty() && stem == "core" { module.clone() } else { child(module, &stem) };
                walk(&path, &inner, found);
            } else if path.extension().is_some_and(|e| e == "rs") && stem != "lib" && stem != "main" {
                let name = if stem == "mod" { module.clone() } else { child(module, &stem) };
                let code = without_tests(&plain(&fs::read_to_string(&path).unwrap()));
                found.insert(name, File { path, code });
            }
        }
    }
    let mut found = BTreeMap::new();
    walk(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src"), &Vec::new(), &mut found);
    found.retain(|module, _| {
        !module.iter().any(|part| part == "tests" || part.starts_with("test_") || part == "fixtures")
    });
    assert!(found.len() > 300, "only {} files found", found.len());
    found
}

fn child(module: &Module, name: &str) -> Module {
    module.iter().cloned().chain([name.to_owned()]).collect()
}

/// Code with comments and the contents of strings and characters blanked out.
fn plain(text: &str) -> String {
    let mut out = String::new();
    let mut rest = text;
    while let Some(first) = rest.chars().next() {
        let raw = rest.strip_prefix('r').map(|r| r.len() - r.trim_start_matches('#').len());
        let raw =
            raw.filter(|n| rest[1 + n..].starts_with('"') && !out.ends_with(|c: char| c.is_alphanumeric() || c == '_'));
        let end = if rest.starts_with("//") {
            rest.find('\n').unwrap_or(rest.len())
        } else if rest.starts_with("/*") {
            rest.find("*/").map_or(rest.len(), |i| i + 2)
        } else if let Some(hashes) = raw {
            let close = format!("\"{}", "#".repeat(hashes));
            rest[2 + hashes..].find(&close).map_or(rest.len(), |i| 2 + hashes + i + close.len())
        } else if first == '"' {
            let mut escaped = false;
            let close = |c: char| {
                let ends = c == '"' && !escaped;
                escaped = c == '\\' && !escaped;
                ends
            };
            rest[1..].find(close).map_or(rest.len(), |i| i + 2)
        } else if let Some(quoted) = rest.strip_prefix("'\\") {
            quoted[1..].find('\'').map_or(rest.len(), |i| i + 4)
        } else if first == '\'' && rest.chars().nth(2) == Some('\'') {
            rest.char_indices().nth(3).map_or(rest.len(), |(i, _)| i)
        } else {
            out.push(first);
            rest = &rest[first.len_utf8()..];
            continue;
        };
        out.push(' ');
        rest = &rest[end..];
    }
    out
}

/// Code without its inline modules of tests.
fn without_tests(code: &str) -> String {
    let mut out = String::new();
    let mut rest = code;
    while let Some(start) = rest.find("#[cfg(test)]") {
        out += &rest[..start];
        let after = &rest[start + "#[cfg(test)]".len()..];
        let (open, end) = (after.find('{'), after.find(';'));
        rest = match (open, end) {
            (Some(open), end) if end.is_none_or(|end| open < end) => {
                let mut depth = 0;
                let close = after[open..].find(|c| {
                    depth += i32::from(c == '{') - i32::from(c == '}');
                    depth == 0
                });
                &after[open + close.expect("braces are paired") + 1..]
            }
            (_, Some(end)) => &after[end + 1..],
            _ => "",
        };
    }
    out + rest
}

/// All paths of two parts and more in a piece of code; trees of `use` are taken apart.
fn paths(code: &str) -> Vec<Vec<String>> {
    let mut tokens = Vec::new();
    let mut rest = code;
    while let Some(c) = rest.chars().next() {
        let word = rest.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(rest.len());
        let length = if word > 0 {
            word
        } else if rest.starts_with("::") {
            2
        } else {
            c.len_utf8()
        };
        if !c.is_whitespace() {
            tokens.push(&rest[..length]);
        }
        rest = &rest[length..];
    }
    let name = |t: &str| t.starts_with(|c: char| c.is_alphabetic() || c == '_');
    let mut found = Vec::new();
    let mut at = 0;
    while at < tokens.len() {
        if name(tokens[at]) && (at == 0 || !["::", "."].contains(&tokens[at - 1])) && tokens.get(at + 1) == Some(&"::")
        {
            at = tree(&tokens, at, &[], &mut found);
        } else {
            at += 1;
        }
    }
    found
}

/// The paths of the tree that begins at a token; where it ends.
fn tree(tokens: &[&str], mut at: usize, before: &[String], found: &mut Vec<Vec<String>>) -> usize {
    let mut path = before.to_vec();
    while let Some(&token) = tokens.get(at) {
        match token {
            "{" if !path.is_empty() && tokens[at - 1] == "::" => {
                at += 1;
                while tokens.get(at).is_some_and(|&t| t != "}") {
                    at = if tokens[at] == "," { at + 1 } else { tree(tokens, at, &path, found).max(at + 1) };
                }
                return at + 1;
            }
            "::" => at += 1,
            "as" => at += 2,
            word if word.starts_with(|c: char| c.is_alphabetic() || c == '_')
                && (path.len() == before.len() || tokens[at - 1] == "::") =>
            {
                path.push(word.to_owned());
                at += 1;
            }
            _ => break,
        }
    }
    found.push(path);
    at
}

/// Who imports whom, with one of the paths that say so.
fn arrows(house: &BTreeMap<Module, File>) -> BTreeMap<&Module, BTreeMap<&Module, String>> {
    let mut found: BTreeMap<&Module, BTreeMap<&Module, String>> = BTreeMap::new();
    for (module, file) in house {
        for path in paths(&file.code) {
            let target = match path[0].as_str() {
                "crate" | "surgescope_core" => path[1..].to_vec(),
                "self" => [module, &path[1..]].concat(),
                "super" => {
                    let up = path.iter().take_while(|part| *part == "super").count();
                    [&module[..module.len().saturating_sub(up)], &path[up..]].concat()
                }
                first if house.contains_key(&child(module, first)) => [module, &path[..]].concat(),
                _ => continue,
            };
            let known = (1..=target.len()).rev().find_map(|n| house.get_key_value(&target[..n]));
            if let Some((target, _)) = known.filter(|(target, _)| *target != module) {
                found.entry(module).or_default().insert(target, path.join("::"));
            }
        }
    }
    let count: usize = found.values().map(BTreeMap::len).sum();
    assert!(count > 1000, "only {count} imports found: the test no longer reads them");
    found
}

fn at<'a>(house: &'a BTreeMap<Module, File>, module: &Module) -> std::path::Display<'a> {
    house[module].path.strip_prefix(env!("CARGO_MANIFEST_DIR")).unwrap().display()
}

#[test]
fn imports_point_down_between_rooms_and_floors() {
    let house = house();
    let mut wrong = Vec::new();
    for (from, targets) in arrows(&house) {
        for (to, path) in targets {
            let place = |room: &str| ROOMS.iter().position(|r| *r == room);
            let (Some(own), Some(other)) = (place(&from[0]), place(&to[0])) else {
                panic!("{} or {} stands in no room of ROOMS", at(&house, from), at(&house, to));
            };
            let forbidden = STRANGERS.iter().any(|(room, never)| *room == from[0] && never.contains(&to[0].as_str()));
            let floors = FLOORS.iter().find(|(room, _)| *room == from[0] && *room == to[0]).map(|(_, floors)| floors);
            let floor = |module: &Module| floors?.iter().position(|f| module.get(1).is_some_and(|part| part == f));
            let climbs = floor(from).zip(floor(to)).is_some_and(|(own, other)| other > own);
            if other > own || forbidden || climbs {
                wrong.push(format!("{}: {path}", at(&house, from)));
            }
        }
    }
    assert!(wrong.is_empty(), "{} imports point up, or at strangers:\n{}", wrong.len(), wrong.join("\n"));
}

#[test]
fn no_files_import_each_other_in_a_circle() {
    let house = house();
    let arrows = arrows(&house);
    let reached = |from| {
        let (mut seen, mut open): (BTreeSet<&Module>, Vec<&Module>) = (BTreeSet::new(), vec![from]);
        while let Some(module) = open.pop() {
            open.extend(
                arrows.get(module).into_iter().flat_map(BTreeMap::keys).copied().filter(|next| seen.insert(*next)),
            );
        }
        seen
    };
    let reach: BTreeMap<&Module, BTreeSet<&Module>> = house.keys().map(|module| (module, reached(module))).collect();
    let mut lines = Vec::new();
    for (from, targets) in &arrows {
        for (to, path) in targets.iter().filter(|(to, _)| reach[*to].contains(from)) {
            lines.push(format!("{} -> {}: {path}", at(&house, from), at(&house, to)));
        }
    }
    let files = reach.iter().filter(|(module, seen)| seen.contains(*module)).count();
    assert!(lines.is_empty(), "{files} files import each other in circles:\n{}", lines.join("\n"));
}

#[test]
fn every_floor_that_is_named_is_there() {
    let house = house();
    for (room, floors) in FLOORS {
        for floor in floors {
            let there = house.keys().any(|module| module.len() > 1 && module[0] == room && module[1] == *floor);
            assert!(there, "{room} has no floor {floor}: take it from FLOORS");
        }
    }
}

/// `println!` and its kin panic where nobody reads any more, in the middle of a recording.
#[test]
fn nothing_prints_but_by_the_macros_of_the_command_line() {
    for file in house().values() {
        for word in ["print!(", "println!(", "dbg!("] {
            let found = file.code.match_indices(word).any(|(i, _)| !file.code[..i].ends_with("e"));
            assert!(!found, "{}: {word} may panic: say!, tell!", file.path.display());
        }
        assert!(!file.code.contains("eprint"), "{}: eprint may panic: tell!", file.path.display());
    }
}

#[test]
fn the_test_reads_rust() {
    let code = "use crate::a::{b, c::{self, D as E}, *}; // use crate::no\nlet x = \"crate::no\"; super::f(g::h::<u8>()); 'x: loop {} '\\''; r#\"crate::no\"#";
    let mut found: Vec<String> = paths(&plain(code)).iter().map(|p| p.join("::")).collect();
    found.sort();
    assert_eq!(found, ["crate::a", "crate::a::b", "crate::a::c::D", "crate::a::c::self", "g::h", "super::f"]);
    let tests = "fn a() {}\n#[cfg(test)]\nmod tests { fn b() { {} } }\nfn c() {}";
    assert_eq!(without_tests(tests).split_whitespace().collect::<String>(), "fna(){}fnc(){}");
}

/// The library names settings (option `budget`); the command line alone knows their flags (`console/print.rs`). Whole
/// commands may be named, in backticks, where a file is written for people at a terminal.
#[test]
fn only_the_command_line_knows_its_flags() {
    let flag = |line: &str| {
        let code = line.split(" // ").next().unwrap_or(line);
        code.match_indices("--").any(|(at, _)| {
            let (before, after) = (&code[..at], &code[at + 2..]);
            after.starts_with(|c: char| c.is_ascii_lowercase()) && !before.ends_with(['-', '!', '<', '('])
        })
    };
    let mut found = Vec::new();
    for (module, file) in house() {
        if module[0] == "cli" || module[..2.min(module.len())] == ["report", "html"] {
            continue;
        }
        let text = fs::read_to_string(&file.path).unwrap();
        let code = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
        for line in code.lines() {
            let command = line.trim_start().starts_with("//") || line.contains("`surgescope ");
            if !command && flag(line) {
                found.push(format!("{}: {}", file.path.display(), line.trim()));
            }
        }
    }
    assert!(found.is_empty(), "flags are named outside of src/cli:\n{}", found.join("\n"));
}
