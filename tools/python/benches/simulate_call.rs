//! How long the library takes for the simulation that `bars.py` calls from Python: the same rig, effects, settings and
//! times. Prints the median of many calls, µs.

use std::path::Path;
use std::time::Instant;

use surgescope::rig::Rig;
use surgescope::simulate::cavities::unmodelled;
use surgescope::simulate::scenario::{Scenario, ValveForm};

const CALLS: usize = 3000;

fn main() -> Result<(), Box<dyn std::error::Error + Send + Sync>> {
    let rig = Rig::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../rigs/demo-hdpe.toml"))?;
    let settings = [("reaches".to_owned(), 8.0)];
    let times_s: Vec<f64> = (0..10).map(|i| f64::from(i) * 0.001).collect();
    let mut taken_us = Vec::with_capacity(CALLS);
    for _ in 0..CALLS {
        let start = Instant::now();
        let scenario = Scenario::new(rig.clone(), &[], ValveForm::Linear, &settings)?;
        let traces = scenario.simulate(0.009)?;
        let heads: Vec<Vec<f64>> = traces.iter().map(|trace| times_s.iter().map(|&t| trace.at(t)).collect()).collect();
        let cavities = unmodelled(&scenario, &traces);
        taken_us.push(start.elapsed().as_secs_f64() * 1e6);
        assert!(cavities.is_empty() && heads.iter().flatten().all(|head| head.is_finite()));
    }
    taken_us.sort_by(f64::total_cmp);
    println!("{:.1}", taken_us[CALLS / 2]);
    Ok(())
}
