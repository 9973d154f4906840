//! `calibrate -o FIT.toml`: a fit as a file of its own.

use std::error::Error;
use std::path::{Path, PathBuf};

use crate::cli::console::print::tell;
use crate::results::fit_file::Form;
use crate::results::fit_record::FitRecord;
use crate::shown::Shown as _;
use crate::storage::output;

/// Where a fit is written.
#[derive(Debug, clap::Args)]
pub struct FitOutput {
    /// Write the full result to a new file, TOML or JSON by its extension. To continue from a model, use --save.
    #[arg(short, long, value_name = "FIT.toml|FIT.json")]
    output: Option<PathBuf>,
    /// Replace an existing output, unless it is a recording.
    #[arg(long, requires = "output")]
    overwrite: bool,
}

impl FitOutput {
    /// Where it is written, if anywhere.
    pub fn path(&self) -> Option<&Path> {
        self.output.as_deref()
    }

    /// Refuses a place that cannot take the fit, before it is made.
    ///
    /// # Errors
    /// Another extension, a file that exists, a folder that does not.
    pub fn check(&self) -> Result<(), Box<dyn Error + Send + Sync>> {
        let Some(path) = &self.output else { return Ok(()) };
        Form::of(path)?;
        output::check_new(path, self.overwrite)
    }

    /// Writes the fit, if that is asked for.
    ///
    /// # Errors
    /// As [`FitOutput::check`]; a file that cannot be written.
    pub fn write(&self, record: &FitRecord) -> Result<(), Box<dyn Error + Send + Sync>> {
        let Some(path) = &self.output else { return Ok(()) };
        let text = record.text(Form::of(path)?)?;
        output::write_new(path, &text, self.overwrite)?;
        tell!("fit: {}", path.shown());
        Ok(())
    }
}
