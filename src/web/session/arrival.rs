//! A file that is dropped on the page becomes a recording in the folder, once its columns are agreed upon.

use std::error::Error;
use std::path::{Path, PathBuf};

use base64::Engine as _;
use base64::prelude::BASE64_STANDARD;
use serde::Deserialize;
use serde_json::{Value, json};

use crate::draft::reading::Reading;
use crate::draft::remark::Weight;
use crate::rig::Rig;
use crate::shown::Shown as _;
use crate::signal::doubts::doubts;
use crate::signal::faults::sensor_faults;
use crate::signal::inspect;
use crate::storage::import::{ImportOptions, Imported, SourceOptions, read_source, unit_warnings};
use crate::storage::{LogError, keep, read, write};
use crate::study::import::import;
use crate::watch::evaluate::sentence;
use crate::web::session::new_rig::free;

type AnyError = Box<dyn Error + Send + Sync>;

/// A file as a page sends it.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Dropped {
    /// Its name.
    pub name: String,
    /// Its bytes, base64.
    pub content: String,
    /// The run whose rig it is; otherwise the rig of what is open.
    #[serde(default)]
    pub rig_of: Option<String>,
    /// Columns and the sensors that they are.
    #[serde(default)]
    pub map: Vec<(String, String)>,
    /// Columns that are no sensors.
    #[serde(default)]
    pub ignore: Vec<String>,
    /// Sensors of the rig that were not recorded.
    #[serde(default)]
    pub without: Vec<String>,
    /// Samples per second of a column that counts samples.
    #[serde(default)]
    pub rate_hz: Option<f64>,
    /// What is written of its text and times.
    #[serde(default)]
    pub reading: Reading,
    /// Columns with what their numbers stand for: of volts or milliamperes such as `1..5 -> 0..10 bar`, of another unit such as `psi`.
    #[serde(default)]
    pub scales: Vec<(String, String)>,
    /// It is of a rig that is not there yet: a form asks for it.
    #[serde(default)]
    pub new_rig: bool,
    /// Write it as it was understood; otherwise it is only looked at.
    #[serde(default)]
    pub accept: bool,
}

impl Dropped {
    /// Its name as a folder lists it, and its bytes.
    ///
    /// # Errors
    /// A file without a name, content that is not base64.
    pub fn unpacked(&self) -> Result<(String, Vec<u8>), AnyError> {
        let name = plain_name(&self.name).ok_or("the file has no name")?;
        let bytes = BASE64_STANDARD.decode(&self.content).map_err(|e| format!("the content is not base64: {e}"))?;
        Ok((name, bytes))
    }
}

/// Reads a file on a rig and, where that is agreed, writes it to a folder. Returns how it was understood, and the recording; of a table without a rig
/// that it `needs_rig`.
///
/// # Errors
/// A file that is no recording of this rig, a folder that cannot be written to.
pub fn take(dropped: &Dropped, rig: Option<&Rig>, folder: &Path) -> Result<(Value, Option<PathBuf>), AnyError> {
    let (name, bytes) = dropped.unpacked()?;
    let name = name.as_str();
    // readers go by the ending of a name
    let scratch = tempfile::tempdir()?;
    let path = scratch.path().join(name);
    std::fs::write(&path, &bytes)?;
    // nobody knows the scratch file by its name
    let by_name = |error: AnyError| sentence(&*error).replace(&*path.shown(), &Path::new(name).shown());
    // A recording knows its rig, and is taken as it is.
    let own = if dropped.rig_of.is_none() { read(&path).ok() } else { None };
    let Some(rig) = own.as_ref().map(|recording| &recording.rig).or(rig) else {
        return Ok((json!({ "needs_rig": name }), None));
    };
    let sensors: Vec<&str> = rig.sensors.iter().map(|sensor| sensor.name.as_str()).collect();
    let mut remarks = Vec::new();
    let reading = dropped.reading.options(&mut remarks);
    let guessing = SourceOptions { rate_hz: reading.rate_hz.or(dropped.rate_hz), ..reading };
    let source = read_source(&path, &guessing);
    if let (Err(error), None) = (&source, &own) {
        remarks.extend(Reading::unread(error));
    }
    if let (Some(wrong), true) = (remarks.iter().find(|remark| remark.weight == Weight::Wrong), dropped.accept) {
        return Err(format!("{}: {}", wrong.field, wrong.says).into());
    }
    let needs_rate = dropped.rate_hz.is_some() || source.as_ref().is_err_and(LogError::lacks_rate);
    let columns: Vec<String> =
        source.map_or(Vec::new(), |read| read.tracks.into_iter().map(|track| track.name).collect());
    let scales = dropped.scales.iter().map(|(column, line)| Ok((column.clone(), line.parse()?)));
    let scales = scales.collect::<Result<Vec<_>, String>>();
    let read = scales
        .map_err(AnyError::from)
        .and_then(|scales| imported(dropped, SourceOptions { scales, ..guessing }, rig, &path));
    let imported = match read.map_err(by_name) {
        // what is only looked at may still be mended: by the rate of its samples, or by saying which column is which sensor
        Err(error) if !dropped.accept && (needs_rate || !remarks.is_empty() || !columns.is_empty()) => {
            let about = json!({
                "problem": error, "remarks": remarks, "rig": rig.name, "columns": columns, "sensors": sensors, "needs_rate": needs_rate,
            });
            return Ok((about, None));
        }
        other => other?,
    };
    remarks.extend(dropped.reading.asked(&imported.repairs));
    let doubts = inspect(&imported.recording).map_or(Vec::new(), |features| doubts(rig, &features));
    let mut about = json!({
        "rig": rig.name, "remarks": remarks, "as_it_is": own.is_some(), "doubts": doubts, "columns": columns, "sensors": sensors, "needs_rate": needs_rate,
        "understood": imported.understood(Path::new(name)), "mended": imported.repairs,
        "warnings": unit_warnings(&imported.recording), "sensor_faults": sensor_faults(&imported.recording),
        "written": null,
    });
    let taken = Path::new(name).file_stem().unwrap_or_default().to_string_lossy();
    let out = free(folder, &taken, "mcap");
    let becomes = out.file_stem().unwrap_or_default().to_string_lossy();
    about["taken"] = json!(
        (becomes != taken)
            .then(|| { format!("The folder has a recording {taken}.mcap already; this one becomes {becomes}.mcap.") })
    );
    if !dropped.accept {
        return Ok((about, None));
    }
    match own {
        Some(_) => keep(&out, &bytes)?,
        None => write(&out, &imported.recording)?,
    }
    about["written"] = json!(format!("{becomes}.mcap"));
    Ok((about, Some(out)))
}

/// A name that a folder lists and a line can show.
fn plain_name(name: &str) -> Option<String> {
    let last = Path::new(name).file_name()?.to_string_lossy();
    let plain = last.chars().filter(|c| !c.is_control()).collect::<String>();
    let plain = plain.trim().trim_start_matches('.');
    (!plain.is_empty()).then(|| plain.to_owned())
}

/// As it stands, or else with guesses.
fn imported(dropped: &Dropped, reading: SourceOptions, rig: &Rig, path: &Path) -> Result<Imported, AnyError> {
    let options = ImportOptions { without: dropped.without.clone(), ..ImportOptions::default() };
    let said = SourceOptions { map: dropped.map.clone(), ignore: dropped.ignore.clone(), guess: false, ..reading };
    import(path, rig, &options, &said, true).or_else(|error| Ok(error.accepted()?))
}
