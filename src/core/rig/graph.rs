//! How the pipes of a rig are joined: nodes, and lines of pipes between them.
//!
//! A rig in series is one line from the supply to the valve. In a network each `[[pipe]]` is a line of its own.

use std::collections::BinaryHeap;
use std::ops::Range;

/// A place on the pipes: a line, and the distance from where it begins.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// Index of the line.
    pub line: usize,
    /// Distance along it, m.
    pub position_m: f64,
}

/// On the first line: the only one of a rig in series.
impl From<f64> for Place {
    fn from(position_m: f64) -> Place {
        Place { line: 0, position_m }
    }
}

/// Pipes in series from one node to another.
#[derive(Debug, Clone, PartialEq)]
pub struct Line {
    /// Index of the node where it begins.
    pub from: usize,
    /// Index of the node where it ends.
    pub to: usize,
    /// Its pipes, by their index in the rig's list.
    pub pipes: Range<usize>,
}

/// Where lines meet or end.
#[derive(Debug, Clone, PartialEq)]
pub struct Node {
    /// Its name.
    pub name: String,
    /// What is there.
    pub kind: NodeKind,
    /// Where it is drawn, in any unit to the right and up; none where a drawing may choose.
    pub at: Option<[f64; 2]>,
}

/// What is at a node.
#[derive(Debug, Clone, PartialEq)]
pub enum NodeKind {
    /// Pipes meet, or one ends; a constant flow may be drawn off, and water may leave by an opening: a leak, a burst, a
    /// demand that follows the pressure.
    Junction {
        /// Flow drawn off, m³/s.
        demand_m3_s: f64,
        /// An opening to the outside.
        outlet: Option<Opening>,
    },
    /// What feeds the pipes, at a constant head unless an effect says otherwise.
    Reservoir {
        /// Its level, m; none where the rig has no other level to compare with.
        head_m: Option<f64>,
    },
    /// An open tank, whose level changes with what flows into it.
    Tank {
        /// Its level before the closure, m.
        head_m: f64,
        /// Area of its surface, m².
        area_m2: f64,
    },
    /// The valve that closes first; the rig has its data.
    Valve,
    /// Another valve.
    Opening(Opening),
    /// A valve that lets no water back.
    CheckValve,
    /// A pump. It lets no water back.
    Pump(Pump),
}

/// A valve with an opening of its own: an orifice `Q = opening · CdA · √(2g ΔH)`.
#[derive(Debug, Clone, PartialEq)]
pub struct Opening {
    /// Its area times its discharge coefficient where it is open, m².
    pub cda_m2: f64,
    /// Times after the start of the closure, s, and its relative opening: linear between them, constant beyond.
    pub opening: Vec<(f64, f64)>,
    /// Head behind it, m; none where a pipe follows.
    pub discharge_head_m: Option<f64>,
    /// How it closes, in place of a table of openings.
    pub closing: Option<Closing>,
}

/// How a valve of known area closes.
#[derive(Debug, Clone, PartialEq)]
pub struct Closing {
    /// When it starts, s after the first valve does.
    pub start_s: f64,
    /// Nominal closing time, s.
    pub time_s: f64,
    /// Standard deviation of the closing time as a share of it, where the file gives one; 0: it is exact.
    pub time_tolerance: Option<f64>,
    /// See [`Valve::characteristic`](crate::rig::Valve::characteristic).
    pub characteristic: Vec<(f64, f64)>,
}

/// A pump at its speed before the closure.
#[derive(Debug, Clone, PartialEq)]
pub struct Pump {
    /// Its curve.
    pub curve: PumpCurve,
    /// Level of the water that it takes, m; none where a pipe leads to it.
    pub suction_head_m: Option<f64>,
    /// How its speed changes.
    pub drive: Drive,
}

/// Head of a pump at its speed before the closure: `H = shutoff - fall · Q^power`, not below the least.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PumpCurve {
    /// Head without flow, m.
    pub shutoff_m: f64,
    /// Its fall, m per (m³/s)^power.
    pub fall: f64,
    /// Power of the flow.
    pub power: f64,
    /// Least head, m: 0 where a bypass with a check valve lets water past, else -∞.
    pub least_m: f64,
}

/// What drives a pump.
#[derive(Debug, Clone, PartialEq)]
pub enum Drive {
    /// Times after the start of the closure, s, and its relative speed: linear between them, constant beyond.
    Speed(Vec<(f64, f64)>),
    /// Its motor loses power, and it runs down against the water's torque.
    Trip {
        /// When, s after the start of the closure.
        at_s: f64,
        /// Moment of inertia of all that turns, kg m².
        inertia_kg_m2: f64,
        /// Speed before, rad/s.
        speed_rad_s: f64,
        /// Efficiency, a share.
        efficiency: f64,
    },
}

impl PumpCurve {
    /// Through one point `(m³/s, m)`, with the shutoff head and the greatest flow that EPANET gives it, or through
    /// three, the first without flow.
    pub fn through(points: &[(f64, f64)]) -> Option<PumpCurve> {
        let least_m = f64::NEG_INFINITY;
        let curve = match *points {
            [(q, h)] => PumpCurve { shutoff_m: 4.0 / 3.0 * h, fall: h / 3.0 / (q * q), power: 2.0, least_m },
            [(0.0, h0), (q1, h1), (q2, h2)] if h0 > h1 && h1 > h2 && q2 > q1 => {
                let power = ((h0 - h2) / (h0 - h1)).ln() / (q2 / q1).ln();
                PumpCurve { shutoff_m: h0, fall: (h0 - h1) / q1.powf(power), power, least_m }
            }
            _ => return None,
        };
        let numbers = [curve.shutoff_m, curve.fall, curve.power];
        (numbers.iter().all(|n| n.is_finite() && *n > 0.0) && curve.power <= 20.0).then_some(curve)
    }
}

/// A value between points of time, constant beyond them.
pub fn at_time(points: &[(f64, f64)], time_s: f64) -> f64 {
    let next = points.partition_point(|p| p.0 <= time_s);
    match (next.checked_sub(1).map(|i| points[i]), points.get(next)) {
        (Some((t0, v0)), Some(&(t1, v1))) => v0 + (v1 - v0) * (time_s - t0) / (t1 - t0),
        (Some((_, v)), None) | (None, Some(&(_, v))) => v,
        (None, None) => 0.0,
    }
}

impl NodeKind {
    /// Its name in a rig file; a dead end is a junction of one line.
    pub fn name(&self) -> &'static str {
        match self {
            NodeKind::Junction { .. } => "junction",
            NodeKind::Reservoir { .. } => "reservoir",
            NodeKind::Tank { .. } => "tank",
            NodeKind::Valve | NodeKind::Opening(_) => "valve",
            NodeKind::CheckValve => "check-valve",
            NodeKind::Pump(_) => "pump",
        }
    }

    /// Whether water passes it in one direction from the lines that end there to those that begin there, which then
    /// have heads of their own.
    pub fn is_passed(&self) -> bool {
        matches!(self, NodeKind::Valve | NodeKind::Opening(_) | NodeKind::CheckValve | NodeKind::Pump(_))
    }

    /// The opening by which water leaves or passes it, apart from the valve that closes.
    pub fn opening(&self) -> Option<&Opening> {
        match self {
            NodeKind::Opening(opening) => Some(opening),
            NodeKind::Junction { outlet, .. } => outlet.as_ref(),
            _ => None,
        }
    }

    /// Constant flow drawn off there, m³/s.
    pub fn demand_m3_s(&self) -> f64 {
        if let NodeKind::Junction { demand_m3_s, .. } = self { *demand_m3_s } else { 0.0 }
    }

    /// Whether it holds a head that an effect may change in time.
    pub fn holds_given_head(&self) -> bool {
        matches!(self, NodeKind::Reservoir { .. })
    }

    /// Whether water comes from it.
    pub fn feeds(&self) -> bool {
        match self {
            NodeKind::Reservoir { .. } | NodeKind::Tank { .. } => true,
            NodeKind::Pump(pump) => pump.suction_head_m.is_some(),
            _ => false,
        }
    }
}

/// Nodes and lines.
#[derive(Debug, Clone, PartialEq)]
pub struct Graph {
    /// The nodes.
    pub nodes: Vec<Node>,
    /// The lines, in the order of their pipes.
    pub lines: Vec<Line>,
    /// Index of the node of the valve that closes first.
    pub valve: usize,
    /// The lines on the way from the supply nearest to the valve, to the valve, and whether each is passed from its end
    /// to its beginning.
    pub way: Vec<(usize, bool)>,
}

impl Graph {
    /// Pipes in series from a supply to a valve.
    pub fn in_series(pipes: usize) -> Graph {
        let node = |name: &str, kind| Node { name: name.to_owned(), kind, at: None };
        Graph {
            nodes: vec![node("supply", NodeKind::Reservoir { head_m: None }), node("valve", NodeKind::Valve)],
            lines: vec![Line { from: 0, to: 1, pipes: 0..pipes }],
            valve: 1,
            way: vec![(0, false)],
        }
    }

    /// Whether a node holds a head of its own.
    pub fn holds_head(&self, node: usize) -> bool {
        matches!(self.nodes[node].kind, NodeKind::Reservoir { .. } | NodeKind::Tank { .. })
    }

    /// The other valves that close, by their nodes: name, opening, and how each closes.
    pub fn others_that_close(&self) -> impl Iterator<Item = (usize, &str, &Opening, &Closing)> {
        self.nodes.iter().enumerate().filter_map(|(n, node)| match &node.kind {
            NodeKind::Opening(opening) => Some((n, node.name.as_str(), opening, opening.closing.as_ref()?)),
            _ => None,
        })
    }

    /// Names of the valves that close, the first one first.
    pub fn closing_valves(&self) -> Vec<&str> {
        let first = self.nodes[self.valve].name.as_str();
        std::iter::once(first).chain(self.others_that_close().map(|(_, name, ..)| name)).collect()
    }

    /// The line that ends at the valve.
    pub fn line_to_valve(&self) -> usize {
        self.lines.iter().position(|line| line.to == self.valve).unwrap_or(0)
    }

    /// The node that feeds the pipes, nearest to the valve.
    pub fn supply(&self) -> usize {
        match self.way.first() {
            Some(&(line, true)) => self.lines[line].to,
            Some(&(line, false)) => self.lines[line].from,
            None => self.valve,
        }
    }

    /// A graph, with its way: from the reservoir nearest to the valve, or if there is none from the nearest tank or
    /// pump.
    pub fn new(nodes: Vec<Node>, lines: Vec<Line>, lengths_m: &[f64], valve: usize) -> Graph {
        let mut graph = Graph { nodes, lines, valve, way: Vec::new() };
        let found = graph.distances(valve, lengths_m);
        let rank = |&n: &usize| (!graph.nodes[n].kind.holds_given_head(), found[n].0);
        let feeding = (0..graph.nodes.len()).filter(|&n| graph.nodes[n].kind.feeds() && n != valve);
        let nearest = feeding.min_by(|a, b| rank(a).0.cmp(&rank(b).0).then(rank(a).1.total_cmp(&rank(b).1)));
        let mut at = nearest.unwrap_or(valve);
        let mut way = Vec::new();
        while let Some(k) = found[at].1 {
            let line = &graph.lines[k];
            way.push((k, line.to == at));
            at = line.from + line.to - at;
        }
        graph.way = way;
        graph
    }

    /// The lines that begin or end at each node.
    pub fn lines_at_nodes(&self) -> Vec<Vec<usize>> {
        let mut at_node = vec![Vec::new(); self.nodes.len()];
        for (k, line) in self.lines.iter().enumerate() {
            at_node[line.from].push(k);
            at_node[line.to].push(k);
        }
        at_node
    }

    /// The shortest distance of each node from one of them, and the line by which it is reached; infinite where no line
    /// leads. The lengths are those of the lines.
    pub fn distances(&self, from: usize, lengths_m: &[f64]) -> Vec<(f64, Option<usize>)> {
        let mut found = vec![(f64::INFINITY, None); self.nodes.len()];
        let at_node = self.lines_at_nodes();
        // Lengths are positive, so that their bits are ordered as they are.
        let mut open = BinaryHeap::from([(std::cmp::Reverse(0u64), from, None)]);
        while let Some((std::cmp::Reverse(bits), node, by)) = open.pop() {
            let distance_m = f64::from_bits(bits);
            if distance_m >= found[node].0 {
                continue;
            }
            found[node] = (distance_m, by);
            for &k in &at_node[node] {
                let other = self.lines[k].from + self.lines[k].to - node;
                let further_m = distance_m + lengths_m[k];
                if further_m < found[other].0 {
                    open.push((std::cmp::Reverse(further_m.to_bits()), other, Some(k)));
                }
            }
        }
        found
    }
}
