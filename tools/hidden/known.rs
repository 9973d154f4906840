//! A recording of a given rig with known parameters, from the scheme that shares nothing with the program: what a
//! calibration should find.
//!
//! `cargo run --release -p surgescope-tools --bin known_run -- RIG OUT.csv NAME=VALUE …`; names are those of
//! `surgescope simulate --set`, with `temperature_degC`, `duration_s`, `noise_m`, `zero_m` (standard deviation of the
//! sensors' zero errors) and `seed`.

#[allow(dead_code)] // of the other program
mod forcing;
mod of_rig;
#[allow(dead_code)] // of the other program
mod record;
#[allow(dead_code)]
mod rig;
#[allow(dead_code)]
mod scheme;

use std::collections::BTreeMap;
use std::path::Path;

use of_rig::{Known, csv};
use surgescope::rig::Rig;

fn main() -> Result<(), Box<dyn std::error::Error + Send + Sync>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [rig, out, settings @ ..] = arguments.as_slice() else {
        return Err("usage: known_run RIG OUT.csv NAME=VALUE …".into());
    };
    let mut given = BTreeMap::new();
    for setting in settings {
        let (name, value) = setting.split_once('=').ok_or_else(|| format!("'{setting}' is no NAME=VALUE"))?;
        given.insert(name.to_owned(), value.parse::<f64>().map_err(|e| format!("{setting}: {e}"))?);
    }
    let rig = Rig::load(Path::new(rig))?;
    if rig.pipes.len() != 1 {
        return Err("the scheme knows rigs of one pipe".into());
    }
    let mut take = |name: &str, usual: Option<f64>| given.remove(name).or(usual).ok_or(format!("{name} is not given"));
    let mut creep = Vec::new();
    for k in 1.. {
        let Ok(j) = take(&format!("J{k}_per_GPa"), None) else { break };
        creep.push((j * 1e-9, take(&format!("tau{k}_s"), None)?));
    }
    let known = Known {
        temperature_degc: take("temperature_degC", Some(rig.fluid.temperature_degc))?,
        wave_speed_m_s: take("wave_speed_m_s", None)?,
        velocity_m_s: take("initial_velocity_m_s", None)?,
        valve_head_m: take("valve_head_m", None)?,
        closing_s: take("closing_time_s", Some(rig.valve.closing_time_s))?,
        creep,
        duration_s: take("duration_s", Some(6.0))?,
        noise_m: take("noise_m", Some(0.05))?,
        zero_m: take("zero_m", Some(0.1))?,
        seed: take("seed", Some(1.0))? as u64,
    };
    if let Some(stranger) = given.keys().next() {
        return Err(format!("there is no setting '{stranger}'").into());
    }
    Ok(std::fs::write(out, csv(&rig, &known))?)
}
