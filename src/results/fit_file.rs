//! A fit record as a file: `calibrate -o FIT.toml` or `FIT.json`. The keys are the same in both.
//!
//! This is a result: it says all about one fit and is written once. The models that a person edits, and goes on from,
//! are in another file (`calibrate --save MODEL.toml`).

use std::path::Path;

use crate::results::fit_record::{FORMAT, FitRecord};
use crate::shown::Shown as _;
use crate::text_file::read_text;

/// First line of the TOML form.
const HEADING: &str = "# surgescope fit: a result, not to be edited (keys: docs/src/keys.md in surgescope's guide)";

/// What a file of results is written as.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// `.toml`
    Toml,
    /// `.json`
    Json,
}

/// A fit on disk that cannot be used.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // the sentences say it
pub enum FitFileError {
    #[error("{0}: a fit is written as TOML or JSON: use a name that ends in .toml or .json")]
    Form(String),
    #[error("cannot read the fit in {0}: {1}")]
    Read(String, std::io::Error),
    #[error("{0} is not a surgescope fit (see `calibrate -o`): {1}")]
    Parse(String, String),
    #[error("{0} is a fit in the format '{1}', and this program reads '{FORMAT}'")]
    Format(String, String),
}

impl Form {
    /// By a file's extension.
    ///
    /// # Errors
    /// Any other than `.toml` and `.json`.
    pub fn of(path: &Path) -> Result<Form, FitFileError> {
        match path.extension().and_then(|e| e.to_str()) {
            Some(e) if e.eq_ignore_ascii_case("toml") => Ok(Form::Toml),
            Some(e) if e.eq_ignore_ascii_case("json") => Ok(Form::Json),
            _ => Err(FitFileError::Form(path.shown().into_owned())),
        }
    }
}

impl FitRecord {
    /// Its text.
    ///
    /// # Errors
    /// None in practice: all values can be written.
    pub fn text(&self, form: Form) -> Result<String, Box<dyn std::error::Error + Send + Sync>> {
        Ok(match form {
            Form::Toml => format!("{HEADING}\n\n{}", toml::to_string(self)?),
            Form::Json => serde_json::to_string_pretty(self)? + "\n",
        })
    }

    /// From the text of a file; `name` is for messages.
    ///
    /// # Errors
    /// A text that is no fit, or one of another format.
    pub fn parse(text: &str, form: Form, name: &str) -> Result<FitRecord, FitFileError> {
        let parsed: Result<FitRecord, String> = match form {
            Form::Toml => toml::from_str(text).map_err(|e| e.message().to_owned()),
            Form::Json => serde_json::from_str(text).map_err(|e| e.to_string()),
        };
        let file = parsed.map_err(|e| FitFileError::Parse(name.to_owned(), e))?;
        if file.format != FORMAT {
            return Err(FitFileError::Format(name.to_owned(), file.format));
        }
        Ok(file)
    }

    /// From a file, whose extension says its form.
    ///
    /// # Errors
    /// One that cannot be read; as [`FitRecord::parse`].
    pub fn read(path: &Path) -> Result<FitRecord, FitFileError> {
        let name = path.shown().into_owned();
        let form = Form::of(path)?;
        let text = read_text(path).map_err(|e| FitFileError::Read(name.clone(), e))?;
        FitRecord::parse(&text, form, &name)
    }
}
