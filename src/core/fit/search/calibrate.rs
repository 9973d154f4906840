//! Calibration of a model: from coarse to fine, from the first cycles to the whole record.
//!
//! A wave speed a few percent off is half a period late after twenty cycles, where least squares sees no way back. So the
//! fit starts with the first cycle and a half on a coarse grid, then takes in more of the record as the phase locks. Then the
//! grid is refined until halving its step changes less than the noise does.

use std::sync::atomic::AtomicUsize;
use std::sync::{Mutex, PoisonError};

use crate::fit::data::run_data::RunData;
use crate::fit::outcome::fit::Fit;
use crate::fit::problem::fit_problem::{Calibration, Window};
use crate::fit::problem::method::Method;
use crate::fit::problem::objective::Misfit;
use crate::fit::search::coarse_fit::{Fitter, State};
use crate::fit::search::sensor_choice::with_sensors;
use crate::model::constraint::{Constraint, Given};
use crate::model::effects::Chosen;
use crate::model::prior::Prior;
use crate::model::{Model, ModelError, check_sensors};
use crate::rig::Rig;

/// Why a fit cannot be had.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // the sentences say it
pub enum FitError {
    #[error("there is no run to fit")]
    NoRun,
    #[error(
        "{file}: no pressure sample lies after the start of the closure; check the closure's time with `surgescope inspect`"
    )]
    NoSample { file: String },
    #[error(
        "{name} cannot be kept between {lower} and {upper}: its bounds must be finite, in order, and more than zero unless it may be negative"
    )]
    Bounds { name: String, lower: f64, upper: f64 },
    #[error("the model has no parameter '{name}'{of} to hold or to bound; it has {known}")]
    NoSuchParameter { name: String, of: String, known: String },
    #[error(
        "{file}: no pressure sensor stands at the valve (within {within_m:.2} m of the pipe's end), which shows how it closed"
    )]
    NoValveSensor { file: String, within_m: f64 },
    #[error(
        "{file}: {sensor} records less than three periods of the pipe after the closure: too short to compare frequencies; use --misfit time"
    )]
    NoRinging { file: String, sensor: String },
    #[error(transparent)]
    Model(#[from] ModelError),
}

/// What a fit is doing.
#[derive(Debug, Clone, PartialEq)]
pub struct Progress {
    /// The stage, in words.
    pub stage: String,
    /// Simulated reaches.
    pub reaches: usize,
    /// Iteration within the stage.
    pub iteration: usize,
    /// Root mean square of the weighted residuals: 1 is the noise.
    pub error_over_noise: f64,
}

/// How far a fit may go.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Most reaches of the grid.
    pub most_reaches: usize,
    /// Share of the noise that the grid's own error may have.
    pub grid_error_over_noise: f64,
    /// Most iterations on each of the finer grids.
    pub patience: usize,
    /// What has been settled about parameters.
    pub constraints: Vec<Constraint>,
    /// How to search.
    pub method: Method,
    /// What of the records is compared once the phase is locked.
    pub misfit: Misfit,
    /// Random starts of least squares beside those that the signals and the effects propose.
    pub starts: usize,
    /// Simulations that a global search may take.
    pub budget: usize,
    /// Steps after which a stepwise calibration stops.
    pub most_steps: usize,
    /// Of a stepwise calibration that goes on from values as they are: names of the features that it has still to use, each once.
    pub features_left: Option<Vec<String>>,
    /// Where parameters start, instead of where signals, rig and effects say.
    pub starts_at: Vec<Given>,
    /// Seed of all that is drawn at random.
    pub seed: u64,
    /// What is known of shared parameters from elsewhere, such as a creep test; a fit begins with the elements that it tells all of.
    pub priors: Vec<Prior>,
}

impl Default for Options {
    fn default() -> Self {
        Options {
            most_reaches: 512,
            grid_error_over_noise: 0.3,
            patience: 40,
            constraints: Vec::new(),
            method: Method::LeastSquares,
            misfit: Misfit::Time,
            starts: 0,
            budget: 20_000,
            most_steps: usize::MAX,
            features_left: None,
            starts_at: Vec::new(),
            seed: 1,
            priors: Vec::new(),
        }
    }
}

/// Evidence (difference of BIC) that one more element must bring: "strong" on the scale of Kass & Raftery (1995).
pub const EVIDENCE: f64 = 6.0;

/// Fits the base model with `effects` to all `runs` at once.
///
/// Where an effect has elements and their number is not fixed, they are added one by one while the evidence asks for it. Where one
/// concerns a pressure sensor and none is named, it goes to the sensor at which a coarse fit is best.
///
/// # Errors
/// No run, a run without samples after its closure, a model that cannot be simulated at its start.
pub fn calibrate(
    rig: &Rig,
    runs: &[RunData],
    effects: &[Chosen],
    options: &Options,
    progress: &(dyn Fn(&Progress) + Sync),
) -> Result<Fit, FitError> {
    for run in runs {
        let any = run.sensors.iter().any(|s| s.time_s.last().is_some_and(|&t| t > run.start.closure_s.0));
        if !any {
            return Err(FitError::NoSample { file: run.file.clone() });
        }
    }
    check_sensors(rig, effects)?;
    if options.misfit == Misfit::Frequency {
        let model = Model::new(rig, &runs[0].conditions.water, &[]);
        let window = Window { reaches: 1, horizon_s: f64::INFINITY, stride: 1 };
        if let Some((file, sensor)) = Calibration::new(&model, runs, window).comparing(options.misfit).too_short() {
            return Err(FitError::NoRinging { file, sensor });
        }
    }
    let fitter = Fitter::new(rig, runs, options, progress, effects, None)?;
    let mut chosen = fitter.placed(effects)?;
    // An effect with elements grows from one: descent from scratch with many ends in poorer places, unless it is told where to start.
    let told = !options.starts_at.is_empty() || options.method != Method::LeastSquares;
    let growing = growing(effects).filter(|&i| effects[i].elements.is_none() || !told);
    if let Some(i) = growing {
        chosen[i] = chosen[i].with_elements(fitter.known_elements(&chosen, i));
    }
    let mut model = fitter.model(&chosen);
    let steps = Mutex::new(Vec::new());
    let found = |model: &Model, smaller: Option<(&Model, &State)>| match options.method {
        Method::LeastSquares => fitter.approach(model, smaller),
        Method::Global | Method::MicroGa | Method::GlobalLocal => Ok(fitter.searched(model)?),
        Method::Stepwise => {
            let (state, walked) = fitter.stepped(model)?;
            steps.lock().unwrap_or_else(PoisonError::into_inner).push((model.effects.clone(), walked));
            Ok(state)
        }
    };
    let mut state = found(&model, None)?;
    if let Some(i) = growing {
        // Where an element is missing, those that are known are drawn off to stand in for it: they are begun with anew, too.
        let grown = |bigger: &Model, model: &Model, state: &State| {
            let on = found(bigger, Some((model, state)))?;
            if options.priors.is_empty() {
                return Ok(on);
            }
            let anew = found(bigger, None)?;
            Ok(if anew.cost < on.cost { anew } else { on })
        };
        (model, state) = fitter.grown((model, state), i, effects[i].elements, grown)?;
    }
    if options.method.descends() {
        return fitter.finish(&model, state);
    }
    // Of the models that were tried with more and more elements, the steps of the one that was kept.
    let tried = steps.into_inner().unwrap_or_else(PoisonError::into_inner);
    match tried.into_iter().find(|(effects, _)| *effects == model.effects) {
        Some((_, walked)) => fitter.ended(&model, state, walked),
        None => fitter.as_found(&model, state),
    }
}

/// A coarse fit from the signals.
#[derive(Debug, Clone)]
pub struct Coarse {
    /// The effects, sensors chosen.
    pub effects: Vec<Chosen>,
    /// Values of all variables: shared ones first, then each run's.
    pub values: Vec<f64>,
    /// Mean square of the residuals, in units of the noise's, priors among them.
    pub mean_square: f64,
}

/// Fits a model coarsely, from the signals alone: some of the samples, on a coarse grid. [`refine`] goes on from there.
///
/// # Errors
/// As [`calibrate`]; elements have to have a number.
pub fn approach(rig: &Rig, runs: &[RunData], effects: &[Chosen], options: &Options) -> Result<Coarse, FitError> {
    let fitter = Fitter::new(rig, runs, options, &|_| {}, effects, None)?;
    let effects = fitter.placed(effects)?;
    let model = fitter.model(&effects);
    let state = fitter.approach(&model, None)?;
    let mean_square = fitter.mean_square(&model, &state);
    Ok(Coarse { mean_square, values: state.values, effects })
}

/// Fits a model on from `values` of all its variables (shared ones, then each run's): to all samples, on as fine a grid as it takes.
///
/// # Errors
/// As [`calibrate`].
pub fn refine(
    rig: &Rig,
    runs: &[RunData],
    effects: &[Chosen],
    values: &[f64],
    options: &Options,
    progress: &(dyn Fn(&Progress) + Sync),
) -> Result<Fit, FitError> {
    let fitter = Fitter::new(rig, runs, options, progress, effects, Some(values))?;
    fitter.finish(&fitter.model(effects), State { values: values.to_vec(), cost: f64::NAN })
}

/// Where the number of elements was left open in what was `asked` for, a fitted model with more of them, while the evidence asks for
/// more; none where it does not.
///
/// # Errors
/// As [`calibrate`].
pub fn with_more_elements(
    rig: &Rig,
    runs: &[RunData],
    fit: &Fit,
    asked: &[Chosen],
    options: &Options,
    progress: &(dyn Fn(&Progress) + Sync),
) -> Result<Option<Fit>, FitError> {
    let Some(i) = growing(asked).filter(|&i| asked[i].elements.is_none()) else { return Ok(None) };
    let state = State { values: fit.values(), cost: f64::NAN };
    let fitter = Fitter::new(rig, runs, options, progress, &fit.effects, Some(&state.values))?;
    let start = (fitter.model(&fit.effects), state);
    let (model, state) = fitter.grown(start, i, None, |bigger, model, state| fitter.grow(bigger, model, state))?;
    if model.effects == fit.effects {
        return Ok(None);
    }
    fitter.finish(&model, state).map(Some)
}

/// Effects whose number of elements is left open with as many as are known beforehand, else with one: as a fit begins with them.
///
/// # Errors
/// No run.
pub fn numbered(rig: &Rig, runs: &[RunData], effects: &[Chosen], options: &Options) -> Result<Vec<Chosen>, FitError> {
    let mut chosen = effects.to_vec();
    if let Some(i) = growing(effects).filter(|&i| effects[i].elements.is_none()) {
        let fitter = Fitter::new(rig, runs, options, &|_| {}, effects, None)?;
        chosen[i] = chosen[i].with_elements(fitter.known_elements(effects, i));
    }
    Ok(chosen)
}

/// The effect of a list whose elements are added one by one.
fn growing(effects: &[Chosen]) -> Option<usize> {
    effects.iter().position(|c| c.effect.elements().is_some_and(|r| r.contains(&2)))
}

impl<'a> Fitter<'a> {
    /// Of models that have `effects` or more; what the pipes need at the least is taken from the model's `values`, or from its starts.
    pub(crate) fn new(
        rig: &'a Rig,
        runs: &'a [RunData],
        options: &'a Options,
        progress: &'a (dyn Fn(&Progress) + Sync),
        effects: &[Chosen],
        values: Option<&[f64]>,
    ) -> Result<Self, FitError> {
        let water = &runs.first().ok_or(FitError::NoRun)?.conditions.water;
        let mut fitter =
            Fitter { rig, water, runs, options, progress, evaluations: AtomicUsize::new(0), least_reaches: 0 };
        let model = fitter.model(effects);
        let starts: Vec<f64> = model.shared.iter().map(|p| p.start).collect();
        fitter.least_reaches = model.least_reaches(values.map_or(&starts[..], |v| &v[..model.shared.len()]));
        Ok(fitter)
    }

    pub(crate) fn model(&self, effects: &[Chosen]) -> Model<'a> {
        Model::new(self.rig, self.water, effects)
            .constrained(&self.options.constraints)
            .starting_at(&self.options.starts_at)
            .informed(&self.options.priors)
    }

    /// Elements of effect `i` of which all is known beforehand, as by a creep test: with these a fit begins; with one where there are none.
    fn known_elements(&self, effects: &[Chosen], i: usize) -> usize {
        let most = effects[i].most_elements().unwrap_or(1);
        let known = |n: &usize| {
            let mut with = effects.to_vec();
            with[i] = with[i].with_elements(*n);
            let model = self.model(&with);
            let from = model.effects_from() + model.effect_sizes()[..i].iter().sum::<usize>();
            model.shared[from..][..model.effect_sizes()[i]].iter().all(|p| p.prior.is_some())
        };
        (1..=most).rev().find(known).unwrap_or(1)
    }

    /// Effects that concern a sensor, each at the one where a coarse fit is best.
    fn placed(&self, effects: &[Chosen]) -> Result<Vec<Chosen>, FitError> {
        with_sensors(self.rig, effects, |trial| Ok(self.approach(&self.model(trial), None)?.cost))
    }

    /// A fitted model with more elements of its effect `i`: as many as were `asked` for, or while the evidence asks for more.
    fn grown(
        &self,
        (mut model, mut state): (Model<'a>, State),
        i: usize,
        asked: Option<usize>,
        fitted: impl Fn(&Model, &Model, &State) -> Result<State, FitError>,
    ) -> Result<(Model<'a>, State), FitError> {
        let range = model.effects[i].effect.elements();
        let most = asked.or(range.map(|r| *r.end())).unwrap_or(1);
        let mut leftover = self.leftover(&model, &state)?;
        for elements in model.effects[i].elements.unwrap_or(1) + 1..=most {
            let mut more = model.effects.clone();
            more[i] = more[i].with_elements(elements);
            let bigger = self.model(&more);
            let trial = fitted(&bigger, &model, &state)?;
            let trial_leftover = self.leftover(&bigger, &trial)?;
            if asked.is_none() && trial_leftover.evidence_over(&leftover) < EVIDENCE {
                break;
            }
            (model, state, leftover) = (bigger, trial, trial_leftover);
        }
        Ok((model, state))
    }
}
