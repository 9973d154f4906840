//! Which test would tell two rivals apart: both are simulated where they have not been fitted.

use rayon::prelude::*;

use super::ground::Ground;
use super::refit::Refit;
use crate::model::trace::Probe;
use crate::model::{ModelError, Resolution, RunValues};

/// A test that could be made.
struct Test {
    /// What to do.
    instruction: &'static str,
    /// Changes the run.
    change: fn(&mut RunValues),
    /// Heads are read here, as a share of the length.
    at: f64,
}

/// Times the noise that two rivals must differ by for a test to be worth making.
const TELLING: f64 = 3.0;

const TESTS: [Test; 5] = [
    Test { instruction: "repeat the test at half the flow", change: |v| v.initial_velocity_m_s *= 0.5, at: 1.0 },
    Test {
        instruction: "repeat the test at one and a half times the flow",
        change: |v| v.initial_velocity_m_s *= 1.5,
        at: 1.0,
    },
    Test { instruction: "close the valve four times as slowly", change: |v| v.closing_time_s *= 4.0, at: 1.0 },
    Test { instruction: "raise the static head by 20 m", change: |v| v.valve_head_m += 20.0, at: 1.0 },
    Test { instruction: "add a pressure sensor at mid-length", change: |_| {}, at: 0.5 },
];

/// The test in which two rivals, as fitted, differ most, in words; `None` where they cannot be simulated there.
pub fn next_test(ground: &Ground, one: &Refit, other: &Refit) -> Option<String> {
    let noise_m = ground.noise_m();
    let differences: Vec<Option<f64>> = TESTS
        .par_iter()
        .map(|test| {
            let (a, b) = (predicted(ground, one, test).ok()?, predicted(ground, other, test).ok()?);
            let n = a.len().min(b.len()).max(1) as f64;
            // A sensor's zero would take up what differs throughout.
            let mean = a.iter().zip(&b).map(|(x, y)| x - y).sum::<f64>() / n;
            Some((a.iter().zip(&b).map(|(x, y)| (x - y - mean).powi(2)).sum::<f64>() / n).sqrt())
        })
        .collect();
    let best =
        TESTS.iter().zip(differences).filter_map(|(t, d)| d.map(|d| (t, d))).max_by(|a, b| a.1.total_cmp(&b.1))?;
    let (test, difference_m) = best;
    if difference_m < TELLING * noise_m {
        return None;
    }
    Some(format!(
        "{} and {} cannot be told apart by these recordings: {}; there the two models, as fitted, differ by {:.3} m rms ({:.1} times \
         the noise)",
        one.form.effect,
        other.form.effect,
        test.instruction,
        difference_m,
        difference_m / noise_m
    ))
}

fn predicted(ground: &Ground, refit: &Refit, test: &Test) -> Result<Vec<f64>, ModelError> {
    let model = ground.model(&refit.effects);
    let (shared, own) = refit.values.split_at(model.shared.len());
    let mut run = RunValues::from_slice(own.first_chunk().unwrap_or(&[f64::NAN; RunValues::COUNT]));
    (test.change)(&mut run);
    let duration_s = 8.0 * model.period_s(shared);
    let probe = Probe::Head(test.at * ground.rig.length_m());
    let resolution = Resolution { reaches: ground.reaches, duration_s };
    let trace = model.simulate(&ground.runs[0].conditions, shared, &run, resolution, &[probe])?.traces.remove(0);
    Ok((0..2000).map(|i| trace.at(f64::from(i) / 2000.0 * duration_s)).collect())
}
