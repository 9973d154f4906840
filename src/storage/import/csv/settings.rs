//! What stands around a table: lines of a key and its values, such as `Sample Interval,1.0e-03`, `Y_Unit_Label⇥bar⇥bar`
//! or `# start: 2026-03-14`.

use std::borrow::Cow;

use crate::storage::import::csv::heading::{header_unit, is_factored, is_known_unit, key_of, time_unit};
use crate::storage::import::csv::numbers::Numbers;
use crate::storage::import::csv::scaled::{changes, factor_in_words, is_absolute, is_absolute_by, is_of_transducer};
use crate::storage::import::csv::stamp::Stamp;
use crate::storage::import::kinds::{is_above_level, is_electric};
use crate::storage::import::source::Order;
use crate::storage::import::source::{Repair, SourceOptions, Start};

/// Kind of the remark on a start that the file gives.
pub(crate) const START: &str = "start";

/// Keys of the time from sample to sample. Those of oscilloscopes and of LabVIEW are in seconds where no unit stands
/// by.
const INTERVALS: [&str; 16] = [
    "sampleinterval",
    "increment",
    "xincrement",
    "xinc",
    "deltax",
    "xdelta",
    "hresolution",
    "samplinginterval",
    "samplingperiod",
    "sampleperiod",
    "interval",
    "timeinterval",
    "timestep",
    "scaninterval",
    "delta",
    "dt",
];
const IN_SECONDS: usize = 7;
/// Keys of samples a second.
const RATES: [&str; 14] = [
    "samplerate",
    "samplingrate",
    "samplingfrequency",
    "samplefrequency",
    "scanrate",
    "rate",
    "fs",
    "abtastrate",
    "messrate",
    "frequencydechantillonnage",
    "samplespersecond",
    "samplessec",
    "acquisitionrate",
    "datarate",
];
/// Keys of how many samples stand for one that was written.
const THINNED: [&str; 8] = [
    "decimation",
    "decimationfactor",
    "downsampling",
    "downsamplingfactor",
    "downsample",
    "skip",
    "everynth",
    "reduction",
];
/// Keys of the units of columns.
const UNITS: [&str; 18] = [
    "unit",
    "units",
    "einheit",
    "einheiten",
    "unité",
    "unités",
    "unidad",
    "eu",
    "yunit",
    "yunits",
    "yunitlabel",
    "verticalunits",
    "verticalunit",
    "vertunits",
    "vunit",
    "yeinheit",
    "yaxisunits",
    "engineeringunits",
];
/// Keys of the unit of times.
const TIME_UNITS: [&str; 8] =
    ["horizontalunits", "horzunits", "hunit", "xunit", "xunits", "xeinheit", "xunitlabel", "timeunit"];
/// Keys of the names of columns, and headings of a column of names in a table of channels.
const NAMES: [&str; 8] = ["signalname", "name", "channelname", "tracename", "tag", "label", "signal", "comment"];
/// Keys of dates and times that are no start by their names.
const STARTS: [&str; 5] = ["date", "datetime", "timestamp", "time0", "datum"];

/// A key and what stands behind it.
#[derive(Debug)]
struct Setting {
    /// As written.
    name: String,
    /// Without signs, in lower case.
    key: String,
    cells: Vec<String>,
    /// The word alone in the last such line above.
    head: Option<String>,
}

/// Whether a line that begins so states units or names.
pub(crate) fn is_key(cell: &str) -> bool {
    let key = key_of(cell.trim_end_matches([':', '=']));
    UNITS.contains(&key.as_str()) || NAMES[..NAMES.len() - 2].contains(&key.as_str())
}

impl Setting {
    /// What a line says of each column: one thing of all; of as many as there are values, by their order; otherwise by
    /// their places, the key in that of the first column or before it.
    fn by_column(&self, width: usize, values: &[usize]) -> Vec<(usize, String)> {
        let cells = || self.cells.iter().map(|c| c.trim()).enumerate().filter(|(_, c)| !c.is_empty());
        // a unit of time is that of the times: the line goes by the columns
        let by_place = cells().any(|(_, cell)| time_unit(cell).is_some());
        let owned = |(i, cell): (usize, &str)| (i, cell.to_owned());
        match cells().count() {
            1 if values.len() > 1 => {
                cells().flat_map(|(_, cell)| values.iter().map(move |v| owned((*v, cell)))).collect()
            }
            n if n == values.len() && !by_place => {
                values.iter().zip(cells()).map(|(v, (_, cell))| owned((*v, cell))).collect()
            }
            _ => {
                // a unit of time in the first cell is that of the first column
                let is_first = self.cells.first().is_some_and(|cell| time_unit(cell).is_some());
                let shift = usize::from(self.cells.len() != width && !is_first);
                cells().map(|(i, cell)| owned((i + shift, cell))).filter(|(i, _)| *i < width).collect()
            }
        }
    }
}

/// All that stands around a table.
#[derive(Debug, Default)]
pub(crate) struct Settings {
    all: Vec<Setting>,
    head: Option<String>,
    /// Lines of one cell, which may be words.
    remarks: Vec<String>,
}

impl Settings {
    /// Takes the cells of a line; of one cell alone what stands on both sides of a colon or an equals sign. A word
    /// alone heads what follows.
    pub(crate) fn take(&mut self, cells: &[Cow<'_, str>]) {
        let last = cells.iter().rposition(|c| !c.is_empty()).map_or(0, |last| last + 1);
        if let [one] = &cells[..last] {
            self.remarks.push(one.trim().to_owned());
        }
        let (name, cells): (&str, Vec<String>) = match &cells[..last] {
            [] => return,
            [one] => match one.split_once([':', '=']).or_else(|| one.split_once('\t')) {
                Some((name, value)) => (name, vec![value.trim().to_owned()]),
                None => {
                    self.head = Some(one.trim().to_owned());
                    return;
                }
            },
            [name, rest @ ..] => (name, rest.iter().map(|c| c.to_string()).collect()),
        };
        let name = name.trim().trim_end_matches([':', '=']).trim();
        self.all.push(Setting { name: name.to_owned(), key: key_of(name), cells, head: self.head.clone() });
    }

    /// Takes a value that stands under its heading.
    pub(crate) fn take_under(&mut self, heading: &str, cell: &str) {
        self.all.push(Setting {
            name: heading.to_owned(),
            key: key_of(heading),
            cells: vec![cell.to_owned()],
            head: None,
        });
    }

    /// The time between samples that is stated, s, and the words that state it.
    pub(crate) fn interval_s(&self) -> Option<(f64, String)> {
        self.all.iter().find_map(|setting| {
            let (name, unit) = header_unit(&setting.name).unwrap_or((setting.name.clone(), String::new()));
            let key = key_of(&name);
            let (place, is_rate) = match INTERVALS.iter().position(|k| *k == key) {
                Some(place) => (place, false),
                None => (RATES.iter().position(|k| *k == key)?, true),
            };
            let first = setting.cells.first()?;
            // `00:00:00.001000` is a time, too
            if first.contains(':') && !is_rate {
                let time = Stamp::parse(first, Order::Unknown).filter(|s| !s.has_date && !s.in_hour)?;
                return Some((time.seconds_of_day(), format!("'{} {first}'", setting.name)));
            }
            let (number, rest) = number_of(first);
            let behind = setting.cells.get(1).map_or("", |c| c.trim());
            // what stands behind a number and is no unit that is known states nothing
            let stated = [rest, unit.as_str(), behind].into_iter().find(|u| !u.is_empty());
            let scale = match stated {
                Some(unit) if unit == behind => scale(unit).or_else(|| usual(is_rate, place))?,
                Some(unit) => scale(unit)?,
                None => usual(is_rate, place)?,
            };
            let interval = |value: f64| match scale {
                Scale::Interval(unit_s) => value * unit_s,
                Scale::Rate(unit_hz) => 1.0 / (value * unit_hz),
            };
            let interval_s = numbers_of(number).into_iter().map(interval).find(|s| PLAUSIBLE_S.contains(s))?;
            (interval_s.is_finite() && interval_s > 0.0)
                .then(|| (interval_s, format!("'{} {}'", setting.name, setting.cells.join(" ").trim())))
        })
    }

    /// What says that of the device's samples not all were written.
    pub(crate) fn thinned(&self) -> Option<String> {
        let is_number =
            |s: &&Setting| s.cells.first().is_some_and(|c| numbers_of(number_of(c).0).iter().any(|n| *n > 1.0));
        let thinned = self.all.iter().filter(|s| THINNED.contains(&s.key.as_str())).find(is_number)?;
        Some(format!("'{} {}'", thinned.name, thinned.cells.join(" ").trim()))
    }

    /// Factors and zeros that lines or remarks state of columns, in their words: nobody can tell whether the numbers
    /// have them yet.
    pub(crate) fn factors(&self, width: usize, values: &[usize]) -> Vec<(usize, String)> {
        // what the lines say of volts is how they became what the numbers are in
        let is_volts = |cell: &String| is_electric(number_of(cell.trim()).1);
        if self.all.iter().any(|s| is_of_transducer(&s.key) || s.cells.iter().any(is_volts)) {
            return Vec::new();
        }
        let of_line = |s: &Setting| -> Vec<(usize, String)> {
            let is_unit = UNITS.contains(&s.key.as_str());
            let is_changed = |cell: &str| changes(&s.key, cell) || (is_unit && is_factored(cell));
            let told = |(i, cell): (usize, String)| is_changed(&cell).then(|| (i, format!("{} {cell}", s.name)));
            s.by_column(width, values).into_iter().filter_map(told).collect()
        };
        let of_remark = |remark: &String| {
            let said = factor_in_words(remark).map(str::to_owned);
            values.iter().filter_map(move |i| Some((*i, said.clone()?))).collect::<Vec<_>>()
        };
        self.all.iter().flat_map(of_line).chain(self.remarks.iter().flat_map(of_remark)).collect()
    }

    /// The unit of times that is stated, s.
    pub(crate) fn time_unit_s(&self) -> Option<f64> {
        let of = |s: &Setting| time_unit(s.cells.first()?);
        self.all.iter().filter(|s| TIME_UNITS.contains(&s.key.as_str())).find_map(of)
    }

    /// The units of columns, where a line states them.
    pub(crate) fn units(&self, width: usize, values: &[usize]) -> Vec<(usize, String)> {
        let states = |s: &Setting| UNITS.contains(&s.key.as_str()) && s.cells.iter().any(|c| is_known_unit(c.trim()));
        // of several that stand under heads of their own, each is of one
        let headed = self.all.iter().filter(|s| states(s) && s.head.is_some() && s.cells.len() == 1).count() > 1;
        let stated = |s: &&Setting| states(s) && !(headed && s.cells.len() == 1);
        let Some(line) = self.all.iter().rev().find(stated) else { return Vec::new() };
        // the same key with another unit contradicts it
        let again = self.all.iter().filter(stated).filter(|s| s.key == line.key && s.cells != line.cells);
        std::iter::once(line).chain(again).flat_map(|line| line.by_column(width, values)).collect()
    }

    /// The names of columns, where a line states them.
    pub(crate) fn names(&self, width: usize, values: &[usize]) -> Vec<(usize, String)> {
        let states = |s: &&Setting| s.cells.len() >= values.len() && values.len() > 1;
        // of several the one nearest to the table
        let line = |key: &&str| self.all.iter().rev().filter(states).find(|s| s.key == **key);
        NAMES.iter().find_map(line).map_or(Vec::new(), |line| line.by_column(width, values))
    }

    /// Name and unit of a channel in a table of channels, such as `CH,Signal name,…,Unit` over `CH1,Valve,…,bar`, or
    /// its unit under its name.
    pub(crate) fn channel(&self, heading: &str) -> Option<(Option<String>, String)> {
        let under = |s: &&Setting| UNITS.contains(&s.key.as_str()) && s.head.as_deref() == Some(heading);
        if let Some(unit) = self.all.iter().find(under).and_then(|s| s.cells.first()).filter(|u| is_known_unit(u)) {
            return Some((None, unit.clone()));
        }
        let head = self
            .all
            .iter()
            .position(|s| s.cells.len() > 1 && s.cells.iter().any(|c| UNITS.contains(&key_of(c).as_str())))?;
        let place = |of: &[&str]| self.all[head].cells.iter().position(|c| of.contains(&key_of(c).as_str()));
        let row = self.all[head + 1..].iter().find(|s| s.key == key_of(heading) && !s.key.is_empty())?;
        let cell = |at: Option<usize>| at.and_then(|at| row.cells.get(at)).filter(|c| !c.is_empty()).cloned();
        let unit = cell(place(&UNITS))
            .map(|u| u.trim_matches(['[', ']', '(', ')']).to_owned())
            .filter(|u| is_known_unit(u))?;
        Some((cell(place(&NAMES)), unit))
    }

    /// Whether a line says that pressures count from the vacuum: `Pressure type: absolute`,
    /// `Reference;absolute;absolute`, `pressures are absolute`.
    pub(crate) fn is_absolute(&self) -> bool {
        let keyed = |s: &Setting| s.cells.iter().any(|cell| is_absolute_by(&s.key, cell));
        // a range or a remark may say it, too
        let worded = |s: &Setting| s.cells.iter().any(|cell| is_absolute(&format!("{} {cell}", s.name)));
        self.all.iter().any(|s| keyed(s) || worded(s)) || self.remarks.iter().any(|r| is_absolute(r))
    }

    /// What says that heads count from the sea or another level: `head above sea level`.
    pub(crate) fn level(&self) -> Option<&str> {
        let said = self.remarks.iter().chain(self.all.iter().flat_map(|s| &s.cells));
        said.flat_map(|text| text.split([',', ';'])).map(str::trim).find(|text| is_above_level(text))
    }

    /// Wall-clock time of time 0, and a remark on it, that a line gives: `start: 2026-03-14T09:26:53.5Z`, or a date and
    /// a time in two lines, as LabVIEW writes them. Of several the last holds, the one nearest to the table.
    pub(crate) fn start(&self, options: &SourceOptions) -> Option<(Start, Repair)> {
        let named = |s: &&Setting| s.key.contains("start") || STARTS.contains(&s.key.as_str());
        let whole = |s: &Setting| {
            let [first, second] = [s.cells.first()?, s.cells.get(1).unwrap_or(&s.cells[0])];
            let order = options.order();
            [first.clone(), format!("{first} {second}")]
                .into_iter()
                .find_map(|text| Stamp::parse(&text, order).filter(|s| s.has_date && s.has_time).map(|s| (s, text)))
        };
        let in_two = || {
            let cell = |key: &str| self.last(key).and_then(|s| s.cells.first());
            in_two_lines(cell("date")?, cell("time")?, options)
        };
        start_at(self.all.iter().rev().filter(named).find_map(whole).or_else(in_two)?, options)
    }

    /// The start of each of several columns of values, where the lines of date and time give each its own and they
    /// differ, as LabVIEW writes channels that were started one after the other.
    pub(crate) fn own_starts(
        &self,
        width: usize,
        values: &[usize],
        options: &SourceOptions,
    ) -> Vec<(usize, Start, Repair)> {
        let (Some(dates), Some(times)) = (self.last("date"), self.last("time")) else { return Vec::new() };
        let times = times.by_column(width, values);
        if times.iter().all(|(_, time)| *time == times[0].1) {
            return Vec::new();
        }
        let dates = dates.by_column(width, values);
        let of = |(column, time): (usize, String)| {
            let (_, date) = dates.iter().find(|(i, _)| *i == column)?;
            let (start, said) = start_at(in_two_lines(date, &time, options)?, options)?;
            Some((column, start, said))
        };
        times.into_iter().filter_map(of).collect()
    }

    /// The last line of a key.
    fn last(&self, key: &str) -> Option<&Setting> {
        self.all.iter().rev().find(|s| s.key == key)
    }
}

/// A date in one line and the time of day in another.
fn in_two_lines(date: &str, time: &str, options: &SourceOptions) -> Option<(Stamp, String)> {
    let text = format!("{date} {time}");
    Stamp::parse(&text, options.order()).filter(|s| s.has_date && s.has_time).map(|s| (s, text))
}

/// Time 0 at a date-time, and the remark on it.
fn start_at((stamp, text): (Stamp, String), options: &SourceOptions) -> Option<(Start, Repair)> {
    let ns = u64::try_from(stamp.unix_ns(options.zone_s.unwrap_or(0))).ok()?;
    let zone = if stamp.zone_s.is_some() || options.zone_s.is_some() { "" } else { ", taken as UTC" };
    let text = format!("time 0 is the start that the file gives, {text}{zone}");
    Some((Start { unix_ns: ns, digit_s: stamp.digit_s }, Repair::new(START, 1, None, text)))
}

/// Steps of the records of a test, s.
const PLAUSIBLE_S: std::ops::RangeInclusive<f64> = 1e-7..=60.0;

/// What a number without a unit is: a rate in Hz; an interval in seconds where oscilloscopes or LabVIEW write it.
fn usual(is_rate: bool, place: usize) -> Option<Scale> {
    if is_rate { Some(Scale::Rate(1.0)) } else { Some(Scale::Interval(1.0)).filter(|_| place < IN_SECONDS) }
}

/// A number and what stands behind it; between its digits may stand marks, blanks and apostrophes.
fn number_of(cell: &str) -> (&str, &str) {
    let is_part = |c: char| c.is_ascii_digit() || "+-.,'eE ".contains(c);
    let end = cell.find(|c: char| !is_part(c)).unwrap_or(cell.len());
    // the `E` of a unit belongs to no number
    let number = cell[..end].trim_end_matches(['e', 'E', ' ']);
    (number, cell[number.len()..].trim())
}

/// What a number may be: `1,000` has a decimal comma, or a thousand.
fn numbers_of(number: &str) -> Vec<f64> {
    let read = |thousands| Numbers::new(';', thousands).read(number, "").ok().filter(|v| v.is_finite());
    let grouped = number.contains(',').then(|| read(Some(','))).flatten();
    // a rate of one sample a second is none of a test
    let mut all: Vec<f64> = read(None).into_iter().chain(grouped).collect();
    if number.ends_with(",000") {
        all.reverse();
    }
    all
}

/// What a unit makes of a number.
enum Scale {
    /// Seconds.
    Interval(f64),
    /// Samples a second.
    Rate(f64),
}

fn scale(unit: &str) -> Option<Scale> {
    let unit = unit.trim().trim_start_matches(['[', '(']).trim_end_matches([']', ')']);
    let rate = match unit.to_lowercase().as_str() {
        "hz" | "1/s" | "s/s" | "sa/s" | "samples/s" | "sps" | "samples/sec" | "samples per second" | "sample/s" => {
            Some(1.0)
        }
        "khz" | "ks/s" | "ksa/s" | "ksps" => Some(1e3),
        "mhz" | "ms/s" | "msa/s" => Some(1e6),
        _ => None,
    };
    rate.map(Scale::Rate).or_else(|| time_unit(unit).map(Scale::Interval))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings(lines: &[&str]) -> Settings {
        let mut found = Settings::default();
        lines.iter().for_each(|line| found.take(&line.split(',').map(Cow::Borrowed).collect::<Vec<_>>()));
        found
    }

    #[test]
    fn intervals_and_rates_in_the_words_of_many_devices() {
        for (line, interval_s) in [
            ("Sample Interval,1.000000e-03", 1e-3),
            ("Sampling interval,1ms", 1e-3),
            ("Delta_X,5.0E-4,5.0E-4", 5e-4),
            ("Sampling interval (us),50", 5e-5),
            ("Interval,500,us", 5e-4),
            ("Sample rate: 2000 Hz", 5e-4),
            ("Sampling Rate = 2 kHz", 5e-4),
            ("Abtastrate,2000", 5e-4),
            ("Scan rate,1000,samples/s", 1e-3),
            ("Sample rate: 1'000 Hz", 1e-3),
            ("Sample rate: 1 000 Hz", 1e-3),
            ("Scan Interval,00:00:00.001000", 1e-3),
            ("Delta              : 0.001 sec.", 1e-3),
        ] {
            let (found, said) = settings(&[line]).interval_s().unwrap_or_else(|| panic!("{line}"));
            assert!((found / interval_s - 1.0).abs() < 1e-12 && said.starts_with('\''), "{line}: {found}");
        }
        for line in
            ["Sampling interval,1", "Baud rate,9600", "Interval,none", "Trigger Point,1.0e+01", "Rate,60000 /min"]
        {
            assert!(settings(&[line]).interval_s().is_none(), "{line}");
        }
    }

    #[test]
    fn units_by_place_by_order_and_of_channels() {
        let lines = settings(&["Unit,psi,psi"]);
        assert_eq!(lines.units(4, &[2, 3]), [(2, "psi".into()), (3, "psi".into())]);
        let labview = settings(&["Y_Unit_Label,bar,,mbar"]);
        assert_eq!(labview.units(5, &[1, 3, 4]), [(1, "bar".into()), (3, "mbar".into())]);
        assert_eq!(settings(&["Vertical Units,V"]).units(3, &[1, 2]), [(1, "V".into()), (2, "V".into())]);
        assert!(settings(&["TempUnit,C", "Unit,7"]).units(3, &[1, 2]).is_empty());
        let graphtec = settings(&["CH,Signal name,Amp,Span,,Unit", "CH1,Valve,M,10,-10,bar", "CH2,,M,10,-10,psi"]);
        assert_eq!(graphtec.channel("CH1"), Some((Some("Valve".into()), "bar".into())));
        assert_eq!(graphtec.channel("CH2"), Some((None, "psi".into())));
        assert_eq!(graphtec.channel("CH3"), None);
        let solinst = settings(&["Location:", "Valve", "LEVEL", "UNIT: kPa", "TEMPERATURE", "UNIT: Deg C"]);
        assert_eq!(solinst.channel("LEVEL"), Some((None, "kPa".into())));
        assert_eq!(solinst.channel("TEMPERATURE"), Some((None, "Deg C".into())));
    }

    /// 2026-03-14T09:26:53Z is 1 773 480 413 s after 1970, by `date -u +%s`.
    #[test]
    fn a_start_in_one_line_or_two() {
        let of = |lines: &[&str]| settings(lines).start(&SourceOptions::default()).map(|(start, _)| start.unix_ns);
        assert_eq!(of(&["Start time,2026/03/14,09:26:53"]), Some(1_773_480_413_000_000_000));
        assert_eq!(of(&["start: 2026-03-14T09:26:53.5Z"]), Some(1_773_480_413_500_000_000));
        let labview = ["Date,2026/03/14", "Time,09:26:40.0352557312", "Date,2026/03/14", "Time,09:26:53.25"];
        assert_eq!(of(&labview), Some(1_773_480_413_250_000_000));
        assert_eq!(of(&["Date,2026/03/14"]), None);
        let apart = settings(&["Date,2026/03/14,,2026/03/14", "Time,09:26:53.25,,09:26:53.253"]);
        let own = apart.own_starts(4, &[1, 3], &SourceOptions::default());
        let own: Vec<(usize, u64)> = own.iter().map(|(column, start, _)| (*column, start.unix_ns)).collect();
        assert_eq!(own, [(1, 1_773_480_413_250_000_000), (3, 1_773_480_413_253_000_000)]);
        let together = settings(&["Date,2026/03/14,,2026/03/14", "Time,09:26:53.25,,09:26:53.25"]);
        assert!(together.own_starts(4, &[1, 3], &SourceOptions::default()).is_empty());
        assert_eq!(of(&["Serial,2026-03-14T09:26:53Z"]), None);
    }
}
