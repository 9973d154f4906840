//! One simulation: steps the lines with their joints and nodes from the start of the closure.

use crate::model::contribution::{Implicit, LineTerm, NodeField};
use crate::model::end::End;
use crate::model::energy::{Balance, Energy, Owners};
use crate::model::error::ModelError;
use crate::model::grid::Grid;
use crate::model::joint::Joints;
use crate::model::junction::{Junction, Law, Side};
use crate::model::late::Late;
use crate::model::node::{Node, Spread};
use crate::model::state::{LineTerms, Reading, State};
use crate::model::steady::Steady;
use crate::model::stop::Heeded;
use crate::model::trace::{Probe, Trace};
use crate::model::wall::waves::WallWaves;
use crate::rig::{Graph, Place};
use crate::wide::widened;

/// All lines with everything on them.
pub struct Lines<'a> {
    /// Steady state, grid and friction.
    pub steady: &'a Steady<'a>,
    /// Terms along the line.
    pub terms: Vec<Box<dyn LineTerm>>,
    /// Takes water out of every node.
    pub field: Option<Box<dyn NodeField>>,
    /// Stress waves in the wall.
    pub wall: Option<WallWaves>,
    /// Elements behind each segment, then those at the nodes of the graph.
    pub nodes: Vec<Node>,
    /// The law of each node of the graph, and its heads before the closure ([`Junction`]).
    pub laws: Vec<(Law, [f64; 2])>,
    /// Elements over several nodes behind segments.
    pub spread: Vec<Spread>,
}

/// What is stepped.
struct Stepped<'a> {
    steady: &'a Steady<'a>,
    terms: Vec<Box<dyn LineTerm>>,
    field: Option<Box<dyn NodeField>>,
    wall: Option<WallWaves>,
    joints: Joints<'a>,
    junctions: Vec<Junction<'a>>,
}

impl<'a> Lines<'a> {
    /// Simulates `steps` steps and returns the reading of each probe; with `owners` also the energy balance.
    ///
    /// # Errors
    /// If the solution stops being finite.
    pub fn run(
        self,
        graph: &Graph,
        steps: usize,
        probes: &[Probe],
        owners: Option<Owners>,
    ) -> Result<(Vec<Trace>, Option<Energy>), ModelError> {
        let grid = self.steady.grid;
        let heads_only = probes.iter().all(|p| matches!(p, Probe::Head(_)));
        let mut state = self.initial_state(heads_only && owners.is_none());
        let mut balance = owners.map(|owners| Balance::new(self.steady, owners, &self.terms, &state, steps));
        let readings: Vec<Reading> = probes.iter().map(|&probe| Reading::new(probe, self.steady)).collect();
        let mut lines = self.stepped(graph, &state);
        if let Some(wall) = &mut lines.wall {
            wall.reserve(grid, steps, probes);
        }
        let mut traces: Vec<Trace> = readings.iter().map(|_| Trace::with_capacity(grid.dt_s, steps + 1)).collect();
        state.read(&mut traces, &readings);
        march(&mut lines, &mut state, steps, &readings, &mut traces, &mut balance)?;
        if let Some(wall) = lines.wall {
            wall.show(grid, probes, &mut traces);
        }
        Ok((traces, balance.map(Balance::close)))
    }

    fn initial_state(&self, heads_only: bool) -> State {
        let grid = self.steady.grid;
        let n = grid.nodes();
        let mut u = vec![0.0; n];
        let (mut fwd, mut bwd) = (vec![0.0; n], vec![0.0; n]);
        let (mut storage, mut momentum) = (vec![0.0; n], vec![0.0; n]);
        let mut steady_half_loss = Vec::new();
        let mut implicit = Vec::new();
        let mut inner_frictions = Vec::new();
        for (s, (segment, friction)) in grid.segments.iter().zip(self.steady.frictions).enumerate() {
            let nodes = segment.nodes();
            let steady_u = segment.impedance * self.steady.flow_m3_s[s];
            u[nodes.clone()].fill(steady_u);
            // h = 0, and the loss of the steady flow cancels: the waves carry u alone.
            fwd[nodes.clone()].fill(steady_u);
            bwd[nodes.clone()].fill(-steady_u);
            let mut total = Implicit::default();
            for term in &self.terms {
                term.known(s, &mut storage[nodes.clone()], &mut momentum[nodes.clone()]);
                let Implicit { kappa, mu } = term.implicit(s);
                total = Implicit { kappa: total.kappa + kappa, mu: total.mu + mu };
            }
            let inner = friction.of_twice_u(1.0 + total.mu);
            steady_half_loss.push(0.5 * (1.0 + total.mu) * inner.steady_half_loss(2.0 * steady_u));
            inner_frictions.push(inner);
            implicit.push(total);
        }
        let late = Late::of(grid, &fwd, &bwd);
        let lies = self.wall.as_ref().is_some_and(WallWaves::lies);
        let terms = match (heads_only && self.field.is_none() && !lies, self.terms.is_empty()) {
            (true, true) => LineTerms::None,
            (true, false) if self.terms.iter().all(|term| term.is_storage_alone()) => LineTerms::Storage,
            _ => LineTerms::All,
        };
        State {
            new_fwd: fwd.clone(),
            new_bwd: bwd.clone(),
            fwd,
            bwd,
            h: vec![0.0; n],
            u,
            storage,
            momentum,
            outflow: vec![0.0; n],
            scratch: vec![0.0; n],
            late,
            terms,
            steady_half_loss,
            implicit,
            frictions: inner_frictions,
        }
    }

    /// Resolves the ends of all segments, once for all steps.
    fn stepped(self, graph: &Graph, state: &State) -> Stepped<'a> {
        let Lines { steady, terms, field, wall, mut nodes, laws, mut spread } = self;
        let grid = steady.grid;
        let mut at_graph = nodes.split_off(grid.segments.len());
        // The last segment of a line has no joint behind it.
        spread.iter_mut().flat_map(|one| &mut one.at).for_each(|(s, _)| *s -= grid.segments[*s].line);
        let joints = grid.joints().map(|s| {
            let (left, right) = (End::new(steady, state, s), End::new(steady, state, s + 1));
            (left, right, std::mem::take(&mut nodes[s]), s)
        });
        let joints = Joints::new(joints, spread);
        let junctions = grid.ends_at(graph).into_iter().zip(laws).zip(&mut at_graph).enumerate();
        let has_wall = wall.is_some();
        let junctions = junctions.map(|(n, (([last, first], (law, steady_m)), node))| Junction {
            is_bare: !has_wall
                && node.is_plain()
                && last.len() + first.len() == 1
                && !(first.len() == 1 && law.passes()),
            last: Side::new(last.into_iter().map(|s| End::new(steady, state, s))),
            first: Side::new(first.into_iter().map(|s| End::new(steady, state, s))),
            law,
            node: std::mem::take(node),
            index: grid.segments.len() + n,
            steady_m,
        });
        Stepped { steady, terms, field, wall, joints, junctions: junctions.collect() }
    }
}

widened! {
    /// All steps.
    over lines.longest();
    fn march(
        lines: &mut Stepped,
        state: &mut State,
        steps: usize,
        readings: &[Reading],
        traces: &mut [Trace],
        balance: &mut Option<Balance>,
    ) -> Result<(), ModelError> {
        let grid = lines.steady.grid;
        let heeded = Heeded::by_this_thread();
        for step in 1..=steps {
            heeded.check()?;
            let time_s = step as f64 * grid.dt_s;
            lines.step(state, time_s, balance.as_mut());
            state.read(traces, readings);
            // At the end of the last line, which all waves reach within L/a; everywhere once, at the end.
            let seen = if step < steps { state.fwd.len() - 1..state.fwd.len() } else { 0..state.fwd.len() };
            if !seen.into_iter().all(|i| state.fwd[i].is_finite() && state.bwd[i].is_finite()) {
                return Err(not_finite(grid, state, time_s));
            }
        }
        Ok(())
    }
}

fn not_finite(grid: &Grid, state: &State, time_s: f64) -> ModelError {
    let bad = (0..state.fwd.len()).find(|&i| !(state.fwd[i].is_finite() && state.bwd[i].is_finite())).unwrap_or(0);
    let segment = grid.segments.iter().find(|s| s.nodes().contains(&bad));
    let position_m = segment.map_or(0.0, |s| s.start_m + s.reach_m * (bad - s.offset) as f64);
    let place = Place { line: segment.map_or(0, |s| s.line), position_m };
    ModelError::NotFinite { time_s, place, along: String::new(), effects: String::new() }
}

impl Stepped<'_> {
    /// Reaches of the longest segment.
    fn longest(&self) -> usize {
        self.steady.grid.segments.iter().map(|segment| segment.reaches).max().unwrap_or(0)
    }

    #[inline(always)]
    fn step(&mut self, state: &mut State, time_s: f64, mut balance: Option<&mut Balance>) {
        let grid = self.steady.grid;
        state.pass_late();
        // The ends first: what they store one by one is long settled when the next step loads it in wide registers.
        for (n, junction) in self.junctions.iter_mut().enumerate() {
            let wall = self.wall.as_mut().and_then(|wall| wall.at(n));
            junction.step(state, (time_s, grid.dt_s), wall, &mut balance);
        }
        self.joints.step(state, self.wall.as_mut(), &mut balance);
        if let Some(wall) = &mut self.wall {
            wall.turn();
        }
        for (s, segment) in grid.segments.iter().enumerate().filter(|(_, segment)| segment.reaches > 1) {
            match &mut self.field {
                None => state.interior(s, segment.nodes()),
                Some(field) => state.interior_with(field.as_mut(), s, segment),
            }
        }
        let lies = self.wall.as_ref().is_some_and(WallWaves::lies);
        match balance {
            Some(balance) => {
                balance.line(state);
                balance.advance(&mut self.terms, self.wall.as_mut(), state);
            }
            None if self.terms.is_empty() && !lies => {}
            None if state.terms == LineTerms::Storage => {
                for (i, term) in self.terms.iter_mut().enumerate() {
                    term.advance_storage(&state.h, &mut state.storage, i == 0);
                }
            }
            // `fill` is a function of its own, which a build in many units leaves as a call.
            None => {
                for sum in &mut state.storage {
                    *sum = 0.0;
                }
                for sum in &mut state.momentum {
                    *sum = 0.0;
                }
                for term in &mut self.terms {
                    term.advance(&state.h, &state.u, &mut state.storage, &mut state.momentum);
                }
                if let Some(wall) = &mut self.wall {
                    let State { new_fwd, new_bwd, momentum, .. } = state;
                    wall.rub(|i| 0.5 * (new_fwd[i - 1] - new_bwd[i + 1]), momentum);
                }
            }
        }
        state.turn();
    }
}
