//! Tables in text.
//!
//! A plain time series (`time_s,P1,…`, decimal points, increasing times) is read as it stands, by `plain`. [`read`] takes tables however they are
//! written: it finds where the table stands and what stands around it (`layout`, `settings`), what each column is (`roles`), and then reads the
//! rows. It repairs what can be repaired safely, and reports each repair; what the file does not say is a guess, which somebody must agree to; the
//! rest it refuses with its line.

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
use crate::storage::import::csv::clock::Clock;
use crate::storage::import::csv::comments::{among_samples, note};
use crate::storage::import::csv::cut::is_cut_off;
use crate::storage::import::csv::keyed::{Channel, Keyed};
use crate::storage::import::csv::layout::{Column, Layout};
use crate::storage::import::csv::lines::{Line, lines, without_receipt};
use crate::storage::import::csv::looks::extremes;
use crate::storage::import::csv::missing::Spellings;
use crate::storage::import::csv::numbers::{Numbers, thousands};
use crate::storage::import::csv::order::put_in_order;
use crate::storage::import::csv::roles::roles;
use crate::storage::import::csv::row::is_row;
use crate::storage::import::csv::rows::{Rows, Timed};
use crate::storage::import::csv::stamp::order_shown;
use crate::storage::import::csv::states::States;
use crate::storage::import::csv::strays::{take_sentinels, take_signs, take_unread};
use crate::storage::import::csv::table::column_series;
use crate::storage::import::csv::text::{check_kind, check_lines, decode};
use crate::storage::import::source::{Repair, SourceFile, SourceOptions, Start, Track};
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
        let file = table(&all, layout, None, cut, options)?;
        repairs.extend(file.repairs);
        return Ok(SourceFile { repairs, ..file });
    };
    let names: Vec<String> = channels.iter().map(|(channel, _)| channel.name.clone()).collect();
    let heading = channels.first().map_or("", |(channel, _)| &layout.columns[channel.column].heading);
    let text = format!("each row is of one channel, as '{heading}' says: {}", listed(&names));
    repairs.push(Repair::new("long-form", channels.len(), None, text));
    let of_channel = |(channel, lines): &(Channel, Vec<Line<'_>>)| {
        let layout = Layout::find(lines).ok_or((None, Box::new(CsvProblem::Empty)))?;
        table(lines, layout, Some(channel), cut, options)
    };
    let files = channels.iter().map(of_channel).collect::<Result<Vec<SourceFile>, CsvFault>>()?;
    Ok(SourceFile::joined(files, repairs))
}

/// Reads a table, or the rows of one channel of a table in long form. The file ends within the line `cut`.
fn table(
    all: &[Line<'_>],
    mut layout: Layout<'_>,
    channel: Option<&Channel>,
    cut: Option<usize>,
    options: &SourceOptions,
) -> Result<SourceFile, CsvFault> {
    let mut repairs = Vec::new();
    let header_at = layout.names_at.map(|at| all[at].at);
    if all[layout.first..].iter().filter(|l| is_row(l.text) && Some(l.at) != cut).count() == 0
        || layout.rows.is_empty() && layout.names_at == Some(layout.first)
    {
        return Err((header_at.or(Some(all[layout.first].at)), Box::new(CsvProblem::HeaderOnly)));
    }
    // what stands between the headings and the first row is no note: it says something of the columns, or is a row that cannot be read
    let above = all[..layout.first].iter().enumerate().rev().find(|(_, l)| is_row(l.text));
    if let Some((_, line)) = above.filter(|(at, line)| !layout.headings.contains(at) && layout.is_nearly_row(line.text))
        && !layout.is_keyed(line.text)
    {
        return Err((Some(line.at), Box::new(CsvProblem::NotARow)));
    }
    let mut found = roles(&mut layout, options).map_err(|problem| (header_at, Box::new(problem)))?;
    repairs.extend(layout.repairs(all));
    repairs.extend(among_samples(&all[layout.first..]));
    repairs.extend(found.repairs);
    let is_key = |i: usize| channel.is_some_and(|channel| channel.column == i);
    found.clocks.iter_mut().for_each(|clock| clock.values.retain(|i| !is_key(*i)));
    let values: Vec<usize> =
        (0..layout.columns.len()).filter(|i| found.clocks.iter().any(|c| c.values.contains(i))).collect();
    if let Some(channel) = channel {
        layout.take_channel(&values, &channel.name);
    }
    layout.take_settings(&values);
    if let Some((line, [column, first, second])) = layout.contradiction.take()
        && !layout
            .columns
            .iter()
            .enumerate()
            .any(|(i, c)| c.heading == column && options.scales.iter().any(|(name, _)| c.is_called(name, i + 1)))
    {
        return Err((line.or(header_at), Box::new(CsvProblem::TwoUnits { column, first, second })));
    }
    let mut extremes = extremes(&layout.columns, &values);
    extremes.retain(|i| !layout.columns[*i].is_given(i + 1, options));
    let mut codes = States::of_opc(&layout, &values);
    codes.retain(|i| !layout.columns[*i].is_given(i + 1, options));
    let is_value = |i: &usize| !extremes.contains(i) && !codes.contains(i);
    found.clocks.iter_mut().for_each(|clock| clock.values.retain(is_value));
    let values: Vec<usize> = values.into_iter().filter(is_value).collect();
    let names = distinct_names(&layout.columns, &mut repairs);
    if !extremes.is_empty() {
        let listed: Vec<&str> = extremes.iter().map(|&i| names[i].0.as_str()).collect();
        let text = format!("left out, for the mean of the same channel stands beside: {}", listed.join(", "));
        let lost = !extremes.iter().all(|i| layout.columns[*i].is_ignored(i + 1, options));
        repairs.push(Repair { lost, ..Repair::new("extremes", extremes.len(), None, text) });
    }
    let telling: Vec<usize> = found.words.iter().chain(&codes).copied().collect();
    let states = States::find(&names.iter().map(|(_, name)| name.clone()).collect::<Vec<_>>(), &telling, &values);
    let is_left = |i: &&usize| !is_key(**i) && !states.has(**i);
    let worded: Vec<&str> =
        found.words.iter().filter(is_left).map(|&i| names[i].0.as_str()).filter(|n| !n.is_empty()).collect();
    if !worded.is_empty() {
        let text = format!("left out, because they hold words or nothing: {}", worded.join(", "));
        repairs.push(Repair::new("words", worded.len(), None, text));
    }
    let counting: Vec<&str> = found.counters.iter().map(|&i| names[i].0.as_str()).collect();
    if counting.iter().any(|n| !n.is_empty()) {
        let text = format!("no sensors, for they count samples or give the times once more: {}", counting.join(", "));
        repairs.push(Repair::new("counters", counting.len(), None, text));
    }
    let mark = found.clocks.iter().filter_map(|c| c.time).find_map(|i| thousands(layout.column(i)));
    let mut numbers = Numbers::new(layout.separator, mark);
    // what the times show holds for all; of values, columns of one unit are written alike
    let alike = |i: usize, j: usize| {
        i == j || (layout.columns[i].unit.is_some() && layout.columns[i].unit == layout.columns[j].unit)
    };
    let own = |i: usize| {
        values.iter().filter(|j| alike(i, **j)).find_map(|j| thousands(layout.column(*j))).filter(|_| mark.is_none())
    };
    let mut timed = Vec::new();
    for columns in &found.clocks {
        let shown = |i: usize| layout.column(i).filter(|c| !c.is_empty());
        // one date with a number above 12 shows the order of all
        let all_dates = |i: usize| {
            all[layout.first..].iter().find_map(|l| order_shown(layout::cells(l.text, layout.separator).get(i)?))
        };
        let clock = Clock::new(columns.clone(), &layout.columns, shown, all_dates, options)
            .map_err(|p| (header_at, Box::new(p)))?;
        let grouped =
            columns.values.iter().map(|&i| own(i).map(|mark| Numbers::new(layout.separator, Some(mark)))).collect();
        timed.push(Timed::new(clock, columns.values.clone(), grouped, &states));
    }
    let mut spellings = Spellings::default();
    let rows = Rows { layout: &layout, lines: all, cut };
    repairs.extend(rows.read(&mut timed, &mut numbers, &mut spellings)?);
    repairs.extend(numbers.repairs());
    let mut tracks: Vec<(usize, Track)> = Vec::new();
    let mut start: Option<Start> = None;
    let many = timed.len() > 1;
    let stated = if many { layout.settings.own_starts(layout.columns.len(), &values, options) } else { Vec::new() };
    for Timed { mut clock, mut table, timeless, values, grouped, .. } in timed {
        repairs.extend(grouped.iter().flatten().flat_map(Numbers::repairs));
        if table.time_s.is_empty() {
            continue;
        }
        repairs.extend(clock.repairs());
        repairs.extend(timeless.repair(table.time_s.len())?);
        let first_s = table.time_s[0];
        for (column, &i) in table.columns.iter_mut().zip(&values) {
            repairs.extend(take_signs(column, &names[i].0));
            take_sentinels(column, &table.line, &mut spellings);
        }
        let mut holes = put_in_order(&mut table, &mut repairs, clock.is_local())?;
        timeless.add_gaps(&table.time_s, &mut holes);
        let own = clock.start(first_s).or_else(|| {
            let (_, own, said) = stated.iter().find(|(column, ..)| values.contains(column))?;
            if start.is_none() {
                repairs.push(said.clone());
            }
            Some(*own)
        });
        // two clocks of one file whose starts differ stand apart by that
        let late_s = match (own, start) {
            (Some(own), Some(first)) if many => (i128::from(own.unix_ns) - i128::from(first.unix_ns)) as f64 * 1e-9,
            _ => 0.0,
        };
        table.time_s.iter_mut().for_each(|t| *t += late_s);
        holes.iter_mut().for_each(|h| (h.gap.from_s, h.gap.to_s) = (h.gap.from_s + late_s, h.gap.to_s + late_s));
        start = start.or(own);
        for (&i, column) in values.iter().zip(&mut table.columns) {
            let (name, short) = names[i].clone();
            let unread = take_unread(column, &table.line, &name, &mut spellings);
            let series = column_series(&table.time_s, column, &holes);
            let uneven = Repair::uneven(&name, &series);
            tracks.push((
                i,
                Track {
                    name,
                    short,
                    unit: layout.columns[i].unit.clone(),
                    series,
                    repairs: unread.into_iter().chain(uneven).collect(),
                    place: Some(i + 1),
                    shares: Some(&layout.columns[i].name).filter(|n| **n != names[i].1).cloned(),
                },
            ));
        }
    }
    if tracks.is_empty() {
        return Err((header_at, Box::new(CsvProblem::HeaderOnly)));
    }
    tracks.sort_by_key(|(i, _)| *i);
    repairs.extend(spellings.repair());
    let start = start.or_else(|| {
        let (start, remark) = layout.settings.start(options)?;
        repairs.push(remark);
        Some(start)
    });
    let is_track = |i: &usize| tracks.iter().any(|(column, _)| column == i);
    let others =
        (0..names.len()).filter(|i| !is_track(i)).flat_map(|i| [names[i].0.clone(), names[i].1.clone()]).collect();
    let tracks = tracks.into_iter().map(|(_, track)| track).collect();
    Ok(SourceFile {
        tracks,
        start,
        notes: note(&all[..layout.first], &all[layout.first..], &layout.headings),
        repairs,
        spare_tracks: false,
        others,
    })
}

/// Heading and name of each column; what stands twice is numbered.
fn distinct_names(columns: &[Column], repairs: &mut Vec<Repair>) -> Vec<(String, String)> {
    let mut names: Vec<(String, String)> = Vec::new();
    for Column { heading, name, .. } in columns {
        let is_taken =
            |name: &str, names: &[(String, String)]| !name.is_empty() && names.iter().any(|(_, n)| n == name);
        if !is_taken(name, &names) {
            names.push((heading.clone(), name.clone()));
            continue;
        }
        let number = (2..).find(|k| !is_taken(&format!("{name} {k}"), &names)).unwrap_or(2);
        names.push((format!("{heading} {number}"), format!("{name} {number}")));
    }
    let again: Vec<&str> = names
        .iter()
        .zip(columns)
        .filter(|((_, short), c)| *short != c.name)
        .map(|((_, short), _)| short.as_str())
        .collect();
    if !again.is_empty() {
        let text = format!("columns of one name are numbered: {}", again.join(", "));
        repairs.push(Repair::new("names", again.len(), None, text));
    }
    names
}
