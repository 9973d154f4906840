//! The error of a whole fit against the noise, and what follows from it in one sentence.

use crate::fit::outcome::fit::{Fit, RunFit, SensorFit};
use crate::report::Stage;
use crate::report::text::number::{error_m, times};

/// RMSE within this factor of the noise counts as noise: the estimate of the noise is no better.
pub(crate) const DOWN_TO_NOISE: f64 = 1.25;
/// RMSE within this factor of the noise cannot be distinguished from noise; between the two factors it may be, or
/// something small is missing.
const AT_NOISE: f64 = 1.1;
/// RMSE beyond this factor of the noise means that something is missing.
const SOMETHING_MISSING: f64 = 2.0;

/// Error and noise over all samples of all runs, m; NaN where there are none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Overall {
    /// Root mean square of model − measured.
    pub rmse_m: f64,
    /// Root mean square of the sensors' noise.
    pub noise_m: f64,
    /// What a model that lacks nothing leaves: the noise, and the error of the grid where that is not small against it.
    pub floor_m: f64,
    /// Samples.
    pub samples: usize,
}

/// Pools the runs of a fit, each weighted by its samples.
pub fn overall(fit: &Fit) -> Overall {
    let (rmse_m, noise_m) = fit.pooled();
    // Where the noise is not known there is no floor either.
    let floor_m = if noise_m > 0.0 { noise_m.hypot(2.0 * fit.grid_error_m) } else { noise_m };
    Overall { rmse_m, noise_m, floor_m, samples: fit.samples() }
}

/// How near a model is to what the recording can tell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Closeness {
    /// The error is the noise.
    Noise,
    /// A little above it.
    Near,
    /// Well above it.
    Missing,
    /// Error or noise are not known.
    Unknown,
}

/// Judges an error against the noise.
pub fn closeness(rmse_m: f64, noise_m: f64) -> Closeness {
    let ratio = rmse_m / noise_m;
    match ratio {
        r if noise_m <= 0.0 || !r.is_finite() => Closeness::Unknown,
        r if r <= DOWN_TO_NOISE => Closeness::Noise,
        r if r <= SOMETHING_MISSING => Closeness::Near,
        _ => Closeness::Missing,
    }
}

/// Judges a whole fit: its error over all samples, and no sensor may hide well above its noise among good ones. One
/// that did not end at an optimum says nothing.
pub fn judge(fit: &Fit) -> Closeness {
    if !fit.converged {
        return Closeness::Unknown;
    }
    let all = overall(fit);
    match closeness(all.rmse_m, all.floor_m) {
        Closeness::Noise if worst_sensor(fit).is_some() => Closeness::Near,
        closeness => closeness,
    }
}

/// Whether nothing of the error can be distinguished from noise.
pub(crate) fn is_noise(fit: &Fit) -> bool {
    let all = overall(fit);
    judge(fit) == Closeness::Noise && all.rmse_m <= AT_NOISE * all.floor_m
}

/// One sentence: `RMSE 1.92 m → 0.032 m, noise 0.030 m: the model is down to the noise.`
pub fn verdict(stages: &[Stage]) -> String {
    let Some(last) = stages.last() else {
        return "Nothing has been calibrated yet.".into();
    };
    let end = overall(last.fit);
    if end.samples == 0 {
        return "The calibration has no samples of a pressure sensor: the model cannot be judged.".into();
    }
    if !end.rmse_m.is_finite() {
        return "The error of the model is not a number: the model failed, or samples of the recording are not numbers.".into();
    }
    // the first of several is what the last is compared with; it is a step only where it goes down
    let first = stages.first().filter(|_| stages.len() > 1).map(|stage| (&stage.title, overall(stage.fit).rmse_m));
    let falls = first.is_some_and(|(_, rmse_m)| rmse_m > end.rmse_m);
    let own = error_m(end.rmse_m);
    let error = match first {
        Some((_, rmse_m)) if falls => format!("RMSE {} m → {own} m", error_m(rmse_m)),
        Some((title, rmse_m)) => format!("RMSE {own} m ({title}: {} m)", error_m(rmse_m)),
        None => format!("RMSE {own} m"),
    };
    if !last.fit.converged {
        let noise = if end.noise_m > 0.0 { format!(", noise {} m", error_m(end.noise_m)) } else { String::new() };
        return format!("{error}{noise}; no verdict on the model: {}.", last.fit.stopped_because);
    }
    let ratio = times(end.rmse_m, end.noise_m);
    let meaning = match closeness(end.rmse_m, end.floor_m) {
        Closeness::Noise => match worst_sensor(last.fit) {
            None if end.rmse_m > AT_NOISE * end.floor_m => {
                format!("{ratio}× the noise; `surgescope diagnose` finds out whether something small is missing")
            }
            None => "the model is down to the noise".into(),
            Some((name, r)) => format!("the model is down to the noise, except at {name} ({r}× its noise)"),
        },
        Closeness::Near => format!("{ratio}× the noise, the model lacks something small"),
        Closeness::Missing if falls => format!("still {ratio}× the noise, something is missing"),
        Closeness::Missing => format!("{ratio}× the noise, something is missing"),
        Closeness::Unknown => {
            return format!("{error}; the noise is not known, so the error cannot be judged against it.");
        }
    };
    format!("{error}, noise {} m: {meaning}.", error_m(end.noise_m))
}

/// The sensor with the largest error in its own noise and that ratio, if something is missing there.
fn worst_sensor(fit: &Fit) -> Option<(String, String)> {
    let ratio = |s: &SensorFit| s.rmse_m / s.noise_m;
    let place = |r: &RunFit, s: &SensorFit| match fit.runs.len() {
        1 => s.name.clone(),
        _ => format!("{} of {}", s.name, r.file),
    };
    fit.runs
        .iter()
        .flat_map(|r| r.sensors.iter().map(move |s| (r, s)))
        .filter(|(_, s)| closeness(s.rmse_m, s.noise_m) == Closeness::Missing)
        .max_by(|(_, a), (_, b)| ratio(a).total_cmp(&ratio(b)))
        .map(|(r, s)| (place(r, s), times(s.rmse_m, s.noise_m)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fit(runs: &[(f64, f64, usize)]) -> Fit {
        let run = |&(rmse_m, noise_m, n): &(f64, f64, usize)| RunFit {
            file: "a".into(),
            rmse_m,
            noise_m,
            mape_extrema_percent: 0.0,
            noise_dies_away: false,
            meter_flow_m3_s: None,
            sensors: vec![SensorFit {
                name: "P1".into(),
                position_m: 0.0,
                time_s: vec![0.0; n],
                measured_m: vec![0.0; n],
                model_m: vec![0.0; n],
                band_m: Vec::new(),
                noise_m,
                white_noise_m: noise_m,
                rmse_m,
                start_rmse_m: 2.0,
                before_m: None,
                extrema: vec![],
            }],
        };
        Fit {
            effects: vec![],
            runs: runs.iter().map(run).collect(),
            parameters: vec![],
            correlation: vec![],
            unidentifiable: vec![],
            reaches: 64,
            grid_error_m: 0.001,
            evaluations: 0,
            seconds: 0.0,
            steps: vec![],
            stopped_because: String::new(),
            converged: true,
            cost: 0.0,
            predicted_reduction: 0.0,
            posterior: None,
            features_left: vec![],
            method: crate::fit::problem::method::Method::default(),
        }
    }

    fn say(fits: &[&Fit]) -> String {
        let stages: Vec<Stage> = fits.iter().map(|&fit| Stage { title: "+ leak".into(), fit }).collect();
        verdict(&stages)
    }

    #[test]
    fn runs_are_pooled_by_their_samples() {
        let all = overall(&fit(&[(3.0, 0.1, 100), (4.0, 0.1, 300), (f64::NAN, f64::NAN, 0)]));
        assert!((all.rmse_m - (0.25f64 * 9.0 + 0.75 * 16.0).sqrt()).abs() < 1e-12);
        assert_eq!(all.samples, 400);
    }

    #[test]
    fn the_verdict_says_what_is_left() {
        let (bad, good, mid) = (fit(&[(1.92, 0.03, 9)]), fit(&[(0.032, 0.03, 9)]), fit(&[(0.045, 0.03, 9)]));
        assert_eq!(say(&[&bad, &good]), "RMSE 1.92 m → 0.032 m, noise 0.030 m: the model is down to the noise.");
        let open = say(&[&bad, &fit(&[(0.036, 0.03, 9)])]);
        assert!(
            open.ends_with("1.2× the noise; `surgescope diagnose` finds out whether something small is missing."),
            "{open}"
        );
        assert_eq!(say(&[&bad]), "RMSE 1.92 m, noise 0.030 m: 64× the noise, something is missing.");
        assert_eq!(
            say(&[&bad, &mid]),
            "RMSE 1.92 m → 0.045 m, noise 0.030 m: 1.5× the noise, the model lacks something small."
        );
        let less = fit(&[(1.0, 0.03, 9)]);
        assert!(say(&[&bad, &less]).contains("still 33× the noise"), "{}", say(&[&bad, &less]));
        // compared with a better model, it is no step
        assert_eq!(
            say(&[&good, &bad]),
            "RMSE 1.92 m (+ leak: 0.032 m), noise 0.030 m: 64× the noise, something is missing."
        );
    }

    #[test]
    fn a_bad_sensor_does_not_hide_among_good_ones() {
        let mixed = fit(&[(0.03, 0.03, 10_000), (0.1, 0.03, 10)]);
        assert!(say(&[&mixed]).contains("except at P1 of a (3.3× its noise)"), "{}", say(&[&mixed]));
        assert_eq!(judge(&mixed), Closeness::Near);
        assert_eq!(judge(&fit(&[(0.03, 0.03, 10)])), Closeness::Noise);
    }

    #[test]
    fn nothing_known_is_said_plainly() {
        assert_eq!(say(&[]), "Nothing has been calibrated yet.");
        assert!(say(&[&fit(&[])]).contains("no samples"));
        assert!(say(&[&fit(&[(1.0, 0.0, 5)])]).contains("noise is not known"));
        assert!(say(&[&fit(&[(f64::NAN, 0.1, 5)])]).contains("not a number"));
    }

    #[test]
    fn what_ended_at_no_optimum_is_not_judged() {
        for rmse_m in [0.1, 1.0] {
            let mut one = fit(&[(rmse_m, 0.1, 5)]);
            one.converged = false;
            one.stopped_because = "the budget ran out".into();
            let said = say(&[&one]);
            assert!(said.ends_with("no verdict on the model: the budget ran out."), "{said}");
            assert!(!said.contains("missing") && !said.contains("down to"), "{said}");
            assert_eq!(judge(&one), Closeness::Unknown);
        }
    }
}
