//! Effects of one's own: the files `effects/NAME.toml` beside a rig file, as text. What they mean, `model` says.
//!
//! A recording keeps them behind the text of its rig, in a table `[effects]`, so that it can be replayed elsewhere.
//! Files that lie beside a recording come before those in it.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use crate::rig::error::RigError;
use crate::rig::types::Rig;
use crate::text_file::read_text;

/// Texts by the names of the effects.
pub type OwnEffects = BTreeMap<String, String>;

/// The folder beside the rig file.
pub const FOLDER: &str = "effects";
/// No effect needs a longer text, bytes.
pub const LONGEST: usize = 100_000;
/// Most files of one folder.
const MOST_FILES: usize = 100;
/// Begins what is kept behind the text of a rig.
const MARK: &str = "\n# effects of one's own, from the files effects/NAME.toml beside this file\n[effects]\n";

/// The effects that rigs of this process have, by their names: a command line names them before it names a rig.
static KNOWN: Mutex<OwnEffects> = Mutex::new(OwnEffects::new());

/// The text of an effect that a rig of this process has; of two of one name, that of the rig that was read last.
pub fn known(name: &str) -> Option<String> {
    KNOWN.lock().unwrap_or_else(PoisonError::into_inner).get(name).cloned()
}

/// Names of these effects.
pub fn known_names() -> Vec<String> {
    KNOWN.lock().unwrap_or_else(PoisonError::into_inner).keys().cloned().collect()
}

/// Makes them known.
pub(crate) fn remember(effects: &OwnEffects) {
    if !effects.is_empty() {
        KNOWN.lock().unwrap_or_else(PoisonError::into_inner).extend(effects.clone());
    }
}

/// Reads the folder `effects` in a folder; none if there is no such folder.
///
/// # Errors
/// A file that cannot be read or is too long.
pub fn beside(folder: &Path) -> Result<OwnEffects, RigError> {
    let paths = files_beside(folder)?.into_iter();
    let effects = paths.map(|path| Ok((stem(&path), text(&path)?))).collect::<Result<_, RigError>>()?;
    remember(&effects);
    Ok(effects)
}

/// The files that [`beside`] reads, sorted by name.
///
/// # Errors
/// More of them than a rig can need.
pub fn files_beside(folder: &Path) -> Result<Vec<PathBuf>, RigError> {
    let own = folder.join(FOLDER);
    let Ok(files) = std::fs::read_dir(&own) else { return Ok(Vec::new()) };
    let is_effect = |path: &Path| path.extension().is_some_and(|e| e == "toml");
    let mut paths: Vec<_> = files.filter_map(|f| f.ok().map(|f| f.path())).filter(|p| is_effect(p)).collect();
    paths.sort();
    if paths.len() > MOST_FILES {
        return Err(RigError::Effect { path: own, said: format!("it holds more than {MOST_FILES} effects") });
    }
    Ok(paths)
}

/// The name of the effect in a file.
pub fn stem(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// The text of one file.
///
/// # Errors
/// As [`beside`].
pub fn text(path: &Path) -> Result<String, RigError> {
    let said = |said: String| RigError::Effect { path: path.to_owned(), said };
    let length = std::fs::metadata(path).map_err(|e| said(e.to_string()))?.len();
    if length > LONGEST as u64 {
        return Err(said(format!("it has {length} bytes, and an effect has {LONGEST} at most")));
    }
    read_text(path).map_err(|e| said(e.to_string()))
}

/// The text of a rig file without the effects that a recording keeps behind it.
pub(crate) fn alone(text: &str) -> &str {
    text.find(MARK).map_or(text, |at| &text[..at])
}

impl Rig {
    /// The text that a recording keeps: the rig file's, and the effects beside it.
    pub fn stored_text(&self) -> String {
        let mut text = self.source.clone();
        if !self.own_effects.is_empty() {
            text.push_str(MARK);
        }
        for (name, effect) in &self.own_effects {
            let quoted = |text: &str| toml::Value::String(text.to_owned()).to_string();
            let _ = writeln!(text, "{} = {}", quoted(name), quoted(effect));
        }
        text
    }

    /// The same rig with the effects in the folder `effects` of a folder; each comes before one of that name that it
    /// has.
    ///
    /// # Errors
    /// As [`beside`].
    pub fn with_effects_beside(mut self, folder: &Path) -> Result<Rig, RigError> {
        self.own_effects.extend(beside(folder)?);
        Ok(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stored_text_gives_rig_and_effects_back() {
        let text = include_str!("../../../rigs/demo-hdpe.toml");
        let mut rig = Rig::from_toml(text, "rig.toml").unwrap();
        assert_eq!(rig.stored_text(), text);
        let effect = "name = \"a\"\nlaw = '''\nH \\ \"x\"\n'''\n".to_owned();
        rig.own_effects.insert("a-1".to_owned(), effect.clone());
        let again = Rig::from_toml(&rig.stored_text(), "rig.toml").unwrap();
        assert_eq!((again.source.as_str(), again.own_effects["a-1"].as_str()), (text, effect.as_str()));
        assert_eq!(known("a-1"), Some(effect));
    }
}
