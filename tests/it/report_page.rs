//! What people and scripts get of a calibration: the page, the JSON document, the terminal text.

use std::f64::consts::PI;
use std::path::Path;
use surgescope::fit::outcome::uncertainty::Uncertainty;

use serde_json::Value;
use surgescope::cli::console::advice::{self, Again};
use surgescope::fit::outcome::fit::{Fit, FittedParameter, RunFit, SensorFit};
use surgescope::fit::problem::compare::ExtremumError;
use surgescope::model::effects::{Chosen, parse_list};
use surgescope::report::Page;
use surgescope::report::calibration::text as table;
use surgescope::report::page::html;
use surgescope::report::{Overlay, Stage};
use surgescope::results::fit_record::FitRecord;
use surgescope::rig::{Constraint, Coupling, Fluid, Pipe, Rig, Sensor, SensorKind, Upstream, Valve};

/// Repeatable noise of standard deviation 1: a sum of uniforms from a small generator.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        let mut uniform = || {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 11) as f64 / (1u64 << 53) as f64
        };
        (0..12).map(|_| uniform()).sum::<f64>() - 6.0
    }
}

/// Head of a surge: odd harmonics of the period, the higher ones damped more, as in a pipe with a creeping wall.
fn surge(t: f64, position: f64, period_s: f64, damping: f64) -> f64 {
    let sum: f64 = (0..9)
        .map(|k| {
            let n = f64::from(2 * k + 1);
            let shape = (n * PI * position / 2.0).sin() * 8.0 / (PI * n).powi(2) * if k % 2 == 0 { 1.0 } else { -1.0 };
            shape * n * (-damping * n.powf(1.4) * t).exp() * (2.0 * PI * n * t / period_s).sin()
        })
        .sum();
    31.0 + 24.0 * sum / (1.0 + (-t / 0.05).exp())
}

const PERIOD_S: f64 = 2.75;
const NOISE_M: f64 = 0.03;

fn sensor_fit(name: &str, position: f64, samples: usize, seed: u64, model: impl Fn(f64) -> f64) -> SensorFit {
    let mut noise = Noise(seed);
    let truth = |t: f64| surge(t, position, PERIOD_S, 0.07);
    let time_s: Vec<f64> = (0..samples).map(|i| i as f64 * 18.5 / samples as f64).collect();
    let measured_m: Vec<f64> = time_s.iter().map(|&t| truth(t) + NOISE_M * noise.next()).collect();
    let model_m: Vec<f64> = time_s.iter().map(|&t| model(t)).collect();
    let square: f64 = measured_m.iter().zip(&model_m).map(|(y, m)| (y - m).powi(2)).sum();
    let half = PERIOD_S / 2.0;
    let extremum = |k: usize| {
        let (from, to) = (k as f64 * half, (k + 1) as f64 * half);
        let peak = k.is_multiple_of(2);
        let best = |values: &[f64]| {
            let inside = time_s.iter().zip(values).filter(|(t, _)| (from..to).contains(*t));
            inside.max_by(|a, b| if peak { a.1.total_cmp(b.1) } else { b.1.total_cmp(a.1) }).map(|(t, v)| (*t, *v))
        };
        let ((time_s, measured_m), (_, model_m)) = (best(&measured_m)?, best(&model_m)?);
        Some(ExtremumError { cycle: k / 2 + 1, peak, time_s, measured_m, model_m, phase_s: 0.0004 * (k as f64 - 3.0) })
    };
    SensorFit {
        name: name.into(),
        position_m: 271.6 * position,
        band_m: Vec::new(),
        noise_m: NOISE_M,
        white_noise_m: NOISE_M,
        rmse_m: (square / samples as f64).sqrt(),
        start_rmse_m: 2.0,
        before_m: None,
        extrema: (0..13).filter_map(extremum).collect(),
        time_s,
        measured_m,
        model_m,
    }
}

fn parameter(name: &str, value: f64, standard_error: f64, unit: &'static str) -> FittedParameter {
    FittedParameter {
        about: "speed of pressure waves",
        name: name.into(),
        run: None,
        value,
        uncertainty: Uncertainty::of(standard_error),
        unit,
        at_bound: false,
        ..FittedParameter::default()
    }
}

fn chosen(effects: &str) -> Vec<Chosen> {
    parse_list(effects).expect("effects of the catalogue")
}

fn fit(effects: &[&str], sensors: Vec<SensorFit>, parameters: Vec<FittedParameter>) -> Fit {
    let mean = |of: fn(&SensorFit) -> f64| {
        (sensors.iter().map(|s| of(s).powi(2)).sum::<f64>() / sensors.len().max(1) as f64).sqrt()
    };
    Fit {
        posterior: None,
        effects: chosen(&effects.join(",")),
        runs: vec![RunFit {
            file: "hdpe-50-run-03.mcap".into(),
            rmse_m: mean(|s| s.rmse_m),
            noise_m: mean(|s| s.noise_m),
            mape_extrema_percent: 0.41,
            noise_dies_away: false,
            meter_flow_m3_s: None,
            sensors,
        }],
        parameters,
        correlation: vec![],
        unidentifiable: vec![],
        reaches: 64,
        grid_error_m: 0.001,
        evaluations: 312,
        seconds: 0.41,
        steps: vec![],
        stopped_because: "the error no longer falls by more than a millionth".into(),
        converged: true,
        cost: 0.0,
        predicted_reduction: 0.0,
        features_left: vec![],
        method: surgescope::fit::problem::method::Method::default(),
    }
}

/// An elastic model that is too lively, and one with a creeping wall that is right.
fn two_stages(samples: usize) -> (Fit, Fit) {
    let places = [("P1", 1.0), ("P2", 0.67), ("P3", 0.33)];
    let sensors = |period: f64, damping: f64| {
        let each = |(i, (name, at)): (usize, (&str, f64))| {
            sensor_fit(name, at, samples, 7 + i as u64, move |t| surge(t, at, period, damping))
        };
        places.into_iter().enumerate().map(each).collect::<Vec<_>>()
    };
    let base = fit(
        &[],
        sensors(2.71, 0.012),
        vec![
            parameter("wave_speed_m_s", 400.9, 2.4, "m/s"),
            parameter("initial_velocity_m_s", 0.497, 0.012, "m/s"),
            FittedParameter {
                about: "speed of pressure waves",
                at_bound: true,
                ..parameter("closing_time_s", 0.5, 0.2, "s")
            },
        ],
    );
    let wall = fit(
        &["viscoelastic-wall:2"],
        sensors(PERIOD_S * 1.00003, 0.07002),
        vec![
            parameter("wave_speed_m_s", 395.12, 0.4, "m/s"),
            parameter("initial_velocity_m_s", 0.5021, 0.0006, "m/s"),
            parameter("closing_time_s", 0.0983, 0.0021, "s"),
            parameter("J1_per_GPa", 0.1034, 0.0021, "1/GPa"),
            parameter("tau1_s", 0.0493, 0.0013, "s"),
            parameter("J2_per_GPa", 0.2391, 0.0114, "1/GPa"),
            FittedParameter {
                about: "speed of pressure waves",
                at_bound: true,
                ..parameter("tau2_s", 10.0, f64::INFINITY, "s")
            },
        ],
    );
    (base, wall)
}

fn rig(name: &str) -> Rig {
    let sensor = |name: &str, position_m: f64| Sensor {
        line: 0,
        name: name.into(),
        kind: SensorKind::Pressure,
        position_m,
        position_sd_m: 0.0,
        unit: "kPa".parse().expect("a known unit"),
        range: Some([-100.0, 1000.0]),
        accuracy_percent_fs: Some(0.25),
        time_constant_s: None,
        elevation_m: None,
        coupling: Coupling::Dc,
        wiring: None,
    };
    Rig {
        own_effects: Default::default(),
        graph: surgescope_core::rig::Graph::in_series(1),
        name: name.into(),
        fluid: Fluid { name: "water".into(), temperature_degc: 20.0 },
        pipes: vec![Pipe {
            name: "main".into(),
            length_m: 271.6,
            inner_diameter_m: 0.0506,
            wall_thickness_m: 0.0062,
            material: "HDPE".into(),
            wave_speed_m_s: None,
            friction_factor: None,
            roughness_m: None,
            poisson_ratio: None,
            constraint: Constraint::Anchored,
            elevation_start_m: 0.0,
            elevation_end_m: 0.0,
            tolerance: surgescope::rig::Tolerance { length: 0.0, diameter: 0.0, wall: 0.0 },
        }],
        upstream: Upstream::Reservoir,
        valve: Valve {
            closing_time_s: 0.1,
            discharge_head_m: 0.0,
            closing_time_tolerance: None,
            characteristic: vec![],
        },
        sensors: vec![sensor("P1", 271.6), sensor("P2", 182.0), sensor("P3", 89.6)],
        steady: vec![],
        devices: vec![],
        source: format!("name = \"{name}\"\n\n[fluid]\nname = \"water\"\n"),
    }
}

fn stages<'a>(fits: &[(&str, &'a Fit)]) -> Vec<Stage<'a>> {
    fits.iter().map(|&(title, fit)| Stage { title: title.into(), fit }).collect()
}

fn page(title: &str, rig: &Rig, stages: Vec<Stage>, overlays: Vec<Overlay>) -> String {
    html(&Page { title: title.into(), stages, overlays, ..Page::of(rig) })
}

/// The data that the page's script reads.
fn data(page: &str) -> Value {
    let (_, rest) = page.split_once("<script type=\"application/json\" id=\"data\">").expect("the page has data");
    serde_json::from_str(rest.split_once("</script>").expect("the data ends").0).expect("the data is JSON")
}

fn keep(name: &str, text: &str) {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    std::fs::write(folder.join(name), text).expect("the page can be written");
}

#[test]
fn a_long_record_makes_a_small_page_that_keeps_every_peak() {
    let (base, wall) = two_stages(37_000);
    let rig = rig("hdpe-50");
    let overlay = Overlay {
        sensor: "P1".into(),
        label: "digitised, Fig. 6".into(),
        time_s: (0..60).map(|i| f64::from(i) * 0.1 + 0.013).collect(),
        head_m: (0..60).map(|i| surge(f64::from(i) * 0.1 + 0.013, 1.0, PERIOD_S, 0.07) + 0.4).collect(),
    };
    let models = stages(&[("base model", &base), ("+ viscoelastic-wall", &wall)]);
    let text = page("HDPE 50, run 3", &rig, models, vec![overlay]);
    keep("report.html", &text);
    assert!(text.len() < 1_500_000, "{} bytes", text.len());

    let data = data(&text);
    let panels = data["panels"].as_array().expect("panels");
    assert_eq!(panels.len(), 3);
    for (panel, fit) in panels.iter().zip(&wall.runs[0].sensors) {
        let column = |name: &str| panel[name].as_array().expect("a column").clone();
        let (x, measured) = (column("x"), column("measured"));
        assert!(x.len() < 9000 && x.len() == measured.len());
        for e in &fit.extrema {
            let close = |(t, y): (&Value, &Value)| {
                (t.as_f64().unwrap_or(f64::NAN) - e.time_s).abs() < 1e-4
                    && (y.as_f64().unwrap_or(f64::NAN) - e.measured_m).abs() < 0.002
            };
            assert!(x.iter().zip(&measured).any(close), "{} cycle {} is lost", fit.name, e.cycle);
        }
    }
    assert!(text.contains("of 37000 samples are drawn"), "the page tells the reader");
    assert_eq!(panels[0]["overlays"][0]["label"], "digitised, Fig. 6");
    assert_eq!(panels[1]["overlays"].as_array().map(Vec::len), Some(0));
}

#[test]
fn the_page_tells_the_story_and_needs_no_network() {
    let (base, wall) = two_stages(2_000);
    let rig = rig("hdpe-50");
    let text = page("Run 3", &rig, stages(&[("base model", &base), ("+ viscoelastic-wall", &wall)]), vec![]);
    keep("report-short.html", &text);
    let terminal = table::calibration(&stages(&[("base model", &base), ("+ viscoelastic-wall", &wall)]));
    keep("report.txt", &terminal);
    assert!(terminal.starts_with("RMSE 5.2") && terminal.contains("395.1(4)") && terminal.contains("RMSE/noise"));
    assert!(text.contains("the model is down to the noise."));
    assert!(text.contains("395.1(4) m/s") && text.contains("at its bound") && text.contains("(undetermined)"));
    assert!(!text.contains("samples are drawn"), "a short trace is shown whole");
    assert_eq!(data(&text)["panels"][0]["x"].as_array().map(Vec::len), Some(2_000));
    // Anything that a browser would fetch stands in one of these.
    for fetching in
        ["src=", "href=\"http", "href='http", "url(", "@import", "<link", "fetch(", "XMLHttpRequest", "import("]
    {
        assert!(!text.contains(fetching), "{fetching}");
    }
    assert!(text.starts_with("<!doctype html>") && text.contains("<meta name=\"generator\" content=\"surgescope "));
    assert!(
        text.contains("Model − measured, <span class=\"unit\">m</span>")
            && !text.to_lowercase().contains("measured − model"),
        "one sign throughout"
    );
    assert!(!text.contains("<details open"), "tables of peaks are folded");
    let residuals = text.matches("base model").count();
    assert!(residuals > 6, "the base model is in every chart: {residuals}");
    assert!(!text.contains("What to do next"), "no command without recordings");
    let unit = &data(&text)["panels"][0]["unit"];
    assert_eq!(unit["name"], "kPa");
    assert!((unit["per_m"].as_f64().unwrap_or(f64::NAN) - 9.792).abs() < 0.01 && unit["zero"] == 0.0, "{unit}");
    assert!(text.contains("data-own=\"kPa\""), "the switch says which units there are");
    assert!(!text.contains("max-height: 38rem"), "no table hides rows in a box of its own");
    assert_eq!(
        [text.matches("<svg xmlns").count(), text.matches("<figure class=\"drawn\"><svg").count()],
        [10, 1],
        "head of each sensor, and the residual of either model, without a script; and the rig"
    );
}

#[test]
fn the_page_says_what_to_do_next_with_a_command() {
    let (base, wall) = two_stages(2_000);
    let rig = rig("hdpe-50");
    let advice = |fit, ignored: &[String]| {
        let page = Page { stages: stages(&[("model", fit)]), ..Page::of(&rig) };
        let advice = advice::of(&page, &Again::of(&["run 3.mcap".into()], None, ignored, &[]));
        let text = html(&Page { advice, ..page });
        Some(text.split_once("class=\"command\">")?.1.split_once('<')?.0.replace("&#39;", "'"))
    };
    let missing = advice(&base, &[]).expect("something is missing");
    assert_eq!(missing, "surgescope diagnose 'run 3.mcap' --report diagnosis.html");
    let good = advice(&wall, &[]).expect("the model can be checked");
    assert_eq!(good, "surgescope cross-validate 'run 3.mcap' --effects viscoelastic-wall:2");
    assert_eq!(advice(&wall, &["P2".into()]), None, "cross-validation leaves no sensor out");
    let mut early = base.clone();
    early.converged = false;
    assert!(advice(&early, &[]).is_some_and(|c| c.ends_with("--method global-local")));
}

#[test]
fn several_runs_and_stages_stay_apart() {
    let (mut base, mut wall) = two_stages(6_000);
    let mut half = base.clone();
    half.runs[0].sensors[0] = sensor_fit("P1", 1.0, 6_000, 7, |t| surge(t, 1.0, 2.73, 0.05));
    half.effects = chosen("unsteady-friction");
    let mut second = two_stages(3_000).1.runs.remove(0);
    second.file = "hdpe-50-run-04.mcap".into();
    second.sensors.truncate(1);
    second.sensors[0].rmse_m = 0.09;
    let sensor = &mut second.sensors[0];
    let lost = sensor.time_s.iter().position(|t| *t > 6.0).expect("the run is longer");
    for column in [&mut sensor.time_s, &mut sensor.measured_m, &mut sensor.model_m] {
        column.drain(lost..lost + 200);
    }
    for fit in [&mut base, &mut half, &mut wall] {
        fit.runs.push(second.clone());
    }
    wall.parameters[1].run = Some("hdpe-50-run-03.mcap".into());
    let mut almost = wall.clone();
    almost.converged = false;
    almost.stopped_because = "the budget of 5000 simulations ran out".into();
    almost.method = surgescope::fit::problem::method::Method::MicroGa;
    let models = [("base model", &base), ("+ unsteady-friction", &half), ("+ viscoelastic-wall:1", &almost)];
    let mut models = stages(&models);
    models.push(Stage { title: "+ viscoelastic-wall:2".into(), fit: &wall });
    let text = page("Runs 3 and 4", &rig("hdpe-50"), models, vec![]);
    keep("report-runs.html", &text);
    let data = data(&text);
    let mut colours: Vec<u64> =
        data["stages"].as_array().expect("stages").iter().filter_map(|s| s["colour"].as_u64()).collect();
    assert_eq!(colours.last(), Some(&0), "the result has the first colour");
    colours.sort_unstable();
    colours.dedup();
    assert_eq!(colours.len(), 4, "no two stages look alike");
    assert_eq!(data["panels"].as_array().map(Vec::len), Some(4));
    assert!(text.contains("P1 · hdpe-50-run-03.mcap</a>") && text.contains("P1 · hdpe-50-run-04.mcap</a>"));
    assert!(text.contains("except at P1"), "a bad sensor among good ones is named");
    assert!(text.contains("stopped early"));
    assert!(
        text.contains("calibrated by least squares; a micro-genetic algorithm; least squares; program"),
        "methods are named"
    );
    let gap = data["panels"][3]["measured"].as_array().expect("a column").iter().filter(|v| v.is_null()).count();
    assert_eq!(gap, 1, "lost samples leave a gap in the line");
}

#[test]
fn hostile_names_do_no_harm() {
    let evil = "</script><script>alert(1)</script><img src=x onerror=alert(2)>\"'&";
    let (mut base, _) = two_stages(100);
    base.runs[0].file = evil.into();
    base.runs[0].sensors[0].name = evil.into();
    base.parameters[0].name = evil.into();
    base.parameters[0].run = Some(evil.into());
    base.effects = vec![chosen("sensor-lag").remove(0).with_sensor(evil)];
    base.stopped_because = evil.into();
    let mut rig = rig(evil);
    rig.fluid.name = evil.into();
    rig.pipes[0].name = evil.into();
    rig.pipes[0].material = evil.into();
    rig.sensors[0].name = evil.into();
    let overlay = Overlay { sensor: evil.into(), label: evil.into(), time_s: vec![0.5], head_m: vec![30.0] };
    let text = page(evil, &rig, stages(&[(evil, &base)]), vec![overlay]);
    keep("report-hostile.html", &text);
    assert!(!text.contains("<script>alert") && !text.contains("<img"));
    assert_eq!(text.matches("</script>").count(), 3, "data, chart library, page script");
    let data = data(&text);
    assert_eq!(data["stages"][0]["title"], evil);
    assert_eq!(data["panels"][0]["overlays"][0]["label"], evil);
}

#[test]
fn numbers_that_are_not_finite_are_left_out() {
    let (_, mut wall) = two_stages(300);
    let sensor = &mut wall.runs[0].sensors[0];
    sensor.model_m[10] = f64::NAN;
    sensor.measured_m[20] = f64::INFINITY;
    sensor.noise_m = f64::NAN;
    sensor.rmse_m = f64::NAN;
    sensor.extrema[0].model_m = f64::NAN;
    sensor.extrema[1].phase_s = f64::NEG_INFINITY;
    wall.runs[0].rmse_m = f64::NAN;
    wall.seconds = f64::NAN;
    wall.parameters[0].value = f64::NAN;
    let text = page("odd", &rig("r"), stages(&[("a", &wall)]), vec![]);
    keep("report-nan.html", &text);
    let body = text.split("<body").nth(1).expect("a body").split("<script").next().expect("text before the data");
    assert!(!body.contains("NaN") && !body.contains(">inf") && !body.contains("Infinity"));
    assert_eq!(data(&text)["panels"][0]["models"][0][10], Value::Null);
    assert!(table::calibration(&stages(&[("a", &wall)])).contains("not a number"));

    let document = record(&wall);
    assert_eq!(document["runs"][0]["rmse_m"], Value::Null);
    assert_eq!(document["parameters"][6]["standard_error"], Value::Null);
}

#[test]
fn nothing_to_show_is_said() {
    let rig = rig("r");
    let none = page("empty", &rig, vec![], vec![]);
    assert!(none.contains("Nothing has been calibrated yet.") && !none.contains("<script"));
    let without_sensors = fit(&[], vec![], vec![]);
    let text = page("no sensors", &rig, stages(&[("base model", &without_sensors)]), vec![]);
    assert!(text.contains("No pressure sensor was calibrated.") && text.contains("no samples"));
    let mut without_samples = two_stages(10).0;
    let sensor = &mut without_samples.runs[0].sensors[0];
    (sensor.time_s, sensor.measured_m, sensor.model_m, sensor.extrema) = (vec![], vec![], vec![], vec![]);
    let text = page("no samples", &rig, stages(&[("base model", &without_samples)]), vec![]);
    keep("report-empty-sensor.html", &text);
    assert!(text.contains("no data") && text.contains("No peaks or troughs"));
}

/// As `calibrate --json` writes it.
fn record(fit: &Fit) -> Value {
    let record = FitRecord::new(fit, &rig("r"), &[], &[]);
    serde_json::from_str(&serde_json::to_string(&record).expect("JSON")).expect("valid JSON")
}

#[test]
fn calibrate_json_has_the_keys_that_scripts_rely_on() {
    let (_, wall) = two_stages(50);
    let document = record(&wall);
    let keys = |value: &Value| value.as_object().expect("an object").keys().cloned().collect::<Vec<_>>();
    let expect_keys = |value: &Value, wanted: &[&str]| {
        for key in wanted {
            assert!(keys(value).iter().any(|k| k == key), "{key} is missing in {:?}", keys(value));
        }
    };
    expect_keys(&document, &["runs", "effects", "parameters", "evaluations", "seconds"]);
    expect_keys(&document["runs"][0], &["file", "rmse_m", "noise_m", "mape_extrema_percent", "sensors"]);
    expect_keys(&document["runs"][0]["sensors"][0], &["name", "rmse_m", "noise_m"]);
    expect_keys(&document["parameters"][0], &["name", "value", "standard_error", "unit", "at_bound"]);
    assert_eq!(document["effects"], serde_json::json!(["viscoelastic-wall:2"]));
    assert_eq!(document["parameters"][0]["value"], 395.12);
    assert_eq!(document["parameters"][6]["at_bound"], true);
    assert_eq!(document["evaluations"], 312);
    assert!(document["runs"][0]["sensors"][2]["rmse_m"].as_f64().is_some_and(|r| (0.02..0.04).contains(&r)));
    assert!(document["parameters"][0].get("run").is_none(), "a shared parameter belongs to no run");
}
