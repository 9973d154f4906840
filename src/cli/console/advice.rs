//! What to do next after the result of a page, with the command to copy.

use std::path::{Path, PathBuf};

use crate::diagnose::{Diagnosis, Verdict};
use crate::report::Page;
use crate::report::advice::{Advice, quoted};
use crate::report::prediction::text as prediction;
use crate::report::view::summary::{self, Closeness};
use crate::shown::Shown as _;
use crate::study::hold::Hold;

/// The recordings of a page as they are given to a command, in words that a shell takes.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Again {
    /// Their paths.
    recordings: String,
    /// Options that they were read with, such as `--rig RIG`, each with a blank before it.
    options: String,
    /// The model file that has the answer already.
    kept: Option<String>,
}

impl Again {
    /// Recordings, read with another rig than their own, without some sensors, with parameters held.
    pub fn of(recordings: &[PathBuf], rig: Option<&Path>, ignored: &[String], held: &[Hold]) -> Self {
        let named: Vec<String> = recordings.iter().map(|path| quoted(&path.shown())).collect();
        let mut options = rig.map_or(String::new(), |rig| format!(" --rig {}", quoted(&rig.shown())));
        if !ignored.is_empty() {
            options += &format!(" --ignore {}", quoted(&ignored.join(",")));
        }
        if !held.is_empty() {
            let held: Vec<String> = held.iter().map(|hold| quoted(&hold.to_string())).collect();
            options += &format!(" --hold {}", held.join(" "));
        }
        Again { recordings: named.join(" "), options, kept: None }
    }

    /// The same where a model file has the answer already.
    pub fn kept_in(self, file: Option<&Path>) -> Self {
        Again { kept: file.map(|file| quoted(&file.shown())), ..self }
    }
}

/// What to do after a page's last result.
pub fn of(page: &Page, again: &Again) -> Option<Advice> {
    let last = page.stages.last()?.fit;
    let Again { recordings, options, kept } = again;
    let effects = |labels: Vec<String>| match labels.as_slice() {
        [] => String::new(),
        all => format!(" --effects {}", all.join(",")),
    };
    let model = effects(last.labels());
    let diagnose = || format!("diagnose {recordings}{model}{options} --report diagnosis.html");
    let validate = || {
        // cross-validation knows no sensors to leave out
        let command = format!("cross-validate {recordings}{model}{options}");
        let why = "Check that the model predicts what it was not fitted to.";
        (!options.contains("--ignore")).then(|| Advice::new(why, &[command]))
    };
    if let Some(found) = page.diagnoses.last() {
        let first = page.diagnoses.first().unwrap_or(found);
        let start = effects(first.start.labels());
        return match found.verdict {
            Verdict::NothingMissing => validate(),
            Verdict::MissingEffect => {
                Some(keep(found, &format!("diagnose {recordings}{start}{options}"), kept.as_deref()))
            }
            Verdict::UnknownEffect => Some(Advice::new(
                "Compare what the recording shows with the rig file: a wrong length, unit or place looks like missing physics.",
                &[format!("inspect {recordings}")],
            )),
        };
    }
    if let Some(ahead) = page.prediction {
        return (prediction::judge(ahead) == Closeness::Missing)
            .then(|| Advice::new("Find out which effect this run shows that the model lacks.", &[diagnose()]));
    }
    match summary::judge(last) {
        Closeness::Noise if summary::is_noise(last) => validate(),
        Closeness::Noise | Closeness::Near | Closeness::Missing => {
            Some(Advice::new("Find out which effect is missing.", &[diagnose()]))
        }
        Closeness::Unknown if !last.converged => Some(Advice::new(
            "Search again, from starts all over the bounds.",
            &[format!("calibrate {recordings}{model}{options} --method global-local")],
        )),
        Closeness::Unknown => None,
    }
}

/// Keeps the model with what was found; then the test that is still needed, or the next effect.
fn keep(found: &Diagnosis, diagnose: &str, kept: Option<&str>) -> Advice {
    let rivals = found.candidates.first().map_or(&[][..], |c| c.indistinguishable_from.as_slice());
    if rivals.is_empty() {
        match kept {
            Some(file) => {
                let why = format!("{file} has {} now: see what it changes, and look for more.", found.answer_label());
                Advice::new(why, &[format!("open {file}")])
            }
            None => {
                let why = format!("Add {} to the model, keep it in a file, and look for more.", found.answer_label());
                Advice::new(why, &[format!("{diagnose} --until-done --apply model.toml")])
            }
        }
    } else {
        let why = format!(
            "Keep the model with {}, and find the test that distinguishes it from {}.",
            found.answer_label(),
            rivals.join(" and ")
        );
        match kept {
            Some(file) => Advice::new(why, &[format!("next {file} --report next.html")]),
            None => {
                let next = "next model.toml --report next.html".to_owned();
                Advice::new(why, &[format!("{diagnose} --apply model.toml"), next])
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shell_takes_what_is_copied() {
        let again = Again::of(
            &[PathBuf::from("runs/a b.mcap"), PathBuf::from("c.mcap")],
            Some(Path::new("it's.toml")),
            &["P2".to_owned()],
            &[
                Hold { name: "wave_speed_m_s".to_owned(), lower: 350.0, upper: 588.0 },
                Hold { name: "offset_m[P1]".to_owned(), lower: 0.1, upper: 0.1 },
            ],
        );
        assert_eq!(again.recordings, "'runs/a b.mcap' c.mcap");
        assert_eq!(
            again.options,
            r" --rig 'it'\''s.toml' --ignore P2 --hold wave_speed_m_s=350:588 'offset_m[P1]=0.1'"
        );
    }
}
