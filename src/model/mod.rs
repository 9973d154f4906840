//! The model of a rig: base model and effects, their parameters, and the simulation of one run by the method of
//! characteristics.
//!
//! The base model has elastic waves, quasi-steady wall friction, a constant supply head and a valve whose opening falls
//! linearly in time. Effects (see [`effects`]) add to it.

mod attach;
pub mod boundary;
pub mod constraint;
pub mod effects;
pub mod energy;
pub mod error;
pub mod friction;
pub mod gas;
pub mod grid;
pub mod kernel;
pub mod node;
pub mod oscillator;
pub mod parameter;
pub mod sensor;
pub mod solver;
pub mod trace;
mod unsteady_kernels;
pub mod valve_from_head;
mod wide;

pub use error::ModelError;

use boundary::{Closure, ConstantHead, HeadInTime, MeasuredHead, Supply, ValveEnd};
use constraint::Constraint;
use effects::{Chosen, Scene, Site};
use energy::{Energy, Owners};
use friction::{ReachFriction, WallFriction};
use grid::{Grid, Stretch};
use parameter::Parameter;
use sensor::seen_by;
use solver::{Line, Steady, settle};
use trace::{Probe, Trace};

use crate::rig::WaterProperties;
use crate::rig::{Rig, Sensor, Upstream};

/// A model: a rig, the effects added to the base model, and its parameters.
#[derive(Debug, Clone)]
pub struct Model<'a> {
    /// The rig.
    pub rig: &'a Rig,
    /// Effects, each with its number of elements decided.
    pub effects: Vec<Chosen>,
    /// How many of the shared parameters belong to each effect.
    effect_sizes: Vec<usize>,
    /// Parameters shared by all runs on the rig: wave speeds, effects.
    pub shared: Vec<Parameter>,
    /// Parameters of one run: velocity, head, closing time, friction.
    pub per_run: [Parameter; RunValues::COUNT],
    /// Form of the closure, its time taken from the run's parameters.
    pub closure: fn(f64) -> Closure,
    /// What has been settled about parameters, those of runs and sensors included.
    pub constraints: Vec<Constraint>,
}

/// The per-run parameters, in their order.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RunValues {
    /// Velocity in the last pipe before the closure, m/s.
    pub initial_velocity_m_s: f64,
    /// Head upstream of the valve before the closure, m.
    pub valve_head_m: f64,
    /// Closing time, s.
    pub closing_time_s: f64,
    /// Multiplies the steady friction factor.
    pub friction_scale: f64,
}

/// What a run has beside its parameters.
#[derive(Debug, Clone)]
pub struct Conditions {
    /// The water at the run's temperature.
    pub water: WaterProperties,
    /// Head measured at position 0 minus its mean before the closure, against time after the start of the closure: drives an
    /// upstream end of kind `measured`.
    pub supply_deviation: Option<(Vec<f64>, Vec<f64>)>,
}

/// How finely and how long to simulate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Resolution {
    /// Number of reaches of the whole line.
    pub reaches: usize,
    /// Simulated time after the start of the closure, s.
    pub duration_s: f64,
}

/// What a simulation gives.
#[derive(Debug, Clone, PartialEq)]
pub struct Simulated {
    /// What each probe reads.
    pub traces: Vec<Trace>,
    /// Where the energy went, if that was asked for.
    pub energy: Option<Energy>,
    starts_m: Vec<f64>,
    flows_m3_s: Vec<f64>,
}

impl Simulated {
    /// Flow before the closure at a place, m³/s: a leak makes it differ along the pipe.
    pub fn steady_flow_m3_s(&self, position_m: f64) -> f64 {
        let segment = self.starts_m.iter().rposition(|&start| position_m >= start).unwrap_or(0);
        self.flows_m3_s[segment]
    }
}

/// Least head over the open valve, m: without any nothing would flow.
pub const LEAST_DROP_M: f64 = 1e-3;
/// Memory that the recorded heads of one simulation may take.
const MOST_HISTORY_BYTES: usize = 4 << 30;
/// Share of the impedance that friction over one reach may take (see [`friction::NodeFriction`]).
const MOST_FRICTION_SHARE: f64 = 0.02;

impl RunValues {
    /// Number of per-run parameters.
    pub const COUNT: usize = 4;

    /// From values in the parameters' order.
    pub fn from_slice(values: &[f64; RunValues::COUNT]) -> RunValues {
        let [initial_velocity_m_s, valve_head_m, closing_time_s, friction_scale] = *values;
        RunValues { initial_velocity_m_s, valve_head_m, closing_time_s, friction_scale }
    }
}

impl<'a> Model<'a> {
    /// The base model of a rig with effects added; `water` and the rig give parameters their starts and bounds.
    pub fn new(rig: &'a Rig, water: &WaterProperties, effects: &[Chosen]) -> Model<'a> {
        let mut shared = Vec::new();
        let mut travel_s = 0.0;
        for pipe in &rig.pipes {
            let (start, lower, upper) = pipe.wave_speed_start(water);
            travel_s += pipe.length_m / start;
            let name = match rig.pipes.len() {
                1 => "wave_speed_m_s".to_owned(),
                _ => format!("wave_speed_m_s[{}]", pipe.name),
            };
            shared.push(Parameter::log(
                name,
                "m/s",
                "speed of pressure waves in the pipe: sets the period, 4L/a, and the height of the first rise",
                start,
                lower,
                upper,
            ));
        }
        let site = Site { rig, water, period_s: 4.0 * travel_s };
        let effects: Vec<Chosen> = effects
            .iter()
            .map(|c| Chosen {
                elements: c.elements.or(c.effect.elements().map(|r| *r.start())),
                sensor: c.sensor.clone().or_else(|| first_sensor(rig).filter(|_| c.effect.at_sensor())),
                ..c.clone()
            })
            .collect();
        let mut effect_sizes = Vec::new();
        for chosen in &effects {
            let parameters = chosen.effect.parameters(&site, chosen.elements.unwrap_or(1));
            effect_sizes.push(parameters.len());
            shared.extend(parameters);
        }
        let nominal_s = rig.valve.closing_time_s;
        let per_run = [
            Parameter::log(
                "initial_velocity_m_s",
                "m/s",
                "mean velocity before the valve closes: sets the height of the first rise",
                1.0,
                1e-4,
                50.0,
            ),
            Parameter::linear(
                "valve_head_m",
                "m",
                "head upstream of the valve before it closes",
                rig.valve.discharge_head_m + 20.0,
                rig.valve.discharge_head_m + LEAST_DROP_M,
                rig.valve.discharge_head_m + 5000.0,
            ),
            Parameter::log(
                "closing_time_s",
                "s",
                "how long the valve takes to close",
                nominal_s,
                nominal_s / 20.0,
                nominal_s * 20.0,
            )
            .with_prior(nominal_s, 0.5),
            // A run's own: the factor belongs to its flow and temperature.
            Parameter::log("friction_scale", "1", "multiplies the steady friction factor", 1.0, 0.2, 5.0)
                .with_prior(1.0, 0.2),
        ];
        Model {
            rig,
            effects,
            effect_sizes,
            shared,
            per_run,
            closure: |closing_time_s| Closure::Linear { closing_time_s },
            constraints: Vec::new(),
        }
    }

    /// With parameters held, or between other bounds.
    pub fn constrained(self, constraints: &[Constraint]) -> Self {
        Model { constraints: constraints.to_vec(), ..self }
    }

    /// Index of the first effect's first parameter among the shared ones.
    pub fn effects_from(&self) -> usize {
        self.rig.pipes.len()
    }

    /// How many shared parameters each effect has.
    pub fn effect_sizes(&self) -> &[usize] {
        &self.effect_sizes
    }

    /// Puts the effects' values in their customary order.
    pub fn put_in_order(&self, values: &mut [f64]) {
        let mut at = self.effects_from();
        for (chosen, &size) in self.effects.iter().zip(&self.effect_sizes) {
            chosen.effect.put_in_order(&mut values[at..at + size]);
            at += size;
        }
    }

    /// Theoretical period `4L/a` for shared parameter values, s.
    pub fn period_s(&self, shared: &[f64]) -> f64 {
        4.0 * self.rig.pipes.iter().zip(shared).map(|(p, a)| p.length_m / a).sum::<f64>()
    }

    /// Fewest reaches that the pipes can be divided into, with wave speeds a fifth off.
    pub fn least_reaches(&self, shared: &[f64]) -> usize {
        let travel_s: Vec<f64> = self.rig.pipes.iter().zip(shared).map(|(p, a)| p.length_m / a).collect();
        let margin = if travel_s.len() > 1 { 1.2 } else { 1.0 };
        (margin * grid::least_reaches(&travel_s) as f64).ceil() as usize
    }

    /// Reaches, at least `reaches`, that fit the pipes' joints best.
    pub fn fitting_reaches(&self, shared: &[f64], reaches: usize) -> usize {
        let travel_s: Vec<f64> = self.rig.pipes.iter().zip(shared).map(|(p, a)| p.length_m / a).collect();
        grid::fitting_reaches(&travel_s, reaches)
    }

    /// Simulates one run: what each probe reads, in time after the start of the closure.
    ///
    /// # Errors
    /// Values out of their physical range, a grid too coarse for the pipes, a run too long for memory, a solution that
    /// stops being finite.
    pub fn simulate(
        &self,
        conditions: &Conditions,
        shared: &[f64],
        run: &RunValues,
        resolution: Resolution,
        probes: &[Probe],
    ) -> Result<Simulated, ModelError> {
        self.run(conditions, shared, run, resolution, probes, None, false)
    }

    /// The same with the head before the valve given, which then drives the line in the valve's stead.
    fn driven(
        &self,
        conditions: &Conditions,
        shared: &[f64],
        run: &RunValues,
        resolution: Resolution,
        probes: &[Probe],
        given_head: Option<HeadInTime>,
    ) -> Result<Simulated, ModelError> {
        self.run(conditions, shared, run, resolution, probes, given_head, false)
    }

    /// The same, and keeps the energy book ([`Simulated::energy`]).
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
        self.run(conditions, shared, run, resolution, probes, None, true)
    }

    #[allow(clippy::too_many_arguments)] // what simulate, driven and simulate_with_energy share
    fn run(
        &self,
        conditions: &Conditions,
        shared: &[f64],
        run: &RunValues,
        resolution: Resolution,
        probes: &[Probe],
        given_head: Option<HeadInTime>,
        with_energy: bool,
    ) -> Result<Simulated, ModelError> {
        self.check(shared, run)?;
        let flow_m3_s = run.initial_velocity_m_s * self.rig.pipes[self.rig.pipes.len() - 1].area_m2();
        let mut stretches = self.stretches(conditions, shared, run, flow_m3_s);
        let travel_s: Vec<f64> = stretches.iter().map(|s| s.length_m / s.wave_speed_m_s).collect();
        let needed = grid::least_reaches(&travel_s);
        if resolution.reaches < needed {
            return Err(ModelError::TooFewReaches { reaches: resolution.reaches, needed });
        }
        for (chosen, values) in self.chosen(shared) {
            chosen.effect.reshape(values, &mut stretches)?;
        }
        let grid = Grid::new(&stretches, resolution.reaches)?;
        // Two steps more than asked for: the cubic interpolation in time looks that far ahead.
        let beyond_s = self.chosen(shared).map(|(chosen, values)| chosen.effect.beyond_s(values)).fold(0.0, f64::max);
        let steps = ((resolution.duration_s + beyond_s) / grid.dt_s).ceil() as usize + 2;
        let columns = probes.len().max(1) + if with_energy { self.effects.len() + 6 } else { 0 };
        let bytes = steps.saturating_mul(columns).saturating_mul(8);
        if bytes > MOST_HISTORY_BYTES {
            let gib = bytes as f64 / (1u64 << 30) as f64;
            return Err(ModelError::TooLong { steps, sensors: probes.len(), gib });
        }
        let scene = Scene {
            rig: self.rig,
            water: &conditions.water,
            dt_s: grid.dt_s,
            flow_m3_s,
            valve_head_m: run.valve_head_m,
        };
        let (grid, mut joints, mut at_valve, nodes) = self.nodes(grid, shared, &scene)?;
        let frictions = reach_frictions(&grid, flow_m3_s)?;
        let (head_m, flows) = settle(&grid, &frictions, &mut joints, &mut at_valve, flow_m3_s, run.valve_head_m);
        let starts_m = grid.segments.iter().map(|s| s.start_m).collect();
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
        let mut owners = Owners { accounts, nodes, valve_head_m: run.valve_head_m, ..Owners::default() };
        let mut field = None;
        let mut supply = self.base_supply(conditions, steady.head_m[0])?;
        let discharge_head_m = self.rig.valve.discharge_head_m;
        let mut valve = ValveEnd {
            flow_m3_s,
            drop_m: run.valve_head_m - discharge_head_m,
            discharge_head_m,
            closure: (self.closure)(run.closing_time_s),
            law: None,
            residual_opening: 0.0,
            given_head,
        };
        for (account, (chosen, values)) in self.chosen(shared).enumerate() {
            terms.extend(chosen.effect.line_terms(values, &steady)?);
            owners.terms.resize(terms.len(), account);
            if let Some(own) = chosen.effect.field(values, &scene, &steady)? {
                field = Some(own);
                owners.field = Some(account);
            }
            supply = chosen.effect.supply(values, supply)?;
            chosen.effect.valve(values, &mut valve)?;
        }
        let line = Line { steady: &steady, terms, field, supply, joints, at_valve, valve };
        let owners = with_energy.then_some(owners);
        let (traces, energy) = line.run(steps, probes, owners).map_err(|error| self.named(error))?;
        Ok(Simulated { traces, energy, starts_m, flows_m3_s: flows })
    }

    /// What a pressure sensor makes of the head at its place: its own dynamics, then the effects that concern it.
    ///
    /// # Errors
    /// If an effect's value is outside its physical range.
    pub fn sensed(&self, shared: &[f64], sensor: &Sensor, trace: Trace) -> Result<Trace, ModelError> {
        let mut trace = seen_by(sensor, trace);
        let elevation_m = sensor.elevation_m.unwrap_or_else(|| self.rig.elevation_m(sensor.position_m));
        for (chosen, values) in self.chosen(shared) {
            if chosen.sensor.as_ref() == Some(&sensor.name) {
                trace = chosen.effect.sense(values, elevation_m, trace)?;
            }
        }
        Ok(trace)
    }

    /// The effects with their values.
    fn chosen<'s>(&'s self, shared: &'s [f64]) -> impl Iterator<Item = (&'s Chosen, &'s [f64])> {
        let mut at = self.effects_from();
        self.effects.iter().zip(&self.effect_sizes).map(move |(chosen, &size)| {
            let values = &shared[at..at + size];
            at += size;
            (chosen, values)
        })
    }

    fn stretches(&self, conditions: &Conditions, shared: &[f64], run: &RunValues, flow_m3_s: f64) -> Vec<Stretch> {
        // Where some pipes are of a material that creeps, only they do.
        let any_creeps = self.rig.pipes.iter().any(|p| p.material().viscoelastic);
        self.rig
            .pipes
            .iter()
            .zip(shared)
            .map(|(pipe, &wave_speed_m_s)| Stretch {
                creeps: pipe.material().viscoelastic || !any_creeps,
                length_m: pipe.length_m,
                diameter_m: pipe.inner_diameter_m,
                wall_m: pipe.wall_thickness_m,
                wave_speed_m_s,
                constraint: pipe.constraint_coefficient(),
                friction: WallFriction::of(pipe, &conditions.water, flow_m3_s).scaled(run.friction_scale),
            })
            .collect()
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

    /// The error with the model's effects in it.
    fn named(&self, error: ModelError) -> ModelError {
        match error {
            ModelError::NotFinite { time_s, position_m, .. } => {
                let labels: Vec<String> = self.effects.iter().map(Chosen::label).collect();
                let effects = if labels.is_empty() { "no effects".to_owned() } else { labels.join(", ") };
                ModelError::NotFinite { time_s, position_m, effects }
            }
            other => other,
        }
    }

    fn check(&self, shared: &[f64], run: &RunValues) -> Result<(), ModelError> {
        for chosen in &self.effects {
            if let Some(name) = &chosen.sensor
                && !self.rig.pressure_sensors().any(|(_, s)| s.name == *name)
            {
                let known: Vec<&str> = self.rig.pressure_sensors().map(|(_, s)| s.name.as_str()).collect();
                return Err(ModelError::UnknownSensor { name: name.clone(), known: known.join(", ") });
            }
        }
        let positive = |name: &str, value: f64| match value > 0.0 && value.is_finite() {
            true => Ok(()),
            false => Err(ModelError::Value { name: name.to_owned(), value, allowed: "more than zero" }),
        };
        for (parameter, &value) in self.shared.iter().zip(shared).take(self.rig.pipes.len()) {
            positive(&parameter.name, value)?;
        }
        let not_negative = |name: &str, value: f64| match value >= 0.0 && value.is_finite() {
            true => Ok(()),
            false => Err(ModelError::Value { name: name.to_owned(), value, allowed: "zero or more" }),
        };
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

/// Name of the first pressure sensor.
fn first_sensor(rig: &Rig) -> Option<String> {
    rig.pressure_sensors().next().map(|(_, s)| s.name.clone())
}

/// The friction of every segment, checked against what the scheme resolves.
fn reach_frictions(grid: &Grid, flow_m3_s: f64) -> Result<Vec<ReachFriction>, ModelError> {
    let total: usize = grid.segments.iter().map(|s| s.reaches).sum();
    grid.segments
        .iter()
        .map(|segment| {
            let largest_u = 2.0 * segment.impedance * flow_m3_s;
            let laws = segment.parts.iter().map(|(s, _)| &s.friction);
            let friction = ReachFriction::new(laws, |q| segment.reach_loss_m(q), segment.impedance, largest_u);
            let share = friction.largest_share(0.5 * largest_u);
            if share > MOST_FRICTION_SHARE {
                let needed = (total as f64 * share / MOST_FRICTION_SHARE).ceil() as usize;
                return Err(ModelError::FrictionTooCoarse { share, needed });
            }
            Ok(friction)
        })
        .collect()
}
