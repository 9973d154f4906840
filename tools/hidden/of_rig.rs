//! A run on a given rig with known parameters: what a lab would have recorded of it, had the pipe been just so.

use std::fmt::Write;

use surgescope::rig::{Rig, Sensor, SensorKind};

use super::record::{linear, normal};
use super::rig::{Case, Hidden};
use super::scheme::solve;

/// The truth of a run.
#[derive(Debug, Clone)]
pub struct Known {
    pub temperature_degc: f64,
    pub wave_speed_m_s: f64,
    pub velocity_m_s: f64,
    pub valve_head_m: f64,
    pub closing_s: f64,
    /// Kelvin-Voigt elements: compliance 1/Pa, retardation time s.
    pub creep: Vec<(f64, f64)>,
    pub duration_s: f64,
    pub noise_m: f64,
    /// Standard deviation of the pressure sensors' zero errors, m.
    pub zero_m: f64,
    pub seed: u64,
}

/// Time before the closure, s.
const LEAD_S: f64 = 0.5;
/// Time between pressure samples, s, and how many pass between those of the slow meters.
const SAMPLE_S: f64 = 1e-3;
const SLOW: usize = 50;
/// Relative error of the flow meter, one for the run; of its readings; and of those of the thermometer, K.
const METER: f64 = 0.003;
const READING: f64 = 0.001;
const DEGREES: f64 = 0.02;

/// The case that the scheme solves: a rig of one pipe.
fn case(rig: &Rig, known: &Known) -> Case {
    let pipe = &rig.pipes[0];
    let mut case = Case {
        name: rig.name.clone(),
        material: pipe.material().name,
        length_m: pipe.length_m,
        diameter_m: pipe.inner_diameter_m,
        wall_m: pipe.wall_thickness_m,
        wave_speed_m_s: known.wave_speed_m_s,
        temperature_c: known.temperature_degc,
        velocity_m_s: known.velocity_m_s,
        second_velocity_m_s: None,
        valve_head_m: known.valve_head_m,
        closing_s: known.closing_s,
        duration_s: known.duration_s,
        lead_s: LEAD_S,
        sample_s: SAMPLE_S,
        sensors_m: pressures(rig).map(|s| s.position_m).collect(),
        noise_m: known.noise_m,
        creep: known.creep.clone(),
        friction: pipe.friction_factor,
        unsteady_friction: false,
        start_effects: Vec::new(),
        hidden: vec![Hidden::Creep],
    };
    // The scheme's wall has c₁ = 1 and its water a density of its own: creep counts by their product with J.
    let density = rig.fluid.properties(known.temperature_degc).density_kg_m3;
    let scale = pipe.constraint_coefficient() * density / case.density_kg_m3();
    case.creep.iter_mut().for_each(|(j, _)| *j *= scale);
    case
}

fn pressures(rig: &Rig) -> impl Iterator<Item = &Sensor> {
    rig.sensors.iter().filter(|s| s.kind == SensorKind::Pressure)
}

/// The time series that `surgescope import` takes: the rig's pressure sensors, flow meters and thermometers, in their
/// units.
pub fn csv(rig: &Rig, known: &Known) -> String {
    let case = case(rig, known);
    let solved = solve(&case, known.velocity_m_s, known.duration_s);
    let density = rig.fluid.properties(known.temperature_degc).density_kg_m3;
    let mut random = fastrand::Rng::with_seed(known.seed);
    let zeros: Vec<f64> = pressures(rig).map(|_| known.zero_m * normal(&mut random)).collect();
    let flow = known.velocity_m_s * case.area_m2() * (1.0 + METER * normal(&mut random));
    let mut out = String::from("time_s");
    rig.sensors.iter().for_each(|s| out += &format!(",{}", s.name));
    out.push('\n');
    let rows = ((LEAD_S + known.duration_s) / SAMPLE_S) as usize;
    for i in 0..rows {
        let t = i as f64 * SAMPLE_S;
        let _ = write!(out, "{t:.5}");
        let mut pressures = zeros.iter().zip(&solved.heads_m);
        for sensor in &rig.sensors {
            let slow = i % SLOW == 0 && t < LEAD_S;
            let si = match sensor.kind {
                SensorKind::Pressure => pressures.next().map(|(zero, heads)| {
                    let head = linear(heads, (t - LEAD_S) / solved.dt_s);
                    (head + zero + known.noise_m * normal(&mut random)) * density * 9.81
                }),
                SensorKind::Flow if slow => Some(flow * (1.0 + READING * normal(&mut random))),
                SensorKind::Temperature if slow => {
                    out += &format!(",{:.3}", known.temperature_degc + DEGREES * normal(&mut random));
                    continue;
                }
                _ => None,
            };
            match si {
                Some(si) => {
                    let _ = write!(out, ",{:.5}", sensor.unit.from_si(si, density));
                }
                None => out.push(','),
            }
        }
        out.push('\n');
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Strain for head is c₁ ρ J: as the program has it, with the rig's wall and water, and as the scheme has it.
    #[test]
    fn the_scheme_strains_as_the_rig_does() {
        let rig = Rig::load(std::path::Path::new("rigs/demo-hdpe.toml")).unwrap();
        let known = Known {
            temperature_degc: 22.2,
            wave_speed_m_s: 342.0,
            velocity_m_s: 0.4,
            valve_head_m: 25.0,
            closing_s: 0.1,
            creep: vec![(0.13e-9, 0.033)],
            duration_s: 1.0,
            noise_m: 0.03,
            zero_m: 0.0,
            seed: 1,
        };
        let case = case(&rig, &known);
        let own = case.density_kg_m3() * case.creep[0].0;
        let rigs = rig.fluid.properties(22.2).density_kg_m3 * rig.pipes[0].constraint_coefficient() * 0.13e-9;
        assert!((own / rigs - 1.0).abs() < 1e-12, "{own} {rigs}");
    }
}
