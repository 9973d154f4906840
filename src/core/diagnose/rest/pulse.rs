//! A forcing at one place, and a short pulse of it: what a Green's function is simulated with.
//!
//! It is an effect as those of the catalogue are, but never a candidate: it adds cubic B-splines of given sizes and
//! times to the supply's head, takes them as a flow out of the pipe, or spreads them as a strain along the wall. One
//! spline is a pulse; a sum of them is a forcing.

use crate::model::boundary::Supply;
use crate::model::contribution::{Implicit, LineTerm};
use crate::model::effects::{Attachment, Chosen, Effect, Element, Place};
use crate::model::error::ModelError;
use crate::model::node::Shunt;
use crate::model::parameter::Parameter;
use crate::model::scene::{Scene, Site};
use crate::model::steady::Steady;

/// Where it acts.
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

/// A sum of cubic B-splines in time, at even knots: a smooth curve (de Boor 1978, A Practical Guide to Splines).
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Curve {
    /// Their coefficients: m at the supply, m³/s out of the pipe, 1 as a strain.
    pub(crate) sizes: Vec<f64>,
    /// Middle of the first, s after the start of the closure.
    pub(crate) first_s: f64,
    /// Distance of knots, s; each spans four.
    pub(crate) width_s: f64,
}

/// Knots from a spline's middle to its ends.
pub(crate) const REACH: usize = 2;

/// The spline of size 1 at a distance of `u` knots from its middle.
pub(crate) fn spline(u: f64) -> f64 {
    let u = u.abs();
    if u < 1.0 { (4.0 - 6.0 * u * u + 3.0 * u.powi(3)) / 6.0 } else { (2.0 - u).max(0.0).powi(3) / 6.0 }
}

impl Curve {
    fn value(&self, time_s: f64) -> f64 {
        let at = (time_s - self.first_s) / self.width_s;
        let first = (at.floor() - 1.0).max(0.0) as usize;
        let near = self.sizes.iter().enumerate().skip(first).take(2 * REACH);
        near.map(|(k, size)| size * spline(at - k as f64)).sum()
    }
}

/// Head of the supply.
pub(crate) fn at_supply(curve: Curve) -> (Chosen, Vec<f64>) {
    chosen(&AT_SUPPLY, None, curve, 0.0)
}

/// Flow out before the valve.
pub(crate) fn at_valve(curve: Curve) -> (Chosen, Vec<f64>) {
    chosen(&AT_VALVE, None, curve, 0.0)
}

/// Flow out at a position along the line that `pipe` belongs to; that of the valve where none is named.
pub(crate) fn on_pipe(curve: Curve, pipe: Option<String>, position_m: f64) -> (Chosen, Vec<f64>) {
    chosen(&ON_PIPE, pipe, curve, position_m)
}

/// Strain of the wall of the line that ends at the valve, in the shape of the line's own mode `mode` of oscillation.
pub(crate) fn in_wall(curve: Curve, mode: usize) -> (Chosen, Vec<f64>) {
    chosen(&IN_WALL, None, curve, mode as f64)
}

fn chosen(effect: &'static Pulse, pipe: Option<String>, curve: Curve, place: f64) -> (Chosen, Vec<f64>) {
    let chosen = Chosen { effect, elements: Some(curve.sizes.len()), sensor: None, pipe, valve: None };
    (chosen, [vec![curve.first_s, curve.width_s, place], curve.sizes].concat())
}

fn curve_of(values: &[f64]) -> Curve {
    Curve { first_s: values[0], width_s: values[1], sizes: values[3..].to_vec() }
}

impl Effect for Pulse {
    fn name(&self) -> &'static str {
        "pulse"
    }
    fn summary(&self) -> &'static str {
        "a pulse of forcing"
    }
    fn equation(&self) -> &'static str {
        "f(t) = size B3((t - at)/width)"
    }
    fn source(&self) -> &'static str {
        "de Boor (1978), A Practical Guide to Splines"
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
    fn parameters(&self, _site: &Site, elements: usize) -> Vec<Parameter> {
        let one = |name: String| Parameter::linear(name, "1", "of a pulse", 0.0, f64::NEG_INFINITY, f64::INFINITY);
        let sizes = (1..=elements).map(|k| format!("pulse_size{k}"));
        ["pulse_first_s", "pulse_width_s", "pulse_place"].map(String::from).into_iter().chain(sizes).map(one).collect()
    }
    fn supply(&self, values: &[f64], supply: Box<dyn Supply>) -> Result<Box<dyn Supply>, ModelError> {
        Ok(match self.0 {
            At::Supply => Box::new(Raised { supply, curve: curve_of(values) }),
            _ => supply,
        })
    }
    fn attachments<'a>(&self, values: &'a [f64], scene: &'a Scene) -> Result<Vec<Attachment<'a>>, ModelError> {
        let place = match self.0 {
            At::Valve => Place::Valve,
            At::Pipe => Place::At(values[2]),
            At::Supply | At::Wall => return Ok(Vec::new()),
        };
        let drawn = move || Drawn { curve: curve_of(values), dt_s: scene.dt_s, step: 0.0 };
        Ok(vec![Attachment { place, make: Box::new(move |_| Element::Shunt(Box::new(drawn()))) }])
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
                let shape = ((2.0 * values[2] + 1.0) * 0.5 * std::f64::consts::PI * x).sin();
                // ½ B (2 A dx) ε': half of the storage flow of a reach, as a head.
                weight_m[node] = segment.impedance * segment.reach_m * segment.mean(|s| s.area_m2()) * shape;
            }
        }
        Ok(vec![Box::new(Strained { curve: curve_of(values), dt_s: grid.dt_s, step: 0.0, weight_m })])
    }
}

/// Adds the curve to another supply.
struct Raised {
    supply: Box<dyn Supply>,
    curve: Curve,
}

impl Supply for Raised {
    fn head_m(&mut self, time_s: f64) -> f64 {
        self.supply.head_m(time_s) + self.curve.value(time_s)
    }
}

/// Takes the curve out as a flow, whatever the head.
struct Drawn {
    curve: Curve,
    dt_s: f64,
    step: f64,
}

impl Shunt for Drawn {
    fn settle(&mut self, _head_m: f64) -> f64 {
        0.0
    }
    fn outflow(&self, _head_m: f64) -> (f64, f64) {
        (self.curve.value((self.step + 1.0) * self.dt_s), 0.0)
    }
    fn advance(&mut self, _head_m: f64) {
        self.step += 1.0;
    }
}

/// The curve as a strain, spread over nodes by their weights.
struct Strained {
    curve: Curve,
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
        let rate_per_s = (self.curve.value(time_s) - self.curve.value(time_s - self.dt_s)) / self.dt_s;
        storage.iter_mut().zip(&self.weight_m).for_each(|(b, w)| *b -= w * rate_per_s);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Splines of equal size add up to a constant between their second and last but one knot, and a single one ends
    /// after two knots on either side.
    #[test]
    fn splines_add_up() {
        let curve = |sizes: Vec<f64>| Curve { sizes, first_s: 0.5, width_s: 0.1 };
        let (even, single) = (curve(vec![3.0; 8]), curve(vec![3.0]));
        for i in 0..50 {
            let time_s = 0.6 + 0.01 * f64::from(i);
            assert!((even.value(time_s) - 3.0).abs() < 1e-12, "{time_s}: {}", even.value(time_s));
        }
        assert!((single.value(0.5) - 2.0).abs() < 1e-12 && (single.value(0.4) - 0.5).abs() < 1e-12);
        assert!([0.3, 0.7, -1.0, 9.0].iter().all(|t| single.value(*t).abs() < 1e-12));
    }
}
