//! Recordings with one effect hidden, or two or three, from a scheme that shares nothing with the program: what
//! `diagnose` is tried on.
//!
//! `cargo run --release -p surgescope-tools --bin hidden_effects -- SEED COUNT FOLDER [KIND,KIND…] [--coloured] [--hum]
//! [--wrong-rig] [--pairs|--triples] [--plastic]` writes folders with `rig.toml`, `run.csv`, sometimes `run2.csv`, and
//! `answers.json` beside them, as `tools/blind.py` reads them.
//! The same seed gives the same files.
//! Kinds of `forcing` (`forcings` for all of them) are what no effect of the catalogue is: the answers have their place
//! and waveform as `forcing`, for `tools/explained.py`.
//! With `--plastic` every wall creeps, also where an effect is otherwise hidden in metal only.

mod forcing;
#[cfg(test)]
mod named;
mod record;
mod rig;
mod scheme;
mod truth;
mod waveform;

use std::path::Path;

use rayon::prelude::*;
use serde_json::{Map, json};

const FLAGS: [&str; 6] = ["--coloured", "--hum", "--wrong-rig", "--pairs", "--triples", "--plastic"];

fn main() -> Result<(), Box<dyn std::error::Error + Send + Sync>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let (flags, plain): (Vec<String>, Vec<String>) = arguments.into_iter().partition(|a| a.starts_with("--"));
    let [seed, count, folder, kinds @ ..] = plain.as_slice() else {
        return Err(format!("usage: hidden_effects SEED COUNT FOLDER [KIND,KIND…] [{}]", FLAGS.join("] [")).into());
    };
    let (seed, count): (u64, u64) = (seed.parse()?, count.parse()?);
    let mut drawn = rig::KINDS.to_vec();
    if let Some(asked) = kinds.first() {
        let asked = asked.replace("forcings", &forcing::KINDS.join(","));
        drawn.extend(forcing::KINDS);
        if let Some(unknown) = asked.split(',').find(|k| !drawn.contains(k)) {
            return Err(format!("there is no kind '{unknown}'; known: {}, forcings", drawn.join(", ")).into());
        }
        drawn.retain(|k| asked.split(',').any(|a| a == *k));
    }
    let has = |flag: &str| flags.iter().any(|f| f == flag);
    if let Some(unknown) = flags.iter().find(|f| !FLAGS.contains(&f.as_str())) {
        return Err(format!("there is no {unknown}; known: {}", FLAGS.join(", ")).into());
    }
    let together = if has("--triples") { 3 } else { 1 + usize::from(has("--pairs")) };
    let lab = record::Lab { coloured: has("--coloured"), hum: has("--hum"), wrong_rig: has("--wrong-rig") };
    let folder = Path::new(folder);
    let cases: Vec<(String, serde_json::Value)> = (0..count)
        .into_par_iter()
        .map(|i| {
            let name = format!("case-{:03}", i + 1);
            let mut random = fastrand::Rng::with_seed(seed * 1_000_003 + i);
            let mut kinds = if together == 1 { vec![drawn[i as usize % drawn.len()]] } else { Vec::new() };
            while kinds.len() < together {
                let left: Vec<_> = rig::together().filter(|kind| !kinds.contains(kind)).collect();
                kinds.push(left[random.usize(..left.len())]);
            }
            let case = rig::draw(&mut random, kinds[0], &kinds[1..], has("--plastic"), &name);
            record::write(&folder.join(&name), &case, &mut random, lab)?;
            let effects: Vec<_> = kinds.iter().filter(|kind| **kind != "nothing").collect();
            let truth = truth::of(&case, &folder.join(&name))?;
            Ok((
                name,
                json!({"hidden": {"effect": kinds[0], "effects": effects, "what": format!("{:?}", case.hidden)}, "start_effects": case.start_effects,
                       "noise_m": case.noise_m, "joukowsky_m": case.joukowsky_m(), "wave_speed_m_s": case.wave_speed_m_s,
                       "material": case.material, "truth": truth, "forcing": waveform::truth(&case)}),
            ))
        })
        .collect::<Result<_, Box<dyn std::error::Error + Send + Sync>>>()?;
    let answers: Map<String, serde_json::Value> = cases.into_iter().collect();
    std::fs::write(folder.join("answers.json"), serde_json::to_string_pretty(&answers)?)?;
    Ok(())
}
