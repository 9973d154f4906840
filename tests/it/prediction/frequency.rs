//! The frequency response against exact solutions, and calibration by frequency against calibration in time.

use std::f64::consts::{PI, TAU};

use nalgebra::Complex;
use serde_json::Value;
use surgescope::fit::problem::objective::Objective;
use surgescope::fit::search::calibrate::calibrate;
use surgescope::fit::search::options::Options;
use surgescope::fit::validate::frequency::{SensorResponse, Traces, response, turned};
use surgescope::model::boundary::Closure;
use surgescope::model::effects::parse_list;
use surgescope::model::trace::Probe;
use surgescope::model::{Conditions, Model, Resolution, RunValues};
use surgescope::rig::Rig;

use super::{CREEP, NOISE_M, Noise, WAVE_SPEED, creeping, creeping_in, plastic};
use crate::common::{self, calibration, done, refused};

type C = Complex<f64>;
const G: f64 = 9.81;

fn rig(length_m: f64, diameter_mm: f64, wall_mm: f64, friction: &str) -> Rig {
    let text = format!(
        "name = \"r\"\n[fluid]\nname = \"water\"\ntemperature_degC = 20.0\n[[pipe]]\nname = \"main\"\nlength_m = {length_m}\n\
         inner_diameter_mm = {diameter_mm}\nwall_thickness_mm = {wall_mm}\nmaterial = \"HDPE\"\nconstraint = 1.0\n{friction}\n\
         [upstream]\nkind = \"reservoir\"\n[downstream]\nkind = \"valve\"\nclosing_time_s = 0.02\n\
         [[sensor]]\nname = \"P1\"\nkind = \"pressure\"\nposition_m = {length_m}\nunit = \"kPa\"\n"
    );
    Rig::from_toml(&text, "r.toml").unwrap()
}

/// Head at the valve after a flow that falls along a raised cosine, and its times.
fn rung(
    rig: &Rig,
    effects: &str,
    shared: &[f64],
    velocity: f64,
    closing_time_s: f64,
    duration_s: f64,
) -> (Vec<f64>, Vec<f64>) {
    let water = rig.fluid.properties(20.0);
    let mut model = Model::new(rig, &water, &parse_list(effects).unwrap());
    model.closure = |closing_time_s| Closure::FlowRamp { closing_time_s };
    let run = RunValues { initial_velocity_m_s: velocity, valve_head_m: 200.0, closing_time_s, friction_scale: 1.0 };
    let conditions = Conditions::of(water);
    let resolution = Resolution { reaches: 400, duration_s };
    let probes = [Probe::head(rig.length_m())];
    let trace = model.simulate(&conditions, shared, &run, resolution, &probes).unwrap().traces.remove(0);
    let time_s: Vec<f64> = (0..(duration_s * 2000.0) as usize).map(|i| i as f64 / 2000.0).collect();
    let head = time_s.iter().map(|&t| trace.at(t)).collect();
    (time_s, head)
}

fn seen(time_s: &[f64], head_m: &[f64], period_s: f64, closing_s: f64, noise_m: f64) -> SensorResponse {
    let traces = Traces { name: "P1", file: "r", time_s, measured_m: head_m, model_m: None, noise_m };
    response(&traces, period_s, closing_s).unwrap()
}

/// A pipe without friction and creep between a reservoir and a closed valve rings at odd multiples of a/4L and at
/// nothing else, with the strengths of a square wave: 4/(nπ) of Joukowsky's head, and less as the closure is slower.
#[test]
fn an_elastic_pipe_has_exact_odd_harmonics() {
    let rig = rig(100.0, 50.0, 5.0, "friction_factor = 0.0");
    let (speed, velocity, closing_s) = (1000.0, 0.5, 0.02);
    let (time_s, head_m) = rung(&rig, "none", &[speed], velocity, closing_s, 8.0);
    let found = seen(&time_s, &head_m, 0.4, closing_s, 1e-3);
    assert!(found.harmonics.len() >= 10);
    for (k, h) in found.harmonics.iter().take(10).enumerate() {
        assert_eq!(h.number, 2 * k + 1);
        assert!((h.ideal_hz - h.number as f64 * speed / 400.0).abs() < 1e-12 && h.shift.abs() < 2e-4, "{h:?}");
        // L{-V'/V0} of a raised cosine at iω: cos(ωTc/2)/(1 - (ωTc/π)²).
        let x = TAU * h.ideal_hz * closing_s;
        let ramp = (0.5 * x).cos() / (1.0 - (x / PI).powi(2));
        let exact = 4.0 / (h.number as f64 * PI) * speed * velocity / G * ramp.abs();
        assert!((h.record.amplitude / exact - 1.0).abs() < 0.01, "{h:?} {exact}");
    }
    for even in [2.0, 4.0, 6.0, 8.0] {
        let between = found.record.at(even * 2.5).amplitude;
        assert!(between < 0.01 * found.harmonics[0].record.amplitude, "{even}: {between}");
    }
}

/// Roots of a polynomial, coefficients from the highest down: Durand & Kerner.
fn roots(coefficients: &[f64]) -> Vec<C> {
    let n = coefficients.len() - 1;
    let monic: Vec<f64> = coefficients.iter().map(|c| c / coefficients[0]).collect();
    let size = monic.iter().enumerate().skip(1).map(|(k, c)| c.abs().powf(1.0 / k as f64)).fold(0.0, f64::max);
    let mut roots: Vec<C> = (0..n).map(|k| C::from_polar(size, 0.4 + TAU * k as f64 / n as f64)).collect();
    for _ in 0..500 {
        for i in 0..n {
            let value = monic.iter().fold(C::from(0.0), |sum, &c| sum * roots[i] + c);
            let others = (0..n).filter(|j| *j != i).fold(C::from(1.0), |p, j| p * (roots[i] - roots[j]));
            let step = value / others;
            roots[i] -= step;
        }
    }
    roots
}

/// A pipe with laminar friction and one Kelvin-Voigt element, by the poles and residues of its transfer function
/// `dH(L,s) = V0 (s+R)/(g γ s) tanh(γL) L{-V'/V0}·s/s`, `γ² = s (s+R) χ/a²`, `χ = 1 + F J/(1+sτ)`, `R = 32ν/D²`: cosh
/// γL vanishes where `(s²+Rs)(1+sτ+FJ) + Ω²(1+sτ) = 0`, `Ω = aπ(2n-1)/2L`.
#[test]
fn a_creeping_pipe_with_friction_agrees_with_its_transfer_function() {
    let (length, diameter, wall, speed, velocity, closing_s) = (60.0, 0.010, 0.0015, 350.0, 0.15, 0.03);
    let (j_per_gpa, tau) = (0.05, 0.04);
    let rig = rig(length, diameter * 1e3, wall * 1e3, "");
    let water = rig.fluid.properties(20.0);
    let nu = water.kinematic_viscosity_m2_s;
    assert!(velocity * diameter / nu < 2000.0, "laminar");
    let (time_s, head_m) = rung(&rig, "viscoelastic-wall:1", &[speed, j_per_gpa, tau], velocity, closing_s, 12.0);
    let period_s = 4.0 * length / speed;
    let found = seen(&time_s, &head_m, period_s, closing_s, 1e-3);

    let friction = 32.0 * nu / diameter.powi(2);
    let creep = speed.powi(2) * water.density_kg_m3 * diameter / wall * j_per_gpa * 1e-9;
    let mut modes: Vec<(C, C)> = Vec::new();
    let mut frequencies = Vec::new();
    for n in 1..=150 {
        let square = (speed * PI * f64::from(2 * n - 1) / (2.0 * length)).powi(2);
        let cubic = [tau, 1.0 + creep + friction * tau, friction * (1.0 + creep) + square * tau, square];
        for s in roots(&cubic) {
            let one = C::from(1.0);
            let relaxed = (one + s * tau).inv();
            let (chi, slope) = (one + relaxed * creep, -relaxed * relaxed * (creep * tau));
            let gamma_square_slope = ((s * 2.0 + friction) * chi + s * (s + friction) * slope) / speed.powi(2);
            let w = PI / closing_s;
            let ramp = (one + (-s * closing_s).exp()) * (0.5 * w * w) / (s * s + w * w);
            modes.push((s, (s + friction) * ramp * (2.0 * velocity) / (s * gamma_square_slope * (G * length))));
            if s.im > 1e-6 {
                frequencies.push(s.im / TAU);
            }
        }
    }
    // The windowed transform of the exact head, by a sum of this test's own.
    let inside: Vec<f64> = time_s.iter().copied().filter(|t| *t >= closing_s).collect();
    let head: Vec<f64> = inside.iter().map(|&t| modes.iter().map(|(s, r)| (r * (s * t).exp()).re).sum()).collect();
    let weights: Vec<f64> = inside.iter().map(|&t| found.window.weight(t)).collect();
    let whole: f64 = weights.iter().sum();
    let mean = head.iter().zip(&weights).map(|(h, w)| h * w).sum::<f64>() / whole;
    assert!(found.harmonics.len() >= 5, "{}", found.harmonics.len());
    for (h, natural_hz) in found.harmonics.iter().zip(&frequencies).take(6) {
        let turn = |t: f64| C::from_polar(2.0 / whole, -TAU * h.record.frequency_hz * (t - found.window.from_s));
        let exact: C = (inside.iter().zip(&head).zip(&weights)).map(|((&t, v), w)| turn(t) * ((v - mean) * w)).sum();
        assert!((h.record.amplitude / exact.norm() - 1.0).abs() < 0.01, "{h:?} {}", exact.norm());
        assert!(turned(h.record.phase_rad, exact.arg()).abs() < 0.02, "{h:?} {}", exact.arg());
        assert!((h.record.frequency_hz / natural_hz - 1.0).abs() < 0.01, "{h:?} {natural_hz}");
        assert!(h.shift < 0.0 && *natural_hz < h.ideal_hz, "creep lowers every harmonic: {h:?}");
    }
}

/// Both misfits find the truth, and both models leave the noise.
#[test]
fn calibration_by_frequency_finds_what_calibration_in_time_finds() {
    let rig = plastic();
    let runs = [creeping(&rig, "run", 0.4, 0.1)];
    let effects = parse_list("viscoelastic-wall:1").unwrap();
    for misfit in [Objective::Time, Objective::Frequency] {
        let options = Options { objective: misfit, most_reaches: 128, ..Options::default() };
        let fit = calibrate(&rig, &runs, &effects, &options, &|_| {}).unwrap();
        assert!(fit.runs[0].rmse_m < 1.1 * NOISE_M, "{misfit:?}: {}", fit.runs[0].rmse_m);
        for (p, exact) in fit.parameters.iter().zip([WAVE_SPEED, CREEP.0, CREEP.1]) {
            let off = (p.value - exact).abs();
            assert!(
                off < 4.0 * p.standard_error() + 2e-3 * exact,
                "{misfit:?} {}: {}({})",
                p.name,
                p.value,
                p.standard_error()
            );
            assert!(p.standard_error() < 0.05 * exact, "{misfit:?} {}: {}", p.name, p.standard_error());
        }
    }
}

/// The shipped record against a fitted model: the model has the harmonics where the record has them, the base model has
/// not.
#[test]
fn the_view_shows_where_a_model_has_its_harmonics() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let own = common::CREEP;
    let view = |effects: &str| -> Value {
        let model = path(&format!("{}.toml", effects.split(':').next().unwrap()));
        let fit = calibration(&[own, "--effects", effects, "--most-reaches", "64"]);
        std::fs::write(&model, &fit.file).unwrap();
        let (page, picture) = (path("page.html"), path("picture.svg"));
        let answer = done(&["frequency", own, "--model", &model, "--report", &page, "--svg", &picture]);
        assert!(std::fs::read_to_string(&page).unwrap().contains("amplitude, m"));
        assert!(std::fs::read_to_string(&picture).unwrap().matches("<svg").count() == 3);
        answer
    };
    let off = |answer: &Value| -> f64 {
        let all = answer["sensors"][0]["harmonics"].as_array().unwrap();
        assert!(all.len() >= 3 && all[0]["number"] == 1);
        let first = &all[0];
        let ratio = first["model"]["amplitude_m"].as_f64().unwrap() / first["record"]["amplitude_m"].as_f64().unwrap();
        // Units stand in the keys, and the shift is the percent of the table.
        let hertz = |v: &Value| v.as_f64().unwrap();
        let shift = 100.0 * (hertz(&first["record"]["frequency_hz"]) / hertz(&first["ideal_hz"]) - 1.0);
        assert!((first["shift_percent"].as_f64().unwrap() - shift).abs() < 1e-9 && shift.abs() > 0.05, "{first}");
        (ratio - 1.0).abs()
    };
    let (wall, base, alone) = (view("viscoelastic-wall:2"), view("none"), done(&["frequency", own]));
    assert!(off(&wall) < 0.01);
    assert!(off(&base) > 0.05);
    // What the record has is the same, whatever the model.
    let of_record = |answer: &Value| {
        let harmonics = |sensor: &Value| sensor["harmonics"].as_array().unwrap().clone();
        let kept = |h: &Value| ["number", "ideal_hz", "shift_percent", "record"].map(|key| h[key].clone());
        let sensors = answer["sensors"].as_array().unwrap();
        sensors.iter().flat_map(harmonics).map(|h| kept(&h)).collect::<Vec<_>>()
    };
    assert_eq!(of_record(&wall), of_record(&alone));
    assert_eq!(of_record(&base), of_record(&alone));
    // A model whose recordings are gone may be of another pipe.
    let moved = path("moved.toml");
    let model = std::fs::read_to_string(path("none.toml")).unwrap();
    std::fs::write(&moved, model.replace("hdpe-creep.mcap", "gone.mcap")).unwrap();
    refused(&["frequency", own, "--model", &moved], &["cannot be read", "--other-rig"]);
    assert!(alone["effects"].is_null() && alone["sensors"].as_array().unwrap().len() == 3);
    assert!(alone["sensors"][0]["harmonics"][0]["model"].is_null());
    refused(&["calibrate", own, "--misfit", "frequency", "--method", "global"], &[]);
}

/// In coloured noise the errors of a fit of frequencies are those that it makes: over eight draws, true values are as
/// far off as errors say.
#[test]
fn a_fit_of_frequencies_knows_the_colour_of_the_noise() {
    let rig = plastic();
    let options = Options { objective: Objective::Frequency, most_reaches: 64, ..Options::default() };
    let effects = parse_list("viscoelastic-wall:1").unwrap();
    let mut squares = Vec::new();
    for seed in 1..=8 {
        let noise = Noise { white_m: 0.02, carried: 0.95, seed };
        let fit = calibrate(&rig, &[creeping_in(noise, &rig, "run", 0.4, 0.1)], &effects, &options, &|_| {}).unwrap();
        let truth = [WAVE_SPEED, CREEP.0, CREEP.1];
        squares.extend(fit.parameters.iter().zip(truth).map(|(p, t)| ((p.value - t) / p.standard_error()).powi(2)));
    }
    let rms = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
    assert!((0.5..1.5).contains(&rms), "{rms}");
}
