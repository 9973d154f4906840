//! A dead-end branch: a pipe that leaves the line at one place, leads nowhere and stores what pressure pushes into it.
//!
//! The branch is elastic and frictionless, with the wave speed of the line at its place. The wave `f` that enters it
//! returns from the dead end unchanged after `2l/a`: `h = f + r`, `r(t) = f(t - 2l/a)`, `Q = (f - r)/B`. Interpolating
//! `f` between time steps (cubic; linear if it returns within one step) makes the trace smooth in the length.

use crate::model::effect::{Attachment, Effect, Element, Place, check};
use crate::model::error::ModelError;
use crate::model::node::Shunt;
use crate::model::parameter::Parameter;
use crate::model::scene::{Scene, Site};
use crate::units::GRAVITY_M_S2;

/// See the module.
pub struct SideBranch;

impl Effect for SideBranch {
    fn name(&self) -> &'static str {
        "side-branch"
    }
    fn summary(&self) -> &'static str {
        "a dead-end branch at an unknown place"
    }
    fn equation(&self) -> &'static str {
        "h = f + r, Q = (f - r) g A_b/a, r(t) = f(t - 2l/a): a node with three pipes, one of them closed"
    }
    fn source(&self) -> &'static str {
        "Wylie & Streeter (1993), Fluid Transients in Systems; Duan & Lee (2016), J. Hydraul. Eng. 142(2):04015045"
    }
    fn trace(&self) -> &'static str {
        "a falling step of a third of the wave when its reflection arrives, echoes of its dead end, a mode of its own"
    }

    fn remedy(&self, place: Option<&str>, _sensor: Option<&str>) -> Option<String> {
        place.map(|at| format!("close off the branch at {at} and repeat the test"))
    }
    fn on_pipe(&self) -> bool {
        true
    }
    fn parameters(&self, site: &Site, _elements: usize) -> Vec<Parameter> {
        let length_m = site.length_m();
        vec![
            Parameter::linear(
                "branch_position_m",
                "m",
                "where the branch leaves the line, from the supply (in a network, from where its pipe begins)",
                0.5 * length_m,
                0.02 * length_m,
                0.98 * length_m,
            ),
            Parameter::log(
                "branch_length_m",
                "m",
                "length of the branch to its dead end",
                0.06 * length_m,
                0.0001 * length_m,
                0.5 * length_m,
            )
            .vanishing_at(0.0),
            Parameter::log(
                "branch_area_ratio",
                "1",
                "cross-section of the branch over that of the line",
                1.0,
                0.05,
                5.0,
            )
            .with_prior(1.0, 0.5),
        ]
    }

    fn other_starts(&self, _elements: usize) -> Vec<Vec<f64>> {
        crate::model::effect::other_places().flat_map(|by| [0.6, 2.0].map(|length| vec![by, length, 1.0])).collect()
    }

    fn attachments<'a>(&self, values: &'a [f64], scene: &'a Scene) -> Result<Vec<Attachment<'a>>, ModelError> {
        let [position_m, length_m, area_ratio] = *values else { return Ok(Vec::new()) };
        let inside = scene.is_inside(position_m);
        check("branch_position_m", position_m, inside, "inside the pipe, between supply and valve")?;
        check("branch_length_m", length_m, length_m >= 0.0, "zero or more")?;
        check("branch_area_ratio", area_ratio, area_ratio >= 0.0, "zero or more")?;
        if length_m == 0.0 || area_ratio == 0.0 {
            return Ok(Vec::new());
        }
        let dt_s = scene.dt_s;
        Ok(vec![Attachment {
            place: Place::At(position_m),
            make: Box::new(move |spot| {
                let admittance = area_ratio * GRAVITY_M_S2 * spot.area_m2 / spot.wave_speed_m_s;
                Element::Shunt(Box::new(DeadEnd::new(admittance, 2.0 * length_m / spot.wave_speed_m_s / dt_s)))
            }),
        }])
    }
}

/// The branch as seen from the line.
struct DeadEnd {
    /// `g A_b/a`, m²/s.
    admittance: f64,
    steady_head_m: f64,
    /// Waves that entered, one per step, in a ring buffer; `last` is the index of the last.
    entered: Vec<f64>,
    last: usize,
    /// Weights in the returning wave of the waves that entered `first, first + 1, …` steps before the new time.
    weights: [f64; 4],
    first: usize,
    /// The part of the returning wave that is known before the step, and the share of the entering wave in it.
    known: f64,
    implicit: f64,
}

impl DeadEnd {
    /// `delay` is the travel time to the dead end and back, in steps.
    fn new(admittance: f64, delay: f64) -> DeadEnd {
        let whole = delay.floor();
        let s = delay - whole;
        // Lagrange through -1, 0, 1, 2. All its gains are at most one, so interpolation feeds no energy to the branch.
        let (first, weights) = if whole < 1.0 {
            (0, [1.0 - s, s, 0.0, 0.0])
        } else {
            let (m, p, q) = (s + 1.0, s - 1.0, s - 2.0);
            (whole as usize - 1, [-s * p * q / 6.0, m * p * q / 2.0, -m * s * q / 2.0, m * s * p / 6.0])
        };
        let implicit = if first == 0 { weights[0] } else { 0.0 };
        DeadEnd {
            admittance,
            steady_head_m: 0.0,
            entered: vec![0.0; first + 4],
            last: 0,
            weights,
            first,
            known: 0.0,
            implicit,
        }
    }

    /// The returning wave if the head is `h` above the steady one, from `r = w f + known`, `f = h - r`.
    fn returning(&self, h: f64) -> f64 {
        (self.implicit * h + self.known) / (1.0 + self.implicit)
    }
}

impl Shunt for DeadEnd {
    fn settle(&mut self, head_m: f64) -> f64 {
        self.steady_head_m = head_m;
        self.entered.fill(0.0);
        self.known = 0.0;
        0.0
    }

    fn outflow(&self, head_m: f64) -> (f64, f64) {
        let h = head_m - self.steady_head_m;
        let slope = (1.0 - self.implicit) / (1.0 + self.implicit);
        (self.admittance * (h - 2.0 * self.returning(h)), self.admittance * slope)
    }

    fn advance(&mut self, head_m: f64) {
        let h = head_m - self.steady_head_m;
        let size = self.entered.len();
        self.last = (self.last + 1) % size;
        self.entered[self.last] = h - self.returning(h);
        // What entered `back` steps before the next time is `back - 1` steps before the last.
        self.known = (0..4)
            .map(|j| (self.first + j, self.weights[j]))
            .filter(|&(back, _)| back > 0)
            .map(|(back, weight)| weight * self.entered[(self.last + size + 1 - back) % size])
            .sum();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A head that follows a wave of one frequency: the flow is that of a lossless stub, `Q = Y tan(ωl/a) h` a quarter
    /// turn ahead.
    #[test]
    fn its_admittance_is_that_of_a_closed_stub() {
        for delay in [0.3, 0.999, 1.0, 1.5, 2.7, 13.4] {
            let mut stub = DeadEnd::new(2e-3, delay);
            stub.settle(10.0);
            let turn = 0.03;
            let exact = 2e-3 * (0.5 * delay * turn).tan();
            // The start leaves a ringing that dies only at the resonances' own (zero) rate: grow the wave in smoothly.
            let (mut worst, mut size) = (0.0f64, 0.0f64);
            for n in 1..6000 {
                let t = f64::from(n);
                let grow = if t < 3000.0 { 0.5 - 0.5 * (std::f64::consts::PI * t / 3000.0).cos() } else { 1.0 };
                let head = 10.0 + grow * (turn * t).sin();
                let flow = stub.outflow(head).0;
                stub.advance(head);
                if n > 4000 {
                    worst = worst.max((flow - exact * (turn * t).cos()).abs());
                    size = size.max(flow.abs());
                }
            }
            // Within one step the interpolation is linear and swallows `½ s (1 - s) ω²` of the wave: a small real
            // admittance.
            let swallowed = if delay < 1.0 { 0.25 * delay * (1.0 - delay) * turn * turn * 2e-3 } else { 0.0 };
            assert!(worst < 2e-3 * exact + 1.01 * swallowed, "{delay}: {worst} of {exact}");
            assert!((size / exact - 1.0).abs() < 2e-3, "{delay}");
        }
    }

    #[test]
    fn no_interpolation_gives_the_branch_energy() {
        for delay in (1..400).map(|i| 0.01 * f64::from(i)) {
            let stub = DeadEnd::new(1.0, delay);
            for turn in (0..200).map(|i| std::f64::consts::PI * f64::from(i) / 199.0) {
                let part = |g: fn(f64) -> f64| {
                    stub.weights.iter().enumerate().map(|(j, w)| w * g(turn * (stub.first + j) as f64)).sum::<f64>()
                };
                assert!(part(f64::cos).hypot(part(f64::sin)) <= 1.0 + 1e-12, "{delay} {turn}");
            }
        }
    }

    /// A branch that falls between nodes is not blurred: its error stays that of one on a node, and falls at more than
    /// first order.
    #[test]
    fn a_branch_between_nodes_is_as_sharp_as_one_on_a_node() {
        use crate::model::effects::parse_list;
        use crate::model::trace::Probe;
        use crate::model::{Conditions, Model, Resolution, RunValues};
        let rig = crate::rig::Rig::from_toml(crate::fit::problem::test_record::HDPE, "rig.toml").unwrap();
        let water = rig.fluid.properties(20.0);
        let effects = parse_list("side-branch").unwrap();
        let model = Model::new(&rig, &water, &effects);
        let run =
            RunValues { initial_velocity_m_s: 0.3, valve_head_m: 40.0, closing_time_s: 0.02, friction_scale: 1.0 };
        let heads = |reaches: usize, position_m: f64| {
            let resolution = Resolution { reaches, duration_s: 0.6 };
            let shared = [1300.0, position_m, 7.5, 1.0];
            let probes = [Probe::head(80.0)];
            let made = model.simulate(&Conditions::of(water), &shared, &run, resolution, &probes).unwrap();
            (0..600).map(|i| made.traces[0].at(1e-3 * f64::from(i))).collect::<Vec<f64>>()
        };
        let error = |reaches: usize, position_m: f64| {
            let (coarse, fine) = (heads(reaches, position_m), heads(1280, position_m));
            (coarse.iter().zip(&fine).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / 600.0).sqrt()
        };
        // nodes of 80 reaches are 1 m apart
        let (on, between) = (error(80, 30.0), error(80, 30.5));
        assert!(between < 3.0 * on && between < 0.1, "{on} m on a node, {between} m between two");
        let order = (between / error(160, 30.5)).log2();
        assert!(order > 1.2, "order {order}");
    }
}
