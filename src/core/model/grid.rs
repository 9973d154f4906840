//! The grid: nodes evenly spaced in *travel time*. One time step carries a wave over every reach of every pipe, and no
//! wave speed or length has to be adjusted to make pipes fit.
//!
//! A reach inside one pipe has `dx = a dt`. The one reach that straddles a joint becomes a segment of its own with the
//! inertance `Σ l/(gA)` and the capacitance `Σ gAl/a²` of its two parts. Their lengths are chosen so that this reach,
//! too, takes one step: `√(inertance capacitance) = dt`. Joint and reflection then move smoothly with wave speeds and
//! lengths, which a fit needs, and no inertia or storage is lost. Such a joint disperses fronts of a few steps, so the
//! number of reaches is chosen to put joints on nodes, or nearly so:
//! [`fitting_reaches`](crate::model::reaches::fitting_reaches).
//!
//! A single line gets the step with which its reaches are whole. Several lines share one step, so each begins with a
//! reach that takes longer: its wave passes an all-pass filter ([`Late`](crate::model::late::Late)) that delays it by
//! the rest of a step and takes nothing of it. The same holds for several runs of a line, where joints must lie on
//! nodes.

use std::ops::Range;

use crate::model::error::ModelError;
use crate::model::friction::WallFriction;
use crate::model::stencil::Stencil;
use crate::rig::{Graph, Place, Regime};
use crate::units::GRAVITY_M_S2;

/// Wave speeds with which the grid can be computed; those of real pipes are far inside.
const WAVE_SPEEDS_M_S: std::ops::RangeInclusive<f64> = 1e-6..=1e9;

/// A joint within this many reaches of a node counts as on it.
const ON_NODE: f64 = 1e-9;
/// A reach that is late by no more than this many steps is on time: rounding.
const LATE: f64 = 1e-6;

/// A length of pipe with constant properties.
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
    /// Regime of the flow before the closure.
    pub regime: Regime,
    /// Whether its wall creeps, in a model with creep.
    pub creeps: bool,
    /// Its run: stretches of one run share the reaches over their joints; where the next run begins, there is a node.
    pub run: usize,
}

impl Stretch {
    /// Cross-section, m².
    pub fn area_m2(&self) -> f64 {
        std::f64::consts::FRAC_PI_4 * self.diameter_m * self.diameter_m
    }

    /// Inertance per metre, `1/(gA)`.
    fn inertance(&self) -> f64 {
        1.0 / (GRAVITY_M_S2 * self.area_m2())
    }

    /// Capacitance per metre, `gA/a²`.
    fn capacitance(&self) -> f64 {
        GRAVITY_M_S2 * self.area_m2() / self.wave_speed_m_s.powi(2)
    }
}

/// Consecutive reaches with equal properties; the nodes are numbered from 0 at the supply side to `reaches`.
#[derive(Debug, Clone)]
pub struct Segment {
    /// Index of its first node in the state's slices.
    pub offset: usize,
    /// Number of reaches; it has one more node.
    pub reaches: usize,
    /// Position of its first node, m from the beginning of its line.
    pub start_m: f64,
    /// Length of one reach, m.
    pub reach_m: f64,
    /// Characteristic impedance `B = a/(gA)`, s/m².
    pub impedance: f64,
    /// The parts of one reach, with their lengths in m: one stretch, or those of a reach over a joint.
    pub parts: Vec<(Stretch, f64)>,
    /// The line that it is part of.
    pub line: usize,
    /// Steps that a wave takes for a reach beyond the first: none but in the reach that makes up a line's length.
    pub late: f64,
}

impl Segment {
    /// The segment's nodes in the state's slices.
    #[inline]
    pub fn nodes(&self) -> std::ops::Range<usize> {
        self.offset..self.offset + self.reaches + 1
    }

    /// Position of its last node, m from the beginning of its line.
    pub fn end_m(&self) -> f64 {
        self.start_m + self.reach_m * self.reaches as f64
    }

    /// Regime of the flow before the closure: that of the longest part.
    pub fn regime(&self) -> Regime {
        let longest = self.parts.iter().max_by(|a, b| a.1.total_cmp(&b.1));
        longest.map_or(Regime::Turbulent, |(stretch, _)| stretch.regime)
    }

    /// Head that wall friction takes over one reach, m.
    pub fn reach_loss_m(&self, flow_m3_s: f64) -> f64 {
        self.parts.iter().map(|(s, length)| s.friction.slope(s.diameter_m, flow_m3_s) * length).sum()
    }

    /// Mean over one reach of a property of its stretches, weighted by length.
    pub fn mean(&self, property: impl Fn(&Stretch) -> f64) -> f64 {
        self.parts.iter().map(|(s, length)| property(s) * length).sum::<f64>() / self.reach_m
    }
}

/// All lines.
#[derive(Debug, Clone)]
pub struct Grid {
    /// Time step, s.
    pub dt_s: f64,
    /// Segments, line after line, each from its beginning to its end.
    pub segments: Vec<Segment>,
    /// The segments of each line.
    pub lines: Vec<Range<usize>>,
}

impl Grid {
    /// Divides lines, each of stretches in series, into reaches of equal travel time: `reaches` of them on the `way`,
    /// lines by their indices.
    ///
    /// A stretch shorter than one reach is lumped with its neighbours in the reach that covers it: less sharp, but with
    /// all its inertance and capacitance. With [`least_reaches`](crate::model::reaches::least_reaches) or more, no
    /// stretch is lumped.
    ///
    /// # Errors
    /// If there are fewer than two reaches, a line is shorter than a reach, or a wave speed is out of range.
    pub fn new(lines: &[Vec<Stretch>], way: &[usize], reaches: usize) -> Result<Grid, ModelError> {
        if reaches < 2 {
            return Err(ModelError::TooFewReaches { reaches, needed: 2 });
        }
        if let Some(odd) = lines.iter().flatten().find(|s| !WAVE_SPEEDS_M_S.contains(&s.wave_speed_m_s)) {
            let (name, value) = ("wave_speed_m_s".to_owned(), odd.wave_speed_m_s);
            return Err(ModelError::Value { name, value, allowed: "1e-6 to 1e9 m/s" });
        }
        let runs = |line: &[Stretch]| line.chunk_by(|a, b| a.run == b.run).count();
        let single = lines.iter().map(|line| runs(line)).sum::<usize>() == 1;
        let dt_s = match lines {
            [line] if single => even_step(line, reaches),
            _ => way.iter().map(|&line| travel_s(&lines[line])).sum::<f64>() / reaches as f64,
        };
        let mut grid = Grid { dt_s, segments: Vec::new(), lines: Vec::new() };
        let mut offset = 0;
        for (line, stretches) in lines.iter().enumerate() {
            let first = grid.segments.len();
            let mut start_m = 0.0;
            for run in stretches.chunk_by(|a, b| a.run == b.run) {
                let own_s = travel_s(run);
                if own_s < dt_s * (1.0 - ON_NODE) {
                    let needed = (reaches as f64 * dt_s / own_s).ceil() as usize;
                    return Err(ModelError::TooFewReaches { reaches, needed });
                }
                for (parts, reaches) in laid(run, dt_s, !single) {
                    let parts: Vec<(Stretch, f64)> = parts.iter().map(|&(k, l)| (run[k].clone(), l)).collect();
                    let reach_m: f64 = parts.iter().map(|p| p.1).sum();
                    let inertance: f64 = parts.iter().map(|(s, l)| s.inertance() * l).sum();
                    let capacitance: f64 = parts.iter().map(|(s, l)| s.capacitance() * l).sum();
                    let impedance = (inertance / capacitance).sqrt();
                    let late = (inertance * capacitance).sqrt() / dt_s - 1.0;
                    let late = if late > LATE { late } else { 0.0 };
                    grid.segments.push(Segment { offset, reaches, start_m, reach_m, impedance, parts, line, late });
                    offset += reaches + 1;
                    start_m += reach_m * reaches as f64;
                }
            }
            grid.lines.push(first..grid.segments.len());
        }
        Ok(grid)
    }

    /// At each node of the graph, the segments that end there and those that begin there.
    pub fn ends_at(&self, graph: &Graph) -> Vec<[Vec<usize>; 2]> {
        let mut ends = vec![[Vec::new(), Vec::new()]; graph.nodes.len()];
        for (line, own) in graph.lines.iter().zip(&self.lines) {
            ends[line.to][0].push(own.end - 1);
            ends[line.from][1].push(own.start);
        }
        ends
    }

    /// The segments behind which another one of the same line follows.
    pub fn joints(&self) -> impl Iterator<Item = usize> {
        self.lines.iter().flat_map(|line| line.start..line.end - 1)
    }

    /// Steps that a pressure wave takes over these segments.
    pub fn steps(&self, segments: Range<usize>) -> f64 {
        self.segments[segments].iter().map(|s| s.reaches as f64 * (1.0 + s.late)).sum()
    }

    /// Total number of reaches.
    pub fn reaches(&self) -> usize {
        self.segments.iter().map(|s| s.reaches).sum()
    }

    /// The inner nodes around a place, counted in reaches over all lines, with weights that add up to 1: an element
    /// between nodes is shared among them.
    ///
    /// The weights are those of a quadratic B-spline: their centre is the position, and their spread is the same
    /// everywhere. Shares of two nodes would be sharp on a node and blurred in between, and a fit would get stuck at
    /// nodes. Near an end two nodes share, and at the end the first inner node has it all.
    pub fn around(&self, place: impl Into<Place>) -> Vec<(usize, f64)> {
        let (before, x, last) = self.inner(place.into());
        if x < 1.5 || x > last - 0.5 {
            return linear(before, x, last);
        }
        let node = x.round();
        let (d, node) = (x - node, before + node as usize);
        vec![(node - 1, 0.5 * (0.5 - d).powi(2)), (node, 0.75 - d * d), (node + 1, 0.5 * (0.5 + d).powi(2))]
    }

    /// The inner nodes around a place, counted in reaches over all lines, with weights that interpolate at it: cubic
    /// convolution (Keys 1981, IEEE Trans. Acoust. 29, 1153), smooth in the position and of third order. Near an end it
    /// is linear.
    pub fn interpolated(&self, place: impl Into<Place>) -> Vec<(usize, f64)> {
        let (before, x, last) = self.inner(place.into());
        if x < 2.0 || x >= last - 1.0 {
            return linear(before, x, last);
        }
        let (s, n) = (x.fract(), before + x as usize);
        let (s2, s3) = (s * s, s * s * s);
        vec![
            (n - 1, 0.5 * (-s + 2.0 * s2 - s3)),
            (n, 1.0 + 0.5 * (-5.0 * s2 + 3.0 * s3)),
            (n + 1, 0.5 * (s + 4.0 * s2 - 3.0 * s3)),
            (n + 2, 0.5 * (-s2 + s3)),
        ]
    }

    /// Reaches of the lines before that of a place; the place in reaches of its line, no nearer to an end than the
    /// inner nodes are; the last of these.
    fn inner(&self, Place { line, position_m }: Place) -> (usize, f64, f64) {
        let reaches = |segments: &[Segment]| segments.iter().map(|s| s.reaches).sum::<usize>();
        let own = &self.segments[self.lines[line].clone()];
        let mut before = 0;
        let mut x = 0.0;
        for segment in own {
            x = before as f64 + ((position_m - segment.start_m) / segment.reach_m).clamp(0.0, segment.reaches as f64);
            before += segment.reaches;
            if position_m <= segment.start_m + segment.reach_m * segment.reaches as f64 {
                break;
            }
        }
        let last = reaches(own).saturating_sub(1).max(1) as f64;
        (reaches(&self.segments[..self.lines[line].start]), x.clamp(1.0, last), last)
    }

    /// The same grid with its segments cut at inner nodes, counted in reaches over all lines.
    pub fn cut(self, nodes: &[usize]) -> Grid {
        let mut segments: Vec<Segment> = Vec::new();
        let mut lines: Vec<Range<usize>> = Vec::new();
        let (mut before, mut offset) = (0, 0);
        for segment in self.segments {
            let mut cuts: Vec<usize> =
                nodes.iter().filter(|&&n| n > before && n < before + segment.reaches).map(|n| n - before).collect();
            cuts.sort_unstable();
            cuts.dedup();
            cuts.push(segment.reaches);
            let mut from = 0;
            for to in cuts {
                let start_m = segment.start_m + segment.reach_m * from as f64;
                segments.push(Segment { offset, reaches: to - from, start_m, ..segment.clone() });
                offset += to - from + 1;
                from = to;
            }
            before += segment.reaches;
            if lines.len() == segment.line {
                lines.push(lines.last().map_or(0, |line| line.end)..0);
            }
            lines[segment.line].end = segments.len();
        }
        Grid { segments, lines, ..self }
    }

    /// The nodes of neighbouring segments that are `alike`, together: the first of these segments, and the nodes.
    pub fn together(&self, alike: impl Fn(usize, usize) -> bool) -> Vec<(usize, Range<usize>)> {
        let mut together: Vec<(usize, Range<usize>)> = Vec::new();
        for (s, segment) in self.segments.iter().enumerate() {
            match together.last_mut() {
                Some((first, nodes)) if alike(*first, s) => nodes.end = segment.nodes().end,
                _ => together.push((s, segment.nodes())),
            }
        }
        together
    }

    /// Number of nodes over all segments (a node between two segments counts in both).
    pub fn nodes(&self) -> usize {
        self.segments.last().map_or(0, |s| s.offset + s.reaches + 1)
    }

    /// The nodes around a place, for a cubic between two of them.
    pub fn stencil(&self, place: impl Into<Place>) -> Stencil {
        let Place { line, position_m } = place.into();
        let own = self.lines[line].clone();
        let ends_behind = |s: &Segment| position_m <= s.start_m + s.reach_m * s.reaches as f64;
        let within = self.segments[own.clone()].iter().position(ends_behind);
        let segment = within.map_or(own.end - 1, |i| own.start + i);
        let Segment { offset, reaches, start_m, reach_m, .. } = self.segments[segment];
        let x = ((position_m - start_m) / reach_m).clamp(0.0, reaches as f64);
        let nearest = x.round();
        let (before, part) = if (x - nearest).abs() < 1e-9 { (nearest as usize, 0.0) } else { (x as usize, x.fract()) };
        let behind = if part > 0.0 { before + 1 } else { before };
        let node = |n: usize| (n <= reaches).then_some(offset + n);
        Stencil {
            segment,
            around: [offset + before, offset + behind],
            further: [before.checked_sub(1).and_then(node), node(behind + 1)],
            part,
        }
    }
}

/// Travel time of a wave through stretches in series, s.
fn travel_s(stretches: &[Stretch]) -> f64 {
    stretches.iter().map(|s| s.length_m / s.wave_speed_m_s).sum()
}

/// The step with which a line has just so many reaches.
fn even_step(stretches: &[Stretch], reaches: usize) -> f64 {
    let total_s = travel_s(stretches);
    let joints = stretches.len() - 1;
    // A longer step makes fewer reaches; every joint costs less than one reach more than travel time alone.
    let (mut low, mut high) = (total_s / reaches as f64, total_s / reaches.saturating_sub(joints).max(1) as f64);
    if joints == 0 {
        return low;
    }
    while lay(stretches, high, |_, _| {}).0 > reaches as f64 {
        high *= 2.0;
    }
    while high - low > 1e-14 * low {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            break;
        }
        if lay(stretches, middle, |_, _| {}).0 > reaches as f64 {
            low = middle;
        } else {
            high = middle;
        }
    }
    high
}

/// The reaches of a line: their parts (stretch and length, m) and how many there are of each. With `rest` the first
/// takes up what is left of the line's length beside whole reaches, half a step to one and a half more than its own; a
/// line of one reach alone may be late by less.
fn laid(stretches: &[Stretch], dt_s: f64, rest: bool) -> Vec<(Vec<(usize, f64)>, usize)> {
    let mut laid: Vec<(Vec<(usize, f64)>, usize)> = Vec::new();
    if !rest {
        lay(stretches, dt_s, |parts, reaches| laid.push((parts.to_vec(), reaches)));
        return laid;
    }
    let reversed: Vec<Stretch> = stretches.iter().rev().cloned().collect();
    let (_, mut open) = lay(&reversed, dt_s, |parts, reaches| laid.push((parts.to_vec(), reaches)));
    let steps = |open: &[(usize, f64)]| {
        let sum = |of: fn(&Stretch) -> f64| open.iter().map(|&(k, l)| of(&reversed[k]) * l).sum::<f64>();
        (sum(Stretch::inertance) * sum(Stretch::capacitance)).sqrt() / dt_s
    };
    while !open.is_empty()
        && steps(&open) < 1.5
        && let Some((parts, reaches)) = laid.last_mut()
    {
        open.splice(0..0, parts.iter().copied());
        *reaches -= 1;
        if *reaches == 0 {
            laid.pop();
        }
    }
    laid.extend((!open.is_empty()).then_some((open, 1)));
    laid.reverse();
    for (parts, _) in &mut laid {
        parts.reverse();
        parts.iter_mut().for_each(|part| part.0 = stretches.len() - 1 - part.0);
    }
    laid
}

/// Two inner nodes around `x`, in reaches of a line with `before` before it, with the weights of linear interpolation;
/// `last` is its last inner node.
fn linear(before: usize, x: f64, last: f64) -> Vec<(usize, f64)> {
    let node = x.floor().min((last - 1.0).max(1.0));
    let (share, node) = (x - node, before + node as usize);
    vec![(node, 1.0 - share), (node + 1, share)]
}

/// Lays reaches of one step's travel time along the stretches from the supply: passes `push` the parts of a reach
/// (stretch and length, m) and its number of repetitions. Returns the number of reaches, the last one as a fraction,
/// and the parts of that.
///
/// A reach over one or several joints takes from the last stretch it touches the length `x` that makes it take one
/// step:
/// `(I + ix)(C + cx) = dt²` with the inertance `I` and capacitance `C` of what it has already.
fn lay(stretches: &[Stretch], dt_s: f64, mut push: impl FnMut(&[(usize, f64)], usize)) -> (f64, Vec<(usize, f64)>) {
    let mut laid = 0;
    let mut open: Vec<(usize, f64)> = Vec::new();
    let (mut inertance, mut capacitance) = (0.0, 0.0);
    for (k, stretch) in stretches.iter().enumerate() {
        let mut left = stretch.length_m;
        let reach_m = stretch.wave_speed_m_s * dt_s;
        let (i, c) = (stretch.inertance(), stretch.capacitance());
        if !open.is_empty() {
            // i c = 1/a²: x² + b x = room in units of a dt.
            let b = reach_m / (dt_s * dt_s) * (inertance * c + capacitance * i);
            let room = (1.0 - inertance * capacitance / (dt_s * dt_s)).max(0.0);
            let x = 2.0 * room / (b + (b * b + 4.0 * room).sqrt()) * reach_m;
            let taken = x.min(left);
            open.push((k, taken));
            if x > left + ON_NODE * reach_m {
                inertance += i * taken;
                capacitance += c * taken;
                continue;
            }
            push(&open, 1);
            laid += 1;
            left -= taken;
            open.clear();
        }
        let whole = (left / reach_m + ON_NODE).floor().max(0.0);
        if whole > 0.0 {
            push(&[(k, reach_m)], whole as usize);
            laid += whole as usize;
            left -= whole * reach_m;
        }
        if left > ON_NODE * reach_m {
            open.push((k, left));
            (inertance, capacitance) = (i * left, c * left);
        } else {
            (inertance, capacitance) = (0.0, 0.0);
        }
    }
    (laid as f64 + (inertance * capacitance).sqrt() / dt_s, open)
}

#[cfg(test)]
impl Stretch {
    /// For tests: a pipe of 50 mm with a constant friction factor.
    pub(crate) fn plain(length_m: f64, wave_speed_m_s: f64) -> Stretch {
        Stretch {
            length_m,
            diameter_m: 0.05,
            wall_m: 0.005,
            wave_speed_m_s,
            constraint: 1.0,
            friction: WallFriction::constant(0.02),
            regime: Regime::Turbulent,
            creeps: true,
            run: 0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(stretches: &[Stretch], reaches: usize) -> Result<Grid, ModelError> {
        Grid::new(&[stretches.to_vec()], &[0], reaches)
    }

    #[test]
    fn length_inertance_and_capacitance_are_exact_whatever_the_joint() {
        for (l1, a1, l2, a2) in [(60.0, 1200.0, 40.0, 400.0), (10.0, 1000.0, 90.3, 350.0), (33.3, 500.0, 66.7, 500.0)] {
            for reaches in [41, 42, 120] {
                let grid = line(&[Stretch::plain(l1, a1), Stretch::plain(l2, a2)], reaches).unwrap();
                let sum = |f: &dyn Fn(&Segment) -> f64| grid.segments.iter().map(f).sum::<f64>();
                assert!((sum(&|s| s.reach_m * s.reaches as f64) - l1 - l2).abs() < 1e-8);
                assert_eq!(grid.segments.iter().map(|s| s.reaches).sum::<usize>(), reaches);
                // As the scheme sees them: B dt and dt/B a reach.
                let inertance = sum(&|s| s.impedance * grid.dt_s * s.reaches as f64);
                let capacitance = sum(&|s| grid.dt_s / s.impedance * s.reaches as f64);
                let area = Stretch::plain(1.0, 1.0).area_m2();
                assert!((inertance * GRAVITY_M_S2 * area / (l1 + l2) - 1.0).abs() < 1e-9);
                let exact = GRAVITY_M_S2 * area * (l1 / (a1 * a1) + l2 / (a2 * a2));
                assert!((capacitance / exact - 1.0).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn a_joint_on_a_node_leaves_no_mixed_reach() {
        let grid = line(&[Stretch::plain(50.0, 500.0), Stretch::plain(100.0, 1000.0)], 20).unwrap();
        assert_eq!(grid.segments.len(), 2);
        assert!(grid.segments.iter().all(|s| s.parts.len() == 1 && s.reaches == 10));
    }

    #[test]
    fn a_place_between_nodes_is_shared_and_cuts_keep_the_line() {
        let grid = line(&[Stretch::plain(50.0, 500.0), Stretch::plain(100.0, 1000.0)], 20).unwrap();
        for position in [5.0, 6.0, 7.49, 7.51, 12.5, 17.4, 40.0, 49.9, 50.0, 63.0, 137.0, 140.0] {
            let shares = grid.around(position);
            let reaches = if position <= 50.0 { position / 5.0 } else { 5.0 + position / 10.0 };
            assert!((shares.iter().map(|s| s.1).sum::<f64>() - 1.0).abs() < 1e-12, "{position}");
            let centre: f64 = shares.iter().map(|s| s.0 as f64 * s.1).sum();
            assert!((centre - reaches).abs() < 1e-9, "{position}: {centre}");
            let nearby = grid.around(position + 1e-7);
            let share = |all: &[(usize, f64)], n: usize| all.iter().filter(|s| s.0 == n).map(|s| s.1).sum::<f64>();
            assert!((0..=20).all(|n| (share(&shares, n) - share(&nearby, n)).abs() < 1e-6), "{position}");
        }
        assert_eq!(grid.around(0.0)[0], (1, 1.0));
        assert_eq!(grid.around(150.0)[1], (19, 1.0));
        let (length, nodes) = (grid.segments.iter().map(|s| s.reach_m * s.reaches as f64).sum::<f64>(), grid.nodes());
        let cut = grid.cut(&[3, 2, 12, 3, 10]);
        assert_eq!(cut.segments.iter().map(|s| s.reaches).collect::<Vec<_>>(), [2, 1, 7, 2, 8]);
        assert_eq!(cut.nodes(), nodes + 3);
        assert!((cut.segments.iter().map(|s| s.reach_m * s.reaches as f64).sum::<f64>() - length).abs() < 1e-9);
        assert!(
            cut.segments
                .windows(2)
                .all(|w| (w[0].start_m + w[0].reach_m * w[0].reaches as f64 - w[1].start_m).abs() < 1e-9)
        );
    }

    /// A parabola that rises all along the line, at nodes 4 m apart.
    #[test]
    fn the_stencil_reproduces_a_parabola_up_to_the_ends() {
        let grid = line(&[Stretch::plain(100.0, 1000.0)], 25).unwrap();
        let f = |x: f64| 1.0 + 0.3 * x + 0.02 * x * x;
        for position in [0.0, 1.3, 4.0, 51.7, 98.9, 100.0] {
            let value = grid.stencil(position).read(|node| f(4.0 * node as f64));
            assert!((value - f(position)).abs() < 1e-9, "{position}: {value}");
        }
    }

    /// A stretch that no reach resolves is lumped, and everything moves smoothly with its length and place.
    #[test]
    fn a_stretch_shorter_than_a_reach_loses_nothing_and_moves_smoothly() {
        let grid = |from: f64, length: f64| {
            let stretches = [
                Stretch::plain(from, 1000.0),
                Stretch::plain(length, 400.0),
                Stretch::plain(100.0 - from - length, 1000.0),
            ];
            let grid = line(&stretches, 20).unwrap();
            let sum = |f: &dyn Fn(&Segment) -> f64| grid.segments.iter().map(f).sum::<f64>();
            assert_eq!(grid.reaches(), 20);
            assert!((sum(&|s| s.reach_m * s.reaches as f64) - 100.0).abs() < 1e-6, "{from} {length}");
            let area = stretches[0].area_m2();
            let capacitance = sum(&|s| grid.dt_s / s.impedance * s.reaches as f64);
            let exact =
                GRAVITY_M_S2 * area * stretches.iter().map(|s| s.length_m / s.wave_speed_m_s.powi(2)).sum::<f64>();
            assert!((capacitance / exact - 1.0).abs() < 1e-8, "{from} {length}");
            grid
        };
        let node = |g: &Grid, n: usize| {
            let mut before = 0;
            for s in &g.segments {
                if n <= before + s.reaches {
                    return s.start_m + s.reach_m * (n - before) as f64;
                }
                before += s.reaches;
            }
            f64::NAN
        };
        for length in [1e-9, 0.01, 0.7, 1.99, 2.0, 2.01, 9.0] {
            for step in 0..400 {
                let from = 40.0 + 0.05 * f64::from(step);
                let (a, b) = (grid(from, length), grid(from + 1e-4, length + 1e-4));
                for n in 0..=20 {
                    assert!((node(&a, n) - node(&b, n)).abs() < 2e-3, "{from} {length} {n}");
                }
            }
        }
        // At the line's very ends, too.
        grid(0.01, 0.5);
        grid(98.5, 1.49);
    }

    #[test]
    fn too_few_reaches_are_refused() {
        let error = line(&[Stretch::plain(1.0, 1.0), Stretch::plain(1.0, 1.0)], 1).unwrap_err();
        assert!(error.to_string().contains("at least 2"), "{error}");
    }
}
