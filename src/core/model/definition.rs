//! The model of a rig: base model and effects, and their parameters with starts, bounds and priors.

use std::ops::Range;

use crate::model::boundary::Closure;
use crate::model::chosen::Chosen;
use crate::model::constraint::{Constraint, Given};
use crate::model::error::ModelError;
use crate::model::other_valves::{self, OwnClosing};
use crate::model::own::compiled;
use crate::model::parameter::Parameter;
use crate::model::prior::Prior;
use crate::model::reaches::Travel;
use crate::model::run::{LEAST_DROP_M, RunValues};
use crate::model::scene::Site;
use crate::model::sensor::seen_by;
use crate::model::trace::Trace;
use crate::rig::{Rig, Sensor, WaterProperties};

/// A model: a rig, the effects added to the base model, and its parameters.
#[derive(Debug, Clone)]
pub struct Model<'a> {
    /// The rig.
    pub rig: &'a Rig,
    /// Effects, each with its number of elements decided.
    pub effects: Vec<Chosen>,
    /// How many of the shared parameters belong to each effect.
    effect_sizes: Vec<usize>,
    /// Parameters shared by all runs on the rig: wave speeds, valves that close beside the first, effects.
    pub shared: Vec<Parameter>,
    /// Parameters of one run: velocity, head, closing time, friction.
    pub per_run: [Parameter; RunValues::COUNT],
    /// Form of the first valve's closure, as a function of the run's closing time.
    pub closure: fn(f64) -> Closure,
    /// Constraints on parameters, those of runs and sensors included.
    pub constraints: Vec<Constraint>,
    /// Start values that the user gave.
    pub starts: Vec<Given>,
    /// Priors of shared parameters, from other sources.
    pub priors: Vec<Prior>,
    /// The most memory that a simulation may take, bytes.
    pub memory_limit_bytes: f64,
}

impl<'a> Model<'a> {
    /// The base model of a rig with effects added; `water` and the rig give parameters their starts and bounds.
    pub fn new(rig: &'a Rig, water: &WaterProperties, effects: &[Chosen]) -> Model<'a> {
        let mut shared: Vec<Parameter> = Vec::new();
        for pipe in &rig.pipes {
            let (start, lower, upper) = pipe.wave_speed_start(water);
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
        let travel_s: f64 = rig.way().map(|i| rig.pipes[i].length_m / shared[i].start).sum();
        let site = Site { rig, water, period_s: 4.0 * travel_s, line: 0 };
        shared.extend(other_valves::parameters(rig, site.period_s));
        let effects: Vec<Chosen> = effects
            .iter()
            .map(|c| Chosen {
                // Another rig may have another effect of that name.
                effect: match rig.own_effects.get(c.effect.name()).map(|text| compiled(c.effect.name(), text)) {
                    Some(Ok(own)) => own,
                    _ => c.effect,
                },
                elements: c.elements.or(c.effect.elements().map(|r| *r.start())),
                sensor: c.sensor.clone().or_else(|| first_sensor(rig).filter(|_| c.effect.at_sensor())),
                ..c.clone()
            })
            .collect();
        let mut effect_sizes = Vec::new();
        for chosen in &effects {
            let site = Site { line: chosen.line(rig), ..site };
            let mut parameters = chosen.effect.parameters(&site, chosen.elements.unwrap_or(1));
            // Files of one's own may use one name each for its own parameter.
            for parameter in &mut parameters {
                if shared.iter().any(|p| p.name == parameter.name) {
                    parameter.name = format!("{}[{}]", parameter.name, chosen.effect.name());
                }
            }
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
            // A run's own parameter: the factor depends on its flow and temperature.
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
            starts: Vec::new(),
            priors: Vec::new(),
            memory_limit_bytes: crate::model::memory::USUAL_LIMIT_BYTES,
        }
    }

    /// Holds parameters or gives them other bounds.
    pub fn constrained(self, constraints: &[Constraint]) -> Self {
        Model { constraints: constraints.to_vec(), ..self }
    }

    /// Sets start values.
    pub fn starting_at(self, starts: &[Given]) -> Self {
        Model { starts: starts.to_vec(), ..self }
    }

    /// Sets priors of shared parameters; those of parameters that the model lacks are ignored.
    pub fn informed(mut self, priors: &[Prior]) -> Self {
        for prior in priors {
            self.shared.iter_mut().filter(|p| p.name == prior.name).for_each(|p| prior.inform(p));
        }
        Model { priors: priors.to_vec(), ..self }
    }

    /// Index of the first effect's first parameter among the shared ones.
    pub fn effects_from(&self) -> usize {
        self.rig.pipes.len() + other_valves::count(self.rig)
    }

    /// How the valves beside the first close, in the order of the graph's nodes.
    pub(crate) fn closings(&self, shared: &[f64]) -> impl Iterator<Item = OwnClosing> {
        other_valves::closings(shared.get(self.rig.pipes.len()..self.effects_from()).unwrap_or_default())
    }

    /// How many shared parameters each effect has.
    pub fn effect_sizes(&self) -> &[usize] {
        &self.effect_sizes
    }

    /// Where the parameters of effect `i` are among the shared ones.
    pub fn parameters_of(&self, i: usize) -> Range<usize> {
        let from = self.effects_from() + self.effect_sizes[..i].iter().sum::<usize>();
        from..from + self.effect_sizes[i]
    }

    /// Puts the values of each effect in their conventional order.
    pub fn put_in_order(&self, values: &mut [f64]) {
        let mut at = self.effects_from();
        for (chosen, &size) in self.effects.iter().zip(&self.effect_sizes) {
            chosen.effect.put_in_order(&mut values[at..at + size]);
            at += size;
        }
    }

    /// Theoretical period `4L/a` for shared parameter values, s.
    pub fn period_s(&self, shared: &[f64]) -> f64 {
        4.0 * self.rig.way().map(|i| self.rig.pipes[i].length_m / shared[i]).sum::<f64>()
    }

    /// Fewest reaches for the pipes, with a margin of a fifth for their wave speeds, and for the effects.
    pub fn least_reaches(&self, shared: &[f64]) -> usize {
        let margin = if self.rig.pipes.len() > 1 { 1.2 } else { 1.0 };
        let pipes = (margin * self.pipes_travel_s(shared).least_reaches() as f64).ceil() as usize;
        pipes.max(self.effects_reaches(shared))
    }

    /// Fewest reaches at which every pipe has as many steps as the effects ask for.
    pub fn effects_reaches(&self, shared: &[f64]) -> usize {
        let way_s = self.pipes_travel_s(shared).way_s();
        let pipes = || self.rig.pipes.iter().zip(shared);
        let needed = self.chosen(shared).flat_map(|(chosen, values)| {
            pipes().map(move |(pipe, &wave_speed_m_s)| {
                let steps = chosen.effect.least_steps(values, self.rig, pipe, wave_speed_m_s);
                (steps, pipe.length_m / wave_speed_m_s)
            })
        });
        let needed = needed.filter(|(steps, _)| *steps > 1.0).map(|(steps, travel_s)| steps * way_s / travel_s);
        needed.fold(1.0, f64::max).ceil() as usize
    }

    /// Number of reaches, at least `reaches`, that fits the pipes' joints best.
    pub fn fitting_reaches(&self, shared: &[f64], reaches: usize) -> usize {
        self.pipes_travel_s(shared).fitting_reaches(reaches)
    }

    /// Travel times of a wave through the pipes.
    pub fn pipes_travel_s(&self, shared: &[f64]) -> Travel {
        let pipe = |i: usize| self.rig.pipes[i].length_m / shared[i];
        let lines_s = self.rig.graph.lines.iter().map(|line| line.pipes.clone().map(pipe).collect()).collect();
        Travel { lines_s, way: self.rig.graph.way.iter().map(|(line, _)| *line).collect() }
    }

    /// The reading of a pressure sensor from the head at its place: its own dynamics, then the effects that concern it.
    ///
    /// # Errors
    /// If an effect's value is outside its physical range.
    pub fn sensed(&self, shared: &[f64], sensor: &Sensor, trace: Trace) -> Result<Trace, ModelError> {
        let mut trace = seen_by(sensor, trace);
        let elevation_m = self.rig.sensor_elevation_m(sensor);
        for (chosen, values) in self.chosen(shared) {
            if chosen.sensor.as_ref() == Some(&sensor.name) {
                trace = chosen.effect.sense(values, elevation_m, trace)?;
            }
        }
        Ok(trace)
    }

    /// How much longer than the record a simulation must be, for what sensors show late, s.
    pub(crate) fn beyond_s(&self, shared: &[f64]) -> f64 {
        self.chosen(shared).map(|(chosen, values)| chosen.effect.beyond_s(values)).fold(0.0, f64::max)
    }

    /// The effects with their values.
    pub(crate) fn chosen<'s>(&'s self, shared: &'s [f64]) -> impl Iterator<Item = (&'s Chosen, &'s [f64])> {
        let mut at = self.effects_from();
        self.effects.iter().zip(&self.effect_sizes).map(move |(chosen, &size)| {
            let values = &shared[at..at + size];
            at += size;
            (chosen, values)
        })
    }
}

/// Name of the first pressure sensor.
fn first_sensor(rig: &Rig) -> Option<String> {
    rig.pressure_sensors().next().map(|(_, s)| s.name.clone())
}

/// Refuses effects at sensors, on pipes, at valves or at a supply that a rig does not have.
///
/// # Errors
/// [`ModelError::UnknownSensor`], [`ModelError::UnknownPipe`], [`ModelError::UnknownValve`], [`ModelError::WhichValve`]
/// or [`ModelError::NoReservoir`] for the first of them.
pub fn check_places(rig: &Rig, effects: &[Chosen]) -> Result<(), ModelError> {
    let pipes: Vec<&str> = match rig.graph.lines.len() {
        1 => Vec::new(),
        _ => rig.pipes.iter().map(|p| p.name.as_str()).collect(),
    };
    if let Some(name) = effects.iter().filter_map(|c| c.pipe.as_ref()).find(|name| !pipes.contains(&name.as_str())) {
        return Err(ModelError::UnknownPipe { name: name.clone(), known: pipes.join(", ") });
    }
    let own = |c: &&Chosen| c.effect.is_own() && !rig.own_effects.contains_key(c.effect.name());
    if let Some(chosen) = effects.iter().find(own) {
        return Err(ModelError::OfAnotherRig { name: chosen.effect.name().to_owned(), rig: rig.name.clone() });
    }
    let supply = &rig.graph.nodes[rig.graph.supply()];
    if let (Some(chosen), false) = (effects.iter().find(|c| c.effect.at_supply()), supply.kind.holds_given_head()) {
        return Err(ModelError::NoReservoir { effect: chosen.label(), node: supply.name.clone() });
    }
    let valves = rig.graph.closing_valves();
    for chosen in effects.iter().filter(|c| c.effect.at_valve()) {
        let (effect, known) = (chosen.effect.name().to_owned(), valves.join(", "));
        match &chosen.valve {
            None if valves.len() > 1 => {
                return Err(ModelError::WhichValve { effect, first: valves[0].to_owned(), known });
            }
            Some(name) if !valves.contains(&name.as_str()) => {
                return Err(ModelError::UnknownValve { name: name.clone(), known });
            }
            _ => {}
        }
    }
    let known: Vec<&str> = rig.pressure_sensors().map(|(_, s)| s.name.as_str()).collect();
    match effects.iter().filter_map(|c| c.sensor.as_ref()).find(|name| !known.contains(&name.as_str())) {
        None => Ok(()),
        Some(name) => Err(ModelError::UnknownSensor { name: name.clone(), known: known.join(", ") }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::effects::parse_list;

    /// A reservoir's head may drift; what a tank or a pump does, its own law says.
    #[test]
    fn an_effect_at_the_supply_needs_a_reservoir() {
        let branched = include_str!("../../../rigs/branched.toml");
        let tank = branched.replace("kind = \"reservoir\"", "kind = \"tank\"\nhead_m = 40.0\narea_m2 = 1.0");
        let check = |rig: &str, effects: &str| {
            let rig = Rig::from_toml(rig, "rig.toml").unwrap();
            let refused = check_places(&rig, &parse_list(effects).unwrap());
            (refused, parse_list(effects).unwrap()[0].effect.impossible(&rig).is_some())
        };
        assert_eq!(check(branched, "supply-drift"), (Ok(()), false));
        assert_eq!(check(&tank, "leak"), (Ok(()), false));
        let (refused, impossible) = check(&tank, "supply-drift,leak");
        let said = refused.unwrap_err().to_string();
        assert!(impossible && said.contains("'supply-drift'") && said.contains("'tank'"), "{said}");
    }
}
