//! What `inspect` finds in traces whose truth is known: exact frictionless waves with everything a lab adds to them.

use std::fmt::Write as _;

use surgescope::recording::{Gap, Recording, RunInfo, Series};
use surgescope::rig::Rig;
use surgescope::signal::{SignalError, inspect};

use crate::common::{done, printed, refused, run, text};

const A: f64 = 420.0;
const L: f64 = 84.0;
const V0: f64 = 0.8;
const JOUKOWSKY: f64 = A * V0 / 9.81;
const RETURN_S: f64 = 2.0 * L / A;
const STEP: f64 = 0.001;

fn rig(sensors: &[(&str, &str, f64, &str)]) -> Rig {
    let mut text = format!(
        "name = \"t\"\n[fluid]\nname = \"water\"\ntemperature_degC = 20.0\n[[pipe]]\nname = \"main\"\nlength_m = {L}\n\
         inner_diameter_mm = 50.0\nwall_thickness_mm = 4.6\nmaterial = \"HDPE\"\n[upstream]\nkind = \"reservoir\"\n\
         [downstream]\nkind = \"valve\"\nclosing_time_s = 0.1\n"
    );
    for (name, kind, position, unit) in sensors {
        let _ = write!(
            text,
            "[[sensor]]\nname = \"{name}\"\nkind = \"{kind}\"\nposition_m = {position}\nunit = \"{unit}\"\n"
        );
    }
    Rig::from_toml(&text, "t.toml").unwrap()
}

/// How the velocity at the valve falls: part of V0 lost at a time after the start.
#[derive(Clone, Copy)]
enum Law {
    Linear(f64),
    Cosine(f64),
}

impl Law {
    fn lost(self, t: f64) -> f64 {
        match self {
            Law::Linear(tc) => (t / tc).clamp(0.0, 1.0),
            Law::Cosine(tc) => 0.5 - 0.5 * ((t / tc).clamp(0.0, 1.0) * std::f64::consts::PI).cos(),
        }
    }
}

/// Exact head above steady of the frictionless pipe: the valve's wave and all its echoes.
fn wave(law: Law, x: f64, t: f64) -> f64 {
    let mut head = 0.0;
    let mut sign = 1.0;
    let mut delay = 0.0;
    while delay <= t {
        head += sign * (law.lost(t - delay - (L - x) / A) - law.lost(t - delay - (L + x) / A));
        sign = -sign;
        delay += RETURN_S;
    }
    JOUKOWSKY * head
}

struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }
}

#[derive(Clone, Copy)]
struct Lab {
    law: Law,
    start: f64,
    end: f64,
    white: f64,
    coloured: f64,
    drift_per_s: f64,
    quantum: f64,
    decay_per_s: f64,
}

const CLEAN: Lab = Lab {
    law: Law::Linear(0.1),
    start: 1.0003,
    end: 6.0,
    white: 0.0,
    coloured: 0.0,
    drift_per_s: 0.0,
    quantum: 0.0,
    decay_per_s: 0.15,
};

/// Pressure sensors in m(H2O) at the places, plus a flow meter and a thermometer.
fn record(lab: Lab, places: &[f64]) -> Recording {
    record_with(lab, places, 77)
}

/// The same with noise drawn from a seed.
fn record_with(lab: Lab, places: &[f64], seed: u64) -> Recording {
    let names: Vec<String> = (1..=places.len()).map(|i| format!("P{i}")).collect();
    let mut sensors: Vec<(&str, &str, f64, &str)> =
        names.iter().zip(places).map(|(n, x)| (n.as_str(), "pressure", *x, "m(H2O)")).collect();
    sensors.push(("Q1", "flow", 0.0, "m3/h"));
    sensors.push(("T1", "temperature", 0.0, "degC"));
    let rig = rig(&sensors);
    let mut noise = Noise(seed);
    let count = (lab.end / STEP) as usize;
    let mut series = Vec::new();
    for x in places {
        let (mut red, mut one) = (0.0, Series::default());
        for i in 0..count {
            let t = i as f64 * STEP;
            red = 0.95 * red + lab.coloured * 0.3122 * noise.next();
            let decay = (-lab.decay_per_s * (t - lab.start).max(0.0)).exp();
            let mut head = 40.0 + decay * wave(lab.law, *x, t - lab.start) + lab.drift_per_s * t;
            head += lab.white * noise.next() + red;
            if lab.quantum > 0.0 {
                head = (head / lab.quantum).round() * lab.quantum;
            }
            one.time_s.push(t);
            one.value.push(head);
        }
        series.push(one);
    }
    let flow = V0 * rig.pipes[0].area_m2() * 3600.0;
    let slow: Vec<f64> = (0..=(lab.end / 0.1) as usize).map(|i| i as f64 * 0.1).collect();
    let flows = slow.iter().map(|t| if *t <= lab.start { flow } else { 0.0 }).collect();
    series.push(Series { time_s: slow, value: flows, gaps: vec![] });
    series.push(Series { time_s: vec![0.0, 1.0], value: vec![20.9, 21.1], gaps: vec![] });
    Recording { rig, series, run: RunInfo::default() }
}

/// Asserts that wave speed and start come back: within `percent` and, for the former, three stated standard errors.
#[track_caller]
fn comes_back(lab: Lab, places: &[f64], percent: f64, start_s: f64) {
    let f = inspect(&record(lab, places)).unwrap();
    let c = f.wave_speed.crossings.expect("crossings");
    let error = (c.value - A).abs();
    assert!(error < percent / 100.0 * A && error < 3.0 * c.standard_error + 0.05, "{c:?}");
    assert!(c.low <= c.value && c.value <= c.high, "{c:?}");
    let late = f.closure.start_s - lab.start;
    assert!(late.abs() < start_s && late.abs() < 4.0 * f.closure.start_se_s + 1e-4, "{:?}", f.closure);
}

#[test]
fn an_exact_wave_gives_back_its_speed_and_start() {
    comes_back(CLEAN, &[L], 0.1, STEP);
    comes_back(Lab { law: Law::Linear(0.004), ..CLEAN }, &[L], 0.2, 2.0 * STEP);
    comes_back(Lab { law: Law::Linear(0.25), ..CLEAN }, &[L], 0.2, STEP);
    comes_back(Lab { law: Law::Cosine(0.2), ..CLEAN }, &[L], 0.2, 0.02);
}

#[test]
fn three_ways_agree_and_say_what_else_there_is() {
    let f = inspect(&record(Lab { white: 0.02, ..CLEAN }, &[L, 0.5 * L, 0.0])).unwrap();
    let near = |value: f64, truth: f64, part: f64| assert!((value / truth - 1.0).abs() < part, "{value} for {truth}");
    near(f.wave_speed.crossings.unwrap().value, A, 0.002);
    near(f.wave_speed.arrival.unwrap().value, A, 0.002);
    near(f.wave_speed.joukowsky.unwrap().value, A, 0.01);
    near(f.steady_velocity_m_s.unwrap().value, V0, 1e-6);
    near(f.period.unwrap().value, 4.0 * L / A, 0.005);
    near(f.closure.end_s.unwrap() - f.closure.start_s, 0.1, 0.05);
    assert!((f.temperature_degc - 21.0).abs() < 1e-9 && f.reference == 0);
    // exp(-0.15 t) a period of 0.8 s
    assert!(f.damping_per_cycle.len() >= 4, "{:?}", f.damping_per_cycle);
    assert!(f.damping_per_cycle.iter().all(|d| (d - 0.12).abs() < 0.03), "{:?}", f.damping_per_cycle);
    let valve = &f.sensors[0];
    near(valve.noise.white_sd_m, 0.02, 0.06);
    near(valve.steady_before_m.value, 40.0, 1e-3);
    assert!((valve.steady_after_m.unwrap().value - 40.0).abs() < 2.0);
    assert!((valve.first_peak.unwrap().head_m - 40.0 - JOUKOWSKY).abs() < 0.05 * JOUKOWSKY);
    assert!(valve.extrema.len() >= 10 && valve.extrema.windows(2).all(|w| w[0].peak != w[1].peak));
    let arrival = f.sensors[1].front_arrival_s.unwrap().value - valve.front_arrival_s.unwrap().value;
    assert!((arrival - 0.5 * L / A).abs() < STEP, "{arrival}");
    assert!(f.sensors[2].front_arrival_s.is_none(), "nothing moves at the supply");
}

#[test]
fn noise_of_every_kind_leaves_the_speed_in_its_error() {
    comes_back(Lab { white: 0.3, ..CLEAN }, &[L], 1.0, 0.005);
    comes_back(Lab { coloured: 0.3, ..CLEAN }, &[L], 1.0, 0.006);
    comes_back(Lab { white: 0.02, quantum: 0.05, ..CLEAN }, &[L], 0.5, 0.003);
    comes_back(Lab { white: 0.05, drift_per_s: 0.4, ..CLEAN }, &[L], 0.5, 0.003);
    let coloured = &inspect(&record(Lab { coloured: 0.3, ..CLEAN }, &[L])).unwrap().sensors[0].noise;
    assert!(coloured.coloured && coloured.effective_fraction < 0.1 && coloured.total_sd_m > 2.0 * coloured.white_sd_m);
    let stepped = &inspect(&record(Lab { white: 0.02, quantum: 0.005, ..CLEAN }, &[L])).unwrap().sensors[0].noise;
    assert!((stepped.quantum_m.unwrap() - 0.005).abs() < 1e-5);
}

#[test]
fn the_lead_in_may_have_any_length() {
    for start in [0.0, 0.0007, 0.01, 0.3, 30.0] {
        comes_back(Lab { start, end: start + 5.0, white: 0.03, ..CLEAN }, &[L], 0.5, 0.003);
        comes_back(Lab { start, end: start + 5.0, white: 0.03, ..CLEAN }, &[L, 0.4 * L], 0.5, 0.003);
    }
}

#[test]
fn a_closure_slower_than_the_wave_is_said_to_be_slow() {
    let lab = Lab { law: Law::Linear(3.0 * RETURN_S), end: 8.0, white: 0.02, ..CLEAN };
    let f = inspect(&record(lab, &[L])).unwrap();
    assert!(f.closure.slow && f.wave_speed.joukowsky.is_none(), "{f:?}");
    let a = f.wave_speed.best().unwrap();
    assert!((a.value / A - 1.0).abs() < 0.02 && (a.value - A).abs() < 3.0 * a.standard_error, "{a:?}");
    assert!((f.closure.start_s - lab.start).abs() < 0.01, "{:?}", f.closure);
    let early = lab.start + 3.0 * RETURN_S - f.closure.end_s.unwrap();
    assert!(early.abs() < 0.25 * RETURN_S, "{early}: {:?}", f.closure);
}

#[test]
fn one_sensor_anywhere_is_enough() {
    for part in [0.3, 0.5, 0.75] {
        let f = inspect(&record(Lab { law: Law::Linear(0.05), white: 0.02, ..CLEAN }, &[part * L])).unwrap();
        let c = f.wave_speed.crossings.unwrap();
        assert!((c.value / A - 1.0).abs() < 0.01 && (c.value - A).abs() < 3.0 * c.standard_error + 0.4, "{part} {c:?}");
        assert!((f.closure.start_s - CLEAN.start).abs() < 0.005, "{part} {:?}", f.closure);
        assert!(f.wave_speed.arrival.is_none());
    }
}

#[test]
fn a_sensor_that_cannot_tell_says_so() {
    // a quarter up from the supply the closure outlasts the wave's return: its end looks like the return
    let f = inspect(&record(Lab { law: Law::Linear(0.14), white: 0.02, ..CLEAN }, &[0.25 * L])).unwrap();
    let a = f.wave_speed.best().unwrap();
    assert!(f.closure.slow && (a.value / A - 1.0).abs() < 0.02, "{:?}", f.wave_speed);
    assert!((f.closure.start_s - CLEAN.start).abs() < 2.0 * f.closure.start_se_s, "{:?}", f.closure);
}

#[test]
fn a_closure_that_outlasts_the_waves_return_is_not_taken_for_it() {
    for (part, returns) in [(0.2, 2.0), (0.2, 3.0), (0.4, 2.0), (0.4, 2.5)] {
        // the level holds until the valve is shut, and falls then: the rise takes as long as the wave's way
        let law = Law::Linear(returns * part * RETURN_S);
        let f = inspect(&record(Lab { law, white: 0.02, end: 8.0, ..CLEAN }, &[part * L])).unwrap();
        let a = f.wave_speed.best().unwrap();
        assert!(f.closure.slow && (a.value / A - 1.0).abs() < 0.02, "{part} {:?}", f.wave_speed);
    }
}

#[test]
fn a_gap_is_never_read_as_a_feature() {
    let lab = Lab { white: 0.02, ..CLEAN };
    let fall = lab.start + RETURN_S;
    let mut recording = record(lab, &[L, 0.6 * L]);
    // the fall at the valve is lost: the other sensor still has its own
    cut(&mut recording.series[0], fall - 0.01, fall + 0.2);
    let f = inspect(&recording).unwrap();
    let c = f.wave_speed.crossings.unwrap();
    assert!((c.value / A - 1.0).abs() < 0.005, "{c:?}");
    assert!((f.wave_speed.arrival.unwrap().value / A - 1.0).abs() < 0.005);
    // gaps in the lead-in and the decay do no harm
    let mut recording = record(lab, &[L]);
    cut(&mut recording.series[0], 0.2, 0.4);
    cut(&mut recording.series[0], 3.0, 3.3);
    let f = inspect(&recording).unwrap();
    assert!((f.wave_speed.crossings.unwrap().value / A - 1.0).abs() < 0.005);
    assert!(f.sensors[0].extrema.iter().all(|e| !(3.0..3.3).contains(&e.time_s)));
    assert_eq!(f.sensors[0].missing_at_front_s, None);
    // the first rise is lost: what is found behind it is doubted
    let mut recording = record(lab, &[L]);
    cut(&mut recording.series[0], lab.start - 0.01, lab.start + 0.05);
    let f = inspect(&recording).unwrap();
    let [from_s, to_s] = f.sensors[0].missing_at_front_s.unwrap();
    assert!((from_s - lab.start + 0.01).abs() < 0.005 && (to_s - lab.start - 0.05).abs() < 0.005, "{from_s} {to_s}");
    let found = surgescope::signal::doubts::doubts(&recording.rig, &f);
    assert!(found.iter().any(|text| text.contains("samples of P1 are missing from")), "{found:?}");
}

fn cut(series: &mut Series, from: f64, to: f64) {
    let keep: Vec<bool> = series.time_s.iter().map(|t| !(from..to).contains(t)).collect();
    let mut k = keep.iter();
    series.value.retain(|_| *k.next().unwrap());
    series.time_s.retain(|t| !(from..to).contains(t));
    series.gaps.push(Gap { from_s: from, to_s: to, samples: None });
}

#[test]
fn a_trigger_gives_the_start() {
    let mut recording = record(CLEAN, &[L]);
    let mut sensors = vec![("P1", "pressure", L, "m(H2O)"), ("G", "trigger", L, "1")];
    sensors.push(("V", "valve-position", L, "%"));
    recording.rig = rig(&sensors);
    let time_s: Vec<f64> = (0..6000).map(|i| i as f64 * 0.001).collect();
    let command = time_s.iter().map(|t| f64::from(u8::from(*t > 0.9805))).collect();
    let position = time_s.iter().map(|t| 100.0 * (1.0 - ((t - 1.0) / 0.12).clamp(0.0, 1.0))).collect();
    let other = |value| Series { time_s: time_s.clone(), value, gaps: vec![] };
    recording.series = vec![recording.series[0].clone(), other(command), other(position)];
    let closure = inspect(&recording).unwrap().closure;
    assert!(closure.from_trigger && (closure.start_s - 0.9805).abs() < 1e-3, "{closure:?}");
    assert!((closure.pressure_onset_s - CLEAN.start).abs() < 1e-3, "{closure:?}");
    assert!((closure.end_s.unwrap() - 1.12).abs() < 0.005, "{closure:?}");
}

#[test]
fn a_recording_that_shows_nothing_says_so() {
    let quiet = |lab: Lab| inspect(&record(Lab { law: Law::Linear(1e9), ..lab }, &[L, 0.5 * L])).unwrap_err();
    for lab in
        [CLEAN, Lab { white: 0.1, ..CLEAN }, Lab { coloured: 0.3, ..CLEAN }, Lab { white: 0.1, quantum: 0.5, ..CLEAN }]
    {
        let error = quiet(lab);
        assert!(matches!(error, SignalError::NoClosure { .. }), "{error}");
        assert!(error.to_string().contains("no closure"));
    }
    // a drift rises but does not come back
    let drift = quiet(Lab { drift_per_s: 0.5, white: 0.05, ..CLEAN });
    assert!(matches!(drift, SignalError::TooShort { .. } | SignalError::NoClosure { .. }), "{drift}");

    let short = inspect(&record(Lab { end: 1.2, white: 0.02, ..CLEAN }, &[L])).unwrap_err();
    assert!(matches!(short, SignalError::TooShort { .. }), "{short}");

    let mut empty = record(CLEAN, &[L]);
    empty.series[0] = Series::default();
    assert!(matches!(inspect(&empty).unwrap_err(), SignalError::NoPressure { sensors: 1 }));
    let mut nan = record(CLEAN, &[L]);
    nan.series[0].value.fill(f64::NAN);
    assert!(matches!(inspect(&nan).unwrap_err(), SignalError::NoPressure { .. }));
    let mut few = record(CLEAN, &[L]);
    few.series[0] = Series { time_s: vec![0.0, 1.0, 2.0], value: vec![1.0, 9.0, 1.0], gaps: vec![] };
    assert!(inspect(&few).is_err());
}

#[test]
fn single_bad_numbers_do_not_spread() {
    let mut recording = record(Lab { white: 0.02, ..CLEAN }, &[L]);
    for i in (5..recording.series[0].value.len()).step_by(997) {
        recording.series[0].value[i] = if i % 2 == 0 { f64::NAN } else { f64::INFINITY };
    }
    let c = inspect(&recording).unwrap().wave_speed.crossings.unwrap();
    assert!((c.value / A - 1.0).abs() < 0.01, "{c:?}");
}

#[test]
fn spikes_of_a_switching_valve_are_no_fronts() {
    let mut recording = record(Lab { white: 0.02, ..CLEAN }, &[L]);
    for i in [100, 500, 870, 2500, 2501] {
        recording.series[0].value[i] += 60.0;
    }
    let f = inspect(&recording).unwrap();
    assert!((f.wave_speed.crossings.unwrap().value / A - 1.0).abs() < 0.005);
    assert!((f.closure.start_s - CLEAN.start).abs() < 0.002, "{:?}", f.closure);
}

#[test]
fn a_dropout_before_the_closure_changes_neither_noise_nor_steady_head() {
    let clean = record(Lab { white: 0.02, ..CLEAN }, &[L]);
    let mut spiky = clean.clone();
    spiky.series[0].value[400] = -10_200.0;
    let (clean, spiky) = (inspect(&clean).unwrap(), inspect(&spiky).unwrap());
    let (a, b) = (&clean.sensors[0], &spiky.sensors[0]);
    assert!((b.noise.white_sd_m / a.noise.white_sd_m - 1.0).abs() < 0.1, "{:?}", b.noise);
    assert!((b.noise.total_sd_m / a.noise.total_sd_m - 1.0).abs() < 0.1, "{:?}", b.noise);
    assert!((b.steady_before_m.value - a.steady_before_m.value).abs() < 0.01, "{:?}", b.steady_before_m);
    assert!((spiky.wave_speed.crossings.unwrap().value / A - 1.0).abs() < 0.005);
}

#[test]
fn numbers_that_cannot_all_be_right_are_doubted_and_others_are_not() {
    use surgescope::signal::doubts::doubts;
    let said = |recording: &Recording| doubts(&recording.rig, &inspect(recording).unwrap());
    let good = record(Lab { white: 0.02, ..CLEAN }, &[L, 0.5 * L]);
    assert_eq!(said(&good), Vec::<String>::new());
    let one = |recording: &Recording, words: &[&str]| {
        let said = said(recording);
        assert!(said.iter().any(|s| words.iter().all(|w| s.contains(w))), "{words:?} is not in {said:#?}");
    };
    // m3/h read as if it were less: the rise is too high for the flow; then so much that no water does it
    let flow = |factor: f64| {
        let mut recording = good.clone();
        recording.series[2].value.iter_mut().for_each(|v| *v *= factor);
        recording
    };
    one(&flow(0.7), &["Joukowsky", "the flow reads too low"]);
    one(&flow(1.0 / 3.6), &["Joukowsky", "the units and scales of flow"]);
    one(&flow(0.1), &["which no water pipe has"]);
    one(&flow(2.0), &["Joukowsky", "whether the valve closed fully"]);
    assert_eq!(said(&flow(1.3)), Vec::<String>::new(), "creep and leaks lower the first rise");
    let copper = |mut recording: Recording| {
        let source =
            recording.rig.source.replace("\"HDPE\"\n", "\"HDPE\"\nwave_speed_m_s = 420.0\n").replace("HDPE", "copper");
        recording.rig = Rig::from_toml(&source, "t.toml").unwrap();
        recording
    };
    one(&copper(flow(1.3)), &["Joukowsky", "a leak, a wrong flow, or a slow closure?"]);
    assert_eq!(said(&copper(flow(1.1))), Vec::<String>::new(), "some percent are in every flow meter and bore");
    // a wave three times as long on top of it: the head crosses its mean at one period, and its spectrum peaks at
    // another
    let mut other = good.clone();
    for (t, head) in other.series[0].time_s.clone().iter().zip(&mut other.series[0].value) {
        *head +=
            1.5 * JOUKOWSKY * if *t > 1.1 { (std::f64::consts::TAU * (t - 1.1) / (6.0 * RETURN_S)).sin() } else { 0.0 };
    }
    assert!(!said(&other).is_empty(), "{:?}", inspect(&other).unwrap().period);
    let mut late = good.clone();
    late.series[1].time_s.iter_mut().for_each(|t| *t += 0.05);
    one(&late, &["from sensor to sensor", "clock"]);
    let mut slow = good.clone();
    slow.series.iter_mut().flat_map(|s| &mut s.time_s).for_each(|t| *t *= 6.0);
    one(&slow, &["a fit allows", "gas in the water"]);
    one(&record(Lab { white: 0.02, end: 2.0, ..CLEAN }, &[L]), &["periods were recorded after the closure"]);
}

#[test]
fn a_record_cut_anywhere_gives_an_answer_or_an_error_but_no_nan() {
    let whole = record(Lab { white: 0.05, ..CLEAN }, &[L, 0.5 * L]);
    for end in (0..6000).step_by(97) {
        let mut part = whole.clone();
        for series in &mut part.series[..2] {
            series.time_s.truncate(end);
            series.value.truncate(end);
        }
        if let Ok(f) = inspect(&part) {
            let text = format!("{f:?}");
            assert!(!text.contains("NaN") && !text.contains("inf,"), "cut at {end}: {text}");
        }
    }
}

#[test]
fn the_program_prints_a_table_and_json() {
    let dir = tempfile::tempdir().unwrap();
    let mcap = dir.path().join("run.mcap");
    surgescope::storage::write(&mcap, &record(Lab { white: 0.02, ..CLEAN }, &[L, 0.5 * L])).unwrap();

    let f = done(&["inspect", text(&mcap)]);
    assert_eq!(f["file"], text(&mcap));
    assert!((f["wave_speed_m_s"]["crossings"]["value"].as_f64().unwrap() / A - 1.0).abs() < 0.002, "{f}");
    for key in ["low", "high", "standard_error"] {
        assert!(f["wave_speed_m_s"]["crossings"][key].is_f64(), "{key}");
    }
    for key in
        ["/wave_speed_m_s/joukowsky/value", "/wave_speed_m_s/arrival/value", "/period_s/value", "/closure/start_s"]
    {
        assert!(f.pointer(key).is_some_and(serde_json::Value::is_f64), "{key} in {f}");
    }
    assert_eq!(f["sensors"].as_array().unwrap().len(), 2);
    assert!(f["sensors"][0]["extrema"].as_array().unwrap().len() > 8);

    assert_eq!(f["doubts"], serde_json::json!([]));
    let mut short = record(Lab { white: 0.02, end: 2.0, ..CLEAN }, &[L]);
    short.series[1] = Series::default();
    let brief = dir.path().join("brief.mcap");
    surgescope::storage::write(&brief, &short).unwrap();
    let table = printed(run(&["inspect", text(&brief)]));
    assert!(table.lines().any(|l| l.starts_with("note: only 1.") && l.contains("periods")), "{table}");
    assert!(table.contains("Joukowsky            not visible\n"), "no unit where there is no number: {table}");
    let brief = done(&["inspect", text(&brief)]);
    assert_eq!(brief["doubts"].as_array().unwrap().len(), 1, "{brief}");

    let table = printed(run(&["inspect", text(&mcap)]));
    assert!(table.contains("wave speed, crossings  4") && table.contains("P2"), "{table}");

    // another rig: the sensors are found by name, and a longer pipe makes a faster wave
    let long = dir.path().join("long.toml");
    std::fs::write(&long, long_rig()).unwrap();
    let f = done(&["inspect", text(&mcap), "--rig", text(&long)]);
    assert!((f["wave_speed_m_s"]["crossings"]["value"].as_f64().unwrap() / (2.0 * A) - 1.0).abs() < 0.002, "{f}");

    let strange = dir.path().join("strange.toml");
    std::fs::write(&strange, rig(&[("X", "pressure", L, "kPa")]).source).unwrap();
    refused(&["inspect", text(&mcap), "--rig", text(&strange)], &["no sensor named 'P1'"]);
}

#[test]
fn the_program_ends_with_two_where_nothing_closed() {
    let dir = tempfile::tempdir().unwrap();
    let mcap = dir.path().join("quiet.mcap");
    surgescope::storage::write(&mcap, &record(Lab { law: Law::Linear(1e9), white: 0.05, ..CLEAN }, &[L])).unwrap();
    refused(&["inspect", text(&mcap), "--json"], &["no closure"]);
}

fn long_rig() -> String {
    let sensors = [
        ("T1", "temperature", 0.0, "degC"),
        ("P2", "pressure", L, "m(H2O)"),
        ("Q1", "flow", 0.0, "m3/h"),
        ("P1", "pressure", 2.0 * L, "m(H2O)"),
    ];
    let mut text = rig(&[("X", "pressure", L, "kPa")])
        .source
        .replace(&format!("length_m = {L}"), &format!("length_m = {}", 2.0 * L));
    for (name, kind, position, unit) in sensors {
        let _ = write!(
            text,
            "[[sensor]]\nname = \"{name}\"\nkind = \"{kind}\"\nposition_m = {position}\nunit = \"{unit}\"\n"
        );
    }
    text
}

/// A thirtieth of the front as noise: laid over each other, noisy fronts give the speed without bias, and with as much
/// error as they say.
#[test]
fn loud_noise_neither_shifts_the_wave_speed_nor_passes_unsaid() {
    let loud = Lab { white: JOUKOWSKY / 30.0, ..CLEAN };
    let found: Vec<_> =
        (1..=40u64).map(|seed| inspect(&record_with(loud, &[L, 0.5 * L], seed * 7919)).unwrap().wave_speed).collect();
    let judge = |name: &str, bias: f64, mut estimates: Vec<(f64, f64)>| {
        let covered = estimates.iter().filter(|(v, se)| (v - A).abs() < 2.0 * se).count();
        estimates.sort_by(|a, b| a.0.total_cmp(&b.0));
        let median = estimates[estimates.len() / 2].0;
        assert!(estimates.len() >= 38, "{name}: {}", estimates.len());
        assert!((median / A - 1.0).abs() < bias, "{name}: {median}");
        assert!(covered as f64 > 0.92 * estimates.len() as f64, "{name}: {covered} of {}", estimates.len());
    };
    judge("crossings", 0.005, found.iter().filter_map(|w| w.crossings).map(|c| (c.value, c.standard_error)).collect());
    judge("two sensors", 0.02, found.iter().filter_map(|w| w.arrival).map(|e| (e.value, e.standard_error)).collect());
}

#[test]
fn the_samples_that_are_counted_are_those_recorded() {
    let mut recording = record(Lab { white: 0.02, ..CLEAN }, &[L]);
    let all = recording.series[0].time_s.len();
    // a gap is bridged on an even grid, but nothing was recorded in it
    let series = &mut recording.series[0];
    series.gaps = vec![Gap { from_s: series.time_s[99], to_s: series.time_s[112], samples: Some(12) }];
    series.time_s.drain(100..112);
    series.value.drain(100..112);
    assert_eq!(inspect(&recording).unwrap().sensors[0].samples, all - 12);
}

/// The table that ships: a leak a third of the way, whose echoes cross the mean more often than the wave does.
#[test]
fn echoes_of_a_leak_are_no_cycles() {
    let folder = tempfile::tempdir().unwrap();
    let [rig, run_1] = ["rig.toml", "run.mcap"].map(|name| text(&folder.path().join(name)).to_owned());
    let pipe = ["--material", "copper", "--length-m", "100", "--pipe", "22x1.5", "--temperature-degC", "18", "--yes"];
    done(&[&["rig", "new", "recordings/logger.csv", "-o", &rig], &pipe[..]].concat());
    done(&["import", "recordings/logger.csv", "--rig", &rig, "--yes", "-o", &run_1]);
    let f = done(&["inspect", &run_1]);
    let number = |value: &serde_json::Value| value.as_f64().unwrap();
    let period_s = number(&f["period_s"]["value"]);
    let of_wave_s = 400.0 / number(&f["wave_speed_m_s"]["crossings"]["value"]);
    assert!((period_s / of_wave_s - 1.0).abs() < 0.03, "{period_s} s for 4L/a = {of_wave_s} s");
    let frequency = done(&["frequency", &run_1]);
    let fundamental_hz = number(&frequency["sensors"][0]["harmonics"][0]["record"]["frequency_hz"]);
    assert!((period_s * fundamental_hz - 1.0).abs() < 0.02, "{period_s} s for {fundamental_hz} Hz");
    let extrema: Vec<&Vec<serde_json::Value>> =
        f["sensors"].as_array().unwrap().iter().map(|s| s["extrema"].as_array().unwrap()).collect();
    assert!(extrema[0].len() >= 12 && extrema.iter().all(|e| e.len() == extrema[0].len()), "{f}");
    for w in extrema.iter().flat_map(|e| e.windows(2)) {
        let apart_s = number(&w[1]["time_s"]) - number(&w[0]["time_s"]);
        assert!((0.25 * period_s..0.75 * period_s).contains(&apart_s), "{apart_s} s");
    }
    let damping = f["damping_per_cycle"].as_array().unwrap();
    assert!(damping.iter().take(5).all(|d| (0.2..0.8).contains(&number(d))), "{damping:?}");
    let doubts = f["doubts"].to_string();
    assert!(doubts.contains("a leak, a wrong flow, or a slow closure?"), "{doubts}");
}

/// 60 m of copper pipe of 10 mm, as teaching rigs have it, with a valve that is turned by hand.
fn slow_rig(closing_time_s: f64, metered: bool) -> String {
    let meter = "[[sensor]]\nname = \"Q1\"\nkind = \"flow\"\nunit = \"L/min\"\nposition_m = 0.0\n";
    format!(
        "name = \"slow\"\n[fluid]\nname = \"water\"\ntemperature_degC = 20.0\n[[pipe]]\nname = \"main\"\nlength_m = 60.0\n\
         inner_diameter_mm = 10.0\nwall_thickness_mm = 1.0\nmaterial = \"copper\"\n[upstream]\nkind = \"reservoir\"\n[downstream]\n\
         kind = \"valve\"\nclosing_time_s = {closing_time_s}\n[[sensor]]\nname = \"P1\"\nkind = \"pressure\"\nposition_m = 60.0\n\
         unit = \"m(H2O)\"\n{}",
        if metered { meter } else { "" }
    )
}

/// 2 s on a line whose 2L/a is 0.088 s: the front carries no wave speed, the oscillation after the closure does, and
/// the model is fitted to its noise, whatever the rig file says of the valve, with a flow meter and without.
#[test]
fn a_slow_closure_shows_its_wave_speed_afterwards_and_is_fitted() {
    for (nominal_s, closing_s, metered) in [(2.0, 2.0, true), (0.05, 1.2, true), (2.0, 0.15, true), (1.0, 1.0, false)] {
        let folder = tempfile::tempdir().unwrap();
        let [rig, run_1] = ["rig.toml", "run.mcap"].map(|name| text(&folder.path().join(name)).to_owned());
        std::fs::write(&rig, slow_rig(nominal_s, metered)).unwrap();
        let closing = format!("closing_time_s={closing_s}");
        let made = done(&["simulate", "--rig", &rig, "--set", &closing, "--seed", "1", "-o", &run_1]);
        let wave_speed = made["settings"]["wave_speed_m_s"].as_f64().unwrap();
        let f = done(&["inspect", &run_1]);
        let speeds = &f["wave_speed_m_s"];
        assert!(f["closure"]["slow"] == true && speeds["crossings"]["slow_closure"] == true, "{closing_s}: {f}");
        assert!(["value", "low", "high"].iter().all(|key| speeds["crossings"][key].is_null()), "{speeds}");
        assert!(speeds["joukowsky"].is_null() && speeds["arrival"].is_null(), "{speeds}");
        let seen = speeds["period"]["value"].as_f64().unwrap();
        assert!((seen / wave_speed - 1.0).abs() < 0.005, "{closing_s}: {seen} for {wave_speed} m/s");
        let took_s = f["closure"]["end_s"].as_f64().unwrap() - f["closure"]["start_s"].as_f64().unwrap();
        assert!((took_s - closing_s).abs() < 0.05, "{took_s} for {closing_s} s");
        assert_eq!(f["sensor_faults"], serde_json::json!([]), "no clock is to blame");
        // the elastic model swings below a vacuum where the closure is fast enough
        let mut doubts = f["doubts"].as_array().unwrap().iter();
        assert!(doubts.all(|d| d.as_str().unwrap().contains("vacuum")), "{closing_s}: {}", f["doubts"]);

        let fit = done(&["calibrate", &run_1]);
        let [rmse_m, noise_m, start_m] = ["rmse_m", "noise_m", "start_rmse_m"]
            .map(|key| fit["runs"][0]["sensors"][0][key].as_f64().unwrap_or_else(|| panic!("{key}: {fit}")));
        assert!(rmse_m < 1.1 * noise_m && rmse_m <= start_m, "{closing_s}: {start_m} -> {rmse_m} m, noise {noise_m} m");
        let found = |name: &str| crate::common::parameter(&fit, name)["value"].as_f64().unwrap();
        assert!((found("wave_speed_m_s") / wave_speed - 1.0).abs() < 0.005, "{}", found("wave_speed_m_s"));
        // a tenth of that was once said to be known
        let closing = crate::common::parameter(&fit, "closing_time_s");
        let (value, error) = (closing["value"].as_f64().unwrap(), closing["standard_error"].as_f64().unwrap());
        assert!((value - closing_s).abs() < 3.0 * error && error < 0.03 * closing_s, "{closing} for {closing_s} s");
        assert!((found("initial_velocity_m_s") - 1.0).abs() < 0.05, "{}", found("initial_velocity_m_s"));
    }
}

/// A wide pipe of steel before a narrow one of copper. Their joint sends back part of the wave before the supply does,
/// and makes the period another than four travel times; what `inspect` takes from it is the mean speed, length by
/// travel time.
#[test]
fn pipes_in_series_show_their_mean_wave_speed_by_the_period() {
    for closing_s in [0.02, 0.1, 0.6] {
        let folder = tempfile::tempdir().unwrap();
        let [rig, run_1] = ["rig.toml", "run.mcap"].map(|name| text(&folder.path().join(name)).to_owned());
        let narrow = slow_rig(closing_s, true).replace("60.0", "100.0");
        let pipe = "[[pipe]]\nname = \"main\"\nlength_m = 100.0\ninner_diameter_mm = 10.0\nwall_thickness_mm = 1.0\nmaterial = \"copper\"\n";
        let series = "[[pipe]]\nname = \"wide\"\nlength_m = 60.0\ninner_diameter_mm = 40.0\nwall_thickness_mm = 2.0\nmaterial = \"steel\"\n\
                      wave_speed_m_s = 1380.0\n[[pipe]]\nname = \"narrow\"\nlength_m = 40.0\ninner_diameter_mm = 20.0\nwall_thickness_mm = 1.5\n\
                      material = \"copper\"\nwave_speed_m_s = 1290.0\n";
        assert!(narrow.contains(pipe), "{narrow}");
        std::fs::write(&rig, narrow.replace(pipe, series)).unwrap();
        let (closing, velocity) = (format!("closing_time_s={closing_s}"), "initial_velocity_m_s=0.5");
        done(&["simulate", "--rig", &rig, "--set", &closing, velocity, "--seed", "3", "-o", &run_1]);
        let f = done(&["inspect", &run_1]);
        let mean = 100.0 / (60.0 / 1380.0 + 40.0 / 1290.0);
        let speeds = &f["wave_speed_m_s"];
        let seen = speeds["period"]["value"].as_f64().unwrap();
        assert!((seen / mean - 1.0).abs() < 0.02, "{closing_s}: {seen} for {mean} m/s");
        assert_eq!(f["closure"]["slow"], closing_s > 0.3, "{closing_s}: {f}");
        let doubts = f["doubts"].to_string();
        assert!(
            speeds["crossings"]["value"].is_null() && !doubts.contains("but a fit allows"),
            "{closing_s}: {doubts}"
        );
    }
}
