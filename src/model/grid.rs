//! The grid: nodes evenly spaced in *travel time*, so that one time step carries a wave over every reach of every pipe
//! and no wave speed has to be bent to make pipes in series fit.
//!
//! The pipes' travel times `l/a` are laid end to end and divided into `N` equal steps. A reach inside one pipe is that
//! pipe's own `dx = a dt`. The one reach that straddles a joint becomes a segment of its own with the inertance
//! `Σ l/(gA)` and the capacitance `Σ gAl/a²` of its two parts: the joint's place and reflection move smoothly with wave
//! speeds and lengths, which a fit needs, and the error is second order in `dt`.

use super::ModelError;
use super::friction::WallFriction;
use crate::units::GRAVITY_M_S2;

/// A length of pipe with constant properties, as the layout of the model gives it.
#[derive(Debug, Clone)]
pub struct Stretch {
    /// Length, m.
    pub length_m: f64,
    /// Inner diameter, m.
    pub diameter_m: f64,
    /// Wall thickness, m.
    pub wall_m: f64,
    /// Elastic wave speed, m/s.
    pub wave_speed_m_s: f64,
    /// Constraint coefficient c₁ of the hoop strain.
    pub constraint: f64,
    /// Steady friction.
    pub friction: WallFriction,
}

impl Stretch {
    /// Cross-section, m².
    pub fn area_m2(&self) -> f64 {
        std::f64::consts::FRAC_PI_4 * self.diameter_m * self.diameter_m
    }
}

/// A run of reaches with equal properties; its nodes are numbered from 0 at the supply side to `reaches`.
#[derive(Debug, Clone)]
pub struct Segment {
    /// Index of its first node in the state's slices.
    pub offset: usize,
    /// Number of reaches; it has one node more.
    pub reaches: usize,
    /// Position of its first node, m from the supply.
    pub start_m: f64,
    /// Length of one reach, m.
    pub reach_m: f64,
    /// Characteristic impedance `B = a/(gA)`, s/m².
    pub impedance: f64,
    /// The parts of one reach: one stretch, or those that a joint's reach is mixed from, with their lengths in m.
    pub parts: Vec<(Stretch, f64)>,
}

impl Segment {
    /// The segment's nodes in the state's slices.
    pub fn nodes(&self) -> std::ops::Range<usize> {
        self.offset..self.offset + self.reaches + 1
    }

    /// Head that wall friction takes from a flow over one reach, m.
    pub fn reach_loss_m(&self, flow_m3_s: f64) -> f64 {
        self.parts.iter().map(|(s, length)| s.friction.slope(s.diameter_m, flow_m3_s) * length).sum()
    }

    /// Mean over one reach of a property of its stretches, weighted by length.
    pub fn mean(&self, property: impl Fn(&Stretch) -> f64) -> f64 {
        self.parts.iter().map(|(s, length)| property(s) * length).sum::<f64>() / self.reach_m
    }
}

/// The whole line from supply to valve.
#[derive(Debug, Clone)]
pub struct Grid {
    /// Time step, s.
    pub dt_s: f64,
    /// Segments from the supply to the valve.
    pub segments: Vec<Segment>,
}

impl Grid {
    /// Divides stretches in series into `reaches` reaches of equal travel time.
    ///
    /// # Errors
    /// If there are fewer than two reaches a stretch.
    pub fn new(stretches: &[Stretch], reaches: usize) -> Result<Grid, ModelError> {
        let needed = 2 * stretches.len();
        if reaches < needed {
            return Err(ModelError::TooFewReaches { reaches, needed });
        }
        let ends: Vec<f64> = stretches
            .iter()
            .scan(0.0, |t, s| {
                *t += s.length_m / s.wave_speed_m_s;
                Some(*t)
            })
            .collect();
        let dt_s = ends[ends.len() - 1] / reaches as f64;
        // Joints in units of reaches; one within a millionth of a node counts as on it.
        let joints: Vec<f64> =
            ends.iter().map(|t| t / dt_s).map(|j| if (j - j.round()).abs() < 1e-6 { j.round() } else { j }).collect();
        let mut segments: Vec<Segment> = Vec::new();
        let (mut node, mut offset, mut start_m) = (0usize, 0usize, 0.0);
        let mut push = |parts: Vec<(Stretch, f64)>, reaches: usize, start_m: &mut f64| {
            let reach_m: f64 = parts.iter().map(|p| p.1).sum();
            let inertance: f64 = parts.iter().map(|(s, l)| l / (GRAVITY_M_S2 * s.area_m2())).sum();
            let capacitance: f64 =
                parts.iter().map(|(s, l)| GRAVITY_M_S2 * s.area_m2() * l / s.wave_speed_m_s.powi(2)).sum();
            let impedance = (inertance / capacitance).sqrt();
            segments.push(Segment { offset, reaches, start_m: *start_m, reach_m, impedance, parts });
            offset += reaches + 1;
            *start_m += reach_m * reaches as f64;
        };
        while node < reaches {
            let here = joints.iter().position(|&j| j > node as f64).unwrap_or(joints.len() - 1);
            let whole = joints[here].floor() as usize - node;
            if whole > 0 {
                let reach_m = stretches[here].wave_speed_m_s * dt_s;
                push(vec![(stretches[here].clone(), reach_m)], whole, &mut start_m);
                node += whole;
                continue;
            }
            // The joint falls inside the reach from `node` to `node + 1`.
            let (from, to) = (node as f64, (node + 1) as f64);
            let mut parts = Vec::new();
            let mut begin = from;
            for (stretch, &joint) in stretches.iter().zip(&joints) {
                let end = joint.min(to);
                if end > begin {
                    parts.push((stretch.clone(), (end - begin) * dt_s * stretch.wave_speed_m_s));
                    begin = end;
                }
            }
            push(parts, 1, &mut start_m);
            node += 1;
        }
        Ok(Grid { dt_s, segments })
    }

    /// Number of nodes over all segments (a node between two segments counts in both).
    pub fn nodes(&self) -> usize {
        self.segments.last().map_or(0, |s| s.offset + s.reaches + 1)
    }

    /// The segment of a position, and weights of up to four of its nodes around it for cubic interpolation.
    pub fn stencil(&self, position_m: f64) -> (usize, Vec<(usize, f64)>) {
        let at = self
            .segments
            .iter()
            .position(|s| position_m <= s.start_m + s.reach_m * s.reaches as f64)
            .unwrap_or(self.segments.len() - 1);
        let segment = &self.segments[at];
        let x = ((position_m - segment.start_m) / segment.reach_m).clamp(0.0, segment.reaches as f64);
        let nearest = x.round();
        if (x - nearest).abs() < 1e-9 {
            return (at, vec![(segment.offset + nearest as usize, 1.0)]);
        }
        let points = (segment.reaches + 1).min(4);
        let first = (x.floor() as isize - (points as isize - 2) / 2).clamp(0, (segment.reaches + 1 - points) as isize);
        let first = first as usize;
        let weights = (first..first + points)
            .map(|i| {
                let weight = (first..first + points)
                    .filter(|&j| j != i)
                    .map(|j| (x - j as f64) / (i as f64 - j as f64))
                    .product::<f64>();
                (segment.offset + i, weight)
            })
            .collect();
        (at, weights)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stretch(length_m: f64, wave_speed_m_s: f64) -> Stretch {
        Stretch {
            length_m,
            diameter_m: 0.05,
            wall_m: 0.005,
            wave_speed_m_s,
            constraint: 1.0,
            friction: WallFriction::constant(0.02),
        }
    }

    #[test]
    fn travel_time_and_length_are_exact_whatever_the_joint() {
        for (l1, a1, l2, a2) in [(60.0, 1200.0, 40.0, 400.0), (10.0, 1000.0, 90.3, 350.0), (33.3, 500.0, 66.7, 500.0)] {
            let grid = Grid::new(&[stretch(l1, a1), stretch(l2, a2)], 37).unwrap();
            let length: f64 = grid.segments.iter().map(|s| s.reach_m * s.reaches as f64).sum();
            assert!((length - l1 - l2).abs() < 1e-9, "{length}");
            assert!((grid.dt_s * 37.0 - l1 / a1 - l2 / a2).abs() < 1e-12);
            assert_eq!(grid.segments.iter().map(|s| s.reaches).sum::<usize>(), 37);
        }
    }

    #[test]
    fn a_joint_on_a_node_leaves_no_mixed_reach() {
        let grid = Grid::new(&[stretch(50.0, 500.0), stretch(100.0, 1000.0)], 20).unwrap();
        assert_eq!(grid.segments.len(), 2);
        assert!(grid.segments.iter().all(|s| s.parts.len() == 1 && s.reaches == 10));
    }

    #[test]
    fn the_stencil_reproduces_a_cubic() {
        let grid = Grid::new(&[stretch(100.0, 1000.0)], 25).unwrap();
        let f = |x: f64| 1.0 + 0.3 * x - 0.02 * x * x + 1e-4 * x.powi(3);
        for position in [0.0, 1.3, 4.0, 51.7, 98.9, 100.0] {
            let value: f64 = grid.stencil(position).1.iter().map(|&(i, w)| w * f(4.0 * i as f64)).sum();
            assert!((value - f(position)).abs() < 1e-9, "{position}: {value}");
        }
    }

    #[test]
    fn too_few_reaches_are_refused() {
        let error = Grid::new(&[stretch(1.0, 1.0), stretch(1.0, 1.0)], 3).unwrap_err();
        assert!(error.to_string().contains("at least 4"), "{error}");
    }
}
