//! The part of a long record that its closure needs. A record of hours holds one closure of seconds: the rest costs
//! time and memory, and tells a fit nothing.

use std::collections::VecDeque;

use rayon::prelude::*;
use serde::Serialize;

use crate::recording::{Gap, Recording, RunInfo, Series};
use crate::rig::check::return_time_s;
use crate::rig::{Rig, Sensor, SensorKind};
use crate::robust::median;
use crate::signal::levels::temperature_degc;
use crate::signal::noise::white_sd_of_whole;

/// A pressure sensor with more samples than this has a long record; what is used of it has no more. A tenth of it
/// resolves any wave: 20 periods of 1,500 samples each. Chosen.
const LONG: usize = 300_000;
/// A window goes on for so many periods of the wave (4L/a) after the closure, as long as a test is usually recorded.
/// Chosen.
const PERIODS: f64 = 20.0;
/// It goes on for no more than so many: no surge outlives them, and each costs a simulation of it. A record of twice as
/// many is long, too. Chosen.
const MOST_PERIODS: f64 = 200.0;
/// Before the closure it holds at least so many periods, and at least so many seconds, from which flow and steady
/// pressure are read.
const LEAD_PERIODS: f64 = 2.0;
const LEAD_S: f64 = 6.0;
/// Blocks into which a record is cut to look for its closure.
const BLOCKS: usize = 1 << 16;
/// Samples of a block at least: fewer do not show which value lasts.
const LEAST_BLOCK: usize = 16;
/// Samples of a block of a recording whose length is not known.
const PASSING_BLOCK: usize = 1024;
/// A step of more than so many usual ones is a gap.
const GAP_STEPS: f64 = 2.5;
/// Samples from which the noise is estimated before anything is known of the record.
const FOR_NOISE: usize = 1 << 16;
/// A front rises by this share of the record's swing, as in `front`.
const RISEN: f64 = 0.2;
/// A swing that is fewer times the noise shows its front only where the whole record is averaged: such a rise is no
/// more than what noise does.
const CLEAR: f64 = 40.0;

/// The recording, or what is used of a long one, with the window that it was cut to.
pub fn used(recording: Recording) -> (Recording, Option<Window>) {
    match Window::of(&recording) {
        Some(window) => (window.cut(&recording), Some(window)),
        None => (recording, None),
    }
}

/// Whether a sensor's record holds more than a fit needs.
fn is_long(samples: usize, lasts_s: f64, period_s: f64) -> bool {
    samples > LONG || lasts_s > 2.0 * MOST_PERIODS * period_s
}

/// What of a long record is used.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Window {
    /// Its first time, s.
    pub from_s: f64,
    /// Its last time, s.
    pub to_s: f64,
    /// So many samples are averaged to one.
    pub averaged: usize,
    /// How long the record is, s.
    pub recorded_s: f64,
    /// It lies around a closure; else none was found.
    #[serde(skip)]
    pub around_closure: bool,
    /// Another front after it, s.
    #[serde(skip)]
    pub next_front_s: Option<f64>,
}

impl Window {
    /// The window of a long record: around the first closure, or all of it, averaged, where there is none. `None` for a
    /// record that is used as it is.
    pub fn of(recording: &Recording) -> Option<Window> {
        let series = |i: usize| &recording.series[i];
        let most = recording.rig.pressure_sensors().map(|(i, _)| series(i).time_s.len()).max()?;
        let temperature_degc = temperature_degc(recording);
        let period_s = period_s(&recording.rig, temperature_degc);
        let lasts_s = |i: usize| series(i).time_s.last().zip(series(i).time_s.first()).map_or(0.0, |(b, a)| b - a);
        let short = |i: usize| !is_long(series(i).time_s.len(), lasts_s(i), period_s);
        if recording.rig.pressure_sensors().all(|(i, _)| short(i)) {
            return None;
        }
        let pressures: Vec<(usize, &Sensor)> = recording.rig.pressure_sensors().collect();
        let scanned = pressures.into_par_iter().map(|(i, sensor)| {
            let mut scan = Scan::new(most.div_ceil(BLOCKS).max(LEAST_BLOCK));
            series(i).time_s.iter().zip(&series(i).value).for_each(|(t, v)| scan.push(*t, *v));
            (sensor, scan)
        });
        let scanned: Vec<(&Sensor, Scan)> = scanned.collect();
        let scans: Vec<(&Sensor, &Scan)> = scanned.iter().map(|(sensor, scan)| (*sensor, scan)).collect();
        Window::of_scans(&recording.rig, temperature_degc, &scans)
    }

    /// The same of pressure sensors whose samples went by.
    fn of_scans(rig: &Rig, temperature_degc: f64, scanned: &[(&Sensor, &Scan)]) -> Option<Window> {
        let period_s = period_s(rig, temperature_degc);
        let lasts_s = |scan: &Scan| scan.span().map_or(0.0, |(first_s, last_s, _)| last_s - first_s);
        if scanned.iter().all(|(_, scan)| !is_long(scan.samples, lasts_s(scan), period_s)) {
            return None;
        }
        let lead_s = LEAD_S.max(LEAD_PERIODS * period_s);
        let seen: Vec<Seen> =
            scanned.iter().filter_map(|(sensor, scan)| scan.closure(lead_s, rig.on_way_m(sensor.place()))).collect();
        // a sensor that drops out shows a front that no other does
        let agreeing = |one: &Seen| seen.iter().filter(|s| (s.closure_s - one.closure_s).abs() <= lead_s).count();
        let rank = |s: &Seen| (agreeing(s), s.clear, s.position_m);
        let closure = seen.iter().max_by(|a, b| {
            let (a, b) = (rank(a), rank(b));
            a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.total_cmp(&b.2))
        });
        let spans = scanned.iter().filter_map(|(_, scan)| scan.span());
        let (first_s, last_s, step_s) = spans.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1), a.2.min(b.2)))?;
        let (from_s, to_s) = match closure {
            Some(seen) => {
                let samples_s = (LONG - 1) as f64 * step_s - lead_s;
                let tail_s = samples_s.clamp(PERIODS * period_s, MOST_PERIODS * period_s);
                ((seen.closure_s - lead_s).max(first_s), (seen.closure_s + tail_s).min(last_s))
            }
            None => (first_s, last_s),
        };
        // but for rounding
        let averaged = ((to_s - from_s) / step_s / LONG as f64 - 1e-9).ceil().max(1.0) as usize;
        let fronts = || scanned.iter().filter_map(|(_, scan)| scan.next_front(lead_s, to_s));
        let next_front_s = closure.and_then(|_| fronts().reduce(f64::min));
        let recorded_s = last_s - first_s;
        Some(Window { from_s, to_s, averaged, recorded_s, around_closure: closure.is_some(), next_front_s })
    }

    /// What lies in the window. A sensor that is so slow that nothing of it does stays whole.
    pub fn cut(&self, recording: &Recording) -> Recording {
        let series = recording.series.par_iter().map(|series| self.cut_series(series)).collect();
        Recording { rig: recording.rig.clone(), series, run: recording.run.clone() }
    }

    fn cut_series(&self, series: &Series) -> Series {
        let mut cutter = Cutter::new(self, series.time_s.len(), typical_step_s(&series.time_s));
        // outside the window the cutter keeps nothing of many samples
        let times = &series.time_s;
        let taken = match cutter.few {
            true => 0..times.len(),
            false => times.partition_point(|t| *t < self.from_s)..times.partition_point(|t| *t <= self.to_s),
        };
        times[taken.clone()].iter().zip(&series.value[taken]).for_each(|(t, v)| cutter.push(*t, *v));
        cutter.finish(&series.gaps)
    }

    /// In a sentence.
    pub fn in_words(&self) -> String {
        let Window { from_s, to_s, averaged, recorded_s, .. } = self;
        let each = if *averaged > 1 { format!(", {averaged} samples averaged to one") } else { String::new() };
        if !self.around_closure {
            return format!("no closure was found in the {recorded_s:.1} s recorded: all of it is used{each}");
        }
        let next = self.next_front_s.map_or(String::new(), |next_s| {
            format!("; another front at {next_s:.1} s is not: cut the record before it to use that one")
        });
        format!(
            "of {recorded_s:.1} s recorded, the {:.1} s from {from_s:.3} s to {to_s:.3} s, around the first closure, are used{each}{next}",
            to_s - from_s
        )
    }
}

/// Takes the samples of one sensor as they go by, and keeps those in a window.
struct Cutter {
    window: Window,
    /// So many make one.
    averaged: usize,
    /// A sensor of so few samples that all are kept until the end: where none lies in the window it stays whole.
    few: bool,
    kept: Series,
    /// Number and sums of those that will make the next one, the first one's time and the last one's.
    count: usize,
    sums: (f64, f64),
    first_s: f64,
    last_s: f64,
    /// The usual step, s.
    step_s: f64,
}

impl Cutter {
    /// Of a sensor with so many samples, usually so far apart: one that is slow enough as it is keeps them.
    fn new(window: &Window, samples: usize, step_s: f64) -> Cutter {
        let few = samples <= LONG;
        Cutter {
            window: *window,
            averaged: if few { 1 } else { window.averaged },
            few,
            kept: Series::default(),
            count: 0,
            sums: (0.0, 0.0),
            first_s: 0.0,
            last_s: 0.0,
            step_s,
        }
    }

    /// Takes a sample; times increase.
    fn push(&mut self, time_s: f64, value: f64) {
        let outside = time_s < self.window.from_s || time_s > self.window.to_s;
        if outside && !self.few {
            return;
        }
        if self.averaged == 1 {
            self.kept.time_s.push(time_s);
            self.kept.value.push(value);
            return;
        }
        // nothing is averaged over a gap
        if self.count > 0 && time_s - self.last_s > GAP_STEPS * self.step_s {
            self.emit();
        }
        if self.count == 0 {
            self.first_s = time_s;
        }
        self.last_s = time_s;
        self.count += 1;
        // about the first time: sums of large times would round
        self.sums = (self.sums.0 + (time_s - self.first_s), self.sums.1 + value);
        if self.count == self.averaged {
            self.emit();
        }
    }

    fn emit(&mut self) {
        let n = self.count as f64;
        self.kept.time_s.push(self.first_s + self.sums.0 / n);
        self.kept.value.push(self.sums.1 / n);
        (self.count, self.sums) = (0, (0.0, 0.0));
    }

    /// What was kept, with those of the sensor's gaps that lie in it.
    fn finish(mut self, gaps: &[Gap]) -> Series {
        let Window { from_s, to_s, .. } = self.window;
        let (from, to) =
            (self.kept.time_s.partition_point(|t| *t < from_s), self.kept.time_s.partition_point(|t| *t <= to_s));
        if self.few && from == to {
            return Series { gaps: gaps.to_vec(), ..self.kept };
        }
        self.kept.time_s.truncate(to);
        self.kept.value.truncate(to);
        self.kept.time_s.drain(..from);
        self.kept.value.drain(..from);
        self.kept.gaps = gaps.iter().filter(|gap| gap.to_s > from_s && gap.from_s < to_s).copied().collect();
        self.kept
    }
}

/// Median of the first steps, s; infinite where there is none.
fn typical_step_s(time_s: &[f64]) -> f64 {
    let first = &time_s[..time_s.len().min(FOR_NOISE)];
    if first.len() < 2 {
        return f64::INFINITY;
    }
    median(&mut first.windows(2).map(|w| w[1] - w[0]).collect::<Vec<_>>())
}

/// What is remembered of the samples of one sensor as they go by, to find its closure.
struct Scan {
    length: usize,
    /// Samples that the last block still takes.
    left: usize,
    samples: usize,
    first_s: f64,
    last_s: f64,
    /// The first samples: times and values.
    head: (Vec<f64>, Vec<f64>),
    /// Of each block its first time, and its lowest and highest value that lasts for three samples; infinite where
    /// there is none.
    blocks: Vec<(f64, f64, f64)>,
    /// The last two values.
    before: (f64, f64),
}

/// The used part of a recording whose samples go by twice and are not kept.
pub struct Passing {
    rig: Rig,
    scans: Vec<Scan>,
    /// Sums of the values, for the temperature.
    sums: Vec<f64>,
    cutting: Option<Vec<Cutter>>,
}

impl Passing {
    /// Of a recording on a rig.
    pub fn new(rig: &Rig) -> Passing {
        let sensors = rig.sensors.len();
        let scans = (0..sensors).map(|_| Scan::new(PASSING_BLOCK)).collect();
        Passing { rig: rig.clone(), scans, sums: vec![0.0; sensors], cutting: None }
    }

    /// Takes a sample that goes by for the first time; times of a sensor increase.
    pub fn first(&mut self, sensor: usize, time_s: f64, value: f64) {
        self.scans[sensor].push(time_s, value);
        self.sums[sensor] += value;
    }

    /// The same for the second time, after all have gone by once.
    pub fn second(&mut self, sensor: usize, time_s: f64, value: f64) {
        let cutters = self.cutting.get_or_insert_with(|| cutting(&self.rig, &self.scans, &self.sums));
        cutters[sensor].push(time_s, value);
    }

    /// What is used of it; `gaps` are those of each sensor.
    pub fn finish(self, gaps: Vec<Vec<Gap>>, run: RunInfo) -> Recording {
        let cutters = self.cutting.unwrap_or_else(|| cutting(&self.rig, &self.scans, &self.sums));
        let series = cutters.into_iter().zip(gaps).map(|(cutter, gaps)| cutter.finish(&gaps)).collect();
        Recording { rig: self.rig, series, run }
    }
}

/// What cuts each sensor to the window, which is all of a recording that is used as it is.
fn cutting(rig: &Rig, scans: &[Scan], sums: &[f64]) -> Vec<Cutter> {
    let thermometer = rig
        .sensors
        .iter()
        .zip(scans.iter().zip(sums))
        .find(|(sensor, (scan, _))| sensor.kind == SensorKind::Temperature && scan.samples > 0);
    let temperature_degc = thermometer.map_or(rig.fluid.temperature_degc, |(sensor, (scan, sum))| {
        sensor.unit.to_si(sum / scan.samples as f64, 1000.0)
    });
    let pressures: Vec<_> = rig.pressure_sensors().map(|(i, sensor)| (sensor, &scans[i])).collect();
    let all = Window {
        from_s: f64::NEG_INFINITY,
        to_s: f64::INFINITY,
        averaged: 1,
        recorded_s: 0.0,
        around_closure: false,
        next_front_s: None,
    };
    let window = Window::of_scans(rig, temperature_degc, &pressures).unwrap_or(all);
    scans.iter().map(|scan| Cutter::new(&window, scan.samples, typical_step_s(&scan.head.0))).collect()
}

/// The closure as one sensor shows it.
struct Seen {
    closure_s: f64,
    /// Swing over noise, as far as that matters.
    clear: f64,
    position_m: f64,
}

impl Scan {
    /// Blocks will have so many samples.
    fn new(length: usize) -> Scan {
        let (head, blocks, before) = (Default::default(), Vec::new(), (f64::NAN, f64::NAN));
        Scan { length: length.max(1), left: 0, samples: 0, first_s: 0.0, last_s: 0.0, head, blocks, before }
    }

    /// Takes a sample; times increase.
    fn push(&mut self, time_s: f64, value: f64) {
        if self.samples == 0 {
            self.first_s = time_s;
        }
        if self.samples < FOR_NOISE {
            self.head.0.push(time_s);
            self.head.1.extend(value.is_finite().then_some(value));
        }
        if self.left == 0 {
            self.left = self.length;
            self.blocks.push((time_s, f64::INFINITY, f64::NEG_INFINITY));
            self.before = (f64::NAN, f64::NAN);
        }
        let (a, b) = self.before;
        if (a + b + value).is_finite()
            && let Some((_, low, high)) = self.blocks.last_mut()
        {
            *low = low.min(a.max(b).max(value));
            *high = high.max(a.min(b).min(value));
        }
        self.before = (b, value);
        self.last_s = time_s;
        self.samples += 1;
        self.left -= 1;
    }

    /// First and last time, s, and the typical step; `None` where there are fewer than two samples.
    fn span(&self) -> Option<(f64, f64, f64)> {
        if self.head.0.len() < 2 {
            return None;
        }
        Some((self.first_s, self.last_s, typical_step_s(&self.head.0)))
    }

    /// The first front.
    fn closure(&self, lookback_s: f64, position_m: f64) -> Option<Seen> {
        let clear = self.clear()?;
        Some(Seen { closure_s: self.front(lookback_s)?, clear, position_m })
    }

    /// How far the highest value that lasts is above the usual ones. Not from the lowest: a sensor that drops out would
    /// stretch it.
    fn swing(&self) -> f64 {
        let mut highs: Vec<f64> = self.blocks.iter().map(|b| b.2).filter(|high| high.is_finite()).collect();
        let usual = median(&mut highs);
        highs.into_iter().fold(usual, f64::max) - usual
    }

    /// Swing over noise; `None` where no front would be clear.
    fn clear(&self) -> Option<f64> {
        let swing = self.swing();
        let clear = swing / white_sd_of_whole(&self.head.1).max(1e-4 * swing);
        (swing.is_finite() && clear > CLEAR).then_some(clear)
    }

    /// A front after a time at which a wave still runs, s: it rises above every peak before it, but for those that are
    /// so near that they may be its own rise.
    fn next_front(&self, lookback_s: f64, after_s: f64) -> Option<f64> {
        self.clear()?;
        let (blocks, risen) = (&self.blocks, RISEN * self.swing());
        // blocks looked back to that none behind them is higher than: the first is the highest
        let (mut highest, mut behind): (VecDeque<usize>, usize) = (VecDeque::new(), 0);
        let front = blocks.iter().find(|block| {
            while blocks[behind].0 < block.0 - 0.5 * lookback_s {
                while highest.back().is_some_and(|&k| blocks[k].2 <= blocks[behind].2) {
                    highest.pop_back();
                }
                highest.push_back(behind);
                behind += 1;
            }
            while highest.front().is_some_and(|&k| blocks[k].0 < block.0 - 1.5 * lookback_s) {
                highest.pop_front();
            }
            block.0 > after_s && highest.front().is_some_and(|&k| block.2 - blocks[k].2 > risen)
        });
        front.map(|block| block.0)
    }

    /// The first front, s: the first block that rises far above the highest values of those shortly before it. Neither
    /// a slow drift nor a sensor that drops out and comes back does.
    fn front(&self, lookback_s: f64) -> Option<f64> {
        let (blocks, risen) = (&self.blocks, RISEN * self.swing());
        let (mut first, mut sum, mut highs) = (0, 0.0, Vec::with_capacity(blocks.len()));
        for (i, block) in blocks.iter().enumerate() {
            while blocks[first].0 < block.0 - lookback_s {
                sum -= highs[first];
                first += 1;
            }
            let base = if first == i { block.1 } else { sum / (i - first) as f64 };
            if block.2 - base > risen {
                return Some(block.0);
            }
            // a block without a value that lasts says nothing, and stands for those before it
            let high = if block.2.is_finite() { block.2 } else { base };
            highs.push(high);
            sum += high;
        }
        None
    }
}

/// Nominal period of the wave, 4L/a, s.
fn period_s(rig: &Rig, temperature_degc: f64) -> f64 {
    let water = rig.fluid.properties(temperature_degc);
    2.0 * return_time_s(rig, &water)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::RunInfo;
    use crate::signal::testing::Gauss;

    const RIG: &str = "name = \"long\"\n[fluid]\nname = \"water\"\ntemperature_degC = 20.0\n[[pipe]]\nname = \"main\"\nlength_m = 100.0\n\
        inner_diameter_mm = 50.0\nwall_thickness_mm = 5.0\nmaterial = \"HDPE\"\n[upstream]\nkind = \"reservoir\"\n[downstream]\nkind = \"valve\"\n\
        closing_time_s = 0.1\n[[sensor]]\nname = \"P1\"\nkind = \"pressure\"\nposition_m = 100.0\nunit = \"kPa\"\n[[sensor]]\nname = \"T1\"\n\
        kind = \"temperature\"\nposition_m = 0.0\nunit = \"degC\"\n";

    /// So many samples at a rate, with a closure at a time: a square wave of 1 s that dies out, on a supply that
    /// drifts.
    fn recording(samples: usize, rate_hz: f64, closure_s: f64) -> Recording {
        let mut dice = Gauss::new(1);
        let time_s: Vec<f64> = (0..samples).map(|i| i as f64 / rate_hz).collect();
        let wave = |t: f64| match t - closure_s {
            after if after < 0.0 => 0.0,
            after => 100.0 * (-after / 5.0).exp() * if after.fract() < 0.5 { 1.0 } else { -1.0 },
        };
        let value = time_s.iter().map(|t| 300.0 + 0.08 * t + wave(*t) + 0.1 * dice.next()).collect();
        let slow = Series { time_s: vec![0.0], value: vec![20.0], gaps: vec![] };
        let rig = Rig::from_toml(RIG, "long.toml").unwrap();
        Recording { rig, series: vec![Series { time_s, value, gaps: vec![] }, slow], run: RunInfo::default() }
    }

    #[test]
    fn a_record_of_usual_length_is_used_as_it_is() {
        assert_eq!(Window::of(&recording(300_000, 10_000.0, 3.0)), None);
    }

    #[test]
    fn of_a_long_record_the_closure_is_used() {
        let long = recording(1_200_000, 1000.0, 900.0);
        let window = Window::of(&long).unwrap();
        assert!((893.0..=894.0).contains(&window.from_s) && window.averaged == 1, "{window:?}");
        let used = window.cut(&long);
        let periods = (window.to_s - 900.0) / period_s(&long.rig, 20.0);
        assert!(used.series[0].time_s.len() <= LONG + 1 && (periods / MOST_PERIODS - 1.0).abs() < 0.01, "{periods}");
        assert_eq!(used.series[0].value[0], long.series[0].value[(window.from_s * 1000.0).ceil() as usize]);
        assert_eq!(used.series[1], long.series[1], "it has one sample, outside of the window");
        assert!(crate::signal::inspect(&used).is_ok());
        assert!(window.in_words().starts_with("of 1200.0 s recorded, the"), "{}", window.in_words());
    }

    #[test]
    fn a_record_of_many_periods_is_long_however_few_its_samples() {
        let record = recording(60_000, 100.0, 100.0);
        let window = Window::of(&record).unwrap();
        assert!((93.0..=94.0).contains(&window.from_s) && window.to_s < 400.0, "{window:?}");
        assert_eq!(Window::of(&recording(30_000, 100.0, 100.0)), None);
    }

    #[test]
    fn what_goes_by_twice_is_cut_as_what_is_kept() {
        for (samples, rate_hz, closure_s) in
            [(1_200_000, 1000.0, 900.0), (1_000_000, 100_000.0, 2.0), (5000, 100.0, 3.0)]
        {
            let whole = recording(samples, rate_hz, closure_s);
            let mut passing = Passing::new(&whole.rig);
            let all = |take: &mut dyn FnMut(usize, f64, f64)| {
                for (i, series) in whole.series.iter().enumerate() {
                    series.time_s.iter().zip(&series.value).for_each(|(t, v)| take(i, *t, *v));
                }
            };
            all(&mut |i, t, v| passing.first(i, t, v));
            all(&mut |i, t, v| passing.second(i, t, v));
            let passed = passing.finish(vec![Vec::new(); 2], RunInfo::default());
            let (used, _) = used(whole.clone());
            let ends = |r: &Recording| (r.series[0].time_s[0], r.series[0].time_s.len());
            let ((from_s, samples), (passed_from_s, passed_samples)) = (ends(&used), ends(&passed));
            assert!(
                (from_s - passed_from_s).abs() < 1.1,
                "one block of a thousand samples: {from_s} and {passed_from_s}"
            );
            assert!(samples.abs_diff(passed_samples) < 1100, "{samples} and {passed_samples}");
        }
    }

    #[test]
    fn a_sensor_that_drops_out_does_not_choose_the_window_and_a_second_closure_is_reported() {
        let mut long = recording(1_200_000, 1000.0, 900.0);
        long.series[0].value[100_000..100_020].fill(-500.0);
        let window = Window::of(&long).unwrap();
        assert!((893.0..=894.0).contains(&window.from_s) && window.next_front_s.is_none(), "{window:?}");
        let again = recording(1_200_000, 1000.0, 200.0);
        let mut twice = recording(1_200_000, 1000.0, 900.0);
        for (value, more) in twice.series[0].value.iter_mut().zip(&again.series[0].value).take(800_000) {
            *value = *more;
        }
        let window = Window::of(&twice).unwrap();
        assert!((193.0..=194.0).contains(&window.from_s), "{window:?}");
        assert!(window.next_front_s.is_some_and(|s| (899.0..901.0).contains(&s)), "{window:?}");
        assert!(window.in_words().contains("another front at"), "{}", window.in_words());
    }

    #[test]
    fn one_short_step_loses_nothing() {
        let mut fast = recording(1_000_000, 100_000.0, 2.0);
        fast.series[0].time_s[500_000] -= 9e-6;
        let used = Window::of(&fast).unwrap().cut(&fast);
        assert_eq!(used.series[0].time_s.len(), 250_000);
    }

    #[test]
    fn a_fast_record_is_averaged() {
        let fast = recording(1_000_000, 100_000.0, 2.0);
        let window = Window::of(&fast).unwrap();
        assert_eq!((window.from_s, window.averaged), (0.0, 4), "{window:?}");
        let used = window.cut(&fast);
        let times = &used.series[0].time_s;
        assert!((times[0] - 1.5e-5).abs() < 1e-12 && (times[1] - times[0] - 4e-5).abs() < 1e-12);
        let start = crate::signal::inspect(&used).unwrap().closure.start_s;
        assert!((start - 2.0).abs() < 1e-3, "{start}");
    }

    #[test]
    fn a_gap_is_not_averaged_over_and_stays_one() {
        let mut fast = recording(1_000_000, 100_000.0, 2.0);
        let series = &mut fast.series[0];
        series.time_s.drain(500_002..500_102);
        series.value.drain(500_002..500_102);
        series.gaps.push(Gap { from_s: 5.00001, to_s: 5.00102, samples: Some(100) });
        let used = Window::of(&fast).unwrap().cut(&fast);
        assert_eq!(used.series[0].gaps, fast.series[0].gaps);
        let longest = used.series[0].time_s.windows(2).map(|w| w[1] - w[0]).fold(0.0, f64::max);
        assert!(longest > 1e-3, "{longest}");
    }

    #[test]
    fn a_long_record_without_a_closure_is_averaged_whole() {
        let mut still = recording(1_200_000, 1000.0, 1e9);
        let window = Window::of(&still).unwrap();
        assert_eq!((window.from_s, window.averaged), (0.0, 4));
        assert!(crate::signal::inspect(&window.cut(&still)).is_err());
        still.series[0].value.iter_mut().for_each(|v| *v = f64::NAN);
        assert_eq!(Window::of(&still).unwrap().from_s, 0.0);
    }
}
