//! Sheets of Excel and LibreOffice: the first one with a table becomes a table in text.

use std::io::Cursor;

use calamine::{Data, Reader as _, open_workbook_auto_from_rs};

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
    let mut text = String::new();
    for row in range.rows() {
        let cells: Vec<String> = row.iter().map(cell).collect();
        text += &cells.join("\t");
        text.push('\n');
    }
    Ok(text)
}

/// A cell as text. A date-time is written in days, as the workbook holds it.
fn cell(data: &Data) -> String {
    match data {
        Data::Float(v) => v.to_string(),
        Data::Int(v) => v.to_string(),
        Data::DateTime(v) => v.as_f64().to_string(),
        Data::DateTimeIso(v) | Data::DurationIso(v) => v.clone(),
        Data::String(v) => v.replace(['\t', '\n', '\r', '"'], " ").trim().to_owned(),
        Data::Bool(v) => f64::from(*v).to_string(),
        Data::Error(_) | Data::Empty => String::new(),
    }
}
