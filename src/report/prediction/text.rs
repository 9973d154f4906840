//! A prediction as text and JSON: how far a model errs on recordings that it was not fitted to.

use serde::Serialize;

use crate::fit::outcome::fit::RunFit;
use crate::fit::problem::compare::mape_percent;
use crate::fit::validate::predict::Prediction;
use crate::report::calibration::text::parameters;
use crate::report::text::number::{error_m, fixed, significant, times};
use crate::report::text::table::Table;
use crate::report::view::summary::{Closeness, DOWN_TO_NOISE, closeness};
use crate::results::fit_record::{Parameter, Run as FittedRun};

/// What was predicted, rms over its samples, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ahead {
    /// Error.
    pub error_m: f64,
    /// Noise of the sensors.
    pub noise_m: f64,
    /// What a model that lacks nothing would err, its values known no better than they are.
    pub expected_m: f64,
}

/// Over all runs; NaN where nothing was predicted.
pub fn ahead(prediction: &Prediction) -> Ahead {
    pooled(prediction, &prediction.fit.runs)
}

fn pooled(prediction: &Prediction, runs: &[RunFit]) -> Ahead {
    let (mut square, mut noise, mut expected, mut samples) = (0.0, 0.0, 0.0, 0.0);
    for sensor in runs.iter().flat_map(|r| &r.sensors) {
        let n = sensor.time_s.iter().filter(|t| **t > prediction.known_until_s).count() as f64;
        if n > 0.0 {
            square += n * prediction.ahead_m(sensor).powi(2);
            noise += n * sensor.noise_m.powi(2);
            expected += n * prediction.expected_m(sensor).powi(2);
            samples += n;
        }
    }
    let [error_m, noise_m, expected_m] = [square, noise, expected].map(|sum| (sum / samples).sqrt());
    Ahead { error_m, noise_m, expected_m }
}

/// How near a prediction is to what its model can be asked for: noise, and the errors of the model's values.
pub fn judge(prediction: &Prediction) -> Closeness {
    let Ahead { error_m, expected_m, noise_m } = ahead(prediction);
    match closeness(error_m, expected_m) {
        Closeness::Near | Closeness::Missing => closeness(error_m, noise_m),
        known => known,
    }
}

/// The prediction in a sentence.
pub fn verdict(prediction: &Prediction) -> String {
    let Ahead { error_m: error, noise_m: noise, expected_m: expected } = ahead(prediction);
    let meaning = match judge(prediction) {
        Closeness::Unknown if error.is_finite() => {
            return format!(
                "Predicted to {} m; the noise is not known, so the error cannot be judged against it.",
                error_m(error)
            );
        }
        Closeness::Unknown => {
            return "All samples were needed to read the runs' own values: nothing was predicted.".to_owned();
        }
        Closeness::Noise if error <= DOWN_TO_NOISE * noise => "the model predicts down to the noise".to_owned(),
        Closeness::Noise => format!(
            "{}× the noise, as much as the uncertainty of its parameters explains ({} m): the model holds here as far as it is known",
            times(error, noise),
            error_m(expected)
        ),
        Closeness::Near => format!("{}× the noise, the model predicts nearly everything", times(error, noise)),
        Closeness::Missing => format!("{}× the noise, the model does not hold here", times(error, noise)),
    };
    format!("Predicted to {} m, noise {} m: {meaning}.", error_m(error), error_m(noise))
}

/// Verdict, errors by sensor, and the values that were used.
pub fn text(prediction: &Prediction) -> String {
    let mut table = Table::new(&[
        "run",
        "sensor",
        "<predicted, m",
        "<all, m",
        "<noise, m",
        "<predicted/noise",
        "<inside 95%",
        "<MAPE, %",
    ]);
    let percent = |value: f64| if value.is_finite() { significant(value, 2) } else { String::new() };
    for run in &prediction.fit.runs {
        for s in &run.sensors {
            let ahead = prediction.ahead_m(s);
            table.row([
                run.file.clone(),
                s.name.clone(),
                error_m(ahead),
                error_m(s.rmse_m),
                error_m(s.noise_m),
                times(ahead, s.noise_m),
                s.inside_band().map_or(String::new(), |share| format!("{}%", fixed(100.0 * share, 1))),
                percent(mape_percent(s.extrema.iter())),
            ]);
        }
    }
    format!(
        "{}\n\n{}predicted: RMSE of the samples later than {:.3} s after the start of the closure; from those before, the run's own values were read. \
         all: with those samples. MAPE: mean absolute error of the peaks and troughs.\n\nShared values come from the model, each run's own \
         from its signals:\n{}",
        verdict(prediction),
        table.without_empty_columns(),
        prediction.known_until_s,
        parameters(&prediction.fit)
    )
}

/// The document of `predict --json`.
#[derive(Debug, Serialize)]
pub struct Document<'a> {
    /// Effects of the model.
    pub effects: Vec<String>,
    /// In a sentence.
    pub verdict: String,
    /// Samples up to this time after the start of the closure told the runs' own values, s.
    pub known_until_s: f64,
    /// Error over the samples after that, m.
    pub predicted_rmse_m: f64,
    /// What a model that lacks nothing would err over them, its values known no better than they are, m.
    pub expected_rmse_m: f64,
    /// Noise of the same, m.
    pub noise_m: f64,
    /// Each run.
    pub runs: Vec<Run>,
    /// Shared parameters as the model has them, and the runs' own.
    pub parameters: Vec<Parameter>,
    /// What to know: differences of the rigs, temperatures, recordings that the model was fitted to.
    pub warnings: &'a [String],
}

/// One run, as in `calibrate --json`, with its error ahead.
#[derive(Debug, Serialize)]
pub struct Run {
    /// As in `calibrate --json`: errors over all samples.
    #[serde(flatten)]
    pub all: FittedRun,
    /// Error over the samples that were predicted, m.
    pub predicted_rmse_m: f64,
    /// The same by sensor, in the order of `sensors`.
    pub predicted_rmse_m_by_sensor: Vec<f64>,
}

/// A prediction as scripts see it.
pub fn document<'a>(prediction: &'a Prediction, warnings: &'a [String]) -> Document<'a> {
    let Ahead { error_m: predicted_rmse_m, noise_m, expected_m } = ahead(prediction);
    let run = |run: &RunFit| Run {
        all: run.into(),
        predicted_rmse_m: pooled(prediction, std::slice::from_ref(run)).error_m,
        predicted_rmse_m_by_sensor: run.sensors.iter().map(|s| prediction.ahead_m(s)).collect(),
    };
    Document {
        effects: prediction.fit.labels(),
        verdict: verdict(prediction),
        known_until_s: prediction.known_until_s,
        predicted_rmse_m,
        expected_rmse_m: expected_m,
        noise_m,
        runs: prediction.fit.runs.iter().map(run).collect(),
        parameters: prediction.fit.parameters.iter().map(Into::into).collect(),
        warnings,
    }
}
