//! What holds of a diagnosis whatever the records: the order in which things are given changes no answer, and nothing
//! is claimed over a rival that is not at its optimum.

use crate::diagnose::search::tests::{run, searched};
use crate::diagnose::{Diagnosis, Verdict, diagnose};
use crate::fit::data::run_data::RunData;
use crate::fit::problem::test_record::{HDPE, copper, record};
use crate::fit::search::calibrate::{calibrate, refine};
use crate::fit::search::options::{Effort, Options};
use crate::model::Model;
use crate::model::effects::parse_list;
use crate::rig::Rig;

const VALVE_SENSOR: &str = "[[sensor]]\nname = \"P1\"\nkind = \"pressure\"\nposition_m = 80.0\nunit = \"kPa\"\n";

/// A copper pipe with a sensor at its valve and one on the way, in either order.
fn two_sensors(is_turned: bool) -> Rig {
    let on_the_way = VALVE_SENSOR.replace("P1", "P2").replace("80.0", "48.0");
    let both = if is_turned { on_the_way + VALVE_SENSOR } else { VALVE_SENSOR.to_owned() + &on_the_way };
    Rig::from_toml(&HDPE.replace("HDPE", "copper").replace(VALVE_SENSOR, &both), "rig.toml").unwrap()
}

/// Records of all sensors of the rig, of two runs.
fn records(rig: &Rig, truth: &str) -> Vec<RunData> {
    let truth = parse_list(truth).unwrap();
    let model = Model::new(rig, &rig.fluid.properties(20.0), &truth);
    let value = |name: &str, start: f64| match name {
        "wave_speed_m_s" => 1200.0,
        "leak_position_m" => 31.0,
        "seat_cda_mm2" => 2.0,
        _ => start,
    };
    let shared: Vec<f64> = model.shared.iter().map(|p| value(&p.name, p.start)).collect();
    let one = |velocity_m_s: f64| {
        let of_sensor = |i: usize| {
            let mut turned = rig.clone();
            turned.sensors.swap(0, i);
            record(&turned, &truth, &shared, run(velocity_m_s), 0.05, 2.0)
        };
        let others = (1..rig.sensors.len()).map(of_sensor);
        others.fold(of_sensor(0), |mut all, other| {
            all.sensors.extend(other.sensors);
            all.extrema.extend(other.extrema);
            all
        })
    };
    vec![one(0.3), RunData { file: "run 2".into(), ..one(0.5) }]
}

#[test]
fn the_order_of_effects_sensors_and_runs_changes_no_answer() {
    let options = Options { most_reaches: 64, ..Options::default() };
    let answer = |effects: &str, are_sensors_turned: bool, are_runs_turned: bool| -> Diagnosis {
        let rig = two_sensors(are_sensors_turned);
        let mut runs = records(&rig, "valve-seat-leak,supply-drift,leak");
        if are_runs_turned {
            runs.reverse();
        }
        diagnose(&rig, &runs, &parse_list(effects).unwrap(), &options, &|_| {}).unwrap()
    };
    let given = answer("valve-seat-leak,supply-drift", false, false);
    assert_eq!((given.verdict, given.answer_label()), (Verdict::MissingEffect, "leak".to_owned()));
    let others = [
        answer("supply-drift,valve-seat-leak", false, false),
        answer("valve-seat-leak,supply-drift", true, false),
        answer("valve-seat-leak,supply-drift", false, true),
    ];
    for other in others {
        assert_eq!((other.verdict, other.answer_label()), (given.verdict, given.answer_label()));
        assert!((other.probability - given.probability).abs() < 1e-3, "{} {}", other.probability, given.probability);
        let (one, two) = (given.answer().unwrap(), other.answer().unwrap());
        for p in &one.parameters {
            let same = |q: &&_| -> bool {
                let q: &crate::fit::outcome::fit::FittedParameter = q;
                q.name == p.name && q.run == p.run
            };
            let q = two.parameters.iter().find(same).unwrap();
            assert!((p.value - q.value).abs() < 0.2 * p.standard_error(), "{}: {} {}", p.name, p.value, q.value);
        }
    }
}

/// A diagnosis starts where a calibration ends.
#[test]
fn a_model_ends_alike_whoever_fits_it() {
    let rig = copper();
    let runs = [record(&rig, &parse_list("leak").unwrap(), &[1200.0, 31.0, 4.0], run(0.5), 0.02, 2.0)];
    let options = Options { most_reaches: 64, ..Options::default() };
    let leak = parse_list("leak").unwrap();
    let calibrated = calibrate(&rig, &runs, &leak, &options, &|_| {}).unwrap();
    let diagnosed = diagnose(&rig, &runs, &leak, &options, &|_| {}).unwrap();
    assert_eq!(diagnosed.start.values(), calibrated.values());
}

/// A rival whose fit was stopped on its way is fitted on, though the search was at its end before it was met.
#[test]
fn a_rival_that_comes_late_is_led_to_its_optimum() {
    let rig = copper();
    let truth = parse_list("leak").unwrap();
    let runs = [record(&rig, &truth, &[1200.0, 31.0, 4.0], run(0.5), 0.02, 2.0)];
    let options = Options { most_reaches: 64, ..Options::default() };
    searched(&rig, &runs, "none", &options, |search| {
        let seat = calibrate(&rig, &runs, &parse_list("valve-seat-leak").unwrap(), &options, &|_| {}).unwrap();
        search.take(seat);
        search.run(&Vec::new(), 1);
        assert!(search.comparison().is_none(), "all that may be claimed is at its optimum");
        let best = search.leader().unwrap().fit.clone().unwrap();
        // the same place once more, a little aside and hardly fitted
        let mut aside = best.values();
        aside[2] *= 1.02;
        let begun = Options { effort: Effort::Brief, ..options.clone() };
        let rival = refine(&rig, &runs, &best.effects, &aside, &begun, &|_| {}).unwrap();
        let place = search.place(&["leak"]);
        search.met[place].fit = Some(rival);
        search.met[place].is_at_end = false;
        while let Some(comparison) = search.comparison() {
            search.compare(comparison);
        }
        assert!(search.met[place].is_at_end && search.leader().unwrap().fit.as_ref().unwrap().converged);
        let all_at_end = search.met.iter().filter(|m| m.fit.is_some() && m.promise() <= search.met[place].square());
        assert!(all_at_end.clone().count() > 0 && all_at_end.clone().all(|m| m.is_at_end));
    });
}
