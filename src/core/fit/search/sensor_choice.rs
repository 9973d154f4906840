//! Which pressure sensor an effect concerns, where its user names none.

use crate::fit::outcome::thresholds::STRONG_EVIDENCE;
use crate::model::effects::Chosen;
use crate::rig::Rig;

/// Whether the fit chooses its number of elements.
pub fn is_open(chosen: &Chosen) -> bool {
    chosen.elements.is_none() && chosen.effect.elements().is_some()
}

/// Names the sensor of each effect that concerns one and has none: the one with which `cost` (half the weighted sum of
/// squares that a coarse fit leaves) is least.
///
/// Where the data cannot decide, it takes the sensor farther from the valve: the one nearest the valve is what others
/// are compared with. Of two clocks that differ, none is known to be right.
///
/// # Errors
/// What `cost` returns.
pub fn with_sensors<E>(
    rig: &Rig,
    effects: &[Chosen],
    cost: impl Fn(&[Chosen]) -> Result<f64, E>,
) -> Result<Vec<Chosen>, E> {
    let mut chosen = effects.to_vec();
    let mut sensors: Vec<_> = rig.pressure_sensors().map(|(_, s)| s).collect();
    sensors.sort_by(|a, b| rig.on_way_m(a.place()).total_cmp(&rig.on_way_m(b.place())));
    for i in 0..chosen.len() {
        if !chosen[i].effect.at_sensor() || chosen[i].sensor.is_some() {
            continue;
        }
        let mut best: Option<(f64, Chosen)> = None;
        for sensor in &sensors {
            let here = chosen[i].with_sensor(&sensor.name);
            if sensors.len() == 1 {
                best = Some((0.0, here));
                continue;
            }
            // Two elements where their number is open: with one the model may be too poor to show a sensor's fault.
            let mut trial: Vec<Chosen> =
                chosen.iter().map(|c| if is_open(c) { with_two(c) } else { c.clone() }).collect();
            trial[i] = here.clone();
            let cost = cost(&trial)?;
            if best.as_ref().is_none_or(|b| cost < b.0 - STRONG_EVIDENCE) {
                best = Some((cost, here));
            }
        }
        if let Some((_, here)) = best {
            chosen[i] = here;
        }
    }
    Ok(chosen)
}

fn with_two(chosen: &Chosen) -> Chosen {
    chosen.with_elements(chosen.effect.elements().map_or(1, |range| 2.min(*range.end())))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::data::run_data::{RunData, RunStart, SensorData};
    use crate::fit::search::calibrate::calibrate;
    use crate::fit::search::options::Options;
    use crate::model::effects::parse_list;
    use crate::model::trace::Probe;
    use crate::model::{Conditions, Model, Resolution, RunValues};

    fn rig() -> Rig {
        let sensor = |name: &str, x: f64| {
            format!("[[sensor]]\nname = \"{name}\"\nkind = \"pressure\"\nposition_m = {x}\nunit = \"kPa\"\n")
        };
        let text = format!(
            "name = \"three\"\n[fluid]\nname = \"water\"\ntemperature_degC = 20.0\n[[pipe]]\nname = \"main\"\nlength_m = \
             100.0\ninner_diameter_mm = 50.0\nwall_thickness_mm = 5.0\nmaterial = \"steel\"\n[upstream]\nkind = \
             \"reservoir\"\n[downstream]\nkind = \"valve\"\nclosing_time_s = 0.05\n{}{}{}",
            sensor("P1", 100.0),
            sensor("P2", 60.0),
            sensor("P3", 30.0)
        );
        Rig::from_toml(&text, "three.toml").unwrap()
    }

    fn labels(chosen: &[Chosen]) -> Vec<String> {
        chosen.iter().map(Chosen::label).collect()
    }

    #[test]
    fn the_cheapest_sensor_is_taken_and_ties_go_away_from_the_valve() {
        let rig = rig();
        let effects = parse_list("viscoelastic-wall,sensor-gain,clock-skew@P1").unwrap();
        let cost_of = |costs: [f64; 3]| {
            with_sensors::<()>(&rig, &effects, |trial| {
                assert_eq!(trial[0].elements, Some(2));
                let at = trial[1].sensor.as_deref();
                Ok(costs[["P1", "P2", "P3"].iter().position(|n| at == Some(n)).unwrap()])
            })
            .unwrap()
        };
        let chosen = labels(&cost_of([500.0, 90.0, 300.0]));
        assert_eq!(chosen, ["viscoelastic-wall", "sensor-gain@P2", "clock-skew@P1"]);
        assert_eq!(labels(&cost_of([99.0, 100.0, 101.0]))[1], "sensor-gain@P3");
        assert_eq!(labels(&cost_of([90.0, 100.0, 101.0]))[1], "sensor-gain@P1");
    }

    /// A run made with a fault at one sensor, fitted without its name.
    #[test]
    fn a_fit_finds_the_sensor_with_the_fault() {
        let rig = rig();
        let water = rig.fluid.properties(20.0);
        let conditions = Conditions::of(water);
        for (fault, value) in [("sensor-gain@P3", 0.04), ("clock-skew@P2", 0.004)] {
            let model = Model::new(&rig, &water, &parse_list(fault).unwrap());
            let values = [model.shared[0].start, value];
            let run =
                RunValues { initial_velocity_m_s: 0.3, valve_head_m: 40.0, closing_time_s: 0.05, friction_scale: 1.0 };
            let time_s: Vec<f64> = (0..1200).map(|i| f64::from(i) * 1e-3).collect();
            let probes: Vec<Probe> = rig.pressure_sensors().map(|(_, s)| Probe::head(s.place())).collect();
            let resolution = Resolution { reaches: 128, duration_s: 1.2 };
            let traces = model.simulate(&conditions, &values, &run, resolution, &probes).unwrap().traces;
            let mut noise = fastrand::Rng::with_seed(7);
            let sensors = rig.pressure_sensors().zip(traces).map(|((_, sensor), trace)| {
                let trace = model.sensed(&values, sensor, trace).unwrap();
                // Uniform noise of standard deviation 0.05 m.
                let head = |t: &f64| trace.at(t - 0.1) + 0.05 * 12f64.sqrt() * (noise.f64() - 0.5);
                SensorData {
                    sensor: sensor.clone(),
                    head_m: time_s.iter().map(head).collect(),
                    time_s: time_s.clone(),
                    noise_m: 0.05,
                    total_noise_m: 0.05,
                    hum: Vec::new(),
                    lines: Vec::new(),
                    offset_sd_m: 0.3,
                    saturated: 0,
                }
            });
            let runs = [RunData {
                file: "a".into(),
                sensors: sensors.collect(),
                conditions: conditions.clone(),
                start: RunStart {
                    closure_s: (0.1005, 1e-3),
                    velocity_m_s: (0.31, 0.05),
                    valve_head_m: (40.1, None),
                    wave_speed_ratio: None,
                    closing_time: None,
                },
                meter: None,
                extrema: vec![Vec::new(); 3],
            }];
            let unnamed = parse_list(fault.split('@').next().unwrap()).unwrap();
            let fit = calibrate(&rig, &runs, &unnamed, &Options::default(), &|_| {}).unwrap();
            assert_eq!(fit.labels(), [fault]);
            let found = &fit.parameters[1];
            assert!((found.value - value).abs() < 5.0 * found.standard_error() + 2e-2 * value, "{fault}: {found:?}");
            assert!(fit.runs[0].rmse_m < 0.055, "{}", fit.runs[0].rmse_m);
        }
    }
}
