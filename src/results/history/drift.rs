//! How a parameter drifts over a rig's runs and over temperature, and whether a new value is within its history.

use crate::results::history::regression::Regression;

/// A parameter's value in one run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// Number of the run, from 1.
    pub run: f64,
    /// Water temperature, °C, where it is known.
    pub temperature_degc: Option<f64>,
    /// The value.
    pub value: f64,
    /// Its standard error.
    pub standard_error: f64,
}

/// A change with its 95% interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Slope {
    /// Change per run or per kelvin.
    pub value: f64,
    /// Lower end of its interval.
    pub low: f64,
    /// Upper end of its interval.
    pub high: f64,
}

impl Slope {
    /// It is not zero, with 95% confidence.
    pub fn stands_out(&self) -> bool {
        self.low > 0.0 || self.high < 0.0
    }
}

/// The drift of a parameter: value = mean + per run · (run − mean run) + per kelvin · (T − mean T).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drift {
    /// Value at the mean run and the mean temperature.
    pub mean: f64,
    /// Mean run number.
    pub mean_run: f64,
    /// Mean temperature, °C; NaN where a run's is not known.
    pub mean_degc: f64,
    /// Change per run; none while there are too few runs.
    pub per_run: Option<Slope>,
    /// Change per kelvin; none where the temperature hardly changed or is not known.
    pub per_kelvin: Option<Slope>,
    /// Both were determined together, each with the other held; otherwise each alone, as if the other had no influence.
    pub together: bool,
    /// Standard deviation from run to run that neither explains, beyond the values' own errors.
    pub scatter: f64,
}

/// Runs from which on a slope can be had.
const FEWEST: usize = 3;
/// Runs from which on two slopes can be had together.
const FEWEST_TOGETHER: usize = 5;
/// Standard deviation of the temperature from which on its influence can be had, K.
const LEAST_SPREAD_K: f64 = 0.3;
/// Correlation of run number and temperature from which on their influences cannot be separated.
const COLLINEAR: f64 = 0.95;
/// Confidence of intervals.
const LEVEL: f64 = 0.95;

/// Temperatures of all points, if all are known.
fn temperatures(points: &[Point]) -> Option<Vec<f64>> {
    points.iter().map(|p| p.temperature_degc).collect()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn centred(values: &[f64]) -> Vec<f64> {
    let mean = mean(values);
    values.iter().map(|v| v - mean).collect()
}

fn spread(values: &[f64]) -> f64 {
    let centred = centred(values);
    (centred.iter().map(|v| v * v).sum::<f64>() / (values.len() as f64 - 1.0)).sqrt()
}

fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let products: f64 = centred(a).iter().zip(centred(b)).map(|(a, b)| a * b).sum();
    products / ((a.len() as f64 - 1.0) * spread(a) * spread(b))
}

fn fit(points: &[Point], columns: &[&[f64]]) -> Option<Regression> {
    let ones = vec![1.0; points.len()];
    let columns: Vec<Vec<f64>> = [ones].into_iter().chain(columns.iter().map(|c| centred(c))).collect();
    let values: Vec<f64> = points.iter().map(|p| p.value).collect();
    let errors: Vec<f64> = points.iter().map(|p| p.standard_error).collect();
    Regression::fit(&columns, &values, &errors)
}

fn slope(fit: &Regression, coefficient: usize) -> Slope {
    let (value, half) = (fit.coefficients[coefficient], fit.half_width(coefficient, LEVEL));
    Slope { value, low: value - half, high: value + half }
}

/// The drift over these points; none while there are fewer than three.
pub fn drift(points: &[Point]) -> Option<Drift> {
    if points.len() < FEWEST {
        return None;
    }
    let runs: Vec<f64> = points.iter().map(|p| p.run).collect();
    let degc = temperatures(points);
    let warmed = degc.as_deref().filter(|t| spread(t) >= LEAST_SPREAD_K);
    let both = warmed.filter(|t| points.len() >= FEWEST_TOGETHER && correlation(&runs, t).abs() < COLLINEAR);
    let (mean_run, mean_degc) = (mean(&runs), degc.as_deref().map_or(f64::NAN, mean));
    if let Some(fit) = both.and_then(|t| fit(points, &[&runs, t])) {
        let (per_run, per_kelvin) = (Some(slope(&fit, 1)), Some(slope(&fit, 2)));
        let mean = fit.coefficients[0];
        return Some(Drift { mean, mean_run, mean_degc, per_run, per_kelvin, together: true, scatter: fit.scatter });
    }
    let over_runs = fit(points, &[&runs])?;
    let over_kelvin = warmed.and_then(|t| fit(points, &[t]));
    let scatter = over_kelvin.as_ref().map_or(over_runs.scatter, |k| k.scatter.min(over_runs.scatter));
    Some(Drift {
        mean: over_runs.coefficients[0],
        mean_run,
        mean_degc,
        per_run: Some(slope(&over_runs, 1)),
        per_kelvin: over_kelvin.as_ref().map(|k| slope(k, 1)),
        together: false,
        scatter,
    })
}

/// What the history says that a new value should be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Expected {
    /// The value.
    pub value: f64,
    /// Half the width of the interval that holds a new one.
    pub half_width: f64,
}

impl Expected {
    /// Whether a value is what was to be expected.
    pub fn holds(&self, value: f64) -> bool {
        (value - self.value).abs() <= self.half_width
    }
}

/// What to expect of a value with this standard error in a run at this temperature, with a probability of `level`,
/// after `earlier` runs; none after fewer than three. From five runs at different temperatures on, the temperature's
/// influence is taken out.
pub fn expected(earlier: &[Point], temperature_degc: Option<f64>, standard_error: f64, level: f64) -> Option<Expected> {
    if earlier.len() < FEWEST {
        return None;
    }
    let degc = temperatures(earlier).filter(|t| earlier.len() >= FEWEST_TOGETHER && spread(t) >= LEAST_SPREAD_K);
    let (value, half_width) = match degc.zip(temperature_degc) {
        Some((known, now)) => fit(earlier, &[&known])?.predict(&[1.0, now - mean(&known)], standard_error, level),
        None => fit(earlier, &[])?.predict(&[1.0], standard_error, level),
    };
    Some(Expected { value, half_width })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Runs of a rig whose wave speed falls by 2 m/s per kelvin and rises by 0.1 m/s a run.
    fn points(temperatures: &[f64]) -> Vec<Point> {
        let of = |(i, t): (usize, &f64)| Point {
            run: (i + 1) as f64,
            temperature_degc: Some(*t),
            value: 395.0 - 2.0 * (t - 20.0) + 0.1 * i as f64 + if i % 2 == 0 { 0.02 } else { -0.02 },
            standard_error: 0.05,
        };
        temperatures.iter().enumerate().map(of).collect()
    }

    #[test]
    fn time_and_temperature_are_told_apart() {
        let drift = drift(&points(&[20.0, 24.0, 18.0, 26.0, 21.0, 19.0, 25.0, 20.0])).unwrap();
        let (run, kelvin) = (drift.per_run.unwrap(), drift.per_kelvin.unwrap());
        assert!(drift.together && run.stands_out() && kelvin.stands_out());
        assert!(run.low < 0.1 && 0.1 < run.high && run.high - run.low < 0.1, "{run:?}");
        assert!(kelvin.low < -2.0 && -2.0 < kelvin.high, "{kelvin:?}");
    }

    #[test]
    fn what_rises_with_the_runs_is_not_told_apart_from_them() {
        let drift = drift(&points(&[18.0, 19.0, 20.0, 21.0, 22.0, 23.0])).unwrap();
        assert!(!drift.together);
        assert!((drift.per_run.unwrap().value + 1.9).abs() < 0.05);
        assert!((drift.per_kelvin.unwrap().value + 1.9).abs() < 0.05);
    }

    #[test]
    fn a_constant_temperature_has_no_influence_to_show() {
        let drift = drift(&points(&[20.0, 20.1, 19.9, 20.0])).unwrap();
        assert!(drift.per_kelvin.is_none() && drift.per_run.is_some());
        assert!(super::drift(&points(&[20.0, 21.0])).is_none());
    }

    #[test]
    fn a_warm_run_is_within_a_history_that_knows_temperatures_and_an_odd_one_is_not() {
        let history = points(&[20.0, 24.0, 18.0, 26.0, 21.0, 19.0]);
        let warm = expected(&history, Some(28.0), 0.05, 0.99).unwrap();
        assert!(warm.holds(395.0 - 16.0 + 0.3), "{warm:?}");
        assert!(!warm.holds(395.0), "the value of a cold run: {warm:?}");
        assert!(expected(&history[..2], Some(20.0), 0.05, 0.99).is_none());
        let short = expected(&history[..3], Some(20.0), 0.05, 0.99).unwrap();
        assert!(
            short.holds(395.0) && short.half_width > 10.0,
            "three runs at several temperatures know little: {short:?}"
        );
    }
}
