//! A run that is only simulated: a rig, effects and settings by name, as `simulate` and `record --simulate` take them.

use std::error::Error;

use crate::model::boundary::Closure;
use crate::model::effects::{Chosen, Effect, Site, catalogue_of, pipe_is_no_setting};
use crate::model::energy::Energy;
use crate::model::friction::WallFriction;
use crate::model::line_flows::{line_flows, way_loss_m};
use crate::model::parameter::Parameter;
use crate::model::trace::{Probe, Trace};
use crate::model::{Conditions, Model, ModelError, Resolution, RunValues, Simulated};
use crate::rig::{Coupling, Rig, Sensor, Upstream, WaterProperties};
use crate::units::GRAVITY_M_S2;

type AnyError = Box<dyn Error + Send + Sync>;

/// Reaches unless `reaches` is set.
const REACHES: usize = 240;
/// Velocity where neither a setting nor a `[[steady]]` table of the rig gives one, m/s.
const VELOCITY_M_S: f64 = 1.0;
/// Head at the supply where nothing gives one, m.
const SUPPLY_HEAD_M: f64 = 30.0;

/// Of more values of one name the list shows only the least and the largest.
const MOST_TOLD: usize = 6;

/// Names less alike than this (Jaro-Winkler) are no slips of one another.
const ALIKE: f64 = 0.75;

/// Form of the closure, as on the command line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum ValveForm {
    /// An orifice whose opening falls linearly.
    Linear,
    /// The flow falls along half a period of a raised cosine, whatever the head.
    FlowRamp,
    /// The flow falls along a cycloid (no jump of acceleration), whatever the head.
    FlowCycloid,
}

impl ValveForm {
    fn closure(self) -> fn(f64) -> Closure {
        match self {
            ValveForm::Linear => |closing_time_s| Closure::Linear { closing_time_s },
            ValveForm::FlowRamp => |closing_time_s| Closure::FlowRamp { closing_time_s },
            ValveForm::FlowCycloid => |closing_time_s| Closure::FlowCycloid { closing_time_s },
        }
    }
}

/// See the module.
pub struct Scenario {
    /// The rig, with the settings that concern it.
    pub rig: Rig,
    /// Its water.
    pub water: WaterProperties,
    /// Effects with their numbers of elements decided.
    pub effects: Vec<Chosen>,
    /// Closure.
    pub valve: ValveForm,
    /// Values of the shared parameters.
    pub shared: Vec<f64>,
    /// Values of the run.
    pub run: RunValues,
    /// Reaches of the grid.
    pub reaches: usize,
}

impl Scenario {
    /// A scenario from settings by name; what is not set has the rig's value or a default.
    ///
    /// # Errors
    /// A setting that no parameter has (the nearest is named), one given twice, values out of range.
    pub fn new(
        mut rig: Rig,
        effects: &[Chosen],
        valve: ValveForm,
        settings: &[(String, f64)],
    ) -> Result<Scenario, AnyError> {
        if let Some((twice, _)) =
            settings.iter().enumerate().find_map(|(i, s)| settings[..i].iter().find(|t| t.0 == s.0))
        {
            return Err(format!("'{twice}' is set twice").into());
        }
        if rig.upstream == Upstream::Measured {
            return Err("the rig's upstream end is 'measured': without a recording nothing drives it; use kind = \
                        \"reservoir\" to simulate"
                .into());
        }
        let water = rig.fluid.properties(rig.fluid.temperature_degc);
        let effects: Vec<Chosen> = effects.iter().map(|c| with_elements_set(c, settings)).collect();
        let get = |name: &str| settings.iter().find(|(n, _)| n == name).map(|(_, v)| *v);
        if let Some(factor) = get("friction_factor") {
            if factor < 0.0 {
                return Err(format!("friction_factor = {factor} must not be negative").into());
            }
            rig.pipes.iter_mut().for_each(|p| p.friction_factor = Some(factor));
        }
        let model = Model::new(&rig, &water, &effects);
        check_names(&model, &water, settings)?;
        let shared: Vec<f64> = model
            .shared
            .iter()
            .map(|p| {
                let of_all = p.name.starts_with("wave_speed_m_s[").then(|| get("wave_speed_m_s")).flatten();
                get(&p.name).or(of_all).unwrap_or(p.start)
            })
            .collect();
        let reaches = match get("reaches") {
            // A network may have pipes that so few would not resolve.
            None => REACHES.max(model.pipes_travel_s(&shared).least_reaches()).max(model.effects_reaches(&shared)),
            Some(n) if n >= 2.0 && n.fract() == 0.0 && n <= 1e7 => n as usize,
            Some(n) => return Err(format!("reaches = {n} must be a whole number from 2 to 10000000").into()),
        };
        let reaches = model.fitting_reaches(&shared, reaches);
        let steady = rig.steady.first();
        let area = rig.pipe_at_valve().area_m2();
        let steady_velocity = steady.map(|s| s.flow_m3_s / area);
        let velocity = get("initial_velocity_m_s").or(steady_velocity).unwrap_or(VELOCITY_M_S);
        let friction_scale = get("friction_scale").unwrap_or(1.0);
        let supply_head = steady.and_then(|s| s.supply_head_m).unwrap_or(SUPPLY_HEAD_M);
        let valve_head = if let Some(head) = get("valve_head_m") {
            head
        } else {
            let lost = way_loss_m(&rig, &water, velocity * area)? * friction_scale;
            if valve == ValveForm::Linear && supply_head - lost <= rig.valve.discharge_head_m {
                return Err(format!(
                    "at {velocity:.3} m/s the pipe loses {lost:.1} m of the supply's {supply_head:.1} m before the valve: nothing would flow; set a \
                     smaller initial_velocity_m_s, or valve_head_m"
                )
                .into());
            }
            supply_head - lost
        };
        let run = RunValues {
            initial_velocity_m_s: velocity,
            valve_head_m: valve_head,
            closing_time_s: get("closing_time_s").unwrap_or(rig.valve.closing_time_s),
            friction_scale,
        };
        Ok(Scenario { water, effects, valve, shared, run, reaches, rig })
    }

    /// The same on the same rig with other wiring.
    pub fn on(&self, rig: Rig) -> Scenario {
        Scenario { rig, effects: self.effects.clone(), shared: self.shared.clone(), ..*self }
    }

    /// The model of it.
    pub fn model(&self) -> Model<'_> {
        let mut model = Model::new(&self.rig, &self.water, &self.effects);
        model.closure = self.valve.closure();
        model.memory_limit_bytes = crate::simulate::memory::limit_bytes();
        model
    }

    /// Every setting with its value, for people and JSON.
    pub fn values(&self) -> Vec<(String, f64)> {
        let model = self.model();
        let run =
            [self.run.initial_velocity_m_s, self.run.valve_head_m, self.run.closing_time_s, self.run.friction_scale];
        let named = |p: &Parameter, v: f64| (p.name.clone(), v);
        let shared = model.shared.iter().zip(&self.shared).map(|(p, &v)| named(p, v));
        shared.chain(model.per_run.iter().zip(run).map(|(p, v)| named(p, v))).collect()
    }

    /// Values that were used without being set: parameters, friction factors at the initial flow, with `friction_scale`
    /// in them, and the grid.
    pub fn not_set(&self, settings: &[(String, f64)]) -> Vec<(String, f64)> {
        let set = |name: &str| {
            let group = name.split('[').next().unwrap_or(name);
            settings.iter().any(|(n, _)| n == name || n == group)
        };
        let mut used = self.values();
        used.retain(|(name, _)| name != "friction_scale");
        let valve_m3_s = self.run.initial_velocity_m_s * self.rig.pipe_at_valve().area_m2();
        // Where nothing flows there is no friction factor.
        let flows = line_flows(&self.rig, &self.water, valve_m3_s, self.run.friction_scale).unwrap_or_default();
        for (flow_m3_s, line) in flows.into_iter().zip(&self.rig.graph.lines) {
            for pipe in &self.rig.pipes[line.pipes.clone()] {
                let velocity = flow_m3_s / pipe.area_m2();
                let slope = WallFriction::of(pipe, &self.water, flow_m3_s)
                    .scaled(self.run.friction_scale)
                    .slope(pipe.inner_diameter_m, flow_m3_s);
                let factor = slope * 2.0 * GRAVITY_M_S2 * pipe.inner_diameter_m / (velocity * velocity.abs());
                let several = if self.rig.pipes.len() > 1 { format!("[{}]", pipe.name) } else { String::new() };
                used.push((format!("friction_factor{several}"), factor));
            }
        }
        used.push(("reaches".to_owned(), self.reaches as f64));
        used.retain(|(name, value)| value.is_finite() && !set(name));
        in_short(&used)
    }

    /// Theoretical period `4L/a`, s.
    pub fn period_s(&self) -> f64 {
        self.model().period_s(&self.shared)
    }

    /// The head at each pressure sensor, as the sensor shows it, in time after the start of the closure.
    ///
    /// # Errors
    /// As [`Model::simulate`].
    pub fn simulate(&self, duration_s: f64) -> Result<Vec<Trace>, ModelError> {
        Ok(self.simulate_with(duration_s, false)?.0)
    }

    /// The same and, if asked for, where the energy went.
    ///
    /// # Errors
    /// As [`Model::simulate`].
    pub fn simulate_with(&self, duration_s: f64, energy: bool) -> Result<(Vec<Trace>, Option<Energy>), ModelError> {
        let probes: Vec<Probe> = self.rig.pressure_sensors().map(|(_, s)| Probe::head(s.place())).collect();
        let simulated = self.run_model(&probes, duration_s, energy)?;
        let model = self.model();
        let sensors = self.rig.pressure_sensors().zip(simulated.traces);
        let seen = sensors.map(|((_, sensor), trace)| model.sensed(&self.shared, sensor, trace));
        Ok((seen.collect::<Result<_, _>>()?, simulated.energy))
    }

    /// What probes read, in time after the start of the closure.
    ///
    /// # Errors
    /// As [`Model::simulate`].
    pub fn probe(&self, probes: &[Probe], duration_s: f64) -> Result<Vec<Trace>, ModelError> {
        Ok(self.run_model(probes, duration_s, false)?.traces)
    }

    fn run_model(&self, probes: &[Probe], duration_s: f64, energy: bool) -> Result<Simulated, ModelError> {
        let conditions = Conditions::of(self.water);
        let resolution = Resolution { reaches: self.reaches, duration_s };
        let model = self.model();
        let needed = model.resolving_reaches(&conditions, &self.shared, &self.run)?;
        if self.reaches < needed {
            return Err(ModelError::TooFewReaches { reaches: self.reaches, needed });
        }
        let simulate = if energy { Model::simulate_with_energy } else { Model::simulate };
        simulate(&model, &conditions, &self.shared, &self.run, resolution, probes)
    }

    /// A head at a sensor in the sensor's unit.
    pub fn displayed(&self, sensor: usize, head_m: f64) -> f64 {
        displayed(&self.rig, &self.rig.sensors[sensor], self.water.density_kg_m3, head_m)
    }
}

/// Values of one name that differ by what stands in brackets: one where they are alike, the least and the largest of
/// many.
fn in_short(used: &[(String, f64)]) -> Vec<(String, f64)> {
    let group = |(name, _): &(String, f64)| name.split('[').next().unwrap_or(name).to_owned();
    let mut short = Vec::new();
    for own in used.chunk_by(|a, b| group(a) == group(b)) {
        let by_value = |a: &&(String, f64), b: &&(String, f64)| a.1.total_cmp(&b.1);
        let (Some(least), Some(most)) = (own.iter().min_by(by_value), own.iter().max_by(by_value)) else { continue };
        if own.len() > 1 && (most.1 - least.1).abs() <= 1e-6 * most.1.abs() {
            short.push((group(least), least.1));
        } else if own.len() > MOST_TOLD {
            short.extend([(format!("{}(least)", least.0), least.1), (format!("{}(largest)", most.0), most.1)]);
        } else {
            short.extend_from_slice(own);
        }
    }
    short
}

/// A head at a sensor in the sensor's unit.
pub fn displayed(rig: &Rig, sensor: &Sensor, density_kg_m3: f64, head_m: f64) -> f64 {
    // A sensor that sees no steady pressure sees no elevation.
    let elevation_m = match sensor.coupling {
        Coupling::Dc => rig.sensor_elevation_m(sensor),
        Coupling::Ac => 0.0,
    };
    sensor.unit.from_si((head_m - elevation_m) * density_kg_m3 * GRAVITY_M_S2, density_kg_m3)
}

/// The number of elements that settings like `tau3_s` ask for, where the list of effects leaves it open.
fn with_elements_set(chosen: &Chosen, settings: &[(String, f64)]) -> Chosen {
    let (None, Some(range)) = (chosen.elements, chosen.effect.elements()) else { return chosen.clone() };
    let site_free_number = |name: &str| {
        let digits: String =
            name.chars().skip_while(|c| !c.is_ascii_digit()).take_while(char::is_ascii_digit).collect();
        digits.parse::<usize>().ok()
    };
    let asked = settings
        .iter()
        .filter(|(n, _)| n.starts_with('J') || n.starts_with("tau"))
        .filter_map(|(n, _)| site_free_number(n));
    chosen.with_elements(asked.max().unwrap_or(*range.start()).clamp(*range.start(), *range.end()))
}

/// Refuses a setting that the model does not have, and says where it belongs.
fn check_names(model: &Model, water: &WaterProperties, settings: &[(String, f64)]) -> Result<(), AnyError> {
    let mut known: Vec<String> = model.shared.iter().chain(&model.per_run).map(|p| p.name.clone()).collect();
    known.extend(["friction_factor", "reaches", "wave_speed_m_s"].map(String::from));
    known.sort();
    known.dedup();
    let Some((name, _)) = settings.iter().find(|(name, _)| !known.contains(name)) else { return Ok(()) };
    let likeness = |k: &String| strsim::jaro_winkler(name, k);
    let nearest = known.iter().max_by(|a, b| likeness(a).total_cmp(&likeness(b))).filter(|k| likeness(k) >= ALIKE);
    let hint = if name == "closure_start_s" {
        "it is a time on a recording's clock, but here time 0 is the start of the closure: leave it out".to_owned()
    } else if name == "offset_m" || name.starts_with("offset_m[") {
        "it belongs to recorded sensors; simulated ones have no offset: leave it out".to_owned()
    } else if let Some(why) = pipe_is_no_setting(name) {
        why
    } else if let Some((effect, elements)) = owner(name, model, water) {
        let label =
            if effect.elements().is_some() { format!("{}:{elements}", effect.name()) } else { effect.name().into() };
        match model.effects.iter().find(|c| c.effect.name() == effect.name()) {
            Some(chosen) => format!("it needs the effect '{label}', and this model has '{}'", chosen.label()),
            None => format!("it belongs to the effect '{}': add option `effects {label}`", effect.name()),
        }
    } else if let Some(nearest) = nearest {
        format!("did you mean '{nearest}'? This model has {}", known.join(", "))
    } else {
        format!("this model has {}", known.join(", "))
    };
    Err(format!("unknown setting '{name}'; {hint}").into())
}

/// The effect of the catalogue that has a parameter of this name, and its least number of elements with it.
fn owner(name: &str, model: &Model, water: &WaterProperties) -> Option<(&'static dyn Effect, usize)> {
    let site =
        Site { rig: model.rig, water, period_s: model.period_s(&starts(model)), line: model.rig.graph.line_to_valve() };
    let all = catalogue_of(model.rig).into_iter().flat_map(|e| std::iter::once(e).chain(e.variants().iter().copied()));
    all.filter_map(|effect| {
        let mut elements = effect.elements().unwrap_or(1..=1);
        let elements = elements.find(|&n| effect.parameters(&site, n).iter().any(|p| p.name == name))?;
        Some((effect, elements))
    })
    .next()
}

fn starts(model: &Model) -> Vec<f64> {
    model.shared.iter().map(|p| p.start).collect()
}
