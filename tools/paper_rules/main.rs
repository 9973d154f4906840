//! Tests the rules that the source paper derives from its sensitivity analysis, one by one, and prints a page in
//! Markdown:
//!
//! ```sh
//! cargo run --release -p surgescope-tools --bin paper_rules -- rigs/paper-ppr.toml initial_velocity_m_s=1 closing_time_s=0.06 > docs/src/measured/paper_rules.md
//! ```
//!
//! The arguments are a rig file and settings as `surgescope simulate --set` takes them. The wall has two elements, and
//! the sensor nearest to the valve is read.

mod claim;
mod claims;
mod designs;
mod judge;
mod page;
mod study;
mod sweep;
mod wall;

use std::error::Error;

use surgescope::model::Conditions;
use surgescope::model::effects::parse_list;
use surgescope::rig::Rig;
use surgescope::sensitivity::subject::{Subject, sensor};
use surgescope::simulate::scenario::{Scenario, ValveForm};

type AnyError = Box<dyn Error + Send + Sync>;

/// Reaches unless a setting gives them, as in `surgescope sensitivity`.
const REACHES: f64 = 96.0;

fn main() -> Result<(), AnyError> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let Some((rig, settings)) = arguments.split_first() else {
        return Err("usage: paper_rules RIG [NAME=VALUE ...]".into());
    };
    let settings = settings.iter().map(|text| setting(text)).collect::<Result<Vec<_>, _>>()?;
    eprintln!("{} simulations at most", study::runs());
    print!("{}", page::rules_page(&rules(rig, "viscoelastic-wall:2", settings)?));
    Ok(())
}

fn setting(text: &str) -> Result<(String, f64), AnyError> {
    let (name, value) = text.split_once('=').ok_or_else(|| format!("'{text}' must be NAME=VALUE"))?;
    Ok((name.to_owned(), value.parse().map_err(|_| format!("'{value}' is not a number"))?))
}

/// Tests all rules on a rig file with `effects` and settings.
fn rules(rig: &str, effects: &str, mut settings: Vec<(String, f64)>) -> Result<study::Rules, AnyError> {
    if settings.iter().all(|(name, _)| name != "reaches") {
        settings.push(("reaches".to_owned(), REACHES));
    }
    let scenario = Scenario::new(Rig::load(rig.as_ref())?, &parse_list(effects)?, ValveForm::Linear, &settings)?;
    let subject = Subject {
        model: scenario.model(),
        conditions: Conditions::of(scenario.water),
        values: scenario.values().into_iter().map(|(_, value)| value).collect(),
        reaches: scenario.reaches,
        sensor: sensor(&scenario.rig, None)?,
    };
    Ok(study::test(&subject, &|| ())?)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A file of the project, wherever the package lies in it.
    fn of_project(path: &str) -> String {
        let here = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
        let root = here.ancestors().find(|folder| folder.join("rigs").is_dir()).unwrap();
        root.join(path).to_str().unwrap().to_owned()
    }

    #[test]
    fn the_page_of_the_papers_rules_is_what_the_program_writes() {
        let settings = vec![("initial_velocity_m_s".to_owned(), 1.0), ("closing_time_s".to_owned(), 0.06)];
        let found = rules(&of_project("rigs/paper-ppr.toml"), "viscoelastic-wall:2", settings).unwrap();
        let verdicts =
            |text: &str| -> Vec<String> { text.lines().filter(|l| l.starts_with("| [")).map(str::to_owned).collect() };
        let written = verdicts(&page::rules_page(&found));
        assert_eq!(written.len(), 19);
        let page = std::fs::read_to_string(of_project("docs/src/measured/paper_rules.md")).unwrap();
        assert_eq!(written, verdicts(&page), "regenerate it: the page says how");
    }

    #[test]
    fn another_model_is_refused() {
        let refusal = rules(&of_project("rigs/demo-hdpe.toml"), "none", Vec::new()).unwrap_err().to_string();
        assert!(refusal.contains("viscoelastic-wall:2"), "{refusal}");
    }

    #[test]
    fn settings_are_names_with_numbers() {
        assert_eq!(setting("closing_time_s=0.06").unwrap(), ("closing_time_s".to_owned(), 0.06));
        assert!(setting("closing_time_s").is_err() && setting("closing_time_s=fast").is_err());
    }
}
