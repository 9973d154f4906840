//! A diagnosis against the rig's history: what to keep of it, what to say in one line, whether to accept its model.

use crate::diagnose::{Diagnosis, Verdict};
use crate::fit::outcome::fit::{Fit, FittedParameter};
use crate::number::{significant, with_error};
use crate::report::text::number::{error_m, plus_minus, probability, times_noise};
use crate::results::history::drift::{Expected, Point, expected};
use crate::results::history::{Finding, Run, Value};

/// Probability that all values of a run that is like the earlier ones are within their history.
const LEVEL: f64 = 0.95;

/// Which models become the rig's without being asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Accept {
    /// None.
    Never,
    /// Those of runs in which nothing is missing, nothing contradicts the meters, and whose values are within their
    /// history.
    Clean,
}

/// How a run's values compare with those of earlier runs of the rig under the same model.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Compared {
    /// Earlier runs that count.
    pub earlier: usize,
    /// Values that could be compared.
    pub compared: usize,
    /// Those that are not what was to be expected.
    pub outside: Vec<(Value, Expected)>,
}

/// The values of a fit.
pub fn values(fit: &Fit) -> Vec<Value> {
    let of = |p: &FittedParameter| Value {
        name: p.name.clone(),
        value: p.value,
        standard_error: p.known_error().filter(|_| !p.at_bound),
        unit: p.unit.to_owned(),
        own: p.run.is_some(),
    };
    fit.parameters.iter().map(of).collect()
}

/// Compares a run's values with those of `earlier` runs of the rig, in all of which nothing is missing.
pub fn compare(values: &[Value], effects: &[String], temperature_degc: Option<f64>, earlier: &[Run]) -> Compared {
    let alike = |run: &&Run| run.is_sound() && run.finding.as_ref().is_some_and(|f| f.effects == effects);
    let earlier: Vec<&Run> = earlier.iter().filter(alike).collect();
    let shared: Vec<&Value> = values.iter().filter(|v| !v.own && v.standard_error.is_some()).collect();
    // Each value gets its share of the error probability (Bonferroni).
    let level = 1.0 - (1.0 - LEVEL) / shared.len().max(1) as f64;
    let mut result = Compared { earlier: earlier.len(), ..Compared::default() };
    for value in shared {
        let points: Vec<Point> = earlier.iter().enumerate().filter_map(|(i, run)| point(run, i, &value.name)).collect();
        let Some(expected) = expected(&points, temperature_degc, value.standard_error.unwrap_or(0.0), level) else {
            continue;
        };
        result.compared += 1;
        if !expected.holds(value.value) {
            result.outside.push((value.clone(), expected));
        }
    }
    result
}

fn point(run: &Run, i: usize, name: &str) -> Option<Point> {
    let finding = run.finding.as_ref()?;
    let value = finding.parameters.iter().find(|v| v.name == name)?;
    let standard_error = value.standard_error?;
    Some(Point { run: i as f64, temperature_degc: finding.temperature_degc, value: value.value, standard_error })
}

/// Whether a run's model is to become the rig's by itself.
pub fn is_clean(diagnosis: &Diagnosis, compared: &Compared, contradictions: usize) -> bool {
    diagnosis.verdict == Verdict::NothingMissing
        && diagnosis.start.converged
        && compared.outside.is_empty()
        && contradictions == 0
}

/// The finding without its line and files.
pub fn finding(diagnosis: &Diagnosis, temperature_degc: f64, flow_m3_s: Option<f64>) -> Finding {
    let fit = &diagnosis.start;
    let (rmse_m, noise_m) = fit.pooled();
    let missing = (diagnosis.verdict == Verdict::MissingEffect).then(|| diagnosis.answer_label());
    Finding {
        temperature_degc: Some(temperature_degc).filter(|t| t.is_finite()),
        flow_m3_s,
        effects: fit.labels(),
        verdict: diagnosis.verdict.name().to_owned(),
        missing,
        probability: diagnosis.probability,
        rmse_m,
        noise_m,
        parameters: values(fit),
        ..Finding::default()
    }
}

/// A run's file and verdict in one line.
pub fn line_of(run: &Run) -> String {
    match (&run.finding, &run.error) {
        (Some(finding), _) => format!("{}: {}", run.file, finding.line),
        (None, Some(error)) => format!("{}: failed: {error}", run.file),
        (None, None) => format!("{}: {}", run.file, run.state.name()),
    }
}

/// A value in the digits of its error; of a model that lacks something, which pulls it by nobody knows how much, about
/// that.
fn told(value: &Value, lacks: bool) -> String {
    if lacks {
        return format!("≈ {}", significant(value.value, 3));
    }
    with_error(value.value, value.standard_error.unwrap_or(f64::INFINITY))
}

/// All in one line, without the file's name: verdict, error, wave speed, how it compares, what to do.
pub fn line(diagnosis: &Diagnosis, finding: &Finding, compared: &Compared, accepted: bool, file: &str) -> String {
    let Finding { rmse_m, noise_m, probability: certain, .. } = finding;
    let error = format!("RMSE {} m ({})", error_m(*rmse_m), times_noise(*rmse_m, *noise_m));
    let sure = probability(*certain);
    let best = diagnosis.candidates.first();
    let beyond = match finding.effects.as_slice() {
        [] => "from the base model".to_owned(),
        effects => format!("beyond {}", effects.join(", ")),
    };
    let mut parts = match (diagnosis.verdict, best) {
        (Verdict::NothingMissing, _) => vec![format!("nothing missing {beyond}"), error],
        (Verdict::MissingEffect, Some(best)) => {
            let left_m = diagnosis.answer().map_or(best.rmse_m, |fit| fit.pooled().0);
            let with = format!("{error}, {} m with it", error_m(left_m));
            vec![format!("{} missing {beyond} (probability {sure})", diagnosis.answer_label()), with]
        }
        _ => vec![format!("something is missing {beyond} that no effect explains (probability {sure})"), error],
    };
    // that of the model that explains the record, where there is one
    let answer = diagnosis.answer().map(values);
    let lacks = answer.is_none() && finding.lacks_something();
    let of_model = answer.as_ref().unwrap_or(&finding.parameters);
    let speeds = of_model.iter().filter(|v| v.name.starts_with("wave_speed_m_s"));
    parts.extend(speeds.map(|v| {
        let pipe = v.name.trim_start_matches("wave_speed_m_s");
        format!("a{pipe} {} m/s", told(v, lacks))
    }));
    parts.push(match (compared.earlier, compared.compared) {
        (0, _) => "first run of this rig and model".to_owned(),
        (earlier, 0) => {
            format!("{earlier} earlier run{}, too few to compare with", if earlier == 1 { "" } else { "s" })
        }
        (earlier, _) if compared.outside.is_empty() => format!("within the range of {earlier} earlier runs"),
        (earlier, _) => {
            let odd = compared.outside.iter().map(|(value, expected)| {
                format!(
                    "{} {} where {} runs gave {}",
                    value.name,
                    told(value, finding.lacks_something()),
                    earlier,
                    plus_minus(expected.value, expected.half_width)
                )
            });
            format!("outside the range of earlier runs: {}", odd.collect::<Vec<_>>().join(", "))
        }
    });
    let mut line = parts.join(", ");
    match (accepted, diagnosis.verdict) {
        (true, _) => line += "; accepted",
        (false, Verdict::MissingEffect) => line += &format!("; `surgescope accept {file}` adds it to the rig's model"),
        (false, Verdict::NothingMissing) => {
            line += &format!("; not accepted automatically: `surgescope accept {file}`")
        }
        (false, Verdict::UnknownEffect) => {}
    }
    line
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::history::{NOTHING_MISSING, State};

    fn value(name: &str, value: f64, own: bool) -> Value {
        Value { name: name.into(), value, standard_error: Some(0.1), unit: "m/s".into(), own }
    }

    /// A run whose wave speed falls by 2 m/s a kelvin.
    fn run(id: i64, degc: f64, verdict: &str, off: f64) -> Run {
        let finding = Finding {
            temperature_degc: Some(degc),
            effects: vec!["leak".into()],
            verdict: verdict.into(),
            parameters: vec![value("wave_speed_m_s", 435.0 - 2.0 * degc + off, false), value("velocity", off, true)],
            ..Finding::default()
        };
        Run {
            id,
            content: id.to_string(),
            file: format!("{id}.mcap"),
            rig: "lab".into(),
            recorded_unix_ns: id,
            state: State::Done,
            tries: 1,
            error: None,
            finding: Some(finding),
            accepted: false,
        }
    }

    fn compared(earlier: &[Run], speed: f64, degc: f64) -> Compared {
        compare(
            &[value("wave_speed_m_s", speed, false), value("velocity", 99.0, true)],
            &["leak".into()],
            Some(degc),
            earlier,
        )
    }

    #[test]
    fn a_value_is_held_against_sound_runs_of_the_same_model_at_its_temperature() {
        let degc = [20.0, 23.0, 18.0, 25.0, 21.0];
        let off = [0.1, -0.1, 0.05, 0.0, -0.05];
        let mut earlier: Vec<Run> = (0..5).map(|i| run(i as i64, degc[i], NOTHING_MISSING, off[i])).collect();
        let warm = compared(&earlier, 379.1, 28.0);
        assert_eq!((warm.earlier, warm.compared, warm.outside.len()), (5, 1, 0), "{warm:?}");
        let odd = compared(&earlier, 395.0, 28.0);
        assert_eq!(odd.outside.len(), 1);
        assert!((odd.outside[0].1.value - 379.0).abs() < 0.5);
        // What lacks something says nothing of the rig, unless a person accepted it.
        earlier.extend([30.0, 10.0, 40.0].map(|degc| run(9, degc, "missing-effect", 50.0)));
        assert_eq!(compared(&earlier, 379.1, 28.0), warm);
        let other = compare(&[value("wave_speed_m_s", 379.1, false)], &[], Some(28.0), &earlier);
        assert_eq!((other.earlier, other.compared), (0, 0), "another model has no history");
    }
}
