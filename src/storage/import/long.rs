//! A plain time series that is too long for memory: it is read twice, line by line, and written as it is read. It comes
//! out as by way of memory, but for the layout of the file: its samples stand in blocks.

use std::fs::File;
use std::io::{BufRead as _, BufReader, BufWriter};
use std::path::Path;

use crate::recording::{CsvFormat, Gap, RunInfo, Series};
use crate::rig::{Rig, SensorKind};
use crate::robust::median;
use crate::storage::disk;
use crate::storage::error::LogError;
use crate::storage::import::csv::columns::sensors_of;
use crate::storage::import::csv::comments::{comment_notes, start_in_comments};
use crate::storage::import::csv::grid::{HOLE_STEPS, SAME_STEP};
use crate::storage::import::csv::numbers::Written;
use crate::storage::import::csv::strays::has_strays;
use crate::storage::import::source::{ImportOptions, Repair, SourceOptions};
use crate::storage::layout::to_ns;
use crate::storage::schema::Kind;
use crate::storage::sink::{Sink, finished, program};
use crate::storage::summary::{SensorSummary, Summary};
use crate::storage::write::{BLOCK_SAMPLES, block};

/// A shorter file is read in one piece, bytes.
const LONG_BYTES: u64 = 64 << 20;
/// Times from which the step of the grid is taken.
const FOR_STEP: usize = 100_000;
/// Most that is kept of the comments, bytes.
const KEPT_COMMENTS: usize = 1 << 16;

/// Values of a sensor among which strays are looked for at once; the last quarter of them is looked at again with the
/// next ones.
const LOOK: usize = 1 << 16;

/// What became of a long time series.
pub struct ImportedLong {
    /// What was written.
    pub summary: Summary,
    /// The gaps of each sensor of the rig.
    pub gaps: Vec<Vec<Gap>>,
    /// Information on the run.
    pub run: RunInfo,
    /// What was noticed.
    pub repairs: Vec<Repair>,
    /// Value of the last digit of its start, s, where it gives one itself.
    pub start_digit_s: Option<f64>,
}

/// Which time a sample goes by.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pass {
    /// Nothing is written yet, and the file may turn out not to be plain.
    First,
    /// It is written.
    Second,
}

/// Sees every sample twice: which time, the sensor's index in the rig, its time in s, and its value.
pub type OnSample<'a> = dyn FnMut(Pass, usize, f64, f64) + 'a;

/// A plain time series, and what is to become of it.
#[derive(Clone, Copy)]
pub struct LongImport<'a> {
    /// The table.
    pub csv: &'a Path,
    /// The rig of the test.
    pub rig: &'a Rig,
    /// What is known of the table.
    pub options: &'a ImportOptions,
    /// How tables of other programs are read: one that needs it is not plain.
    pub source: &'a SourceOptions,
    /// The recording to write.
    pub out: &'a Path,
}

impl LongImport<'_> {
    /// Imports a long table, in memory that does not grow with it. `None` where the file is short, or not plain to the
    /// last line: then it is for [`import_file`](crate::storage::import::import_file), which says what is wrong or
    /// mends it.
    ///
    /// # Errors
    /// Files that cannot be read or written.
    pub fn run(self, on_sample: &mut OnSample<'_>) -> Result<Option<ImportedLong>, LogError> {
        let file = disk::open_file(self.csv)?;
        let about = file.metadata().map_err(|e| LogError::io("read", self.csv, e))?;
        let plain = self.source.is_plain();
        if about.is_file() && about.len() >= LONG_BYTES && plain { self.streamed(on_sample) } else { Ok(None) }
    }

    fn streamed(self, on_sample: &mut OnSample<'_>) -> Result<Option<ImportedLong>, LogError> {
        disk::refuse_existing(self.out)?;
        let Some(seen) = first_pass(self, on_sample)? else { return Ok(None) };
        second_pass(self, &seen, on_sample).map(Some)
    }
}

/// The rows of a plain time series, one after the other.
struct Rows {
    lines: BufReader<File>,
    line: Vec<u8>,
    /// Comment lines.
    comments: String,
    /// The last line had an end.
    ended: bool,
}

impl Rows {
    fn open(csv: &Path) -> Result<Rows, LogError> {
        let lines = BufReader::with_capacity(1 << 20, disk::open_file(csv)?);
        Ok(Rows { lines, line: Vec::new(), comments: String::new(), ended: true })
    }

    /// The next line that holds something; `None` at the end, an error where it is no text.
    fn next(&mut self) -> Option<Result<&str, ()>> {
        loop {
            self.line.clear();
            match self.lines.read_until(b'\n', &mut self.line) {
                Ok(0) => return None,
                Ok(_) => {}
                Err(_) => return Some(Err(())),
            }
            self.ended = self.line.last() == Some(&b'\n');
            if self.line.first() == Some(&b'#') {
                let Ok(text) = std::str::from_utf8(&self.line) else { return Some(Err(())) };
                if self.comments.len() < KEPT_COMMENTS {
                    self.comments.push_str(text);
                }
            } else if !self.line.trim_ascii().is_empty() {
                return Some(std::str::from_utf8(&self.line).map_err(drop));
            }
        }
    }
}

/// The cells of a row, without the blanks around them. By bytes: this is where an import spends its time.
struct Cells<'r>(Option<&'r str>);

impl<'r> Iterator for Cells<'r> {
    type Item = &'r str;

    fn next(&mut self) -> Option<&'r str> {
        let rest = self.0?;
        let end = rest.as_bytes().iter().position(|b| *b == b',');
        self.0 = end.map(|end| &rest[end + 1..]);
        Some(rest[..end.unwrap_or(rest.len())].trim_ascii())
    }
}

/// What the first pass finds.
struct Seen {
    header: String,
    /// The sensor of each column after the first.
    sensors: Vec<usize>,
    written: Vec<Written>,
    /// The step of an even grid of times, s.
    step_s: Option<f64>,
    rows: usize,
    earliest_s: f64,
    comments: String,
}

fn first_pass(of: LongImport<'_>, on_sample: &mut OnSample<'_>) -> Result<Option<Seen>, LogError> {
    let LongImport { csv, rig, options, .. } = of;
    let mut rows = Rows::open(csv)?;
    let Some(Ok(header)) = rows.next() else { return Ok(None) };
    let header = header.trim_end().trim_start_matches('\u{feff}').to_owned();
    let names: Vec<String> = header.split(',').map(|name| name.trim().to_owned()).collect();
    let Ok(sensors) = sensors_of(&names, rig, &options.without) else { return Ok(None) };
    if header.contains('"') {
        return Ok(None);
    }
    let mut written = vec![Written::default(); names.len()];
    let mut samples = vec![0_usize; sensors.len()];
    let (mut grid, mut count, mut before_s, mut earliest_s) = (Grid::default(), 0, f64::NEG_INFINITY, 0.0);
    let mut scratch = String::new();
    let mut looked_at: Vec<Vec<f64>> = vec![Vec::with_capacity(LOOK); sensors.len()];
    while let Some(row) = rows.next() {
        let Ok(row) = row else { return Ok(None) };
        let mut cells = Cells(Some(row));
        let time = cells.next().unwrap_or_default();
        let Some(time_s) = time.parse().ok().filter(|t: &f64| *t > before_s && t.is_finite() && to_ns(*t).is_some())
        else {
            return Ok(None);
        };
        written[0].watch(time, time_s, &mut scratch);
        if count == 0 {
            earliest_s = time_s;
        }
        let of_sensors = samples.iter_mut().zip(&sensors).zip(&mut looked_at);
        for (((samples, &sensor), values), written) in of_sensors.zip(&mut written[1..]) {
            let Some(cell) = cells.next() else { return Ok(None) };
            if cell.is_empty() {
                continue;
            }
            let Some(value) = cell.parse().ok().filter(|v: &f64| v.is_finite()) else { return Ok(None) };
            written.watch(cell, value, &mut scratch);
            on_sample(Pass::First, sensor, time_s, value);
            *samples += 1;
            values.push(value);
            if values.len() == LOOK {
                if has_strays(values) {
                    return Ok(None);
                }
                values.drain(..LOOK / 4 * 3);
            }
        }
        if cells.next().is_some() {
            return Ok(None);
        }
        grid.push(time_s);
        before_s = time_s;
        count += 1;
    }
    // a last line without an end, written otherwise than those above it, may be cut off
    let whole = rows.ended || written.last().is_some_and(|w| w.decimals().is_some_and(|d| d > 0));
    let sampled = samples.iter().zip(&sensors).all(|(n, &i)| *n > 0 || rig.sensors[i].kind != SensorKind::Pressure);
    if !whole || !sampled || count == 0 || looked_at.iter().any(|values| has_strays(values)) {
        return Ok(None);
    }
    let (step_s, comments) = (grid.step_s(), rows.comments);
    Ok(Some(Seen { header, sensors, written, step_s, rows: count, earliest_s, comments }))
}

/// Whether times stand on an even grid, as `csv::grid` says, from its first steps on.
#[derive(Default)]
struct Grid {
    first: Vec<f64>,
    step_s: f64,
    before_s: f64,
    steps: u64,
    even: u64,
}

impl Grid {
    fn push(&mut self, time_s: f64) {
        if self.first.len() < FOR_STEP {
            self.first.push(time_s);
            if self.first.len() == FOR_STEP {
                self.settle();
            }
        } else {
            self.count(time_s - self.before_s);
        }
        self.before_s = time_s;
    }

    fn settle(&mut self) {
        let steps: Vec<f64> = self.first.windows(2).map(|w| w[1] - w[0]).collect();
        self.step_s = median(&mut steps.clone());
        steps.into_iter().for_each(|step| self.count(step));
    }

    fn count(&mut self, step_s: f64) {
        self.steps += 1;
        self.even += u64::from((step_s / self.step_s - 1.0).abs() < SAME_STEP);
    }

    fn step_s(mut self) -> Option<f64> {
        if self.first.len() < FOR_STEP {
            self.settle();
        }
        (self.steps > 1 && self.step_s > 0.0 && self.even as f64 >= 0.8 * self.steps as f64).then_some(self.step_s)
    }
}

/// What is under way of one sensor.
struct Part {
    sensor: usize,
    block: Series,
    gaps: Vec<Gap>,
    samples: usize,
    first_s: f64,
    last_s: f64,
    /// Its time in the row before; none where that row had no sample.
    before_s: Option<f64>,
}

fn second_pass(of: LongImport<'_>, seen: &Seen, on_sample: &mut OnSample<'_>) -> Result<ImportedLong, LogError> {
    let LongImport { csv, rig, options, source, out } = of;
    let mut run = RunInfo {
        start_unix_ns: options.start_unix_ns,
        source: format!("import {}", csv.file_name().unwrap_or_default().to_string_lossy()),
        program: program(),
        notes: comment_notes(&seen.comments),
        csv: Some(CsvFormat {
            time_decimals: seen.written[0].decimals(),
            columns: seen.sensors.iter().zip(&seen.written[1..]).map(|(i, w)| (*i, w.decimals())).collect(),
        }),
    };
    let (mut repairs, mut start_digit_s) = (Vec::new(), None);
    if let Some((start, remark)) = start_in_comments(&seen.comments, source).filter(|_| options.start_unix_ns == 0) {
        (run.start_unix_ns, start_digit_s) = (start.unix_ns, Some(start.digit_s));
        repairs.push(remark);
    }
    let zero_ns = match run.start_unix_ns {
        0 => (-seen.earliest_s.min(0.0)).ceil() as u64 * 1_000_000_000,
        start => start,
    };
    let temporary = disk::temporary_beside(out)?;
    let mut sink = Sink::start(BufWriter::new(temporary.as_file()), finished(), out, rig, &run, zero_ns)?;
    let part = |&sensor: &usize| Part {
        sensor,
        block: Series::default(),
        gaps: Vec::new(),
        samples: 0,
        first_s: f64::NAN,
        last_s: f64::NAN,
        before_s: None,
    };
    let mut parts: Vec<Part> = seen.sensors.iter().map(part).collect();
    for part in &parts {
        sink.channel(part.sensor, Kind::Block)?;
    }
    let mut rows = Rows::open(csv)?;
    let changed =
        || LogError::SourceFile { path: csv.into(), why: "it changed while it was read: nothing was written".into() };
    let same =
        matches!(rows.next(), Some(Ok(header)) if header.trim_end().trim_start_matches('\u{feff}') == seen.header);
    let (mut count, mut before_s) = (0, f64::NEG_INFINITY);
    while let Some(row) = rows.next() {
        let mut cells = Cells(Some(row.map_err(|()| changed())?));
        let time_s: f64 = cells.next().and_then(|t| t.parse().ok()).filter(|t| *t > before_s).ok_or_else(changed)?;
        for part in &mut parts {
            let cell = cells.next().ok_or_else(changed)?;
            let value: Option<f64> = if cell.is_empty() { None } else { Some(cell.parse().map_err(|_| changed())?) };
            part.take(time_s, value, before_s, seen.step_s, &mut sink)?;
            if let Some(value) = value {
                on_sample(Pass::Second, part.sensor, time_s, value);
            }
        }
        before_s = time_s;
        count += 1;
    }
    if !same || count != seen.rows {
        return Err(changed());
    }
    for part in &mut parts {
        part.write_block(&mut sink)?;
    }
    let stream = sink.finish()?;
    stream.into_inner().map_err(|e| LogError::io("write", out, e.into_error()))?;
    disk::publish_new(temporary, out)?;
    let missing: u64 = parts.iter().flat_map(|p| &p.gaps).filter_map(|g| g.samples).sum();
    repairs.extend((missing > 0).then(|| Repair::missing_times(missing)));
    let summary = summary(rig, &parts);
    let mut gaps = vec![Vec::new(); rig.sensors.len()];
    parts.into_iter().for_each(|part| gaps[part.sensor] = part.gaps);
    Ok(ImportedLong { summary, gaps, run, repairs, start_digit_s })
}

impl Part {
    fn take<W: std::io::Write + std::io::Seek>(
        &mut self,
        time_s: f64,
        value: Option<f64>,
        row_before_s: f64,
        step_s: Option<f64>,
        sink: &mut Sink<W>,
    ) -> Result<(), LogError> {
        let before_s = std::mem::replace(&mut self.before_s, value.map(|_| time_s));
        let Some(value) = value else { return Ok(()) };
        // lines are missing between two rows that both have a sample
        let wide = step_s.filter(|step_s| before_s.is_some() && time_s - row_before_s > HOLE_STEPS * step_s);
        if let Some(step_s) = wide {
            self.write_block(sink)?;
            let samples = Some((((time_s - row_before_s) / step_s).round() as u64).saturating_sub(1));
            let gap = Gap { from_s: row_before_s, to_s: time_s, samples };
            sink.gap(self.sensor, to_ns(time_s).unwrap_or_default(), gap)?;
            self.gaps.push(gap);
        }
        if self.samples == 0 {
            self.first_s = time_s;
        }
        self.samples += 1;
        self.last_s = time_s;
        self.block.time_s.push(time_s);
        self.block.value.push(value);
        if self.block.time_s.len() == BLOCK_SAMPLES { self.write_block(sink) } else { Ok(()) }
    }

    fn write_block<W: std::io::Write + std::io::Seek>(&mut self, sink: &mut Sink<W>) -> Result<(), LogError> {
        let Some(&first_s) = self.block.time_s.first() else { return Ok(()) };
        let whole = block(&self.block, 0, self.block.time_s.len());
        sink.block(self.sensor, to_ns(first_s).unwrap_or_default(), &whole)?;
        self.block.time_s.clear();
        self.block.value.clear();
        Ok(())
    }
}

fn summary(rig: &Rig, parts: &[Part]) -> Summary {
    let sensor = |(i, sensor): (usize, &crate::rig::Sensor)| {
        let part = parts.iter().find(|part| part.sensor == i && part.samples > 0);
        SensorSummary {
            name: sensor.name.clone(),
            kind: sensor.kind.name(),
            unit: sensor.unit.symbol,
            samples: part.map_or(0, |p| p.samples),
            gaps: part.map_or(0, |p| p.gaps.len()),
            first_s: part.map(|p| p.first_s),
            last_s: part.map(|p| p.last_s),
        }
    };
    Summary::of_sensors(&rig.name, rig.sensors.iter().enumerate().map(sensor).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::Recording;
    use crate::storage::fixtures::{assert_same, place, rig};
    use crate::storage::import::import_file;
    use crate::storage::read;

    /// Rows at 1 kHz with every kind of cell that is plain, lines missing, comments among them.
    fn table(rows: usize) -> String {
        let mut text = String::from("# start: 2026-03-14T09:26:53.5Z\n# by hand\ntime_s,P1,P2,Q1,T1\n");
        for i in (0..rows).filter(|i| !(700..750).contains(i)) {
            let (p2, q1) =
                (if i % 3 == 0 { "-1.5".into() } else { String::new() }, if i % 10 == 0 { "0.3" } else { "" });
            text += &format!("{:.3},{:.2},{p2},{q1},{}\n", i as f64 / 1e3 - 0.5, (i as f64 * 0.1).sin() * 100.0, 20);
            if i == 900 {
                text += "# a remark\n\n";
            }
        }
        text
    }

    fn both(text: &str) -> Option<(Recording, Recording, ImportedLong)> {
        let (_folder, out) = place("run.mcap");
        let csv = out.with_file_name("run.csv");
        std::fs::write(&csv, text).unwrap();
        let (rig, options, source) = (rig(), ImportOptions::default(), SourceOptions::default());
        let mut passed = [Vec::new(), Vec::new()];
        let mut on_sample = |pass: Pass, sensor: usize, t: f64, v: f64| passed[pass as usize].push((sensor, t, v));
        let long = LongImport { csv: &csv, rig: &rig, options: &options, source: &source, out: &out };
        let long = long.streamed(&mut on_sample).unwrap()?;
        assert_eq!(passed[0], passed[1], "each sample goes by twice");
        let usual = import_file(&csv, &rig, &options, &source, true).unwrap();
        let mended = |repairs: &[Repair]| repairs.iter().map(|r| r.text.clone()).collect::<Vec<_>>();
        assert_eq!(mended(&long.repairs), mended(&usual.repairs));
        assert_eq!(long.start_digit_s, usual.start_digit_s);
        Some((read(&out).unwrap(), usual.recording, long))
    }

    #[test]
    fn a_table_read_line_by_line_becomes_the_same_recording() {
        for text in [table(5000), table(5000).replace('\n', "\r\n"), table(3)] {
            let (streamed, usual, long) = both(&text).unwrap();
            assert_same(&streamed, &usual);
            let summary = Summary::of(&usual);
            assert_eq!(format!("{}", long.summary), format!("{summary}"));
            let gaps: Vec<_> = usual.series.iter().map(|s| s.gaps.clone()).collect();
            assert_eq!(long.gaps, gaps);
        }
        let (streamed, ..) = both(&table(5000)).unwrap();
        assert_eq!(streamed.series[0].gaps.len(), 1);
    }

    #[test]
    fn what_is_not_plain_is_left_to_the_usual_way() {
        let plain = table(200);
        for (from, to) in [
            ("-0.400,", "x,"),
            (",20\n-0.3", ",20,5\n-0.3"),
            (",20\n-0.3", "\n-0.3"),
            ("P2", "P9"),
            (",20\n-0.4", ",nan\n-0.4"),
            ("time_s", "Time"),
            ("P1", "\"P1\""),
        ] {
            let changed = plain.replacen(from, to, 1);
            assert_ne!(changed, plain, "{from}");
            assert!(both(&changed).is_none(), "{from} -> {to}");
        }
        assert!(both(plain.trim_end().trim_end_matches('0')).is_none(), "cut off within its last number");
        // a reading that fell out, in the second look
        let pressure = |i: usize| if i == 90_000 { 0.0 } else { 300.0 + (i as f64 * 0.1).sin() };
        let rows: String = (0..100_000).map(|i| format!("{:.3},{:.2},-1.5,,\n", i as f64 / 1e3, pressure(i))).collect();
        assert!(both(&format!("time_s,P1,P2,Q1,T1\n{rows}")).is_none());
    }
}
