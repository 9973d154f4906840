//! A rig that is made on the page: from a table of a logger and a form beside it to a rig file, a recording and its
//! first fit.

use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use serde::Deserialize;
use serde_json::{Value, json};
use tempfile::TempDir;

use crate::align::Part;
use crate::draft::form::{Filled, Form, Made, Seen};
use crate::draft::reading::Reading;
use crate::draft::remark::{Remark, Weight};
use crate::rig::material::MATERIALS;
use crate::shown::Shown as _;
use crate::storage::import::{
    ImportOptions, Repair, SourceFile, SourceOptions, Track, import_file, rate_hz, read_source, unit_warnings,
};
use crate::storage::together::{Together, recorded, together};
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
    /// Further tables of the same closure.
    #[serde(default)]
    pub further: Vec<String>,
    /// What is written in the form.
    #[serde(default)]
    pub form: Form,
    /// Write rig and recording; otherwise the table is only looked at.
    #[serde(default)]
    pub accept: bool,
}

/// The tables of one closure.
struct Whole {
    /// What they hold together.
    file: SourceFile,
    /// The columns of each.
    columns: Vec<Vec<String>>,
}

/// Tables as they were read last, with what their reading went by.
type LastRead = (Vec<FileKey>, SourceOptions, Arc<Whole>);

/// See the module.
#[derive(Default)]
pub struct Tables {
    /// The tables that were dropped on the page last: their names, in a folder of their own.
    dropped: Mutex<Option<(TempDir, Vec<String>)>>,
    /// A form asks again at each answer, of which few change how the table is read.
    last: Mutex<Option<LastRead>>,
}

fn lock<T>(of: &Mutex<T>) -> MutexGuard<'_, T> {
    of.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Tables {
    /// Keeps tables that were dropped on the page, by their names.
    ///
    /// # Errors
    /// No room for them; two of one name.
    pub fn keep(&self, files: &[(String, Vec<u8>)]) -> Result<(), AnyError> {
        let scratch = tempfile::tempdir()?;
        for (name, bytes) in files {
            let path = scratch.path().join(name);
            if path.exists() {
                return Err(format!("two of the files are called {name}: give one of them another name").into());
            }
            fs::write(path, bytes)?;
        }
        *lock(&self.dropped) = Some((scratch, files.iter().map(|(name, _)| name.clone()).collect()));
        Ok(())
    }

    /// Where a table lies, by its name.
    fn path(&self, name: &str, tables: &[PathBuf]) -> Option<PathBuf> {
        let dropped = lock(&self.dropped);
        let own = dropped.as_ref().filter(|(_, names)| names.iter().any(|own| own == name));
        let scratch = own.map(|(scratch, _)| scratch.path().join(name));
        scratch.or_else(|| tables.iter().find(|path| name_of(path) == name).cloned())
    }

    /// The tables beside one, which may be of the same closure: those that were dropped with it, or the folder's.
    fn beside(&self, name: &str, tables: &[PathBuf]) -> Vec<String> {
        let dropped = lock(&self.dropped).as_ref().map(|(_, names)| names.clone());
        let with_it = dropped.filter(|names| names.iter().any(|own| own == name));
        let all = with_it.unwrap_or_else(|| tables.iter().map(|path| name_of(path)).collect());
        all.into_iter().filter(|own| own != name).collect()
    }

    fn read(&self, paths: &[PathBuf], source: &SourceOptions) -> Result<Arc<Whole>, LogError> {
        let now: Option<Vec<FileKey>> = paths.iter().map(|path| key(path).ok()).collect();
        if let (Some((of, by, whole)), Some(now)) = (&*lock(&self.last), &now)
            && (of, by) == (now, source)
        {
            return Ok(whole.clone());
        }
        let parts: Vec<SourceFile> = paths.iter().map(|path| read_source(path, source)).collect::<Result<_, _>>()?;
        let columns = parts.iter().map(|part| part.tracks.iter().map(|track| track.name.clone()).collect()).collect();
        let refused = |why| LogError::SourceFile { path: paths.last().cloned().unwrap_or_default(), why };
        let whole = Arc::new(Whole { file: SourceFile::continued(parts).map_err(refused)?, columns });
        *lock(&self.last) = now.map(|now| (now, source.clone(), whole.clone()));
        Ok(whole)
    }

    /// What a form makes of a table, and, where that is wished, the files that were written to the folder: rig and
    /// recording.
    ///
    /// # Errors
    /// A table that is not there; where it is to be written, a form with an answer that is wrong or missing, and a
    /// folder that cannot be written to. Nothing is written then.
    pub fn take(&self, asked: &Asked, tables: &[PathBuf], folder: &Path) -> Result<(Value, Option<PathBuf>), AnyError> {
        let path = |name: &String| {
            self.path(name, tables)
                .ok_or_else(|| format!("there is no such table as {name}: drop it on the page again"))
        };
        let paths = std::iter::once(&asked.table).chain(&asked.further).map(path).collect::<Result<Vec<_>, _>>()?;
        let name = Path::new(&asked.table);
        // nobody knows the scratch files by their names
        let by_name = |error: &(dyn Error + 'static)| {
            paths.iter().fold(sentence(error), |said, path| said.replace(&*path.shown(), &name_of(path)))
        };
        let stem = name.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let [rig_path, out] = [free(folder, "rig", "toml"), free(folder, &stem, "mcap")];
        let mut remarks = Vec::new();
        let whole = self.read(&paths, &asked.form.reading.options(&mut remarks));
        let mut about = json!({
            "table": asked.table, "further": asked.further, "beside": self.beside(&asked.table, tables), "folder": std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned()).shown(),
            "name": stem, "writes": [name_of(&rig_path), name_of(&out)], "pipe": null, "columns": [], "understood": [], "guessed": [], "rig": null, "written": null,
            "materials": MATERIALS.iter().map(|material| material.name).collect::<Vec<_>>(),
            "units": UNITS.iter().map(|unit| json!([unit.symbol, format!("{:?}", unit.quantity).to_lowercase()])).collect::<Vec<_>>(),
        });
        let whole = match whole {
            Ok(whole) => whole,
            Err(error) => {
                let says = by_name(&error);
                if asked.accept {
                    return Err(says.into());
                }
                let reading = Reading::unread(&error);
                let weight = if reading.is_empty() { Weight::Wrong } else { Weight::Open };
                remarks.push(Remark::new(weight, "file", says));
                remarks.extend(reading);
                // what the first table alone leaves open may be why they do not come together
                if paths.len() > 1
                    && let Ok(first) = self.read(&paths[..1], &asked.form.reading.options(&mut Vec::new()))
                {
                    remarks.extend(asked.form.reading.asked(&first.file.repairs));
                }
                about["remarks"] = json!(remarks);
                return Ok((about, None));
            }
        };
        let file = &whole.file;
        let Filled { pipe, columns, mut remarks, mut made } = asked.form.filled(file, &stem);
        let joined = made.as_ref().filter(|_| paths.len() > 1).map(|made| joined(&paths, &whole.columns, made));
        let joined = match joined {
            Some(Err(error)) => {
                remarks.push(Remark::new(Weight::Wrong, "further", by_name(&*error)));
                made = None;
                None
            }
            Some(Ok(together)) => Some(together),
            None => None,
        };
        about["pipe"] = json!(pipe);
        about["columns"] = file.tracks.iter().zip(&columns).map(column).collect();
        let asked_for = |repair: &&Repair| remarks.iter().all(|remark| !remark.says.ends_with(&repair.text));
        let of_file = file.repairs.iter().chain(file.tracks.iter().flat_map(|track| &track.repairs));
        let of_rig = made.iter().flat_map(|made| &made.repairs).filter(|repair| repair.what != "left-out");
        let (guessed, understood): (Vec<&Repair>, Vec<&Repair>) =
            of_file.chain(of_rig).filter(asked_for).partition(|repair| repair.guessed);
        let parts = joined.iter().flat_map(Together::said);
        about["understood"] =
            understood.iter().map(|repair| repair.text.clone()).chain(parts).map(Value::from).collect();
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
        let recording = match joined {
            Some(together) => together.recording,
            None => {
                let imported = import_file(&paths[0], &made.rig, &ImportOptions::default(), &made.source, true);
                imported.map_err(|error| by_name(&error))?.recording
            }
        };
        keep(&rig_path, made.text.as_bytes())?;
        if let Err(error) = write(&out, &recording) {
            // a rig without its recording would stand in the way of the next try
            let _ = fs::remove_file(&rig_path);
            return Err(error.into());
        }
        about["remarks"] = json!(remarks);
        about["warnings"] = unit_warnings(&recording).iter().map(|warning| json!(warning.text)).collect();
        about["written"] = json!([name_of(&rig_path), name_of(&out)]);
        // a table takes memory
        *lock(&self.last) = None;
        lock(&self.dropped).take_if(|(_, names)| names.contains(&asked.table));
        Ok((about, Some(out)))
    }
}

/// One recording of all tables, as `import` makes it: each table takes only the answers about its own columns, and a
/// flow by hand is one reading.
fn joined(paths: &[PathBuf], columns: &[Vec<String>], made: &Made) -> Result<Together, AnyError> {
    let mut parts: Vec<Part> = Vec::new();
    for (path, own) in paths.iter().zip(columns) {
        let mut source = made.source.clone();
        source.map.retain(|(column, _)| own.contains(column));
        source.scales.retain(|(column, _)| own.contains(column));
        source.ignore.retain(|column| own.contains(column));
        source.flow = source.flow.filter(|_| parts.is_empty());
        source.elsewhere = recorded(&parts, &made.rig);
        let imported = import_file(path, &made.rig, &ImportOptions::default(), &source, false)?;
        parts.push(Part { file: name_of(path), recording: imported.recording, start_digit_s: imported.start_digit_s });
    }
    Ok(together(parts, &made.rig, &[], &columns.concat(), None)?)
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
