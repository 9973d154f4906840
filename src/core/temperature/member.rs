//! One run of a family, and why a family cannot be fitted.

use crate::fit::data::run_data::RunData;
use crate::fit::problem::error::FitError;
use crate::temperature::thresholds::LEAST_SPREAD_K;

/// Where a run's temperature comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Source {
    /// Its own temperature sensor.
    Sensor,
    /// The rig file.
    Rig,
    /// The caller.
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

/// Why a family cannot be fitted.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // the sentences say it
pub enum FamilyError {
    #[error("one run is no family: give two or more, at several temperatures")]
    OneRun,
    #[error(
        "no run has recorded its temperature, and their rig files all say {degc} °C: give the temperature of each run"
    )]
    NoTemperature { degc: f64 },
    #[error(
        "all runs lie between {low:.2} and {high:.2} °C: a law of the temperature needs runs at least {LEAST_SPREAD_K} K apart; runs \
         at one temperature can be calibrated together"
    )]
    OneTemperature { low: f64, high: f64 },
    #[error("{file} was made on another rig than {first}: {what} differs; a family is of one rig")]
    OtherRig { file: String, first: String, what: &'static str },
    #[error(
        "the law of Williams, Landel and Ferry has two constants: it needs three temperatures or more, and there are {have}"
    )]
    TooFewForWlf { have: usize },
    #[error(
        "{file}: the fitted wave speed of {wave_speed_m_s:.0} m/s reaches that of sound in the water, which no elastic wall allows: check length \
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
