//! Texts that live as long as the program, such as names and units of the catalogue, read back from a serialised
//! result.

use std::collections::HashSet;
use std::sync::{Mutex, PoisonError};

use serde::{Deserialize, Deserializer};

/// Such a text. By this name the derived readers do not take it for a part of what they read.
pub type Text = &'static str;

/// Each text once: there are as many as the catalogue has.
static TEXTS: Mutex<Option<HashSet<&'static str>>> = Mutex::new(None);

/// The text, kept.
pub fn interned(text: String) -> &'static str {
    let mut texts = TEXTS.lock().unwrap_or_else(PoisonError::into_inner);
    let texts = texts.get_or_insert_default();
    match texts.get(text.as_str()) {
        Some(known) => known,
        None => {
            let text: &'static str = text.leak();
            texts.insert(text);
            text
        }
    }
}

/// One text.
pub fn text<'de, D: Deserializer<'de>>(from: D) -> Result<&'static str, D::Error> {
    Ok(interned(String::deserialize(from)?))
}

/// A list of texts.
pub fn texts<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<&'static str>, D::Error> {
    Ok(Vec::<String>::deserialize(from)?.into_iter().map(interned).collect())
}

/// Two texts.
pub fn pair<'de, D: Deserializer<'de>>(from: D) -> Result<[&'static str; 2], D::Error> {
    Ok(<[String; 2]>::deserialize(from)?.map(interned))
}

/// A list of texts, each with words of its own.
pub fn with_words<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<(&'static str, String)>, D::Error> {
    Ok(Vec::<(String, String)>::deserialize(from)?.into_iter().map(|(text, words)| (interned(text), words)).collect())
}
