//! One finished recording of a folder: fitted, diagnosed, entered in the folder's index, with fit and report beside it.

use std::collections::BTreeSet;
use std::error::Error;
use std::path::{Path, PathBuf};

use crate::diagnose::{Diagnosis, Verdict, diagnose};
use crate::fit::outcome::fit::Fit;
use crate::fit::progress::Progress;
use crate::fit::search::options::Options;
use crate::fit::validate::conflict::conflicts;
use crate::fit::validate::energy::energy_of;
use crate::model::effects::Chosen;
use crate::report::advice::{Advice, quoted};
use crate::report::page::html;
use crate::report::text::number::probability;
use crate::report::{Page, Stage, page_title};
use crate::results::fit_file::Form;
use crate::results::fit_record::{FitRecord, now};
use crate::results::history::content::identity;
use crate::results::history::index::Entered;
use crate::results::history::lock::Lock;
use crate::results::history::{Accepted, Finding, HistoryError, Index, Run};
use crate::results::model_file::ModelFile;
use crate::rig::Rig;
use crate::shown::Shown as _;
use crate::storage::decode;
use crate::storage::output;
use crate::study::models;
use crate::study::open::Loaded;
use crate::watch::folder::{Content, list, look_into};
use crate::watch::start::Start;
use crate::watch::verdict::{self, Accept};

type AnyError = Box<dyn Error + Send + Sync>;

/// How runs are fitted.
#[derive(Debug, Clone)]
pub struct Settings {
    /// Effects to start with where no model of the rig was accepted yet; those that its material asks for, without.
    pub effects: Option<Vec<Chosen>>,
    /// Which models become the rig's by themselves.
    pub accept: Accept,
}

impl Default for Settings {
    fn default() -> Self {
        Settings { effects: None, accept: Accept::Clean }
    }
}

/// What happens while a run is evaluated.
#[derive(Debug, Clone, PartialEq)]
pub enum Notice {
    /// How far it has come, with the file's name.
    Progress(String),
    /// What to look at twice, with the file's name.
    Warning(String),
    /// A watch is at work in the folder and will do it.
    Left(String),
}

/// Hears what happens; it may be called from several threads.
pub type OnNotice<'a> = dyn Fn(Notice) + Sync + 'a;

/// Begins the reason of a model that was not made by hand, so that one left by a killed process is known.
const WATCHED: &str = "fitted when it was recorded";

/// How a run ended.
pub enum Ended {
    /// It is done.
    Done(Run),
    /// It cannot be: the index says why.
    Failed(Run),
    /// The file has changed or gone since it was entered.
    Changed,
}

/// Fits and diagnoses a claimed run and enters what came of it, whatever that is.
///
/// # Errors
/// Only where the index cannot be written.
pub fn evaluate(
    index: &mut Index,
    folder: &Path,
    run: &Run,
    rig: Option<&Rig>,
    settings: &Settings,
    notice: &OnNotice,
) -> Result<Ended, AnyError> {
    let path = folder.join(&run.file);
    let Some(bytes) = std::fs::read(&path).ok().filter(|bytes| identity(bytes) == run.content) else {
        index.forget(run.id)?;
        return Ok(Ended::Changed);
    };
    // A defect that one recording brings out must not keep the others from their turn.
    let work = std::panic::AssertUnwindSafe(|| found(index, &path, &bytes, run, rig, settings, notice));
    let result = std::panic::catch_unwind(work)
        .unwrap_or_else(|_| Err("this is a bug in the program: please report it with this recording".into()));
    match result {
        Ok((rig, finding, accepted)) => index.done(run, &rig, &finding, accepted.as_ref())?,
        Err(error) => {
            index.failed(run.id, &sentence(error.as_ref()))?;
            return Ok(Ended::Failed(index.run(run.id)?));
        }
    }
    Ok(Ended::Done(index.run(run.id)?))
}

/// Enters a recording that was just finished in its folder's index and evaluates it; none where a watch is at work
/// there, which will.
///
/// # Errors
/// A recording that cannot be read back, an index that cannot be written.
pub fn evaluate_new(path: &Path, settings: &Settings, notice: &OnNotice) -> Result<Option<Run>, AnyError> {
    let (folder, file) = place(path);
    let _lock = match Lock::take(&folder) {
        Ok(lock) => lock,
        Err(HistoryError::Busy { who, .. }) => {
            notice(Notice::Left(format!(
                "{}: a watch is at work in this folder ({who}): it calibrates the recording",
                file.shown()
            )));
            return Ok(None);
        }
        Err(error) => return Err(error.into()),
    };
    let mut index = Index::open(&folder)?;
    // entered under its name and content as the folder lists it, so that a later watch knows it
    let listed = list(&folder)?.0.into_iter().find(|l| l.name.file == file);
    let (Some(listed), Content::Recording { identity, rig, recorded_unix_ns }) = (listed, look_into(path)?) else {
        return Err(format!(
            "{} cannot be read back: name it NAME.mcap and check it with `surgescope inspect`",
            path.shown()
        )
        .into());
    };
    let entered =
        index.enter(&listed.name, &identity, (&rig, recorded_unix_ns), None, |name| folder.join(name).exists())?;
    let Entered::New(id) = entered else { return Ok(index.named(&file)?) };
    let Some(run) = index.claim(Some(id))? else { return Ok(index.named(&file)?) };
    match evaluate(&mut index, &folder, &run, None, settings, notice)? {
        Ended::Done(run) | Ended::Failed(run) => Ok(Some(run)),
        Ended::Changed => Err(format!("{} changed while it was calibrated", path.shown()).into()),
    }
}

/// An error with its causes in one line.
pub fn sentence(error: &(dyn Error + 'static)) -> String {
    let mut causes = vec![error.to_string()];
    let mut cause = error.source();
    while let Some(inner) = cause {
        causes.push(inner.to_string());
        cause = inner.source();
    }
    causes.dedup();
    causes.join(": ").replace('\n', " ")
}

/// The rig's name, what was found, and the acceptance where it is accepted by itself; files are written.
fn found(
    index: &Index,
    path: &Path,
    bytes: &[u8],
    run: &Run,
    rig: Option<&Rig>,
    settings: &Settings,
    notice: &OnNotice,
) -> Result<(String, Finding, Option<Accepted>), AnyError> {
    let mut recording = decode(bytes, path)?;
    if let Some(rig) = rig {
        recording = recording.on_rig(rig.clone())?;
    }
    let rig = recording.rig.clone();
    let hear = |progress: &Progress| notice(Notice::Progress(format!("{}: {progress}", run.file.shown())));
    let loaded = Loaded::new(run.file.clone(), recording)?;
    loaded.require_sound()?;
    let features = &loaded.features;
    let data = [loaded.run()];
    let start = match index.in_force(&rig.name)? {
        Some(accepted) => Start::from_accepted(&accepted, &rig, &data[0], Options::default())?,
        None => Start::from_scratch(settings.effects.as_deref(), &rig, Options::default())?,
    };
    let diagnosis = diagnose(&rig, &data, &start.effects, &start.options, &hear)?;

    let contradictions = conflicts(&diagnosis.start, &data);
    let named = format!("{}: ", run.file.shown());
    let warnings = loaded.doubts.iter().chain(&diagnosis.warnings);
    let warnings: BTreeSet<&str> = warnings.map(|w| w.strip_prefix(&named).unwrap_or(w)).collect();
    warnings.into_iter().for_each(|warning| notice(Notice::Warning(format!("{named}{warning}"))));
    let mut finding = verdict::finding(&diagnosis, features.temperature_degc, features.flow_m3_s.map(|q| q.value));
    let earlier: Vec<Run> = index.runs(&rig.name)?.into_iter().filter(|r| r.id != run.id).collect();
    let compared = verdict::compare(&finding.parameters, &finding.effects, finding.temperature_degc, &earlier);
    let clean = verdict::is_clean(&diagnosis, &compared, contradictions.len());
    let accept = settings.accept == Accept::Clean && clean;
    finding.line = verdict::line(&diagnosis, &finding, &compared, accept, &run.file.shown());

    let (model_path, report_path) = (path.with_extension("model.toml"), path.with_extension("html"));
    (finding.model_file, finding.report_file) = (name(&model_path), name(&report_path));
    let file = write_model(&model_path, path, &diagnosis)?;
    let fit = FitRecord::new(&diagnosis.start, &rig, &[(&loaded.recording, features)], &contradictions);
    write_fit(&path.with_extension("fit.toml"), &fit)?;
    let fits: Vec<&Fit> = std::iter::once(&diagnosis.start).chain(diagnosis.answer()).collect();
    let page = Page {
        title: page_title(&[&run.file.shown()], &rig),
        stages: fits.iter().map(|fit| Stage::of(fit)).collect(),
        energy: fits.last().and_then(|fit| energy_of(&rig, &data, fit, 0).ok().flatten()),
        diagnoses: std::slice::from_ref(&diagnosis),
        advice: advice(diagnosis.verdict, accept, path),
        temperatures_degc: vec![(run.file.clone(), features.temperature_degc)],
        ..Page::of(&rig)
    };
    write_report(&report_path, &html(&page))?;
    let accepted = accept.then(|| acceptance(&run.file, &file, "automatic")).transpose()?;
    Ok((rig.name.clone(), finding, accepted))
}

/// What to do with a run: take its model into the rig's, unless that has been done; look at what no effect explains.
fn advice(verdict: Verdict, accepted: bool, path: &Path) -> Option<Advice> {
    let path = quoted(&path.shown());
    match verdict {
        Verdict::UnknownEffect => Some(Advice::new(
            "Compare what the recording shows with the rig file: a wrong length, unit or place looks like missing physics.",
            &[format!("inspect {path}")],
        )),
        _ if accepted => None,
        _ => Some(Advice::new("If you trust this model, let later runs start from it.", &[format!("accept {path}")])),
    }
}

fn name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Writes the fit as a file of models: the start model, and in force the one with what is missing. What a person added
/// to an older file of that name stays in it.
fn write_model(path: &Path, recording: &Path, diagnosis: &Diagnosis) -> Result<ModelFile, AnyError> {
    let mut file = models::about(path, &[recording.to_owned()], None)?;
    if file.models.iter().all(|m| m.why.starts_with(WATCHED)) {
        file.models.clear();
    }
    file.append(&diagnosis.start, WATCHED, None, now());
    if let Some(fit) = diagnosis.answer() {
        let why = format!(
            "{WATCHED}: {} missing, probability {}",
            diagnosis.answer_label(),
            probability(diagnosis.probability)
        );
        file.append(fit, &why, Some(diagnosis.answer_evidence()), now());
    }
    models::save(&mut file, path)?;
    Ok(file)
}

/// Writes the fit that the index has the values of, as `calibrate -o` does.
fn write_fit(path: &Path, fit: &FitRecord) -> Result<(), AnyError> {
    output::check_result(path, "# surgescope fit:")?;
    output::write_new(path, &fit.text(Form::Toml)?, true)
}

/// Puts a page in its place in one step.
fn write_report(path: &Path, page: &str) -> Result<(), AnyError> {
    output::check_report(path)?;
    output::write_new(path, page, true)
}

/// The model in force of a file as the one accepted of a rig.
///
/// # Errors
/// None in practice: all values can be written.
pub fn acceptance(recording: &str, file: &ModelFile, how: &str) -> Result<Accepted, AnyError> {
    let model = toml::to_string(file.current())?;
    Ok(Accepted { file: recording.to_owned(), when: now(), how: how.to_owned(), model })
}

/// The folder of a recording, and its name there.
pub fn place(path: &Path) -> (PathBuf, String) {
    let folder = path.parent().filter(|f| !f.as_os_str().is_empty()).unwrap_or(Path::new("."));
    (folder.to_owned(), name(path))
}
