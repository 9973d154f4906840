//! What a law does to the scheme at each of its places.

use crate::model::boundary::Supply;
use crate::model::contribution::{Implicit, LineTerm};
use crate::model::node::{HeadLoss, Shunt};
use crate::model::own::file::{Definition, H, H0, INPUTS, Q, Q0, T};
use crate::model::own::number::{NODES, Wide};
use crate::model::own::program::Program;
use crate::model::own::running::Running;
use crate::model::steady::Steady;
use crate::model::trace::Trace;

/// A flow out of a node.
pub(crate) struct FlowOut {
    pub law: Running,
    pub dt_s: f64,
    /// Time of the last step.
    pub time_s: f64,
}

impl Shunt for FlowOut {
    fn passing(&mut self, flow_m3_s: f64) {
        self.law.learn(flow_m3_s);
    }

    fn settle(&mut self, head_m: f64) -> f64 {
        self.time_s = 0.0;
        self.law.settle(head_m)
    }

    fn outflow(&self, head_m: f64) -> (f64, f64) {
        self.law.value(self.time_s + self.dt_s, head_m)
    }

    fn advance(&mut self, head_m: f64) {
        self.time_s += self.dt_s;
        self.law.advance(self.time_s, self.dt_s, head_m);
    }
}

/// A share of a head loss at a node.
pub(crate) struct Drop {
    pub law: Running,
    /// Negative where the node counts a flow as positive that the law counts as negative.
    pub share: f64,
    pub dt_s: f64,
    /// Time of the last step.
    pub time_s: f64,
}

impl Drop {
    fn at(&self, time_s: f64, flow_m3_s: f64) -> (f64, f64) {
        let (drop_m, slope) = self.law.value(time_s, self.share.signum() * flow_m3_s);
        (self.share * drop_m, self.share.abs() * slope)
    }
}

impl HeadLoss for Drop {
    fn facing(&mut self, head_m: f64) {
        self.law.learn(head_m);
    }

    fn settle(&mut self, flow_m3_s: f64) -> f64 {
        self.time_s = 0.0;
        self.share * self.law.settle(self.share.signum() * flow_m3_s)
    }

    fn drop_m(&self, flow_m3_s: f64) -> (f64, f64) {
        self.at(self.time_s + self.dt_s, flow_m3_s)
    }

    fn steady_drop_m(&self, flow_m3_s: f64) -> (f64, f64) {
        self.at(0.0, flow_m3_s)
    }

    fn advance(&mut self, flow_m3_s: f64) {
        self.time_s += self.dt_s;
        self.law.advance(self.time_s, self.dt_s, self.share.signum() * flow_m3_s);
    }
}

/// The head of a supply, from that of another.
pub(crate) struct Head {
    supply: Box<dyn Supply>,
    law: Running,
    time_s: f64,
}

impl Head {
    pub(crate) fn new(mut supply: Box<dyn Supply>, mut law: Running) -> Head {
        law.settle(supply.head_m(0.0));
        Head { supply, law, time_s: 0.0 }
    }
}

impl Supply for Head {
    fn head_m(&mut self, time_s: f64) -> f64 {
        let before_m = self.supply.head_m(time_s);
        if time_s > self.time_s {
            self.law.advance(time_s, time_s - self.time_s, before_m);
            self.time_s = time_s;
        }
        self.law.value(time_s.max(0.0), before_m).0
    }
}

/// What a sensor reads.
pub(crate) fn reading(mut law: Running, mut trace: Trace) -> Trace {
    law.settle(trace.values[0]);
    for (i, value) in trace.values.iter_mut().enumerate() {
        let time_s = i as f64 * trace.dt_s;
        if i > 0 {
            law.advance(time_s, trace.dt_s, *value);
        }
        *value = law.value(time_s, *value).0;
    }
    trace
}

/// Friction of the wall beyond what it is before the closure, which the steady friction has already.
///
/// The flow of the last step gives the friction of the next one.
pub(crate) struct Wall {
    law: Program,
    rates: Vec<Program>,
    first_state: usize,
    dt_s: f64,
    /// Time of the last step.
    time_s: f64,
    blocks: Vec<Block>,
    scratch: Vec<Wide>,
}

/// Some nodes of one segment.
struct Block {
    from: usize,
    count: usize,
    impedance: f64,
    half_reach_m: f64,
    steady_m: Wide,
    steady_m3_s: f64,
    steady_friction: Wide,
    states: Vec<Wide>,
}

impl Block {
    #[inline]
    fn run(
        &self,
        program: &Program,
        time_s: f64,
        h: Wide,
        q: Wide,
        first_state: usize,
        scratch: &mut Vec<Wide>,
    ) -> Wide {
        let input = |i: usize| match i {
            T => Wide([time_s; NODES]),
            H => h,
            Q => q,
            H0 => self.steady_m,
            Q0 => Wide([self.steady_m3_s; NODES]),
            _ => self.states.get(i.wrapping_sub(first_state)).copied().unwrap_or(Wide([0.0; NODES])),
        };
        program.run(input, scratch)
    }
}

impl Wall {
    pub(crate) fn new(d: &Definition, values: &[f64], steady: &Steady) -> Wall {
        let given = |i: usize| i.checked_sub(INPUTS.len()).and_then(|i| values.get(i)).copied();
        let first_state = INPUTS.len() + values.len();
        let starts: Vec<Program> = d.states.iter().map(|s| s.start.bound(given)).collect();
        let law = d.law.bound(given);
        let mut scratch = Vec::new();
        let mut blocks = Vec::new();
        for (segment, &flow) in steady.grid.segments.iter().zip(&steady.flow_m3_s) {
            let nodes: Vec<usize> = segment.nodes().collect();
            for nodes in nodes.chunks(NODES) {
                let head = |k: usize| steady.head_m[nodes[k.min(nodes.len() - 1)]];
                let mut block = Block {
                    from: nodes[0],
                    count: nodes.len(),
                    impedance: segment.impedance,
                    half_reach_m: 0.5 * segment.reach_m,
                    steady_m: Wide(std::array::from_fn(head)),
                    steady_m3_s: flow,
                    steady_friction: Wide([0.0; NODES]),
                    states: Vec::new(),
                };
                let (h, q) = (block.steady_m, Wide([flow; NODES]));
                for start in &starts {
                    let value = block.run(start, 0.0, h, q, first_state, &mut scratch);
                    block.states.push(value);
                }
                block.steady_friction = block.run(&law, 0.0, h, q, first_state, &mut scratch);
                blocks.push(block);
            }
        }
        let rates = d.states.iter().map(|s| s.rate.bound(given)).collect();
        Wall { law, rates, first_state, dt_s: steady.grid.dt_s, time_s: 0.0, blocks, scratch }
    }
}

/// Small change of a state that shows how its rate depends on it, of the state's size or 1.
const SMALL: f64 = 1e-6;

impl LineTerm for Wall {
    fn implicit(&self, _segment: usize) -> Implicit {
        Implicit::default()
    }

    fn advance(&mut self, h: &[f64], u: &[f64], _storage: &mut [f64], momentum: &mut [f64]) {
        self.time_s += self.dt_s;
        for block in &mut self.blocks {
            let last = block.count - 1;
            let head = Wide(std::array::from_fn(|k| block.steady_m.0[k] + h[block.from + k.min(last)]));
            let flow = Wide(std::array::from_fn(|k| u[block.from + k.min(last)] / block.impedance));
            // As in Running::advance; all nodes at once, so the derivative is a difference.
            for (k, rate) in self.rates.iter().enumerate() {
                let was = block.states[k];
                let (first, dt_s) = (self.first_state, self.dt_s);
                let at = block.run(rate, self.time_s, head, flow, first, &mut self.scratch);
                block.states[k] = Wide(was.0.map(|x| x + SMALL * (1.0 + x.abs())));
                let beside = block.run(rate, self.time_s, head, flow, first, &mut self.scratch);
                block.states[k] = Wide(std::array::from_fn(|i| {
                    let by_itself = (beside.0[i] - at.0[i]) / (SMALL * (1.0 + was.0[i].abs()));
                    let x = by_itself * dt_s;
                    was.0[i] + at.0[i] * dt_s * if x.abs() < 1e-9 { 1.0 } else { x.exp_m1() / x }
                }));
            }
            let friction = block.run(&self.law, self.time_s, head, flow, self.first_state, &mut self.scratch);
            for k in 0..block.count {
                momentum[block.from + k] -= block.half_reach_m * (friction.0[k] - block.steady_friction.0[k]);
            }
        }
    }
}
