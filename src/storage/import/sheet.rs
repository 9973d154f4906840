//! Sheets of Excel and LibreOffice: the first one with a table becomes a table in text.

use std::io::Cursor;

use calamine::{Data, Reader as _, open_workbook_auto_from_rs};
use chrono::{NaiveDate, NaiveTime, TimeDelta};

/// Whether the bytes are those of a workbook: a zip archive, or a compound file of older versions.
pub(crate) fn is_workbook(bytes: &[u8]) -> bool {
    bytes.starts_with(b"PK\x03\x04") || bytes.starts_with(b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1")
}

/// The fullest sheet as text, its columns separated by tabs.
///
/// # Errors
/// A file that is no workbook, or holds no table.
pub(crate) fn text_of_sheet(bytes: &[u8]) -> Result<String, String> {
    let mut book = open_workbook_auto_from_rs(Cursor::new(bytes))
        .map_err(|e| format!("it is no workbook of Excel or LibreOffice that can be read ({e}); save it as CSV"))?;
    let sheets = book.worksheets();
    let fullest = sheets.iter().max_by_key(|(_, range)| range.used_cells().count()).filter(|(_, r)| !r.is_empty());
    let (_, range) = fullest.ok_or("the workbook has no table in it")?;
    let all = || range.rows().skip(1);
    let clocks: Vec<Clock> = (0..range.width()).map(|column| Clock::of(all().filter_map(|r| r.get(column)))).collect();
    let mut text = String::new();
    for row in range.rows() {
        let cells: Vec<String> = row.iter().zip(&clocks).map(|(data, clock)| cell(data, *clock)).collect();
        text += &cells.join("\t");
        text.push('\n');
    }
    Ok(text)
}

/// What the date-times of a column say: a workbook holds all as days since 1900.
#[derive(Clone, Copy, PartialEq)]
enum Clock {
    Dates,
    TimesOfDay,
    Both,
}

impl Clock {
    fn of<'d>(cells: impl Iterator<Item = &'d Data>) -> Clock {
        let days: Vec<f64> =
            cells.filter_map(|c| if let Data::DateTime(v) = c { Some(v.as_f64()) } else { None }).collect();
        match () {
            _ if days.iter().all(|d| d.fract() == 0.0) => Clock::Dates,
            _ if days.iter().all(|d| (0.0..1.0).contains(d)) => Clock::TimesOfDay,
            _ => Clock::Both,
        }
    }

    /// Days since 1900 as text; a workbook's times are good to a microsecond.
    fn text(self, days: f64) -> Option<String> {
        let since = NaiveDate::from_ymd_opt(1899, 12, 30)?.and_time(NaiveTime::MIN);
        let at = since.checked_add_signed(TimeDelta::microseconds((days * 86_400e6).round() as i64))?;
        let form = match self {
            Clock::Dates => "%Y-%m-%d",
            Clock::TimesOfDay => "%H:%M:%S%.6f",
            Clock::Both => "%Y-%m-%dT%H:%M:%S%.6f",
        };
        Some(at.format(form).to_string())
    }
}

/// A cell as text.
fn cell(data: &Data, clock: Clock) -> String {
    match data {
        Data::Float(v) => v.to_string(),
        Data::Int(v) => v.to_string(),
        Data::DateTime(v) => clock.text(v.as_f64()).unwrap_or_else(|| v.as_f64().to_string()),
        Data::DateTimeIso(v) => v.clone(),
        Data::DurationIso(v) => time_of_day(v).unwrap_or_else(|| v.clone()),
        Data::String(v) => v.replace(['\t', '\n', '\r', '"'], " ").trim().to_owned(),
        Data::Bool(v) => f64::from(*v).to_string(),
        Data::Error(_) | Data::Empty => String::new(),
    }
}

/// `PT09H26M53.25S` of LibreOffice is 09:26:53.25.
fn time_of_day(text: &str) -> Option<String> {
    let (hours, rest) = text.strip_prefix("PT")?.strip_suffix('S')?.split_once('H')?;
    let (minutes, seconds) = rest.split_once('M')?;
    Some(format!("{hours}:{minutes}:{seconds}"))
}
