//! Which samples enter a calibration, and where those of each sensor are among its residuals.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::ops::Range;

use crate::fit::data::run_data::RunData;
use crate::fit::problem::hum::Hum;
use crate::fit::problem::objective::Bins;
use crate::fit::problem::thresholds::MIN_NOISE_SAMPLES;

/// What one standard deviation of an error that all samples of an instrument share does to residuals: where they start,
/// and by how much they change.
pub type CommonError = Vec<(usize, Vec<f64>)>;

/// The samples of all runs that enter a calibration, and their residuals: run by run, sensor by sensor.
pub struct SampleRows<'a> {
    runs: &'a [RunData],
    /// Every how many samples one enters.
    stride: usize,
    /// Samples of each run and sensor that enter: first index, past the last.
    spans: Vec<Vec<(usize, usize)>>,
    /// Their times on the recording's clock, s, and heads, m.
    samples: Vec<Vec<[Cow<'a, [f64]>; 2]>>,
    /// The bins of each run and sensor whose frequencies are compared and whose record is long enough.
    bins: Vec<Vec<Option<Bins>>>,
    /// The hum of each run and sensor whose samples are compared.
    hum: Vec<Vec<Option<Hum>>>,
}

impl<'a> SampleRows<'a> {
    /// The rows of every `stride`th sample within the `spans`; `bins` is empty where the samples themselves are
    /// compared.
    pub(crate) fn new(
        runs: &'a [RunData],
        stride: usize,
        spans: Vec<Vec<(usize, usize)>>,
        bins: Vec<Vec<Option<Bins>>>,
    ) -> Self {
        let entering = |values: &'a [f64], (first, last): (usize, usize)| match stride {
            1 => Cow::Borrowed(&values[first..last]),
            _ => Cow::Owned(values[first..last].iter().step_by(stride).copied().collect()),
        };
        let of_run = |(run, spans): (&'a RunData, &Vec<(usize, usize)>)| {
            let of = run.sensors.iter().zip(spans);
            of.map(|(s, &span)| [entering(&s.time_s, span), entering(&s.head_m, span)]).collect()
        };
        let samples: Vec<Vec<[Cow<'a, [f64]>; 2]>> = runs.iter().zip(&spans).map(of_run).collect();
        let is_binned = |r: usize, s: usize| bins.get(r).and_then(|row| row.get(s)).is_some_and(Option::is_some);
        let of_sensor = |r: usize, s: usize| {
            (!is_binned(r, s)).then(|| Hum::of(&runs[r].sensors[s], &samples.get(r)?[s][0])).flatten()
        };
        let of_run = |(r, run): (usize, &RunData)| (0..run.sensors.len()).map(|s| of_sensor(r, s)).collect();
        let hum = runs.iter().enumerate().map(of_run).collect();
        SampleRows { runs, stride, spans, samples, bins, hum }
    }

    /// The first run and sensor whose frequencies should be compared and cannot be.
    pub(crate) fn too_short(&self) -> Option<(usize, usize)> {
        let mut all =
            self.bins.iter().enumerate().flat_map(|(r, row)| row.iter().enumerate().map(move |(s, b)| (r, s, b)));
        all.find(|(_, _, bins)| bins.is_none()).map(|(r, s, _)| (r, s))
    }

    /// Time of the last sample of a run that enters, on its clock, s; `from_s` where none is later.
    pub(crate) fn last_s(&self, r: usize, from_s: f64) -> f64 {
        let entering = self.runs[r].sensors.iter().zip(&self.spans[r]).filter(|(_, span)| span.1 > span.0);
        entering.map(|(s, span)| s.time_s[span.1 - 1]).fold(from_s, f64::max)
    }

    /// Number of residuals that are samples rather than priors.
    pub fn count(&self) -> usize {
        (0..self.runs.len()).map(|r| self.run_row_count(r)).sum()
    }

    /// How many residuals a run's sensor has.
    pub(crate) fn row_count(&self, r: usize, sensor: usize) -> usize {
        self.bins_at(r, sensor).map_or(self.taken(self.spans[r][sensor]), Bins::len)
    }

    pub(crate) fn run_row_count(&self, r: usize) -> usize {
        (0..self.runs[r].sensors.len()).map(|s| self.row_count(r, s)).sum()
    }

    /// What an offset of 1 m takes from each residual of a run's sensor, times the noise: 1 for a sample, its leakage
    /// for a frequency.
    pub(crate) fn unit_offset(&self, r: usize, sensor: usize) -> Vec<f64> {
        self.seen(r, sensor, vec![1.0; self.taken(self.spans[r][sensor])])
    }

    /// Whether the residuals of a run's sensor are other than what its samples leave.
    pub(crate) fn are_mapped(&self, r: usize, sensor: usize) -> bool {
        self.bins_at(r, sensor).is_some() || self.hum[r][sensor].is_some()
    }

    /// The residuals of a run's sensor, of what its samples leave over their noise: these, less their hum, or their
    /// frequencies.
    pub(crate) fn seen(&self, r: usize, sensor: usize, mut left: Vec<f64>) -> Vec<f64> {
        match (self.bins_at(r, sensor), &self.hum[r][sensor]) {
            (Some(bins), _) => bins.of_residuals(&left),
            (None, Some(hum)) => {
                hum.whiten(&mut left);
                left
            }
            (None, None) => left,
        }
    }

    /// Columns over the residuals, seen from the samples: the transpose of the map from samples to bins, applied to
    /// each record.
    pub(crate) fn seen_in_time(&self, columns: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let records = self.records();
        let one = |column: &Vec<f64>| {
            let seen = records.iter().flat_map(|(r, s, range)| match self.bins_at(*r, *s) {
                Some(bins) => bins.transposed(&column[range.clone()]),
                None => column[range.clone()].to_vec(),
            });
            seen.collect()
        };
        columns.iter().map(one).collect()
    }

    pub(crate) fn bins_at(&self, r: usize, sensor: usize) -> Option<&Bins> {
        self.bins.get(r)?.get(sensor)?.as_ref()
    }

    /// Noise of each sample that enters, m, in the order of the residuals; for frequencies, such that the root mean
    /// square over them equals that over the samples.
    pub fn sample_noise(&self) -> Vec<f64> {
        let sensors = self.runs.iter().enumerate().flat_map(|(r, run)| (0..run.sensors.len()).map(move |s| (r, s)));
        let noise = sensors.flat_map(|(r, s)| {
            let (rows, samples) = (self.row_count(r, s), self.taken(self.spans[r][s]).max(1));
            std::iter::repeat_n(self.runs[r].sensors[s].noise_m * (rows as f64 / samples as f64).sqrt(), rows)
        });
        noise.collect()
    }

    /// First sample of a run's sensor that enters, and how many do.
    pub fn entering(&self, r: usize, sensor: usize) -> (usize, usize) {
        let span = self.spans[r][sensor];
        (span.0, self.taken(span))
    }

    /// Samples of a run's sensor that enter: times on the recording's clock, s, and heads, m.
    pub fn samples_of(&self, r: usize, s: usize) -> [&[f64]; 2] {
        self.samples[r][s].each_ref().map(|values| &values[..])
    }

    /// Run, sensor and range among all residuals of each sensor, in their order.
    pub fn records(&self) -> Vec<(usize, usize, Range<usize>)> {
        let sensors = |r: usize| (0..self.runs[r].sensors.len()).map(move |s| (r, s));
        (0..self.runs.len()).flat_map(sensors).map(|(r, s)| (r, s, self.rows(r, s))).collect()
    }

    /// The ranges of the records, grouped by what was sampled together.
    pub fn record_rows(&self) -> Vec<Vec<Range<usize>>> {
        let rows = |group: Vec<(usize, usize)>| group.into_iter().map(|(r, s)| self.rows(r, s)).collect();
        self.sampled_together().into_iter().map(rows).collect()
    }

    /// The run of each group of records of [`record_rows`](Self::record_rows).
    pub fn runs_of_records(&self) -> Vec<usize> {
        self.sampled_together().iter().map(|group| group[0].0).collect()
    }

    /// Runs and sensors, grouped where their samples belong together one by one: equally many of one run, each nearer
    /// to its partner than to the next sample, as instruments that share a clock take them at once or in turns.
    fn sampled_together(&self) -> Vec<Vec<(usize, usize)>> {
        let times = |r: usize, s: usize| {
            let (first, last) = self.spans[r][s];
            &self.runs[r].sensors[s].time_s[first..last]
        };
        let mut groups: Vec<Vec<(usize, usize)>> = Vec::new();
        for (r, s, _) in self.records() {
            let own = times(r, s);
            let step_s = own.last().zip(own.first()).map_or(0.0, |(b, a)| (b - a) / (own.len().max(2) - 1) as f64);
            let alike = |group: &&mut Vec<(usize, usize)>| {
                let (other, first) = (times(group[0].0, group[0].1), group[0].0 == r);
                first && other.len() == own.len() && other.iter().zip(own).all(|(a, b)| (a - b).abs() < step_s)
            };
            match groups.iter_mut().find(alike) {
                Some(group) => group.push((r, s)),
                None => groups.push(vec![(r, s)]),
            }
        }
        groups
    }

    /// The noise of each record of [`record_rows`](Self::record_rows) before its samples enter, in units of its noise,
    /// less its mean. None where one of them is too short to show its autocorrelation.
    pub fn noise_before(&self) -> Option<Vec<Vec<Vec<f64>>>> {
        let before = |(r, s): (usize, usize)| {
            let (sensor, (first, _)) = (&self.runs[r].sensors[s], self.spans[r][s]);
            let head_m: Vec<f64> = sensor.head_m[..first].iter().step_by(self.stride).copied().collect();
            let mean = head_m.iter().sum::<f64>() / head_m.len().max(1) as f64;
            let mut noise: Vec<f64> = head_m.iter().map(|h| (h - mean) / sensor.noise_m).collect();
            let time_s: Vec<f64> = sensor.time_s[..first].iter().step_by(self.stride).copied().collect();
            Hum::of(sensor, &time_s).inspect(|hum| hum.whiten(&mut noise));
            (head_m.len() >= MIN_NOISE_SAMPLES).then_some(noise)
        };
        self.sampled_together().into_iter().map(|group| group.into_iter().map(before).collect()).collect()
    }

    /// The effect of one standard deviation of each sensor's gain on the residuals, by its name; a sensor is the same
    /// instrument in all runs.
    pub fn gain_errors(&self) -> BTreeMap<&str, CommonError> {
        let mut by_sensor: BTreeMap<&str, CommonError> = BTreeMap::new();
        for (r, s, range) in self.records() {
            let sensor = &self.runs[r].sensors[s];
            let weight = sensor.gain_sd() / sensor.noise_m;
            let moved = self.seen(r, s, self.samples_of(r, s)[1].iter().map(|head| head * weight).collect());
            by_sensor.entry(&sensor.sensor.name).or_default().push((range.start, moved));
        }
        by_sensor
    }

    pub(crate) fn taken(&self, (first, last): (usize, usize)) -> usize {
        (last - first).div_ceil(self.stride)
    }

    /// The residuals of a run's sensor.
    pub(crate) fn rows(&self, r: usize, sensor: usize) -> Range<usize> {
        let first: usize = (0..r).map(|r| self.run_row_count(r)).sum::<usize>()
            + (0..sensor).map(|s| self.row_count(r, s)).sum::<usize>();
        first..first + self.row_count(r, sensor)
    }
}
