//! Recordings that are open together, and the models fitted to them.
//!
//! The models are those of a file, the same that the commands work on: `NAME.model.toml` beside the recording. It is
//! written when a model is made by hand; what the workbench fits to show something at once stays in memory.

use std::collections::BTreeMap;
use std::convert::Infallible;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use serde_json::Value as Json;

use crate::diagnose::Diagnosis;
use crate::fit::outcome::fit::{Fit, FittedParameter};
use crate::fit::outcome::profile::Profile;
use crate::fit::progress::Passing;
use crate::fit::search::options::Options;
use crate::model::constraint::Given;
use crate::model::effects::Chosen;
use crate::recording::Recording;
use crate::report::diagnosis::text::json as diagnosis_json;
use crate::results::fit_record::now;
use crate::results::model_file::ModelFile;
use crate::shown::Shown as _;
use crate::study::Study;
use crate::study::models::{about, load, rig_of, save};
use crate::study::simulated::Simulated;
use crate::text_file::read_text;
use crate::web::session::glances::{FileKey, key};
use crate::web::session::jobs::Jobs;
use crate::web::session::samples::{Samples, Stretch};

type AnyError = Box<dyn Error + Send + Sync>;

/// Simulations, and stretches of records, that are kept for a chart that is asked for again.
const KEPT: usize = 16;
/// Diagnoses that are kept, for a step back to the model of one.
const DIAGNOSES: usize = 4;

/// The command lines that do the same as actions on recordings and their model file.
pub type Commands = fn(&[PathBuf], &Path) -> BTreeMap<&'static str, String>;

/// See the module.
pub struct Bench {
    /// The recordings.
    pub paths: Vec<PathBuf>,
    /// Their files as they were read.
    files: Vec<FileKey>,
    /// The same, inspected and prepared.
    pub study: Study,
    /// Noise of their heads, m.
    pub noise_m: f64,
    /// Those of which only a part is used, whole: a chart shows every peak of them.
    whole: Vec<Option<Recording>>,
    /// The file of models; it need not exist yet.
    pub model_path: PathBuf,
    /// The command lines that do the same as actions, by their names.
    pub commands: BTreeMap<&'static str, String>,
    jobs: Arc<Jobs>,
    models: Mutex<Models>,
    simulations: Mutex<Vec<(Key, Arc<Simulated>)>>,
    shown: Mutex<Vec<(ShownKey, Arc<Shown>)>>,
}

/// Indices of the samples that a chart shows, and how many its stretch has.
type Shown = (Vec<usize>, usize);
/// What they follow from: the sensor, when its closure starts (as bits), and the stretch.
type ShownKey = ((usize, usize), u64, Stretch);

struct Models {
    file: ModelFile,
    /// Fits by the number of their model.
    fits: BTreeMap<usize, Arc<Fit>>,
    /// Profiles by the number of their model and that of their parameter in its fit.
    profiles: BTreeMap<(usize, usize), Arc<Profile>>,
    /// The latest diagnoses by the number of their model, oldest first.
    diagnoses: Vec<(usize, Arc<Diagnosis>)>,
    /// So many models were there when the file was read: what was once diagnosed of them is not in it.
    read: usize,
    /// The text of a file that another program wrote and that holds no models; it is complained of once.
    rejected: Option<String>,
}

impl Models {
    /// Of a file, of which nothing has been computed yet.
    fn of(file: ModelFile) -> Models {
        let read = file.models.len();
        Models { file, fits: BTreeMap::new(), profiles: BTreeMap::new(), diagnoses: Vec::new(), read, rejected: None }
    }
}

/// What a simulation follows from: effects, values (as bits) and grid.
type Key = (String, Vec<(String, Option<String>, u64)>, usize);

impl Bench {
    /// Reads recordings, and their models where there is a file of them.
    ///
    /// # Errors
    /// As [`Study::open`]; a model file that cannot be read, or that holds models of other recordings.
    pub fn open(
        paths: Vec<PathBuf>,
        model_file: Option<&Path>,
        commands: Commands,
        jobs: Arc<Jobs>,
    ) -> Result<Bench, AnyError> {
        let files = paths.iter().map(|path| key(path)).collect::<Result<_, _>>()?;
        let model_path = model_file.map_or_else(|| beside(&paths), Path::to_owned);
        let file = about(&model_path, &paths, None)?;
        let rig = rig_of(None, Some((&model_path, &file)));
        let (mut study, whole) = Study::open_with_whole(rig.as_deref(), &paths)?;
        let (square, samples) = (study.runs().iter().flat_map(|run| &run.sensors))
            .fold((0.0, 0), |(sum, n), s| (sum + s.noise_m.powi(2) * s.time_s.len() as f64, n + s.time_s.len()));
        let noise_m = (square / samples.max(1) as f64).sqrt();
        let heard = jobs.clone();
        study.on_progress(move |progress| heard.hear(progress));
        let models = Mutex::new(Models::of(file));
        let commands = commands(&paths, &model_path);
        let (simulations, shown) = (Mutex::default(), Mutex::default());
        Ok(Bench { paths, files, study, noise_m, whole, model_path, commands, jobs, models, simulations, shown })
    }

    /// What files that are taken away are named after: the file of models, without its endings.
    pub fn name(&self) -> String {
        let file = Path::new(self.model_path.file_name().unwrap_or_default()).shown().into_owned();
        [".model.toml", ".toml"].iter().find_map(|ending| file.strip_suffix(ending)).unwrap_or(&file).to_owned()
    }

    /// When a run's closure starts on its clock, s: as the model in force has it, or as its signals show it.
    pub fn closure_start_s(&self, run: usize) -> f64 {
        let data = &self.study.runs()[run];
        let own = |fit: &Fit| {
            let is_it = |p: &&FittedParameter| p.name == "closure_start_s" && p.run.as_ref() == Some(&data.file);
            fit.parameters.iter().find(is_it).map(|p| p.value)
        };
        self.fit().and_then(|fit| own(&fit)).unwrap_or(data.start.closure_s.0)
    }

    /// The samples of a sensor as they were recorded.
    pub fn samples(&self, run: usize, sensor: usize) -> Option<Samples<'_>> {
        let data = self.study.runs().get(run)?.sensors.get(sensor)?;
        let loaded = &self.study.recordings()[run];
        Some(Samples::of(loaded, data, self.whole[run].as_ref(), self.closure_start_s(run)))
    }

    /// Those of them that a chart shows of a stretch, kept for the next time: of a long record they take long to find.
    pub fn shown(&self, (run, sensor): (usize, usize), samples: &Samples<'_>, stretch: &Stretch) -> Arc<Shown> {
        let key = ((run, sensor), self.closure_start_s(run).to_bits(), *stretch);
        kept(&self.shown, key, || Ok::<_, Infallible>(samples.shown(stretch))).unwrap_or_default()
    }

    fn models(&self) -> MutexGuard<'_, Models> {
        self.models.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The models as they stand.
    pub fn file(&self) -> ModelFile {
        self.models().file.clone()
    }

    /// The fit of the model in force, where it has been computed.
    pub fn fit(&self) -> Option<Arc<Fit>> {
        let models = self.models();
        models.fits.get(&models.file.in_force).cloned()
    }

    /// The fit in force behind those of the models that it grew out of, the first of all first; without those that were
    /// not fitted here.
    pub fn fits(&self) -> Vec<Arc<Fit>> {
        let models = self.models();
        let parent = |number: &usize| models.file.models.get(number - 1)?.grown_from;
        let chain = std::iter::successors(Some(models.file.in_force).filter(|n| *n > 0), parent);
        let mut fits: Vec<_> = chain.filter_map(|number| models.fits.get(&number).cloned()).collect();
        fits.reverse();
        fits
    }

    /// The diagnosis of the model in force, where there is one.
    pub fn diagnosis(&self) -> Option<Arc<Diagnosis>> {
        let models = self.models();
        let of_force = models.diagnoses.iter().rfind(|(number, _)| *number == models.file.in_force);
        of_force.map(|(_, found)| found.clone())
    }

    /// True where the model in force is one that the file held already, and what it lacks has not been asked since.
    pub fn is_undiagnosed_of_old(&self) -> bool {
        let is_of_old = {
            let models = self.models();
            models.file.in_force <= models.read
        };
        is_of_old && self.diagnosis().is_none()
    }

    /// The model that is being fitted, as it is at this moment.
    pub fn passing(&self) -> Option<Arc<Passing>> {
        self.jobs.current()?.passing
    }

    /// A diagnosis as `diagnose --json` prints it.
    ///
    /// # Errors
    /// None in practice.
    pub fn diagnosis_json(&self, found: &Diagnosis) -> Result<Json, AnyError> {
        let faults: Vec<_> = self.study.recordings().iter().flat_map(|l| l.faults.iter().cloned()).collect();
        Ok(serde_json::from_str(&diagnosis_json(std::slice::from_ref(found), &faults)?)?)
    }

    /// Fits the model in force, where that has not been done: again from the values of the file, or the base model
    /// where there is none yet.
    ///
    /// # Errors
    /// A model that cannot be simulated, recordings without samples.
    pub fn fit_in_force(&self) -> Result<Arc<Fit>, AnyError> {
        if let Some(fit) = self.fit() {
            return Ok(fit);
        }
        let entry = {
            let models = self.models();
            (!models.file.models.is_empty()).then(|| models.file.current().clone())
        };
        let study = &self.study;
        let fit = match &entry {
            Some(entry) => entry.refit(study.rig(), study.runs(), &Options::default(), study.watcher())?,
            None => study.calibrate("none").run()?,
        };
        let fit = Arc::new(fit);
        let mut models = self.models();
        if models.file.models.is_empty() {
            models.file.append(&fit, "calibrated", None, now());
        }
        let number = models.file.in_force;
        models.fits.insert(number, fit.clone());
        Ok(fit)
    }

    /// Adds a fit as the model in force and writes the file.
    ///
    /// # Errors
    /// As [`save`].
    pub fn append(&self, fit: Fit, why: &str, evidence: Option<f64>) -> Result<(), AnyError> {
        self.change(|file| {
            file.append(&fit, why, evidence, now());
            Ok(())
        })?;
        self.keep_fit(fit);
        Ok(())
    }

    /// Puts another model in force and writes the file.
    ///
    /// # Errors
    /// What `choose` refuses; as [`save`].
    pub fn put_in_force(&self, choose: impl FnOnce(&mut ModelFile) -> Result<(), AnyError>) -> Result<(), AnyError> {
        self.change(choose)
    }

    /// Changes the models and writes them; where that fails they are as before.
    fn change(&self, change: impl FnOnce(&mut ModelFile) -> Result<(), AnyError>) -> Result<(), AnyError> {
        let mut models = self.models();
        let mut file = models.file.clone();
        change(&mut file)?;
        let expected = file.models.len();
        save(&mut file, &self.model_path)?;
        if file.models.len() == expected {
            models.file = file;
        } else {
            // another program has added models: numbers have moved
            *models = Models::of(file);
        }
        Ok(())
    }

    /// Keeps a diagnosis of the model in force.
    pub fn keep(&self, found: Arc<Diagnosis>) {
        let mut models = self.models();
        let number = models.file.in_force;
        models.diagnoses.retain(|(of, _)| *of != number);
        models.diagnoses.push((number, found));
        if models.diagnoses.len() > DIAGNOSES {
            models.diagnoses.remove(0);
        }
    }

    /// Keeps the fit of the model in force with more that is known of it.
    pub fn keep_fit(&self, fit: Fit) {
        let mut models = self.models();
        let number = models.file.in_force;
        models.fits.insert(number, Arc::new(fit));
    }

    /// Keeps the profile of a parameter of the model in force.
    pub fn keep_profile(&self, parameter: usize, profile: Profile) {
        let mut models = self.models();
        let number = models.file.in_force;
        models.profiles.insert((number, parameter), Arc::new(profile));
    }

    /// The profile of a parameter of the model in force, where it was asked for.
    pub fn profile(&self, parameter: usize) -> Option<Arc<Profile>> {
        let models = self.models();
        models.profiles.get(&(models.file.in_force, parameter)).cloned()
    }

    /// Whether the recordings and the model file are what was read.
    pub fn is_as_read(&self) -> bool {
        self.paths.iter().zip(&self.files).all(|(path, file)| key(path).is_ok_and(|now| now == *file))
            && !self.changed_outside()
    }

    /// Whether another program has written to the model file since it was read.
    pub fn changed_outside(&self) -> bool {
        let text = read_text(&self.model_path).ok();
        let models = self.models();
        text.is_some() && text != models.file.as_read && text != models.rejected
    }

    /// Reads the model file again.
    ///
    /// # Errors
    /// One that is no file of models at the moment.
    pub fn reload(&self) -> Result<(), AnyError> {
        let text = read_text(&self.model_path).ok();
        let loaded = load(&self.model_path);
        {
            let mut models = self.models();
            models.rejected = text.filter(|_| loaded.is_err());
            *models = Models::of(loaded?);
        }
        self.fit_in_force()?;
        Ok(())
    }

    /// The model with these effects at these values, kept for the next time.
    ///
    /// # Errors
    /// As [`Study::simulated`].
    pub fn simulated(
        &self,
        effects: &[Chosen],
        given: &[Given],
        reaches: usize,
    ) -> Result<Arc<Simulated>, crate::study::error::Error> {
        let labels = effects.iter().map(Chosen::label).collect::<Vec<_>>().join(",");
        let values = given.iter().map(|g| (g.name.clone(), g.run.clone(), g.value.to_bits())).collect();
        let key: Key = (labels, values, reaches);
        kept(&self.simulations, key, || self.study.simulated(effects, given, reaches))
    }
}

/// What was made for a key, or what is made now and kept for the next time; the oldest is given up.
fn kept<K: PartialEq, V, E>(
    kept: &Mutex<Vec<(K, Arc<V>)>>,
    key: K,
    make: impl FnOnce() -> Result<V, E>,
) -> Result<Arc<V>, E> {
    let lock = || kept.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some((_, known)) = lock().iter().find(|(known, _)| *known == key) {
        return Ok(known.clone());
    }
    let made = Arc::new(make()?);
    let mut kept = lock();
    if kept.len() >= KEPT {
        kept.remove(0);
    }
    kept.push((key, made.clone()));
    Ok(made)
}

/// Where the models of recordings are: beside the first of them.
fn beside(paths: &[PathBuf]) -> PathBuf {
    let first = paths.first().cloned().unwrap_or_default();
    let others = match paths.len() {
        0 | 1 => String::new(),
        n => format!("-and-{}-more", n - 1),
    };
    let name = first.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    first.with_file_name(format!("{name}{others}.model.toml"))
}
