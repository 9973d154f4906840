//! Simulation of one run: checks the values, builds the line and steps it.

use std::collections::BTreeMap;

use crate::model::attach::{Attached, attach};
use crate::model::boundary::{Closure, ConstantHead, GivenEnd, MeasuredHead, Supply, ValveEnd};
use crate::model::chosen::Chosen;
use crate::model::definition::{Model, check_places};
use crate::model::energy::Owners;
use crate::model::error::ModelError;
use crate::model::friction::{ReachFriction, WallFriction};
use crate::model::grid::{Grid, Stretch};
use crate::model::laws::Laws;
use crate::model::line_flows::System;
use crate::model::memory::Need;
use crate::model::other_valves::{closing_start_of, closing_time_of};
use crate::model::reaches::Travel;
use crate::model::run::{Conditions, Resolution, RunValues, Simulated};
use crate::model::scene::Scene;
use crate::model::solver::Lines;
use crate::model::steady::{Found, Given, Steady};
use crate::model::stop;
use crate::model::trace::Probe;
use crate::rig::{Place, Regime, Upstream};
use crate::units::GRAVITY_M_S2;

/// Share of the impedance that friction over one reach may take (see
/// [`NodeFriction`](crate::model::friction::NodeFriction)).
const MOST_FRICTION_SHARE: f64 = 0.02;

impl Model<'_> {
    /// Travel times of a wave through the pipes, and through the sections that effects make of them.
    ///
    /// # Errors
    /// If a value is outside its physical range.
    pub fn travel_s(&self, conditions: &Conditions, shared: &[f64], run: &RunValues) -> Result<Travel, ModelError> {
        self.check(shared, run)?;
        let lines =
            self.reshaped(self.stretches(conditions, shared, run, &vec![0.0; self.rig.graph.lines.len()]), shared)?;
        let of = |line: &Vec<Stretch>| line.iter().map(|s| s.length_m / s.wave_speed_m_s).collect();
        Ok(Travel { lines_s: lines.iter().map(of).collect(), ..self.pipes_travel_s(shared) })
    }

    /// Fewest reaches at which no pipe, and no section that an effect makes of one, is shorter than a reach, and every
    /// pipe has the steps that effects ask for. With fewer, a simulation still runs and lumps short sections with their
    /// neighbours, because a fit moves them about.
    ///
    /// # Errors
    /// If a value is outside its physical range.
    pub fn resolving_reaches(
        &self,
        conditions: &Conditions,
        shared: &[f64],
        run: &RunValues,
    ) -> Result<usize, ModelError> {
        Ok(self.travel_s(conditions, shared, run)?.least_reaches().max(self.effects_reaches(shared)))
    }

    /// Simulates one run: the reading of each probe, in time after the start of the closure.
    ///
    /// # Errors
    /// Values out of their physical range, a grid too coarse for the pipes, a run too large for memory, a solution that
    /// stops being finite.
    pub fn simulate(
        &self,
        conditions: &Conditions,
        shared: &[f64],
        run: &RunValues,
        resolution: Resolution,
        probes: &[Probe],
    ) -> Result<Simulated, ModelError> {
        self.run(conditions, shared, run, resolution, probes, GivenEnd::Nothing, false)
    }

    /// The same with part of the valve's end prescribed.
    pub(crate) fn driven(
        &self,
        conditions: &Conditions,
        shared: &[f64],
        run: &RunValues,
        resolution: Resolution,
        probes: &[Probe],
        given: GivenEnd,
    ) -> Result<Simulated, ModelError> {
        self.run(conditions, shared, run, resolution, probes, given, false)
    }

    /// The same, and computes the energy balance ([`Simulated::energy`]).
    ///
    /// # Errors
    /// As [`Model::simulate`].
    pub fn simulate_with_energy(
        &self,
        conditions: &Conditions,
        shared: &[f64],
        run: &RunValues,
        resolution: Resolution,
        probes: &[Probe],
    ) -> Result<Simulated, ModelError> {
        self.run(conditions, shared, run, resolution, probes, GivenEnd::Nothing, true)
    }

    #[allow(clippy::too_many_arguments)] // what simulate, driven and simulate_with_energy share
    fn run(
        &self,
        conditions: &Conditions,
        shared: &[f64],
        run: &RunValues,
        resolution: Resolution,
        probes: &[Probe],
        given: GivenEnd,
        with_energy: bool,
    ) -> Result<Simulated, ModelError> {
        stop::check()?;
        self.check(shared, run)?;
        let graph = &self.rig.graph;
        let flow_m3_s = run.initial_velocity_m_s * self.rig.pipe_at_valve().area_m2();
        let system = System::new(self.rig, flow_m3_s);
        let line_m3_s = system.link_flows(self.rig, &conditions.water, run.friction_scale)?;
        let needed = self.pipes_travel_s(shared).least_reaches();
        if resolution.reaches < needed {
            return Err(ModelError::TooFewReaches { reaches: resolution.reaches, needed });
        }
        let stretches = self.reshaped(self.stretches(conditions, shared, run, &line_m3_s), shared)?;
        let way: Vec<usize> = graph.way.iter().map(|(line, _)| *line).collect();
        let grid = Grid::new(&stretches, &way, resolution.reaches)?;
        // Two more steps: the cubic interpolation in time looks that far ahead.
        let steps = ((resolution.duration_s + self.beyond_s(shared)) / grid.dt_s).ceil() + 2.0;
        let per_step = probes.len().max(1) + if with_energy { self.effects.len() + 6 } else { 0 };
        let effects_per_node = self.effects.iter().map(|c| c.effect.kept_per_node(c.elements.unwrap_or(1))).sum();
        Need { steps, per_step, nodes: grid.nodes(), effects_per_node }.check(self.memory_limit_bytes)?;
        let steps = steps as usize;
        let scene = Scene {
            rig: self.rig,
            water: &conditions.water,
            dt_s: grid.dt_s,
            flow_m3_s,
            valve_head_m: run.valve_head_m,
            line: graph.line_to_valve(),
        };
        let Attached { grid, mut nodes, mut spread, owners } = attach(self, grid, shared, &scene)?;
        let frictions = reach_frictions(&grid, resolution.reaches, &line_m3_s, flow_m3_s)?;
        let before = Given {
            grid: &grid,
            system: &system,
            frictions: &frictions,
            valve_head_m: run.valve_head_m,
            start_m3_s: &line_m3_s,
        };
        let Found { head_m, flow_m3_s: flows, at_m, behind_m, link_m3_s } = before.settle(&mut nodes, &mut spread)?;
        let at_graph = nodes[grid.segments.len()..].iter_mut().zip(&graph.nodes);
        at_graph.for_each(|(node, of)| node.taken_m3_s = of.kind.demand_m3_s());
        let starts = grid.segments.iter().map(|s| Place { line: s.line, position_m: s.start_m }).collect();
        let steady = Steady {
            grid: &grid,
            frictions: &frictions,
            head_m,
            flow_m3_s: flows.clone(),
            density_kg_m3: conditions.water.density_kg_m3,
            viscosity_m2_s: conditions.water.kinematic_viscosity_m2_s,
        };
        let mut terms = Vec::new();
        let accounts = self.effects.iter().map(|c| c.effect.name().to_owned()).collect();
        let mut owners = Owners { accounts, nodes: owners, ..Owners::default() };
        let (mut field, mut wall) = (None, None);
        let mut supply = self.base_supply(conditions, behind_m[graph.supply()])?;
        let discharge_head_m = self.rig.valve.discharge_head_m;
        let (given_head, given_law) = match given {
            GivenEnd::Nothing => (None, None),
            GivenEnd::Head(head) => (Some(head), None),
            GivenEnd::Law(law) => (None, Some(law)),
        };
        let first = ValveEnd {
            flow_m3_s,
            start_s: 0.0,
            // Into lines that follow, by their head.
            drop_m: run.valve_head_m - system.behind[graph.valve].map_or(discharge_head_m, |behind| at_m[behind]),
            discharge_head_m,
            closure: (self.closure)(run.closing_time_s),
            law: None,
            characteristic: self.rig.valve.characteristic.clone(),
            residual_opening: 0.0,
            given_head,
        };
        let mut valves = BTreeMap::from([(graph.valve, first)]);
        for ((node, _, opening, closing), own) in graph.others_that_close().zip(self.closings(shared)) {
            let other = ValveEnd {
                // What it passes of 1 m: its area is known.
                flow_m3_s: opening.cda_m2 * (2.0 * GRAVITY_M_S2).sqrt(),
                drop_m: 1.0,
                discharge_head_m: system.behind[node].map_or(0.0, |behind| at_m[behind]),
                start_s: own.start_s,
                closure: Closure::Linear { closing_time_s: own.time_s },
                law: None,
                characteristic: closing.characteristic.clone(),
                residual_opening: 0.0,
                given_head: None,
            };
            valves.insert(node, other);
        }
        for (account, (chosen, values)) in self.chosen(shared).enumerate() {
            terms.extend(chosen.effect.line_terms(values, &steady)?);
            owners.terms.resize(terms.len(), account);
            if let Some(own) = chosen.effect.field(values, &scene, &steady)? {
                field = Some(own);
                owners.field = Some(account);
            }
            if let Some(own) = chosen.effect.wall_waves(values, &scene, &steady)? {
                wall = Some(own);
                owners.wall = Some(account);
            }
            supply = chosen.effect.supply(values, supply)?;
            if let Some(valve) = valves.get_mut(&chosen.valve(self.rig)) {
                chosen.effect.valve(values, valve)?;
            }
        }
        if let (Some(valve), true) = (valves.get_mut(&graph.valve), given_law.is_some()) {
            (valve.law, valve.characteristic) = (given_law, Vec::new());
        }
        let mut laws = Laws {
            system: &system,
            at_m: &at_m,
            link_m3_s: &link_m3_s,
            dt_s: grid.dt_s,
            density_kg_m3: conditions.water.density_kg_m3,
            supply: Some(supply),
            valves,
        };
        let ends = grid.ends_at(graph);
        let laws = ends.iter().enumerate().map(|(n, [last, first])| {
            let sum = |of: &[usize]| of.iter().map(|&s| flows[s]).sum::<f64>();
            let steady_m = [at_m[n], system.behind[n].map_or(behind_m[n], |behind| at_m[behind])];
            (laws.of(n, sum(last) - sum(first)), steady_m)
        });
        let lines = Lines { steady: &steady, terms, field, wall, nodes, laws: laws.collect(), spread };
        let owners = with_energy.then_some(owners);
        let (traces, energy) = lines.run(graph, steps, probes, owners).map_err(|error| self.named(error))?;
        Ok(Simulated { traces, energy, starts, flows_m3_s: flows })
    }

    /// The stretches with what effects make of them.
    fn reshaped(&self, mut lines: Vec<Vec<Stretch>>, shared: &[f64]) -> Result<Vec<Vec<Stretch>>, ModelError> {
        for (chosen, values) in self.chosen(shared) {
            chosen.effect.reshape(values, &mut lines[chosen.line(self.rig)])?;
        }
        Ok(lines)
    }

    /// The stretches of each line, one a pipe, for the flow in it.
    fn stretches(
        &self,
        conditions: &Conditions,
        shared: &[f64],
        run: &RunValues,
        line_m3_s: &[f64],
    ) -> Vec<Vec<Stretch>> {
        // If some pipes are of a material that creeps, only they do.
        let any_creeps = self.rig.pipes.iter().any(|p| p.material().viscoelastic);
        // What is faster than the liquid's wave needs a node at each joint.
        let on_nodes = self.effects_reaches(shared) > 1;
        let stretch = |i: usize, flow_m3_s: f64| {
            let pipe = &self.rig.pipes[i];
            let given = conditions.regimes.as_ref().and_then(|regimes| regimes.get(i));
            let regime = given.copied().unwrap_or_else(|| Regime::of(pipe.reynolds(&conditions.water, flow_m3_s)));
            Stretch {
                creeps: pipe.material().viscoelastic || !any_creeps,
                length_m: pipe.length_m,
                diameter_m: pipe.inner_diameter_m,
                wall_m: pipe.wall_thickness_m,
                wave_speed_m_s: shared[i],
                constraint: pipe.constraint_coefficient(),
                run: if on_nodes { i } else { 0 },
                friction: WallFriction::in_regime(pipe, &conditions.water, flow_m3_s, regime)
                    .scaled(run.friction_scale),
                regime,
            }
        };
        let lines = self.rig.graph.lines.iter().zip(line_m3_s);
        lines.map(|(line, &flow_m3_s)| line.pipes.clone().map(|i| stretch(i, flow_m3_s)).collect()).collect()
    }

    fn base_supply(&self, conditions: &Conditions, steady_head_m: f64) -> Result<Box<dyn Supply>, ModelError> {
        match (self.rig.upstream, &conditions.supply_deviation) {
            (Upstream::Measured, Some((time_s, deviation_m))) if !time_s.is_empty() => {
                let head_m = deviation_m.iter().map(|d| steady_head_m + d).collect();
                Ok(Box::new(MeasuredHead { time_s: time_s.clone(), head_m, cursor: 0 }))
            }
            (Upstream::Measured, _) => Err(ModelError::NoSupplyHead),
            (Upstream::Reservoir | Upstream::Pump, _) => Ok(Box::new(ConstantHead(steady_head_m))),
        }
    }

    /// Adds the model's effects to an error.
    fn named(&self, error: ModelError) -> ModelError {
        match error {
            ModelError::NotFinite { time_s, place, .. } => {
                let labels: Vec<String> = self.effects.iter().map(Chosen::label).collect();
                let effects = if labels.is_empty() { "no effects".to_owned() } else { labels.join(", ") };
                ModelError::NotFinite { time_s, place, along: self.rig.along_words(place.line), effects }
            }
            other => other,
        }
    }

    fn check(&self, shared: &[f64], run: &RunValues) -> Result<(), ModelError> {
        check_places(self.rig, &self.effects)?;
        let positive = |name: &str, value: f64| match value > 0.0 && value.is_finite() {
            true => Ok(()),
            false => Err(ModelError::Value { name: name.to_owned(), value, allowed: "more than zero" }),
        };
        let not_negative = |name: &str, value: f64| match value >= 0.0 && value.is_finite() {
            true => Ok(()),
            false => Err(ModelError::Value { name: name.to_owned(), value, allowed: "zero or more" }),
        };
        for (parameter, &value) in self.shared.iter().zip(shared).take(self.rig.pipes.len()) {
            positive(&parameter.name, value)?;
        }
        for ((_, name, ..), own) in self.rig.graph.others_that_close().zip(self.closings(shared)) {
            positive(&closing_time_of(name), own.time_s)?;
            not_negative(&closing_start_of(name), own.start_s)?;
        }
        not_negative("friction_scale", run.friction_scale)?;
        not_negative("initial_velocity_m_s", run.initial_velocity_m_s)?;
        not_negative("closing_time_s", run.closing_time_s)?;
        let needs_drop = matches!((self.closure)(run.closing_time_s), Closure::Linear { .. });
        if !run.valve_head_m.is_finite() || (needs_drop && run.valve_head_m <= self.rig.valve.discharge_head_m) {
            return Err(ModelError::Value {
                name: "valve_head_m".to_owned(),
                value: run.valve_head_m,
                allowed: "above the discharge head, or nothing would flow",
            });
        }
        Ok(())
    }
}

/// The friction of every segment, checked against the resolution of the scheme. Tables reach to the flow at the valve,
/// whose stop sends it everywhere.
fn reach_frictions(
    grid: &Grid,
    reaches: usize,
    line_m3_s: &[f64],
    valve_m3_s: f64,
) -> Result<Vec<ReachFriction>, ModelError> {
    grid.segments
        .iter()
        .map(|segment| {
            let own_m3_s = line_m3_s[segment.line].abs();
            let largest_u = 2.0 * segment.impedance * own_m3_s.max(valve_m3_s.abs());
            let laws = segment.parts.iter().map(|(s, _)| &s.friction);
            let friction = ReachFriction::new(laws, |q| segment.reach_loss_m(q), segment.impedance, largest_u);
            let share = friction.largest_share(segment.impedance * own_m3_s) / (1.0 + segment.late);
            if share > MOST_FRICTION_SHARE {
                let needed = (reaches as f64 * share / MOST_FRICTION_SHARE).ceil() as usize;
                return Err(ModelError::FrictionTooCoarse { share, needed });
            }
            Ok(friction)
        })
        .collect()
}
