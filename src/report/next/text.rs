//! Which test next, as text and JSON.

use serde::Serialize;
use serde_json::json;

use crate::diagnose::next::{Change, Curve, Precision, Separation, odds};
use crate::model::RunValues;
use crate::report::text::number::{error_m, fixed, probability, significant};
use crate::report::text::table::Table;
use crate::rig::Rig;
use crate::study::next::{Contest, NOTHING, Standing};

/// Tests that are listed.
pub const LISTED: usize = 6;
/// Most points of a curve in JSON.
const POINTS: usize = 500;

/// The settings of a test.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Settings {
    /// Velocity before the closure in the last pipe, m/s.
    pub velocity_m_s: f64,
    /// Flow before the closure, L/s.
    #[serde(rename = "flow_L_s")]
    pub flow_l_s: f64,
    /// Head before the valve, m.
    pub valve_head_m: f64,
    /// Closing time, s.
    pub closing_time_s: f64,
    /// Temperature of the water, °C.
    #[serde(rename = "temperature_degC")]
    pub temperature_degc: f64,
    /// Place of one more pressure sensor, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sensor_m: Option<f64>,
}

/// The settings of a test on a rig.
pub fn settings(rig: &Rig, change: &Change, run: &RunValues) -> Settings {
    let area_m2 = rig.pipes.last().map_or(0.0, |pipe| pipe.area_m2());
    Settings {
        velocity_m_s: run.initial_velocity_m_s,
        flow_l_s: 1e3 * run.initial_velocity_m_s * area_m2,
        valve_head_m: run.valve_head_m,
        closing_time_s: run.closing_time_s,
        temperature_degc: rig.fluid.temperature_degc + change.warmer_k,
        sensor_m: change.sensor.map(|share| share * rig.length_m()),
    }
}

/// Two answers in words, with their probabilities where these are known.
pub fn title(between: &[Standing; 2]) -> String {
    let named = |standing: &Standing| match standing.probability {
        Some(p) => format!("{} (probability {})", standing.answer.name, probability(p)),
        None => standing.answer.name.clone(),
    };
    format!("{} or {}", named(&between[0]), named(&between[1]))
}

/// Where two answers differ most under a test.
pub fn most(test: &Separation) -> Option<(&Curve, f64, f64)> {
    let all = test.curves.iter().map(|curve| (curve, curve.most()));
    all.max_by(|a, b| a.1.1.abs().total_cmp(&b.1.1.abs())).map(|(curve, (at_s, by_m))| (curve, at_s, by_m))
}

/// The headings of a table of tests.
pub const HEADINGS: [&str; 5] = ["test", "expected odds", "tests to 20:1", "peak, m", "they differ most"];

/// The telling tests of a contest, one row each.
pub fn rows(contest: &Contest) -> Vec<[String; 5]> {
    let telling = contest.tests.iter().filter_map(|test| Some((test, test.repeats?))).take(LISTED);
    let row = |(test, repeats): (&Separation, usize)| {
        let where_most = most(test).map_or(String::new(), |(curve, at_s, by_m)| {
            format!("{} at {} s, by {} m", curve.sensor, significant(at_s, 2), error_m(by_m.abs()))
        });
        [test.instruction.clone(), odds(test.log_odds), repeats.to_string(), fixed(test.peak_m, 1), where_most]
    };
    telling.map(row).collect()
}

/// What the columns mean.
pub fn legend(contest: &Contest) -> String {
    let [one, other] = contest.between.each_ref().map(|s| s.answer.name.as_str());
    format!(
        "expected odds: by one such test, for whichever of the two is true. they differ most: time after the start of the closure, and what \
         remains after {other} has been fitted to the record that {one} expects."
    )
}

/// The tests of a contest as text.
pub fn contest(contest: &Contest) -> String {
    let rows = rows(contest);
    if rows.is_empty() {
        return format!("{}: no test of this rig tells them apart in twenty repeats.\n", title(&contest.between));
    }
    let mut table = Table::new(&HEADINGS);
    rows.into_iter().for_each(|row| table.row(row));
    format!("{}\n{table}{}\n", title(&contest.between), legend(contest))
}

/// The only answer that stands, in a sentence.
pub fn only(standing: &Standing) -> String {
    let Standing { answer, probability: known } = standing;
    let sure = known.map_or(String::new(), |p| format!(" (probability {})", probability(p)));
    let what = if answer.name == NOTHING { "nothing is missing" } else { &answer.name };
    format!("One answer stands: {what}{sure}.")
}

/// A parameter, and the tests that narrow it, the best first.
#[derive(Debug, Clone)]
pub struct Narrowing {
    /// Name of the parameter.
    pub parameter: String,
    /// Its unit.
    pub unit: &'static str,
    /// The tests.
    pub tests: Vec<Precision>,
}

/// The headings of a table of tests that narrow a parameter.
pub const NARROWING: [&str; 3] = ["test", "standard error after", "share of before"];

impl Narrowing {
    /// What the parameter is known to now, or that no test narrows it.
    pub fn heading(&self) -> String {
        let name = &self.parameter;
        match self.tests.first() {
            Some(test) => format!("Tests that narrow {name}, now known to ± {}", self.error(test.before)),
            None => format!("No test of this rig narrows {name}"),
        }
    }

    /// The best tests, one row each.
    pub fn rows(&self) -> Vec<[String; 3]> {
        let row = |test: &Precision| {
            let share = format!("{}%", significant(100.0 * test.after / test.before, 2));
            [test.instruction.clone(), self.error(test.after), share]
        };
        self.tests.iter().take(LISTED).map(row).collect()
    }

    /// The tests as text.
    pub fn text(&self) -> String {
        if self.tests.is_empty() {
            return format!("{}.\n", self.heading());
        }
        let mut table = Table::new(&NARROWING);
        self.rows().into_iter().for_each(|row| table.row(row));
        format!("{}\n{table}", self.heading())
    }

    fn error(&self, value: f64) -> String {
        let unit = if self.unit == "1" { String::new() } else { format!(" {}", self.unit) };
        format!("{}{unit}", significant(value, 2))
    }
}

/// The tests as JSON.
pub fn document(rig: &Rig, contests: &[Contest], narrowed: Option<&Narrowing>) -> serde_json::Value {
    let curve = |curve: &Curve| {
        let step = curve.time_s.len().div_ceil(POINTS).max(1);
        let thinned = |v: &[f64]| v.iter().step_by(step).copied().collect::<Vec<f64>>();
        json!({ "sensor": curve.sensor, "time_s": thinned(&curve.time_s), "first_m": thinned(&curve.one_m), "second_m": thinned(&curve.other_m) })
    };
    let test = |test: &Separation| {
        json!({
            "instruction": test.instruction, "settings": settings(rig, &test.change, &test.run), "log_odds": test.log_odds,
            "repeats": test.repeats, "peak_m": test.peak_m, "curves": test.curves.iter().map(curve).collect::<Vec<_>>(),
        })
    };
    let contest = |contest: &Contest| {
        json!({
            "between": contest.between.iter().map(|s| &s.answer.name).collect::<Vec<_>>(),
            "probability": contest.between.iter().map(|s| s.probability).collect::<Vec<_>>(),
            "tests": contest.tests.iter().map(test).collect::<Vec<_>>(),
        })
    };
    let narrowed = narrowed.map(|Narrowing { parameter, tests, .. }| {
        let test = |test: &Precision| {
            json!({
                "instruction": test.instruction, "settings": settings(rig, &test.change, &test.run),
                "standard_error_before": test.before, "standard_error_after": test.after,
            })
        };
        json!({ "parameter": parameter, "tests": tests.iter().map(test).collect::<Vec<_>>() })
    });
    json!({ "answers": contests.iter().map(contest).collect::<Vec<_>>(), "narrowing": narrowed })
}

/// The settings of a test as a file.
///
/// # Errors
/// If a value cannot be written as TOML.
pub fn settings_file(why: &str, instruction: &str, settings: &Settings) -> Result<String, toml::ser::Error> {
    let lines = why.lines().map(|line| format!("# {line}\n")).collect::<String>();
    Ok(format!("{lines}instruction = {}\n{}", toml::Value::from(instruction), toml::to_string(settings)?))
}
