//! The fit of a family of runs: each by itself, then all together.

use crate::fit::outcome::fit::Fit;
use crate::fit::progress::Progress;
use crate::fit::search::options::Options;
use crate::model::effects::Chosen;
use crate::rig::Rig;
use crate::temperature::apart::{Quantity, apart, quantities};
use crate::temperature::joint::{Together, together};
use crate::temperature::law::{Laws, Shift};
use crate::temperature::member::{FamilyError, Member, Source};
use crate::temperature::thresholds::LEAST_SPREAD_K;

/// What to do with a family.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// Laws under which the runs are also fitted together.
    pub laws: Option<Laws>,
    /// Temperature that the laws' values are given at, °C; the runs' mean unless another is named.
    pub reference_degc: Option<f64>,
    /// Standard deviation of the runs' temperatures, K.
    pub temperature_sd_k: f64,
    /// Options of each fit.
    pub options: Options,
}

/// A fitted family.
#[derive(Debug, Clone)]
pub struct Family {
    /// The runs.
    pub members: Vec<Member>,
    /// Effects beside the base model, the number of elements decided.
    pub effects: Vec<String>,
    /// Temperature that values of laws and lines are given at, °C.
    pub reference_degc: f64,
    /// Each run's own fit.
    pub fits: Vec<Fit>,
    /// Quantities that may depend on temperature: wave speed, modulus, elements.
    pub quantities: Vec<Quantity>,
    /// The fit of all runs under the laws.
    pub together: Option<Together>,
    /// Warnings for the reader.
    pub remarks: Vec<String>,
}

/// Refuses runs of another rig: other pipes, supply or valve. Nominal wave speeds, temperatures and sensors may differ.
///
/// # Errors
/// The first difference.
pub fn same_rig(first: (&str, &Rig), other: (&str, &Rig)) -> Result<(), FamilyError> {
    let pipes = |rig: &Rig| -> Vec<_> {
        rig.pipes.iter().map(|p| crate::rig::Pipe { wave_speed_m_s: None, ..p.clone() }).collect()
    };
    let what = if pipes(first.1) != pipes(other.1) {
        "a pipe"
    } else if first.1.upstream != other.1.upstream {
        "the supply"
    } else if first.1.valve != other.1.valve {
        "the valve"
    } else {
        return Ok(());
    };
    Err(FamilyError::OtherRig { file: other.0.to_owned(), first: first.0.to_owned(), what })
}

/// Fits a family; `rig` is that of all runs.
///
/// # Errors
/// Fewer than two runs or temperatures, a law with more constants than temperatures, runs that cannot be fitted.
pub fn family(
    rig: &Rig,
    members: Vec<Member>,
    effects: &[Chosen],
    plan: &Plan,
    progress: &(dyn Fn(&str, &Progress) + Sync),
) -> Result<Family, FamilyError> {
    let temperatures = check(&members, plan)?;
    let mean = temperatures.iter().sum::<f64>() / temperatures.len() as f64;
    let mut reference_degc = plan.reference_degc.unwrap_or(mean.round());
    if let Some(Laws { shift: Shift::Free, .. }) = plan.laws {
        // Free factors are measured against one of the runs.
        let near = |t: &&f64| (**t - reference_degc).abs();
        reference_degc = *temperatures.iter().min_by(|a, b| near(a).total_cmp(&near(b))).unwrap_or(&mean);
    }
    let fits = apart(rig, &members, effects, &plan.options, progress)?;
    let mut remarks = Vec::new();
    let mut quantities = quantities(rig, &members, &fits, (reference_degc, plan.temperature_sd_k), &mut remarks)?;
    let together = match plan.laws {
        Some(laws) => Some(together(
            rig,
            &members,
            &fits,
            (laws, reference_degc, plan.temperature_sd_k),
            &mut quantities,
            progress,
        )?),
        None => None,
    };
    remarks.extend(together.iter().flat_map(Together::remarks));
    let effects = fits.first().map(Fit::labels).unwrap_or_default();
    Ok(Family { members, effects, reference_degc, fits, quantities, together, remarks })
}

/// The runs' temperatures, if they can show a law.
fn check(members: &[Member], plan: &Plan) -> Result<Vec<f64>, FamilyError> {
    if members.len() < 2 {
        return Err(FamilyError::OneRun);
    }
    let temperatures: Vec<f64> = members.iter().map(|m| m.temperature_degc).collect();
    let mut sorted = temperatures.clone();
    sorted.sort_by(f64::total_cmp);
    let (low, high) = (sorted[0], sorted[sorted.len() - 1]);
    if high - low < LEAST_SPREAD_K {
        let unknown = low == high && members.iter().all(|m| m.source == Source::Rig);
        return Err(if unknown {
            FamilyError::NoTemperature { degc: low }
        } else {
            FamilyError::OneTemperature { low, high }
        });
    }
    let have = 1 + sorted.windows(2).filter(|w| w[1] - w[0] > 0.5 * LEAST_SPREAD_K).count();
    if plan.laws.is_some_and(|l| l.shift == Shift::Wlf) && have < 3 {
        return Err(FamilyError::TooFewForWlf { have });
    }
    Ok(temperatures)
}
