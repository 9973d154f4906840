//! The variables of a problem by what they describe: wave speeds, closure, levels, creep.

use crate::fit::problem::fit_problem::FitProblem;
use crate::fit::problem::thresholds::{VISIBLE_COMPLIANCE_SHARE, VISIBLE_TIMES_PERIODS};

/// The variables of a model by what they describe.
pub(crate) struct Groups {
    pub(crate) wave_speeds: Vec<usize>,
    /// Closing time and start of each valve, and its law.
    pub(crate) closure: Vec<usize>,
    pub(crate) velocities: Vec<usize>,
    pub(crate) levels: Vec<usize>,
    pub(crate) friction: Vec<usize>,
    /// Compliances and retardation times of the elements of creep.
    pub(crate) compliances: Vec<usize>,
    pub(crate) times: Vec<usize>,
    pub(crate) others: Vec<usize>,
}

impl Groups {
    /// The groups of a problem.
    pub(crate) fn of(problem: &FitProblem) -> Self {
        let model = problem.model;
        let named = |names: &[&str]| -> Vec<usize> {
            (model.shared.len()..problem.parameters.len())
                .filter(|&j| names.iter().any(|n| problem.parameters[j].name.starts_with(n)))
                .collect()
        };
        let mut groups = Groups {
            wave_speeds: (0..model.rig.pipes.len()).collect(),
            closure: (model.rig.pipes.len()..model.effects_from())
                .chain(named(&["closing_time", "closure_start"]))
                .collect(),
            velocities: named(&["initial_velocity"]),
            levels: named(&["valve_head", "offset"]),
            friction: named(&["friction_scale"]),
            compliances: vec![],
            times: vec![],
            others: vec![],
        };
        let mut at = model.effects_from();
        for (chosen, &size) in model.effects.iter().zip(model.effect_sizes()) {
            for j in at..at + size {
                match problem.parameters[j].unit {
                    "1/GPa" => groups.compliances.push(j),
                    "s" if chosen.effect.elements().is_some() => groups.times.push(j),
                    _ if chosen.effect.name().starts_with("valve-law") => groups.closure.push(j),
                    _ => groups.others.push(j),
                }
            }
            at += size;
        }
        groups
    }

    /// Narrows bounds to the elements of creep that a surge of this period can show.
    pub(crate) fn keep_visible(&self, lower: &mut [f64], upper: &mut [f64], period_s: f64) {
        for &j in &self.times {
            let (quickest, slowest) = VISIBLE_TIMES_PERIODS;
            lower[j] = (quickest * period_s).ln().clamp(lower[j], upper[j]);
            upper[j] = (slowest * period_s).ln().clamp(lower[j], upper[j]);
        }
        for &j in &self.compliances {
            lower[j] = (upper[j] + VISIBLE_COMPLIANCE_SHARE.ln()).clamp(lower[j], upper[j]);
        }
    }
}
