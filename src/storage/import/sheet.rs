//! Sheets of Excel and LibreOffice: the first one with a table becomes a table in text.

use std::io::{self, Cursor, Read as _};

use calamine::{Data, Reader as _, Sheets, open_workbook_auto_from_rs};
use chrono::{NaiveDate, NaiveTime, TimeDelta};
use zip::ZipArchive;

/// A workbook may unpack to so many times its size, and a small one to at least, and any to at most, so many bytes: what is in it takes as much
/// memory again.
const RATIO: u64 = 100;
const LEAST_UNPACKED: u64 = 64 << 20;
const MOST_UNPACKED: u64 = 1 << 30;
/// Most cells of the rectangle that a sheet's cells span: all of them take memory, however few are filled.
const MOST_CELLS: u64 = 20_000_000;

/// Whether the bytes are those of a workbook: a zip archive, or a compound file of older versions.
pub(crate) fn is_workbook(bytes: &[u8]) -> bool {
    bytes.starts_with(b"PK\x03\x04") || bytes.starts_with(b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1")
}

/// The fullest sheet as text, its columns separated by tabs.
///
/// # Errors
/// A file that is no workbook, or holds no table.
pub(crate) fn text_of_sheet(bytes: &[u8]) -> Result<String, String> {
    check_unpacked(bytes)?;
    let mut book = open_workbook_auto_from_rs(Cursor::new(bytes))
        .map_err(|e| format!("it is no workbook of Excel or LibreOffice that can be read ({e}); save it as CSV"))?;
    check_spans(&mut book)?;
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

/// Refuses an archive that unpacks to far more than it looks like: unpacks it once and keeps nothing.
fn check_unpacked(bytes: &[u8]) -> Result<(), String> {
    let Ok(mut archive) = ZipArchive::new(Cursor::new(bytes)) else { return Ok(()) };
    let most = (bytes.len() as u64 * RATIO).clamp(LEAST_UNPACKED, MOST_UNPACKED);
    let mut left = most;
    for i in 0..archive.len() {
        // the reader reports members that do not unpack
        let Ok(member) = archive.by_index(i) else { continue };
        left = left.saturating_sub(io::copy(&mut member.take(left + 1), &mut io::sink()).unwrap_or_default());
        if left == 0 {
            return Err(format!("it unpacks to more than {} MB: save the table as CSV", most >> 20));
        }
    }
    Ok(())
}

/// Refuses a sheet with cells so far apart that what lies between them would fill the memory.
fn check_spans(book: &mut Sheets<Cursor<&[u8]>>) -> Result<(), String> {
    for name in book.sheet_names() {
        let mut last = (0, 0);
        let mut see = |(row, column): (u32, u32)| last = (row.max(last.0), column.max(last.1));
        // the reader reports sheets that it cannot read
        match book {
            Sheets::Xlsx(book) => {
                let Ok(mut cells) = book.worksheet_cells_reader(&name) else { continue };
                while let Ok(Some(cell)) = cells.next_cell() {
                    see(cell.get_position());
                }
            }
            Sheets::Xlsb(book) => {
                let Ok(mut cells) = book.worksheet_cells_reader(&name) else { continue };
                while let Ok(Some(cell)) = cells.next_cell() {
                    see(cell.get_position());
                }
            }
            _ => {}
        }
        let (rows, columns) = (u64::from(last.0) + 1, u64::from(last.1) + 1);
        if rows * columns > MOST_CELLS {
            return Err(format!(
                "sheet '{name}' reaches to row {rows} and column {columns}, which is more than {MOST_CELLS} cells: save the table as CSV"
            ));
        }
    }
    Ok(())
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

#[cfg(test)]
mod tests {
    use std::io::Write as _;

    use super::*;

    const FIXTURE: &[u8] = include_bytes!("../../../tests/fixtures/openpyxl.xlsx");

    /// The fixture with other content in its sheet of data.
    fn workbook(rows: &[&str]) -> Vec<u8> {
        let mut from = ZipArchive::new(Cursor::new(FIXTURE)).unwrap();
        let mut to = zip::ZipWriter::new(Cursor::new(Vec::new()));
        for i in 0..from.len() {
            let member = from.by_index_raw(i).unwrap();
            let name = member.name().unwrap().into_owned();
            if !name.ends_with("sheet2.xml") {
                to.raw_copy_file(member).unwrap();
                continue;
            }
            to.start_file(name, zip::write::SimpleFileOptions::default()).unwrap();
            to.write_all(b"<worksheet xmlns=\"http://schemas.openxmlformats.org/spreadsheetml/2006/main\"><sheetData>")
                .unwrap();
            rows.iter().for_each(|row| to.write_all(row.as_bytes()).unwrap());
            to.write_all(b"</sheetData></worksheet>").unwrap();
        }
        to.finish().unwrap().into_inner()
    }

    #[test]
    fn a_small_file_does_not_fill_the_memory() {
        let first = "<row r=\"1\"><c r=\"A1\"><v>1</v></c><c r=\"B1\"><v>2.5</v></c></row>";
        assert_eq!(text_of_sheet(&workbook(&[first])).unwrap(), "1\t2.5\n");
        let far = "<row r=\"1048576\"><c r=\"XFD1048576\"><v>1</v></c></row>";
        let why = text_of_sheet(&workbook(&[first, far])).unwrap_err();
        assert!(why.contains("row 1048576 and column 16384"), "{why}");
        let blanks = " ".repeat(1 << 20);
        let bomb = workbook(&vec![&blanks[..]; 80]);
        assert!(bomb.len() < 400_000, "{}", bomb.len());
        let why = text_of_sheet(&bomb).unwrap_err();
        assert!(why.contains("unpacks to more than 64 MB"), "{why}");
    }
}
