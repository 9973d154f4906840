//! A file of models at hand: read with its recordings, grown, written.

use std::error::Error;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use crate::fit::data::run_data::RunData;
use crate::fit::search::options::Options;
use crate::results::model_file::ModelFile;
use crate::rig::Rig;
use crate::storage::LogError;
use crate::storage::disk::{publish_over, require_folder, temporary_beside};
use crate::storage::output;
use crate::study::open as recordings_of;

/// A file of models with all that a fit needs.
pub struct Opened {
    /// Where it is.
    pub path: PathBuf,
    /// The models.
    pub file: ModelFile,
    /// The rig of the recordings.
    pub rig: Rig,
    /// The recordings as a fit takes them.
    pub runs: Vec<RunData>,
    /// What the model in force settles.
    pub options: Options,
    /// What of the recordings should make a user look twice, each with its file.
    pub doubts: Vec<String>,
}

/// Reads a file of models and the recordings that it names.
///
/// # Errors
/// If either cannot be read.
pub fn open(path: &Path) -> Result<Opened, Box<dyn Error + Send + Sync>> {
    let file = load(path)?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let recordings: Vec<PathBuf> = file.recordings.iter().map(|r| folder.join(r)).collect();
    let rig = rig_of(None, Some((path, &file)));
    let loaded = recordings_of::load(&recordings, rig.as_deref())
        .map_err(|e| format!("{}: the recordings that it names: {e}", path.display()))?;
    let options =
        Options { constraints: file.current().constraints(), priors: file.current().priors(), ..Options::default() };
    let rig = loaded[0].recording.rig.clone();
    let doubts = loaded.iter().flat_map(|l| l.doubts.iter().map(|doubt| format!("{}: {doubt}", l.file))).collect();
    Ok(Opened { path: path.to_owned(), rig, runs: recordings_of::runs(&loaded), options, file, doubts })
}

/// Reads a file of models.
///
/// # Errors
/// One that cannot be read, is none, or contradicts itself.
pub fn load(path: &Path) -> Result<ModelFile, Box<dyn Error + Send + Sync>> {
    let text = std::fs::read_to_string(path).map_err(|e| output::unread("the models in", path, &e))?;
    let mut file = ModelFile::parse(&text, path)?;
    file.as_read = Some(text);
    Ok(file)
}

/// Writes a file of models whole or not at all.
///
/// # Errors
/// If it cannot be written, may not be, or has changed since it was read; what was there is then as it was.
pub fn save(file: &mut ModelFile, path: &Path) -> Result<(), Box<dyn Error + Send + Sync>> {
    // Through a link to what it names.
    let path = &path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let failed = |e: std::io::Error| LogError::io("write the models to", path, e);
    let present = match std::fs::read_to_string(path) {
        Ok(text) => Some(text),
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => None,
        Err(e) => return Err(failed(e).into()),
    };
    if present != file.as_read {
        return Err(format!("{} has changed while this ran: nothing was written; run it again", path.display()).into());
    }
    require_writable(path)?;
    let text = file.text()?;
    let mut beside = temporary_beside(path)?;
    beside.write_all(text.as_bytes()).map_err(failed)?;
    if let Ok(old) = std::fs::metadata(path) {
        std::fs::set_permissions(beside.path(), old.permissions()).map_err(failed)?;
    }
    publish_over(beside, path)?;
    file.as_read = Some(text);
    Ok(())
}

fn require_writable(path: &Path) -> Result<(), String> {
    let locked = std::fs::metadata(path).is_ok_and(|m| m.permissions().readonly());
    if locked { Err(format!("{} may not be written to", path.display())) } else { Ok(()) }
}

/// The models of `path` if it is about these recordings; a new list of none where there is no file yet.
///
/// # Errors
/// A file that is no file of models, or one about other recordings.
pub fn about(
    path: &Path,
    recordings: &[PathBuf],
    rig: Option<&Path>,
) -> Result<ModelFile, Box<dyn Error + Send + Sync>> {
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
        && recordings
            .iter()
            .all(|r| file.recordings.iter().any(|own| crate::storage::output::same_file(&folder.join(own), r)));
    if !same {
        return Err(format!(
            "{} holds the models of {}: name another file for other recordings",
            path.display(),
            file.recordings.iter().map(|r| r.display().to_string()).collect::<Vec<_>>().join(", ")
        )
        .into());
    }
    let own = file.rig.as_ref().map(|r| folder.join(r));
    if let (Some(own), Some(asked)) = (&own, rig)
        && !crate::storage::output::same_file(own, asked)
    {
        return Err(format!("{} holds models of the rig {}: name another file", path.display(), own.display()).into());
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

/// Now, as RFC 3339.
pub fn now() -> String {
    chrono::Utc::now().to_rfc3339_opts(chrono::SecondsFormat::Secs, true)
}
