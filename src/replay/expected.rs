//! `NAME.expected.toml`: read with every slip named by its line, written from what is found.

use std::fmt::Write as _;
use std::io::Write as _;
use std::ops::Range;
use std::path::{Path, PathBuf};

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::model::effects::{Chosen, parse_list};
use crate::replay::found::Found;
use crate::replay::quantity::{Quantity, Table, key};
use crate::report::text::number::significant;
use crate::shown::Shown as _;
use crate::text_file::read_text;

/// What is expected of one recording.
#[derive(Debug, Clone, Default)]
pub struct Expected {
    /// Effects to calibrate with; none: the recording is only inspected.
    pub effects: Option<Vec<Chosen>>,
    /// The quantities, in the order of the file.
    pub quantities: Vec<Expectation>,
}

/// One quantity with the value that it had and how far it may move.
#[derive(Debug, Clone, PartialEq)]
pub struct Expectation {
    /// Which.
    pub quantity: Quantity,
    /// The value that it had.
    pub value: f64,
    /// How far it may move, in its own unit.
    pub tolerance: f64,
}

/// A file of expected results that cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ExpectedError {
    /// There is none.
    #[error(
        "{recording} has no expected results beside it ({file} does not exist); `surgescope replay --accept {recording}` \
         writes the present results there, with option `effects A,B` also those of a calibration",
        recording = recording.shown(), file = file.shown()
    )]
    Missing {
        /// The recording.
        recording: PathBuf,
        /// The file that should be there.
        file: PathBuf,
    },
    /// It cannot be read.
    #[error("cannot read the expected results {}; they must be a text file in UTF-8 that you may read", .0.shown())]
    Read(PathBuf, #[source] std::io::Error),
    /// It cannot be written.
    #[error("cannot write the expected results {}", .0.shown())]
    Write(PathBuf, #[source] std::io::Error),
    /// It says something that it must not.
    #[error("{}:{line}: {message}\n{line:>5} | {text}", file.shown())]
    Invalid {
        /// The file.
        file: PathBuf,
        /// Line from 1.
        line: usize,
        /// What is wrong and what is allowed.
        message: String,
        /// The text of that line.
        text: String,
    },
}

/// Where the expected results of a recording stand: `NAME.expected.toml` beside `NAME.mcap`.
pub fn path_beside(recording: &Path) -> PathBuf {
    recording.with_extension("expected.toml")
}

impl Expected {
    /// Reads the expected results beside a recording.
    ///
    /// # Errors
    /// [`ExpectedError::Missing`] where there are none, others where they cannot be read or understood.
    pub fn beside(recording: &Path) -> Result<Expected, ExpectedError> {
        let file = path_beside(recording);
        match read_text(&file) {
            Ok(text) => Expected::from_toml(&text, &file),
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => {
                Err(ExpectedError::Missing { recording: recording.to_owned(), file })
            }
            Err(e) => Err(ExpectedError::Read(file, e)),
        }
    }

    /// Reads the text of such a file; `file` is what errors call it.
    ///
    /// # Errors
    /// [`ExpectedError::Invalid`] for the first thing that is wrong.
    pub fn from_toml(text: &str, file: &Path) -> Result<Expected, ExpectedError> {
        read(text).map_err(|Fault(place, message)| {
            let before = text.get(..place.start).unwrap_or(text);
            let line = before.matches('\n').count() + 1;
            let text = text.lines().nth(line - 1).unwrap_or_default().trim_end().to_owned();
            ExpectedError::Invalid { file: file.to_owned(), line, message, text }
        })
    }
}

/// What is wrong, and where.
struct Fault(Range<usize>, String);

/// A quantity and where it stands in the text.
type Placed = (usize, Expectation);

type Key<'a> = Spanned<std::borrow::Cow<'a, str>>;

fn read(text: &str) -> Result<Expected, Fault> {
    let document = DeTable::parse(text)
        .map_err(|e| Fault(e.span().unwrap_or_default(), format!("not valid TOML: {}", e.message().trim_end())))?;
    let mut expected = Expected::default();
    // tables come sorted by their keys; the place of each line brings back the file's order
    let mut placed = Vec::new();
    for (name, value) in document.get_ref() {
        match name.get_ref().as_ref() {
            "effects" => expected.effects = Some(read_effects(value)?),
            "inspect" => read_inspect(table_of(name, value)?, &mut placed)?,
            "calibrate" => read_calibrate(table_of(name, value)?, &mut placed)?,
            _ => return Err(unknown(name, "the file", &["effects", "inspect", "calibrate"])),
        }
    }
    placed.sort_by_key(|(place, _)| *place);
    expected.quantities = placed.into_iter().map(|(_, quantity)| quantity).collect();
    let calibrated = document.get_ref().iter().find(|(name, _)| name.get_ref() == "calibrate");
    match calibrated {
        Some((name, _)) if expected.effects.is_none() => Err(Fault(
            name.span(),
            "[calibrate] needs a line such as effects = \"viscoelastic-wall:2\" at the top of the file; \"none\" is the base \
             model alone"
                .into(),
        )),
        _ => Ok(expected),
    }
}

fn read_effects(value: &Spanned<DeValue>) -> Result<Vec<Chosen>, Fault> {
    let DeValue::String(text) = value.get_ref() else {
        return Err(Fault(value.span(), "'effects' must be a text such as \"viscoelastic-wall:2\" or \"none\"".into()));
    };
    parse_list(text).map_err(|e| Fault(value.span(), e.to_string()))
}

fn read_inspect(table: &DeTable, out: &mut Vec<Placed>) -> Result<(), Fault> {
    for (name, value) in table {
        if name.get_ref() != "sensor" {
            out.push(read_quantity(Table::Inspect, &["sensor"], name, value)?);
            continue;
        }
        for (sensor, value) in table_of(name, value)? {
            for (name, value) in table_of(sensor, value)? {
                out.push(read_quantity(Table::Sensor(sensor.get_ref().to_string()), &[], name, value)?);
            }
        }
    }
    Ok(())
}

fn read_calibrate(table: &DeTable, out: &mut Vec<Placed>) -> Result<(), Fault> {
    for (name, value) in table {
        if name.get_ref() != "parameter" {
            out.push(read_quantity(Table::Calibrate, &["parameter"], name, value)?);
            continue;
        }
        for (name, value) in table_of(name, value)? {
            out.push(read_quantity(Table::Parameter, &[], name, value)?);
        }
    }
    Ok(())
}

/// One line of a table; `tables` are the tables that may stand in it beside its quantities.
fn read_quantity(table: Table, tables: &[&str], name: &Key, value: &Spanned<DeValue>) -> Result<Placed, Fault> {
    if let Some(keys) = table.keys()
        && !keys.contains(&name.get_ref().as_ref())
    {
        return Err(unknown(name, &format!("[{table}]"), &[keys, tables].concat()));
    }
    let (mut expected, mut tolerance) = (None, None);
    let shape = || format!("'{}' must be like {{ value = 342.2, tolerance = 0.5 }}", name.get_ref());
    let DeValue::Table(entries) = value.get_ref() else { return Err(Fault(value.span(), shape())) };
    for (entry, value) in entries {
        let number = number(value.get_ref());
        match entry.get_ref().as_ref() {
            "value" => {
                expected = Some(number.ok_or_else(|| Fault(value.span(), "'value' must be a finite number".into()))?)
            }
            "tolerance" => {
                let number = number.filter(|t| *t >= 0.0);
                let words = "'tolerance' must be a finite number of at least 0, in the unit of the value";
                tolerance = Some(number.ok_or_else(|| Fault(value.span(), words.into()))?);
            }
            _ => return Err(unknown(entry, &format!("'{}'", name.get_ref()), &["value", "tolerance"])),
        }
    }
    let (Some(value), Some(tolerance)) = (expected, tolerance) else { return Err(Fault(name.span(), shape())) };
    Ok((name.span().start, Expectation { quantity: Quantity::new(table, name.get_ref().as_ref()), value, tolerance }))
}

fn table_of<'t, 'a>(name: &Key, value: &'t Spanned<DeValue<'a>>) -> Result<&'t DeTable<'a>, Fault> {
    match value.get_ref() {
        DeValue::Table(table) => Ok(table),
        _ => Err(Fault(value.span(), format!("'{}' must be a table", name.get_ref()))),
    }
}

fn number(value: &DeValue) -> Option<f64> {
    let number: f64 = match value {
        DeValue::Float(number) => number.as_str().parse().ok()?,
        DeValue::Integer(number) => i64::from_str_radix(number.as_str(), number.radix()).ok()? as f64,
        _ => return None,
    };
    number.is_finite().then_some(number)
}

/// Names less alike than this (Jaro-Winkler) are no slips of one another.
const ALIKE: f64 = 0.75;

fn unknown(name: &Key, place: &str, known: &[&str]) -> Fault {
    let likeness = |k: &str| strsim::jaro_winkler(name.get_ref(), k);
    let nearest = known.iter().max_by(|a, b| likeness(a).total_cmp(&likeness(b)));
    let hint = match nearest.filter(|k| likeness(k) >= ALIKE) {
        Some(nearest) => format!("did you mean '{nearest}'?"),
        None => format!("known are {}", known.join(", ")),
    };
    Fault(name.span(), format!("unknown key '{}' in {place}; {hint}", name.get_ref()))
}

/// The text of the file for what is found now; what is no use to compare stands there as a comment.
pub fn to_toml(recording: &str, effects: Option<&[Chosen]>, found: &[Found]) -> String {
    let mut out = format!(
        "# What surgescope {} finds in {recording}. `surgescope replay` fails where a value moves by more than its tolerance.\n\
         # Values and tolerances may be edited, lines removed; `surgescope replay --accept` writes the file anew.\n",
        env!("CARGO_PKG_VERSION")
    );
    if let Some(effects) = effects {
        let labels: Vec<String> = effects.iter().map(Chosen::label).collect();
        let list = if labels.is_empty() { "none".into() } else { labels.join(",") };
        let _ = writeln!(out, "\neffects = \"{list}\"");
    }
    let mut table = None;
    for found in found {
        let Quantity { table: own, name } = &found.quantity;
        if table != Some(own) {
            let _ = writeln!(out, "\n[{own}]");
            table = Some(own);
        }
        let _ = match found.tolerance {
            Ok(tolerance) if found.value.is_finite() => {
                let (value, tolerance) = (rounded(found.value, tolerance), significant(tolerance, 2));
                writeln!(out, "{} = {{ value = {value}, tolerance = {tolerance} }}", key(name))
            }
            Ok(_) => writeln!(out, "# {name} is left out: it is not a number"),
            Err(why) => writeln!(out, "# {name} is left out: {why}"),
        };
    }
    out
}

/// A value to a hundredth of its tolerance.
pub(crate) fn rounded(value: f64, tolerance: f64) -> String {
    let decimals = (2.0 - tolerance.log10().floor()).max(0.0);
    if tolerance > 0.0 && decimals <= 17.0 { format!("{value:.*}", decimals as usize) } else { format!("{value:?}") }
}

/// Writes the expected results beside a recording, whole or not at all.
///
/// # Errors
/// [`ExpectedError::Write`].
pub fn write_beside(recording: &Path, text: &str) -> Result<PathBuf, ExpectedError> {
    let file = path_beside(recording);
    let folder = file.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let write = || {
        let mut new = tempfile::Builder::new().prefix(".expected").tempfile_in(folder)?;
        new.write_all(text.as_bytes())?;
        readable_by_all(new.as_file())?;
        new.persist(&file).map_err(|e| e.error).map(drop)
    };
    write().map_err(|e| ExpectedError::Write(file.clone(), e))?;
    Ok(file)
}

/// A temporary file is its owner's alone; this one goes into a repository.
#[cfg(unix)]
fn readable_by_all(file: &std::fs::File) -> std::io::Result<()> {
    use std::os::unix::fs::PermissionsExt;
    file.set_permissions(std::fs::Permissions::from_mode(0o644))
}

#[cfg(not(unix))]
fn readable_by_all(_: &std::fs::File) -> std::io::Result<()> {
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn slip(text: &str) -> String {
        Expected::from_toml(text, Path::new("a.expected.toml")).unwrap_err().to_string()
    }

    #[test]
    fn what_is_written_reads_back() {
        let found = [
            (Table::Inspect, "period_s", 1.755_712_3, Ok(0.0066)),
            (Table::Inspect, "wave_speed_crossings_m_s", 338.5, Err("the recording hardly determines it")),
            (Table::Sensor("P 1".into()), "noise_m", 3.2e-9, Ok(1.5e-10)),
            (Table::Calibrate, "rmse_m", 0.0, Ok(0.0)),
            (Table::Parameter, "offset_m[P 1]", -12_345.6, Ok(678.0)),
        ]
        .map(|(table, name, value, tolerance)| Found {
            quantity: Quantity::new(table, name),
            value,
            tolerance,
        });
        let effects = parse_list("viscoelastic-wall:2").unwrap();
        let text = to_toml("a.mcap", Some(&effects), &found);
        let read = Expected::from_toml(&text, Path::new("a.expected.toml")).unwrap();
        assert_eq!(read.effects.unwrap()[0].label(), "viscoelastic-wall:2");
        assert_eq!(read.quantities.len(), 4, "{text}");
        assert!(text.contains("# wave_speed_crossings_m_s is left out: the recording hardly determines it"));
        for found in found.iter().filter(|f| f.tolerance.is_ok()) {
            let back = read.quantities.iter().find(|e| e.quantity == found.quantity).expect("written and read");
            let tolerance = found.tolerance.unwrap();
            assert!((back.value - found.value).abs() <= 0.01 * tolerance, "{text}");
            assert!((back.tolerance - tolerance).abs() <= 0.05 * tolerance, "{text}");
        }
    }

    #[test]
    fn slips_are_named_with_their_lines() {
        let cases = [
            (
                "[inspect]\nperiod = { value = 1, tolerance = 1 }",
                ":2: unknown key 'period' in [inspect]; did you mean 'period_s'?",
            ),
            ("\n[inspects]\n", ":2: unknown key 'inspects' in the file; did you mean 'inspect'?"),
            (
                "[inspect.sensor.P1]\n\nnoise = 1",
                ":3: unknown key 'noise' in [inspect.sensor.P1]; did you mean 'noise_m'?",
            ),
            ("[inspect]\nperiod_s = { value = 1, tol = 1 }", ":2: unknown key 'tol' in 'period_s'"),
            ("[inspect]\nperiod_s = { value = 1 }", ":2: 'period_s' must be like { value"),
            ("[inspect]\nperiod_s = 3", ":2: 'period_s' must be like { value"),
            (
                "[inspect]\nperiod_s = { value = 1, tolerance = -1 }",
                ":2: 'tolerance' must be a finite number of at least 0",
            ),
            ("[inspect]\nperiod_s = { value = nan, tolerance = 1 }", ":2: 'value' must be a finite number"),
            ("effects = \"creep\"\n", ":1: "),
            ("effects = 3\n", ":1: 'effects' must be a text"),
            ("[calibrate]\nrmse_m = { value = 1, tolerance = 1 }", ":1: [calibrate] needs a line such as effects"),
            ("inspect = 3", ":1: 'inspect' must be a table"),
            ("[inspect]\nperiod_s = {", ":2: not valid TOML"),
        ];
        for (text, message) in cases {
            assert!(slip(text).starts_with(&format!("a.expected.toml{message}")), "{text}\n{}", slip(text));
        }
    }
}
