//! What the paper's other rules are about: analyses of variance, compliance in equal steps, elements that change
//! places, runs repeated.

use crate::wall::{PAPER, Wall};
use surgescope::sensitivity::anova::{OneWay, one_way};
use surgescope::sensitivity::factor::Reach;
use surgescope::sensitivity::features::{OUTPUTS, index};
use surgescope::sensitivity::levels::{Plan, study};
use surgescope::sensitivity::subject::Subject;
use surgescope::sensitivity::{SensitivityError, Tick};

/// How far the other parameters are drawn in the analyses of variance, each way.
pub const SCATTERS: [f64; 2] = [0.01, 0.05];
/// More repeats than the paper's three: F of three is itself a matter of luck.
pub const PLAN: Plan = Plan { levels: 4, repeats: 25, seed: 1 };
/// The walls of the paper's analyses of variance: of the retardation times, of the compliances.
const WALLS: [(Wall, [&str; 2]); 2] = [
    (Wall { values: [0.1, 0.1, 1.5, 1.0] }, ["tau1_s", "tau2_s"]),
    (Wall { values: [0.1, 0.0225, 0.8, 1.1] }, ["J1_per_GPa", "J2_per_GPa"]),
];
/// Step of the compliances that are raised in equal steps, 1/GPa.
pub const EQUAL_STEP: f64 = 0.25;
/// Compliances so reached.
const EQUAL: usize = 8;

/// F of one parameter under one scatter.
pub struct Significance {
    /// The parameter.
    pub parameter: &'static str,
    /// Scatter of the others.
    pub scatter: f64,
    /// F of the peak differences 1-2, 1-3, 1-4.
    pub damping: [f64; 3],
    /// F of the time differences.
    pub phase: [f64; 3],
}

/// Results.
pub struct Designs {
    /// By parameter and scatter.
    pub significances: Vec<Significance>,
    /// Outputs at one to [`EQUAL`] steps, by element.
    equal: [Vec<Vec<f64>>; 2],
    /// The outputs of the paper's wall, and of the same with its elements named the other way round.
    pub swapped: [Vec<f64>; 2],
    /// The paper's analysis taken literally: four levels of τ1, the same run three times each; P1-P2.
    pub literal: Option<OneWay>,
}

impl Designs {
    /// Simulations that they take.
    pub fn runs() -> usize {
        SCATTERS.len() * 4 * PLAN.levels * PLAN.repeats + 2 * EQUAL + 2 + 12
    }

    /// Simulates them.
    ///
    /// # Errors
    /// If a simulation fails.
    pub fn run(subject: &Subject, tick: Tick) -> Result<Designs, SensitivityError> {
        let mut significances = Vec::new();
        for scatter in SCATTERS {
            for (wall, names) in WALLS {
                let around = Subject { values: wall.within(subject), ..subject.clone() };
                let studied = around.factors(Reach::Factor(2.0), &[], &names.map(String::from))?;
                let drawn = around.factors(Reach::Share(scatter), &[], &[])?;
                let found = study(&around, &studied, &drawn, PLAN, tick)?;
                for (analysis, parameter) in found.analyses.iter().zip(names) {
                    let f = |kind: &str| {
                        let own = found.outputs.iter().zip(&analysis.outputs).filter(|(o, _)| o.name.starts_with(kind));
                        let all: Vec<f64> = own.map(|(_, a)| a.map_or(f64::NAN, |a| a.f)).collect();
                        [all[0], all[1], all[2]]
                    };
                    significances.push(Significance { parameter, scatter, damping: f("drop"), phase: f("lag") });
                }
            }
        }
        let wall = PAPER;
        let read = |walls: Vec<Wall>| -> Result<Vec<Vec<f64>>, SensitivityError> {
            Ok(subject.run(&walls.iter().map(|w| w.within(subject)).collect::<Vec<_>>(), tick)?.outputs)
        };
        let equal = |element: usize| {
            let tau_s = wall.values[2 * element + 1];
            read((1..=EQUAL).map(|k| wall.with(element, k as f64 * EQUAL_STEP, tau_s)).collect())
        };
        let [j1, tau1, j2, tau2] = wall.values;
        let mut swapped = read(vec![wall, Wall { values: [j2, tau2, j1, tau1] }])?.into_iter();
        let mut next = || swapped.next().unwrap_or_else(|| vec![f64::NAN; OUTPUTS.len()]);
        let repeated = [0.05, 0.1, 0.2, 0.4].iter().flat_map(|&tau| [WALLS[0].0.with(0, 0.1, tau); 3]).collect();
        let drop12: Vec<f64> = read(repeated)?.iter().map(|v| v[index("drop12_m")]).collect();
        Ok(Designs {
            significances,
            equal: [equal(0)?, equal(1)?],
            swapped: [next(), next()],
            literal: one_way(&drop12.chunks(3).map(<[f64]>::to_vec).collect::<Vec<_>>()),
        })
    }

    /// What each of the equal steps of an element's compliance adds to an output.
    pub fn added(&self, element: usize, output: &str) -> Vec<f64> {
        self.equal[element].windows(2).map(|w| w[1][index(output)] - w[0][index(output)]).collect()
    }
}
