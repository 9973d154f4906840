//! Sobol indices of the Ishigami function by this project, for tools/sensitivity/compare.py:
//! `cargo run --release -p surgescope-tools --bin ishigami -- ROWS SEED` prints a row a parameter,
//! `S1 S1_low S1_high ST ST_low ST_high`.

use std::f64::consts::PI;

use surgescope::sensitivity::sobol::design;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let numbers: Vec<u64> = std::env::args().skip(1).map(|a| a.parse()).collect::<Result<_, _>>()?;
    let [rows, seed] = numbers[..] else { return Err("give ROWS and SEED".into()) };
    let design = design(3, rows as usize, seed)?;
    let ishigami = |u: &Vec<f64>| {
        let x = [0, 1, 2].map(|i| PI * (2.0 * u[i] - 1.0));
        x[0].sin() + 7.0 * x[1].sin().powi(2) + 0.1 * x[2].powi(4) * x[0].sin()
    };
    let values: Vec<f64> = design.points.iter().map(ishigami).collect();
    for i in design.shares(&values).parameters {
        let (s, t) = (i.first, i.total);
        println!("{} {} {} {} {} {}", s.value, s.low, s.high, t.value, t.low, t.high);
    }
    Ok(())
}
