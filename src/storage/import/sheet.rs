//! Workbooks of Excel and LibreOffice: the fullest table becomes one in text, over as many sheets as it takes.

use std::io::{self, Cursor, Read as _};

use calamine::{Data, Range, Reader as _, Sheets, open_workbook_auto_from_rs};
use chrono::{NaiveDate, NaiveDateTime, NaiveTime, TimeDelta};
use zip::ZipArchive;

use crate::storage::import::source::Repair;
use crate::storage::import::tables::Tables;
use crate::storage::nearest::listed;

/// A workbook may unpack to so many times its size, and a small one to at least, and any to at most, so many bytes:
/// what is in it takes as much memory again.
const RATIO: u64 = 100;
const LEAST_UNPACKED: u64 = 64 << 20;
const MOST_UNPACKED: u64 = 1 << 30;
/// Most cells of the rectangle that a sheet's cells span: all of them take memory, however few are filled.
const MOST_CELLS: u64 = 20_000_000;

/// Whether the bytes are those of a workbook: a zip archive, or a compound file of older versions.
pub(crate) fn is_workbook(bytes: &[u8]) -> bool {
    bytes.starts_with(b"PK\x03\x04") || bytes.starts_with(b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1")
}

/// The fullest table of a workbook as text, with the sheets that go on with it; other sheets with a table are left out.
///
/// # Errors
/// A file that is no workbook, or holds no table.
pub(crate) fn tables_of_book(bytes: &[u8]) -> Result<Tables, String> {
    check_unpacked(bytes)?;
    let mut book = open_workbook_auto_from_rs(Cursor::new(bytes))
        .map_err(|e| format!("it is no workbook of Excel or LibreOffice that can be read ({e}); save it as CSV"))?;
    check_spans(&mut book)?;
    let since_1904 = match &book {
        Sheets::Xls(book) => book.has_1904_epoch(),
        Sheets::Xlsx(book) => book.has_1904_epoch(),
        Sheets::Xlsb(book) => book.has_1904_epoch(),
        Sheets::Ods(_) => false,
    };
    let sheets: Vec<Sheet> = book.worksheets().into_iter().map(|(name, range)| Sheet::new(name, range)).collect();
    let mut tables: Vec<Vec<&Sheet>> = Vec::new();
    for sheet in sheets.iter().filter(|sheet| !sheet.range.is_empty()) {
        match tables.iter_mut().find(|table| table.last().is_some_and(|last| last.goes_on_in(sheet))) {
            Some(table) => table.push(sheet),
            None => tables.push(vec![sheet]),
        }
    }
    let cells = |table: &[&Sheet]| table.iter().map(|sheet| sheet.range.used_cells().count()).sum::<usize>();
    // the first of equals
    let fullest =
        (0..tables.len()).rev().max_by_key(|&i| cells(&tables[i])).ok_or("the workbook has no table in it")?;
    let table = tables.swap_remove(fullest);
    let mut repairs = Vec::new();
    if let [first, others @ ..] = &table[..]
        && !others.is_empty()
    {
        let names: Vec<String> = others.iter().map(|sheet| format!("'{}'", sheet.name)).collect();
        let text = format!("the table of sheet '{}' goes on in {}: joined", first.name, listed(&names));
        repairs.push(Repair::new("sheets", table.len(), None, text));
    }
    if since_1904 {
        repairs.push(Repair::new("date-system", 1, None, "the workbook counts its days from 1904"));
    }
    let others = tables.iter().flatten().filter(|sheet| sheet.is_table());
    let left_out = others.map(|sheet| (sheet.name.clone(), "a sheet with another table: save it as CSV".into()));
    let left_out = left_out.collect();
    Ok(Tables { texts: vec![(table[0].name.clone(), text_of(&table, since_1904))], repairs, left_out, paths: false })
}

/// Sheets one below the other as text, the headings once.
fn text_of(table: &[&Sheet], since_1904: bool) -> String {
    let width = table.iter().map(|sheet| sheet.range.width()).max().unwrap_or_default();
    let samples = || table.iter().flat_map(|sheet| sheet.range.rows().skip(sheet.first));
    let clocks: Vec<Clock> = (0..width).map(|column| Clock::of(samples().filter_map(|r| r.get(column)))).collect();
    let mut text = String::new();
    for (i, sheet) in table.iter().enumerate() {
        for row in sheet.range.rows().skip(if i == 0 { 0 } else { sheet.first }) {
            let cells: Vec<String> =
                row.iter().zip(&clocks).map(|(data, clock)| cell(data, *clock, since_1904)).collect();
            text += &cells.join("\t");
            text.push('\n');
        }
    }
    text
}

/// Rows of numbers from which on a sheet is taken for a table: settings have fewer, or one number a row.
const LEAST_ROWS: usize = 10;

struct Sheet {
    name: String,
    range: Range<Data>,
    /// The first row of numbers, from 0.
    first: usize,
}

impl Sheet {
    fn new(name: String, range: Range<Data>) -> Sheet {
        let first = range.rows().position(is_sample).unwrap_or(range.height());
        Sheet { name, range, first }
    }

    /// Whether numbers stand in it side by side, row after row.
    fn is_table(&self) -> bool {
        self.range.rows().filter(|row| is_sample(row)).count() >= LEAST_ROWS
    }

    /// Whether the other one holds the rows that come next: the same columns under the same headings or none, and one
    /// that rises goes on.
    fn goes_on_in(&self, next: &Sheet) -> bool {
        let headed = |sheet: &Sheet, above: usize| {
            let at = sheet.first.checked_sub(above)?;
            // a title fills one cell
            let row = sheet.range.rows().nth(at).filter(|row| 2 * filled(row) > row.len())?;
            Some(row.to_vec())
        };
        let alike = |above: usize| headed(next, above).is_none_or(|own| headed(self, above) == Some(own));
        let rising = |sheet: &Sheet, column: usize| {
            let of = |row: &[Data]| row.get(column).map(|data| rank(data).ok_or(()));
            let ranks: Result<Vec<f64>, ()> = sheet.range.rows().skip(sheet.first).filter_map(of).collect();
            let ranks = ranks.ok().filter(|r| r.len() > 1 && r.windows(2).all(|w| w[1] > w[0]))?;
            Some((ranks[0], ranks[ranks.len() - 1]))
        };
        let goes_on = |column: usize| {
            let ends = rising(self, column).zip(rising(next, column));
            ends.is_some_and(|((_, last), (first, _))| first > last)
        };
        self.range.width() == next.range.width() && alike(1) && alike(2) && (0..self.range.width()).any(goes_on)
    }
}

fn filled(row: &[Data]) -> usize {
    row.iter().filter(|data| **data != Data::Empty).count()
}

/// Whether most of the cells of a row that hold something are numbers or times, two at least.
fn is_sample(row: &[Data]) -> bool {
    let numbers = row.iter().filter(|data| rank(data).is_some()).count();
    numbers > 1 && 2 * numbers > filled(row)
}

/// A number or a time as a number that rises with it.
fn rank(data: &Data) -> Option<f64> {
    match data {
        Data::Float(v) => Some(*v),
        Data::Int(v) => Some(*v as f64),
        Data::DateTime(v) => Some(v.as_f64()),
        Data::DateTimeIso(v) => {
            let at: NaiveDateTime =
                v.parse().ok().or_else(|| Some(v.parse::<NaiveDate>().ok()?.and_time(NaiveTime::MIN)))?;
            Some(at.and_utc().timestamp_micros() as f64 * 1e-6)
        }
        Data::DurationIso(v) => {
            let since = time_of_day(v)?.parse::<NaiveTime>().ok()?.signed_duration_since(NaiveTime::MIN);
            Some(since.num_microseconds()? as f64 * 1e-6)
        }
        Data::String(v) => v.trim().replace(',', ".").parse().ok(),
        Data::Bool(_) | Data::Error(_) | Data::Empty => None,
    }
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

/// What the date-times of a column say: a workbook holds all as days since 1900 or 1904.
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

    /// Days as text; a workbook's times are good to a microsecond.
    fn text(self, days: f64, since_1904: bool) -> Option<String> {
        let since =
            if since_1904 { NaiveDate::from_ymd_opt(1904, 1, 1) } else { NaiveDate::from_ymd_opt(1899, 12, 30) };
        let since = since?.and_time(NaiveTime::MIN);
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
fn cell(data: &Data, clock: Clock, since_1904: bool) -> String {
    match data {
        Data::Float(v) => v.to_string(),
        Data::Int(v) => v.to_string(),
        Data::DateTime(v) => clock.text(v.as_f64(), since_1904).unwrap_or_else(|| v.as_f64().to_string()),
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
        assert_eq!(tables_of_book(&workbook(&[first])).unwrap().texts[0].1, "1\t2.5\n");
        let far = "<row r=\"1048576\"><c r=\"XFD1048576\"><v>1</v></c></row>";
        let why = tables_of_book(&workbook(&[first, far])).unwrap_err();
        assert!(why.contains("row 1048576 and column 16384"), "{why}");
        let blanks = " ".repeat(1 << 20);
        let bomb = workbook(&vec![&blanks[..]; 80]);
        assert!(bomb.len() < 400_000, "{}", bomb.len());
        let why = tables_of_book(&bomb).unwrap_err();
        assert!(why.contains("unpacks to more than 64 MB"), "{why}");
    }
}
