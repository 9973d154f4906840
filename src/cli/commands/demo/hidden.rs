//! What is hidden in the test of a demonstration, and what the diagnosis found of it.

use serde_json::{Value, json};

use crate::cli::console::outcome::AnyError;
use crate::diagnose::Diagnosis;
use crate::fit::outcome::fit::FittedParameter;
use crate::model::effects::parse_list;
use crate::report::effects::example::Example;
use crate::report::text::number::{significant, with_error};
use crate::report::text::table::Table;
use crate::simulate::scenario::{Scenario, ValveForm};

/// What the other simulator hid in the shipped test; see recordings/README.md.
const SHIPPED: (&str, [(&str, f64); 7]) = (
    "viscoelastic-wall",
    [
        ("wave_speed_m_s", 342.27),
        ("J1_per_GPa", 0.1315),
        ("tau1_s", 0.0327),
        ("J2_per_GPa", 0.1203),
        ("tau2_s", 0.321),
        ("J3_per_GPa", 0.128),
        ("tau3_s", 1.55),
    ],
);
/// With a seed, each value is drawn within this factor of where a fit starts.
const WITHIN: f64 = 1.4;

/// An effect and its true values.
pub(super) struct Hidden {
    /// Its name in the catalogue.
    pub(super) effect: &'static str,
    /// The test in which it hides; none of the shipped one.
    pub(super) scenario: Option<Scenario>,
    values: Vec<(String, f64)>,
}

impl Hidden {
    /// What the shipped test has.
    pub(super) fn shipped() -> Hidden {
        let values = SHIPPED.1.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect();
        Hidden { effect: SHIPPED.0, scenario: None, values }
    }

    /// An effect of the catalogue in a test in which it shows; with a `seed`, its values are drawn.
    ///
    /// # Errors
    /// An effect that does not exist, or that cannot be simulated with the values drawn.
    pub(super) fn in_a_test(name: &str, seed: Option<u64>) -> Result<Hidden, AnyError> {
        let [chosen] = &parse_list(name)?[..] else {
            return Err(format!("--hidden {name}: name one effect of `demo --list`").into());
        };
        let Example { scenario, parameters, .. } = Example::of(chosen)?;
        let scenario = match seed {
            None => scenario,
            Some(seed) => {
                let mut random = fastrand::Rng::with_seed(seed);
                let mut values = scenario.values();
                for p in &parameters {
                    let value = values.iter_mut().find(|(name, _)| *name == p.name);
                    let factor = WITHIN.powf(2.0 * random.f64() - 1.0);
                    value.into_iter().for_each(|(_, value)| *value = (*value * factor).clamp(p.lower, p.upper));
                }
                Scenario::new(scenario.rig, &scenario.effects, ValveForm::Linear, &values)?
            }
        };
        let own = |name: &str| name.starts_with("wave_speed_m_s") || parameters.iter().any(|p| p.name == name);
        let values = scenario.values().into_iter().filter(|(name, _)| own(name)).collect();
        Ok(Hidden { effect: chosen.effect.name(), values, scenario: Some(scenario) })
    }

    /// Each true value with what was found of it.
    fn beside<'a>(&'a self, found: &'a Diagnosis) -> impl Iterator<Item = (&'a str, f64, Option<&'a FittedParameter>)> {
        let fitted = found.answer().unwrap_or(&found.start);
        self.values
            .iter()
            .map(move |(name, value)| (name.as_str(), *value, fitted.parameters.iter().find(|p| p.name == *name)))
    }

    /// The answer beside the truth.
    pub(super) fn text(&self, found: &Diagnosis) -> String {
        let mut table = Table::new(&["", "hidden", "found"]);
        for (name, value, fitted) in self.beside(found) {
            let found = fitted.map_or("–".to_owned(), |p| with_error(p.value, p.standard_error()));
            table.row([name.to_owned(), significant(value, 4), found]);
        }
        format!("Hidden was {}; the diagnosis says: {}.\n{table}", self.effect, answer(found))
    }

    /// The same for JSON.
    pub(super) fn json(&self, found: &Diagnosis) -> Value {
        let each = self.beside(found).map(|(name, value, fitted)| {
            json!({
                "name": name, "hidden": value, "found": fitted.map(|p| p.value), "standard_error": fitted.map(FittedParameter::standard_error),
            })
        });
        json!(each.collect::<Vec<_>>())
    }
}

/// What the diagnosis says, in a word.
fn answer(found: &Diagnosis) -> String {
    found.answer().map_or_else(|| found.verdict.name().replace('-', " "), |_| found.answer_label())
}
