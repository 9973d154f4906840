//! Which samples enter a calibration, and where each sensor's stand among its residuals.

use std::collections::BTreeMap;
use std::ops::Range;

use super::Calibration;
use crate::fit::errors::Common;
use crate::fit::misfit::Bins;

impl<'a> Calibration<'a> {
    /// Number of residuals that are samples rather than priors.
    pub fn samples(&self) -> usize {
        (0..self.runs.len()).map(|r| self.run_row_count(r)).sum()
    }

    /// How many residuals a run's sensor has.
    pub(super) fn row_count(&self, r: usize, sensor: usize) -> usize {
        self.bins_at(r, sensor).map_or(self.taken(self.spans[r][sensor]), Bins::len)
    }

    pub(super) fn run_row_count(&self, r: usize) -> usize {
        (0..self.runs[r].sensors.len()).map(|s| self.row_count(r, s)).sum()
    }

    /// What an offset of 1 m takes from each residual of a run's sensor, times the noise: 1 a sample, what leaks of it into frequencies.
    pub(in crate::fit) fn unit_offset(&self, r: usize, sensor: usize) -> Vec<f64> {
        let constant = vec![1.0; self.taken(self.spans[r][sensor])];
        match self.bins_at(r, sensor) {
            Some(bins) => bins.of_residuals(&constant),
            None => constant,
        }
    }

    /// Columns over the residuals seen from the samples: the transpose of what makes bins of samples, applied to the rows of each record.
    pub(in crate::fit) fn seen_in_time(&self, columns: &[Vec<f64>]) -> Vec<Vec<f64>> {
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

    pub(super) fn bins_at(&self, r: usize, sensor: usize) -> Option<&Bins> {
        self.bins.get(r)?.get(sensor)?.as_ref()
    }

    /// Noise of each sample that enters, m, in the order of the residuals; of frequencies, such that a root mean square over them is that
    /// over the samples.
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
    pub fn samples_of(&self, r: usize, s: usize) -> impl Iterator<Item = (f64, f64)> + use<'a, '_> {
        let (first, last) = self.spans[r][s];
        let sensor = &self.runs[r].sensors[s];
        let samples = sensor.time_s[first..last].iter().zip(&sensor.head_m[first..last]);
        samples.step_by(self.window.stride).map(|(&t, &head)| (t, head))
    }

    /// Where each sensor's residuals lie among all: run, sensor, range; in their order.
    pub fn records(&self) -> Vec<(usize, usize, Range<usize>)> {
        let sensors = |r: usize| (0..self.runs[r].sensors.len()).map(move |s| (r, s));
        (0..self.runs.len()).flat_map(sensors).map(|(r, s)| (r, s, self.rows(r, s))).collect()
    }

    /// Where the records are, in that order.
    pub fn record_rows(&self) -> Vec<Range<usize>> {
        self.records().into_iter().map(|(_, _, rows)| rows).collect()
    }

    /// What one standard deviation of each sensor's gain does to the residuals, by its name; a sensor is the same instrument in all runs.
    pub fn gain_errors(&self) -> BTreeMap<&str, Common> {
        let mut by_sensor: BTreeMap<&str, Common> = BTreeMap::new();
        for (r, s, range) in self.records() {
            let sensor = &self.runs[r].sensors[s];
            let weight = sensor.gain_sd() / sensor.noise_m;
            let moved: Vec<f64> = self.samples_of(r, s).map(|(_, head)| head * weight).collect();
            let moved = self.bins_at(r, s).map_or_else(|| moved.clone(), |bins| bins.of_residuals(&moved));
            by_sensor.entry(&sensor.sensor.name).or_default().push((range.start, moved));
        }
        by_sensor
    }

    /// Residuals of priors: where they are among all.
    pub fn prior_rows(&self) -> Range<usize> {
        let first = self.samples();
        first..first + self.parameters.iter().filter(|p| p.prior.is_some()).count()
    }

    pub(super) fn taken(&self, (first, last): (usize, usize)) -> usize {
        (last - first).div_ceil(self.window.stride)
    }

    /// The residuals of a run's sensor.
    pub(in crate::fit) fn rows(&self, r: usize, sensor: usize) -> Range<usize> {
        let first: usize = (0..r).map(|r| self.run_row_count(r)).sum::<usize>()
            + (0..sensor).map(|s| self.row_count(r, s)).sum::<usize>();
        first..first + self.row_count(r, sensor)
    }
}
