//! Checks whether a recording agrees with its rig file.

pub(crate) mod flow;
pub(crate) mod rigs;
pub(crate) mod samples;
pub(crate) mod track;
pub(crate) mod waves;

use crate::signal::check::flow::check_flow;
use crate::signal::check::rigs::compare_rigs;
use crate::signal::check::samples::{check_presence, check_sample_rate, check_saturation, check_vapour};
use crate::signal::check::track::{Front, temperature_degc, tracks};
use crate::signal::check::waves::{check_speeds, check_travel};

use crate::recording::Recording;
use crate::rig::check::{Finding, Level};
use crate::rig::{Rig, SensorKind};

/// All findings on a recording with a rig, its own or another one. [`crate::rig::check::check`] gives the findings on
/// the rig alone.
pub fn check_recording(rig: &Rig, recording: &Recording) -> Vec<Finding> {
    let mut findings = vec![compare_rigs(rig, &recording.rig)];
    let tracks = tracks(rig, recording);
    findings.extend(rig.sensors.iter().filter_map(|sensor| check_presence(sensor, &tracks)));
    findings.extend(tracks.iter().filter_map(|track| check_saturation(rig, track)));

    let water = rig.fluid.properties(temperature_degc(rig, &tracks));
    let pressures: Vec<Front> =
        tracks.iter().filter(|t| t.sensor.kind == SensorKind::Pressure).map(Front::find).collect();
    let start_s = pressures.iter().filter_map(|f| f.arrival_s).min_by(f64::total_cmp);
    if start_s.is_none() && !pressures.is_empty() {
        let message = "no pressure sensor leaves its steady value: the recording shows no closure";
        findings.push(Finding::new(Level::Warning, "closure", message, &[]));
    }
    findings.extend(pressures.iter().filter_map(|front| check_sample_rate(rig, front, &pressures, &water)));
    findings.extend(tracks.iter().filter_map(|track| check_vapour(track, &water)));
    findings.extend(check_travel(rig, &pressures, &water));
    findings.extend(check_speeds(rig, recording, &water));
    for track in tracks.iter().filter(|t| t.sensor.kind == SensorKind::Flow) {
        findings.extend(check_flow(rig, track, start_s, &pressures, &water));
    }
    findings
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::{Gap, RunInfo, Series};
    use crate::rig::Sensor;
    use crate::rig::check::friction_loss_m;

    const SPEED: f64 = 384.0;

    fn demo() -> Rig {
        Rig::from_toml(include_str!("../../../../tests/rigs/hdpe-63.toml"), "hdpe-63.toml").unwrap()
    }

    /// A steady flow of 6 m³/h with the friction that belongs to it; at 0.5 s a wave of 200 kPa leaves the valve.
    fn run(rig: &Rig) -> Recording {
        let water = rig.fluid.properties(18.0);
        let flow = 6.0 / 3600.0;
        let times: Vec<f64> = (0..4000).map(|i| f64::from(i) * 5e-4).collect();
        let value = |sensor: &Sensor, i: usize, t: f64| match sensor.kind {
            SensorKind::Pressure => {
                let loss_kpa = friction_loss_m(rig, 0.0, sensor.position_m, flow, &water) * 9.79;
                let ramp = ((t - 0.5 - (120.0 - sensor.position_m) / SPEED) / 0.08).clamp(0.0, 1.0);
                245.0 - loss_kpa + 200.0 * ramp + 0.05 * (i as f64 * 1.7).sin()
            }
            SensorKind::Flow => 6.0,
            SensorKind::Temperature => 18.0,
            SensorKind::Trigger | SensorKind::ValvePosition => f64::from(u8::from(t > 0.5)),
        };
        let series = |sensor: &Sensor| Series {
            value: times.iter().enumerate().map(|(i, t)| value(sensor, i, *t)).collect(),
            time_s: times.clone(),
            gaps: Vec::new(),
        };
        Recording { rig: rig.clone(), series: rig.sensors.iter().map(series).collect(), run: RunInfo::default() }
    }

    fn level(findings: &[Finding], subject: &str) -> Level {
        let found = findings.iter().find(|f| f.subject.starts_with(subject));
        found.unwrap_or_else(|| panic!("nothing on '{subject}' in {findings:#?}")).level
    }

    #[test]
    fn a_recording_that_fits_its_rig_is_fine_throughout() {
        let rig = demo();
        let findings = check_recording(&rig, &run(&rig));
        let not_fine: Vec<_> = findings.iter().filter(|f| f.level != Level::Fine).collect();
        assert!(not_fine.is_empty(), "{not_fine:#?}");
        let wave = findings.iter().find(|f| f.subject == "wave from 'P1' to 'P2'").unwrap();
        assert!((wave.numbers[0].1 / SPEED - 1.0).abs() < 0.01, "{wave:?}");
        assert_eq!(level(&findings, "steady loss from 'P3' to 'P1'"), Level::Fine);
        assert_eq!(level(&findings, "flow in 'main' by 'Q1'"), Level::Fine);
    }

    #[test]
    fn a_flow_that_the_meter_cannot_show_contradicts_its_range_and_the_loss() {
        let rig = demo();
        let mut recording = run(&rig);
        recording.series[3].value.fill(20.0);
        let findings = check_recording(&rig, &recording);
        assert_eq!(level(&findings, "range of 'Q1'"), Level::Contradiction);
        assert_eq!(level(&findings, "steady loss from 'P3' to 'P1'"), Level::Contradiction);
    }

    #[test]
    fn a_flow_between_laminar_and_turbulent_is_a_warning() {
        let rig = demo();
        let mut recording = run(&rig);
        recording.series[3].value.fill(0.4); // Re about 2600
        assert_eq!(level(&check_recording(&rig, &recording), "flow in 'main' by 'Q1'"), Level::Warning);
    }

    /// A closed valve that rings: a square wave of period 4L/a.
    #[test]
    fn times_in_milliseconds_contradict_the_wall() {
        let rig = demo();
        let mut recording = run(&rig);
        for (sensor, series) in rig.sensors.iter().zip(&mut recording.series) {
            if sensor.kind != SensorKind::Pressure {
                continue;
            }
            let front = |t: f64| (t / 0.02).clamp(0.0, 1.0);
            let (to, back) = ((120.0 - sensor.position_m) / SPEED, (120.0 + sensor.position_m) / SPEED);
            for (i, (t, v)) in series.time_s.iter().zip(&mut series.value).enumerate() {
                let since = t - 0.5;
                let echoes = |k: i32| {
                    let delay = f64::from(k) * 240.0 / SPEED;
                    let sign = if k % 2 == 0 { 200.0 } else { -200.0 };
                    sign * (front(since - to - delay) - front(since - back - delay))
                };
                *v = 245.0 + (0..4).map(echoes).sum::<f64>() + 0.05 * (i as f64 * 1.7).sin();
            }
        }
        let said = |recording: &Recording| {
            let findings = check_recording(&rig, recording);
            findings.into_iter().filter(|f| f.subject.starts_with("wave speed by")).collect::<Vec<_>>()
        };
        assert_eq!(said(&recording), []);
        recording.series.iter_mut().flat_map(|s| &mut s.time_s).for_each(|t| *t *= 1000.0);
        let found = said(&recording);
        assert_eq!(found.len(), 2, "{found:#?}");
        assert!(
            found.iter().all(|f| f.level == Level::Contradiction && f.message.contains("are the times in seconds"))
        );
    }

    #[test]
    fn swapped_sensors_are_noticed_by_the_wave_that_comes_too_early() {
        let rig = demo();
        let mut recording = run(&rig);
        recording.series.swap(0, 1);
        assert_eq!(level(&check_recording(&rig, &recording), "wave from 'P1' to 'P2'"), Level::Contradiction);
    }

    #[test]
    fn saturation_boiling_gaps_and_empty_columns_are_told() {
        let rig = demo();
        let mut recording = run(&rig);
        recording.series[0].value[3000] = 1000.0;
        recording.series[1].value[3000] = -180.0;
        recording.series[1].gaps.push(Gap { from_s: 1.0, to_s: 1.2, samples: Some(400) });
        recording.series[2] = Series::default();
        let findings = check_recording(&rig, &recording);
        assert_eq!(level(&findings, "saturation of 'P1'"), Level::Warning);
        assert_eq!(level(&findings, "lowest pressure of 'P2'"), Level::Contradiction, "below absolute vacuum");
        assert_eq!(level(&findings, "samples of 'P2'"), Level::Warning);
        assert_eq!(level(&findings, "samples of 'P3'"), Level::Warning);
        recording.series[1].value[3000] = -99.0;
        assert_eq!(level(&check_recording(&rig, &recording), "lowest pressure of 'P2'"), Level::Warning);
    }

    #[test]
    fn too_few_samples_for_a_front_and_a_recording_without_a_closure_are_told() {
        let rig = demo();
        let mut recording = run(&rig);
        for series in &mut recording.series {
            series.time_s = series.time_s.iter().step_by(40).copied().collect();
            series.value = series.value.iter().step_by(40).copied().collect();
        }
        assert_eq!(level(&check_recording(&rig, &recording), "sample rate of 'P1'"), Level::Warning);
        recording = run(&rig);
        for series in &mut recording.series[..3] {
            series.value.truncate(900);
            series.time_s.truncate(900);
        }
        assert_eq!(level(&check_recording(&rig, &recording), "closure"), Level::Warning);
    }

    #[test]
    fn a_rig_other_than_the_recorded_one_is_told() {
        let rig = demo();
        let recording = run(&rig);
        let text = |from: &str, to: &str| Rig::from_toml(&rig.source.replacen(from, to, 1), "x.toml").unwrap();
        let longer = text("length_m = 120.0", "length_m = 121.0");
        assert_eq!(level(&check_recording(&longer, &recording), "rig of the recording"), Level::Warning);
        let commented = text("[fluid]", "# tap\n[fluid]");
        assert_eq!(level(&check_recording(&commented, &recording), "rig of the recording"), Level::Fine);
        let bar = text("unit = \"kPa\"", "unit = \"bar\"");
        assert_eq!(level(&check_recording(&bar, &recording), "rig of the recording"), Level::Contradiction);
    }
}
