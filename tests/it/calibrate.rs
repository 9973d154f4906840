//! The main job: recordings in, fitted models out, with what they must show.
//!
//! The shipped recordings come from a simulator that shares nothing with this project; their truth is in
//! recordings/README.md. The others are made by the project's own model on a grid many times finer than the fit's, with
//! noise: they hold the fit to its standard errors.

use surgescope::fit::data::prepare::prepare;
use surgescope::fit::data::run_data::RunData;
use surgescope::fit::outcome::fit::Fit;
use surgescope::fit::search::calibrate::calibrate;
use surgescope::fit::search::options::Options;
use surgescope::model::effects::parse_list;
use surgescope::model::trace::Probe;
use surgescope::model::{Conditions, Model, Resolution, RunValues};
use surgescope::recording::{Recording, RunInfo, Series};
use surgescope::rig::{Coupling, Rig, SensorKind};
use surgescope::signal::inspect;
use surgescope::units::GRAVITY_M_S2;

use crate::common::{self, CREEP, done, here, printed, run, text};

fn run_of(recording: &Recording) -> RunData {
    prepare("run", &recording.rig, recording, &inspect(recording).unwrap())
}

fn fit(recordings: &[Recording], effects: &str) -> Fit {
    let runs: Vec<RunData> = recordings.iter().map(run_of).collect();
    calibrate(&recordings[0].rig, &runs, &parse_list(effects).unwrap(), &Options::default(), &|_| {}).unwrap()
}

fn shipped(name: &str) -> Recording {
    surgescope::storage::read(&here("recordings").join(name)).unwrap()
}

fn over_noise(fit: &Fit) -> f64 {
    fit.runs.iter().map(|r| r.rmse_m / r.noise_m).fold(0.0, f64::max)
}

/// How many standard errors a parameter is from its truth.
fn z(fit: &Fit, name: &str, truth: f64) -> f64 {
    let p = fit.parameters.iter().find(|p| p.name == name).unwrap_or_else(|| panic!("{name} in {:?}", fit.parameters));
    assert!(p.standard_error().is_finite() && !p.at_bound, "{p:?}");
    (p.value - truth) / p.standard_error()
}

#[test]
fn creep_added_to_the_base_model_brings_the_error_down_to_the_noise() {
    let recording = [shipped("hdpe-creep.mcap")];
    let (base, full) = (fit(&recording, "none"), fit(&recording, "viscoelastic-wall"));
    assert!(base.runs[0].rmse_m > 10.0 * full.runs[0].rmse_m, "{} {}", base.runs[0].rmse_m, full.runs[0].rmse_m);
    assert!(over_noise(&full) <= 1.5, "{}", over_noise(&full));
    assert_eq!(full.labels(), ["viscoelastic-wall:3"], "the evidence finds the three elements that are there");
    let truth = [
        ("wave_speed_m_s", 342.272),
        ("J1_per_GPa", 0.13146),
        ("tau1_s", 0.032666),
        ("J2_per_GPa", 0.12027),
        ("tau2_s", 0.32123),
        ("J3_per_GPa", 0.12839),
        ("tau3_s", 1.55286),
    ];
    for (name, value) in truth {
        assert!(z(&full, name, value).abs() < 4.0, "{name}: {:.1} standard errors off", z(&full, name, value));
    }
}

#[test]
fn a_recording_with_nothing_missing_is_fitted_to_its_noise() {
    let full = fit(&[shipped("hdpe-nothing-missing.mcap")], "viscoelastic-wall");
    assert!(over_noise(&full) <= 1.5, "{}", over_noise(&full));
    assert!(z(&full, "wave_speed_m_s", 360.2575).abs() < 4.0);
}

#[test]
fn more_elements_never_fit_worse() {
    let recording = [shipped("hdpe-creep.mcap")];
    let errors: Vec<f64> = (1..=4).map(|n| fit(&recording, &format!("viscoelastic-wall:{n}")).runs[0].rmse_m).collect();
    assert!(errors.windows(2).all(|w| w[1] < 1.001 * w[0]), "{errors:?}");
}

/// What a made-up run is made with.
struct Made<'a> {
    rig: &'a str,
    effects: &'a str,
    shared: &'a [f64],
    run: RunValues,
    reaches: usize,
    duration_s: f64,
    rate_hz: f64,
    noise_m: f64,
}

const LEAD_S: f64 = 0.5;

/// Normal numbers, the same at every run of the tests.
fn gauss(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed;
    let mut uniform = move || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        ((state >> 11) as f64 + 0.5) / (1u64 << 53) as f64
    };
    move || (-2.0 * uniform().ln()).sqrt() * (std::f64::consts::TAU * uniform()).cos()
}

impl Made<'_> {
    /// The recording, with the supply's head moving as `supply` says where the rig's upstream end is measured.
    fn recording(&self, supply: Option<fn(f64) -> f64>) -> Recording {
        let rig = Rig::from_toml(self.rig, "made.toml").unwrap();
        let water = rig.fluid.properties(rig.fluid.temperature_degc);
        let model = Model::new(&rig, &water, &parse_list(self.effects).unwrap());
        let places: Vec<Probe> = rig.pressure_sensors().map(|(_, s)| Probe::head(s.place())).collect();
        let fine: Vec<f64> = (0..20_000).map(|i| f64::from(i) * self.duration_s / 20_000.0).collect();
        let supply_deviation = supply.map(|f| (fine.clone(), fine.iter().map(|&t| f(t)).collect()));
        let conditions = Conditions { supply_deviation, ..Conditions::of(water) };
        let resolution = Resolution { reaches: self.reaches, duration_s: self.duration_s };
        let simulated = model.simulate(&conditions, self.shared, &self.run, resolution, &places).unwrap();
        let samples = ((LEAD_S + self.duration_s) * self.rate_hz) as usize;
        let time_s: Vec<f64> = (0..samples).map(|i| i as f64 / self.rate_hz).collect();
        let mut noise = gauss(42);
        let weight = water.density_kg_m3 * GRAVITY_M_S2;
        let mut traces = rig.pressure_sensors().map(|(_, s)| s).zip(simulated.traces);
        let flow = self.run.initial_velocity_m_s * rig.pipes.last().unwrap().area_m2();
        let mut series = Vec::new();
        for sensor in &rig.sensors {
            let value: Vec<f64> = match sensor.kind {
                SensorKind::Pressure => {
                    let (sensor, trace) = traces.next().unwrap();
                    let trace = model.sensed(self.shared, sensor, trace).unwrap();
                    let z = if sensor.coupling == Coupling::Ac { 0.0 } else { rig.elevation_m(sensor.position_m) };
                    let head = |t: f64| trace.at(t - LEAD_S) - z + self.noise_m * noise();
                    time_s
                        .iter()
                        .copied()
                        .map(head)
                        .map(|h| sensor.unit.from_si(h * weight, water.density_kg_m3))
                        .collect()
                }
                _ => vec![sensor.unit.from_si(flow, water.density_kg_m3); samples],
            };
            series.push(Series { time_s: time_s.clone(), value, gaps: Vec::new() });
        }
        Recording { rig: rig.clone(), series, run: RunInfo::default() }
    }

    fn errors(&self, fit: &Fit) -> Vec<(String, f64)> {
        let run = [
            ("valve_head_m", self.run.valve_head_m),
            ("closing_time_s", self.run.closing_time_s),
            ("closure_start_s", LEAD_S),
            ("initial_velocity_m_s", self.run.initial_velocity_m_s),
        ];
        let shared = fit.parameters.iter().map(|p| p.name.as_str()).zip(self.shared.iter().copied());
        shared.take(self.shared.len()).chain(run).map(|(name, truth)| (name.to_owned(), z(fit, name, truth))).collect()
    }

    fn must_come_back(&self, recording: &Recording, most_over_noise: f64) {
        let fitted = fit(std::slice::from_ref(recording), self.effects);
        assert!(over_noise(&fitted) < most_over_noise, "{} x the noise", over_noise(&fitted));
        let errors = self.errors(&fitted);
        assert!(errors.iter().all(|(_, z)| z.abs() < 4.0), "{errors:?}\n{:?}", fitted.parameters);
    }
}

fn rig_text(pipes: &str, upstream: &str, closing_time_s: f64, sensors: &str) -> String {
    format!(
        "name = \"made\"\n[fluid]\nname = \"water\"\ntemperature_degC = 20.0\n{pipes}[upstream]\nkind = \"{upstream}\"\n[downstream]\nkind = \
         \"valve\"\nclosing_time_s = {closing_time_s}\n{sensors}"
    )
}

fn pipe(name: &str, length_m: f64, diameter_mm: f64, wall_mm: f64, material: &str) -> String {
    format!(
        "[[pipe]]\nname = \"{name}\"\nlength_m = {length_m}\ninner_diameter_mm = {diameter_mm}\nwall_thickness_mm = {wall_mm}\nmaterial = \
         \"{material}\"\n"
    )
}

fn pressure(name: &str, position_m: f64, more: &str) -> String {
    format!("[[sensor]]\nname = \"{name}\"\nkind = \"pressure\"\nposition_m = {position_m}\nunit = \"kPa\"\n{more}\n")
}

const METER: &str = "[[sensor]]\nname = \"Q1\"\nkind = \"flow\"\nposition_m = 0.0\nunit = \"L/s\"\n";

fn fast_copper<'a>(rig: &'a str, shared: &'a [f64]) -> Made<'a> {
    Made {
        rig,
        effects: "none",
        shared,
        run: RunValues { initial_velocity_m_s: 0.3, valve_head_m: 60.0, closing_time_s: 0.009, friction_scale: 1.0 },
        reaches: 2000,
        duration_s: 2.0,
        rate_hz: 5000.0,
        noise_m: 0.03,
    }
}

/// Sharp fronts in metal: the grid's own error would pull the parameters many standard errors away.
#[test]
fn a_fast_closure_in_copper_comes_back_within_its_standard_errors() {
    let sensors = pressure("P1", 37.2, "") + &pressure("P2", 18.0, "") + METER;
    let rig = rig_text(&pipe("main", 37.2, 22.1, 1.63, "copper"), "reservoir", 0.01, &sensors);
    let made = fast_copper(&rig, &[1310.0]);
    made.must_come_back(&made.recording(None), 1.15);
}

#[test]
fn one_sensor_and_no_flow_meter_are_enough() {
    let rig = rig_text(&pipe("main", 37.2, 22.1, 1.63, "copper"), "reservoir", 0.01, &pressure("P1", 37.2, ""));
    let made = fast_copper(&rig, &[1310.0]);
    made.must_come_back(&made.recording(None), 1.15);
}

/// Two pipes whose joint lies on no node of an ordinary grid.
#[test]
fn pipes_in_series_come_back() {
    let sensors = pressure("P1", 60.0, "") + &pressure("P2", 25.0, "") + METER;
    let pipes = pipe("up", 40.0, 30.0, 3.0, "steel") + &pipe("down", 20.0, 20.0, 3.0, "steel");
    let rig = rig_text(&pipes, "reservoir", 0.012, &sensors);
    let made = Made {
        reaches: 2100,
        run: RunValues { initial_velocity_m_s: 0.5, valve_head_m: 100.0, closing_time_s: 0.012, friction_scale: 1.0 },
        ..fast_copper(&rig, &[1000.0, 1250.0])
    };
    let recording = made.recording(None);
    let fitted = fit(std::slice::from_ref(&recording), "none");
    assert!(over_noise(&fitted) < 1.5, "{} x the noise", over_noise(&fitted));
    for (name, truth) in [("wave_speed_m_s[up]", 1000.0), ("wave_speed_m_s[down]", 1250.0)] {
        let p = fitted.parameters.iter().find(|p| p.name == name).unwrap();
        assert!((p.value / truth - 1.0).abs() < 2e-3, "{p:?}");
    }
}

/// A tank that sways: measured at the supply, it drives the model, noise and all.
#[test]
fn a_measured_supply_is_followed() {
    let sensors = pressure("P0", 0.0, "") + &pressure("P1", 37.2, "") + METER;
    let rig = rig_text(&pipe("main", 37.2, 22.1, 1.63, "copper"), "measured", 0.01, &sensors);
    let made = fast_copper(&rig, &[1310.0]);
    let recording = made.recording(Some(|t| 1.5 * (1.0 - (-t / 0.6).exp()) + 0.3 * (8.0 * t).sin()));
    let fitted = fit(std::slice::from_ref(&recording), "none");
    assert_eq!(fitted.runs[0].sensors.len(), 1, "the driver is no evidence");
    assert!(over_noise(&fitted) < 1.6, "{} x the noise", over_noise(&fitted));
    let a = fitted.parameters.iter().find(|p| p.name == "wave_speed_m_s").unwrap();
    assert!((a.value / 1310.0 - 1.0).abs() < 1e-3, "{a:?}");
}

/// A piezoelectric sensor at the valve sees no steady pressure; one further up does.
#[test]
fn an_ac_coupled_sensor_is_fitted_as_one() {
    let sensors = pressure("P1", 37.2, "coupling = \"ac\"\ntime_constant_s = 1.5\nelevation_m = 0.0")
        + &pressure("P2", 18.0, "")
        + METER;
    let rig = rig_text(&pipe("main", 37.2, 22.1, 1.63, "copper"), "reservoir", 0.01, &sensors);
    let made = fast_copper(&rig, &[1310.0]);
    made.must_come_back(&made.recording(None), 1.15);
    let alone = rig_text(
        &pipe("main", 37.2, 22.1, 1.63, "copper"),
        "reservoir",
        0.01,
        &pressure("P1", 37.2, "coupling = \"ac\"\ntime_constant_s = 1.5"),
    );
    let made = fast_copper(&alone, &[1310.0]);
    let fitted = fit(&[made.recording(None)], "none");
    assert!(over_noise(&fitted) < 1.15, "{}", over_noise(&fitted));
    assert!(z(&fitted, "wave_speed_m_s", 1310.0).abs() < 4.0);
}

/// A closure slower than 2L/a leaves no plateau.
#[test]
fn a_slow_closure_comes_back() {
    let sensors = pressure("P1", 37.2, "") + METER;
    let rig = rig_text(&pipe("main", 37.2, 22.1, 1.63, "copper"), "reservoir", 0.25, &sensors);
    let base = fast_copper(&rig, &[1310.0]);
    let made = Made { run: RunValues { closing_time_s: 0.2, ..base.run }, ..base };
    made.must_come_back(&made.recording(None), 1.15);
}

/// Steel and HDPE in series: only the plastic creeps.
#[test]
fn only_the_plastic_pipe_creeps() {
    let sensors = pressure("P1", 100.0, "") + &pressure("P2", 60.0, "") + METER;
    let pipes = pipe("steel", 60.0, 50.0, 3.0, "steel") + &pipe("plastic", 40.0, 50.0, 5.0, "HDPE");
    let rig = rig_text(&pipes, "reservoir", 0.05, &sensors);
    let made = Made {
        effects: "viscoelastic-wall:1",
        duration_s: 6.0,
        rate_hz: 1000.0,
        reaches: 1400,
        run: RunValues { initial_velocity_m_s: 0.4, valve_head_m: 60.0, closing_time_s: 0.05, friction_scale: 1.0 },
        ..fast_copper(&rig, &[1200.0, 380.0, 0.15, 0.2])
    };
    made.must_come_back(&made.recording(None), 1.2);
}

/// Four elements of creep for a copper pipe that has none: those that vanish leave the results of the others as they
/// are.
#[test]
fn elements_that_vanish_spare_the_others() {
    let fit = fit(&[shipped("copper-leak.mcap")], "viscoelastic-wall:4");
    let gone: Vec<&String> = fit.unidentifiable.iter().flat_map(|u| &u.parameters).collect();
    assert!(fit.converged && gone.len() >= 2, "{gone:?}");
    let elements = fit.parameters.iter().filter(|p| p.name.starts_with('J') || p.name.starts_with("tau"));
    for p in elements {
        if gone.contains(&&p.name) {
            assert!(p.standard_error().is_nan(), "{p:?}");
        } else {
            assert!(p.standard_error() < 0.2 * p.value && p.interval_95.0 > 0.0, "{p:?}");
        }
    }
}

/// The sway of a tank before the closure, ten times the noise, which dies away with the flow: the first rise is known
/// no better than that.
#[test]
fn noise_that_dies_away_counts_where_the_valve_closes() {
    let recording = shipped("hdpe-nothing-missing.mcap");
    let options = Options { most_reaches: 64, ..Options::default() };
    let error = |sway_m: f64| {
        let mut run = run_of(&recording);
        let mut random = fastrand::Rng::with_seed(3);
        for sensor in &mut run.sensors {
            let mut sway = 0.0;
            let before = sensor.time_s.partition_point(|&t| t < run.start.closure_s.0 - 0.05);
            for head in &mut sensor.head_m[..before] {
                sway = 0.95 * sway + (random.f64() - 0.5);
                *head += sway_m * sway;
            }
        }
        let effects = parse_list("viscoelastic-wall:2").unwrap();
        let fit = calibrate(&recording.rig, &[run], &effects, &options, &|_| {}).unwrap();
        (
            fit.parameters.iter().find(|p| p.name == "closing_time_s").unwrap().standard_error(),
            fit.runs[0].noise_dies_away,
        )
    };
    let ((even, even_said), (swaying, swaying_said)) = (error(0.0), error(0.2));
    assert!(!even_said && swaying_said);
    assert!(swaying > 3.0 * even, "{swaying} for {even}");
}

/// Whatever an effect can do, it can also vanish: the model with it fits no worse than the one without.
#[test]
fn a_model_that_contains_another_ends_no_worse() {
    let rmse_m = |effects: &str| {
        let fit = done(&["calibrate", CREEP, "--effects", effects, "--against", "none", "--most-reaches", "32"]);
        fit["rmse_m"].as_f64().unwrap()
    };
    let smaller = rmse_m("none");
    for effect in
        ["clock-skew@P2", "sensor-lag@P1", "supply-drift", "air-pocket", "side-branch", "section-change", "leak"]
    {
        let bigger = rmse_m(effect);
        assert!(bigger < 1.001 * smaller, "{effect}: {bigger} m, {smaller} m without");
    }
    let (one, both) = (rmse_m("blockage"), rmse_m("clock-skew@P3,blockage"));
    assert!(both < 1.001 * one, "{both} m, {one} m without clock-skew");
}

/// Much gas, whose waves steepen. A fit that starts with gas that follows at once ends at 38 times the noise, where it
/// follows far too late.
#[test]
fn much_gas_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let (rig, record) = (folder.path().join("rig.toml"), folder.path().join("run.mcap"));
    let sensors = [("P1", 45.31), ("P2", 33.28), ("P3", 11.72)].map(|(name, at_m)| {
        format!("[[sensor]]\nname = \"{name}\"\nkind = \"pressure\"\nposition_m = {at_m}\nunit = \"kPa\"\n")
    });
    let pipe = "name = \"steel\"\n[fluid]\nname = \"water\"\ntemperature_degC = 19.0\n[[pipe]]\nname = \"main\"\n\
                length_m = 45.31\ninner_diameter_mm = 32.0\nwall_thickness_mm = 1.92\nmaterial = \"steel\"\n\
                [upstream]\nkind = \"reservoir\"\n[downstream]\nkind = \"valve\"\nclosing_time_s = 0.026\n";
    std::fs::write(&rig, pipe.to_owned() + &sensors.concat()).unwrap();
    let truth = [
        "gas_fraction=3.26e-5",
        "gas_lag_s=2e-5",
        "wave_speed_m_s=1206.36",
        "initial_velocity_m_s=0.3067",
        "valve_head_m=48.09",
        "closing_time_s=0.0212",
    ];
    let made =
        ["simulate", "--rig", text(&rig), "--effects", "entrained-gas", "--seed", "1", "-o", text(&record), "--set"];
    printed(run(&[&made[..], &truth].concat()));
    let fit = done(&["calibrate", text(&record), "--effects", "entrained-gas", "--most-reaches", "64"]);
    let over_noise = common::over_noise(&fit);
    assert!(over_noise < 2.0, "{over_noise}");
}
