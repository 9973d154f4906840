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
}

/// What is at a node.
#[derive(Debug, Clone, PartialEq)]
pub enum NodeKind {
    /// Pipes meet, and a constant flow may be drawn off.
    Junction {
        /// Flow drawn off, m³/s.
        demand_m3_s: f64,
    },
    /// What feeds the pipes, at a constant head unless an effect says otherwise.
    Reservoir {
        /// Its level against that of other reservoirs, m.
        head_m: Option<f64>,
    },
    /// The valve that closes; the rig has its data.
    Valve,
}

/// Nodes and lines.
#[derive(Debug, Clone, PartialEq)]
pub struct Graph {
    /// The nodes.
    pub nodes: Vec<Node>,
    /// The lines, in the order of their pipes.
    pub lines: Vec<Line>,
    /// Index of the node of the valve that closes.
    pub valve: usize,
    /// The lines on the way from the supply nearest to the valve, to the valve, and whether each is passed from its end to its beginning.
    pub way: Vec<(usize, bool)>,
}

impl Graph {
    /// Pipes in series from a supply to a valve.
    pub fn in_series(pipes: usize) -> Graph {
        let node = |name: &str, kind| Node { name: name.to_owned(), kind };
        Graph {
            nodes: vec![node("supply", NodeKind::Reservoir { head_m: None }), node("valve", NodeKind::Valve)],
            lines: vec![Line { from: 0, to: 1, pipes: 0..pipes }],
            valve: 1,
            way: vec![(0, false)],
        }
    }

    /// Whether a node holds a head of its own.
    pub fn holds_head(&self, node: usize) -> bool {
        matches!(self.nodes[node].kind, NodeKind::Reservoir { .. })
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

    /// Every line once, each after one that leads to it from the valve, and whether it is reached at its end.
    pub fn from_valve(&self) -> Vec<(usize, bool)> {
        let at_node = self.lines_at_nodes();
        let mut reached = vec![false; self.nodes.len()];
        let mut found: Vec<(usize, bool)> = Vec::with_capacity(self.lines.len());
        let mut done = vec![false; self.lines.len()];
        let mut open = std::collections::VecDeque::from([self.valve]);
        reached[self.valve] = true;
        while let Some(node) = open.pop_front() {
            for &k in &at_node[node] {
                if std::mem::replace(&mut done[k], true) {
                    continue;
                }
                let line = &self.lines[k];
                found.push((k, line.to == node));
                let other = line.from + line.to - node;
                if !std::mem::replace(&mut reached[other], true) {
                    open.push_back(other);
                }
            }
        }
        found
    }

    /// The lines that begin or end at each node.
    fn lines_at_nodes(&self) -> Vec<Vec<usize>> {
        let mut at_node = vec![Vec::new(); self.nodes.len()];
        for (k, line) in self.lines.iter().enumerate() {
            at_node[line.from].push(k);
            at_node[line.to].push(k);
        }
        at_node
    }

    /// The shortest distance of each node from one of them, and the line by which it is reached; infinite where no line leads. The lengths are those of
    /// the lines.
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
