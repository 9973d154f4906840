//! Tests of the calibration's residuals.

use crate::fit::data::run_data::RunStart;
use crate::fit::data::run_data::{Meter, SensorData};
use crate::fit::numeric::least_squares::jacobian;
use crate::fit::numeric::uncertainty::covariance;
use crate::fit::problem::fit_problem::*;
use crate::fit::problem::test_record::{HDPE, record};
use crate::model::Conditions;
use crate::model::effects::parse_list;
use crate::rig::Rig;

const RIG: &str = r#"
name = "two sensors"
[fluid]
name = "water"
temperature_degC = 20.0
[[pipe]]
name = "main"
length_m = 100.0
inner_diameter_mm = 50.0
wall_thickness_mm = 5.0
material = "HDPE"
[upstream]
kind = "reservoir"
[downstream]
kind = "valve"
closing_time_s = 0.1
[[sensor]]
name = "P1"
kind = "pressure"
position_m = 100.0
unit = "kPa"
[[sensor]]
name = "P2"
kind = "pressure"
position_m = 40.0
unit = "kPa"
"#;

fn run(rig: &Rig, file: &str) -> RunData {
    let time_s: Vec<f64> = (0..400).map(|i| i as f64 * 0.01).collect();
    let sensors = rig
        .pressure_sensors()
        .map(|(_, sensor)| SensorData {
            sensor: sensor.clone(),
            head_m: time_s.iter().map(|t| 20.0 + (9.0 * t).sin()).collect(),
            time_s: time_s.clone(),
            noise_m: 0.05,
            total_noise_m: 0.05,
            hum: Vec::new(),
            lines: Vec::new(),
            offset_sd_m: 0.2,
            saturated: 0,
        })
        .collect();
    RunData {
        file: file.into(),
        sensors,
        conditions: Conditions::of(rig.fluid.properties(20.0)),
        start: RunStart {
            closure_s: (0.5, 1e-3),
            velocity_m_s: (0.4, 0.01),
            valve_head_m: (20.0, None),
            wave_speed_ratio: None,
            closing_time: None,
        },
        extrema: vec![Vec::new(); 2],
        meter: (file == "a").then_some(Meter { place: 0.0.into(), flow_m3_s: 8e-4, relative_sd: 0.01 }),
    }
}

/// The shortcuts of `residuals_moved` (other runs copied, offsets added, the latest simulation read) give what a full
/// evaluation gives.
#[test]
fn moving_one_variable_by_a_shortcut_changes_nothing() {
    let rig = Rig::from_toml(RIG, "rig.toml").unwrap();
    let runs = [run(&rig, "a"), run(&rig, "b")];
    let effects = parse_list("viscoelastic-wall:1,sensor-lag@P2").unwrap();
    let model = Model::new(&rig, &runs[0].conditions.water, &effects);
    let window = Window { reaches: 20, horizon_s: 2.0, stride: 3 };
    let problem = FitProblem::new(&model, &runs, window);
    let mut x = problem.start();
    let first_offset = problem.parameters.iter().position(|p| p.name.starts_with("offset")).unwrap();
    x[first_offset] = 0.1;
    let base = problem.residuals(&x).unwrap();
    let priors = problem.parameters.iter().filter(|p| p.prior.is_some()).count();
    assert_eq!(base.len(), problem.samples() + priors + 1, "one run has a meter");
    let mut from_the_latest = Vec::new();
    for j in 0..x.len() {
        let mut moved = x.clone();
        moved[j] += problem.difference_step(j);
        let values = problem.values(&moved);
        if (0..2).all(|r| problem.latest(r, &values).is_some()) {
            from_the_latest.push(problem.parameters[j].name.clone());
        }
        let short = problem.residuals_moved(&moved, j, &base).unwrap();
        let full = FitProblem::new(&model, &runs, window).residuals(&moved).unwrap();
        let worst = short.iter().zip(&full).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-9, "{}: {worst}", problem.parameters[j].name);
        assert!(full.iter().zip(&base).any(|(a, b)| a != b), "{} changes nothing", problem.parameters[j].name);
    }
    let offsets = ["offset_m[P1]", "offset_m[P2]"];
    let once = ["lag_time_s", "lag_damping_ratio", "position_m[P2]"].into_iter();
    let expected: Vec<&str> = once.chain((0..2).flat_map(|_| ["closure_start_s"].into_iter().chain(offsets))).collect();
    assert_eq!(from_the_latest, expected);
}

/// A value that is held at an end of all that can be simulated has a slope, too: to the inside.
#[test]
fn what_is_held_may_stand_at_either_end_of_the_pipe() {
    let rig = Rig::from_toml(RIG, "rig.toml").unwrap();
    let runs = [run(&rig, "a")];
    let effects = parse_list("section-change").unwrap();
    let model = Model::new(&rig, &runs[0].conditions.water, &effects);
    let mut problem = FitProblem::new(&model, &runs, Window { reaches: 20, horizon_s: 2.0, stride: 3 });
    let section = ["section_start_m", "section_end_m"]
        .map(|name| problem.parameters.iter().position(|p| p.name == name).unwrap());
    let mut values = problem.start_values();
    (values[section[0]], values[section[1]]) = (0.0, 100.0);
    problem.hold(&section, &values);
    let x = problem.variables(&values);
    let columns = jacobian(&problem, &x, &problem.residuals(&x).unwrap()).unwrap();
    for j in section {
        assert!(
            columns[j].iter().all(|slope| slope.is_finite()) && columns[j].iter().any(|slope| *slope != 0.0),
            "{}",
            problem.parameters[j].name
        );
    }
}

/// A closure that takes six times 2L/a: another start and another closing time that leave its end where it is hardly
/// change the head. How far they are known is the same on every grid.
#[test]
fn start_and_duration_of_a_slow_closure_are_known_alike_on_every_grid() {
    let text = HDPE.replace("80.0", "60.0").replace("closing_time_s = 0.1", "closing_time_s = 0.53");
    let text = text.replace("50.0", "10.0").replace("5.0", "1.0").replace("HDPE", "copper");
    let rig = Rig::from_toml(&text, "rig.toml").unwrap();
    let run = RunValues { initial_velocity_m_s: 1.0, valve_head_m: 20.5, closing_time_s: 0.53, friction_scale: 1.0 };
    let runs = [record(&rig, &[], &[1363.0], run, 0.14, 2.3)];
    let model = Model::new(&rig, &runs[0].conditions.water, &[]);
    let error_s = |reaches| {
        let problem = FitProblem::new(&model, &runs, Window { reaches, horizon_s: f64::INFINITY, stride: 1 });
        let x = problem.start();
        let residuals = problem.residuals(&x).unwrap();
        let columns = jacobian(&problem, &x, &residuals).unwrap();
        let closing = problem.closing_time_variable(0);
        let known = covariance(&columns, &vec![false; x.len()])[(closing, closing)].sqrt();
        known * problem.stretch(closing, run.closing_time_s)
    };
    let errors_s = [64, 128, 256].map(error_s);
    // with steps far below the grid's they would rise by the root of two from grid to grid, from a fifth of what they
    // are
    assert!(errors_s.iter().all(|e| (e / errors_s[2] - 1.0).abs() < 0.05), "{errors_s:?}");
}
