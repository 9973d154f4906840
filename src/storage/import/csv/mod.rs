//! Tables in text.
//!
//! A plain time series (`time_s,P1,…`, decimal points, increasing times) is read as it stands, by `plain`. [`read`]
//! takes tables however they are written: it finds where the table stands and what stands around it (`layout`,
//! `settings`), what each column is (`roles`), and then reads the rows (`reading`). It repairs what can be repaired
//! safely, and reports each repair; what the file does not say is a guess, which somebody must agree to; the rest it
//! refuses with its line.

pub(crate) mod cell;
pub(crate) mod clock;
pub(crate) mod columns;
pub(crate) mod comments;
pub(crate) mod cut;
pub(crate) mod grid;
pub(crate) mod heading;
pub(crate) mod keyed;
mod late;
pub(crate) mod layout;
pub(crate) mod lines;
mod looks;
pub(crate) mod missing;
pub(crate) mod numbers;
pub(crate) mod order;
pub(crate) mod plain;
mod reading;
pub(crate) mod roles;
pub(crate) mod row;
pub(crate) mod rows;
pub(crate) mod scaled;
pub(crate) mod settings;
pub(crate) mod stamp;
pub(crate) mod states;
pub(crate) mod strays;
pub(crate) mod table;
pub(crate) mod text;
pub(crate) mod timeless;

use crate::storage::error::{CsvFault, CsvProblem};
use crate::storage::import::csv::cut::is_cut_off;
use crate::storage::import::csv::keyed::{Channel, Keyed};
use crate::storage::import::csv::layout::Layout;
use crate::storage::import::csv::lines::{Line, lines, without_receipt};
use crate::storage::import::csv::reading::Reading;
use crate::storage::import::csv::row::is_row;
use crate::storage::import::csv::text::{check_kind, check_lines, decode};
use crate::storage::import::source::{Repair, SourceFile, SourceOptions};
use crate::storage::nearest::listed;

/// Reads a table however it is written.
///
/// # Errors
/// The line from 1, where there is one, and what is wrong.
pub(crate) fn read(bytes: &[u8], options: &SourceOptions) -> Result<SourceFile, CsvFault> {
    check_kind(bytes)?;
    check_lines(bytes)?;
    let mut repairs = Vec::new();
    let text = decode(bytes, options, &mut repairs)?;
    let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
    let (all, received) = without_receipt(lines(text));
    repairs.extend(received);
    let layout = Layout::find(&all).ok_or((None, Box::new(CsvProblem::Empty)))?;
    let cut =
        is_cut_off(text, layout.separator).then(|| all.iter().rev().find(|l| is_row(l.text)).map(|l| l.at)).flatten();
    let Some(Keyed { channels }) = Keyed::find(&layout, &all) else {
        let file = Reading::new(&all, layout, cut, options).file(None)?;
        repairs.extend(file.repairs);
        return Ok(SourceFile { repairs, ..file });
    };
    let names: Vec<String> = channels.iter().map(|(channel, _)| channel.name.clone()).collect();
    let heading = channels.first().map_or("", |(channel, _)| &layout.columns[channel.column].heading);
    let text = format!("each row is of one channel, as '{heading}' says: {}", listed(&names));
    repairs.push(Repair::new("long-form", channels.len(), None, text));
    let of_channel = |(channel, lines): &(Channel, Vec<Line<'_>>)| {
        let layout = Layout::find(lines).ok_or((None, Box::new(CsvProblem::Empty)))?;
        Reading::new(lines, layout, cut, options).file(Some(channel))
    };
    let files = channels.iter().map(of_channel).collect::<Result<Vec<SourceFile>, CsvFault>>()?;
    Ok(SourceFile::joined(files, repairs))
}
