//! Bands, predictions of other runs, cross-validation.

use surgescope::fit::outcome::fit::Fit;
use surgescope::fit::search::calibrate::calibrate;
use surgescope::fit::search::options::Options;
use surgescope::fit::validate::cross_validate::{By, CrossValidation, Fold, cross_validate};
use surgescope::fit::validate::predict::{Known, predict};
use surgescope::model::effects::parse_list;
use surgescope::report::prediction::cross_validation::comparison;
use surgescope::report::prediction::text::{Ahead, ahead, verdict};
use surgescope::report::view::summary;
use surgescope::report::view::summary::Closeness;

use super::{NOISE_M, Noise, creeping, creeping_in, plastic};
use crate::common::{self, Made, calibration, done, refused};

fn inside(fit: &Fit) -> Vec<f64> {
    fit.runs.iter().flat_map(|r| &r.sensors).map(|s| s.inside_band().unwrap()).collect()
}

/// A model of one flow predicts another flow and another closing time down to the noise if its physics is whole, and
/// does not if it is not.
#[test]
fn a_model_of_one_flow_predicts_another() {
    let rig = plastic();
    let (one, other) = ([creeping(&rig, "slow", 0.25, 0.09)], [creeping(&rig, "fast", 0.55, 0.13)]);
    let options = Options { most_reaches: 128, ..Options::default() };
    let whole = parse_list("viscoelastic-wall:1").unwrap();
    let fit = calibrate(&rig, &one, &whole, &options, &|_| {}).unwrap();
    assert!(inside(&fit).iter().all(|share| (0.94..0.96).contains(share)), "{:?}", inside(&fit));
    let predicted = predict(&rig, &other, &Known::of(&fit), &[], &options, &|_| {}).unwrap();
    let Ahead { error_m: error, noise_m: noise, .. } = ahead(&predicted);
    assert!(error < 1.15 * noise && (noise - NOISE_M).abs() < 1e-9, "{error}");
    assert!(verdict(&predicted).contains("down to the noise"), "{}", verdict(&predicted));
    assert!(inside(&predicted.fit).iter().all(|share| (0.9..0.98).contains(share)), "{:?}", inside(&predicted.fit));
    let value = |name: &str| predicted.fit.parameters.iter().find(|p| p.name == name).unwrap();
    assert!((value("closing_time_s").value - 0.13).abs() < 0.01 && !value("closing_time_s").held);
    assert!(value("wave_speed_m_s").held && value("wave_speed_m_s").value == fit.parameters[0].value);
    // All of it lies after 2L/a, some half a second.
    assert!((0.4..0.6).contains(&predicted.known_until_s), "{}", predicted.known_until_s);

    let poor = calibrate(&rig, &one, &[], &options, &|_| {}).unwrap();
    assert!(inside(&poor).iter().all(|share| *share < 0.7), "{:?}", inside(&poor));
    let predicted = predict(&rig, &other, &Known::of(&poor), &[], &options, &|_| {}).unwrap();
    assert!(
        ahead(&predicted).error_m > 20.0 * noise && verdict(&predicted).contains("does not hold"),
        "{}",
        verdict(&predicted)
    );
}

/// A true model whose values come from a noisy record errs more than a quiet sensor's noise where it predicts: as much
/// as it says.
#[test]
fn a_true_model_that_is_poorly_known_is_not_called_wrong() {
    let rig = plastic();
    let noise = |white_m, seed| Noise { white_m, carried: 0.0, seed };
    let options = Options { most_reaches: 128, ..Options::default() };
    let effects = parse_list("viscoelastic-wall:1").unwrap();
    for seed in [1, 2, 3] {
        let noisy = [creeping_in(noise(0.4, seed), &rig, "noisy", 0.25, 0.09)];
        let quiet = [creeping_in(noise(0.003, seed + 10), &rig, "quiet", 0.55, 0.13)];
        let fit = calibrate(&rig, &noisy, &effects, &options, &|_| {}).unwrap();
        let predicted = predict(&rig, &quiet, &Known::of(&fit), &[], &options, &|_| {}).unwrap();
        let Ahead { error_m, noise_m, expected_m } = ahead(&predicted);
        assert!(error_m > 2.0 * noise_m && error_m < 3.0 * expected_m, "{error_m} {noise_m} {expected_m}");
        assert!(!verdict(&predicted).contains("does not hold"), "{}", verdict(&predicted));
        let speed = predicted.fit.parameters.iter().find(|p| p.name == "wave_speed_m_s").unwrap();
        let half = 0.5 * (speed.interval_95.1 - speed.interval_95.0);
        assert!(speed.held && (half / (1.96 * fit.parameters[0].standard_error()) - 1.0).abs() < 1e-3, "{speed:?}");
    }
}

/// The true model in coloured noise leaves just that noise: neither a fit nor a prediction nor a fold left out speaks
/// of missing physics.
#[test]
fn coloured_noise_is_noise() {
    let rig = plastic();
    let noise = |seed| Noise { white_m: 0.02, carried: 0.9, seed };
    let runs = [creeping_in(noise(1), &rig, "one", 0.25, 0.09), creeping_in(noise(2), &rig, "other", 0.55, 0.13)];
    let options = Options { most_reaches: 128, ..Options::default() };
    let effects = parse_list("viscoelastic-wall:1").unwrap();
    let fit = calibrate(&rig, &runs[..1], &effects, &options, &|_| {}).unwrap();
    assert_eq!(summary::judge(&fit), Closeness::Noise);
    let predicted = predict(&rig, &runs[1..], &Known::of(&fit), &[], &options, &|_| {}).unwrap();
    assert!(verdict(&predicted).contains("down to the noise"), "{}", verdict(&predicted));
    let left_out = cross_validate(&rig, &runs, &effects, &[By::Runs], &options, &|_| {}).unwrap();
    assert!(left_out.pooled(By::Runs).unwrap().held_out_over_noise < 1.25);
}

/// A quiet run among noisy ones counts as much as they do.
#[test]
fn folds_are_pooled_in_units_of_their_own_noise() {
    let fold = |held_out_m, noise_m| Fold {
        by: By::Runs,
        left_out: "r".into(),
        samples: 100,
        held_out_m,
        in_fit_m: noise_m,
        noise_m,
    };
    let fit =
        calibrate(&plastic(), &[creeping(&plastic(), "r", 0.25, 0.09)], &[], &Options::default(), &|_| {}).unwrap();
    let folds = vec![fold(0.4, 0.4), fold(0.05, 0.01)];
    let pooled = CrossValidation { fit, folds, skipped: vec![] }.pooled(By::Runs).unwrap();
    assert!((pooled.held_out_over_noise - 13.0f64.sqrt()).abs() < 1e-12, "{pooled:?}");
}

#[test]
fn cross_validation_tells_the_whole_model_from_the_poor_one() {
    let rig = plastic();
    let runs = [creeping(&rig, "slow", 0.25, 0.09), creeping(&rig, "fast", 0.55, 0.13)];
    let options = Options { most_reaches: 64, ..Options::default() };
    let all = [By::Sensors, By::Runs, By::Time];
    let of =
        |effects: &str| cross_validate(&rig, &runs, &parse_list(effects).unwrap(), &all, &options, &|_| {}).unwrap();
    let (whole, poor) = (of("viscoelastic-wall:1"), of("none"));
    let left_out: Vec<&str> = whole.folds.iter().map(|f| f.left_out.as_str()).collect();
    assert_eq!(left_out[..4], ["P1", "P2", "slow", "fast"]);
    assert_eq!(whole.folds.len(), 5);
    for by in all {
        let (good, bad) = (whole.pooled(by).unwrap(), poor.pooled(by).unwrap());
        assert!(good.held_out_m < 1.15 * NOISE_M && good.held_out_m >= 0.9 * good.in_fit_m, "{by:?} {good:?}");
        assert!(bad.held_out_m > 5.0 * NOISE_M, "{by:?} {bad:?}");
    }
    let words = comparison(&whole, &poor);
    assert!(words.len() == 3 && words.iter().all(|w| w.contains("viscoelastic-wall:1 predicts better")), "{words:?}");
    let alone = cross_validate(&rig, &runs[..1], &[], &[By::Runs, By::Time], &options, &|_| {}).unwrap();
    assert!(alone.folds.len() == 1 && alone.skipped[0].contains("single recording"), "{:?}", alone.skipped);
}

/// A model file predicts; another pipeline is refused unless that is asked for; the record it was fitted to is named.
#[test]
fn a_file_of_models_predicts_recordings_of_its_line_only() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (model, page) = (path("model.toml"), path("page.html"));
    let own = common::CREEP;
    let Made { answer: fit, file } = calibration(&[own, "--effects", "viscoelastic-wall:2", "--most-reaches", "64"]);
    std::fs::write(&model, file).unwrap();
    let share = fit["runs"][0]["sensors"][0]["inside_band_95"].as_f64().unwrap();
    assert!((0.9..0.99).contains(&share), "{share}");
    let answer = done(&["predict", &model, own, "--report", &page]);
    let [error, noise] = ["predicted_rmse_m", "noise_m"].map(|key| answer[key].as_f64().unwrap());
    assert!(error < 1.5 * noise, "{error} {noise}");
    assert!(answer["warnings"][0].as_str().unwrap().contains("was fitted to"), "{}", answer["warnings"]);
    let text = std::fs::read_to_string(&page).unwrap();
    assert!(text.contains("95% band") && text.contains("prediction"));
    let held = done(&["predict", &model, own, "--closing-time", "0.2"]);
    assert!(held["predicted_rmse_m"].as_f64().unwrap() > error, "a wrong closing time predicts worse");

    let other = common::NOTHING;
    refused(&["predict", &model, other, "--json"], &["another pipeline", "length 82.21 m, not 135.52"]);
    let forced = done(&["predict", &model, other, "--other-rig"]);
    assert!(forced["predicted_rmse_m"].as_f64().unwrap() > 5.0 * forced["noise_m"].as_f64().unwrap());
    refused(&["predict", &model, own, "--hold", "wave_speed_m_s=300"], &["is the model's, not the run's"]);
}
