//! What the fit of creep tests gives back.

use nalgebra::DMatrix;

use crate::creep::problem::gradient;
use crate::creep::shift::{Arrhenius, ShiftFactor, Wlf};
use crate::creep::{Creep, CreepTest};

/// How the noise of a test depends on its reading.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Noise {
    /// The same at all times.
    Constant,
    /// A share of the reading.
    Proportional,
}

impl Noise {
    /// In one word.
    pub fn name(self) -> &'static str {
        match self {
            Noise::Constant => "constant",
            Noise::Proportional => "proportional",
        }
    }
}

/// A number of elements that was tried.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tried {
    /// Elements.
    pub elements: usize,
    /// Root mean square of the residuals, in units of the noise that a spectrum of retardation times leaves.
    pub rms_over_noise: f64,
    /// Bayesian information criterion above that of the best.
    pub bic_above_best: f64,
}

/// One test under the fit; vectors of one length.
#[derive(Debug, Clone, PartialEq)]
pub struct TestFit {
    /// The test.
    pub test: CreepTest,
    /// J of the fit at the test's temperature, 1/Pa.
    pub fitted_per_pa: Vec<f64>,
    /// Root mean square of measured - fitted, 1/Pa.
    pub rms_per_pa: f64,
    /// Noise of the measurement from sample to sample, whatever the model, 1/Pa.
    pub noise_per_pa: f64,
    /// Its shift factor: 1 at the reference.
    pub factor: f64,
}

/// The fit of creep tests.
#[derive(Debug, Clone, PartialEq)]
pub struct CreepFit {
    /// At the reference temperature.
    pub creep: Creep,
    /// Standard errors of `ln J0, ln J_1, ln τ_1, …`: relative ones of the values; NaN at a bound.
    pub relative_errors: Vec<f64>,
    /// Which of these ended at a bound.
    pub at_bound: Vec<bool>,
    /// Covariance of the same, and of the logarithms of the shift factors after them.
    pub(crate) covariance: DMatrix<f64>,
    /// Half a 95% interval in standard errors.
    pub half_width: f64,
    /// Factor by which the autocorrelation of the residuals widens variances.
    pub inflation: f64,
    /// How noise depends on the reading.
    pub noise: Noise,
    /// Numbers of elements tried.
    pub tried: Vec<Tried>,
    /// Each test.
    pub tests: Vec<TestFit>,
    /// Temperature of the elements, °C, where temperatures are known.
    pub reference_degc: Option<f64>,
    /// The shift factor of each other temperature.
    pub shifts: Vec<ShiftFactor>,
    /// Arrhenius' law of them.
    pub arrhenius: Option<Arrhenius>,
    /// Williams, Landel and Ferry's, from three temperatures on.
    pub wlf: Option<Wlf>,
    /// Warnings for the reader.
    pub remarks: Vec<String>,
}

impl CreepFit {
    /// J(t) at the reference and the bounds of its 95% interval, 1/Pa.
    pub fn band_per_pa(&self, time_s: f64) -> (f64, f64, f64) {
        let slope = gradient(&self.creep, time_s);
        let cell = |i: usize, j: usize| slope[i] * self.covariance[(i, j)] * slope[j];
        let variance: f64 =
            (0..slope.len()).flat_map(|i| (0..slope.len()).map(move |j| (i, j))).map(|(i, j)| cell(i, j)).sum();
        let (mid, half) = (self.creep.compliance_per_pa(time_s), self.half_width * variance.max(0.0).sqrt());
        (mid, mid - half, mid + half)
    }

    /// The 95% interval of a value by the standard error of its logarithm.
    pub fn interval(&self, value: f64, relative_error: f64) -> (f64, f64) {
        let by = (self.half_width * relative_error).exp();
        (value / by, value * by)
    }

    /// Root mean square of the residuals over all tests, 1/Pa.
    pub fn rms_per_pa(&self) -> f64 {
        self.pooled(|t| t.rms_per_pa)
    }

    /// The tests' noise, each weighed by its samples, 1/Pa.
    pub fn noise_per_pa(&self) -> f64 {
        self.pooled(|t| t.noise_per_pa)
    }

    /// Covariance of the logarithms of the shift factors.
    pub(crate) fn shift_covariance(&self) -> DMatrix<f64> {
        let (first, n) = (self.relative_errors.len(), self.shifts.len());
        self.covariance.view((first, first), (n, n)).clone_owned()
    }

    fn pooled(&self, of: impl Fn(&TestFit) -> f64) -> f64 {
        let samples = |t: &TestFit| t.test.time_s.len() as f64;
        let total: f64 = self.tests.iter().map(samples).sum();
        (self.tests.iter().map(|t| samples(t) * of(t).powi(2)).sum::<f64>() / total).sqrt()
    }

    /// Time of the first reading, reduced to the reference, s: J0 includes all creep within it. 0 where a reading was
    /// taken at once.
    pub fn first_reading_s(&self) -> f64 {
        self.tests.iter().filter_map(|t| t.test.time_s.first().map(|s| s / t.factor)).fold(f64::INFINITY, f64::min)
    }

    /// Shortest time after 0 and longest, reduced to the reference, s.
    pub fn span_s(&self) -> (f64, f64) {
        let reduced = self.tests.iter().flat_map(|t| t.test.time_s.iter().map(|s| s / t.factor));
        reduced.filter(|t| *t > 0.0).fold((f64::INFINITY, 0.0), |(a, b), t| (t.min(a), t.max(b)))
    }
}
