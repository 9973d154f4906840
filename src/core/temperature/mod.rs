//! Runs of one rig at several temperatures: each fitted by itself, with trends, and all together under laws of the temperature.
//!
//! Apart, every run has its own wave speed and creep; a weighted line through the values says how they go with temperature.
//! Together, the compliances J_k are shared, the retardation times shift by one factor, `tau_k(T) = a_T tau_k(T0)`, and the wall's modulus
//! follows a law of its own; the water's bulk modulus and density at each temperature do the rest of the wave speed. Whether the laws
//! describe the runs is what the two fits tell against each other.

pub mod apart;
pub(crate) mod compare;
pub(crate) mod joint;
pub mod law;
pub(crate) mod start;
pub mod trend;

pub use crate::temperature::compare::{Comparison, Verdict};
pub use crate::temperature::joint::{LawParameter, RunError, Together};

use crate::fit::data::run_data::RunData;
use crate::fit::outcome::fit::Fit;
use crate::fit::search::calibrate::{FitError, Options, Progress};
use crate::model::effects::Chosen;
use crate::rig::Rig;
use crate::temperature::apart::Quantity;
use crate::temperature::law::{Laws, Shift};

/// Temperatures nearer to each other than this tell no law of the temperature, K.
const LEAST_SPREAD_K: f64 = 2.0;

/// Where a run's temperature comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Source {
    /// Its own temperature sensor.
    Sensor,
    /// The rig file.
    Rig,
    /// Whoever asked for the fit.
    Given,
}

impl Source {
    /// In a word.
    pub fn name(self) -> &'static str {
        match self {
            Source::Sensor => "sensor",
            Source::Rig => "rig file",
            Source::Given => "given",
        }
    }
}

/// One run of a family.
#[derive(Debug, Clone)]
pub struct Member {
    /// Temperature of water and wall, °C.
    pub temperature_degc: f64,
    /// Where that comes from.
    pub source: Source,
    /// The run.
    pub data: RunData,
}

/// What to do with a family.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// Fit them together, too, under these laws.
    pub laws: Option<Laws>,
    /// Temperature that the laws' values are given at, °C; the runs' mean unless another is named.
    pub reference_degc: Option<f64>,
    /// Standard deviation of the runs' temperatures, K.
    pub temperature_sd_k: f64,
    /// Of each fit.
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
    /// What goes with temperature: wave speed, modulus, elements.
    pub quantities: Vec<Quantity>,
    /// The fit of all runs under the laws.
    pub together: Option<Together>,
    /// What a reader has to know.
    pub remarks: Vec<String>,
}

/// Why a family cannot be fitted.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // the sentences say it
pub enum FamilyError {
    #[error("one run is no family: give two or more, at several temperatures")]
    OneRun,
    #[error(
        "no run has recorded its temperature, and their rig files all say {degc} °C: name each run's with --temperature-degC, in the files' order"
    )]
    NoTemperature { degc: f64 },
    #[error(
        "all runs lie between {low:.2} and {high:.2} °C: a law of the temperature needs runs at least {LEAST_SPREAD_K} K apart; `surgescope calibrate` \
         fits runs at one temperature together"
    )]
    OneTemperature { low: f64, high: f64 },
    #[error("{file} was made on another rig than {first}: {what} differs; a family is of one rig")]
    OtherRig { file: String, first: String, what: &'static str },
    #[error(
        "the law of Williams, Landel and Ferry has two constants: it takes three temperatures or more, and these are {have}"
    )]
    TooFewForWlf { have: usize },
    #[error(
        "{file}: the fitted wave speed of {wave_speed_m_s:.0} m/s is that of sound in the water or more, which no elastic wall gives: check length \
         and clock"
    )]
    NoWall { file: String, wave_speed_m_s: f64 },
    #[error(transparent)]
    Fit(#[from] FitError),
}

impl From<crate::model::ModelError> for FamilyError {
    fn from(error: crate::model::ModelError) -> Self {
        FamilyError::Fit(FitError::Model(error))
    }
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
    let fits = crate::temperature::apart::apart(rig, &members, effects, &plan.options, progress)?;
    let mut remarks = Vec::new();
    let mut quantities = crate::temperature::apart::quantities(
        rig,
        &members,
        &fits,
        (reference_degc, plan.temperature_sd_k),
        &mut remarks,
    )?;
    let together = match plan.laws {
        Some(laws) => Some(crate::temperature::joint::together(
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

/// The runs' temperatures, if they can tell a law.
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
