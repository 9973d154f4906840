//! The energy balance: where the energy of the moving water goes, step by step (Karney 1990, J. Hydraul. Eng.
//! 116(10):1180-1196; Duan et al. 2010, J. Hydraul. Eng. 136(9):702-712).
//!
//! Energies are relative to the steady state `H0(x)`: with `h = H - H0`, elastic energy is `ρg²A/(2a²) ∫h² dx`, and an
//! outflow `q` takes `ρg h q` with it. The work of the slope of `H0` on the flow counts as the supply's: before the
//! closure it is just what friction takes, and everything else is zero.
//!
//! The scheme has an exact balance. A wave `F` carries the power `ρg F²/(4B)`, so the reach from node `i` to `i+1`
//! holds `ρg dt/(4B) (fwdᵢ² + bwdᵢ₊₁²)`: its kinetic and elastic energy when the two waves meet in its middle, half a
//! step after the nodes' time. To one side of a node arrives `Cp = X + Y` and leaves `bwd = (2h - X) - (2u - Y)`, where
//! `X = h + s`, `Y = u + f` (`s`: half of what storage takes over the reach, `f`: the same for momentum), so that
//!
//! ```text
//! Cp² - bwd² = 4 (h u + u f + s (h + f))      from upstream; from downstream with -u, -f
//! ```
//!
//! `h u` goes to the other side or out of the node, `u f` to friction, `s (h + f)` to storage. Friction is computed
//! from its law, each term from its own `κh - b` and `μu - d`, each outflow from its own law. None is the remainder of
//! the others, so the balance checks the step.

use crate::model::contribution::{Implicit, LineTerm};
use crate::model::node::{Node, Solved, Spread};
use crate::model::state::State;
use crate::model::steady::Steady;
use crate::model::wall::waves::WallWaves;
use crate::units::GRAVITY_M_S2;

/// Owners of the parts of the line: the index of an account for every term, field, shunt and loss.
#[derive(Debug, Clone, Default)]
pub struct Owners {
    /// Names of the accounts: the effects.
    pub accounts: Vec<String>,
    /// Of each line term.
    pub terms: Vec<usize>,
    /// Of the node field.
    pub field: Option<usize>,
    /// Of the stress waves in the wall.
    pub wall: Option<usize>,
    /// Of the elements at the nodes: behind each segment, then at those of the graph.
    pub nodes: Vec<NodeOwners>,
}

/// Owners of the elements of one node.
#[derive(Debug, Clone, Default)]
pub struct NodeOwners {
    /// Of each shunt.
    pub shunts: Vec<usize>,
    /// Of each loss, with its `K/(2gA²)`, by which losses at one node share the drop.
    pub losses: Vec<(usize, f64)>,
}

/// The energy balance after each step. All values except the contents of the line are sums since the start of the
/// closure.
#[derive(Debug, Clone, PartialEq)]
pub struct Energy {
    /// Time step, s.
    pub dt_s: f64,
    /// Names of the effects that have an account.
    pub accounts: Vec<String>,
    /// [`Energy::width`] values per step, J, in the order of [`Energy::columns`].
    values: Vec<f64>,
}

/// Columns before those of the effects.
const KINETIC: usize = 0;
const ELASTIC: usize = 1;
const SUPPLY: usize = 2;
const VALVE: usize = 3;
const FRICTION: usize = 4;
const EFFECTS: usize = 5;

impl Energy {
    /// Values per step: five, one per effect, and the remainder.
    pub fn width(&self) -> usize {
        EFFECTS + self.accounts.len() + 1
    }

    /// Names of the values, in J: contents of the line (`kinetic`, `elastic`), energy from the supply, energy out at
    /// the valve, losses to steady friction and to each effect, and the remainder of the balance.
    pub fn columns(&self) -> Vec<String> {
        let fixed = ["kinetic", "elastic", "supply", "valve", "friction"].map(String::from);
        let names = fixed.into_iter().chain(self.accounts.iter().cloned()).chain(["unbalanced".to_owned()]);
        names.map(|name| format!("{name}_J")).collect()
    }

    /// The values of each step.
    pub fn steps(&self) -> impl ExactSizeIterator<Item = &[f64]> {
        self.values.chunks_exact(self.width())
    }

    /// The values at a time after the start of the closure, linear between steps.
    pub fn at(&self, time_s: f64) -> Vec<f64> {
        let last = self.steps().len() - 1;
        let x = (time_s / self.dt_s).clamp(0.0, last as f64);
        let (i, part) = (x as usize, x.fract());
        let row = |i: usize| &self.values[i.min(last) * self.width()..][..self.width()];
        row(i).iter().zip(row(i + 1)).map(|(a, b)| a + part * (b - a)).collect()
    }

    /// Kinetic energy before the closure, J.
    pub fn initial_kinetic_j(&self) -> f64 {
        self.values[KINETIC]
    }

    /// Largest remainder of the balance over all steps, J.
    pub fn largest_imbalance_j(&self) -> f64 {
        self.steps().filter_map(|row| row.last()).fold(0.0, |most, e| most.max(e.abs()))
    }

    /// Energy taken up to a time, J, by the valve, friction and each effect, and the contents of the line; largest
    /// first.
    pub fn takers(&self, time_s: f64) -> Vec<(String, f64)> {
        let row = self.at(time_s);
        let mut takers = vec![
            ("left in the line".to_owned(), row[KINETIC] + row[ELASTIC]),
            ("valve".to_owned(), row[VALVE]),
            ("friction".to_owned(), row[FRICTION]),
        ];
        takers.extend(self.accounts.iter().cloned().zip(row[EFFECTS..].iter().copied()));
        takers.sort_by(|a, b| b.1.total_cmp(&a.1));
        takers
    }

    /// The same as shares that add up to 1; a negative value (energy given) counts as zero.
    pub fn shares(&self, time_s: f64) -> Vec<(String, f64)> {
        let takers = self.takers(time_s);
        let whole = takers.iter().map(|t| t.1.max(0.0)).sum::<f64>().max(f64::MIN_POSITIVE);
        takers.into_iter().map(|(name, joules)| (name, joules.max(0.0) / whole)).collect()
    }

    /// Energy from the supply up to a time, J.
    pub fn supplied_j(&self, time_s: f64) -> f64 {
        self.at(time_s)[SUPPLY]
    }
}

/// The energy balance during a simulation.
pub(crate) struct Balance<'a> {
    steady: &'a Steady<'a>,
    owners: Owners,
    /// `ρg dt`: a head times a flow becomes an energy.
    weight: f64,
    /// Implicit parts of each term, segment after segment.
    implicit: Vec<Vec<Implicit>>,
    /// Known storage and momentum of each term at all nodes.
    known: Vec<(Vec<f64>, Vec<f64>)>,
    /// `u` one step before at the two ends of each segment, about which their friction is linearised.
    ends: Vec<[f64; 2]>,
    /// Values of the current step.
    row: Vec<f64>,
    energy: Energy,
}

impl<'a> Balance<'a> {
    /// Starts at the steady state.
    pub fn new(
        steady: &'a Steady<'a>,
        mut owners: Owners,
        terms: &[Box<dyn LineTerm>],
        state: &State,
        steps: usize,
    ) -> Self {
        let grid = steady.grid;
        let mut known = vec![(vec![0.0; grid.nodes()], vec![0.0; grid.nodes()]); terms.len()];
        for (term, (storage, momentum)) in terms.iter().zip(&mut known) {
            for (s, segment) in grid.segments.iter().enumerate() {
                term.known(s, &mut storage[segment.nodes()], &mut momentum[segment.nodes()]);
            }
        }
        let energy = Energy { dt_s: grid.dt_s, accounts: owners.accounts.clone(), values: Vec::new() };
        let mut implicit: Vec<Vec<Implicit>> =
            terms.iter().map(|t| (0..grid.segments.len()).map(|s| t.implicit(s)).collect()).collect();
        // What a wall that lies on a floor takes from pressure waves comes last, and has no implicit part.
        if let Some(wall) = owners.wall {
            owners.terms.push(wall);
            implicit.push(vec![Implicit::default(); grid.segments.len()]);
            known.push((vec![0.0; grid.nodes()], vec![0.0; grid.nodes()]));
        }
        let mut balance = Balance {
            weight: steady.density_kg_m3 * GRAVITY_M_S2 * grid.dt_s,
            implicit,
            known,
            ends: vec![[0.0; 2]; grid.segments.len()],
            row: vec![0.0; energy.width()],
            energy,
            steady,
            owners,
        };
        balance.energy.values.reserve_exact((steps + 1) * balance.row.len());
        balance.close_step(state);
        balance
    }

    /// The balance so far.
    pub fn close(self) -> Energy {
        self.energy
    }

    /// Adds what the elements of a node take, with its heads before the closure. Call it before the node advances.
    pub fn node(&mut self, index: usize, node: &Node, solved: &Solved, [before_m, behind_m]: [f64; 2]) {
        let owners = &self.owners.nodes[index];
        let flow = solved.left_flow_m3_s;
        let whole: f64 = owners.losses.iter().map(|(_, k)| k).sum();
        for &(owner, k) in owners.losses.iter().filter(|(_, k)| *k > 0.0) {
            let drop_m = solved.left_head_m - solved.right_head_m;
            self.row[EFFECTS + owner] += self.weight * k / whole * drop_m * flow;
            self.row[SUPPLY] += self.weight * k / whole * (before_m - behind_m) * flow;
        }
        for (shunt, &owner) in node.shunts.iter().zip(&owners.shunts) {
            let outflow = shunt.outflow(solved.right_head_m).0;
            self.row[EFFECTS + owner] += self.weight * (solved.right_head_m - behind_m) * outflow;
        }
    }

    /// Adds what an element over several joints takes from them; `head_m` is their head deviation, interpolated at it.
    pub fn spread(&mut self, one: &Spread, head_m: f64) {
        self.row[EFFECTS + one.owner] += self.weight * head_m * one.flow_m3_s;
    }

    /// Adds what pressure waves bring to an end or joint of head deviation `h` less what goes on there: the wall takes it.
    pub fn wall(&mut self, (h, flow_m3_s): (f64, f64), (on_m, on_m3_s): (f64, f64)) {
        if let Some(owner) = self.owners.wall {
            self.row[EFFECTS + owner] += self.weight * (h * flow_m3_s - on_m * on_m3_s);
        }
    }

    /// Adds what leaves the pipes at a node of head deviation `h`: into a supply, or else by a valve and as demand.
    pub fn leaves(&mut self, into_supply: bool, h: f64, flow_m3_s: f64) {
        let work = self.weight * h * flow_m3_s;
        if into_supply {
            self.row[SUPPLY] -= work;
        } else {
            self.row[VALVE] += work;
        }
    }

    /// Adds the losses along the line in a step whose heads, flows and leaving waves are known, and closes the step.
    pub fn line(&mut self, state: &State) {
        let steady = self.steady;
        for (s, segment) in steady.grid.segments.iter().enumerate() {
            let (first, last) = (segment.offset, segment.offset + segment.reaches);
            let half_b = 0.5 * segment.impedance;
            let weight = self.weight / segment.impedance;
            let law = &steady.frictions[s];
            for i in first..=last {
                let (h, u) = (state.h[i], state.u[i]);
                let half_loss = if i == first || i == last {
                    let before = self.ends[s][usize::from(i == last)];
                    let (loss, slope) = law.half_loss_and_slope(before);
                    loss + slope * (u - before)
                } else {
                    law.half_loss_and_slope(u).0
                };
                let outflow = if i == first || i == last { 0.0 } else { state.outflow[i] };
                if let Some(owner) = self.owners.field {
                    self.row[EFFECTS + owner] += self.weight * h * outflow;
                }
                // The side towards the supply, then the side towards the valve.
                for (side, u) in [(1.0, u + half_b * outflow), (-1.0, u - half_b * outflow)] {
                    if (side > 0.0 && i == first) || (side < 0.0 && i == last) {
                        continue;
                    }
                    self.row[FRICTION] += weight * u * half_loss;
                    self.row[SUPPLY] += weight * u * state.steady_half_loss[s];
                    let mut momentum = half_loss - state.steady_half_loss[s];
                    for (implicit, known) in self.implicit.iter().zip(&self.known) {
                        momentum += implicit[s].mu * u - known.1[i];
                    }
                    for ((implicit, known), owner) in self.implicit.iter().zip(&self.known).zip(&self.owners.terms) {
                        let (stored, moved) = (implicit[s].kappa * h - known.0[i], implicit[s].mu * u - known.1[i]);
                        self.row[EFFECTS + owner] += weight * (u * moved + stored * (h + side * momentum));
                    }
                }
            }
        }
        self.close_step(state);
    }

    /// Advances the terms as the solver would, but keeps their contributions apart.
    pub fn advance(&mut self, terms: &mut [Box<dyn LineTerm>], wall: Option<&mut WallWaves>, state: &mut State) {
        for (term, (storage, momentum)) in terms.iter_mut().zip(&mut self.known) {
            storage.fill(0.0);
            momentum.fill(0.0);
            term.advance(&state.h, &state.u, storage, momentum);
        }
        if let (Some(_), Some((_, momentum))) = (&wall, self.known.last_mut()) {
            momentum.fill(0.0);
        }
        state.storage.fill(0.0);
        state.momentum.fill(0.0);
        let add = |total: &mut [f64], own: &[f64]| total.iter_mut().zip(own).for_each(|(total, own)| *total += own);
        for (storage, momentum) in &self.known {
            add(&mut state.storage, storage);
            add(&mut state.momentum, momentum);
        }
        if let (Some(wall), Some((_, own))) = (wall, self.known.last_mut()) {
            own.copy_from_slice(&state.momentum);
            wall.rub(|i| 0.5 * (state.new_fwd[i - 1] - state.new_bwd[i + 1]), &mut state.momentum);
            own.iter_mut().zip(&state.momentum).for_each(|(own, after)| *own = after - *own);
        }
    }

    /// Computes the contents of the line from the waves that now leave the nodes, completes the balance and stores the
    /// row.
    fn close_step(&mut self, state: &State) {
        let (mut kinetic, mut elastic) = (0.0, 0.0);
        for (s, segment) in self.steady.grid.segments.iter().enumerate() {
            let nodes = segment.nodes();
            let weight = self.weight / (8.0 * segment.impedance);
            let pairs = state.new_fwd[nodes.clone()].iter().zip(&state.new_bwd[nodes.clone()][1..]);
            let (k, e) = pairs.fold((0.0, 0.0), |(k, e), (f, b)| (k + (f - b) * (f - b), e + (f + b) * (f + b)));
            kinetic += weight * k;
            elastic += weight * e;
            self.ends[s] = [state.u[nodes.start], state.u[nodes.end - 1]];
        }
        for late in &state.late {
            let weight = self.weight / (8.0 * self.steady.grid.segments[late.segment].impedance);
            let [f, b] = late.waves();
            kinetic += weight * (f - b) * (f - b);
            elastic += weight * (f + b) * (f + b);
        }
        self.row[KINETIC] = kinetic;
        self.row[ELASTIC] = elastic;
        let initial = self.energy.values.first().copied().unwrap_or(kinetic);
        let last = self.row.len() - 1;
        let taken: f64 = self.row[VALVE..last].iter().sum();
        self.row[last] = initial + self.row[SUPPLY] - taken - kinetic - elastic;
        self.energy.values.extend_from_slice(&self.row);
    }
}
