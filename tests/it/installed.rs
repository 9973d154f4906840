//! What comes along with an installed program: completions and manual pages.

use serde_json::Value;

use crate::common::{done, here, printed, refused, run, text};

/// Every command, as the help lists them.
fn commands() -> Vec<String> {
    let help = printed(run(&["--help"]));
    let lines = help.lines().take_while(|line| !line.starts_with("Options:"));
    let names = lines.filter_map(|line| line.strip_prefix("  ")?.split_whitespace().next());
    let names: Vec<String> = names.map(str::to_owned).collect();
    assert!(names.len() > 30 && names.contains(&"export".to_owned()), "{names:?}");
    names
}

#[test]
fn completions_know_every_command_and_its_options() {
    for (shell, option) in
        [("bash", "--until-done"), ("zsh", "--until-done["), ("fish", "-l until-done"), ("elvish", "--until-done")]
    {
        let script = printed(run(&["completions", shell]));
        for command in commands() {
            assert!(script.contains(&command), "{shell}: no {command}");
        }
        assert!(script.contains(option), "{shell}: no {option}");
        let told = done(&["completions", shell]);
        assert_eq!((told["shell"].as_str(), told["script"].as_str()), (Some(shell), Some(script.as_str())));
    }
    refused(&["completions", "cmd"], &["invalid value 'cmd'", "bash", "zsh"]);
}

/// Bash loads the script, and completes the beginning of a command.
#[test]
fn bash_completes_a_command() {
    let script = printed(run(&["completions", "bash"]));
    let ask = "\nCOMP_WORDS=(surgescope diag); COMP_CWORD=1; _surgescope surgescope diag surgescope; echo \"${COMPREPLY[@]}\"";
    let Ok(output) = std::process::Command::new("bash").args(["-c", &(script + ask)]).output() else {
        return; // no bash here, and so nobody who would complete
    };
    assert_eq!(printed(output).trim(), "diagnose");
}

#[test]
fn each_command_has_a_manual_page() {
    let folder = tempfile::tempdir().unwrap();
    let man = folder.path().join("new/man1");
    let told = done(&["man", text(&man)]);
    let pages: Vec<&str> = told["pages"].as_array().unwrap().iter().filter_map(Value::as_str).collect();
    let mut wanted: Vec<String> = commands().iter().map(|c| format!("surgescope-{c}.1")).collect();
    wanted.extend(["surgescope.1".into(), "surgescope-rig-check.1".into()]);
    for name in &wanted {
        assert!(pages.contains(&name.as_str()), "no {name}");
        let page = std::fs::read_to_string(man.join(name)).unwrap();
        let (title, version) = (name.strip_suffix(".1").unwrap(), env!("CARGO_PKG_VERSION"));
        assert!(page.contains(&format!(".TH {title} 1 ")) && page.contains(&format!("surgescope {version}")), "{name}");
        assert!(page.contains(".SH SYNOPSIS"), "{name}");
    }
    assert_eq!(std::fs::read_dir(&man).unwrap().count(), pages.len());
    let page = std::fs::read_to_string(man.join("surgescope-diagnose.1")).unwrap();
    assert!(page.contains("\\-\\-until\\-done"), "{page}");

    // Nothing is replaced unasked.
    std::fs::write(man.join("surgescope.1"), "mine").unwrap();
    refused(&["man", text(&man)], &["exists", "--overwrite"]);
    assert_eq!(std::fs::read_to_string(man.join("surgescope.1")).unwrap(), "mine");
    done(&["man", text(&man), "--overwrite"]);
    assert_ne!(std::fs::read_to_string(man.join("surgescope.1")).unwrap(), "mine");
    refused(&["man", text(&man.join("surgescope.1"))], &["cannot make the folder"]);
}

/// A package, its citation and its physics name one version and one address, and every file that a package takes along
/// is there.
#[test]
fn what_is_published_agrees() {
    let manifest = |path: &str| std::fs::read_to_string(here(path)).unwrap().parse::<toml::Table>().unwrap();
    let (own, core) = (manifest("Cargo.toml"), manifest("src/core/Cargo.toml"));
    let (own, core) = (own["package"].as_table().unwrap(), core["package"].as_table().unwrap());
    for key in ["version", "repository", "homepage", "license", "rust-version"] {
        assert_eq!(own[key], core[key], "{key}");
    }
    let citation = std::fs::read_to_string(here("CITATION.cff")).unwrap();
    let [version, address] = ["version", "repository"].map(|key| own[key].as_str().unwrap());
    assert!(citation.lines().any(|line| line == format!("version: {version}")), "{citation}");
    assert!(citation.contains(&format!("repository-code: \"{address}\"")), "{citation}");

    let assets = own["metadata"]["deb"]["assets"].as_array().unwrap();
    assert!(assets.len() > 5);
    let made = ["target/release/surgescope", "target/man/", "target/completions/", "target/third-party-licences.txt"];
    for source in assets.iter().map(|asset| asset[0].as_str().unwrap()) {
        assert!(made.iter().any(|m| source.starts_with(m)) || here(source).exists(), "no {source}");
    }
    let script = std::fs::read_to_string(here("tools/release.sh")).unwrap();
    for made in &made[1..] {
        assert!(script.contains(made.trim_end_matches('/')), "tools/release.sh does not make {made}");
    }
    assert!(script.contains("name=surgescope-$version-$target"), "binstall asks for this name");
}
