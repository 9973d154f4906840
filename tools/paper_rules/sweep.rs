//! One Kelvin-Voigt element at many retardation times, its compliance raised at each: what most of the paper's rules
//! are about.

use rayon::prelude::*;

use crate::wall::{PAPER, Wall};
use surgescope::model::ModelError;
use surgescope::sensitivity::Tick;
use surgescope::sensitivity::features::{Features, index};
use surgescope::sensitivity::map::Response;
use surgescope::sensitivity::subject::Subject;

/// Decades of retardation times below and above the paper's 0.1 s.
const DECADES: (i32, i32) = (3, 3);
/// Retardation times a decade.
const PER_DECADE: i32 = 8;
/// From which compliance to which, 1/GPa: a small step, and that of the paper's Figure 12.
pub const STEPS: [(f64, f64); 2] = [(0.1, 0.2), (1.0, 2.0)];
/// The wall in which the paper varies its second element (text to Figure 11).
const SECOND: Wall = Wall { values: [2.0, 0.0011, 1.5, 1.1] };
/// The other element's retardation time, s, where a rule is about what that changes.
pub const OTHER_TAUS_S: [f64; 3] = [0.11, 1.1, 11.0];

/// What raising the compliance does at one retardation time.
#[derive(Debug, Clone, PartialEq)]
pub struct Point {
    /// Retardation time of the element, s.
    pub tau_s: f64,
    /// Before.
    before: Features,
    /// After.
    after: Features,
}

impl Point {
    fn response(&self) -> Response {
        Response::of(&self.before, &self.after)
    }

    /// Delay of the fourth crossing of the mean level, percent of `4L/a`.
    pub fn phase_percent(&self) -> f64 {
        self.response().phase_percent
    }

    /// Change of the logarithmic decrement.
    pub fn decrement(&self) -> f64 {
        self.response().damping
    }

    /// The same as a part of the decrement before.
    pub fn relative_decrement(&self) -> f64 {
        self.decrement() / self.before.damping().unwrap_or(f64::NAN)
    }

    /// Change of the first peak minus the second, m.
    pub fn drop12_m(&self) -> f64 {
        let drop = |f: &Features| f.values()[index("drop12_m")];
        drop(&self.after) - drop(&self.before)
    }

    /// `(P − P′)/P` of a peak counted from 1, percent: equation 21.
    pub fn peak_percent(&self, number: usize) -> f64 {
        self.response().peaks_percent[number - 1]
    }

    /// Delay of a peak counted from 1, percent of `4L/a`.
    pub fn delay_percent(&self, number: usize) -> f64 {
        match (self.before.peak(number), self.after.peak(number)) {
            (Some(b), Some(a)) => 100.0 * (a.0 - b.0) / self.before.period_s,
            _ => f64::NAN,
        }
    }
}

/// All sweeps of one closure.
pub struct Sweeps {
    /// Theoretical period `4L/a`, s.
    pub period_s: f64,
    /// By element and step of [`STEPS`], at each retardation time.
    pub elements: [[Vec<Point>; 2]; 2],
    /// The first element with the small step, by the second's retardation time in [`OTHER_TAUS_S`].
    pub others: Vec<Vec<Point>>,
}

impl Sweeps {
    /// Simulations that they take.
    pub fn runs() -> usize {
        2 * taus_s().len() * (2 * STEPS.len() + OTHER_TAUS_S.len())
    }

    /// Simulates them.
    ///
    /// # Errors
    /// If a simulation fails.
    pub fn run(subject: &Subject, tick: Tick) -> Result<Sweeps, ModelError> {
        let of = |wall: Wall, element: usize, step: (f64, f64)| sweep(subject, wall, element, step, tick);
        let both = |wall: Wall, element: usize| {
            Ok::<_, ModelError>([of(wall, element, STEPS[0])?, of(wall, element, STEPS[1])?])
        };
        let other = |&tau_s: &f64| of(PAPER.with(1, PAPER.values[2], tau_s), 0, STEPS[0]);
        Ok(Sweeps {
            period_s: subject.period_s(),
            elements: [both(PAPER, 0)?, both(SECOND, 1)?],
            others: OTHER_TAUS_S.iter().map(other).collect::<Result<_, _>>()?,
        })
    }
}

fn taus_s() -> Vec<f64> {
    let (below, above) = DECADES;
    (-below * PER_DECADE..=above * PER_DECADE).map(|i| 0.1 * 10f64.powf(f64::from(i) / f64::from(PER_DECADE))).collect()
}

/// Raises the compliance of an element at each retardation time.
fn sweep(
    subject: &Subject,
    wall: Wall,
    element: usize,
    step: (f64, f64),
    tick: Tick,
) -> Result<Vec<Point>, ModelError> {
    taus_s()
        .par_iter()
        .map(|&tau_s| {
            let seen = |compliance: f64| {
                let features = subject.features(&wall.with(element, compliance, tau_s).within(subject));
                tick();
                features
            };
            Ok(Point { tau_s, before: seen(step.0)?, after: seen(step.1)? })
        })
        .collect()
}
