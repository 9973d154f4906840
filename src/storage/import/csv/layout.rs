//! Where a table stands among the lines of a file: its separator, its headings with the units that stand anywhere, its
//! first row.

use std::borrow::Cow;

use crate::rig::quantity_of;
use crate::storage::import::csv::cell::{Cell, with_unit};
use crate::storage::import::csv::heading::{
    header_unit, is_date_name, is_factor, is_factored, is_known_unit, is_time_name, key_of, time_unit,
};
use crate::storage::import::csv::late::{Late, is_numbers, without_brackets};
use crate::storage::import::csv::lines::Line;
use crate::storage::import::csv::row::{Row, is_row};
use crate::storage::import::csv::settings::{Settings, is_key};
use crate::storage::import::kinds::{
    is_above_level, is_electric, is_nameless, kind_of_name, pressure_unit, quantity_of_unit, same_unit,
};
use crate::storage::import::source::{NAMELESS, Repair, SourceOptions, is_place};

/// Rows at the beginning and at the end of a table by which it is judged.
const JUDGED: usize = 1500;
/// Lines of headings: names, units, how each value was taken.
const MOST_HEADINGS: usize = 4;
/// So many rows show how wide a row is.
const ENOUGH: usize = 3;
/// How each value was taken, in lower case, as Campbell's loggers write it under the units.
const PROCESSES: [&str; 10] = ["smp", "avg", "min", "max", "std", "tot", "med", "mean", "raw", "ave"];

/// A column of a table.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Column {
    /// Its heading as it stands in the file, on one line.
    pub(crate) heading: String,
    /// Its name without the unit.
    pub(crate) name: String,
    /// Its unit, from wherever it is written.
    pub(crate) unit: Option<String>,
    /// The unit that stands behind each of its numbers.
    pub(crate) suffix: Option<String>,
}

/// What a table says twice, and not the same: the line of the second, from 1, where it has one, heading and both units.
pub(crate) type Contradiction = (Option<usize>, [String; 3]);

impl Column {
    /// Takes a unit that stands somewhere, for a column that has none yet; one that differs from what stands elsewhere
    /// is a contradiction.
    pub(crate) fn state(&mut self, unit: &str, line: Option<usize>, found: &mut Option<Contradiction>) {
        match &self.unit {
            None => self.unit = Some(unit.to_owned()),
            Some(own) if is_known_unit(own) && is_known_unit(unit) && differ(own, unit) => {
                found.get_or_insert((line, [self.heading.clone(), own.clone(), unit.to_owned()]));
            }
            // `P(valve)` over `bar`: what stands in brackets is a name
            Some(own) if !is_known_unit(own) && !is_factored(own) && is_known_unit(unit) => {
                self.name = self.heading.clone();
                self.unit = Some(unit.to_owned());
            }
            Some(_) => {}
        }
    }

    /// Takes a factor that stands elsewhere into its unit, which is none that is known then, as with a factor in the
    /// heading. What is in volts awaits a line anyway.
    fn take_factor(&mut self, factor: &str) {
        if !self.unit.as_deref().is_some_and(is_electric) {
            let unit = self.unit.take().unwrap_or_default();
            self.unit = Some(format!("{factor} {unit}").trim_end().to_owned());
        }
    }

    /// Whether a user who writes `name` means it, the column at a place from 1.
    pub(crate) fn is_called(&self, name: &str, place: usize) -> bool {
        self.heading == name || self.name == name || is_place(name, place)
    }

    /// Whether an option says that the column at a place from 1 is a value.
    pub(crate) fn is_given(&self, place: usize, options: &SourceOptions) -> bool {
        let mut given = options.map.iter().map(|(name, _)| name).chain(options.scales.iter().map(|(name, _)| name));
        given.any(|name| self.is_called(name, place))
    }

    /// Whether an option leaves it out.
    pub(crate) fn is_ignored(&self, place: usize, options: &SourceOptions) -> bool {
        options.ignore.iter().any(|name| self.is_called(name, place))
    }

    fn of(heading: &str) -> Column {
        let heading = heading.split_whitespace().collect::<Vec<_>>().join(" ").replace('"', " ");
        match header_unit(&heading) {
            Some((name, unit)) => Column { heading, name, unit: Some(unit), suffix: None },
            None => Column { name: heading.clone(), heading, unit: None, suffix: None },
        }
    }
}

/// Whether a unit is a length, in which heads are given; a water column is a pressure.
fn is_head(unit: &str) -> bool {
    ["m", "cm", "mm", "ft", "in"].contains(&unit.to_lowercase().as_str())
}

/// Whether two known units, of times or of other quantities, are not the same.
fn differ(one: &str, other: &str) -> bool {
    match (time_unit(one), time_unit(other)) {
        (None, None) => !same_unit(one, other),
        (one, other) => one != other,
    }
}

/// A table among the lines of a file.
pub(crate) struct Layout<'t> {
    /// A blank stands for any number of them.
    pub(crate) separator: char,
    /// The line of the names, as an index into the lines; none where the columns are numbered.
    pub(crate) names_at: Option<usize>,
    /// Lines of headings.
    pub(crate) headings: Vec<usize>,
    /// The first row, as an index into the lines.
    pub(crate) first: usize,
    pub(crate) columns: Vec<Column>,
    /// Least cells of a row.
    pub(crate) expected: usize,
    /// Cells of a line with all separators.
    pub(crate) widest: usize,
    /// Rows from the beginning and from the end.
    pub(crate) rows: Vec<Vec<Cow<'t, str>>>,
    /// What stands around it.
    pub(crate) settings: Settings,
    /// A column of two units.
    pub(crate) contradiction: Option<Contradiction>,
    late: Late,
}

/// The cells of a line.
pub(crate) fn cells(line: &str, separator: char) -> Vec<Cow<'_, str>> {
    let mut row = Row::default();
    row.read(line, separator);
    row.into_cells()
}

impl<'t> Layout<'t> {
    /// Finds the table; none in a file without a row.
    pub(crate) fn find(lines: &[Line<'t>]) -> Option<Layout<'t>> {
        let rows: Vec<usize> = (0..lines.len()).filter(|&i| is_row(lines[i].text)).collect();
        let separator = separator_of(lines, &rows)?;
        let of = |at: usize| cells(lines[at].text, separator);
        let late = Late::of(rows[rows.len() / 2..].iter().rev().take(JUDGED).map(|&at| of(at)));
        let is_data = |at: usize| late.is_data(&of(at));
        let mut first = first_row(&rows, is_data).or_else(|| rows.get(1).copied()).or(rows.first().copied())?;
        // pandas numbers the columns that have no names
        let place = rows.iter().position(|&at| at == first)?;
        let is_named = place.checked_sub(1).is_some_and(|above| late.is_heading(&of(rows[above]), of(first).len()));
        let below = rows.get(place + 1).filter(|_| !is_named);
        let is_numbered = below.is_some_and(|&below| numbers_columns(&of(first), &of(below)));
        let mut judged: Vec<Vec<Cow<'t, str>>> = Vec::new();
        let data: Vec<usize> = rows.iter().copied().filter(|&at| at >= first + usize::from(is_numbered)).collect();
        let late_rows = data.len().saturating_sub(JUDGED).max(JUDGED.min(data.len()));
        judged.extend(
            data[..JUDGED.min(data.len())]
                .iter()
                .chain(&data[late_rows..])
                .map(|&at| of(at))
                .filter(|row| late.is_data(row)),
        );
        let width = width_of(&judged).unwrap_or_else(|| of(first).len());
        let mut above: Vec<usize> =
            (0..first).filter(|&at| is_row(lines[at].text) || lines[at].text.starts_with('#')).collect();
        let is_other = |at: usize| titled(&rows, at, of).is_some_and(|title| title != "names");
        let named: Vec<usize> = above.iter().copied().filter(|at| !is_other(*at)).collect();
        let mut headings = Vec::new();
        if is_numbered {
            headings.push(first);
            above.push(first);
            first = data[0];
        } else {
            for &at in named.iter().rev().take(MOST_HEADINGS) {
                let cells = heading_cells(lines[at].text, separator);
                match late.is_heading(&cells, width) {
                    // it says what it is: a setting
                    _ if cells.first().is_some_and(|key| is_key(key)) => {}
                    true => headings.insert(0, at),
                    false => break,
                }
            }
        }
        if let Some(names) = names_above(&headings, &named, lines, separator, &late, width) {
            headings = names;
        }
        let least = if late.is_numbering(&judged) { late.least(width) } else { usize::MAX };
        let cells_at = |at: usize| aligned(heading_cells(lines[at].text, separator), least);
        let names_at = names_line(&mut headings, cells_at, &late);
        let named =
            names_at.map_or(0, |at| cells_at(at).iter().rposition(|c| !c.is_empty()).map_or(0, |last| last + 1));
        let mut columns: Vec<Column> = match names_at {
            Some(at) => cells_at(at).iter().map(|cell| Column::of(cell)).collect(),
            None => (1..=width).map(|i| Column::of(&format!("{NAMELESS}{i}"))).collect(),
        };
        columns.resize_with(width.max(named), || Column::of(""));
        let mut settled = Vec::new();
        let widest = names_at.map_or(width, |at| of(at).len()).max(width);
        let mut settings = Settings::default();
        for &at in above.iter().filter(|at| !headings.contains(at)) {
            settings.take(&match lines[at].text.strip_prefix('#') {
                Some(comment) => vec![Cow::Borrowed(comment.trim())],
                None => of(at),
            });
        }
        // remarks at the end may say when it began
        for line in lines[first..].iter().filter_map(|line| line.text.strip_prefix('#')) {
            settings.take(&[Cow::Borrowed(line.trim())]);
        }
        let mut contradiction = None;
        for &at in headings.iter().filter(|at| Some(**at) != names_at) {
            for ((column, cell), i) in columns.iter_mut().zip(cells_at(at)).zip(0..) {
                match Cell::of(&cell) {
                    // a column without values holds a setting, once
                    Cell::Number(_) if late.is_empty(i) => {
                        settings.take_under(&column.heading, &cell);
                        settled.push(i);
                    }
                    // under a unit it says that the pressure counts from the vacuum
                    Cell::Word if ["abs", "absolute", "absolut"].contains(&cell.to_lowercase().as_str()) => {
                        column.unit.iter_mut().for_each(|unit| unit.push_str(" abs"));
                    }
                    Cell::Word if at != headings[1] && is_factor(&cell) => column.take_factor(&cell),
                    Cell::Word if column.heading.is_empty() && !is_known_unit(without_brackets(&cell)) => {
                        *column = Column::of(&cell)
                    }
                    Cell::Word if is_known_unit(without_brackets(&cell)) || at == headings[1] => {
                        let said = without_brackets(&cell);
                        if !PROCESSES.contains(&said.to_lowercase().as_str()) {
                            column.state(said, Some(lines[at].at), &mut contradiction);
                        }
                    }
                    _ => {}
                }
            }
        }
        let expected = match names_at {
            // headings to the right of all rows head nothing
            Some(_) if named > width && judged.len() >= ENOUGH && judged.iter().all(|row| row.len() == width) => width,
            Some(_) => {
                (0..named.max(late.least(width))).rev().find(|i| !settled.contains(i)).map_or(width, |last| last + 1)
            }
            None => width,
        };
        for (i, column) in columns.iter_mut().enumerate() {
            let shown = judged.iter().filter_map(|row| row.get(i)).find(|c| !c.is_empty());
            if let Some((_, suffix)) = shown.and_then(|cell| with_unit(cell)) {
                column.suffix = Some(suffix.to_owned());
                column.state(suffix, None, &mut contradiction);
            }
        }
        for row in &mut judged {
            let beside = late.take_beside(row);
            if beside.iter().any(|c| !c.is_empty()) {
                settings.take(&beside);
            }
        }
        Some(Layout {
            separator,
            names_at,
            headings,
            first,
            columns,
            expected,
            widest,
            rows: judged,
            settings,
            contradiction,
            late,
        })
    }

    /// Gives `values` the name of a channel, which may state their unit as well.
    pub(crate) fn take_channel(&mut self, values: &[usize], name: &str) {
        for &i in values {
            let old = self.columns[i].clone();
            let heading = if values.len() == 1 { name.to_owned() } else { format!("{} {name}", old.name) };
            let mut column = Column { suffix: old.suffix, ..Column::of(&heading) };
            if let Some(unit) = &old.unit {
                column.state(unit, None, &mut self.contradiction);
            }
            self.columns[i] = column;
        }
    }

    /// Takes the units of `values`, and names of channels, from what stands around the table, for those that their
    /// headings leave without.
    pub(crate) fn take_settings(&mut self, values: &[usize]) {
        let width = self.columns.len();
        let (units, names) = (self.settings.units(width, values), self.settings.names(width, values));
        let factors = self.settings.factors(width, values);
        let is_absolute = self.settings.is_absolute();
        let level = self.settings.level().map(str::to_owned);
        for &i in values {
            let column = &mut self.columns[i];
            if let Some((name, unit)) = self.settings.channel(&column.name) {
                if column.unit.is_none() {
                    column.name = name.unwrap_or_else(|| column.name.clone());
                }
                column.state(&unit, None, &mut self.contradiction);
            }
            // one unit for all is that of those whose names say no other quantity
            let is_other = |unit: &str| {
                kind_of_name(&column.name)
                    .is_some_and(|kind| quantity_of_unit(unit).is_some_and(|q| q != quantity_of(kind)))
            };
            let stated: Vec<&String> =
                units.iter().filter(|(at, unit)| *at == i && !is_other(unit)).map(|(_, unit)| unit).collect();
            stated.iter().for_each(|unit| column.state(unit, None, &mut self.contradiction));
            if is_absolute
                && let Some(unit) =
                    column.unit.as_mut().filter(|unit| pressure_unit("", unit).is_some_and(|(_, absolute)| !absolute))
            {
                unit.push_str(" abs");
            }
            // a head counts from the level that is named, a pressure does not
            if let Some(level) = level.as_ref().or(Some(&column.heading).filter(|name| is_above_level(name)))
                && column.unit.as_deref().is_some_and(is_head)
            {
                column.unit = Some(format!("m, {level}"));
            }
            factors.iter().filter(|(at, _)| *at == i).for_each(|(_, factor)| column.take_factor(factor));
            if let Some((_, name)) =
                names.iter().find(|(at, _)| *at == i).filter(|_| column.name.is_empty() || is_nameless(&column.name))
            {
                let named = Column::of(name);
                *column = Column { unit: column.unit.take().or(named.unit.clone()), ..named };
            }
        }
    }

    /// What there is to say of where it stands.
    pub(crate) fn repairs(&self, lines: &[Line<'_>]) -> Vec<Repair> {
        let mut repairs = Vec::new();
        let named = [(' ', "blanks"), (';', "semicolons"), ('\t', "tabs"), ('|', "bars")];
        if let Some((_, name)) = named.iter().find(|(separator, _)| *separator == self.separator) {
            repairs.push(Repair::new("separator", 1, None, format!("columns are separated by {name}")));
        }
        let Some(at) = self.names_at else {
            let text = "no line names the columns: they are numbered (name them with option `map`)";
            repairs.push(Repair::guess("headings", text.into()));
            return repairs;
        };
        if lines[..at].iter().any(|line| is_row(line.text)) {
            let line = lines[at].at;
            let text = format!("the headings stand in line {line}; the lines above are kept as a note");
            repairs.push(Repair::new("preamble", line - 1, Some(line), text));
        }
        if let [_, units, ..] = self.headings[..] {
            repairs.push(Repair::new("units", 1, Some(lines[units].at), "the line under the header holds units"));
        }
        repairs
    }

    /// Whether a line could head the columns of such a table.
    pub(crate) fn is_heading(&self, line: &str) -> bool {
        let cells = heading_cells(line, self.separator);
        let words = cells.iter().filter(|c| Cell::of(c).is_word()).count();
        words > 1 && 2 * words > cells.len() && self.late.is_heading(&cells, self.late.counts.len())
    }

    /// Whether a line has numbers where the rows have them, in half of its columns or more.
    pub(crate) fn is_nearly_row(&self, line: &str) -> bool {
        let row = cells(line, self.separator);
        let numeric = |i: &usize| self.late.is_numeric(*i);
        let columns = (0..self.late.counts.len()).filter(numeric).count();
        let numbers = row.iter().enumerate().filter(|(i, c)| numeric(i) && Cell::of(c).is_number()).count();
        row.len() >= self.expected && 2 * numbers >= columns && numbers > 0
    }

    /// Whether a line of numbers says in its first cell, in letters alone, what they are.
    pub(crate) fn is_keyed(&self, line: &str) -> bool {
        let row = cells(line, self.separator);
        row.first().is_some_and(|key| key.contains(char::is_alphabetic) && !key.contains(|c: char| c.is_ascii_digit()))
    }

    /// Whether a line looks like the rows.
    pub(crate) fn is_row(&self, line: &str) -> bool {
        self.late.is_data(&cells(line, self.separator))
    }

    /// The cells of a column in the judged rows.
    pub(crate) fn column(&self, column: usize) -> impl Iterator<Item = &str> {
        self.rows.iter().filter_map(move |row| row.get(column)).map(|cell| &**cell)
    }
}

/// The first row of a run of rows: numbers may stand in a preamble, too, but not so many lines of them.
fn first_row(rows: &[usize], is_data: impl Fn(usize) -> bool) -> Option<usize> {
    let mut run = 0;
    for (place, &at) in rows.iter().enumerate() {
        run = if is_data(at) { run + 1 } else { 0 };
        let from = place + 1 - run;
        let enough = RUN.min((rows.len() - from).div_ceil(2)).max(2);
        if run >= enough {
            return Some(rows[from]);
        }
    }
    None
}

/// What a line holds where the file says so, in lower case: by a word of its own behind a `#` in quotes, or by one that
/// stands alone above it, as `"#NAMES"` and `"#TYPES"`.
fn titled<'t>(rows: &[usize], at: usize, of: impl Fn(usize) -> Vec<Cow<'t, str>>) -> Option<String> {
    let is_row = |at: usize| rows.binary_search(&at).is_ok();
    let title = |at: usize| {
        let cell = of(at).first().filter(|cell| is_row(at) && cell.starts_with('#')).map(|cell| key_of(cell));
        cell.filter(|title| !title.is_empty())
    };
    let above = rows[..rows.partition_point(|row| *row < at)].last();
    let is_alone = |at: &&usize| of(**at)[1..].iter().all(|cell| cell.is_empty());
    title(at).or_else(|| above.filter(is_alone).and_then(|&above| title(above)))
}

/// So many lines of numbers on end are rows; half of a shorter table is enough.
const RUN: usize = 20;

/// The separator that leaves numbers alone, otherwise one that leaves few words beside them. A comma may be a decimal
/// one, and is tried late.
fn separator_of(lines: &[Line<'_>], rows: &[usize]) -> Option<char> {
    let from = rows.len().saturating_sub(JUDGED + 1);
    let judged = |separator: char, words: bool| {
        let fits = |at: &&usize| {
            let cells: Vec<Cell> = cells(lines[**at].text, separator).iter().map(|c| Cell::of(c)).collect();
            cells.len() > 1 && is_numbers(&cells) && (words || !cells.iter().any(|c| c.is_word()))
        };
        let good = rows[from..].iter().filter(fits).count();
        good > 1 && 10 * good > 9 * rows[from..].len().saturating_sub(2)
    };
    let found = |words| [';', '\t', ',', ' ', '|'].into_iter().find(|&s| judged(s, words));
    let by_header = || {
        let header = lines[*rows.first()?].text;
        Some([';', '\t', ','].into_iter().find(|s| header.contains(*s)).unwrap_or(','))
    };
    found(false).or_else(|| found(true)).or_else(by_header)
}

/// Most cells of most rows.
fn width_of(rows: &[Vec<Cow<'_, str>>]) -> Option<usize> {
    let mut widths: Vec<usize> = rows.iter().map(Vec::len).collect();
    widths.sort_unstable();
    widths.chunk_by(|a, b| a == b).max_by_key(|same| same.len()).map(|same| same[0])
}

/// `0,1,2` over `0.000,2.80,2.85`: names that count the columns.
fn numbers_columns(names: &[Cow<'_, str>], below: &[Cow<'_, str>]) -> bool {
    let skipped = usize::from(names.first().is_some_and(|c| c.is_empty()));
    let counted = names.iter().skip(skipped).enumerate();
    let from = |first: usize| counted.clone().all(|(i, cell)| **cell == (i + first).to_string());
    let marked = |row: &[Cow<'_, str>]| row.iter().any(|c| c.contains(['.', ',']));
    names.len() == below.len()
        && names.len() > 1
        && (from(0) || from(1))
        && (skipped == 1 || (marked(below) && !marked(names)))
}

/// Lines about the sensors may stand between the names and the rows: where the lines next to the rows name no time, a
/// line above that does so is that of the names, and of the lines between only those of units belong to it.
fn names_above(
    headings: &[usize],
    above: &[usize],
    lines: &[Line<'_>],
    separator: char,
    late: &Late,
    width: usize,
) -> Option<Vec<usize>> {
    let of = |at: usize| heading_cells(lines[at].text, separator);
    let names_time = |at: usize| of(at).iter().any(|c| names_time(c));
    if headings.iter().any(|at| names_time(*at)) {
        return None;
    }
    let is_whole = |at: usize| {
        let cells = of(at);
        let named = |i: usize| cells.get(i).is_some_and(|cell| Cell::of(cell).is_word());
        late.is_heading(&cells, width) && (0..width).all(|i| named(i) || !late.is_numeric(i))
    };
    let names = above.iter().copied().rev().find(|at| names_time(*at) && is_whole(*at))?;
    let units = above.iter().copied().rfind(|at| *at > names && late.is_units(&of(*at)));
    Some(std::iter::once(names).chain(units).collect())
}

/// Whether a heading is that of times or dates.
fn names_time(cell: &str) -> bool {
    let name = header_unit(cell).map_or(cell.to_owned(), |(name, _)| name);
    is_time_name(&name) || is_date_name(&name)
}

/// The cells of a line of headings, which may stand in a comment, as numpy writes them. Where blanks separate the
/// columns, two of them are needed where one stands within names, and a unit in brackets belongs to the name before it.
fn heading_cells(line: &str, separator: char) -> Vec<Cow<'_, str>> {
    let line = line.trim_start_matches(['#', '%']).trim_start_matches(|c| c == ' ' && separator != ' ');
    if separator != ' ' {
        return cells(line, separator);
    }
    if line.trim().contains("  ") {
        return line.split("  ").map(str::trim).filter(|c| !c.is_empty()).map(Cow::Borrowed).collect();
    }
    let mut joined: Vec<Cow<'_, str>> = Vec::new();
    for cell in cells(line, separator) {
        match joined.last_mut() {
            Some(last) if cell.starts_with(['(', '[']) && !last.is_empty() && !last.ends_with([')', ']']) => {
                *last = Cow::Owned(format!("{last} {cell}"));
            }
            _ => joined.push(cell),
        }
    }
    joined
}

/// As many cells as there are columns up to the last that holds anything: R names one less where the first numbers the
/// rows.
fn aligned(mut row: Vec<Cow<'_, str>>, least: usize) -> Vec<Cow<'_, str>> {
    if row.len() + 1 == least && row.first().is_some_and(|c| !c.is_empty()) {
        row.insert(0, Cow::Borrowed(""));
    }
    row
}

/// The line of names among those of headings; leaves the lines that belong to it. Under the names may stand units, and
/// lines on how each value was taken.
fn names_line<'t>(
    headings: &mut Vec<usize>,
    cells_at: impl Fn(usize) -> Vec<Cow<'t, str>>,
    late: &Late,
) -> Option<usize> {
    let is_units = |at: usize| late.is_units(&cells_at(at));
    let is_process = |at: usize| {
        let cells = cells_at(at);
        let mut filled = cells.iter().filter(|c| !c.is_empty()).peekable();
        filled.peek().is_some() && filled.all(|c| PROCESSES.contains(&c.to_lowercase().as_str()))
    };
    let names = match headings.iter().rposition(|&at| is_units(at)) {
        // the units may stand above the names
        Some(0) if headings.len() > 1 => {
            headings.swap(0, 1);
            0
        }
        // `f8 f8 f8` names nothing
        Some(units) => (0..units).rev().find(|&at| !is_one_word(&cells_at(headings[at]))).unwrap_or(0),
        None => headings.len().checked_sub(1 + headings.iter().rev().take_while(|&&at| is_process(at)).count())?,
    };
    headings.drain(..names);
    headings.first().copied()
}

/// Whether all of several cells hold the same word.
fn is_one_word(cells: &[Cow<'_, str>]) -> bool {
    let filled: Vec<&Cow<'_, str>> = cells.iter().filter(|c| !c.is_empty()).collect();
    filled.len() > 1 && filled.iter().all(|c| *c == filled[0])
}
