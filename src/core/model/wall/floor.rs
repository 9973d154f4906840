//! Dry friction between a pipe and what it lies on, gathered at the places where stress waves meet after each step.
//!
//! There the stress jumps by `f`, at most by what the floor holds, against the wall's velocity; head, flow and that
//! velocity do not jump. It sends a stress wave of `-f/2(1 + αβ)` upstream, its opposite downstream, and pressure waves
//! of `-β` times as much. Where less than the most is enough, the wall stands still.

use std::ops::Range;

use crate::model::grid::Segment;
use crate::model::steady::Steady;
use crate::model::wall::modes::{Modes, Wall};
use crate::model::wall::ways::Ways;

/// See the module.
pub(crate) struct Floor {
    modes: Modes,
    /// From the pipe's end on.
    places: Vec<Rubbed>,
    /// For each probe, where waves towards it were changed last.
    heard: Vec<[Option<Heard>; 2]>,
}

/// One place of it.
struct Rubbed {
    x_m: f64,
    /// Most of `f/2(1 + αβ)`.
    most_m: f64,
    /// Inner nodes around it, with weights.
    nodes: [(usize, f64); 2],
    /// Velocity of the wall by the pressure waves' `u`, in steady flow, and by what is sent.
    by_u: f64,
    steady_m_s: f64,
    by_sent: f64,
}

/// A wave as it was after each step at the place of this number.
pub(crate) struct Heard {
    place: usize,
    pub(crate) x_m: f64,
    pub(crate) wave_m: Vec<f64>,
}

impl Floor {
    /// Of a pipe on these segments, whose stress waves have `count` places to meet. Nothing where there are no nodes
    /// about these places.
    pub(crate) fn new(
        wall: &Wall,
        modes: Modes,
        count: usize,
        segments: Range<usize>,
        steady: &Steady,
    ) -> Option<Floor> {
        let (grid, reach_m) = (steady.grid, modes.stress_speed_m_s * steady.grid.dt_s);
        let start_m = grid.segments[segments.start].start_m;
        // Place, index and steady flow of each inner node.
        let inner: Vec<(f64, usize, f64)> = segments
            .flat_map(|s| {
                let (Segment { start_m, reach_m, offset, reaches, .. }, flow) =
                    (&grid.segments[s], steady.flow_m3_s[s]);
                (1..*reaches).map(move |i| (start_m + reach_m * i as f64, offset + i, flow))
            })
            .collect();
        let last = inner.len().checked_sub(1).filter(|last| *last > 0)?;
        let twice = 2.0 * (1.0 + modes.alpha * modes.beta);
        let place = |i: usize| {
            let along_m = wall.length_m - (i + 1) as f64 * reach_m;
            let x_m = start_m + along_m;
            // The first has what lies between it and the pipe's end, the last what lies between it and its beginning.
            let to_end_m = if i == 0 { reach_m } else { 0.5 * reach_m };
            let to_start_m = if i + 1 == count { along_m } else { 0.5 * reach_m };
            let behind = inner.partition_point(|(at_m, ..)| *at_m < x_m).clamp(1, last);
            let [(from_m, first, from_m3_s), (to_m, second, to_m3_s)] = [inner[behind - 1], inner[behind]];
            let part = ((x_m - from_m) / (to_m - from_m)).clamp(0.0, 1.0);
            let Segment { impedance, .. } = grid.segments[grid.stencil(x_m).segment];
            let by_u = modes.per_flow() / impedance;
            Rubbed {
                x_m,
                most_m: modes.thrust * wall.floor_m * (to_end_m + to_start_m) / wall.length_m / twice,
                nodes: [(first, 1.0 - part), (second, part)],
                by_u,
                steady_m_s: modes.per_flow() * ((1.0 - part) * from_m3_s + part * to_m3_s),
                by_sent: modes.per_stress() + by_u * modes.beta * (part * part + (1.0 - part) * (1.0 - part)),
            }
        };
        Some(Floor { modes, places: (0..count).map(place).collect(), heard: Vec::new() })
    }

    /// Holds the wall in the next step, or brakes it; adds its `d`. `next_u` is what arrives there at a node, before
    /// what friction takes over one reach.
    #[inline(always)]
    pub(crate) fn rub(&mut self, ways: &mut Ways, next_u: &impl Fn(usize) -> f64, momentum: &mut [f64]) {
        let (beta, by_stress) = (self.modes.beta, self.modes.per_stress());
        for (place, (down, up)) in self.places.iter().zip(ways.down.iter_mut().zip(ways.up.iter_mut().rev())) {
            let u = place.nodes.iter().map(|&(node, share)| share * (next_u(node) + momentum[node])).sum::<f64>();
            let free_m_s = place.by_u * u - place.steady_m_s - by_stress * (*down - *up);
            let sent = (free_m_s / place.by_sent).clamp(-place.most_m, place.most_m);
            *down += sent;
            *up -= sent;
            for &(node, share) in &place.nodes {
                momentum[node] -= share * beta * sent;
            }
        }
        let last = self.places.len().wrapping_sub(1);
        for [before, behind] in &mut self.heard {
            if let Some(heard) = before {
                heard.wave_m.push(ways.down[heard.place]);
            }
            if let Some(heard) = behind {
                heard.wave_m.push(ways.up[last - heard.place]);
            }
        }
    }

    /// Listens for so many steps before and behind each probe at a distance from the line's beginning; `None` is on
    /// another pipe.
    pub(crate) fn listen(&mut self, probes: impl Iterator<Item = Option<f64>>, steps: usize) {
        self.heard = probes.map(|x_m| x_m.map_or([None, None], |x_m| self.around(x_m, steps))).collect();
    }

    /// The waves that were heard before and behind a probe.
    pub(crate) fn heard(&self, probe: usize) -> [Option<&Heard>; 2] {
        self.heard[probe].each_ref().map(Option::as_ref)
    }

    /// The places before and behind a probe, with room for so many steps.
    fn around(&self, x_m: f64, steps: usize) -> [Option<Heard>; 2] {
        let before = self.places.iter().position(|place| place.x_m <= x_m);
        let behind = self.places.iter().rposition(|place| place.x_m >= x_m);
        [before, behind].map(|found| {
            let place = found?;
            // Nothing moves before the second step.
            let mut wave_m = Vec::with_capacity(steps + 2);
            wave_m.extend([0.0, 0.0]);
            Some(Heard { place, x_m: self.places[place].x_m, wave_m })
        })
    }
}
