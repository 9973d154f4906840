//! Inputs of tasks: their checksums, and whether they still are what was planned.

use std::collections::HashMap;
use std::fs::Metadata;
use std::io;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use crate::campaign::checksum::checksum;
use crate::campaign::task::Input;

/// What tells that a file was not written to since it was looked at.
type Stamp = (u64, Option<SystemTime>);

fn stamp(about: &Metadata) -> Stamp {
    (about.len(), about.modified().ok())
}

/// Files whose content was compared with what was planned: each once, as long as nobody writes to it.
#[derive(Default)]
pub struct Checked(HashMap<PathBuf, (Stamp, String)>);

impl Checked {
    /// Where the input is, in the folder of a campaign or elsewhere, once it is known to be what was planned.
    ///
    /// # Errors
    /// Why it is not, as a reason of a task that failed.
    pub fn path(&mut self, folder: &Path, input: &Input) -> Result<PathBuf, String> {
        for effect in &input.effects {
            self.path(folder, effect)?;
        }
        let path = folder.join(&input.path);
        let about = match path.metadata() {
            Ok(about) => stamp(&about),
            Err(e) if e.kind() == io::ErrorKind::NotFound => {
                return Err(format!("the input {} vanished: it is no longer at its place", input.name));
            }
            Err(e) => return Err(format!("the input {} cannot be read: {e}", input.name)),
        };
        let known = self.0.get(&path).filter(|(seen, _)| *seen == about);
        let sha256 = match known {
            Some((_, sha256)) => sha256.clone(),
            None => {
                let sha256 = checksum(&path).map_err(|e| format!("the input {} cannot be read: {e}", input.name))?;
                self.0.insert(path.clone(), (about, sha256.clone()));
                sha256
            }
        };
        match sha256 == input.sha256 {
            true => Ok(path),
            false => Err(format!("the input {} changed since the campaign was planned", input.name)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_input_that_changed_or_vanished_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        std::fs::write(&path, "abc").unwrap();
        let input =
            Input { name: "runs/a".into(), path: "a".into(), sha256: checksum(&path).unwrap(), effects: Vec::new() };
        let mut checked = Checked::default();
        assert_eq!(checked.path(folder.path(), &input).unwrap(), path);
        std::fs::write(&path, "abcd").unwrap();
        assert!(checked.path(folder.path(), &input).unwrap_err().contains("runs/a changed"));
        std::fs::remove_file(&path).unwrap();
        assert!(checked.path(folder.path(), &input).unwrap_err().contains("runs/a vanished"));
    }
}
