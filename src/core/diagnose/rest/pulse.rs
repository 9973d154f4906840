//! A short pulse of forcing at one place: what a Green's function is simulated with.
//!
//! It is an effect as those of the catalogue are, but never a candidate: it adds a hat of a given size, time and width to the supply's head, takes it as
//! a flow out of the pipe, or spreads it as a strain along the wall.

use crate::model::boundary::Supply;
use crate::model::contribution::{Implicit, LineTerm};
use crate::model::effects::{Attachment, Chosen, Effect, Element, Place};
use crate::model::error::ModelError;
use crate::model::node::Shunt;
use crate::model::parameter::Parameter;
use crate::model::scene::{Scene, Site};
use crate::model::steady::Steady;

/// Where a pulse acts.
#[derive(Debug, Clone, Copy, PartialEq)]
enum At {
    Supply,
    Valve,
    Pipe,
    Wall,
}

struct Pulse(At);

static AT_SUPPLY: Pulse = Pulse(At::Supply);
static AT_VALVE: Pulse = Pulse(At::Valve);
static ON_PIPE: Pulse = Pulse(At::Pipe);
static IN_WALL: Pulse = Pulse(At::Wall);

/// A hat in time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Hat {
    /// Its greatest value: m at the supply, m³/s out of the pipe, 1 as a strain.
    pub(crate) size: f64,
    /// When it has it, s after the start of the closure.
    pub(crate) at_s: f64,
    /// How long it rises, and falls, s.
    pub(crate) width_s: f64,
}

impl Hat {
    fn value(&self, time_s: f64) -> f64 {
        self.size * (1.0 - (time_s - self.at_s).abs() / self.width_s).max(0.0)
    }
}

/// Head of the supply.
pub(crate) fn at_supply(hat: Hat) -> (Chosen, Vec<f64>) {
    chosen(&AT_SUPPLY, None, hat, 0.0)
}

/// Flow out before the valve.
pub(crate) fn at_valve(hat: Hat) -> (Chosen, Vec<f64>) {
    chosen(&AT_VALVE, None, hat, 0.0)
}

/// Flow out at a position along the line that `pipe` belongs to; that of the valve where none is named.
pub(crate) fn on_pipe(hat: Hat, pipe: Option<String>, position_m: f64) -> (Chosen, Vec<f64>) {
    chosen(&ON_PIPE, pipe, hat, position_m)
}

/// Strain of the wall of the line that ends at the valve, in the shape of the line's own mode `mode` of oscillation.
pub(crate) fn in_wall(hat: Hat, mode: usize) -> (Chosen, Vec<f64>) {
    chosen(&IN_WALL, None, hat, mode as f64)
}

fn chosen(effect: &'static Pulse, pipe: Option<String>, hat: Hat, place: f64) -> (Chosen, Vec<f64>) {
    let chosen = Chosen { effect, elements: None, sensor: None, pipe };
    (chosen, vec![hat.size, hat.at_s, hat.width_s, place])
}

fn hat_of(values: &[f64]) -> Hat {
    Hat { size: values[0], at_s: values[1], width_s: values[2] }
}

impl Effect for Pulse {
    fn name(&self) -> &'static str {
        "pulse"
    }
    fn summary(&self) -> &'static str {
        "a pulse of forcing"
    }
    fn equation(&self) -> &'static str {
        "f(t) = size (1 - |t - at|/width)"
    }
    fn source(&self) -> &'static str {
        "the hat function of linear finite elements"
    }
    fn trace(&self) -> &'static str {
        "the Green's function of its place"
    }
    fn on_pipe(&self) -> bool {
        self.0 == At::Pipe
    }
    fn at_supply(&self) -> bool {
        self.0 == At::Supply
    }
    fn parameters(&self, _site: &Site, _elements: usize) -> Vec<Parameter> {
        let one = |name: &str| Parameter::linear(name, "1", "of a pulse", 0.0, f64::NEG_INFINITY, f64::INFINITY);
        ["pulse_size", "pulse_at_s", "pulse_width_s", "pulse_place"].map(one).to_vec()
    }
    fn supply(&self, values: &[f64], supply: Box<dyn Supply>) -> Result<Box<dyn Supply>, ModelError> {
        Ok(match self.0 {
            At::Supply => Box::new(Raised { supply, hat: hat_of(values) }),
            _ => supply,
        })
    }
    fn attachments<'a>(&self, values: &'a [f64], scene: &'a Scene) -> Result<Vec<Attachment<'a>>, ModelError> {
        let place = match self.0 {
            At::Valve => Place::Valve,
            At::Pipe => Place::At(values[3]),
            At::Supply | At::Wall => return Ok(Vec::new()),
        };
        let (hat, dt_s) = (hat_of(values), scene.dt_s);
        Ok(vec![Attachment {
            place,
            make: Box::new(move |_| Element::Shunt(Box::new(Drawn { hat, dt_s, step: 0.0 }))),
        }])
    }
    fn line_terms(&self, values: &[f64], steady: &Steady) -> Result<Vec<Box<dyn LineTerm>>, ModelError> {
        if self.0 != At::Wall {
            return Ok(Vec::new());
        }
        let grid = steady.grid;
        let line = grid.segments.iter().map(|s| s.line).next_back().unwrap_or(0);
        let own = || grid.segments.iter().filter(|s| s.line == line);
        let length_m = own().map(|s| s.end_m()).fold(0.0, f64::max);
        let mut weight_m = vec![0.0; grid.nodes()];
        for segment in own() {
            for (i, node) in segment.nodes().enumerate() {
                let x = (segment.start_m + i as f64 * segment.reach_m) / length_m;
                let shape = ((2.0 * values[3] + 1.0) * 0.5 * std::f64::consts::PI * x).sin();
                // ½ B (2 A dx) ε': half of the storage flow of a reach, as a head.
                weight_m[node] = segment.impedance * segment.reach_m * segment.mean(|s| s.area_m2()) * shape;
            }
        }
        Ok(vec![Box::new(Strained { hat: hat_of(values), dt_s: grid.dt_s, step: 0.0, weight_m })])
    }
}

/// Adds the hat to another supply.
struct Raised {
    supply: Box<dyn Supply>,
    hat: Hat,
}

impl Supply for Raised {
    fn head_m(&mut self, time_s: f64) -> f64 {
        self.supply.head_m(time_s) + self.hat.value(time_s)
    }
}

/// Takes the hat out as a flow, whatever the head.
struct Drawn {
    hat: Hat,
    dt_s: f64,
    step: f64,
}

impl Shunt for Drawn {
    fn settle(&mut self, _head_m: f64) -> f64 {
        0.0
    }
    fn outflow(&self, _head_m: f64) -> (f64, f64) {
        (self.hat.value((self.step + 1.0) * self.dt_s), 0.0)
    }
    fn advance(&mut self, _head_m: f64) {
        self.step += 1.0;
    }
}

/// The hat as a strain, spread over nodes by their weights.
struct Strained {
    hat: Hat,
    dt_s: f64,
    step: f64,
    weight_m: Vec<f64>,
}

impl LineTerm for Strained {
    fn implicit(&self, _segment: usize) -> Implicit {
        Implicit::default()
    }
    fn advance(&mut self, _h: &[f64], _u: &[f64], storage: &mut [f64], _momentum: &mut [f64]) {
        // What is added here belongs to the step after this one.
        self.step += 1.0;
        let time_s = (self.step + 1.0) * self.dt_s;
        let rate_per_s = (self.hat.value(time_s) - self.hat.value(time_s - self.dt_s)) / self.dt_s;
        storage.iter_mut().zip(&self.weight_m).for_each(|(b, w)| *b -= w * rate_per_s);
    }
}
