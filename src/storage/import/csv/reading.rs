//! The steps in which a table is read, once it is known where it stands: what its columns are, their clocks, the rows,
//! and the tracks that they make.

use crate::storage::error::{CsvFault, CsvProblem};
use crate::storage::import::csv::clock::Clock;
use crate::storage::import::csv::comments::{among_samples, note};
use crate::storage::import::csv::keyed::Channel;
use crate::storage::import::csv::layout::{Column, Layout, cells};
use crate::storage::import::csv::lines::Line;
use crate::storage::import::csv::looks::{ends_of_one, extremes};
use crate::storage::import::csv::missing::Spellings;
use crate::storage::import::csv::numbers::{Numbers, thousands};
use crate::storage::import::csv::order::put_in_order;
use crate::storage::import::csv::roles::{Clock as ClockColumns, Roles, roles};
use crate::storage::import::csv::row::is_row;
use crate::storage::import::csv::rows::{Rows, Timed};
use crate::storage::import::csv::stamp::order_shown;
use crate::storage::import::csv::states::States;
use crate::storage::import::csv::strays::{take_sentinels, take_signs, take_unread};
use crate::storage::import::csv::table::column_series;
use crate::storage::import::source::{Repair, SourceFile, SourceOptions, Start, Track};

/// A table, or the rows of one channel of a table in long form, while it is read.
pub(crate) struct Reading<'a, 't> {
    lines: &'a [Line<'t>],
    layout: Layout<'t>,
    /// The line within which the file ends.
    cut: Option<usize>,
    options: &'a SourceOptions,
    /// The line of the names, from 1.
    header_at: Option<usize>,
    repairs: Vec<Repair>,
    spellings: Spellings,
}

/// The columns of values, and what is known of all.
struct Columns {
    clocks: Vec<ClockColumns>,
    values: Vec<usize>,
    /// Heading and name of every column.
    names: Vec<(String, String)>,
    states: States,
}

impl<'a, 't> Reading<'a, 't> {
    pub(crate) fn new(
        lines: &'a [Line<'t>],
        layout: Layout<'t>,
        cut: Option<usize>,
        options: &'a SourceOptions,
    ) -> Reading<'a, 't> {
        let header_at = layout.names_at.map(|at| lines[at].at);
        Reading { lines, layout, cut, options, header_at, repairs: Vec::new(), spellings: Spellings::default() }
    }

    /// What the table holds, or the rows of one channel.
    ///
    /// # Errors
    /// The line from 1, where there is one, and what is wrong.
    pub(crate) fn file(mut self, channel: Option<&Channel>) -> Result<SourceFile, CsvFault> {
        self.check()?;
        let columns = self.columns(channel)?;
        let mut timed = self.clocks(&columns)?;
        self.read_rows(&columns, &mut timed)?;
        let (tracks, start) = self.tracks(timed, &columns)?;
        if tracks.is_empty() {
            return Err((self.header_at, Box::new(CsvProblem::HeaderOnly)));
        }
        self.repairs.extend(self.spellings.repair());
        let start = start.or_else(|| {
            let (start, remark) = self.layout.settings.start(self.options)?;
            self.repairs.push(remark);
            Some(start)
        });
        let is_track = |i: usize| tracks.iter().any(|track| track.place == Some(i + 1));
        let others = columns.names.into_iter().enumerate().filter(|(i, _)| !is_track(*i));
        let others = others.flat_map(|(_, (heading, name))| [heading, name]).collect();
        let (above, below) = self.lines.split_at(self.layout.first);
        let notes = note(above, below, &self.layout.headings);
        Ok(SourceFile { tracks, start, notes, repairs: self.repairs, spare_tracks: false, others })
    }

    /// There are rows, and nothing between them and the headings looks like one that cannot be read.
    fn check(&self) -> Result<(), CsvFault> {
        let Reading { lines, layout, .. } = self;
        let has_rows = lines[layout.first..].iter().any(|l| is_row(l.text) && Some(l.at) != self.cut);
        if !has_rows || layout.rows.is_empty() && layout.names_at == Some(layout.first) {
            return Err((self.header_at.or(Some(lines[layout.first].at)), Box::new(CsvProblem::HeaderOnly)));
        }
        let above = lines[..layout.first].iter().enumerate().rev().find(|(_, l)| is_row(l.text));
        let is_strange = |at: usize, line: &Line<'_>| {
            !layout.headings.contains(&at) && layout.is_nearly_row(line.text) && !layout.is_keyed(line.text)
        };
        match above.filter(|(at, line)| is_strange(*at, line)) {
            Some((_, line)) => Err((Some(line.at), Box::new(CsvProblem::NotARow))),
            None => Ok(()),
        }
    }

    /// What the columns are, with their units, and which are left out.
    fn columns(&mut self, channel: Option<&Channel>) -> Result<Columns, CsvFault> {
        let found = roles(&mut self.layout, self.options).map_err(|problem| (self.header_at, Box::new(problem)))?;
        let Roles { mut clocks, words, counters, repairs } = found;
        self.repairs.extend(self.layout.repairs(self.lines));
        self.repairs.extend(among_samples(&self.lines[self.layout.first..]));
        self.repairs.extend(repairs);
        let is_key = |i: usize| channel.is_some_and(|channel| channel.column == i);
        clocks.iter_mut().for_each(|clock| clock.values.retain(|i| !is_key(*i)));
        let mut values: Vec<usize> = clocks.iter().flat_map(|clock| clock.values.iter().copied()).collect();
        values.sort_unstable();
        if let Some(channel) = channel {
            self.layout.take_channel(&values, &channel.name);
        }
        self.layout.take_settings(&values);
        self.check_units()?;
        let is_free = |i: &usize| !self.layout.columns[*i].is_given(i + 1, self.options);
        let mut extremes = extremes(&self.layout.columns, &values);
        extremes.retain(is_free);
        let mut codes = States::of_opc(&self.layout, &values);
        codes.retain(is_free);
        let is_value = |i: &usize| !extremes.contains(i) && !codes.contains(i);
        clocks.iter_mut().for_each(|clock| clock.values.retain(is_value));
        values.retain(is_value);
        let open: Vec<usize> = values
            .iter()
            .copied()
            .filter(|i| is_free(i) && !self.layout.columns[*i].is_ignored(i + 1, self.options))
            .collect();
        if let Some(ends) = ends_of_one(&self.layout.columns, &open) {
            let [largest, least] = ends.map(|i| self.layout.columns[i].name.clone());
            return Err((self.header_at, Box::new(CsvProblem::EndsAlone { largest, least })));
        }
        let names = distinct_names(&self.layout.columns, &mut self.repairs);
        let telling: Vec<usize> = words.iter().chain(&codes).copied().collect();
        let states = States::find(&names.iter().map(|(_, name)| name.clone()).collect::<Vec<_>>(), &telling, &values);
        let words: Vec<usize> = words.into_iter().filter(|i| !is_key(*i) && !states.has(*i)).collect();
        let lost = extremes.iter().any(|i| !self.layout.columns[*i].is_ignored(i + 1, self.options));
        let extremes = says(
            &names,
            "extremes",
            &extremes,
            "left out, for the same channel stands beside as its mean or as it was read",
        );
        self.repairs.extend(extremes.map(|repair| Repair { lost, ..repair }));
        self.repairs.extend(says(&names, "words", &words, "left out, because they hold words or nothing"));
        let counted = "no sensors, for they count samples or give the times once more";
        self.repairs.extend(says(&names, "counters", &counters, counted));
        Ok(Columns { clocks, values, names, states })
    }

    /// No column has two units, unless somebody says what its numbers stand for.
    fn check_units(&mut self) -> Result<(), CsvFault> {
        let Some((line, [column, first, second])) = self.layout.contradiction.take() else { return Ok(()) };
        let mut columns = self.layout.columns.iter().enumerate().filter(|(_, c)| c.heading == column);
        if columns.any(|(i, c)| self.options.scales.iter().any(|(name, _)| c.is_called(name, i + 1))) {
            return Ok(());
        }
        Err((line.or(self.header_at), Box::new(CsvProblem::TwoUnits { column, first, second })))
    }

    /// The mark between the thousands of times, which holds for all numbers.
    fn mark(&self, columns: &Columns) -> Option<char> {
        columns.clocks.iter().filter_map(|c| c.time).find_map(|i| thousands(self.layout.column(i)))
    }

    /// The clocks, with the readers of their values.
    fn clocks(&self, columns: &Columns) -> Result<Vec<Timed>, CsvFault> {
        let Reading { layout, .. } = self;
        let mark = self.mark(columns);
        // columns of one unit are written alike
        let alike = |i: usize, j: usize| {
            i == j || (layout.columns[i].unit.is_some() && layout.columns[i].unit == layout.columns[j].unit)
        };
        let own = |i: usize| {
            let mut same = columns.values.iter().filter(|j| alike(i, **j));
            same.find_map(|j| thousands(layout.column(*j))).filter(|_| mark.is_none())
        };
        let shown = |i: usize| layout.column(i).filter(|c| !c.is_empty());
        // one date with a number above 12 shows the order of all
        let all_dates = |i: usize| {
            let mut rows = self.lines[layout.first..].iter();
            rows.find_map(|l| order_shown(cells(l.text, layout.separator).get(i)?))
        };
        let timed = |clock: &ClockColumns| {
            let read = Clock::new(clock.clone(), &layout.columns, shown, all_dates, self.options);
            let read = read.map_err(|problem| (self.header_at, Box::new(problem)))?;
            let grouped = clock.values.iter().map(|&i| own(i).map(|mark| Numbers::new(layout.separator, Some(mark))));
            Ok(Timed::new(read, clock.values.clone(), grouped.collect(), &columns.states))
        };
        columns.clocks.iter().map(timed).collect()
    }

    fn read_rows(&mut self, columns: &Columns, timed: &mut [Timed]) -> Result<(), CsvFault> {
        let mut numbers = Numbers::new(self.layout.separator, self.mark(columns));
        let rows = Rows { layout: &self.layout, lines: self.lines, cut: self.cut };
        self.repairs.extend(rows.read(timed, &mut numbers, &mut self.spellings)?);
        self.repairs.extend(numbers.repairs());
        Ok(())
    }

    /// The tracks of all clocks, in the order of their columns, and when the first clock began.
    fn tracks(&mut self, timed: Vec<Timed>, columns: &Columns) -> Result<(Vec<Track>, Option<Start>), CsvFault> {
        let many = timed.len() > 1;
        let (width, settings) = (self.layout.columns.len(), &self.layout.settings);
        let stated = if many { settings.own_starts(width, &columns.values, self.options) } else { Vec::new() };
        let mut tracks: Vec<Track> = Vec::new();
        let mut start: Option<Start> = None;
        for Timed { mut clock, mut table, timeless, values, grouped, .. } in timed {
            self.repairs.extend(grouped.iter().flatten().flat_map(Numbers::repairs));
            let Some(&first_s) = table.time_s.first() else { continue };
            self.repairs.extend(clock.repairs());
            self.repairs.extend(timeless.repair(table.time_s.len())?);
            for (column, &i) in table.columns.iter_mut().zip(&values) {
                self.repairs.extend(take_signs(column, &columns.names[i].0));
                take_sentinels(column, &table.line, &mut self.spellings);
            }
            let mut holes = put_in_order(&mut table, &mut self.repairs, clock.is_local())?;
            timeless.add_gaps(&table.time_s, &mut holes);
            let own = clock.start(first_s).or_else(|| {
                let (_, own, said) = stated.iter().find(|(column, ..)| values.contains(column))?;
                self.repairs.extend(start.is_none().then(|| said.clone()));
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
                let (name, short) = columns.names[i].clone();
                let unread = take_unread(column, &table.line, &name, &mut self.spellings);
                let series = column_series(&table.time_s, column, &holes);
                let uneven = Repair::uneven(&name, &series);
                let Column { name: own_name, unit, .. } = &self.layout.columns[i];
                tracks.push(Track {
                    shares: Some(own_name).filter(|own| **own != short).cloned(),
                    name,
                    short,
                    unit: unit.clone(),
                    series,
                    repairs: unread.into_iter().chain(uneven).collect(),
                    place: Some(i + 1),
                });
            }
        }
        tracks.sort_by_key(|track| track.place);
        Ok((tracks, start))
    }
}

/// What there is to say of columns that are no values; nothing of those without a heading.
fn says(names: &[(String, String)], what: &'static str, columns: &[usize], why: &str) -> Option<Repair> {
    let named: Vec<&str> = columns.iter().map(|&i| names[i].0.as_str()).filter(|heading| !heading.is_empty()).collect();
    (!named.is_empty()).then(|| Repair::new(what, columns.len(), None, format!("{why}: {}", named.join(", "))))
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
