//! A rig that is made on the page: from a table of a logger and a form beside it to a rig file, a recording and its first fit.

use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use serde::Deserialize;
use serde_json::{Value, json};
use tempfile::TempDir;

use crate::draft::form::{Filled, Form, Seen};
use crate::draft::reading::Reading;
use crate::draft::remark::{Remark, Weight};
use crate::rig::material::MATERIALS;
use crate::shown::Shown as _;
use crate::storage::import::{
    ImportOptions, Repair, SourceFile, SourceOptions, Track, import_file, rate_hz, read_source, unit_warnings,
};
use crate::storage::{LogError, keep, write};
use crate::units::UNITS;
use crate::watch::evaluate::sentence;
use crate::web::session::glances::{FileKey, key, spark};

type AnyError = Box<dyn Error + Send + Sync>;

/// Values of a column that are shown.
const SHOWN: usize = 4;

/// What a page asks about a table.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Asked {
    /// The table's name: one of the folder's, or the one that was dropped on the page.
    pub table: String,
    /// What is written in the form.
    #[serde(default)]
    pub form: Form,
    /// Write rig and recording; otherwise the table is only looked at.
    #[serde(default)]
    pub accept: bool,
}

/// A table as it was read last, with what its reading went by.
type LastRead = (FileKey, SourceOptions, Arc<SourceFile>);

/// See the module.
#[derive(Default)]
pub struct Tables {
    /// The table that was dropped on the page last: its name, in a folder of its own.
    dropped: Mutex<Option<(TempDir, String)>>,
    /// A form asks again at each answer, of which few change how the table is read.
    last: Mutex<Option<LastRead>>,
}

fn lock<T>(of: &Mutex<T>) -> MutexGuard<'_, T> {
    of.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Tables {
    /// Keeps a table that was dropped on the page.
    ///
    /// # Errors
    /// No room for it.
    pub fn keep(&self, name: &str, bytes: &[u8]) -> Result<(), AnyError> {
        let scratch = tempfile::tempdir()?;
        fs::write(scratch.path().join(name), bytes)?;
        *lock(&self.dropped) = Some((scratch, name.to_owned()));
        Ok(())
    }

    /// Where a table lies, by its name.
    fn path(&self, name: &str, tables: &[PathBuf]) -> Option<PathBuf> {
        let dropped = lock(&self.dropped);
        let scratch = dropped.as_ref().filter(|(_, own)| own == name).map(|(scratch, own)| scratch.path().join(own));
        scratch.or_else(|| tables.iter().find(|path| name_of(path) == name).cloned())
    }

    fn read(&self, path: &Path, source: &SourceOptions) -> Result<Arc<SourceFile>, AnyError> {
        let now = key(path)?;
        if let Some((of, by, file)) = &*lock(&self.last)
            && (of, by) == (&now, source)
        {
            return Ok(file.clone());
        }
        let file = Arc::new(read_source(path, source)?);
        *lock(&self.last) = Some((now, source.clone(), file.clone()));
        Ok(file)
    }

    /// What a form makes of a table, and, where that is wished, the files that were written to the folder: rig and recording.
    ///
    /// # Errors
    /// A table that is not there; where it is to be written, a form with an answer that is wrong or missing, and a folder that cannot be written to.
    /// Nothing is written then.
    pub fn take(&self, asked: &Asked, tables: &[PathBuf], folder: &Path) -> Result<(Value, Option<PathBuf>), AnyError> {
        let path = self.path(&asked.table, tables).ok_or("there is no such table: drop it on the page again")?;
        let name = Path::new(&asked.table);
        // nobody knows the scratch file by its name
        let by_name = |error: &(dyn Error + 'static)| sentence(error).replace(&*path.shown(), &name.shown());
        let stem = name.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let [rig_path, out] = [free(folder, "rig", "toml"), free(folder, &stem, "mcap")];
        let mut remarks = Vec::new();
        let file = self.read(&path, &asked.form.reading.options(&mut remarks));
        let mut about = json!({
            "table": asked.table, "folder": std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned()).shown(),
            "name": stem, "writes": [name_of(&rig_path), name_of(&out)], "pipe": null, "columns": [], "understood": [], "guessed": [], "rig": null, "written": null,
            "materials": MATERIALS.iter().map(|material| material.name).collect::<Vec<_>>(),
            "units": UNITS.iter().map(|unit| json!([unit.symbol, format!("{:?}", unit.quantity).to_lowercase()])).collect::<Vec<_>>(),
        });
        let file = match file {
            Ok(file) => file,
            Err(error) => {
                let says = by_name(&*error);
                if asked.accept {
                    return Err(says.into());
                }
                if let Some(error) = error.downcast_ref::<LogError>() {
                    let asked = Reading::unread(error);
                    let weight = if asked.is_empty() { Weight::Wrong } else { Weight::Open };
                    remarks.push(Remark::new(weight, "file", says));
                    remarks.extend(asked);
                    about["remarks"] = json!(remarks);
                    return Ok((about, None));
                }
                return Err(error);
            }
        };
        let Filled { pipe, columns, remarks, made } = asked.form.filled(&file, &stem);
        about["pipe"] = json!(pipe);
        about["columns"] = file.tracks.iter().zip(&columns).map(column).collect();
        let asked_for = |repair: &&Repair| remarks.iter().all(|remark| !remark.says.ends_with(&repair.text));
        let of_file = file.repairs.iter().chain(file.tracks.iter().flat_map(|track| &track.repairs));
        let of_rig = made.iter().flat_map(|made| &made.repairs).filter(|repair| repair.what != "left-out");
        let (guessed, understood): (Vec<&Repair>, Vec<&Repair>) =
            of_file.chain(of_rig).filter(asked_for).partition(|repair| repair.guessed);
        about["understood"] = understood.iter().map(|repair| json!(repair.text)).collect();
        about["guessed"] = guessed.iter().map(|repair| json!(repair.text)).collect();
        about["rig"] = made.as_ref().map_or(Value::Null, |made| json!({ "text": made.text, "doubts": made.doubts }));
        if !asked.accept {
            about["remarks"] = json!(remarks);
            return Ok((about, None));
        }
        let Some(made) = made else {
            let wanting = remarks.iter().filter(|remark| remark.weight != Weight::Assumed);
            let wanting: Vec<String> = wanting.map(|remark| format!("{}: {}", remark.field, remark.says)).collect();
            return Err(format!("nothing was written; {}", wanting.join("; ")).into());
        };
        let imported = import_file(&path, &made.rig, &ImportOptions::default(), &made.source, true);
        let imported = imported.map_err(|error| by_name(&error))?;
        keep(&rig_path, made.text.as_bytes())?;
        if let Err(error) = write(&out, &imported.recording) {
            // a rig without its recording would stand in the way of the next try
            let _ = fs::remove_file(&rig_path);
            return Err(error.into());
        }
        about["remarks"] = json!(remarks);
        about["warnings"] = unit_warnings(&imported.recording).iter().map(|warning| json!(warning.text)).collect();
        about["written"] = json!([name_of(&rig_path), name_of(&out)]);
        // a table takes memory
        *lock(&self.last) = None;
        lock(&self.dropped).take_if(|(_, own)| *own == asked.table);
        Ok((about, Some(out)))
    }
}

/// A file's name, as the page shows it and names it.
pub fn name_of(path: &Path) -> String {
    Path::new(path.file_name().unwrap_or_default()).shown().into_owned()
}

/// A file of this name that does not exist yet.
pub fn free(folder: &Path, stem: &str, ending: &str) -> PathBuf {
    let first = folder.join(format!("{stem}.{ending}"));
    let further = (2..).map(|n| folder.join(format!("{stem}-{n}.{ending}")));
    std::iter::once(first.clone()).chain(further).find(|path| !path.exists()).unwrap_or(first)
}

/// A column, as it is written and as it is understood.
fn column((track, seen): (&Track, &Seen)) -> Value {
    let (time_s, value) = (&track.series.time_s, &track.series.value);
    json!({
        "name": track.name, "short": track.short, "written_unit": track.unit, "samples": value.len(), "rate_hz": rate_hz(&track.series),
        "from_s": time_s.first(), "to_s": time_s.last(), "first": value.iter().take(SHOWN).collect::<Vec<_>>(), "spark": spark(value),
        "is": seen.kind.map(|kind| kind.name()), "unit": seen.unit.map(|unit| unit.symbol), "position_m": seen.position_m,
    })
}
