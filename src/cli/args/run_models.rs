//! `--save FOLDER`: of several runs fitted each by itself, each one's model in a file of its own.

use std::error::Error;
use std::path::{Path, PathBuf};

use crate::cli::console::print::tell;
use crate::fit::outcome::fit::Fit;
use crate::results::fit_record::now;
use crate::results::model_file::ModelFile;
use crate::shown::Shown as _;
use crate::storage::LogError;
use crate::study::models;

/// Where the models of the runs go.
#[derive(Debug, clap::Args)]
pub struct RunModels {
    /// Save each run's model in this folder as NAME.model.toml; the folder is created if missing, older models stay in
    /// the files.
    // A file of models finds its run's temperature in the recording or its rig, and not on a command line.
    #[arg(long, value_name = "FOLDER", conflicts_with = "temperature_degc")]
    save: Option<PathBuf>,
}

/// Files of models, in the order of the recordings; none where nothing is to be kept.
pub struct OpenModels(Vec<(PathBuf, ModelFile)>);

impl RunModels {
    /// Opens the file of each recording, before fits that may take long.
    ///
    /// # Errors
    /// A folder that cannot be made, two recordings of one name, a file that is about another recording or rig.
    pub fn open(&self, recordings: &[PathBuf], rig: Option<&Path>) -> Result<OpenModels, Box<dyn Error + Send + Sync>> {
        let Some(folder) = &self.save else { return Ok(OpenModels(Vec::new())) };
        std::fs::create_dir_all(folder).map_err(|e| LogError::io("make the folder", folder, e))?;
        let mut open: Vec<(PathBuf, ModelFile)> = Vec::new();
        for recording in recordings {
            let name = recording.file_stem().unwrap_or_default().to_string_lossy();
            let path = folder.join(format!("{name}.model.toml"));
            if open.iter().any(|(other, _)| *other == path) {
                return Err(format!(
                    "two recordings are called {name}, so their models would have one name: rename one"
                )
                .into());
            }
            let file = models::about(&path, std::slice::from_ref(recording), rig)?;
            if let (Some(own), None) = (&file.rig, rig) {
                return Err(
                    format!("{} holds models of the rig {}: name it with --rig", path.shown(), own.shown()).into()
                );
            }
            open.push((path, file));
        }
        Ok(OpenModels(open))
    }
}

impl OpenModels {
    /// Puts each fit in force in its file.
    ///
    /// # Errors
    /// A file that cannot be written, or has changed meanwhile.
    pub fn save(self, fits: &[Fit], why: &str) -> Result<(), Box<dyn Error + Send + Sync>> {
        for ((path, mut file), fit) in self.0.into_iter().zip(fits) {
            file.append(fit, why, None, now());
            models::save(&mut file, &path)?;
            tell!("model {} in {}", file.in_force, path.shown());
        }
        Ok(())
    }
}
