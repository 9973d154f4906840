//! The front door: recordings opened, inspected and prepared, ready to be calibrated and diagnosed. Nothing in here prints.

pub mod calibrate;
pub mod error;
pub mod hold;
pub mod models;
pub mod open;
pub mod predict;
pub mod progress;

use std::path::{Path, PathBuf};

use crate::diagnose::{Diagnosis, diagnose, diagnose_fit, grow};
use crate::fit::data::run_data::RunData;
use crate::fit::outcome::fit::Fit;
use crate::fit::search::calibrate::Options;
use crate::model::effects::{Chosen, parse_list};
use crate::recording::Recording;
use crate::rig::Rig;
use crate::study::calibrate::{Calibrate, Effects};
use crate::study::error::{Error, Result};
use crate::study::hold::options_of;
use crate::study::open::{Loaded, load, one_rig};
use crate::study::progress::{OnProgress, Progress};

/// Recordings of one rig, ready to be calibrated and diagnosed.
///
/// The whole loop: fit the base model, ask what it lacks, add that, and look again.
///
/// ```no_run
/// use surgescope::Study;
/// use surgescope::diagnose::Verdict;
///
/// let study = Study::open(["recordings/hdpe-creep.mcap"])?;
/// let mut fit = study.calibrate("none").run()?;
/// loop {
///     let diagnosis = study.diagnose(&fit)?;
///     let Some(missing) = diagnosis.candidates.first().filter(|_| diagnosis.verdict == Verdict::MissingEffect) else {
///         break;
///     };
///     println!("{} is missing (probability {:.2})", missing.label, missing.probability);
///     fit = study.grow(&fit, missing.label.as_str())?.fit;
/// }
/// let speed = fit.parameter("wave_speed_m_s")?;
/// println!("wave speed {:.1} ± {:.1} {}", speed.value, speed.standard_error, speed.unit);
/// # Ok::<(), surgescope::Error>(())
/// ```
pub struct Study {
    rig: Rig,
    recordings: Vec<Loaded>,
    runs: Vec<RunData>,
    on_progress: Box<dyn Fn(&Progress) + Send + Sync>,
}

/// A model with one effect more.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Grown {
    /// The fit.
    pub fit: Fit,
    /// Evidence for the effect: natural logarithm of the odds. The data do not ask for it where this is not above 0.
    pub evidence: f64,
}

impl Study {
    /// Reads, inspects and prepares recordings, all of the rig that is stored in them.
    ///
    /// ```
    /// use surgescope::Study;
    ///
    /// let study = Study::open(["recordings/hdpe-creep.mcap"])?;
    /// assert_eq!(study.rig().pipes.len(), 1);
    /// assert!(study.recordings()[0].features.period.is_some());
    /// for warning in study.warnings() {
    ///     eprintln!("{warning}");
    /// }
    /// # Ok::<(), surgescope::Error>(())
    /// ```
    ///
    /// # Errors
    /// No file, one that cannot be read or shows no closure, one given twice, recordings of different rigs.
    pub fn open(files: impl IntoIterator<Item = impl AsRef<Path>>) -> Result<Study> {
        Study::open_on(None, files)
    }

    /// The same with the rig of a file instead of the stored one.
    ///
    /// # Errors
    /// As [`Study::open`]; a rig file that cannot be read, or that lacks a sensor of the recordings.
    pub fn open_on(rig: Option<&Path>, files: impl IntoIterator<Item = impl AsRef<Path>>) -> Result<Study> {
        let paths: Vec<PathBuf> = files.into_iter().map(|path| path.as_ref().to_owned()).collect();
        Study::of(load(&paths, rig)?)
    }

    /// Of recordings at hand, each with its name: simulated, read from elsewhere, or changed.
    ///
    /// # Errors
    /// As [`Study::open`].
    pub fn from_recordings(recordings: impl IntoIterator<Item = (String, Recording)>) -> Result<Study> {
        let mut loaded: Vec<Loaded> = Vec::new();
        for (name, recording) in recordings {
            if let Some(first) = loaded.first() {
                one_rig((&first.file, &first.recording.rig), (&name, &recording.rig))?;
            }
            loaded.push(Loaded::new(name, recording)?);
        }
        Study::of(loaded)
    }

    fn of(recordings: Vec<Loaded>) -> Result<Study> {
        let first = recordings.first().ok_or(Error::NoRecording)?;
        let runs = recordings.iter().map(Loaded::run).collect();
        Ok(Study { rig: first.recording.rig.clone(), runs, recordings, on_progress: Box::new(|_| {}) })
    }

    /// Calls `heard` while something is computed, possibly from several threads.
    pub fn on_progress(&mut self, heard: impl Fn(&Progress) + Send + Sync + 'static) {
        self.on_progress = Box::new(heard);
    }

    /// The rig.
    pub fn rig(&self) -> &Rig {
        &self.rig
    }

    /// The recordings with what they show; never empty.
    pub fn recordings(&self) -> &[Loaded] {
        &self.recordings
    }

    /// The recordings as a fit takes them, in the same order.
    pub fn runs(&self) -> &[RunData] {
        &self.runs
    }

    /// What in the recordings should make a user look twice, a sentence each, with the file's name.
    pub fn warnings(&self) -> Vec<String> {
        let of = |l: &Loaded| l.doubts.iter().map(|doubt| format!("{}: {doubt}", l.file)).collect::<Vec<_>>();
        self.recordings.iter().flat_map(of).collect()
    }

    /// A calibration of the model with these effects: `"none"`, `"viscoelastic-wall:2,leak"`, or a list chosen before.
    ///
    /// ```no_run
    /// let study = surgescope::Study::open(["recordings/hdpe-creep.mcap"])?;
    /// let fit = study.calibrate("viscoelastic-wall").run()?;
    /// let (rmse_m, noise_m) = fit.pooled();
    /// assert!(rmse_m < 2.0 * noise_m);
    /// # Ok::<(), surgescope::Error>(())
    /// ```
    pub fn calibrate(&self, effects: impl Effects) -> Calibrate<'_> {
        Calibrate {
            rig: &self.rig,
            runs: &self.runs,
            on_progress: &*self.on_progress,
            effects: effects.chosen(),
            hold: Vec::new(),
            options: Options::default(),
        }
    }

    /// What a fitted model lacks. Nothing is fitted twice: the fit is the start model as it is, with its bounds and what it held.
    ///
    /// ```no_run
    /// let study = surgescope::Study::open(["recordings/hdpe-creep.mcap"])?;
    /// let diagnosis = study.diagnose(&study.calibrate("none").run()?)?;
    /// assert_eq!(diagnosis.candidates[0].effect, "viscoelastic-wall");
    /// # Ok::<(), surgescope::Error>(())
    /// ```
    ///
    /// # Errors
    /// A model that cannot be simulated.
    pub fn diagnose(&self, fit: &Fit) -> Result<Diagnosis> {
        let options = options_of(fit);
        Ok(diagnose_fit(&self.rig, &self.runs, &fit.effects, fit.clone(), &options, &self.told())?)
    }

    /// Fits the model with `effects` and diagnoses it; where a number of elements is left open, it is open for all models compared.
    ///
    /// # Errors
    /// As [`Study::calibrate`] and [`Study::diagnose`].
    pub fn diagnose_model(&self, effects: &[Chosen], options: &Options) -> Result<Diagnosis> {
        Ok(diagnose(&self.rig, &self.runs, effects, options, &self.told())?)
    }

    /// The model of a fit with one effect more, and the evidence for it.
    ///
    /// ```no_run
    /// let study = surgescope::Study::open(["recordings/copper-leak.mcap"])?;
    /// let base = study.calibrate("unsteady-friction").run()?;
    /// let grown = study.grow(&base, "leak")?;
    /// println!("leak at {:.1} m", grown.fit.parameter("leak_position_m")?.value);
    /// # Ok::<(), surgescope::Error>(())
    /// ```
    ///
    /// # Errors
    /// An effect that does not exist, that the model has already or that excludes another; a model that cannot be simulated.
    pub fn grow(&self, fit: &Fit, effect: impl Effects) -> Result<Grown> {
        let mut added = effect.chosen()?;
        let (Some(added), true) = (added.pop(), added.is_empty()) else { return Err(Error::NotOneEffect) };
        // The list as a whole says what stands against the newcomer.
        let labels: Vec<String> = fit.labels().into_iter().chain([added.label()]).collect();
        parse_list(&labels.join(","))?;
        let (fit, evidence) = grow(&self.rig, &self.runs, fit, &added, &options_of(fit), &self.told())?;
        Ok(Grown { fit, evidence })
    }

    /// What hears the messages of a diagnosis.
    fn told(&self) -> impl Fn(&str) + Sync + '_ {
        |message| (self.on_progress)(&Progress::from(message))
    }

    /// What hears how far a computation has come.
    pub(crate) fn heard(&self) -> &OnProgress<'_> {
        &*self.on_progress
    }
}
