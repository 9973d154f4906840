//! `surgescope effects`: the catalogue.

use std::fmt::Write as _;

use serde_json::json;

use super::{CommandResult, Outcome};
use crate::model::effects::CATALOGUE;

/// List the effects that a model can have.
#[derive(Debug, clap::Args)]
pub struct Args {}

/// Runs it.
///
/// # Errors
/// Only if standard output cannot be written.
pub fn run(_args: Args, json: bool) -> CommandResult {
    if json {
        let list: Vec<_> = CATALOGUE
            .iter()
            .map(|e| {
                json!({
                    "name": e.name(), "summary": e.summary(), "equation": e.equation(), "source": e.source(),
                    "trace": e.trace(), "most_elements": e.elements().map(|r| *r.end()),
                })
            })
            .collect();
        super::say!("{:#}", json!({ "effects": list }));
    } else {
        let mut text = String::new();
        for effect in CATALOGUE {
            let elements = effect.elements().map_or(String::new(), |r| format!(" (:1 to :{} elements)", r.end()));
            let _ = writeln!(text, "{}{elements}", effect.name());
            for (label, value) in [
                ("adds", effect.summary()),
                ("equation", effect.equation()),
                ("source", effect.source()),
                ("trace", effect.trace()),
            ] {
                let _ = writeln!(text, "  {label:9} {value}");
            }
        }
        super::say_text!(text);
    }
    Ok(Outcome::Done)
}
