//! A file of models at hand: read with its recordings, grown, written.

use std::path::{Path, PathBuf};

use crate::fit::outcome::fit::Fit;
use crate::fit::search::options::Options;
use crate::results::fit_record::now;
use crate::results::model_file::{ModelFile, ModelFileError};
use crate::shown::Shown as _;
use crate::storage::LogError;
use crate::storage::disk::{alone_in_folder, require_folder};
use crate::storage::output;
use crate::study::Study;
use crate::study::error::{Error, Result};
use crate::text_file::read_text;

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
        let current = self.file.current();
        Ok(current.refit(self.study.rig(), self.study.runs(), &Options::default(), self.study.watcher())?)
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
    let text = read_text(path).map_err(|source| match source.kind() {
        std::io::ErrorKind::NotFound => Error::from(LogError::Missing(path.to_owned())),
        std::io::ErrorKind::InvalidData => {
            let why = "it holds no text; models of a recording are in a file of their own, NAME.model.toml".to_owned();
            ModelFileError::Parse(path.to_owned(), why).into()
        }
        _ => LogError::io("read the models in", path, source).into(),
    })?;
    let mut file = ModelFile::parse(&text, path)?;
    file.as_read = Some(text);
    Ok(file)
}

/// Writes a file of models whole or not at all, one process at a time. Models that another process has added since the
/// file was read stay in it; those of `file` follow them.
///
/// # Errors
/// If it cannot be written, may not be, or has been changed otherwise since it was read; what was there is then as it
/// was.
pub fn save(file: &mut ModelFile, path: &Path) -> Result<()> {
    // Through a link to what it names.
    let path = &path.canonicalize().unwrap_or_else(|_| path.to_owned());
    alone_in_folder(path, || save_alone(file, path))
}

fn save_alone(file: &mut ModelFile, path: &Path) -> Result<()> {
    let failed = |e: std::io::Error| LogError::io("write the models to", path, e);
    let present = match read_text(path) {
        Ok(text) => Some(text),
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => None,
        Err(e) => return Err(failed(e).into()),
    };
    // a file that somebody deleted is written anew
    if present.is_some() && present != file.as_read {
        let parsed = |text: &Option<String>| text.as_deref().and_then(|text| ModelFile::parse(text, path).ok());
        let joined = parsed(&present).and_then(|there| file.behind(&there, parsed(&file.as_read).as_ref()));
        *file = joined.ok_or_else(|| Error::Changed(path.to_owned()))?;
    }
    require_writable(path)?;
    let text = file.text().map_err(|e| Error::Unwritable { file: path.to_owned(), why: e.to_string() })?;
    output::write(path, &text)?;
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
        let own = file.recordings.iter().map(|r| r.shown().into_owned()).collect::<Vec<_>>().join(", ");
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Eight writers that have all read the same file: each model that one saved is in it at the end, and each grew out
    /// of what its writer read.
    #[test]
    fn no_model_is_lost_among_eight_writers() {
        const WRITERS: usize = 8;
        const SAVES: usize = 25;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("grown.model.toml");
        let kept = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/results/grown.model.toml");
        std::fs::copy(kept, &path).unwrap();
        let first = load(&path).unwrap();
        let write = |writer: usize| {
            for save_number in 0..SAVES {
                let mut file = load(&path).unwrap();
                let mut model = file.current().clone();
                model.name = format!("{writer} {save_number}");
                model.grown_from = Some(file.in_force);
                // A file of hundreds of models would only be slow to read.
                model.parameters.clear();
                model.correlation.clear();
                file.models.push(model);
                file.in_force = file.models.len();
                save(&mut file, &path).unwrap();
            }
        };
        let write = &write;
        std::thread::scope(|scope| (0..WRITERS).for_each(|writer| drop(scope.spawn(move || write(writer)))));
        let file = load(&path).unwrap();
        assert_eq!(file.models.len(), first.models.len() + WRITERS * SAVES);
        assert_eq!(file.models[..first.models.len()], first.models);
        let mut names: Vec<&str> = file.models[first.models.len()..].iter().map(|m| m.name.as_str()).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), WRITERS * SAVES);
    }

    #[test]
    fn a_file_that_was_deleted_meanwhile_is_written_anew() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("grown.model.toml");
        let kept = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/results/grown.model.toml");
        std::fs::copy(kept, &path).unwrap();
        let mut file = load(&path).unwrap();
        std::fs::remove_file(&path).unwrap();
        file.models.push(file.current().clone());
        save(&mut file, &path).unwrap();
        assert_eq!(load(&path).unwrap().models.len(), file.models.len());
    }

    #[test]
    fn what_a_person_changed_meanwhile_is_not_written_over() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("grown.model.toml");
        let kept = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/results/grown.model.toml");
        std::fs::copy(kept, &path).unwrap();
        let mut file = load(&path).unwrap();
        let edited = std::fs::read_to_string(&path).unwrap().replacen("in_force = 2", "in_force = 1", 1);
        let other = edited.replacen("name = \"base model\"", "name = \"mine\"", 1);
        assert_ne!(other, edited);
        std::fs::write(&path, &other).unwrap();
        let model = file.current().clone();
        file.models.push(model);
        assert!(matches!(save(&mut file, &path), Err(Error::Changed(_))));
        assert_eq!(std::fs::read_to_string(&path).unwrap(), other);
    }
}
