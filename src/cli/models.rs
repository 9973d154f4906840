//! A file of models at hand: read with its recordings, grown, written.

use std::error::Error;
use std::path::{Path, PathBuf};

use super::load;
use crate::fit::calibrate::Options;
use crate::fit::data::RunData;
use crate::fit::model_file::ModelFile;
use crate::rig::Rig;

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
}

/// Reads a file of models and the recordings that it names.
///
/// # Errors
/// If either cannot be read.
pub fn open(path: &Path) -> Result<Opened, Box<dyn Error + Send + Sync>> {
    let file = ModelFile::load(path)?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let recordings: Vec<PathBuf> = file.recordings.iter().map(|r| folder.join(r)).collect();
    let rig = file.rig.as_ref().map(|r| folder.join(r));
    let loaded = load::load(&recordings, rig.as_deref())
        .map_err(|e| format!("{}: the recordings that it names: {e}", path.display()))?;
    let options = Options { constraints: file.current().constraints(), ..Options::default() };
    let rig = loaded[0].recording.rig.clone();
    Ok(Opened { path: path.to_owned(), rig, runs: load::runs(&loaded), options, file })
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
        let from_folder = |p: &Path| relative(p, folder);
        let recordings = recordings.iter().map(|r| from_folder(r)).collect();
        return Ok(ModelFile { in_force: 0, recordings, rig: rig.map(from_folder), models: Vec::new() });
    }
    let file = ModelFile::load(path)?;
    let same = file.recordings.len() == recordings.len()
        && recordings.iter().all(|r| file.recordings.iter().any(|own| super::output::same_file(&folder.join(own), r)));
    if !same {
        return Err(format!(
            "{} holds the models of {}: name another file for other recordings",
            path.display(),
            file.recordings.iter().map(|r| r.display().to_string()).collect::<Vec<_>>().join(", ")
        )
        .into());
    }
    Ok(file)
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
