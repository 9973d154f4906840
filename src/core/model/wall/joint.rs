//! A joint of two pipes in series whose walls hang together, and may move along their axis.
//!
//! The joint has no mass and no support of its own. For the water in it and the wall around it, with `A` and `A_w` for
//! the sections of water and wall,
//!
//! ```text
//! H1 = H2                                no loss of head (what an element takes there is behind the joint)
//! A1 (V1 - u1) = A2 (V2 - u2)            what flows into the moving joint flows out of it
//! u1 = u2                                the walls stay together
//! A_w1 s1 - A1 H1 = A_w2 s2 - A2 H2      tension of the walls, and the push of the water on the change of section
//! ```
//!
//! The last is the balance of momentum of a slice about the joint: the walls pull with `A_w1 s1` and `A_w2 s2`, the water
//! pushes with `A1 H1` and `A2 H2`, and the momentum that it carries through is left out, as it is along a pipe. With
//! `A2 = A_w2 = 0` it is the law of a closed end. Together they pass on the power `ρg [A (V - u) H + (A H - A_w s) u]`
//! unchanged, so that no energy is lost. On such coupling in general: Wiggert & Tijsseling (2001), Appl. Mech. Rev.
//! 54:455-481; on two pipes: Tijsseling (2009), CASA report 09-14, Eindhoven, of which no number is used here.
//!
//! Three of the four waves are eliminated. What is left is the characteristic that reaches the pressure waves of the pipe
//! behind the joint, which the node then takes as it takes any other.

use nalgebra::{Vector2, Vector3};

use crate::model::node::Arriving;
use crate::model::wall::modes::Modes;
use crate::model::wall::ways::Mouth;

/// See the module. Heads and flows are deviations from the steady flow, in which there are no stress waves.
pub(crate) struct WallJoint {
    /// The segment before it.
    pub(crate) segment: usize,
    /// Waves of the pipe before it and of the one behind it.
    modes: [Modes; 2],
    steady_m: f64,
    steady_m3_s: f64,
    pub(crate) mouths: [Mouth; 2],
    met: Met,
}

/// What is linear in the flow `q` of the pressure waves behind the joint: the constant and the factor of `q`.
type Line = Vector2<f64>;

/// A step before its `q` is known.
#[derive(Default)]
struct Met {
    /// Head and flow of the pressure waves before the joint.
    head: Line,
    flow: Line,
    /// Sums of the two stress waves before the joint and behind it.
    sums: [Line; 2],
}

impl WallJoint {
    /// Behind a segment, with head and flow there before the closure.
    pub(crate) fn new(segment: usize, modes: [Modes; 2], (steady_m, steady_m3_s): (f64, f64)) -> WallJoint {
        let mouths = [Mouth::new(), Mouth::new()];
        WallJoint { segment, modes, steady_m, steady_m3_s, mouths, met: Met::default() }
    }

    /// The characteristic that reaches the pressure waves behind the joint, from that which reaches those before it.
    pub(crate) fn meets(&mut self, reached: Arriving) -> Arriving {
        let [before, behind] = &self.modes;
        let [arriving, coming] = self.mouths.each_ref().map(|mouth| mouth.arriving_m);
        // All by their constant and their factors of q and of the jump J between the stress waves behind the joint.
        let (one, q, jump) = (Vector3::x(), Vector3::y(), Vector3::z());
        let flow = q * behind.through() + jump * behind.flow_per_stress();
        let velocity = q * behind.per_flow() - jump * behind.per_stress();
        // Flow and velocity fix q and J before the joint.
        let both = 1.0 + before.alpha * before.beta;
        let q_before = (flow + velocity * (before.flow_per_stress() / before.per_stress())) / both;
        let jump_before = (flow * before.per_flow() - velocity * before.through()) / (before.per_stress() * both);
        let sum_before = one * (2.0 * arriving) - jump_before;
        let sum_behind = one * (2.0 * coming) + jump;
        let epsilon_m = reached.e - self.steady_m - reached.z * self.steady_m3_s;
        let h_before = one * epsilon_m - q_before * reached.z;
        let head = h_before + sum_before * before.beta;
        let h_behind = head - sum_behind * behind.beta;
        let pull = |modes: &Modes, sum, h: Vector3<f64>| (sum - h * modes.alpha) * modes.wall_m2();
        let force = pull(before, sum_before, h_before) - pull(behind, sum_behind, h_behind)
            + head * (behind.area_m2 - before.area_m2);
        // It vanishes: that is J.
        let jump = -force.xy() / force.z;
        let line = |of: Vector3<f64>| of.xy() + jump * of.z;
        self.met = Met { head: line(h_before), flow: line(q_before), sums: [line(sum_before), line(sum_behind)] };
        let h = line(h_behind);
        Arriving { z: -h.y, e: self.steady_m + h.x - h.y * self.steady_m3_s }
    }

    /// Head and flow of the pressure waves before the joint where the flow of those behind it is this one.
    pub(crate) fn leaves(&mut self, flow_m3_s: f64) -> (f64, f64) {
        let q = flow_m3_s - self.steady_m3_s;
        let at = |line: &Line| line.x + line.y * q;
        for (mouth, sum) in self.mouths.iter_mut().zip(&self.met.sums) {
            mouth.leaving_m = at(sum) - mouth.arriving_m;
        }
        (self.steady_m + at(&self.met.head), self.steady_m3_s + at(&self.met.flow))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::wall::modes::Wall;
    use crate::units::GRAVITY_M_S2;

    fn modes(area_m2: f64, wall_ratio: f64, poisson_ratio: f64, stress_speed_m_s: f64, density_ratio: f64) -> Modes {
        let wall =
            Wall { poisson_ratio, stress_speed_m_s, density_ratio, wall_ratio, area_m2, length_m: 1.0, floor_m: 0.0 };
        wall.modes(700.0).unwrap()
    }

    /// Head, relative flow, velocity and force, from the pressure waves and the stress waves in a pipe.
    fn state(modes: &Modes, (h, q): (f64, f64), down: f64, up: f64) -> [f64; 4] {
        let (sum, jump, g) = (down + up, down - up, GRAVITY_M_S2 / modes.stress_speed_m_s);
        let head = h + modes.beta * sum;
        let velocity = modes.alpha * modes.density_ratio * q / modes.area_m2 - g * modes.density_ratio * jump;
        let flow = q + modes.area_m2 * modes.beta * g * jump - modes.area_m2 * velocity;
        let stress = sum - modes.alpha * h;
        [head, flow, velocity, modes.area_m2 / modes.thrust * stress - modes.area_m2 * head]
    }

    #[test]
    fn the_four_laws_hold() {
        let pipes = [modes(0.5, 100.0, 0.3, 5000.0, 0.13), modes(0.2, 30.0, 0.4, 1900.0, 0.7)];
        let mut joint = WallJoint::new(0, pipes, (30.0, 0.1));
        joint.mouths[0].arriving_m = 3.0;
        joint.mouths[1].arriving_m = -2.0;
        let reached = Arriving { z: 150.0, e: 70.0 };
        let seen = joint.meets(reached);
        let flow = 0.04;
        let before = joint.leaves(flow);
        assert!((before.0 - (reached.e - reached.z * before.1)).abs() < 1e-9);
        let behind = (seen.e - seen.z * flow, flow);
        let deviation = |(head, flow): (f64, f64)| (head - 30.0, flow - 0.1);
        let [left, right] = &joint.mouths;
        let before = state(&pipes[0], deviation(before), left.arriving_m, left.leaving_m);
        let behind = state(&pipes[1], deviation(behind), right.leaving_m, right.arriving_m);
        for (a, b) in before.iter().zip(&behind) {
            assert!((a - b).abs() < 1e-9 * (1.0 + a.abs()), "{before:?} {behind:?}");
        }
    }

    #[test]
    fn between_equal_pipes_nothing_is_sent_back() {
        let pipe = modes(0.5, 100.0, 0.3, 5000.0, 0.13);
        let mut joint = WallJoint::new(0, [pipe; 2], (30.0, 0.1));
        joint.mouths[0].arriving_m = 3.0;
        joint.mouths[1].arriving_m = -2.0;
        let reached = Arriving { z: 150.0, e: 70.0 };
        let seen = joint.meets(reached);
        let (head, flow) = joint.leaves(0.04);
        assert!((seen.z - reached.z).abs() < 1e-9 && (seen.e - reached.e).abs() < 1e-9, "{seen:?}");
        assert!((head - (70.0 - 150.0 * 0.04)).abs() < 1e-9 && (flow - 0.04).abs() < 1e-12);
        assert!((joint.mouths[0].leaving_m + 2.0).abs() < 1e-9 && (joint.mouths[1].leaving_m - 3.0).abs() < 1e-9);
    }
}
