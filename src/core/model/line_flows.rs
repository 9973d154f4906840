//! A rig's lines and what its nodes let pass, as links between heads; and the flow in every line before the closure,
//! from the pipes alone: it decides each pipe's law of friction before there is a grid.

use crate::model::error::ModelError;
use crate::model::friction::WallFriction;
use crate::model::network::{Drawn, Network};
use crate::model::passage::steady_loss;
use crate::rig::{Graph, NodeKind, Pipe, Regime, Rig, WaterProperties, at_time};

/// Reynolds numbers between which a flow goes over from one law to the other: with a jump, a loop might have no
/// solution.
const TRANSITION: std::ops::Range<f64> = 2000.0..4000.0;
/// Velocity from which the iteration starts, m/s.
const USUAL_M_S: f64 = 0.3;

/// Links between heads. The first heads are those of the graph's nodes, before what is there; then come those behind
/// nodes that are passed.
pub(crate) struct System<'a> {
    pub graph: &'a Graph,
    /// Links, the lines and then the nodes that are passed, and the heads that are held, as the rig file has them.
    pub network: Network,
    /// The node that each link after the lines is.
    pub passed: Vec<usize>,
    /// The head behind each node that is passed.
    pub behind: Vec<Option<usize>>,
    /// Flow drawn at each head, m³/s.
    pub drawn_m3_s: Vec<f64>,
    /// A flow of the size that is usual in each link, m³/s.
    pub usual_m3_s: Vec<f64>,
}

impl<'a> System<'a> {
    /// Of a rig while its valve passes `valve_m3_s`.
    pub(crate) fn new(rig: &'a Rig, valve_m3_s: f64) -> System<'a> {
        let graph = &rig.graph;
        let count = graph.nodes.len();
        let mut begins = vec![false; count];
        graph.lines.iter().for_each(|line| begins[line.from] = true);
        let mut held_m = vec![None; count];
        let mut drawn_m3_s: Vec<f64> = graph.nodes.iter().map(|node| node.kind.demand_m3_s()).collect();
        let (mut behind, mut passed) = (vec![None; count], Vec::new());
        for (n, node) in graph.nodes.iter().enumerate() {
            if node.kind.opening().is_some() || (node.kind.is_passed() && begins[n]) {
                behind[n] = Some(held_m.len());
                held_m.push(None);
                drawn_m3_s.push(0.0);
            }
            match &node.kind {
                NodeKind::Reservoir { head_m } => held_m[n] = Some(head_m.unwrap_or(0.0)),
                NodeKind::Tank { head_m, .. } => held_m[n] = Some(*head_m),
                NodeKind::Valve => {
                    drawn_m3_s[n] = valve_m3_s;
                    behind[n].iter().for_each(|&b| drawn_m3_s[b] = -valve_m3_s);
                }
                NodeKind::Junction { .. } | NodeKind::Opening(_) => {}
                NodeKind::CheckValve => passed.push(n),
                NodeKind::Pump(pump) => {
                    held_m[n] = pump.suction_head_m;
                    passed.push(n);
                }
            }
            if let Some(opening) = node.kind.opening() {
                behind[n].iter().for_each(|&b| held_m[b] = opening.discharge_head_m);
                passed.extend((at_time(&opening.opening, 0.0) > 0.0).then_some(n));
            }
        }
        let start = |n: usize| behind[n].filter(|_| graph.nodes[n].kind.is_passed()).unwrap_or(n);
        let line = |line: &crate::rig::Line| (start(line.from), line.to);
        let mut links: Vec<(usize, usize)> = graph.lines.iter().map(line).collect();
        links.extend(passed.iter().filter_map(|&n| Some((n, behind[n]?))));
        let mut near_m2 = vec![0.0; count];
        for (k, line) in graph.lines.iter().enumerate() {
            (near_m2[line.from], near_m2[line.to]) = (rig.pipes_of(k)[0].area_m2(), rig.pipes_of(k)[0].area_m2());
        }
        let of_lines = (0..graph.lines.len()).map(|k| USUAL_M_S * rig.pipes_of(k)[0].area_m2());
        let usual_m3_s = of_lines.chain(passed.iter().map(|&n| USUAL_M_S * near_m2[n])).collect();
        let network = Network::new(links, held_m);
        System { graph, network, passed, behind, drawn_m3_s, usual_m3_s }
    }

    /// Flow at the end of each link, from the flow drawn along each line, flows from which the iteration starts, and
    /// the head that a line takes.
    ///
    /// # Errors
    /// [`ModelError::NoSteadyFlow`].
    pub(crate) fn flows(
        &self,
        taken_m3_s: &[f64],
        start_m3_s: &[f64],
        line_loss: impl Fn(usize, f64) -> (f64, f64),
    ) -> Result<Vec<f64>, ModelError> {
        let lines = self.graph.lines.len();
        let drawn =
            Drawn { nodes_m3_s: &self.drawn_m3_s, links_m3_s: taken_m3_s, usual_m3_s: &self.usual_m3_s, start_m3_s };
        self.network.flows(&drawn, |k, q| if k < lines { line_loss(k, q) } else { self.loss(k, q) })
    }

    /// Flow in every link, the lines first, m³/s, from the pipes' friction alone, which `scale` multiplies.
    ///
    /// # Errors
    /// [`ModelError::NoSteadyFlow`].
    pub(crate) fn link_flows(&self, rig: &Rig, water: &WaterProperties, scale: f64) -> Result<Vec<f64>, ModelError> {
        self.flows(&vec![0.0; self.network.links.len()], &self.usual_m3_s, |k, q| {
            let loss = |q: f64| rig.pipes_of(k).iter().map(|p| loss_m(p, water, q)).sum::<f64>() * scale;
            let (here, step) = (loss(q), 1e-6 * q.abs().max(1e-6 * self.usual_m3_s[k]));
            (here, (loss(q + step) - here) / step)
        })
    }

    /// Head that a link after the lines takes, m, and its slope.
    pub(crate) fn loss(&self, link: usize, flow_m3_s: f64) -> (f64, f64) {
        steady_loss(&self.graph.nodes[self.passed[link - self.graph.lines.len()]].kind, flow_m3_s)
    }
}

/// Flow in every line from its beginning to its end while the valve passes `valve_m3_s`, m³/s.
///
/// # Errors
/// [`ModelError::NoSteadyFlow`].
pub fn line_flows(rig: &Rig, water: &WaterProperties, valve_m3_s: f64, scale: f64) -> Result<Vec<f64>, ModelError> {
    let mut flows = System::new(rig, valve_m3_s).link_flows(rig, water, scale)?;
    flows.truncate(rig.graph.lines.len());
    Ok(flows)
}

/// Head that friction takes from the supply to the valve while the valve passes `valve_m3_s`, m.
///
/// # Errors
/// [`ModelError::NoSteadyFlow`].
pub fn way_loss_m(rig: &Rig, water: &WaterProperties, valve_m3_s: f64) -> Result<f64, ModelError> {
    let flows = line_flows(rig, water, valve_m3_s, 1.0)?;
    let losses = rig.graph.way.iter().flat_map(|&(line, backwards)| {
        let q = flows[line];
        let of = move |p: &Pipe| WallFriction::of(p, water, q).slope(p.inner_diameter_m, q) * p.length_m;
        rig.pipes_of(line).iter().map(move |p| if backwards { -of(p) } else { of(p) })
    });
    Ok(losses.sum())
}

/// What a pipe takes of a flow, m.
fn loss_m(pipe: &Pipe, water: &WaterProperties, flow_m3_s: f64) -> f64 {
    let of = |regime| {
        WallFriction::in_regime(pipe, water, flow_m3_s, regime).slope(pipe.inner_diameter_m, flow_m3_s) * pipe.length_m
    };
    let past = (pipe.reynolds(water, flow_m3_s).abs() - TRANSITION.start) / (TRANSITION.end - TRANSITION.start);
    match past.clamp(0.0, 1.0) {
        0.0 => of(Regime::Laminar),
        1.0 => of(Regime::Turbulent),
        part => (1.0 - part) * of(Regime::Laminar) + part * of(Regime::Turbulent),
    }
}
