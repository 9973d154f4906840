//! The text of an error: the sentence, its causes, and what to try.

use std::error::Error;

use crate::cli::console::hints::hint;
use crate::cli::console::print::{harmless, with_flags};

/// The sentence of an error, then a line for each cause, and one for the option that helps, if one does.
pub fn in_words(error: &(dyn Error + 'static)) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(inner) = cause {
        text += &format!("\n  because: {inner}");
        cause = inner.source();
    }
    if let Some(hint) = hint(error) {
        text += &format!("\n  try: {hint}");
    }
    harmless(&with_flags(&text)).into_owned()
}
