//! The rules that the source paper derives from its sensitivity analysis, tested one by one on a rig.
//!
//! Each is tested on three closures: as set; on the same rig eight times as long (period and closing time eight times
//! as long, friction an eighth, the walls as they are), which tells a rule about τ in seconds from one about τ/T; and
//! with the rig's nominal closing time where that is another one. Where the paper says two things, both are tested.

use crate::claim::{Evidence, Finding};
use crate::claims::CLAIMS;
use crate::designs::Designs;
use crate::sweep::Sweeps;
use surgescope::model::effects::name_of;
use surgescope::model::{Model, RunValues};
use surgescope::sensitivity::subject::{Subject, sensor};
use surgescope::sensitivity::{SensitivityError, Tick};

/// How much longer the second rig is.
const LONGER: f64 = 8.0;

/// All rules on all closures.
#[derive(Debug, Clone, PartialEq)]
pub struct Rules {
    /// Name of the rig.
    pub rig: String,
    /// The closures on which they were tested.
    pub cases: Vec<Case>,
    /// The rules.
    pub rules: Vec<Rule>,
    /// Reaches of the grid.
    pub reaches: usize,
    /// Simulations.
    pub runs: usize,
}

/// One closure.
#[derive(Debug, Clone, PartialEq)]
pub struct Case {
    /// What it is called.
    pub name: String,
    /// Theoretical period `4L/a`, s.
    pub period_s: f64,
    /// Closing time, s.
    pub closing_time_s: f64,
    /// Velocity before the closure, m/s.
    pub velocity_m_s: f64,
}

/// One rule.
#[derive(Debug, Clone, PartialEq)]
pub struct Rule {
    /// What the paper says, shortened.
    pub says: &'static str,
    /// Where it says so.
    pub place: &'static str,
    /// How it was tested.
    pub test: &'static str,
    /// What was found, one a case.
    pub findings: Vec<Finding>,
}

/// Simulations that a test takes, at most.
pub fn runs() -> usize {
    3 * (Sweeps::runs() + Designs::runs())
}

/// Tests the rules around a model with a two-element wall.
///
/// # Errors
/// Another model; if a simulation fails.
pub fn test(subject: &Subject, tick: Tick) -> Result<Rules, SensitivityError> {
    let two = |m: &Model| {
        m.effects.len() == 1 && m.effects[0].effect.name() == "viscoelastic-wall" && m.effects[0].elements == Some(2)
    };
    if !two(&subject.model) {
        return Err(SensitivityError::NeedsTwoElements { effects: name_of(&subject.model.effects) });
    }
    let closing = subject.values.len() - RunValues::COUNT + 2;
    let friction = closing + 1;
    let mut cases = Vec::new();
    let mut evidence = Vec::new();
    let mut add = |name: String, subject: &Subject| -> Result<(), SensitivityError> {
        cases.push(Case {
            name,
            period_s: subject.period_s(),
            closing_time_s: subject.values[closing],
            velocity_m_s: subject.values[closing - 2],
        });
        evidence.push(Evidence { sweeps: Sweeps::run(subject, tick)?, designs: Designs::run(subject, tick)? });
        Ok(())
    };
    add("as set".to_owned(), subject)?;

    let mut rig = subject.model.rig.clone();
    rig.pipes.iter_mut().for_each(|p| p.length_m *= LONGER);
    rig.sensors.iter_mut().for_each(|s| s.position_m *= LONGER);
    let model = Model::new(&rig, &subject.conditions.water, &subject.model.effects);
    let mut values = subject.values.clone();
    values[closing] *= LONGER;
    values[friction] /= LONGER;
    let sensor = sensor(&rig, Some(&subject.sensor.name))?;
    add(format!("{LONGER} times as long"), &Subject { model, values, sensor, ..subject.clone() })?;

    let nominal_s = subject.model.rig.valve.closing_time_s;
    if (nominal_s / subject.values[closing] - 1.0).abs() > 0.01 {
        let mut values = subject.values.clone();
        values[closing] = nominal_s;
        add(format!("closing in {nominal_s} s"), &Subject { values, ..subject.clone() })?;
    }
    let rules = CLAIMS
        .iter()
        .map(|c| Rule {
            says: c.says,
            place: c.place,
            test: c.test,
            findings: evidence.iter().map(|e| (c.ask)(e)).collect(),
        })
        .collect();
    let runs = cases.len() * (Sweeps::runs() + Designs::runs());
    Ok(Rules { rig: subject.model.rig.name.clone(), cases, rules, reaches: subject.reaches, runs })
}
