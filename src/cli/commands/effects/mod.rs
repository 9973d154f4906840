//! `surgescope effects`: the catalogue, what each effect is and does, and effects of one's own.

mod check;
pub(crate) mod new;

use std::path::PathBuf;

use serde_json::{Value, json};

use crate::cli::args::values::one_effect;
use crate::cli::console::document::say_document;
use crate::cli::console::outcome::{CommandResult, Outcome};
use crate::cli::console::print::say_text;
use crate::model::effects::{CATALOGUE, Chosen};
use crate::report::effects::example::Example;
use crate::report::effects::json::{about, described, example as example_json};
use crate::report::effects::text::{explained, list, table};
use crate::storage::output;

/// List or explain the effects of a model, or write and check one of your own.
#[derive(Debug, clap::Args)]
#[command(args_conflicts_with_subcommands = true)]
pub struct Args {
    #[command(subcommand)]
    action: Option<Action>,
    /// Effect to explain, such as valve-law or viscoelastic-wall:2 [default: list all].
    #[arg(value_name = "NAME", value_parser = one_effect)]
    effect: Option<Chosen>,
    /// Write a chart of its influence on a record; replaces an older picture of that name, and no other file.
    #[arg(long, value_name = "SVG", requires = "effect")]
    svg: Option<PathBuf>,
}

#[derive(Debug, clap::Subcommand)]
enum Action {
    New(new::Args),
    Check(check::Args),
}

/// Runs it.
///
/// # Errors
/// Those of each action; an effect that cannot be simulated on the example's rig, a chart that cannot be written.
pub fn run(args: Args, json: bool) -> CommandResult {
    match args.action {
        Some(Action::New(args)) => return new::run(&args, json),
        Some(Action::Check(args)) => return check::run(&args, json),
        None => {}
    }
    let Some(chosen) = args.effect else {
        if json {
            let list: Vec<Value> = CATALOGUE.iter().map(|e| about(*e)).collect();
            say_document(json!({ "effects": list }))?;
        } else {
            say_text!(list());
        }
        return Ok(Outcome::Done);
    };
    let example = Example::of(&chosen)?;
    if let Some(path) = &args.svg {
        output::check_picture(path)?;
        output::write(path, &example.chart().to_svg(900.0, 420.0))?;
    }
    if json {
        let mut document = about(chosen.effect);
        document["parameters"] = example.parameters.iter().map(described).collect();
        document["example"] = example_json(&example);
        say_document(document)?;
    } else {
        say_text!(explained(chosen.effect));
        say_text!(format_args!(
            "\nParameters, with their start values and bounds on rig '{}':\n",
            example.scenario.rig.name
        ));
        say_text!(table(&example.parameters));
        say_text!(format_args!("\n{example}"));
    }
    Ok(Outcome::Done)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::text::plot::MARKS;

    #[test]
    fn every_effect_shows_what_it_does_on_the_demo_rig() {
        let all = CATALOGUE.iter().flat_map(|e| std::iter::once(*e).chain(e.variants().iter().copied()));
        for effect in all {
            let example = Example::of(&one_effect(effect.name()).unwrap()).unwrap();
            assert!(example.shows(), "{} is not seen", effect.name());
            let text = example.to_string();
            assert!(text.contains(MARKS[1]) && text.contains("They differ"), "{text}");
            for parameter in &example.parameters {
                assert!(text.contains(&parameter.name), "{text}");
                assert!((parameter.lower..=parameter.upper).contains(&parameter.start), "{parameter:?}");
            }
            assert!(example.chart().to_svg(900.0, 420.0).ends_with("</svg>"));
        }
    }

    #[test]
    fn a_slip_is_explained_and_the_list_names_them_all() {
        assert!(one_effect("valve_law").unwrap_err().contains("did you mean 'valve-law'"));
        assert!(one_effect("none").is_err() && one_effect("valve-law,sensor-gain").is_err());
        let list = list();
        assert!(CATALOGUE.iter().all(|e| list.contains(e.name()) && list.contains(e.summary())), "{list}");
        assert!(list.contains("valve-law/power") && list.contains("sensor-lag@SENSOR"), "{list}");
    }
}
