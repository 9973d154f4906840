//! The guide and the README: the pages made from the program are what the program says now, every command that a page
//! shows ends as the page says, and every link leads somewhere.
//!
//! `SURGESCOPE_UPDATE_GUIDE=1 cargo test --test it guide` writes the pages made from the program anew.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::fs;
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use serde_json::Value;
use tempfile::TempDir;

const PROGRAM: &str = env!("CARGO_BIN_EXE_surgescope");

/// Pages whose commands are run, each by a test of its own so that they run side by side.
macro_rules! pages {
    ($($test:ident $page:literal)*) => {
        const RUN: &[&str] = &[$($page),*];
        $(#[test] fn $test() { run_page($page); })*
    };
}

pages! {
    readme "README.md"
    first_run "docs/src/first-run.md"
    rig "docs/src/rig.md"
    networks "docs/src/networks.md"
    recording "docs/src/recording.md"
    devices "docs/src/devices.md"
    importing "docs/src/importing.md"
    the_loop "docs/src/loop.md"
    diagnosis "docs/src/diagnosis.md"
    explain "docs/src/explain.md"
    own_effects "docs/src/own-effects.md"
    methods "docs/src/methods.md"
    trust "docs/src/trust.md"
    temperatures "docs/src/temperatures.md"
    sensitivity "docs/src/sensitivity.md"
    automation "docs/src/automation.md"
    rig_computer "docs/src/rig-computer.md"
    formats "docs/src/formats.md"
    installing "docs/src/installing.md"
    protocols "docs/src/protocols.md"
    physics "docs/src/physics.md"
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn read(path: impl AsRef<Path>) -> String {
    let path = root().join(path);
    fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// Every page of the guide, the README and CONTRIBUTING, as paths from the root.
fn all_pages() -> Vec<PathBuf> {
    fn walk(folder: &Path, found: &mut Vec<PathBuf>) {
        for entry in fs::read_dir(root().join(folder)).unwrap() {
            let path = folder.join(entry.unwrap().file_name());
            if root().join(&path).is_dir() {
                walk(&path, found);
            } else if path.extension().is_some_and(|e| e == "md") {
                found.push(path);
            }
        }
    }
    let mut found = vec!["README.md".into(), "CONTRIBUTING.md".into()];
    walk(Path::new("docs/src"), &mut found);
    found
}

/// A folder with copies of `rigs/` and `recordings/`, as the root of the repository has them.
pub(crate) fn scratch() -> TempDir {
    fn copy(from: &Path, to: &Path) {
        fs::create_dir(to).unwrap();
        for entry in fs::read_dir(from).unwrap() {
            let path = entry.unwrap().path();
            let copied = to.join(path.file_name().unwrap());
            if path.is_dir() { copy(&path, &copied) } else { fs::copy(&path, copied).map(drop).unwrap() }
        }
    }
    let folder = tempfile::tempdir().unwrap();
    for name in ["rigs", "recordings"] {
        copy(&root().join(name), &folder.path().join(name));
    }
    folder
}

pub(crate) fn surgescope(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(PROGRAM);
    command.args(arguments).current_dir(folder);
    if arguments.first() != Some(&"open") || arguments.contains(&"--help") {
        return command.output().unwrap();
    }
    // It serves until somebody stops it, once it has said where.
    let mut serving = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut out = serving.stdout.take().unwrap();
    let mut said = [0; 8];
    let _ = out.read_exact(&mut said);
    Command::new("kill").args(["-TERM", &serving.id().to_string()]).status().unwrap();
    serving.wait_with_output().unwrap()
}

/// The JSON document that a command prints.
fn document(folder: &Path, command: &str) -> Value {
    let arguments: Vec<&str> = command.split(' ').collect();
    let output = surgescope(folder, &arguments);
    let errors = String::from_utf8_lossy(&output.stderr);
    serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("surgescope {command}: {e}\n{errors}"))
}

/// The lines of a page's fences of one kind, continued lines joined.
fn fenced(page: &str, kind: &str) -> Vec<String> {
    let page = read(page).replace("\\\n", " ");
    let mut inside = None;
    let mut lines = Vec::new();
    for line in page.lines() {
        match line.strip_prefix("```") {
            Some(opened) if inside.is_none() => inside = Some(opened.to_owned()),
            Some(_) => inside = None,
            None if inside.as_deref() == Some(kind) && !line.trim().is_empty() => lines.push(line.to_owned()),
            None => {}
        }
    }
    lines
}

/// Runs all lines of the page's `sh` fences, in order, in one folder.
fn run_page(page: &str) {
    let folder = scratch();
    let programs = [Path::new(PROGRAM).parent().unwrap().to_owned()];
    let path = std::env::var_os("PATH").unwrap_or_default();
    let path = std::env::join_paths(programs.into_iter().chain(std::env::split_paths(&path))).unwrap();
    for command in fenced(page, "sh") {
        let expected = command.rsplit_once("# exit ").map_or(0, |(_, code)| code.trim().parse().unwrap());
        let output =
            Command::new("sh").args(["-c", &command]).current_dir(folder.path()).env("PATH", &path).output().unwrap();
        let said = format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
        assert_eq!(output.status.code(), Some(expected), "{page}: {command}\n{said}");
    }
}

#[test]
fn no_page_with_commands_is_forgotten() {
    for page in all_pages() {
        let page = page.to_str().unwrap();
        assert!(fenced(page, "sh").is_empty() || RUN.contains(&page), "{page}: add it to `pages!`");
        // What is shown as a command is in a fence that says whether it is run.
        let other = fenced(page, "").into_iter().chain(fenced(page, "bash")).chain(fenced(page, "console"));
        let shown: Vec<String> = other.filter(|l| l.starts_with("surgescope ") || l.starts_with("$ ")).collect();
        assert!(shown.is_empty(), "{page}: {shown:?} stands outside a fence of class sh or sh,norun");
    }
}

#[test]
fn links_lead_somewhere() {
    for page in all_pages() {
        let text = read(&page);
        for link in text.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
            if link.contains("://") || link.contains(char::is_whitespace) {
                continue;
            }
            let (file, anchor) = link.split_once('#').unwrap_or((link, ""));
            let target = if file.is_empty() { page.clone() } else { page.parent().unwrap().join(file) };
            assert!(root().join(&target).exists(), "{}: {link} leads nowhere", page.display());
            let headings = || read(&target).lines().filter(|l| l.starts_with('#')).map(slug).collect::<Vec<_>>();
            assert!(anchor.is_empty() || headings().contains(&anchor.to_owned()), "{}: no {link}", page.display());
        }
    }
}

/// The anchor of a heading, as GitHub and mdBook make it.
fn slug(heading: &str) -> String {
    let text = heading.trim_start_matches('#').trim().to_lowercase().replace(' ', "-");
    text.chars().filter(|c| c.is_alphanumeric() || matches!(c, '-' | '_')).collect()
}

#[test]
fn the_guide_lists_its_pages_and_the_readme_is_one() {
    let summary = read("docs/src/SUMMARY.md");
    for page in all_pages().iter().filter_map(|p| p.strip_prefix("docs/src").ok()) {
        let page = page.to_str().unwrap();
        assert!(page == "SUMMARY.md" || summary.contains(&format!("({page})")), "{page} is not in SUMMARY.md");
    }
    assert!(read("README.md").lines().count() <= 150);
}

/// Compares a page made from the program with the one that is committed, or writes it where that was asked for.
fn is_current(name: &str, made: &str) {
    let path = root().join("docs/src").join(name);
    if std::env::var_os("SURGESCOPE_UPDATE_GUIDE").is_some() {
        return fs::write(path, made).unwrap();
    }
    let committed = read(path);
    let differ = made.lines().zip(committed.lines()).find(|(now, then)| now != then);
    let again = "SURGESCOPE_UPDATE_GUIDE=1 cargo test --test it guide";
    assert!(made == committed, "docs/src/{name} is old; first difference: {differ:?}. Make it again: {again}");
}

const MADE: &str = "<!-- Made from the program by tests/it/guide.rs: do not edit, run `SURGESCOPE_UPDATE_GUIDE=1 cargo test --test it guide`. -->";

#[test]
fn the_page_of_commands_is_current() {
    let mut page = format!(
        "{MADE}\n\n# Commands\n\nThe help of every command, as the program prints it. What all commands have in common stands in \
         [First run](first-run.md#what-every-command-has-in-common).\n"
    );
    add_help(&mut page, &[]);
    is_current("commands.md", &page);
}

/// Adds the help of a command and of those below it.
fn add_help(page: &mut String, command: &[&str]) {
    let output = surgescope(root(), &[command, &["--help"]].concat());
    assert!(output.status.success(), "{command:?} has no help");
    let help = String::from_utf8(output.stdout).unwrap();
    if !command.is_empty() {
        let _ = write!(page, "\n{} {}\n", "#".repeat(command.len() + 1), command.join(" "));
    }
    let lines: Vec<&str> = help.lines().map(str::trim_end).collect();
    let _ = write!(page, "\n```text\n{}\n```\n", lines.join("\n").trim_end());
    let listed = lines.iter().take_while(|l| **l != "Options:").filter_map(|l| l.strip_prefix("  "));
    for name in listed.filter(|l| l.starts_with(|c: char| c.is_ascii_lowercase())) {
        let name = name.split(' ').next().unwrap();
        if name != "help" {
            add_help(page, &[command, &[name]].concat());
        }
    }
}

#[test]
fn the_page_of_effects_is_current() {
    let list = document(root(), "effects --json");
    let mut page = format!(
        "{MADE}\n\n# Effects\n\nThe physics that a model can have beside the base model, as `surgescope effects` lists it. Start and bounds of the \
         parameters are those of a fit on the rig `rigs/demo-hdpe.toml`; at the value in the column 'vanishes at', an effect changes nothing.\n\n\
         A number of elements (`viscoelastic-wall:2`) or a sensor (`sensor-lag@P2`) that is left out is found by the fit. A name with a slash is another form \
         of the same effect.\n"
    );
    for effect in list["effects"].as_array().unwrap() {
        add_effect(&mut page, effect);
        for form in effect["variants"].as_array().unwrap() {
            add_effect(&mut page, form);
        }
    }
    is_current("effects.md", &page);
}

fn add_effect(page: &mut String, listed: &Value) {
    let text = |value: &Value, key: &str| value[key].as_str().unwrap_or_default().to_owned();
    let name = text(listed, "name");
    let effect = document(root(), &format!("effects {name} --json"));
    let _ = write!(
        page,
        "\n## {name}\n\nIt adds {}.\n\n```text\n{}\n```\n\n",
        text(&effect, "summary"),
        text(&effect, "equation").replace(";  ", ";\n")
    );
    let _ = write!(
        page,
        "- **Trace in a record:** {}.\n- **Source:** {}.\n",
        text(&effect, "trace"),
        text(&effect, "source")
    );
    for other in effect["excludes"].as_array().unwrap() {
        let _ = writeln!(page, "- **Not together with** `{}`: {}.", text(other, "name"), text(other, "why"));
    }
    *page += "\n| parameter | unit | start | from | to | vanishes at | scale | what it is |\n| --- | --- | --- | --- | --- | --- | --- | --- |\n";
    for p in effect["parameters"].as_array().unwrap() {
        let [start, lower, upper, vanishes] = ["start", "lower", "upper", "vanishes_at"].map(|key| number(&p[key]));
        let [name, unit, scale, about] = ["name", "unit", "scale", "about"].map(|key| text(p, key));
        let _ = writeln!(page, "| `{name}` | {unit} | {start} | {lower} | {upper} | {vanishes} | {scale} | {about} |");
    }
}

/// A number to three digits; nothing where there is none.
fn number(value: &Value) -> String {
    match value.as_f64() {
        None => String::new(),
        Some(0.0) => "0".into(),
        Some(v) if (1e-3..1e4).contains(&v.abs()) => {
            let digits = (2 - v.abs().log10().floor() as i32).max(0) as usize;
            let text = format!("{v:.digits$}");
            if digits > 0 { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
        }
        Some(v) => format!("{v:.2e}"),
    }
}

#[test]
fn the_page_of_keys_is_current() {
    let folder = scratch();
    let mut page =
        format!("{MADE}\n\n# Keys\n\n## The rig file\n\nEvery key carries its unit. Keys in **bold** must be there.\n");
    let meanings = meanings();
    for (_, table, meanings) in meanings.iter().filter(|(of, ..)| of == "rig") {
        add_rig_table(&mut page, folder.path(), table, meanings);
    }
    let run = |command: &str| document(folder.path(), command);
    let recorded = run(
        "record --rig rigs/demo-hdpe.toml --simulate --speed 0 --rate 100 --duration 6 --effects viscoelastic-wall:1 \
         --set J1_per_GPa=0.12 tau1_s=0.1 -o run.mcap --json",
    );
    let inspected = run("inspect run.mcap --json");
    let calibrated =
        run("calibrate run.mcap --effects viscoelastic-wall:1 --profile tau1_s -o fit.json --save model.toml --json");
    let diagnosed = run("diagnose run.mcap --json");
    let next = run("next model.toml --for tau1_s --json");
    let fit: Value = serde_json::from_str(&fs::read_to_string(folder.path().join("fit.json")).unwrap()).unwrap();
    assert_eq!(fit, calibrated, "the file and the printed document are one record");
    let models: toml::Table = fs::read_to_string(folder.path().join("model.toml")).unwrap().parse().unwrap();
    let models = serde_json::to_value(models).unwrap();
    let add = |page: &mut String, name: &str, value: &Value| {
        let (.., meanings) = meanings.iter().find(|(of, table, _)| of == "document" && table == name).unwrap();
        add_document(page, name, meanings, value);
    };
    page += "\n## The fit file\n\nWhat `calibrate -o FIT.toml` or `-o FIT.json` writes and `calibrate --json` prints. `runs[].file` stands for the key `file` of each run.\n";
    add(&mut page, "fit", &calibrated);
    page += "\n## The model file\n\nWhat `calibrate --save`, `diagnose --apply`, `add` and `refit` write.\n";
    add(&mut page, "model", &models);
    page += "\n## What `--json` prints\n\nKeys may be added; they are not renamed or removed.\n";
    for (name, value) in [("record", &recorded), ("inspect", &inspected), ("diagnose", &diagnosed), ("next", &next)] {
        let _ = write!(page, "\n### {name} --json\n");
        add(&mut page, name, value);
    }
    is_current("keys.md", &page);
}

/// What keys mean, in their order.
type Meanings = Vec<(String, toml::Value)>;

/// The tables of `docs/keys.toml` in their order, which the parser of a whole file does not keep: `rig`, `[[pipe]]`,
/// its keys.
fn meanings() -> Vec<(String, String, Meanings)> {
    let mut tables: Vec<(String, String, Meanings)> = Vec::new();
    for line in read("docs/keys.toml").lines() {
        let (name, value) =
            match line.parse::<toml::Table>().unwrap_or_else(|e| panic!("{line}: {e}")).into_iter().next() {
                Some(entry) => entry,
                None => continue, // a comment, or nothing
            };
        match value {
            toml::Value::Table(inner) => tables.push((name, inner.keys().next().unwrap().clone(), Vec::new())),
            meaning => tables.last_mut().unwrap().2.push((name, meaning)),
        }
    }
    tables
}

/// Adds a table of the rig file: its keys, and what each may be, from what the program says of a file that has them
/// wrong.
fn add_rig_table(page: &mut String, folder: &Path, table: &str, meanings: &Meanings) {
    let all_keys: toml::Table = read("tools/fuzz/corpus/rig/all-keys.toml").parse().unwrap();
    let complaint = |change: &dyn Fn(&mut toml::Table)| {
        let mut file = all_keys.clone();
        let name = table.trim_matches(['[', ']']);
        if name == table {
            change(&mut file);
        } else if table.starts_with("[[") {
            let list = file.entry(name).or_insert(toml::Value::Array(vec![toml::Table::new().into()]));
            change(list[0].as_table_mut().unwrap());
        } else {
            change(file[name].as_table_mut().unwrap());
        }
        fs::write(folder.join("wrong.toml"), toml::to_string(&file).unwrap()).unwrap();
        String::from_utf8(surgescope(folder, &["rig", "check", "wrong.toml"]).stderr).unwrap()
    };
    let after =
        |said: &str, mark: &str| said.split(mark).nth(1).and_then(|rest| rest.lines().next()).map(str::to_owned);
    let unknown = complaint(&|table| drop(table.insert("qqqq".into(), 1.into())));
    let known = after(&unknown, "known are ").unwrap_or_else(|| panic!("{unknown}"));
    let known: Vec<&str> = known.split(", ").collect();
    let described: Vec<&str> = meanings.iter().map(|(key, _)| key.as_str()).collect();
    assert_eq!(described, known, "docs/keys.toml (left) and the program (right) differ in the keys of {table}");

    let empty = complaint(&toml::Table::clear);
    let heading = if table.starts_with('[') { table } else { "At the top" };
    let _ = write!(page, "\n### {heading}\n\n| key | what it may be | what it is |\n| --- | --- | --- |\n");
    for (key, meaning) in meanings {
        let said = complaint(&|table| {
            table.insert(key.clone(), "qqqq".into());
            if key == "unit" {
                table.remove("kind"); // so that the units of all kinds are named
            }
        });
        // 'length_m' in [[pipe]] must be a number above 0, not "qqqq"; or a list: Known are …
        let must_be = [format!("'{key}' in {table} must be "), format!("'{key}' must be ")]
            .iter()
            .find_map(|mark| after(&said, mark));
        let must_be = must_be.map(|words| words.split(", not ").next().unwrap().to_owned());
        let listed = must_be.or(after(&said, "Known are ")).or(after(&said, "allowed here are "));
        let missing = [format!("missing key '{key}'"), format!("missing [{key}]"), format!("missing [[{key}]]")];
        let mark = if missing.iter().any(|words| empty.contains(words)) { "**" } else { "" };
        let (may_be, meaning) = (listed.unwrap_or_else(|| "a text".to_owned()), meaning.as_str().unwrap());
        let _ = writeln!(page, "| {mark}`{key}`{mark} | {may_be} | {meaning} |");
    }
}

/// Adds the keys of a document in the order of `docs/keys.toml`, and fails where the two do not agree.
fn add_document(page: &mut String, name: &str, meanings: &Meanings, value: &Value) {
    let mut found = BTreeSet::new();
    flatten("", value, &mut found);
    // what is empty here may hold more elsewhere: `unseen[]` stands for `unseen[].in_words`
    let stands_for =
        |key: &str, more: &str| more.strip_prefix(key).is_some_and(|m| m.is_empty() || m.starts_with(['.', '[']));
    let lacking: Vec<&String> = found.iter().filter(|key| !meanings.iter().any(|(m, _)| stands_for(key, m))).collect();
    assert!(lacking.is_empty(), "docs/keys.toml does not describe {lacking:?} of {name}");
    *page += "\n| key | what it is |\n| --- | --- |\n";
    for (key, meaning) in meanings {
        let words = match meaning {
            toml::Value::Array(pair) => {
                format!("{}. Only where {}.", pair[0].as_str().unwrap(), pair[1].as_str().unwrap())
            }
            meaning => {
                assert!(found.contains(key), "docs/keys.toml describes '{key}' of {name}, which is not there");
                meaning.as_str().unwrap().to_owned()
            }
        };
        let _ = writeln!(page, "| `{key}` | {words} |");
    }
}

/// The paths of all values of a document: `runs[].file`.
fn flatten(path: &str, value: &Value, found: &mut BTreeSet<String>) {
    match value {
        Value::Object(object) => {
            for (key, value) in object {
                flatten(&if path.is_empty() { key.clone() } else { format!("{path}.{key}") }, value, found);
            }
        }
        Value::Array(items) if !items.is_empty() => {
            items.iter().for_each(|item| flatten(&format!("{path}[]"), item, found));
        }
        Value::Array(_) => drop(found.insert(format!("{path}[]"))),
        _ => drop(found.insert(path.to_owned())),
    }
}
