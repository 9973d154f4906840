//! The creep test: the strain of a specimen under a constant load gives the Kelvin-Voigt elements of the pipe's wall.
//!
//! `J(t) = J0 + Σ J_k (1 - exp(-t/τ_k))` (generalised Kelvin-Voigt; Ferry, Viscoelastic Properties of Polymers, 1980,
//! ch. 1 and 11 for the shift of times with temperature, `τ_k(T) = a_T τ_k`).
//!
//! | file | what it does |
//! | --- | --- |
//! | [`read`] | a test from the text of a CSV file |
//! | [`nnls`] | non-negative least squares |
//! | `spectrum` | from samples to a few retardation times, where a fit starts |
//! | `problem` | the fit as bounded least squares |
//! | `reading_noise` | errors where neighbouring readings are correlated |
//! | `outcome` | what a fit gives back |
//! | `ladder` | fits of one element after the other, and the evidence for each |
//! | [`fit`](mod@fit) | the fit: number of elements, noise, intervals |
//! | `remarks` | warnings about its numbers |
//! | [`shift`] | Arrhenius' and Williams, Landel and Ferry's laws of the shift |
//! | [`file`](mod@file) | the result on disk, `CREEP.toml` |
//! | [`prior`] | the prior that it gives a calibration |

pub mod file;
pub mod fit;
pub(crate) mod ladder;
pub mod nnls;
pub mod outcome;
pub mod prior;
pub(crate) mod problem;
pub mod read;
pub(crate) mod reading_noise;
pub(crate) mod remarks;
pub mod shift;
pub(crate) mod spectrum;
pub mod thresholds;

/// One specimen under one constant load from time 0.
#[derive(Debug, Clone, PartialEq)]
pub struct CreepTest {
    /// Name of its file.
    pub file: String,
    /// Temperature, °C, where it is known.
    pub temperature_degc: Option<f64>,
    /// Times after the load was applied, s; increasing, none negative.
    pub time_s: Vec<f64>,
    /// Strain over stress at these times, 1/Pa; all positive.
    pub compliance_per_pa: Vec<f64>,
}

/// One Kelvin-Voigt element.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Element {
    /// Compliance, 1/Pa.
    pub compliance_per_pa: f64,
    /// Retardation time, s.
    pub tau_s: f64,
}

/// The creep compliance of a material at one temperature.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Creep {
    /// J0, 1/Pa: the instantaneous compliance; from a test that of its first reading, which includes all faster creep.
    pub instantaneous_per_pa: f64,
    /// By retardation time.
    pub elements: Vec<Element>,
}

impl Creep {
    /// J(t), 1/Pa.
    pub fn compliance_per_pa(&self, time_s: f64) -> f64 {
        let retarded = self.elements.iter().map(|e| -e.compliance_per_pa * (-time_s / e.tau_s).exp_m1());
        self.instantaneous_per_pa + retarded.sum::<f64>()
    }
}

/// Why creep tests cannot be fitted, or why their result cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs)] // the sentences say it
pub enum CreepError {
    #[error("{file}{}: {problem}", .line.map_or(String::new(), |l| format!(", line {l}")))]
    Csv { file: String, line: Option<usize>, problem: String },
    #[error("{file} is no result of a creep test: {problem}")]
    File { file: String, problem: String },
    #[error(
        "{files} creep tests and {temperatures} temperatures: give one temperature for each file, in the order of the files"
    )]
    Temperatures { files: usize, temperatures: usize },
    #[error("the reference of {reference} °C is none of the temperatures tested, {tested}: choose one of them")]
    Reference { reference: f64, tested: String },
    #[error("{elements} elements have {parameters} parameters, and there are {samples} samples: ask for fewer")]
    TooManyElements { elements: usize, parameters: usize, samples: usize },
    #[error(
        "a surge of period {period_s:.3} s shows none of the elements of the creep test; it shows retardation times from {shortest_s:.3} \
         to {longest_s:.3} s, and the test has {found}"
    )]
    NoneInReach { period_s: f64, shortest_s: f64, longest_s: f64, found: String },
    #[error(
        "the creep test has {found} elements that a surge can show, and a model takes at most {most}: fit the test with fewer"
    )]
    TooManyInReach { found: usize, most: usize },
    #[error(
        "viscoelastic-wall:{asked} asks for fewer elements than the {found} of the creep test that a surge can show: use \
         viscoelastic-wall:{found} or more, or leave the number out"
    )]
    TooFew { asked: usize, found: usize },
    #[error("a creep test describes viscoelastic-wall, which is not in the model: add this effect")]
    NoWall,
}
