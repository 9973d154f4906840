//! Whether the program names what this scheme hides, and explains the record down to its noise.

use surgescope::Study;
use surgescope::diagnose::Verdict;
use surgescope::fit::search::options::Options;
use surgescope::model::effects::parse_list;
use surgescope::rig::Rig;
use surgescope::storage::import::{ImportOptions, SourceOptions};
use surgescope::study::import::import;

use super::record::{self, Lab};
use super::rig::{Case, draw};

/// The effect that a diagnosis of the case's first run names, and what it leaves over the noise.
fn named(case: &Case, random: &mut fastrand::Rng) -> (&'static str, f64) {
    let folder = tempfile::tempdir().unwrap();
    record::write(folder.path(), case, random, Lab { coloured: false, hum: false, wrong_rig: false }).unwrap();
    let rig = Rig::load(&folder.path().join("rig.toml")).unwrap();
    let (table, options) = (folder.path().join("run.csv"), ImportOptions::default());
    let recording = import(&table, &rig, &options, &SourceOptions::default(), true).unwrap().recording;
    let study = Study::from_recordings([("run".to_owned(), recording)]).unwrap();
    let start = if case.start_effects.is_empty() { "none".to_owned() } else { case.start_effects.join(",") };
    let answer = study.diagnose_model(&parse_list(&start).unwrap(), &Options::default()).unwrap();
    assert_eq!(answer.verdict, Verdict::MissingEffect);
    let best = &answer.candidates[0];
    (best.effect, best.over_noise)
}

/// A wall that moves, whose records show what a moving valve or creep would be asked to explain.
#[test]
fn a_wall_that_moves_is_named() {
    let mut random = fastrand::Rng::with_seed(2581 * 1_000_003 + 1);
    let mut case = draw(&mut random, "fluid-structure", None, false, "wall");
    // A few cycles are enough to tell it from its rivals.
    case.duration_s *= 0.2;
    let (effect, over_noise) = named(&case, &mut random);
    assert_eq!(effect, "fluid-structure");
    assert!(over_noise < 1.1, "{over_noise} times the noise");
}
