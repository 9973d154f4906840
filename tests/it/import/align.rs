//! Two acquisition systems with clocks of their own: a slow one at 1 kHz and a fast one at 50 kHz, over one simulated
//! closure.

use serde_json::Value;
use surgescope::align::{Method, Part, align};
use surgescope::model::trace::{Probe, Trace};
use surgescope::model::{Conditions, Model, Resolution, RunValues};
use surgescope::recording::{Recording, RunInfo, Series};
use surgescope::rig::Rig;

use super::Bench;
use crate::common::{done, parameter, text};

/// The closure starts here on the slow system's clock, s.
const CLOSURE_S: f64 = 0.3;
const DURATION_S: f64 = 2.5;
const LEAK_S: f64 = 0.8;

/// The slow system measures P1 at the valve, the fast one PZ, which is piezoelectric, at 60 m.
fn bench(trigger: bool) -> Bench {
    let mut sensors = vec![
        ("P1", "pressure", "kPa", ""),
        ("PZ", "pressure", "kPa", "position_m = 60.0\ncoupling = \"ac\"\ntime_constant_s = 0.8"),
    ];
    if trigger {
        sensors.push(("TRIG", "trigger", "1", ""));
    }
    Bench::new(&sensors)
}

struct Truth {
    traces: Vec<Trace>,
}

fn truth(bench: &Bench) -> Truth {
    let rig = Rig::load(&bench.path("rig.toml")).unwrap();
    let water = rig.fluid.properties(20.0);
    let model = Model::new(&rig, &water, &[]);
    let run = RunValues { initial_velocity_m_s: 0.4, valve_head_m: 30.0, closing_time_s: 0.02, friction_scale: 1.0 };
    let conditions = Conditions::of(water);
    let resolution = Resolution { reaches: 400, duration_s: DURATION_S };
    let probes = [Probe::head(100.0), Probe::head(60.0)];
    Truth { traces: model.simulate(&conditions, &[400.0], &run, resolution, &probes).unwrap().traces }
}

impl Truth {
    /// Gauge pressure at a sensor at a time of the slow clock, kPa, with the rig's water (998.2 kg/m³ at 20 °C).
    fn kpa(&self, sensor: usize, time_s: f64) -> f64 {
        9.81 * 0.9982 * self.traces[sensor].at((time_s - CLOSURE_S).max(0.0))
    }
}

/// What a trigger shows.
type Trigger<'t> = Option<&'t dyn Fn(f64) -> f64>;

fn noise(random: &mut fastrand::Rng) -> f64 {
    0.2 * ((0..12).map(|_| random.f64()).sum::<f64>() - 6.0)
}

/// The slow system's file: its clock is the true one.
fn slow(truth: &Truth, head: &str, trigger: Trigger) -> String {
    let mut random = fastrand::Rng::with_seed(1);
    let mut text = format!("{head}time_s,P1{}\n", if trigger.is_some() { ",TRIG" } else { "" });
    for i in 0..2000 {
        let t = f64::from(i) * 0.001;
        text += &format!("{t:.3},{:.3}", truth.kpa(0, t) + noise(&mut random));
        trigger.iter().for_each(|f| text += &format!(",{:.4}", f(t)));
        text.push('\n');
    }
    text
}

/// The fast system's file: the slow clock is `offset_s + (1 + drift) t` at its time `t`. The high-pass of the
/// piezoelectric sensor, y' = x' - y/T, is integrated here by its own recursion.
fn fast(truth: &Truth, head: &str, trigger: Trigger, offset_s: f64, drift: f64) -> String {
    let mut random = fastrand::Rng::with_seed(2);
    let mut text = format!("{head}time_s,PZ{}\n", if trigger.is_some() { ",TRIG" } else { "" });
    let (step_s, mut charge, mut before) = (2e-5, 0.0, f64::NAN);
    for i in 0..90_000 {
        let own = f64::from(i) * step_s;
        let t = offset_s + (1.0 + drift) * own;
        let x = truth.kpa(1, t);
        if before.is_finite() {
            let decay = (-step_s / LEAK_S).exp();
            charge = decay * charge + (x - before) * decay.sqrt();
        }
        before = x;
        text += &format!("{own:.5},{:.3}", charge + noise(&mut random));
        trigger.iter().for_each(|f| text += &format!(",{:.4}", f(t)));
        text.push('\n');
    }
    text
}

/// The alignment of the second file.
fn clock(document: &Value) -> &Value {
    &document["alignment"][1]
}

fn number(value: &Value, key: &str) -> f64 {
    value[key].as_f64().unwrap_or_else(|| panic!("no {key} in {value}"))
}

#[test]
fn a_trigger_aligns_two_systems_to_a_fraction_of_the_slow_ones_step() {
    let bench = bench(true);
    let truth = truth(&bench);
    let offset_s = 0.123_456_7;
    // a command of 0 and 1: known to the slow system's step; a voltage that rises in 6 ms: known far better
    let step = |t: f64| f64::from(t > CLOSURE_S - 0.0123);
    let voltage = |t: f64| 5.0 * ((t - CLOSURE_S + 0.013) / 0.006).clamp(0.0, 1.0);
    for (trigger, most_s) in [(&step as &dyn Fn(f64) -> f64, 3e-4), (&voltage, 8e-5)] {
        bench.put("slow.csv", slow(&truth, "", Some(trigger)));
        bench.put("fast.csv", fast(&truth, "# charge amplifier 2\n", Some(trigger), offset_s, 0.0));
        let (document, err) = bench.import(0, &["slow.csv", "fast.csv"]);
        let clock = clock(&document);
        let (error, said) = (number(clock, "offset_s") - offset_s, number(clock, "uncertainty_s"));
        assert!(said < most_s && error.abs() < 3.0 * said, "off by {error} s, said {said} s");
        assert_eq!((clock["method"].as_str(), clock["events"].as_u64()), (Some("trigger"), Some(1)));
        assert!(
            err.contains("fast.csv: aligned by one edge of the trigger") && err.contains("by front it would be"),
            "{err}"
        );
        assert!(err.contains("'TRIG' of slow.csv (2000 samples) is left out: fast.csv has more"), "{err}");
        let recording = bench.recording();
        assert!(recording.run.notes.contains(&("comment (fast.csv)".into(), "charge amplifier 2".into())));
        let note = recording.run.notes.iter().find(|(key, _)| key == "alignment").unwrap();
        assert!(note.1.contains("fast.csv: aligned by one edge"), "{note:?}");
        let first = recording.series[1].time_s[0];
        assert!((first - number(clock, "offset_s")).abs() < 1e-9, "{first}");
    }
}

#[test]
fn repeated_edges_give_the_drift_and_a_better_offset() {
    let bench = bench(true);
    let truth = truth(&bench);
    // pulses at uneven times, as a random trigger or a coded one gives them
    let at = [0.05013, 0.21071, 0.33045, 0.50029, 0.61088, 0.93052, 1.10097, 1.42011, 1.60063, 1.75037];
    let pulses = |t: f64| f64::from(at.iter().any(|&p| t >= p && t < p + 0.03037));
    let (offset_s, drift) = (0.0317, 180e-6);
    bench.put("slow.csv", slow(&truth, "", Some(&pulses)));
    bench.put("fast.csv", fast(&truth, "", Some(&|t| 1.0 - pulses(t)), offset_s, drift));
    let (document, err) = bench.import(0, &["slow.csv", "fast.csv", "--align", "trigger"]);
    let clock = clock(&document);
    assert_eq!(clock["events"], 20);
    assert!(err.contains("active low"), "{err}");
    let error_s = number(clock, "offset_s") - offset_s;
    assert!(error_s.abs() < 3e-4, "{error_s}");
    let (said, residual) = (number(clock, "uncertainty_s"), number(clock, "residual_s"));
    assert!(said < 1e-4 && residual < 5e-4, "{said} {residual}");
    // 20 edges known to 1 ms/√12 over 1.8 s: about 120 ppm
    assert!(number(clock, "drift_error_ppm") < 150.0);
    if let Some(found) = clock["drift_ppm"].as_f64() {
        assert!((found - drift * 1e6).abs() < 3.0 * number(clock, "drift_error_ppm"), "{found} ppm");
    }
}

#[test]
fn drift_is_found_where_the_edges_are_sharp_enough_to_show_it() {
    let bench = bench(true);
    let rig = Rig::load(&bench.path("rig.toml")).unwrap();
    let part = |file: &str, rate_hz: f64, begins_s: f64, offset_s: f64, drift: f64| {
        let time_s: Vec<f64> = (0..(3.0 * rate_hz) as usize).map(|i| begins_s + i as f64 / rate_hz).collect();
        let edge = |t: f64| f64::from((offset_s + (1.0 + drift) * t).rem_euclid(0.37) < 0.11 && t > 0.1);
        let value = time_s.iter().map(|&t| edge(t)).collect();
        let mut series = vec![Series::default(); 3];
        series[2] = Series { time_s, value, gaps: vec![] };
        let recording = Recording { rig: rig.clone(), series, run: RunInfo::default() };
        Part { file: file.into(), recording, start_digit_s: None }
    };
    let parts = [part("a", 20_000.0, 0.0, 0.0, 0.0), part("b", 50_000.0, 0.0, 0.0004, 120e-6)];
    let clock = &align(&parts, None).unwrap()[1];
    let found = clock.drift_ppm.expect("a drift of 120 ppm over 3 s is seven steps");
    assert!((found - 120.0).abs() < 4.0 * clock.drift_error_ppm.unwrap(), "{clock}");
    assert!((clock.offset_s - 0.0004).abs() < 4.0 * clock.uncertainty_s + 2e-5, "{clock}");
    // a clock that counts from long before: where it stands is known where the edges are
    let parts = [part("a", 20_000.0, 0.0, 0.0, 0.0), part("b", 50_000.0, 50_000.0, -50_006.0, 120e-6)];
    let clock = &align(&parts, None).unwrap()[1];
    assert!((50_000.5..50_002.5).contains(&clock.at_s), "{clock}");
    let error_s = clock.time_s(clock.at_s) - (clock.at_s * (1.0 + 120e-6) - 50_006.0);
    assert!(error_s.abs() < 4.0 * clock.uncertainty_s + 2e-5 && clock.to_string().contains("time 5000"), "{clock}");
}

/// Pulses a whole number of samples apart fall between the samples in one way: many of them say no more than one.
#[test]
fn edges_that_fall_between_the_samples_in_one_way_are_not_averaged() {
    let rig = Rig::load(&bench(true).path("rig.toml")).unwrap();
    let part = |file: &str, rate_hz: f64, offset_s: f64| {
        let time_s: Vec<f64> = (0..(12.0 * rate_hz) as usize).map(|i| i as f64 / rate_hz).collect();
        let value =
            time_s.iter().map(|t| f64::from((t + offset_s).rem_euclid(1.0) < 0.1 && t + offset_s > 2.0)).collect();
        let mut series = vec![Series::default(); 3];
        series[2] = Series { time_s, value, gaps: vec![] };
        let recording = Recording { rig: rig.clone(), series, run: RunInfo::default() };
        Part { file: file.into(), recording, start_digit_s: None }
    };
    for phase in [0.001, 0.005, 0.009] {
        let clock = align(&[part("a", 1000.0, 0.0), part("b", 100.0, phase)], Some(Method::Trigger)).unwrap().remove(1);
        assert!(clock.events > 10 && (clock.offset_s - phase).abs() < 2.0 * clock.uncertainty_s, "{clock}");
    }
}

#[test]
fn the_front_itself_aligns_what_has_no_trigger() {
    let bench = bench(false);
    let truth = truth(&bench);
    // the front reaches 60 m a tenth of a second after the valve
    let offset_s = 0.151;
    bench.put("slow.csv", slow(&truth, "", None));
    bench.put("fast.csv", fast(&truth, "", None, offset_s, 0.0));
    let (document, err) = bench.import(0, &["slow.csv", "fast.csv"]);
    let clock = clock(&document);
    let (error, said) = (number(clock, "offset_s") - offset_s, number(clock, "uncertainty_s"));
    assert!(error.abs() < 3.0 * said && said < 2e-3, "off by {error} s, said {said} s: {err}");
    assert_eq!(clock["method"], "front");
    assert!(err.contains("wave speed") && err.contains("as measured"), "{err}");
}

#[test]
fn absolute_times_align_and_what_contradicts_them_is_said() {
    let bench = bench(false);
    let truth = truth(&bench);
    let offset_s = 0.1;
    bench.put("slow.csv", slow(&truth, "# start: 2026-03-14T09:26:53.000Z\n", None));
    bench.put("fast.csv", fast(&truth, "# Start time = 2026-03-14 10:26:53,100+01:00\n", None, offset_s, 0.0));
    let (document, err) = bench.import(0, &["slow.csv", "fast.csv", "--align", "time"]);
    assert!((number(clock(&document), "offset_s") - offset_s).abs() < 1e-9, "{err}");
    assert!(err.contains("which agrees"), "{err}");
    assert_eq!(bench.recording().run.start_unix_ns, 1_773_480_413_000_000_000);
    // a clock that is a quarter of a second wrong: the front knows better
    let args = ["slow.csv", "fast.csv", "--align", "time", "--start", "fast.csv=2026-03-14T09:26:53.350Z"];
    let (_, err) = bench.import(0, &args);
    assert!(err.contains("by front it would be -0.25") && err.contains("which contradicts it"), "{err}");
    assert!(err.contains("warning: fast.csv: by front it would be -0.25"), "{err}");
    // an hour without its zone: the two would share not one second, though both show the closure
    let hour = ["slow.csv", "fast.csv", "--start", "fast.csv=2026-03-14T10:26:53.101Z"];
    bench.refuses(&hour, &["do not overlap", "--zone", "--align front"]);
    let (_, err) = bench.import(0, &[&hour[..], &["--align", "time"]].concat());
    assert!(err.contains("warning: fast.csv: by their times the two recordings do not overlap"), "{err}");
    let (document, _) = bench.import(0, &[&hour[..], &["--align", "front"]].concat());
    assert!((number(clock(&document), "offset_s") - offset_s).abs() < 0.01);
    // starts written to the second are no match for a front
    bench.put("slow.csv", slow(&truth, "# start: 2026-03-14T09:26:53Z\n", None));
    bench.put("fast.csv", fast(&truth, "# start: 2026-03-14T09:26:53Z\n", None, offset_s, 0.0));
    let (document, _) = bench.import(0, &["slow.csv", "fast.csv"]);
    assert_eq!(clock(&document)["method"], "front");
    bench.refuses(&["slow.csv", "fast.csv", "--start", "2026-03-14T09:26:53Z"], &["--start must name its file"]);
}

#[test]
fn what_cannot_be_aligned_is_refused_with_what_each_method_lacks() {
    let bench = bench(true);
    bench.put("slow.csv", "time_s,P1,TRIG\n0,100,0\n0.1,100,0\n");
    bench.put("fast.csv", "time_s,PZ,TRIG\n0,100,0\n0.1,100,1\n");
    let words = [
        "by trigger: the trigger of slow.csv has no edge",
        "by time: slow.csv does not say when",
        "by front: no pressure sensor of",
    ];
    bench.refuses(&["slow.csv", "fast.csv"], &words);
    bench
        .refuses(&["slow.csv", "fast.csv", "--align", "time"], &["cannot be aligned with slow.csv by time", "--start"]);
    // one edge against three that are alike
    bench.put("slow.csv", "time_s,P1,TRIG\n0,100,0\n1,100,1\n2,100,1\n");
    bench.put("fast.csv", "time_s,PZ,TRIG\n0,1,0\n1,1,1\n2,1,0\n3,1,1\n4,1,0\n5,1,1\n");
    bench.refuses(&["slow.csv", "fast.csv", "--align", "trigger"], &["1 edges against 5 match in several ways"]);
    bench.put("slow.csv", "time_s,P1\n0,100\n");
    bench.refuses(&["slow.csv", "fast.csv", "--without", "PZ,TRIG,P7"], &["--without P7"]);
    bench.refuses(&["slow.csv", "fast.csv"], &["slow.csv has no trigger", "--map"]);
}

/// The slow and the fast system together, the fast sensor AC-coupled: the model fits both down to their noise.
#[test]
fn an_ac_coupled_sensor_of_the_other_system_is_modelled_as_such() {
    let bench = bench(true);
    let truth = truth(&bench);
    let voltage = |t: f64| 5.0 * ((t - CLOSURE_S + 0.003) / 0.006).clamp(0.0, 1.0);
    bench.put("slow.csv", slow(&truth, "", Some(&voltage)));
    bench.put("fast.csv", fast(&truth, "", Some(&voltage), 0.1, 0.0));
    bench.import(0, &["slow.csv", "fast.csv"]);
    let document = done(&["calibrate", text(&bench.path("run.mcap"))]);
    for sensor in document["runs"][0]["sensors"].as_array().unwrap() {
        // the noise is 0.2 kPa, 0.02 m
        assert!(number(sensor, "rmse_m") < 0.05, "{sensor}");
    }
    let speed = parameter(&document, "wave_speed_m_s");
    assert!((number(speed, "value") - 400.0).abs() < 0.5, "{speed}");
}

/// One system of several that see a closure without friction, which reaches the valve at [`CLOSURE_S`] of the true
/// time.
struct System {
    /// Of the sensors A to D, at 100 m (the valve), 80 m, 60 m and 40 m, those that are its own.
    own: std::ops::Range<usize>,
    rate_hz: f64,
    /// True time at its time 0, s.
    offset_s: f64,
    closing_s: f64,
}

impl System {
    /// Head of the wave at a place: up when the front comes, down when it comes back from the supply, and so on; kPa.
    fn kpa(&self, place_m: f64, true_s: f64) -> f64 {
        const SPEED_M_S: f64 = 400.0;
        let closed = |at_s: f64| ((true_s - CLOSURE_S - at_s) / self.closing_s).clamp(0.0, 1.0);
        let (out_s, back_s) = ((100.0 - place_m) / SPEED_M_S, (100.0 + place_m) / SPEED_M_S);
        let periods = (0..6).map(|n| (f64::from(n) * 200.0 / SPEED_M_S, if n % 2 == 0 { 1.0 } else { -1.0 }));
        200.0
            + periods
                .map(|(later_s, sign)| 160.0 * sign * (closed(later_s + out_s) - closed(later_s + back_s)))
                .sum::<f64>()
    }

    fn part(&self, file: &str, rig: &Rig) -> Part {
        let mut random = fastrand::Rng::with_seed(3);
        let time_s: Vec<f64> = (0..(2.0 * self.rate_hz) as usize).map(|i| i as f64 / self.rate_hz).collect();
        let series = (0..4).map(|sensor| {
            if !self.own.contains(&sensor) {
                return Series::default();
            }
            let place_m = [100.0, 80.0, 60.0, 40.0][sensor];
            let value = time_s.iter().map(|t| self.kpa(place_m, t + self.offset_s) + noise(&mut random)).collect();
            Series { time_s: time_s.clone(), value, gaps: vec![] }
        });
        let recording = Recording { rig: rig.clone(), series: series.collect(), run: RunInfo::default() };
        Part { file: file.into(), recording, start_digit_s: None }
    }
}

/// The rig of these systems, which says the sensors to be at these places.
fn stated(places_m: [f64; 4]) -> Rig {
    let places: Vec<String> = places_m.iter().map(|m| format!("position_m = {m:.1}")).collect();
    let names = ["A", "B", "C", "D"].into_iter();
    let sensors: Vec<_> = names.zip(&places).map(|(name, place)| (name, "pressure", "kPa", place.as_str())).collect();
    Rig::load(&Bench::new(&sensors).path("rig.toml")).unwrap()
}

const RIGHT: [f64; 4] = [100.0, 80.0, 60.0, 40.0];

#[test]
fn pairs_of_sensors_that_contradict_each_other_are_said_and_outvoted() {
    let offset_s = 0.151;
    let aligned = |places_m: [f64; 4]| {
        let rig = stated(places_m);
        let slow = System { own: 0..3, rate_hz: 1000.0, offset_s: 0.0, closing_s: 0.01 };
        let fast = System { own: 3..4, rate_hz: 5000.0, offset_s, closing_s: 0.01 };
        align(&[slow.part("slow", &rig), fast.part("fast", &rig)], Some(Method::Front)).unwrap().remove(1)
    };
    let right = aligned(RIGHT);
    assert!(right.warnings.is_empty() && right.events == 3, "{right:?}");
    assert!((right.offset_s - offset_s).abs() < 4.0 * right.uncertainty_s && right.uncertainty_s < 2e-3, "{right}");
    // one of three is elsewhere
    let outvoted = aligned([100.0, 80.0, 35.0, 40.0]);
    let [warning] = &outvoted.warnings[..] else { panic!("{outvoted:?}") };
    assert!(warning.contains("contradict each other") && warning.contains("these differ: C and D by "), "{warning}");
    assert!(warning.contains("left out") && outvoted.events == 2, "{outvoted:?}");
    assert!((outvoted.offset_s - offset_s).abs() < 5e-3, "{outvoted}");
    // each is elsewhere by another way
    let none = aligned([100.0, 95.0, 35.0, 40.0]);
    assert!(none.warnings[0].contains("is not reliable") && none.events == 3, "{none:?}");
    assert!((none.offset_s - offset_s).abs() < 3.0 * none.uncertainty_s, "{none:?}");
}

/// Of a front between two samples of the slower system no more is known than that.
#[test]
fn a_sharp_front_is_known_to_a_step_of_the_slower_system() {
    let rig = stated(RIGHT);
    for (slow_hz, fast_hz, closing_s) in [(500.0, 5000.0, 0.001), (100.0, 1000.0, 0.001), (100.0, 1000.0, 0.02)] {
        for phase in 0..8 {
            let offset_s = 0.15 + f64::from(phase) / 8.0 / slow_hz;
            let slow = System { own: 0..1, rate_hz: slow_hz, offset_s, closing_s };
            let fast = System { own: 2..3, rate_hz: fast_hz, offset_s: 0.0, closing_s };
            for (first, other, sign) in [(&fast, &slow, 1.0), (&slow, &fast, -1.0)] {
                let clocks =
                    align(&[first.part("first", &rig), other.part("other", &rig)], Some(Method::Front)).unwrap();
                let (error_s, said_s) = (clocks[1].offset_s - sign * offset_s, clocks[1].uncertainty_s);
                assert!(
                    error_s.abs() < 3.0 * said_s && said_s < 0.5 / slow_hz,
                    "{slow_hz} {closing_s} {phase}: {error_s} ± {said_s}"
                );
            }
        }
    }
}

/// A file that begins within the front, or behind it, shows part of one, or a later one.
#[test]
fn a_file_without_the_first_front_is_not_aligned_by_it() {
    let rig = stated(RIGHT);
    for (begins_s, is_there) in
        [(CLOSURE_S - 0.05, true), (CLOSURE_S + 0.03, false), (CLOSURE_S + 0.3, false), (CLOSURE_S + 0.8, false)]
    {
        let whole = System { own: 0..1, rate_hz: 1000.0, offset_s: 0.0, closing_s: 0.1 };
        let late = System { own: 0..1, offset_s: begins_s, ..whole };
        match align(&[whole.part("whole", &rig), late.part("late", &rig)], Some(Method::Front)) {
            Ok(clocks) => assert!(
                is_there && (clocks[1].offset_s - begins_s).abs() < 3.0 * clocks[1].uncertainty_s,
                "{begins_s} {}",
                clocks[1]
            ),
            Err(error) => assert!(
                !is_there && error.to_string().contains("no pressure sensor of late shows the first front"),
                "{error}"
            ),
        }
    }
}
