//! What a lab would have recorded of a run: sensors with noise, offsets and faults, and a rig file with what the lab
//! believes.

use std::fmt::Write;
use std::path::Path;

use super::forcing::Forced;
use super::rig::{Case, Hidden};
use super::scheme::{Solved, solve};

const MAINS_HZ: f64 = 50.0;
/// By how much the frequency of the mains is off, and how fast it changes, standard deviations. Chosen: the grid keeps
/// within some hundredths of a hertz on an ordinary day.
const MAINS_OFF_HZ: f64 = 0.02;
const MAINS_DRIFT_HZ_S: f64 = 1e-3;

/// What the lab has against it.
#[derive(Clone, Copy)]
pub struct Lab {
    /// Half of the noise remembers 5 ms.
    pub coloured: bool,
    /// Each pressure has the hum of the mains on it, one to three times the noise, whose frequency drifts.
    pub hum: bool,
    /// Its tape measures and data sheets are off.
    pub wrong_rig: bool,
}

pub fn write(folder: &Path, case: &Case, random: &mut fastrand::Rng, lab: Lab) -> std::io::Result<()> {
    let Lab { coloured, hum, wrong_rig } = lab;
    std::fs::create_dir_all(folder)?;
    let wrong =
        |random: &mut fastrand::Rng, by: f64| if wrong_rig { 1.0 + by * (2.0 * random.f64() - 1.0) } else { 1.0 };
    // As tape measures and data sheets are off.
    let length_m = case.length_m * wrong(random, 0.007);
    let closing = case.closing_s * (1.0 + 0.25 * (2.0 * random.f64() - 1.0));
    let mut rig = format!(
        "name = \"{}\"\n\n[fluid]\nname = \"water\"\ntemperature_degC = {:.1}\n\n[[pipe]]\nname = \"main\"\nlength_m = {:.2}\n\
         inner_diameter_mm = {:.2}\nwall_thickness_mm = {:.3}\nmaterial = \"{}\"\n\n[upstream]\nkind = \"reservoir\"\n\n[downstream]\nkind = \
         \"valve\"\nclosing_time_s = {closing:.3}\n",
        case.name,
        case.temperature_c,
        length_m,
        1e3 * case.diameter_m * wrong(random, 0.015),
        1e3 * case.wall_m * wrong(random, 0.06),
        case.material
    );
    let mut columns = String::from("time_s");
    for (i, &x) in case.sensors_m.iter().enumerate() {
        // One at the valve is at the valve, however long the pipe.
        let place = if x < case.length_m { (x * wrong(random, 0.003)).min(length_m) } else { length_m };
        let _ = write!(
            rig,
            "\n[[sensor]]\nname = \"P{}\"\nkind = \"pressure\"\nposition_m = {place:.2}\nunit = \"kPa\"\n",
            i + 1
        );
        let _ = write!(columns, ",P{}", i + 1);
    }
    rig += "\n[[sensor]]\nname = \"Q1\"\nkind = \"flow\"\nposition_m = 0.0\nunit = \"m3/h\"\n";
    rig += "\n[[sensor]]\nname = \"T1\"\nkind = \"temperature\"\nposition_m = 0.0\nunit = \"degC\"\n";
    std::fs::write(folder.join("rig.toml"), rig)?;
    // Errors of the instruments are the same in both runs.
    let gains: Vec<f64> = case.sensors_m.iter().map(|_| 1.0 + 0.001 * normal(random)).collect();
    let offsets: Vec<f64> = case.sensors_m.iter().map(|_| 0.003 * case.joukowsky_m() * normal(random)).collect();
    let meter = 1.0 + 0.003 * normal(random);
    let kpa_per_m = 9.81e-3 * case.density_kg_m3();
    let velocities = [("run.csv", Some(case.velocity_m_s)), ("run2.csv", case.second_velocity_m_s)];
    for (file, velocity) in velocities.into_iter().filter_map(|(f, v)| v.map(|v| (f, v))) {
        let solved = solve(case, velocity, case.duration_s);
        let mut out = format!("{columns},Q1,T1\n");
        let n = ((case.lead_s + case.duration_s) / case.sample_s) as usize;
        let [off_hz, drift_hz_s] =
            [MAINS_OFF_HZ, MAINS_DRIFT_HZ_S].map(|sd| if hum { sd * normal(random) } else { 0.0 });
        let turns = |t: f64| (MAINS_HZ + off_hz + 0.5 * drift_hz_s * t) * t;
        let heads: Vec<Vec<f64>> = (0..case.sensors_m.len())
            .map(|s| {
                let trace = sensed(case, s, &solved);
                let skew_of =
                    |h: &Hidden| if let Hidden::Skew(which, skew) = h { (*which == s).then_some(*skew) } else { None };
                // A clock that is ahead shows what comes, and before that the steady head.
                let skew_s = case.find(skew_of).unwrap_or(0.0);
                let memory = if coloured { (-case.sample_s / 0.005f64).exp() } else { 0.0 };
                let mut slow = 0.0;
                let hum_m = if hum { case.noise_m * (1.0 + 2.0 * random.f64()) } else { 0.0 };
                let phase = if hum { std::f64::consts::TAU * random.f64() } else { 0.0 };
                (0..n)
                    .map(|i| {
                        slow = memory * slow + (1.0 - memory * memory).sqrt() * normal(random);
                        let t = i as f64 * case.sample_s - case.lead_s;
                        let seen_s = t - skew_s;
                        let mains_m = hum_m * (std::f64::consts::TAU * turns(t) + phase).sin();
                        let h = gains[s] * at(case, &solved, &trace, seen_s) + offsets[s] + mains_m;
                        let noise = if coloured { 0.7 * normal(random) + 0.7 * slow } else { normal(random) };
                        (((h + case.noise_m * noise) * kpa_per_m / 0.03).round()) * 0.03
                    })
                    .collect()
            })
            .collect();
        for i in 0..n {
            let _ = write!(out, "{:.5}", i as f64 * case.sample_s);
            for head in &heads {
                let _ = write!(out, ",{:.4}", head[i]);
            }
            if i % 100 == 0 && (i as f64) * case.sample_s < case.lead_s {
                let of_leak = |h: &Hidden| if let Hidden::Leak(_, flow) = h { Some(*flow) } else { None };
                let leak = case.find(of_leak).unwrap_or(0.0) * velocity / case.velocity_m_s;
                let flow = (velocity * case.area_m2() + leak) * 3600.0 * meter * (1.0 + 0.001 * normal(random));
                let _ = write!(out, ",{flow:.5},{:.2}", case.temperature_c + 0.05 * normal(random));
            } else {
                out += ",,";
            }
            out.push('\n');
        }
        std::fs::write(folder.join(file), out)?;
    }
    Ok(())
}

/// Head that a sensor shows, every step, without its noise.
pub fn sensed(case: &Case, s: usize, solved: &Solved) -> Vec<f64> {
    let mut trace = solved.heads_m[s].clone();
    for hidden in &case.hidden {
        show(hidden, s, solved, &mut trace);
    }
    trace
}

/// What a hidden fault makes of the trace of a sensor.
fn show(hidden: &Hidden, s: usize, solved: &Solved, trace: &mut [f64]) {
    match *hidden {
        Hidden::Lag(which, hz) if which == s => {
            let keep = (-std::f64::consts::TAU * hz * solved.dt_s).exp();
            let mut shown = trace[0];
            for h in trace {
                shown = keep * shown + (1.0 - keep) * *h;
                *h = shown;
            }
        }
        Hidden::Gain(which, gain) if which == s => trace.iter_mut().for_each(|h| *h *= gain),
        Hidden::Bent(which, bend) if which == s => {
            let still = trace[0];
            trace.iter_mut().for_each(|h| *h += bend * (*h - still).powi(2));
        }
        Hidden::Hum(which, amplitude, hz) if which == s => {
            for (i, h) in trace.iter_mut().enumerate() {
                *h += amplitude * (std::f64::consts::TAU * hz * i as f64 * solved.dt_s).sin();
            }
        }
        Hidden::Forced(Forced::SaturatingSensor { sensor, above_m, share }) if sensor == s => {
            trace.iter_mut().for_each(|h| *h -= (1.0 - share) * (*h - above_m).max(0.0));
        }
        _ => {}
    }
}

/// Pulsation is there before the closure, too; all else is still until then.
fn at(case: &Case, solved: &Solved, trace: &[f64], t: f64) -> f64 {
    let pulsates = case.hidden.iter().any(|h| matches!(h, Hidden::Pulsation(..)));
    let before = if pulsates { case.lead_s } else { 0.0 };
    linear(trace, (t + before) / solved.dt_s)
}

pub fn linear(trace: &[f64], at: f64) -> f64 {
    let at = at.clamp(0.0, (trace.len() - 2) as f64);
    let i = at as usize;
    trace[i] + (at - i as f64) * (trace[i + 1] - trace[i])
}

/// Box & Muller (1958).
pub fn normal(random: &mut fastrand::Rng) -> f64 {
    (-2.0 * (1.0 - random.f64()).ln()).sqrt() * (std::f64::consts::TAU * random.f64()).cos()
}
