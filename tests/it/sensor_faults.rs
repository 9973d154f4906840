//! Faulty sensors, made from the shipped recordings: each is named as what it is, and a sound one is not.

use surgescope::Recording;
use surgescope::rig::SensorKind;
use surgescope::signal::faults::{Fault, in_words, sensor_faults};
use surgescope::signal::inspect;
use surgescope::storage::read;

use crate::common::{CREEP, LEAK, NOTHING, here};

/// The recording with a fault in the first pressure sensor, or in the first two.
fn with(fault: Fault, recording: &Recording) -> Recording {
    let mut broken = recording.clone();
    let places: Vec<usize> = recording.rig.pressure_sensors().map(|(i, _)| i).collect();
    let values = &mut broken.series[places[0]].value;
    let low = values.iter().copied().fold(f64::INFINITY, f64::min);
    let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    match fault {
        Fault::Flat => values.fill(300.0),
        Fault::Stuck => {
            // from where it moves on: behind its highest value
            let from = values.iter().position(|v| *v == high).unwrap() + 10;
            let level = values[from];
            values[from..].fill(level);
        }
        Fault::Clipped => values.iter_mut().for_each(|v| *v = v.min(low + 0.6 * (high - low))),
        Fault::Inverted => values.iter_mut().for_each(|v| *v = -*v),
        Fault::Swapped => broken.series.swap(places[0], places[1]),
        Fault::WrongUnit => values.iter_mut().for_each(|v| *v *= 0.01),
        Fault::WrongTimeUnit => {
            broken.series.iter_mut().for_each(|s| s.time_s.iter_mut().for_each(|t| *t *= 1000.0));
        }
        _ => panic!("{fault:?} is no fault of this test"),
    }
    broken
}

#[test]
fn each_fault_is_named_as_what_it_is() {
    let faults = [
        Fault::Flat,
        Fault::Stuck,
        Fault::Clipped,
        Fault::Inverted,
        Fault::Swapped,
        Fault::WrongUnit,
        Fault::WrongTimeUnit,
    ];
    let mut wrong = Vec::new();
    for name in [CREEP, LEAK, NOTHING] {
        let recording = read(&here(name)).unwrap();
        let first = recording.rig.pressure_sensors().next().unwrap().1.name.clone();
        assert_eq!(sensor_faults(&recording), [], "{name}");
        for fault in faults {
            let found = sensor_faults(&with(fault, &recording));
            let of_first = found.iter().find(|f| f.sensor == first).map(|f| f.fault);
            if of_first != Some(fault) {
                wrong.push(format!("{name}, {fault:?}: {found:?}"));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// A quiet sensor shows one value until the wave comes to it, while those nearer to the valve move already.
#[test]
fn a_sensor_that_waits_for_the_wave_is_not_stuck() {
    for name in [CREEP, LEAK, NOTHING] {
        let mut recording = read(&here(name)).unwrap();
        let found = inspect(&recording).unwrap();
        for sensor in &found.sensors {
            let Some(arrival) = sensor.front_arrival_s else { continue };
            let series = &mut recording.series[sensor.sensor];
            let waits = series.time_s.partition_point(|t| *t < arrival.value - 2.0 * sensor.interval_s);
            let level = series.value[waits];
            series.value[..waits].fill(level);
        }
        assert_eq!(sensor_faults(&recording), [], "{name}");
    }
}

/// Of two sensors, either may be the one in a wrong unit; the flow tells which. Without it the fault is said of both.
#[test]
fn of_two_sensors_the_flow_tells_which_is_in_a_wrong_unit() {
    for name in [CREEP, LEAK, NOTHING] {
        let mut recording = read(&here(name)).unwrap();
        let pressures: Vec<usize> = recording.rig.pressure_sensors().map(|(i, _)| i).collect();
        for surplus in &pressures[2..] {
            recording.series[*surplus] = Default::default();
        }
        for (wrong, factor) in [(0, 100.0), (1, 100.0), (0, 6.9), (1, 6.9), (0, 0.01), (1, 0.01)] {
            let mut broken = recording.clone();
            broken.series[pressures[wrong]].value.iter_mut().for_each(|v| *v *= factor);
            let name_of = |i: usize| broken.rig.sensors[pressures[i]].name.clone();
            let found = sensor_faults(&broken);
            assert_eq!(found.len(), 1, "{name}, sensor {wrong} times {factor}: {found:?}");
            assert_eq!((&found[0].sensor, found[0].fault), (&name_of(wrong), Fault::WrongUnit), "{name}, {factor}");

            for (i, sensor) in recording.rig.sensors.iter().enumerate() {
                if sensor.kind == SensorKind::Flow {
                    broken.series[i] = Default::default();
                }
            }
            let found = sensor_faults(&broken);
            let both: Vec<&str> = found.iter().map(|f| f.sensor.as_str()).collect();
            assert_eq!(both, [name_of(0), name_of(1)], "{name}, sensor {wrong} times {factor}: {found:?}");
            assert!(found.iter().all(|f| f.fault == Fault::WrongUnit && f.says == found[0].says), "{found:?}");
            assert!(in_words(&found).contains("one of the two is"), "{}", in_words(&found));
            assert!(!in_words(&found).contains("ignore"), "{}", in_words(&found));
        }
    }
}
