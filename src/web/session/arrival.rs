//! What is dropped on the page becomes a recording in the folder, once its columns are agreed upon: one file, or
//! several of one closure.

use std::collections::BTreeSet;
use std::error::Error;
use std::path::{Path, PathBuf};

use base64::Engine as _;
use base64::prelude::BASE64_STANDARD;
use serde::Deserialize;
use serde_json::{Value, json};

use crate::align::{Method, Part};
use crate::draft::reading::Reading;
use crate::draft::remark::Weight;
use crate::recording::Recording;
use crate::rig::Rig;
use crate::shown::Shown as _;
use crate::signal::doubts::doubts;
use crate::signal::faults::examine;
use crate::storage::import::{ImportOptions, Imported, Repair, SourceOptions, read_source, unit_warnings};
use crate::storage::together::{recorded, together};
use crate::storage::{keep, read, write};
use crate::study::import::import;
use crate::watch::evaluate::sentence;
use crate::web::session::new_rig::{free, name_of};

type AnyError = Box<dyn Error + Send + Sync>;

/// A file by its name and its bytes.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Further {
    /// Its name.
    pub name: String,
    /// Its bytes, base64.
    pub content: String,
}

/// A file as a page sends it.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Dropped {
    /// Its name.
    pub name: String,
    /// Its bytes, base64.
    pub content: String,
    /// Further files of the same closure.
    #[serde(default)]
    pub further: Vec<Further>,
    /// How their clocks are aligned; otherwise the most reliable way that all of them allow.
    #[serde(default)]
    pub align: Option<Method>,
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
    /// Columns with what their numbers stand for: of volts or milliamperes such as `1..5 -> 0..10 bar`, of another unit
    /// such as `psi`.
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
    /// The names of the files as a folder lists them, and their bytes.
    ///
    /// # Errors
    /// A file without a name, content that is not base64.
    pub fn unpacked(&self) -> Result<Vec<(String, Vec<u8>)>, AnyError> {
        let further = self.further.iter().map(|file| (&file.name, &file.content));
        let all = std::iter::once((&self.name, &self.content)).chain(further);
        all.map(|(name, content)| unpacked(name, content)).collect()
    }

    /// Writes all files to a folder, each under its name, and returns their paths.
    fn unpack_to(&self, scratch: &Path) -> Result<Vec<PathBuf>, AnyError> {
        let mut paths = Vec::new();
        for (number, (name, bytes)) in self.unpacked()?.into_iter().enumerate() {
            // two files may have one name
            let own = scratch.join(number.to_string());
            std::fs::create_dir(&own)?;
            paths.push(own.join(name));
            std::fs::write(&paths[number], &bytes)?;
        }
        Ok(paths)
    }
}

fn unpacked(name: &str, content: &str) -> Result<(String, Vec<u8>), AnyError> {
    let name = plain_name(name).ok_or("the file has no name")?;
    let bytes = BASE64_STANDARD.decode(content).map_err(|e| format!("the content is not base64: {e}"))?;
    Ok((name, bytes))
}

/// What was understood of the files.
struct Understood {
    recording: Recording,
    /// Each sensor with its column, unit, rate and first values.
    sensors: Value,
    mended: Vec<Repair>,
    /// What else there is to say, in words.
    notes: Vec<String>,
}

/// Reads what was dropped on a rig and, where that is agreed, writes it to a folder. Returns how it was understood, and
/// the recording; of a table without a rig that it `needs_rig`.
///
/// # Errors
/// Files that are no recording of this rig, or not of one closure; a folder that cannot be written to.
pub fn take(dropped: &Dropped, rig: Option<&Rig>, folder: &Path) -> Result<(Value, Option<PathBuf>), AnyError> {
    // readers go by the ending of a name
    let scratch = tempfile::tempdir()?;
    let paths = dropped.unpack_to(scratch.path())?;
    // nobody knows the scratch files by their names
    let by_name = |error: AnyError| {
        paths.iter().fold(sentence(&*error), |said, path| said.replace(&*path.shown(), &name_of(path)))
    };
    let path = &paths[0];
    // A recording knows its rig, and is taken as it is.
    let own = if dropped.rig_of.is_none() { read(path).ok() } else { None };
    if paths.len() > 1
        && let Some(whole) = paths.iter().find(|path| read(path).is_ok())
    {
        return Err(format!(
            "{} is a whole recording, and goes with no other file: drop recordings one after the other",
            name_of(whole)
        )
        .into());
    }
    let Some(rig) = own.as_ref().map(|recording| &recording.rig).or(rig) else {
        let further: Vec<String> = paths[1..].iter().map(|path| name_of(path)).collect();
        return Ok((json!({ "needs_rig": name_of(path), "further": further }), None));
    };
    let sensors: Vec<&str> = rig.sensors.iter().map(|sensor| sensor.name.as_str()).collect();
    let mut remarks = Vec::new();
    let reading = dropped.reading.options(&mut remarks);
    let guessing = SourceOptions { rate_hz: reading.rate_hz.or(dropped.rate_hz), ..reading };
    let mut needs_rate = dropped.rate_hz.is_some();
    let mut columns: Vec<String> = Vec::new();
    for path in &paths {
        match read_source(path, &guessing) {
            Ok(source) => columns.extend(source.tracks.into_iter().map(|track| track.name)),
            Err(error) if own.is_none() => {
                needs_rate |= error.lacks_rate();
                remarks.extend(Reading::unread(&error));
            }
            Err(_) => {}
        }
    }
    let mut seen = BTreeSet::new();
    columns.retain(|column| seen.insert(column.clone()));
    if let (Some(wrong), true) = (remarks.iter().find(|remark| remark.weight == Weight::Wrong), dropped.accept) {
        return Err(format!("{}: {}", wrong.field, wrong.says).into());
    }
    let scales = dropped.scales.iter().map(|(column, line)| Ok((column.clone(), line.parse()?)));
    let scales = scales.collect::<Result<Vec<_>, String>>();
    let read = scales
        .map_err(AnyError::from)
        .and_then(|scales| understood(dropped, &SourceOptions { scales, ..guessing }, rig, &paths));
    let understood = match read.map_err(by_name) {
        // what is only looked at may still be mended: by the rate of its samples, or by saying which column is which
        // sensor
        Err(error) if !dropped.accept && (needs_rate || !remarks.is_empty() || !columns.is_empty()) => {
            let about = json!({
                "problem": error, "remarks": remarks, "rig": rig.name, "columns": columns, "sensors": sensors, "needs_rate": needs_rate,
            });
            return Ok((about, None));
        }
        other => other?,
    };
    let Understood { recording, sensors: seen, mended, notes } = understood;
    remarks.extend(dropped.reading.asked(&mended));
    let (features, faults) = examine(&recording);
    let doubts = features.map_or(Vec::new(), |features| doubts(rig, &features));
    let mut about = json!({
        "rig": rig.name, "remarks": remarks, "as_it_is": own.is_some(), "doubts": doubts, "columns": columns, "sensors": sensors, "needs_rate": needs_rate,
        "understood": { "file": name_of(path), "sensors": seen }, "mended": mended, "joined": notes,
        "warnings": unit_warnings(&recording), "sensor_faults": faults,
        "written": null,
    });
    let taken = path.file_stem().unwrap_or_default().to_string_lossy();
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
        Some(_) => keep(&out, &std::fs::read(path)?)?,
        None => write(&out, &recording)?,
    }
    about["written"] = json!(format!("{becomes}.mcap"));
    Ok((about, Some(out)))
}

/// One recording of all files, as `import` makes it.
fn understood(
    dropped: &Dropped,
    reading: &SourceOptions,
    rig: &Rig,
    paths: &[PathBuf],
) -> Result<Understood, AnyError> {
    let alone = paths.len() == 1;
    let (mut parts, mut mended, mut sensors, mut columns) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for path in paths {
        let source = SourceOptions { elsewhere: recorded(&parts, rig), ..reading.clone() };
        let imported = imported(dropped, source, rig, path, alone)?;
        let about = imported.understood(path);
        let own = about["sensors"].as_array().cloned().unwrap_or_default();
        // of a sensor that several files hold, the first
        let held = |seen: &Value| !alone && seen["samples"] == json!(0);
        sensors.extend(own.into_iter().filter(|seen| !held(seen)));
        let Imported { recording, repairs, start_digit_s, names, .. } = imported;
        columns.extend(names);
        let of = |text: String| if alone { text } else { format!("{}: {text}", name_of(path)) };
        mended.extend(repairs.into_iter().map(|repair| Repair { text: of(repair.text), ..repair }));
        parts.push(Part { file: name_of(path), recording, start_digit_s });
    }
    let mut without = dropped.without.clone();
    if !alone && !dropped.accept {
        let held = recorded(&parts, rig);
        without.extend(rig.sensors.iter().map(|s| s.name.clone()).filter(|name| !held.contains(name)));
    }
    let whole = together(parts, rig, &without, &columns, dropped.align)?;
    let notes = whole.said().into_iter().chain(whole.clocks.iter().flat_map(|clock| clock.warnings.clone())).collect();
    Ok(Understood { recording: whole.recording, sensors: json!(sensors), mended, notes })
}

/// A name that a folder lists and a line can show.
fn plain_name(name: &str) -> Option<String> {
    let last = Path::new(name).file_name()?.to_string_lossy();
    let plain = last.chars().filter(|c| !c.is_control()).collect::<String>();
    let plain = plain.trim().trim_start_matches('.');
    (!plain.is_empty()).then(|| plain.to_owned())
}

/// As it stands, or else with guesses.
fn imported(
    dropped: &Dropped,
    reading: SourceOptions,
    rig: &Rig,
    path: &Path,
    alone: bool,
) -> Result<Imported, AnyError> {
    let options = ImportOptions { without: dropped.without.clone(), ..ImportOptions::default() };
    let said = SourceOptions { map: dropped.map.clone(), ignore: dropped.ignore.clone(), guess: false, ..reading };
    import(path, rig, &options, &said, alone).or_else(|error| Ok(error.accepted()?))
}
