//! Whether an effect leaves the base model where it vanishes, and whether refinement converges.

use crate::model::effects::Chosen;
use crate::model::trace::Trace;
use crate::report::effects::example::PERIODS;
use crate::report::text::number::significant;
use crate::rig::Rig;
use crate::simulate::scenario::{Scenario, ValveForm};

type AnyError = Box<dyn std::error::Error + Send + Sync>;

/// What is left of an effect near the value at which it vanishes.
#[derive(Debug, serde::Serialize)]
pub struct Left {
    /// The parameter.
    pub parameter: String,
    /// Its value, where the effect vanishes.
    pub value: f64,
    /// Largest difference from the base model there, m.
    pub gone_m: f64,
    /// The same a millionth of the way to the start value, m.
    pub faint_m: f64,
    /// The same at the start value, m.
    pub whole_m: f64,
}

impl Left {
    /// Nothing where it is gone, and next to nothing beside it: a jump there would be one that no fit can cross.
    pub fn holds(&self) -> bool {
        self.gone_m == 0.0 && self.faint_m <= 1e-3 * self.whole_m + FAINT_M
    }
}

/// A joint at the effect's place takes friction about the flow of the step before: so much may that change, m.
const FAINT_M: f64 = 1e-3;
/// Grids that are compared.
const REACHES: [usize; 4] = [60, 120, 240, 480];
/// A sum of differences that falls by less than this from grid to grid does not converge: the first order halves it.
const LEAST_FALL: f64 = 1.3;
/// Differences as small as this are rounding, m.
const ROUNDING_M: f64 = 1e-9;

/// See the module.
#[derive(Debug, serde::Serialize)]
pub struct Checked {
    /// Each parameter at which it vanishes.
    pub vanishing: Vec<Left>,
    /// Grids, and the root mean square by which each differs from the one before, m.
    pub refined_m: Vec<(usize, f64)>,
    /// Whether that falls.
    pub converges: bool,
}

impl Checked {
    /// Checks an effect on a rig, at the values where a fit starts.
    ///
    /// # Errors
    /// A model that cannot be simulated.
    pub fn on(rig: &Rig, chosen: &Chosen) -> Result<Checked, AnyError> {
        let traces = |effects: &[Chosen], settings: &[(String, f64)]| -> Result<Vec<f64>, AnyError> {
            let scenario = Scenario::new(rig.clone(), effects, ValveForm::Linear, settings)?;
            let duration_s = PERIODS * scenario.period_s();
            Ok(points(&scenario.simulate(duration_s)?, duration_s))
        };
        let own = std::slice::from_ref(chosen);
        let with = |settings: &[(String, f64)]| traces(own, settings);
        let (base, whole) = (traces(&[], &[])?, with(&[])?);
        let scenario = Scenario::new(rig.clone(), own, ValveForm::Linear, &[])?;
        let mut vanishing = Vec::new();
        for p in scenario.model().shared {
            let Some(gone) = p.vanishes_at else { continue };
            let at = |value: f64| with(&[(p.name.clone(), value)]);
            let faint = gone + 1e-6 * (p.start - gone);
            vanishing.push(Left {
                gone_m: largest(&at(gone)?, &base),
                faint_m: largest(&at(faint)?, &base),
                whole_m: largest(&whole, &base),
                parameter: p.name,
                value: gone,
            });
        }
        let grids: Vec<Vec<f64>> =
            REACHES.iter().map(|&n| with(&[("reaches".to_owned(), n as f64)])).collect::<Result<_, _>>()?;
        let refined_m: Vec<(usize, f64)> =
            grids.windows(2).zip(&REACHES[1..]).map(|(w, n)| (*n, rms(&w[0], &w[1]))).collect();
        let falls = |w: &[(usize, f64)]| w[1].1 < ROUNDING_M || w[0].1 / w[1].1 > LEAST_FALL;
        Ok(Checked { converges: refined_m.windows(2).all(falls), vanishing, refined_m })
    }

    /// Whether all holds.
    pub fn holds(&self) -> bool {
        self.converges && self.vanishing.iter().all(Left::holds)
    }
}

/// All traces at even times.
fn points(traces: &[Trace], duration_s: f64) -> Vec<f64> {
    const POINTS: usize = 1000;
    let times = || (0..POINTS).map(|i| duration_s * i as f64 / POINTS as f64);
    traces.iter().flat_map(|trace| times().map(|t| trace.at(t))).collect()
}

fn largest(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

fn rms(a: &[f64], b: &[f64]) -> f64 {
    (a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / a.len() as f64).sqrt()
}

impl std::fmt::Display for Checked {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let answer = |holds: bool| if holds { "holds" } else { "FAILS" };
        for left in &self.vanishing {
            writeln!(
                f,
                "{}  at {} = {} it changes nothing: {} m; a millionth of the way to its start: {} m; there: {} m",
                answer(left.holds()),
                left.parameter,
                left.value,
                significant(left.gone_m, 2),
                significant(left.faint_m, 2),
                significant(left.whole_m, 2)
            )?;
        }
        let steps: Vec<String> = self
            .refined_m
            .iter()
            .zip(REACHES)
            .map(|((finer, m), coarser)| format!("{coarser} to {finer} reaches {} m", significant(*m, 2)))
            .collect();
        writeln!(f, "{}  refinement converges: from {}", answer(self.converges), steps.join(", "))
    }
}
