//! Recordings from disk with their signals, ready for a fit.

use std::error::Error;
use std::path::{Path, PathBuf};

use crate::fit::data::prepare::prepare;
use crate::fit::data::run_data::RunData;
use crate::recording::Recording;
use crate::rig::Rig;
use crate::signal::doubts::doubts;
use crate::signal::{Features, inspect};
use crate::storage::output::{same_content, same_file};

/// A recording with what it shows.
pub struct Loaded {
    /// File name without its folder.
    pub file: String,
    /// The recording, on the rig in force.
    pub recording: Recording,
    /// What it shows.
    pub features: Features,
    /// What of that should make a user look twice, one sentence each.
    pub doubts: Vec<String>,
}

/// Reads recordings, all of one rig: that of `rig`, or the one stored in the first of them.
///
/// # Errors
/// Any that cannot be read or shows no closure (the file is named), one given twice, or recordings of different rigs.
pub fn load(paths: &[PathBuf], rig: Option<&Path>) -> Result<Vec<Loaded>, Box<dyn Error + Send + Sync>> {
    let given = rig.map(Rig::load).transpose()?;
    let mut loaded: Vec<Loaded> = Vec::new();
    for (i, path) in paths.iter().enumerate() {
        if let Some(twin) = paths[..i].iter().find(|p| same_file(p, path)) {
            return Err(if twin == path {
                format!("{} is given twice: a recording counts once", path.display())
            } else {
                format!("{} and {} are one recording: it counts once", twin.display(), path.display())
            }
            .into());
        }
        if let Some(twin) = paths[..i].iter().find(|p| same_content(p, path)) {
            return Err(format!("{} is a copy of {}: a recording counts once", path.display(), twin.display()).into());
        }
        let mut recording = crate::storage::read(path)?;
        if let Some(rig) = &given {
            recording = recording.on_rig(rig.clone()).map_err(|e| format!("{}: {e}", path.display()))?;
        } else if let Some(first) = loaded.first()
            && first.recording.rig.source != recording.rig.source
        {
            return Err(format!(
                "{} was made on rig '{}' and {} on rig '{}', or on another state of it; fit them apart, or say with --rig which \
                 rig file holds for all",
                loaded[0].file,
                loaded[0].recording.rig.name,
                path.display(),
                recording.rig.name
            )
            .into());
        }
        let features = inspect(&recording).map_err(|e| format!("{}: {e}", path.display()))?;
        let file = file_name(path, paths);
        let doubts = doubts(&recording.rig, &features);
        loaded.push(Loaded { file, recording, features, doubts });
    }
    Ok(loaded)
}

/// The file's name alone, or its path where another of the paths has the same name.
fn file_name(path: &Path, paths: &[PathBuf]) -> String {
    let name = path.file_name().unwrap_or(path.as_os_str());
    let unique = paths.iter().filter(|p| p.file_name() == Some(name)).count() == 1;
    if unique { name.to_string_lossy().into_owned() } else { path.display().to_string() }
}

/// What a fit takes.
pub fn runs(loaded: &[Loaded]) -> Vec<RunData> {
    loaded.iter().map(|l| prepare(&l.file, &l.recording.rig, &l.recording, &l.features)).collect()
}
