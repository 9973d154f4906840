//! Effects of one's own: the files `effects/NAME.toml` beside a rig file, each an [`Effect`] like those of the
//! catalogue.

pub mod file;
pub mod number;
pub mod parser;
pub(crate) mod places;
pub mod program;
pub mod running;

use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};

use crate::model::boundary::Supply;
use crate::model::contribution::LineTerm;
use crate::model::effect::{Attachment, Effect, Element, Place, check, other_places};
use crate::model::error::ModelError;
use crate::model::own::file::{Definition, Gives, POSITION, read};
use crate::model::own::places::{Drop, FlowOut, Head, Wall, reading};
use crate::model::own::running::Running;
use crate::model::parameter::{Parameter, Scale};
use crate::model::scene::{Scene, Site};
use crate::model::steady::Steady;
use crate::model::trace::Trace;
use crate::rig::own_effects::known;
use crate::rig::{Rig, Upstream};

/// One of them.
pub struct OwnEffect(Definition);

/// An effect, or why there is none.
type Compiled = Result<&'static OwnEffect, String>;

/// Each text is compiled once and kept: a process sees few, and every model refers to them.
static COMPILED: Mutex<Option<HashMap<(String, String), Compiled>>> = Mutex::new(None);

/// The effect of a text.
///
/// # Errors
/// [`ModelError::OwnEffect`] with what is wrong, at which line and column.
pub fn compiled(name: &str, text: &str) -> Result<&'static OwnEffect, ModelError> {
    let mut all = COMPILED.lock().unwrap_or_else(PoisonError::into_inner);
    let one = all.get_or_insert_default().entry((name.to_owned(), text.to_owned())).or_insert_with(|| {
        let definition = read(text, &format!("effects/{name}.toml"), name)?;
        Ok(Box::leak(Box::new(OwnEffect(definition))))
    });
    one.clone().map_err(|said| ModelError::OwnEffect { said })
}

/// The effects of a rig's own.
///
/// # Errors
/// The first that is faulty.
pub fn of_rig(rig: &Rig) -> Result<Vec<&'static dyn Effect>, ModelError> {
    rig.own_effects.iter().map(|(name, text)| Ok(compiled(name, text)? as &dyn Effect)).collect()
}

/// An effect by its name, where a rig of this process has it.
///
/// # Errors
/// If it is faulty.
pub fn named(name: &str) -> Result<Option<&'static dyn Effect>, ModelError> {
    known(name).map(|text| Ok(compiled(name, &text)? as &dyn Effect)).transpose()
}

impl OwnEffect {
    /// Where it acts and what its law gives.
    pub fn gives(&self) -> Gives {
        self.0.gives
    }

    /// Whether a parameter has the value at which nothing is left of it.
    fn is_gone(&self, values: &[f64]) -> bool {
        self.0.parameters.iter().zip(values).any(|(p, v)| p.vanishes_at == Some(*v))
    }

    /// Refuses values out of the bounds of the file: its law is checked within them.
    fn law(&self, values: &[f64]) -> Result<Option<Running>, ModelError> {
        for (p, &value) in self.0.parameters.iter().zip(values) {
            check(&p.name, value, true, "a number")?;
        }
        Ok((!self.is_gone(values)).then(|| Running::new(&self.0, values)))
    }
}

/// Shares of its range at which a parameter that no record shows near its start is tried, too: a valve that opens above
/// every head leaves no trace. They are dense near the lower bound: bounds of a threshold reach far above what a test
/// reaches.
const SHARES: [f64; 5] = [0.04, 0.1, 0.2, 0.4, 0.7];

impl Effect for OwnEffect {
    fn name(&self) -> &'static str {
        self.0.name
    }
    fn summary(&self) -> &'static str {
        self.0.says
    }
    fn equation(&self) -> &'static str {
        self.0.law_text
    }
    fn source(&self) -> &'static str {
        "an effect of the rig's own"
    }
    fn trace(&self) -> &'static str {
        "as its law says; `surgescope effects check` plots it"
    }
    fn at_sensor(&self) -> bool {
        self.0.gives == Gives::Reading
    }
    fn on_pipe(&self) -> bool {
        self.0.gives.is_at_place()
    }
    fn is_own(&self) -> bool {
        true
    }
    fn at_supply(&self) -> bool {
        matches!(self.0.gives, Gives::SupplyHead | Gives::HeadLossAtSupply)
    }
    fn impossible(&self, rig: &Rig) -> Option<&'static str> {
        let supply = &rig.graph.nodes[rig.graph.supply()];
        if self.at_supply() && !supply.kind.holds_given_head() {
            return Some("no reservoir feeds the rig: the head of its tank or pump follows from its own law");
        }
        (self.0.gives == Gives::HeadLossAtSupply && rig.upstream == Upstream::Measured)
            .then_some("the head that drives the model is measured in the pipe, behind its inlet")
    }
    fn remedy(&self, place: Option<&str>, sensor: Option<&str>) -> Option<String> {
        let at = place.or(sensor)?;
        Some(format!("look for it at {at}, put it right and repeat the test"))
    }
    fn parameters(&self, site: &Site, _elements: usize) -> Vec<Parameter> {
        let length_m = site.length_m();
        let placed = |p: &Parameter| match p.start.is_nan() {
            true => Parameter { start: 0.5 * length_m, lower: 0.02 * length_m, upper: 0.98 * length_m, ..p.clone() },
            false => p.clone(),
        };
        self.0.parameters.iter().map(placed).collect()
    }
    fn other_starts(&self, _elements: usize) -> Vec<Vec<f64>> {
        let parameters = &self.0.parameters;
        let usual = vec![1.0; parameters.len()];
        let mut starts = vec![usual.clone()];
        if let Some(at) = parameters.iter().position(|p| p.name == POSITION && p.start.is_nan()) {
            starts.extend(other_places().map(|by| {
                let mut start = usual.clone();
                start[at] = by;
                start
            }));
        }
        let open = |p: &Parameter| p.vanishes_at.is_none() && p.start.is_finite() && p.start != 0.0;
        for (i, p) in parameters.iter().enumerate().filter(|(_, p)| open(p)) {
            let value = |share: f64| match p.scale {
                Scale::Linear => p.lower + share * (p.upper - p.lower),
                Scale::Log => p.lower * (p.upper / p.lower).powf(share),
            };
            let factors: Vec<f64> = SHARES.iter().map(|share| value(*share) / p.start).collect();
            let moved: Vec<Vec<f64>> = factors
                .iter()
                .flat_map(|factor| {
                    starts.iter().map(move |start| {
                        let mut start = start.clone();
                        start[i] = *factor;
                        start
                    })
                })
                .collect();
            // Each further parameter multiplies the starts: more than this no fit tries.
            if starts.len() + moved.len() > MOST_STARTS {
                break;
            }
            starts.extend(moved);
        }
        starts.remove(0);
        starts
    }
    fn kept_per_node(&self, _elements: usize) -> usize {
        if self.0.gives == Gives::Friction { self.0.states.len() } else { 0 }
    }
    fn line_terms(&self, values: &[f64], steady: &Steady) -> Result<Vec<Box<dyn LineTerm>>, ModelError> {
        if self.0.gives != Gives::Friction || self.law(values)?.is_none() {
            return Ok(Vec::new());
        }
        Ok(vec![Box::new(Wall::new(&self.0, values, steady))])
    }
    fn attachments<'a>(&self, values: &'a [f64], scene: &'a Scene) -> Result<Vec<Attachment<'a>>, ModelError> {
        let of = self.0.parameters.iter().position(|p| p.name == POSITION).and_then(|i| values.get(i));
        let place = match (self.0.gives, of) {
            (Gives::FlowOut | Gives::HeadLoss, Some(&position_m)) => {
                let inside = scene.is_inside(position_m);
                check(POSITION, position_m, inside, "inside the pipe, between supply and valve")?;
                Place::At(position_m)
            }
            (Gives::FlowOutAtValve | Gives::HeadLossAtValve, _) => Place::Valve,
            (Gives::HeadLossAtSupply, _) => Place::Supply,
            _ => return Ok(Vec::new()),
        };
        if self.law(values)?.is_none() {
            return Ok(Vec::new());
        }
        let (definition, dt_s) = (self.0.clone(), scene.dt_s);
        Ok(vec![Attachment {
            place,
            make: Box::new(move |spot| {
                let law = Running::new(&definition, values).at_elevation(spot.elevation_m);
                // The supply's node counts what leaves the pipe as positive.
                let share = if definition.gives == Gives::HeadLossAtSupply { -spot.share } else { spot.share };
                match definition.gives.is_loss() {
                    true => Element::Drop(Box::new(Drop { law, share, dt_s, time_s: 0.0 })),
                    false => Element::Shunt(Box::new(FlowOut { law, dt_s, time_s: 0.0 })),
                }
            }),
        }])
    }
    fn supply(&self, values: &[f64], supply: Box<dyn Supply>) -> Result<Box<dyn Supply>, ModelError> {
        if self.0.gives != Gives::SupplyHead {
            return Ok(supply);
        }
        Ok(match self.law(values)? {
            Some(law) => Box::new(Head::new(supply, law)),
            None => supply,
        })
    }
    fn sense(&self, values: &[f64], elevation_m: f64, trace: Trace) -> Result<Trace, ModelError> {
        Ok(match self.law(values)? {
            Some(law) => reading(law.at_elevation(elevation_m), trace),
            None => trace,
        })
    }
}

/// Starts of one effect, at most.
const MOST_STARTS: usize = 60;
