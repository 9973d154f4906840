//! The whole way, on records whose forcing is known.

use crate::diagnose::rest::cells::{CELLS, Run, Times};
use crate::diagnose::rest::explain;
use crate::diagnose::rest::explanation::Site;
use crate::diagnose::rest::forced::Forced;
use crate::diagnose::rest::places::Spot;
use crate::diagnose::rest::pulse::{REACH, spline};
use crate::diagnose::rest::response::response;
use crate::fit::data::run_data::RunData;
use crate::fit::problem::test_record::{HDPE, record};
use crate::fit::search::calibrate::calibrate;
use crate::fit::search::options::Options;
use crate::model::effects::parse_list;
use crate::model::trace::Probe;
use crate::model::{Conditions, Model, Resolution, RunValues};
use crate::rig::Rig;

const NOISE_M: f64 = 0.05;
const CHANGE_M: f64 = 4.0;
const TAU_S: f64 = 1.5;

/// A pipe of steel with a sensor at its valve and one halfway.
fn rig() -> Rig {
    let second = "[[sensor]]\nname = \"P2\"\nkind = \"pressure\"\nposition_m = 40.0\nunit = \"kPa\"\n";
    let steel = HDPE.replace("material = \"HDPE\"", "material = \"steel\"\nfriction_factor = 0.02");
    Rig::from_toml(&format!("{steel}{second}"), "rig.toml").unwrap()
}

/// What both sensors show of a test, with a supply that drifts by `change_m`.
fn run(rig: &Rig, change_m: f64) -> RunData {
    let own = RunValues { initial_velocity_m_s: 0.25, valve_head_m: 45.0, closing_time_s: 0.05, friction_scale: 1.0 };
    let effects = parse_list("supply-drift").unwrap();
    let shared = [1150.0, change_m, TAU_S];
    let mut run = record(rig, &effects, &shared, own, NOISE_M, 4.0);
    let water = rig.fluid.properties(20.0);
    let model = Model::new(rig, &water, &effects);
    let resolution = Resolution { reaches: 601, duration_s: 4.0 };
    let probes = [Probe::head(40.0)];
    let seen = model.simulate(&Conditions::of(water), &shared, &own, resolution, &probes).unwrap();
    let mut second = run.sensors[0].clone();
    second.sensor = rig.sensors[1].clone();
    let mut random = fastrand::Rng::with_seed(2);
    let mut noise = || NOISE_M * 12f64.sqrt() * (random.f64() - 0.5);
    second.head_m = second.time_s.iter().map(|t| seen.traces[0].at(t - 0.2) + noise()).collect();
    run.extrema.push(run.extrema[0].clone());
    run.sensors.push(second);
    run
}

/// The drift is `ΔH (1 - exp(-t/T))`; an explanation without a shape given finds it at the supply.
#[test]
fn a_supply_that_drifts_is_found_with_its_waveform() {
    let rig = rig();
    let runs = [run(&rig, CHANGE_M)];
    let options = Options { most_reaches: 96, ..Options::default() };
    let fit = calibrate(&rig, &runs, &[], &options, &|_| {}).unwrap();
    let found = explain(&rig, &runs, &fit, &options, &|_| {}).unwrap();
    let first = found.first().expect("something is left");
    assert_eq!(first.site, Site::Supply, "{}", first.says);
    let (mut tt, mut vv, mut tv) = (0.0, 0.0, 0.0);
    let n = first.value.len() as f64;
    let truth: Vec<f64> = first.time_s.iter().map(|t| -CHANGE_M * (-t / TAU_S).exp_m1()).collect();
    let (mean_t, mean_v) = (truth.iter().sum::<f64>() / n, first.value.iter().sum::<f64>() / n);
    for (t, v) in truth.iter().zip(&first.value) {
        tt += (t - mean_t).powi(2);
        vv += (v - mean_v).powi(2);
        tv += (t - mean_t) * (v - mean_v);
    }
    let alike = tv / (tt * vv).sqrt();
    assert!(alike > 0.95, "correlation {alike}: {}", first.says);
    let last = (first.value[first.value.len() - 5], truth[truth.len() - 5]);
    assert!((last.0 - last.1).abs() < 0.15 * CHANGE_M, "{last:?}");
}

#[test]
fn where_nothing_is_hidden_nothing_is_shown() {
    let rig = rig();
    let runs = [run(&rig, 0.0)];
    let options = Options { most_reaches: 96, ..Options::default() };
    let fit = calibrate(&rig, &runs, &[], &options, &|_| {}).unwrap();
    assert_eq!(explain(&rig, &runs, &fit, &options, &|_| {}).unwrap(), []);
}

/// The second sensor shows 0.3% more of the surge. Two right solvers may differ by as little: it is no interference.
#[test]
fn a_small_share_of_the_surge_is_the_models_own_error() {
    let rig = rig();
    let mut runs = [run(&rig, 0.0)];
    let second = &mut runs[0].sensors[1];
    let before_m = second.head_m[0];
    second.head_m.iter_mut().for_each(|head| *head += 0.003 * (*head - before_m));
    let options = Options { most_reaches: 96, ..Options::default() };
    let fit = calibrate(&rig, &runs, &[], &options, &|_| {}).unwrap();
    assert!(fit.mean_square() > 1.15, "{}", fit.mean_square());
    assert_eq!(explain(&rig, &runs, &fit, &options, &|_| {}).unwrap(), []);
}

/// A run with nothing hidden, under the model that is fitted to it, on 64 reaches.
fn quiet(check: impl FnOnce(&Rig, &Run)) {
    let rig = rig();
    let runs = [run(&rig, 0.0)];
    let options = Options { most_reaches: 96, ..Options::default() };
    let fit = calibrate(&rig, &runs, &[], &options, &|_| {}).unwrap();
    let model = Model::new(&rig, &runs[0].conditions.water, &[]);
    let at = Run::new(&model, &runs, &fit, 64).unwrap();
    check(&rig, &at);
}

/// A head of the supply reaches the closed valve after `L/a`, doubled; a flow out there lowers its head at once by
/// `a/(gA)`. Friction takes a few per cent.
#[test]
fn pulses_arrive_as_waves_do() {
    quiet(|rig, at| {
        let times = Times { knot_s: at.period_s() / 32.0, before: 17, knots: 81 };
        let way_s = 0.25 * at.period_s();
        let of = |spot: Spot| response(at, &spot, &times).unwrap()[0][0].clone();
        // A quarter of a period is eight knots.
        let shape = |cell: usize, late: f64| spline((cell as f64 + 0.5) / CELLS as f64 - REACH as f64 - late);
        let (supply, valve) = (of(Spot::Supply), of(Spot::Valve));
        let impedance = 80.0 / way_s / (9.806_65 * rig.pipes[0].area_m2());
        for cell in 0..2 * REACH * CELLS {
            let arrived = supply[cell + 8 * CELLS];
            assert!((arrived - 2.0 * shape(cell, 0.0)).abs() < 0.08, "{arrived} {}", shape(cell, 0.0));
            assert!((valve[cell] / impedance + shape(cell, 0.0)).abs() < 0.04, "{} {impedance}", valve[cell]);
        }
        assert!(supply[..8 * CELLS - CELLS].iter().all(|v| v.abs() < 1e-6));
    });
}

/// A hundredth of the surge does what its pulses do. Twice the surge sends flow through the whole pipe, which has its
/// friction.
#[test]
fn a_small_forcing_is_the_sum_of_its_pulses_and_a_large_one_is_not() {
    quiet(|rig, at| {
        let times = Times { knot_s: at.period_s() / 32.0, before: 17, knots: 145 };
        let flow_m3_s = 0.25 * rig.pipes[0].area_m2();
        for (spot, whole) in [(Spot::Supply, 29.0), (Spot::Valve, flow_m3_s), (Spot::Pipe(None, 30.0), flow_m3_s)] {
            let apart = |size: f64| {
                let shape = |k: usize| size * whole * (-((k as f64 - 60.0) / 8.0).powi(2)).exp();
                let knots = vec![(0..times.knots).map(shape).collect()];
                let forced = Forced { spot: spot.clone(), times, knots };
                let (done, linear) = (forced.done_m(at, &at.x).unwrap(), forced.linear_m(at).unwrap());
                let size = |of: &[Vec<f64>]| of.iter().flatten().map(|v| v * v).sum::<f64>().sqrt();
                let bend: Vec<Vec<f64>> =
                    done.iter().zip(&linear).map(|(d, l)| d.iter().zip(l).map(|(d, l)| d - l).collect()).collect();
                size(&bend) / size(&done)
            };
            let (small, large) = (apart(0.01), apart(2.0));
            assert!(small < 0.03, "{spot:?}: {small}");
            assert!(large > small * if spot == Spot::Supply { 10.0 } else { 1.0 }, "{spot:?}: {small} {large}");
        }
    });
}
