//! The next test: what would tell two answers apart, or narrow a parameter, computed before anybody opens a valve.
//!
//! Each test that the rig can do is simulated under one answer; the other answer is then fitted to that, with what the
//! records so far know of its parameters as prior. What it cannot follow is the evidence that the test is expected to
//! bring (Hunter & Reiner 1965, Technometrics 7, 307; Atkinson & Fedorov 1975, Biometrika 62, 57: T-optimal designs),
//! averaged over what the first answer's parameters may be. A parameter is narrowed most by the test whose linearised
//! record holds most information on it (D-optimal for one parameter; Atkinson, Donev & Tobias 2007, Optimum
//! Experimental Designs).

pub(crate) mod answer;
pub(crate) mod change;
pub(crate) mod precision;
pub(crate) mod separation;

use rayon::prelude::*;

use crate::diagnose::baseline::Baseline;
use crate::diagnose::limits::{BEST_TESTS, DRAWS, NAMED_TESTS, SAME_SHARE};
pub use crate::diagnose::next::answer::Answer;
pub use crate::diagnose::next::change::Change;
use crate::diagnose::next::change::{REMEDY, changes};
pub use crate::diagnose::next::precision::Precision;
pub use crate::diagnose::next::separation::{Curve, Separation};
use crate::fit::data::run_data::RunData;
use crate::fit::outcome::fit::Fit;
use crate::fit::problem::error::FitError;
use crate::fit::progress::OnProgress;
use crate::fit::search::options::Options;
use crate::rig::Rig;

/// The tests that tell two answers apart, the most telling first; of those that leave them alike, none.
///
/// `start` is the fit around which coarse problems are built.
///
/// # Errors
/// If an answer cannot be simulated under its own records.
pub fn between(
    rig: &Rig,
    runs: &[RunData],
    start: &Fit,
    answers: [&Answer; 2],
    options: &Options,
    progress: &OnProgress<'_>,
) -> Result<Vec<Separation>, FitError> {
    let baseline = Baseline::new(rig, runs, start, options)?;
    separations(&baseline, answers, progress)
}

/// The same on a baseline.
pub(crate) fn separations(
    baseline: &Baseline,
    answers: [&Answer; 2],
    progress: &OnProgress<'_>,
) -> Result<Vec<Separation>, FitError> {
    let [Some(one), Some(other)] = [answers[0].known(baseline)?, answers[1].known(baseline)?] else {
        return Ok(Vec::new());
    };
    let unit = one.unit.max(other.unit);
    let places_m: Vec<f64> = baseline.runs[0].sensors.iter().map(|s| baseline.rig.on_way_m(s.sensor.place())).collect();
    let (first, length_m) = (&one.runs[0], baseline.rig.length_m());
    let open = changes()
        .into_iter()
        .chain([REMEDY])
        .filter(|change| change.is_possible(first) && !change.is_made(&one.runs, &places_m, length_m));
    let open: Vec<Change> = open.collect();
    let expected = |change: &Change, draws: u32| {
        progress(&change.instruction(first, baseline.rig, "the cause put right").into());
        separation::of(baseline, answers, [&one, &other], *change, unit, draws)
    };
    let sorted = |mut found: Vec<Separation>| {
        found.sort_by(|a, b| b.log_odds.total_cmp(&a.log_odds));
        found
    };
    // all at what is most probable of the parameters, then the best over what is left open
    let mut found = sorted(open.par_iter().filter_map(|change| expected(change, 1)).collect());
    found.truncate(BEST_TESTS);
    let found = sorted(found.par_iter().filter_map(|test| expected(&test.change, DRAWS)).collect());
    Ok(found)
}

/// The tests that narrow a parameter of an answer, the best first.
///
/// # Errors
/// If the answer cannot be simulated under its own records.
pub fn narrowing(
    rig: &Rig,
    runs: &[RunData],
    start: &Fit,
    answer: &Answer,
    parameter: &str,
    options: &Options,
) -> Result<Vec<Precision>, FitError> {
    let baseline = Baseline::new(rig, runs, start, options)?;
    let Some(known) = answer.known(&baseline)? else { return Ok(Vec::new()) };
    let Some(j) = known.names.iter().position(|name| name == parameter) else { return Ok(Vec::new()) };
    let first = known.runs[0];
    let open: Vec<Change> = changes().into_iter().filter(|change| change.is_possible(&first)).collect();
    let mut found: Vec<Precision> =
        open.par_iter().filter_map(|change| precision::of(&baseline, answer, &known, j, *change)).collect();
    found.sort_by(|a, b| a.after.total_cmp(&b.after));
    Ok(found)
}

/// The answer that a fit is.
pub fn answer_of(name: &str, fit: &Fit) -> Answer {
    Answer { name: name.to_owned(), effects: fit.effects.clone(), values: fit.values() }
}

/// The tests that tell two answers apart best, in words; none where no test does.
pub(crate) fn in_words(baseline: &Baseline, [one, other]: [Answer; 2]) -> Option<String> {
    let found = separations(baseline, [&one, &other], &|_| {}).ok()?;
    let telling = found.iter().filter_map(|test| {
        let repeats = test.repeats?;
        let often = if repeats == 1 { String::new() } else { format!(", {repeats} times") };
        Some(format!("{}{often} (expected odds {})", test.instruction, odds(test.log_odds)))
    });
    let [creep_of_one, creep_of_other] = [&one, &other].map(|answer| creep_per_gpa(baseline, answer));
    let creep = creep_test(creep_of_one, creep_of_other);
    let tests: Vec<String> = telling.take(NAMED_TESTS).chain(creep).collect();
    (!tests.is_empty()).then(|| {
        format!("{} and {} cannot be told apart by these recordings: {}", one.name, other.name, tests.join("; or "))
    })
}

/// Odds in words, from their logarithm.
pub fn odds(log_odds: f64) -> String {
    if log_odds > 1000f64.ln() { "above 1000:1".to_owned() } else { format!("{:.1}:1", log_odds.exp()) }
}

/// Final creep compliance of the wall, 1/GPa.
fn creep_per_gpa(baseline: &Baseline, answer: &Answer) -> f64 {
    let shared = baseline.model(&answer.effects).shared;
    shared.iter().zip(&answer.values).filter(|(p, _)| p.unit == "1/GPa").map(|(_, v)| v).sum()
}

/// A creep test of the wall, if the two answers need different walls.
fn creep_test(one: f64, other: f64) -> Option<String> {
    let apart = one.max(other) > (1.0 + SAME_SHARE) * one.min(other).max(0.0);
    apart.then(|| {
        format!("make a creep test of the wall, which creeps by {one:.3} 1/GPa in the first model and by {other:.3} in the second")
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::evidence::tempered;
    use crate::diagnose::measures::square;
    use crate::fit::outcome::fit::Fit;
    use crate::fit::problem::test_record::{copper, record};
    use crate::fit::search::calibrate::calibrate;
    use crate::model::RunValues;
    use crate::model::effects::parse_list;

    const RUN: RunValues =
        RunValues { initial_velocity_m_s: 0.3, valve_head_m: 30.0, closing_time_s: 0.1, friction_scale: 1.0 };

    fn fitted(rig: &Rig, runs: &[RunData], effects: &str) -> Fit {
        calibrate(rig, runs, &parse_list(effects).unwrap(), &Options::default(), &|_| {}).unwrap()
    }

    /// The evidence that a test is expected to bring is what it brings, once it is made and all records are fitted
    /// again.
    #[test]
    fn a_test_brings_the_evidence_that_was_expected_of_it() {
        // known exactly, and elastic: two answers, nothing else
        let rig = copper();
        let truth = parse_list("leak").unwrap();
        let made = |run: RunValues, file: &str| RunData {
            file: file.into(),
            ..record(&rig, &truth, &[1250.0, 31.0, 0.4], run, 0.3, 2.0)
        };
        let first = [made(RUN, "a")];
        let [start, leak, blockage] = ["none", "leak", "blockage"].map(|effects| fitted(&rig, &first, effects));
        let answers = [answer_of("leak", &leak), answer_of("blockage", &blockage)];
        let baseline = Baseline::new(&rig, &first, &start, &Options::default()).unwrap();
        let known = answers.each_ref().map(|answer| answer.known(&baseline).unwrap().unwrap());
        let unit = known[0].unit.max(known[1].unit);
        let changes = changes();
        for velocity in [0.5, 2.0] {
            let change = changes.iter().find(|change| change.velocity == velocity).unwrap();
            let [one, other] = answers.each_ref();
            let test = separation::of(&baseline, [one, other], known.each_ref(), *change, unit, DRAWS).unwrap();
            let both = [made(RUN, "a"), made(test.change.of(&RUN), "b")];
            let evidence = |leak: &Fit, blockage: &Fit| tempered(0.5 * (square(blockage) - square(leak)) / unit);
            let before = evidence(&leak, &blockage);
            let after = evidence(&fitted(&rig, &both, "leak"), &fitted(&rig, &both, "blockage"));
            let brought = after - before;
            assert!(
                test.log_odds > 0.5 * brought && test.log_odds < 2.0 * brought,
                "at {velocity} times the velocity: {} expected, {brought} brought",
                test.log_odds
            );
        }
    }

    /// A test that is made once more doubles the information: errors fall to about 1/√2 where neither priors nor the
    /// run's own values matter.
    #[test]
    fn a_repetition_narrows_as_a_second_record_does() {
        let rig = copper();
        let made = |file: &str| RunData {
            file: file.into(),
            ..record(&rig, &parse_list("leak").unwrap(), &[1250.0, 31.0, 2.0], RUN, 0.1, 2.0)
        };
        let [one, two] = [vec![made("a")], vec![made("a"), made("b")]].map(|runs| (fitted(&rig, &runs, "leak"), runs));
        let expected = |name: &str| {
            let answer = answer_of("leak", &one.0);
            let tests = narrowing(&rig, &one.1, &one.0, &answer, name, &Options::default()).unwrap();
            let again = tests.iter().find(|t| t.instruction == "repeat the test as it was").unwrap();
            again.after / again.before
        };
        for name in ["leak_position_m", "leak_cda_mm2"] {
            let error = |fit: &Fit| fit.parameter(name).unwrap().standard_error();
            let (expected, found) = (expected(name), error(&two.0) / error(&one.0));
            assert!((expected - 0.5f64.sqrt()).abs() < 0.05, "{name}: {expected}");
            assert!((expected / found - 1.0).abs() < 0.15, "{name}: {expected} expected, {found} found");
        }
    }

    #[test]
    fn a_creep_test_is_worth_making_where_the_walls_differ() {
        assert!(creep_test(0.0, 0.0).is_none());
        assert!(creep_test(0.30, 0.31).is_none());
        assert!(creep_test(0.30, 0.0).is_some() && creep_test(0.2, 0.3).unwrap().contains("0.200 1/GPa"));
    }
}
