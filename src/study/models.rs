//! A file of models at hand: read with its recordings, grown, written.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use crate::fit::outcome::fit::Fit;
use crate::fit::search::options::Options;
use crate::results::fit_record::now;
use crate::results::model_file::ModelFile;
use crate::storage::LogError;
use crate::storage::disk::{publish_over, require_folder, temporary_beside};
use crate::storage::output;
use crate::study::Study;
use crate::study::error::{Error, Result};
use crate::study::progress::Progress;

/// A file of models with the recordings that it names.
pub struct Opened {
    /// Where it is.
    pub path: PathBuf,
    /// The models.
    pub file: ModelFile,
    /// Its recordings.
    pub study: Study,
}

/// Reads a file of models and the recordings that it names.
///
/// # Errors
/// If either cannot be read.
pub fn open(path: &Path) -> Result<Opened> {
    let file = load(path)?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let rig = rig_of(None, Some((path, &file)));
    let study = Study::open_on(rig.as_deref(), file.recordings.iter().map(|r| folder.join(r)))
        .map_err(|source| Error::Named { file: path.to_owned(), source: Box::new(source) })?;
    Ok(Opened { path: path.to_owned(), file, study })
}

impl Opened {
    /// Fits the model in force again, from the values in the file, with what is held and bounded there.
    ///
    /// # Errors
    /// A parameter in the file that the model does not have, a model that cannot be simulated.
    pub fn refit(&self) -> Result<Fit> {
        let watcher = |p: &crate::fit::search::options::Progress| self.study.watcher()(&Progress::from(p));
        let current = self.file.current();
        Ok(current.refit(self.study.rig(), self.study.runs(), &Options::default(), &watcher)?)
    }

    /// Adds a fit as the model in force, and writes the file.
    ///
    /// # Errors
    /// As [`save`].
    pub fn append(&mut self, fit: &Fit, why: &str, evidence: Option<f64>) -> Result<()> {
        self.file.append(fit, why, evidence, now());
        save(&mut self.file, &self.path)
    }
}

/// Reads a file of models.
///
/// # Errors
/// One that cannot be read, is none, or contradicts itself.
pub fn load(path: &Path) -> Result<ModelFile> {
    let text = std::fs::read_to_string(path).map_err(|source| match source.kind() {
        std::io::ErrorKind::NotFound => LogError::Missing(path.to_owned()),
        _ => LogError::io("read the models in", path, source),
    })?;
    let mut file = ModelFile::parse(&text, path)?;
    file.as_read = Some(text);
    Ok(file)
}

/// Writes a file of models whole or not at all.
///
/// # Errors
/// If it cannot be written, may not be, or has changed since it was read; what was there is then as it was.
pub fn save(file: &mut ModelFile, path: &Path) -> Result<()> {
    // Through a link to what it names.
    let path = &path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let failed = |e: std::io::Error| LogError::io("write the models to", path, e);
    let present = match std::fs::read_to_string(path) {
        Ok(text) => Some(text),
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => None,
        Err(e) => return Err(failed(e).into()),
    };
    if present != file.as_read {
        return Err(Error::Changed(path.to_owned()));
    }
    require_writable(path)?;
    let text = file.text().map_err(|e| Error::Unwritable { file: path.to_owned(), why: e.to_string() })?;
    let mut beside = temporary_beside(path)?;
    beside.write_all(text.as_bytes()).map_err(failed)?;
    if let Ok(old) = std::fs::metadata(path) {
        std::fs::set_permissions(beside.path(), old.permissions()).map_err(failed)?;
    }
    publish_over(beside, path)?;
    file.as_read = Some(text);
    Ok(())
}

fn require_writable(path: &Path) -> Result<()> {
    let locked = std::fs::metadata(path).is_ok_and(|m| m.permissions().readonly());
    if locked { Err(Error::ReadOnly(path.to_owned())) } else { Ok(()) }
}

/// The models of `path` if it is about these recordings; a new list of none where there is no file yet.
///
/// # Errors
/// A file that is no file of models, or one about other recordings.
pub fn about(path: &Path, recordings: &[PathBuf], rig: Option<&Path>) -> Result<ModelFile> {
    let folder = path.parent().unwrap_or(Path::new(""));
    if !path.exists() {
        require_folder(path)?;
        let from_folder = |p: &Path| relative(p, folder);
        let recordings = recordings.iter().map(|r| from_folder(r)).collect();
        return Ok(ModelFile { in_force: 0, recordings, rig: rig.map(from_folder), models: Vec::new(), as_read: None });
    }
    let file = load(path)?;
    require_writable(path)?;
    let same = file.recordings.len() == recordings.len()
        && recordings.iter().all(|r| file.recordings.iter().any(|own| output::same_file(&folder.join(own), r)));
    if !same {
        let own = file.recordings.iter().map(|r| r.display().to_string()).collect::<Vec<_>>().join(", ");
        return Err(Error::OtherRecordings { file: path.to_owned(), recordings: own });
    }
    let own = file.rig.as_ref().map(|r| folder.join(r));
    if let (Some(own), Some(asked)) = (&own, rig)
        && !output::same_file(own, asked)
    {
        return Err(Error::OtherRigFile { file: path.to_owned(), rig: own.clone() });
    }
    Ok(file)
}

/// The rig file to read the recordings with: the one asked for, or that of the file of models.
pub fn rig_of(asked: Option<&Path>, file: Option<(&Path, &ModelFile)>) -> Option<PathBuf> {
    let own = |(path, file): (&Path, &ModelFile)| Some(path.parent().unwrap_or(Path::new("")).join(file.rig.as_ref()?));
    asked.map(Path::to_owned).or_else(|| own(file.filter(|(_, f)| !f.models.is_empty())?))
}

/// A path from a folder where it lies in it, otherwise from the root.
fn relative(path: &Path, folder: &Path) -> PathBuf {
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    match (path.canonicalize(), folder.canonicalize()) {
        (Ok(path), Ok(folder)) => path.strip_prefix(&folder).map(Path::to_owned).unwrap_or(path),
        _ => path.to_owned(),
    }
}
