//! The catalogue: the list of all effects, one file each.
//!
//! An effect describes itself completely. Help, calibration, diagnosis and reports iterate over [`CATALOGUE`]. An
//! effect contributes to the scheme in a few ways, each a method of [`Effect`] that does nothing by default:
//!
//! | method | what the effect changes |
//! | --- | --- |
//! | [`Effect::reshape`] | the pipes, before the grid is laid |
//! | [`Effect::line_terms`] | a term along the line, once a step for all nodes of a segment |
//! | [`Effect::attachments`] | something at one place, or at an end: before the valve, in the supply's mouth |
//! | [`Effect::field`] with [`Effect::node_shunt`] | what takes water out of every node |
//! | [`Effect::supply`], [`Effect::valve`] | the ends |
//! | [`Effect::wall_waves`] | waves in the walls, which meet those of the water at ends and joints |
//! | [`Effect::sense`] | what one sensor makes of the head |

pub(crate) mod air_pocket;
pub(crate) mod blockage;
pub(crate) mod clock_skew;
pub(crate) mod entrained_gas;
pub(crate) mod fluid_structure;
pub(crate) mod inlet_jet;
pub(crate) mod leak;
pub(crate) mod moving_valve;
pub(crate) mod section_change;
pub(crate) mod sensor_gain;
pub(crate) mod sensor_lag;
pub(crate) mod side_branch;
pub(crate) mod supply_drift;
pub mod unsteady_friction;
pub(crate) mod valve_law;
pub(crate) mod valve_seat_leak;
pub(crate) mod vapour_cavity;
pub(crate) mod viscoelastic_wall;

pub(crate) use crate::model::chosen::labels_of;
pub use crate::model::chosen::{Chosen, boils, excluded, name_of};
pub use crate::model::effect::{Attachment, Circumstances, Effect, Element, Place, SHOWN, check};
use crate::model::error::ModelError;
use crate::model::own;
pub use crate::model::scene::{ATMOSPHERE_PA, Scene, Site, Spot, vapour_head_m};
use crate::rig::Rig;
use crate::rig::own_effects::known_names;

/// Every effect that a model can have, besides those of a rig's own.
pub static CATALOGUE: &[&dyn Effect] = &[
    &crate::model::effects::viscoelastic_wall::ViscoelasticWall,
    &crate::model::effects::unsteady_friction::UnsteadyFriction,
    &crate::model::effects::entrained_gas::EntrainedGas,
    &crate::model::effects::vapour_cavity::VapourCavity,
    &crate::model::effects::leak::Leak,
    &crate::model::effects::blockage::Blockage,
    &crate::model::effects::section_change::SectionChange,
    &crate::model::effects::valve_law::ValveLaw,
    &crate::model::effects::valve_seat_leak::ValveSeatLeak,
    &crate::model::effects::supply_drift::SupplyDrift,
    &crate::model::effects::inlet_jet::InletJet,
    &crate::model::effects::air_pocket::AirPocket,
    &crate::model::effects::moving_valve::MovingValve,
    &crate::model::effects::fluid_structure::FluidStructure,
    &crate::model::effects::side_branch::SideBranch,
    &crate::model::effects::sensor_lag::SensorLag,
    &crate::model::effects::clock_skew::ClockSkew,
    &crate::model::effects::sensor_gain::SensorGain,
];

/// The effects that a model of a rig can have: the catalogue, and those of its own. A faulty one is left out:
/// [`own::of_rig`](crate::model::own::of_rig) says what is wrong with it.
pub fn catalogue_of(rig: &Rig) -> Vec<&'static dyn Effect> {
    CATALOGUE.iter().copied().chain(rig.own_effects.keys().filter_map(|name| own_of(rig, name))).collect()
}

/// The effect of a rig's own of that name.
fn own_of(rig: &Rig, name: &str) -> Option<&'static dyn Effect> {
    own::compiled(name, rig.own_effects.get(name)?).ok().map(|own| own as &dyn Effect)
}

/// All effects of the catalogue, and their variants.
fn variants() -> impl Iterator<Item = &'static dyn Effect> {
    CATALOGUE.iter().flat_map(|e| std::iter::once(*e).chain(e.variants().iter().copied()))
}

/// Parses a comma-separated list of effects; `none` or an empty list is the base model.
///
/// # Errors
/// A name that is not in the catalogue (the nearest is named), a number of elements where there are none or out of
/// range, an effect named twice.
pub fn parse_list(text: &str) -> Result<Vec<Chosen>, ModelError> {
    let mut chosen: Vec<Chosen> = Vec::new();
    for item in text.split(',').map(str::trim).filter(|s| !s.is_empty() && *s != "none") {
        let (item, at) = match item.split_once('@') {
            Some((item, at)) => (item, Some(at.to_owned())),
            None => (item, None),
        };
        let (name, number) = match item.split_once(':') {
            Some((name, number)) => (name, Some(number)),
            None => (item, None),
        };
        let of_catalogue = variants().find(|e| e.name() == name);
        let effect = match of_catalogue {
            Some(effect) => effect,
            None => own::named(name)?.ok_or_else(|| unknown(name))?,
        };
        let elements = match (number, effect.elements()) {
            (None, _) => None,
            (Some(number), Some(range)) => {
                Some(number.parse().ok().filter(|n| range.contains(n)).ok_or_else(|| ModelError::Elements {
                    item: item.to_owned(),
                    low: *range.start(),
                    high: *range.end(),
                })?)
            }
            (Some(_), None) => return Err(ModelError::NoElements { item: item.to_owned() }),
        };
        let (mut sensor, mut pipe, mut valve) = (None, None, None);
        match at {
            None => {}
            at if effect.at_sensor() => sensor = at,
            at if effect.on_pipe() => pipe = at,
            at if effect.at_valve() => valve = at,
            _ => return Err(ModelError::NoSensor { item: item.to_owned() }),
        }
        for other in &chosen {
            if other.effect.name() == name {
                return Err(ModelError::EffectTwice { name: name.to_owned() });
            }
            excluded(effect, other.effect)?;
        }
        chosen.push(Chosen { effect, elements, sensor, pipe, valve });
    }
    Ok(chosen)
}

fn unknown(name: &str) -> ModelError {
    let known: Vec<String> = variants().map(|e| e.name().to_owned()).chain(known_names()).collect();
    let nearest = known.iter().max_by(|a, b| strsim::jaro_winkler(name, a).total_cmp(&strsim::jaro_winkler(name, b)));
    ModelError::UnknownEffect {
        name: name.to_owned(),
        nearest: nearest.cloned().unwrap_or_default(),
        known: known.join(", "),
    }
}

/// Why there is no setting such as `leak_pipe`: the pipe stands behind the effect's name.
pub fn pipe_is_no_setting(name: &str) -> Option<String> {
    let own = name.strip_suffix("_pipe")?;
    let effect = CATALOGUE.iter().find(|e| e.on_pipe() && e.name().split('-').any(|word| word == own))?.name();
    Some(format!(
        "the pipe stands behind the effect's name: write {effect}@PIPE in option `effects`, PIPE being the name of the pipe"
    ))
}

/// As on the command line.
impl serde::Serialize for Chosen {
    fn serialize<S: serde::Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_str(&self.label())
    }
}

impl<'de> serde::Deserialize<'de> for Chosen {
    fn deserialize<D: serde::Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let label = String::deserialize(from)?;
        let mut chosen = parse_list(&label).map_err(serde::de::Error::custom)?;
        chosen.pop().ok_or_else(|| serde::de::Error::custom("an effect has no name"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_file_of_the_folder_is_in_the_catalogue() {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("model/effects");
        let mut files: Vec<String> = std::fs::read_dir(folder)
            .unwrap()
            .map(|f| f.unwrap().file_name().into_string().unwrap())
            .filter(|f| f != "mod.rs")
            .map(|f| f.trim_end_matches(".rs").replace('_', "-"))
            .collect();
        files.sort();
        let mut names: Vec<String> = CATALOGUE.iter().map(|e| e.name().to_owned()).collect();
        names.sort();
        assert_eq!(files, names);
    }

    /// An effect that extends another is a variant of it, and has its parameters first.
    #[test]
    fn what_extends_another_effect_has_all_of_it() {
        let rig = Rig::from_toml(crate::fit::problem::test_record::HDPE, "rig.toml").unwrap();
        let water = rig.fluid.properties(20.0);
        let names = |effect| {
            let model = crate::model::Model::new(&rig, &water, &[Chosen::of(effect)]);
            model.shared.iter().map(|p| p.name.clone()).collect::<Vec<String>>()
        };
        let extending = variants().filter_map(|effect| Some((effect, effect.extends()?)));
        let checked = extending.map(|(effect, smaller)| {
            assert!(smaller.variants().iter().any(|v| v.name() == effect.name()), "{}", effect.name());
            assert!(names(effect).starts_with(&names(smaller)), "{}", effect.name());
        });
        assert_eq!(checked.count(), 2);
    }

    #[test]
    fn lists_are_read_and_slips_are_explained() {
        assert!(parse_list("none").unwrap().is_empty());
        assert_eq!(parse_list("viscoelastic-wall:3").unwrap()[0].label(), "viscoelastic-wall:3");
        let slip = parse_list("viscoelastic_wall").unwrap_err().to_string();
        assert!(slip.contains("did you mean 'viscoelastic-wall'"), "{slip}");
        assert!(parse_list("viscoelastic-wall:0").unwrap_err().to_string().contains("from 1 to"));
        assert!(parse_list("viscoelastic-wall,viscoelastic-wall:2").unwrap_err().to_string().contains("twice"));
        for (setting, write) in [("leak_pipe", "leak@PIPE"), ("branch_pipe", "side-branch@PIPE")] {
            assert!(pipe_is_no_setting(setting).unwrap().contains(write), "{setting}");
        }
        assert_eq!((pipe_is_no_setting("tau1_s"), pipe_is_no_setting("gas_pipe")), (None, None));
    }
}
