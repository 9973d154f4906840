//! The front door: recordings opened, inspected and prepared, ready to be calibrated and diagnosed. Nothing in here
//! prints.

pub mod beside;
pub mod calibrate;
pub mod error;
pub mod hold;
pub mod import;
pub mod models;
pub mod next;
pub mod open;
pub mod predict;
pub mod search;
pub mod simulated;
pub mod until_done;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use crate::diagnose::growing::{Growing, Step};
use crate::diagnose::rest::explain;
use crate::diagnose::rest::explanation::Explanation;
use crate::diagnose::{Diagnosis, diagnose, diagnose_fit, grow};
use crate::fit::data::run_data::RunData;
use crate::fit::outcome::fit::Fit;
use crate::fit::posterior::doubt::find_doubts;
use crate::fit::posterior::sample::sample;
use crate::fit::progress::{OnProgress, Progress};
use crate::fit::search::calibrate::{Begin, Fitter};
use crate::fit::search::options::{Effort, Options};
use crate::model::Model;
use crate::model::effects::{Chosen, parse_list};
use crate::recording::Recording;
use crate::results::fit_record::FitRecord;
use crate::rig::Rig;
use crate::study::calibrate::{Calibrate, Effects};
use crate::study::error::{Error, Result};
use crate::study::hold::options_of;
use crate::study::open::{Loaded, load, load_keeping, one_rig};

/// Recordings of one rig, ready to be calibrated and diagnosed.
///
/// The whole loop: fit the base model, ask what it lacks, add that, and look again.
///
/// ```no_run
/// use surgescope::Study;
/// use surgescope::diagnose::Verdict;
/// use surgescope::study::until_done::UntilDone;
///
/// let study = Study::open(["recordings/hdpe-creep.mcap"])?;
/// let mut search = UntilDone::starting("none")?;
/// while search.step(&study)?.is_some() {}
/// for diagnosis in search.diagnoses().iter().filter(|d| d.verdict == Verdict::MissingEffect) {
///     println!("{} is missing (probability {:.2})", diagnosis.answer_label(), diagnosis.probability);
/// }
/// let fit = search.models().last().expect("there is the start model at least");
/// let speed = fit.parameter("wave_speed_m_s")?;
/// println!("wave speed {:.1} ± {:.1} {}", speed.value, speed.standard_error(), speed.unit);
/// # Ok::<(), surgescope::Error>(())
/// ```
///
/// A clone shares the recordings; [`Study::on_progress`] is each one's own.
#[derive(Clone)]
pub struct Study {
    rig: Arc<Rig>,
    recordings: Arc<[Loaded]>,
    runs: Arc<[RunData]>,
    on_progress: Arc<dyn Fn(&Progress) + Send + Sync>,
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
        Study::open_without(rig, files, &[])
    }

    /// The same, and each recording as it was, where it is so long that only a part of it is used.
    ///
    /// # Errors
    /// As [`Study::open_on`].
    pub fn open_with_whole(rig: Option<&Path>, paths: &[PathBuf]) -> Result<(Study, Vec<Option<Recording>>)> {
        let mut whole = Vec::new();
        let loaded = load_keeping(paths, rig, &[], |recording| whole.push(recording))?;
        Ok((Study::of(loaded)?, whole))
    }

    /// The same as if some sensors had not been recorded, such as one that is broken.
    ///
    /// # Errors
    /// As [`Study::open_on`]; a name that no sensor has.
    pub fn open_without(
        rig: Option<&Path>,
        files: impl IntoIterator<Item = impl AsRef<Path>>,
        ignored: &[String],
    ) -> Result<Study> {
        let paths: Vec<PathBuf> = files.into_iter().map(|path| path.as_ref().to_owned()).collect();
        Study::of(load(&paths, rig, ignored)?)
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
        let rig = Arc::new(first.recording.rig.clone());
        Ok(Study { rig, runs, recordings: recordings.into(), on_progress: Arc::new(|_| {}) })
    }

    /// Calls `watcher` while something is computed, possibly from several threads.
    pub fn on_progress(&mut self, watcher: impl Fn(&Progress) + Send + Sync + 'static) {
        self.on_progress = Arc::new(watcher);
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

    /// All about a fit of these recordings, as a fit file and `calibrate --json` hold it; `warnings` are about the fit.
    pub fn record(&self, fit: &Fit, warnings: &[String]) -> FitRecord {
        let recordings: Vec<_> = self.recordings.iter().map(|l| (&l.recording, &l.features)).collect();
        FitRecord::new(fit, &self.rig, &recordings, warnings)
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
            quasi_2d: false,
        }
    }

    /// What a fitted model lacks. Nothing is fitted twice: the fit is the start model as it is, with its bounds and
    /// what it held.
    ///
    /// ```no_run
    /// let study = surgescope::Study::open(["recordings/hdpe-creep.mcap"])?;
    /// let diagnosis = study.diagnose(&study.calibrate("none").run()?)?;
    /// assert_eq!(diagnosis.candidates[0].effect, "viscoelastic-wall");
    /// # Ok::<(), surgescope::Error>(())
    /// ```
    ///
    /// # Errors
    /// A recording with a faulty sensor, a model that cannot be simulated.
    pub fn diagnose(&self, fit: &Fit) -> Result<Diagnosis> {
        self.recordings.iter().try_for_each(Loaded::require_sound)?;
        let options = options_of(fit);
        Ok(diagnose_fit(&self.rig, &self.runs, &fit.effects, fit.clone(), &options, self.watcher())?)
    }

    /// Fits the model with `effects` and diagnoses it; where a number of elements is left open, it is open for all
    /// models compared.
    ///
    /// # Errors
    /// As [`Study::calibrate`] and [`Study::diagnose`].
    pub fn diagnose_model(&self, effects: &[Chosen], options: &Options) -> Result<Diagnosis> {
        self.recordings.iter().try_for_each(Loaded::require_sound)?;
        Ok(diagnose(&self.rig, &self.runs, effects, options, self.watcher())?)
    }

    /// Takes the 95% intervals of a fit from the joint posterior of its values, sampled until each parameter has
    /// `wanted` independent draws, and says of which the intervals that the errors give are in doubt. Where the chains
    /// do not meet, intervals stay as they are, and [`Fit::posterior`] says so; where the fit's noise or slopes are not
    /// finite, it has no posterior.
    ///
    /// ```no_run
    /// let study = surgescope::Study::open(["recordings/hdpe-creep.mcap"])?;
    /// let mut fit = study.calibrate("viscoelastic-wall:2").run()?;
    /// study.sample(&mut fit, 400, 1)?;
    /// assert!(fit.posterior.is_some_and(|posterior| posterior.converged));
    /// # Ok::<(), surgescope::Error>(())
    /// ```
    ///
    /// # Errors
    /// A model that cannot be simulated.
    pub fn sample(&self, fit: &mut Fit, wanted: usize, seed: u64) -> Result<()> {
        let began = Instant::now();
        let options = Options { seed, ..options_of(fit) };
        find_doubts(&self.rig, &self.runs, fit, &options)?;
        sample(&self.rig, &self.runs, fit, wanted, &options, self.watcher())?;
        fit.seconds += began.elapsed().as_secs_f64();
        Ok(())
    }

    /// The fitted model without one of its effects, refitted from where the rest stands.
    ///
    /// # Errors
    /// An effect that the model does not have, a model that cannot be simulated.
    pub fn without(&self, fit: &Fit, effect: &str) -> Result<Fit> {
        let is_it = |c: &Chosen| c.label() == effect || c.effect.name() == effect;
        let Some(i) = fit.effects.iter().position(is_it) else { return Err(Error::NoSuchEffect(effect.to_owned())) };
        Ok(self.fitter(&options_of(fit)).without(fit, i, Effort::Whole)?)
    }

    /// What would explain what a fitted model leaves, where no effect of the catalogue does: the most probable place of
    /// a forcing first, then those that the recordings cannot tell from it. Nothing where nothing is left.
    ///
    /// # Errors
    /// A recording with a faulty sensor, a model that cannot be simulated.
    pub fn explain(&self, fit: &Fit) -> Result<Vec<Explanation>> {
        self.recordings.iter().try_for_each(Loaded::require_sound)?;
        Ok(explain(&self.rig, &self.runs, fit, &options_of(fit), self.watcher())?)
    }

    /// A model with `effects` that grew out of one with those of `start`, both fitted, ready to grow on.
    pub(crate) fn growing(&self, start: &[Chosen], effects: &[Chosen], options: &Options) -> Result<Growing> {
        self.recordings.iter().try_for_each(Loaded::require_sound)?;
        let (rig, runs) = (&self.rig, &self.runs);
        let has = |c: &Chosen| effects.iter().any(|own| own.effect.name() == c.effect.name());
        // What is held or bounded of an added effect has no meaning without it, so that effect stays.
        let model = Model::new(rig, &runs[0].conditions.water, effects);
        let knows = |i: usize| start.iter().any(|c| c.effect.name() == effects[i].effect.name());
        let added: Vec<&str> = (0..effects.len())
            .filter(|&i| !knows(i))
            .flat_map(|i| model.shared[model.parameters_of(i)].iter().map(|p| p.name.as_str()))
            .collect();
        let mut names = options.constraints.iter().map(|c| &c.name).chain(options.priors.iter().map(|p| &p.name));
        let of_added = names.any(|name| added.contains(&name.as_str()));
        if start.len() == effects.len() || of_added || !start.iter().all(has) {
            return Ok(Growing::starting(rig, runs, effects, options, self.watcher())?);
        }
        let fit = self.fitter(options).fit(effects, Begin::Signals, Effort::Whole)?;
        Ok(Growing::starting(rig, runs, start, options, self.watcher())?.grown_to(rig, runs, fit)?)
    }

    /// See [`Growing::step`].
    pub(crate) fn grow_on(&self, growing: &mut Growing) -> Result<Option<Step>> {
        Ok(growing.step(&self.rig, &self.runs, self.watcher())?)
    }

    /// The model of a fit with one effect more, and the evidence for it. Of an effect that the model has with fewer
    /// elements, as many are added as the evidence supports, up to the number that is named.
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
    /// An effect that does not exist, that the model has already or that excludes another; elements that the records do
    /// not show; a model that cannot be simulated.
    pub fn grow(&self, fit: &Fit, effect: impl Effects) -> Result<Grown> {
        let mut added = effect.chosen()?;
        let (Some(added), true) = (added.pop(), added.is_empty()) else { return Err(Error::NotOneEffect) };
        let of_it = |c: &Chosen| c.effect.name() == added.effect.name();
        if let Some(i) = fit.effects.iter().position(of_it)
            && let (has, Some(most)) = (fit.effects[i].elements, added.most_elements())
            && Some(most) > has
        {
            let options = options_of(fit);
            let grown = self.fitter(&options).with_more_elements(fit, i, most, Effort::Whole)?;
            if grown.effects[i].elements == has {
                return Err(Error::NoMoreElements(fit.effects[i].label()));
            }
            return Ok(Grown { evidence: grown.evidence_over(fit), fit: grown });
        }
        // The list as a whole says what stands against the newcomer.
        let labels: Vec<String> = fit.labels().into_iter().chain([added.label()]).collect();
        parse_list(&labels.join(","))?;
        let (fit, evidence) = grow(&self.rig, &self.runs, fit, &added, &options_of(fit), self.watcher())?;
        Ok(Grown { fit, evidence })
    }

    /// What fits models of the recordings, with these options.
    pub(crate) fn fitter<'a>(&'a self, options: &'a Options) -> Fitter<'a> {
        Fitter::new(&self.rig, &self.runs, options, self.watcher())
    }

    /// The watcher of computations.
    pub(crate) fn watcher(&self) -> &OnProgress<'_> {
        &*self.on_progress
    }
}

#[cfg(test)]
mod tests {
    use std::error::Error as _;
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::*;
    use crate::diagnose::Verdict;
    use crate::model::ModelError;
    use crate::model::stop::Stop;

    fn file(name: &str) -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("recordings").join(name)
    }

    /// Wherever it is stopped, in a fit or between candidates, no half of an answer comes.
    #[test]
    fn what_is_stopped_ends_with_an_error() {
        for (effects, heard) in [("unsteady-friction", 5), ("none", 60), ("none", 180)] {
            let mut study = Study::open([file("copper-leak.mcap")]).unwrap();
            let (stop, count) = (Stop::default(), AtomicUsize::new(0));
            let told = stop.clone();
            study.on_progress(move |_| {
                if count.fetch_add(1, Ordering::Relaxed) == heard {
                    told.stop();
                }
            });
            let options = Options { most_reaches: 32, ..Options::default() };
            let effects = parse_list(effects).unwrap();
            let ended = stop.threads(None).unwrap().install(|| study.diagnose_model(&effects, &options));
            assert!(stop.is_stopped(), "{heard} reports never came");
            assert_eq!(ended.unwrap_err().to_string(), ModelError::Stopped.to_string());
        }
    }

    #[test]
    fn the_whole_loop_goes_through_the_front_door() {
        static HEARD: AtomicUsize = AtomicUsize::new(0);
        let mut study = Study::open([file("hdpe-creep.mcap")]).unwrap();
        study.on_progress(|_| {
            HEARD.fetch_add(1, Ordering::Relaxed);
        });
        let options = Options { most_reaches: 32, ..Options::default() };
        let base = study.calibrate("none").options(options).run().unwrap();
        let of_fit = HEARD.load(Ordering::Relaxed);
        assert!(of_fit > 0 && base.effects.is_empty());

        let diagnosis = study.diagnose(&base).unwrap();
        assert!(HEARD.load(Ordering::Relaxed) > of_fit);
        let same = |fit: &Fit| (fit.values(), fit.evaluations, fit.seconds);
        assert_eq!(same(&diagnosis.start), same(&base), "the fit is the start model, not fitted again");
        assert_eq!((diagnosis.verdict, diagnosis.candidates[0].effect), (Verdict::MissingEffect, "viscoelastic-wall"));

        let grown = study.grow(&base, "viscoelastic-wall:1").unwrap();
        assert!(grown.evidence > 0.0 && grown.fit.pooled().0 < 0.5 * base.pooled().0);
        assert!(grown.fit.parameter("J1_per_GPa").unwrap().value > 0.0);
        let unknown = grown.fit.parameter("leak_position_m").unwrap_err().to_string();
        assert!(unknown.contains("leak_position_m") && unknown.contains("tau1_s"), "{unknown}");
    }

    #[test]
    fn values_are_held_and_slips_are_errors_with_their_cause() {
        let study = Study::open([file("hdpe-creep.mcap")]).unwrap();
        let options = Options { most_reaches: 32, ..Options::default() };
        let fit = study.calibrate("none").options(options).hold("closing_time_s", 0.1).run().unwrap();
        let held = fit.parameter("closing_time_s").unwrap();
        assert!(held.held && held.value == 0.1);
        assert!(matches!(study.calibrate("none").hold("leak_position_m", 3.0).run(), Err(Error::Fit(_))));
        assert!(matches!(study.calibrate("no-such-effect").run(), Err(Error::Model(_))));
        assert!(matches!(study.grow(&fit, "none"), Err(Error::NotOneEffect)));
        assert!(matches!(Study::open([""; 0]), Err(Error::NoRecording)));
        let path = file("hdpe-creep.mcap");
        assert!(matches!(Study::open([&path, &path]), Err(Error::Twice(_))));
        let whole = crate::storage::read(&path).unwrap();
        let changed = |value: fn(usize) -> f64| {
            let mut recording = whole.clone();
            for series in &mut recording.series {
                series.value.iter_mut().enumerate().for_each(|(i, v)| *v = value(i));
            }
            Study::from_recordings([("still".to_owned(), recording)]).err().unwrap()
        };
        let error = changed(|i| 1.0 + 1e-3 * (i % 7) as f64);
        assert!(matches!(error, Error::Unusable { .. }) && error.source().is_some(), "{error}");
        let error = changed(|_| 1.0);
        assert!(matches!(error, Error::Faulty { .. }) && error.source().is_some(), "{error}");
    }
}
