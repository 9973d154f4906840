//! The stress waves of all pipes of a line, with its ends and the joints between them.

use std::iter::once;
use std::ops::Range;

use crate::model::error::ModelError;
use crate::model::grid::Grid;
use crate::model::steady::Steady;
use crate::model::trace::{Probe, Trace};
use crate::model::wall::end::{Hold, WallEnd};
use crate::model::wall::floor::Floor;
use crate::model::wall::joint::WallJoint;
use crate::model::wall::modes::{Modes, Wall};
use crate::model::wall::ways::{Mouth, Ways};
use crate::units::GRAVITY_M_S2;

/// Steps that stress waves must take through a pipe.
pub const LEAST_STEPS: f64 = 2.0;
/// The same on a floor, which needs a place where waves meet, and nodes about it.
pub const LEAST_STEPS_ON_FLOOR: f64 = 3.0;

/// The stress waves of pipes in series.
pub struct WallWaves {
    pipes: Vec<WallPipe>,
    ends: [WallEnd; 2],
    joints: Vec<WallJoint>,
    dt_s: f64,
}

/// Those of one pipe.
struct WallPipe {
    modes: Modes,
    segments: Range<usize>,
    start_m: f64,
    end_m: f64,
    ways: Ways,
    floor: Option<Floor>,
}

impl WallPipe {
    /// Of the pipe on these segments.
    fn new(wall: &Wall, segments: Range<usize>, steady: &Steady) -> Result<WallPipe, ModelError> {
        let (grid, dt_s) = (steady.grid, steady.grid.dt_s);
        let own = &grid.segments[segments.clone()];
        let modes = wall.modes(wall.length_m / (grid.steps(segments.clone()) * dt_s))?;
        let steps = wall.length_m / modes.stress_speed_m_s / dt_s;
        let least = if wall.floor_m > 0.0 { LEAST_STEPS_ON_FLOOR } else { LEAST_STEPS };
        let too_few = |times: f64| {
            let reaches = grid.steps(0..grid.segments.len());
            ModelError::TooFewReaches { reaches: reaches.round() as usize, needed: (times * reaches).ceil() as usize }
        };
        if steps.round() < least {
            return Err(too_few(least / steps));
        }
        let ways = Ways::new(steps);
        let lies = wall.floor_m > 0.0;
        let floor = || Floor::new(wall, modes, ways.down.len(), segments.clone(), steady).ok_or(too_few(2.0));
        let floor = lies.then(floor).transpose()?;
        let (start_m, end_m) = (own.first().map_or(0.0, |s| s.start_m), own.last().map_or(0.0, |s| s.end_m()));
        Ok(WallPipe { modes, segments, start_m, end_m, ways, floor })
    }

    /// Whether a place of the line is on this pipe, as the grid has it.
    fn has(&self, grid: &Grid, probe: &Probe) -> bool {
        self.segments.contains(&grid.stencil(probe.place()).segment)
    }

    /// Adds what the stress waves between its two mouths make of head or flow to the trace of a probe.
    fn show(&self, [start, end]: [&Mouth; 2], (n, probe): (usize, &Probe), dt_s: f64, shown: &mut Trace) {
        let Modes { beta, stress_speed_m_s, area_m2, .. } = self.modes;
        let trace = |values: &[f64]| Trace { dt_s, values: values.to_vec(), late_s: 0.0 };
        let x_m = probe.place().position_m;
        // Where waves were last heard on their way to the probe: at the ends, or where the floor changes them.
        let [before, behind] = self.floor.as_ref().map_or([None, None], |floor| floor.heard(n));
        let (from_m, from_start) =
            before.map_or((self.start_m, trace(&start.left_m)), |at| (at.x_m, trace(&at.wave_m)));
        let (to_m, from_end) = behind.map_or((self.end_m, trace(&end.left_m)), |at| (at.x_m, trace(&at.wave_m)));
        for (i, value) in shown.values.iter_mut().enumerate() {
            let t = i as f64 * dt_s;
            let (down_m, up_m) = if x_m <= self.start_m {
                (start.left_m[i], start.arrived_m[i])
            } else if x_m >= self.end_m {
                (end.arrived_m[i], end.left_m[i])
            } else {
                let since = |way_m: f64| t - way_m / stress_speed_m_s;
                (from_start.at(since(x_m - from_m)), from_end.at(since(to_m - x_m)))
            };
            *value += match probe {
                Probe::Head(_) => beta * (down_m + up_m),
                Probe::Flow(_) => area_m2 * beta * GRAVITY_M_S2 / stress_speed_m_s * (down_m - up_m),
            };
        }
    }
}

impl WallWaves {
    /// Of a line of pipes, one or more, in steady flow, with its nodes of the supply and of the valve and what holds the
    /// wall there.
    ///
    /// # Errors
    /// A stress wave no faster than a pressure wave; fewer than two steps for it to pass a pipe.
    pub fn new(walls: &[Wall], [supply, valve]: [(usize, Hold); 2], steady: &Steady) -> Result<WallWaves, ModelError> {
        let grid = steady.grid;
        let mut pipes = Vec::with_capacity(walls.len());
        let (mut first, mut end_m) = (0, 0.0);
        for wall in walls {
            end_m += wall.length_m;
            let behind = first + grid.segments[first..].partition_point(|s| 0.5 * (s.start_m + s.end_m()) < end_m);
            pipes.push(WallPipe::new(wall, first..behind, steady)?);
            first = behind;
        }
        let before = |s: usize| (steady.head_m[grid.segments[s].nodes().end - 1], steady.flow_m3_s[s]);
        let joints = pipes.windows(2).map(|pair| {
            let segment = pair[0].segments.end - 1;
            WallJoint::new(segment, [pair[0].modes, pair[1].modes], before(segment))
        });
        let joints = joints.collect();
        let end = |pipe: &WallPipe, (node, hold), at| WallEnd::new(pipe.modes, node, hold, at, grid.dt_s);
        let ends = [
            end(&pipes[0], supply, (steady.head_m[0], -steady.flow_m3_s[0])),
            end(&pipes[pipes.len() - 1], valve, before(grid.segments.len() - 1)),
        ];
        Ok(WallWaves { pipes, ends, joints, dt_s: grid.dt_s })
    }

    /// The end at a node of the graph.
    pub(crate) fn at(&mut self, node: usize) -> Option<&mut WallEnd> {
        self.ends.iter_mut().find(|end| end.node == node)
    }

    /// The joint of pipes behind a segment.
    pub(crate) fn behind(&mut self, segment: usize) -> Option<&mut WallJoint> {
        self.joints.iter_mut().find(|joint| joint.segment == segment)
    }

    /// Each pipe with its mouths, from the supply on.
    fn mouths(&mut self) -> impl Iterator<Item = (&mut WallPipe, [&mut Mouth; 2])> {
        let [supply, valve] = &mut self.ends;
        let joints = self.joints.iter_mut().flat_map(|joint| &mut joint.mouths);
        let mut mouths = once(&mut supply.mouth).chain(joints).chain(once(&mut valve.mouth));
        self.pipes.iter_mut().map_while(move |pipe| Some((pipe, [mouths.next()?, mouths.next()?])))
    }

    /// What left one end of a pipe in this step goes on towards the other.
    pub(crate) fn turn(&mut self) {
        for (pipe, [start, end]) in self.mouths() {
            pipe.ways.turn(start, end);
        }
    }

    /// Whether the pipes lie on a floor, so that what rubs there acts on the line.
    pub(crate) fn lies(&self) -> bool {
        self.pipes.iter().any(|pipe| pipe.floor.is_some())
    }

    /// The floor holds the wall in the next step, or brakes it; adds its `d`. `next_u` is what arrives there at a node,
    /// before what friction takes over one reach.
    #[inline(always)]
    pub(crate) fn rub(&mut self, next_u: impl Fn(usize) -> f64, momentum: &mut [f64]) {
        for pipe in &mut self.pipes {
            if let Some(floor) = &mut pipe.floor {
                floor.rub(&mut pipe.ways, &next_u, momentum);
            }
        }
    }

    /// Makes room for what is kept of so many steps for the probes, so that no step has to.
    pub(crate) fn reserve(&mut self, grid: &Grid, steps: usize, probes: &[Probe]) {
        for (pipe, mouths) in self.mouths() {
            mouths.into_iter().for_each(|mouth| mouth.reserve(steps));
            let places: Vec<Option<f64>> =
                probes.iter().map(|probe| pipe.has(grid, probe).then_some(probe.place().position_m)).collect();
            if let Some(floor) = &mut pipe.floor {
                floor.listen(places.into_iter(), steps);
            }
        }
    }

    /// Adds what the stress waves make of heads and flows to the traces of probes.
    pub(crate) fn show(mut self, grid: &Grid, probes: &[Probe], traces: &mut [Trace]) {
        let dt_s = self.dt_s;
        for (pipe, [start, end]) in self.mouths() {
            for (n, (probe, shown)) in probes.iter().zip(&mut *traces).enumerate() {
                if pipe.has(grid, probe) {
                    pipe.show([start, end], (n, probe), dt_s, shown);
                }
            }
        }
    }
}
