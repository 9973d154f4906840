//! Inputs of tasks: their checksums, and whether they still are what was planned.

use std::collections::HashMap;
use std::fmt::Write as _;
use std::fs::{File, Metadata};
use std::io::{self, Read as _};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use sha2::{Digest as _, Sha256};

use crate::campaign::task::Input;

/// SHA-256 of some bytes, in hexadecimal.
pub(crate) fn hexadecimal(bytes: &[u8]) -> String {
    in_digits(&Sha256::digest(bytes))
}

fn in_digits(hash: &[u8]) -> String {
    hash.iter().fold(String::new(), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    })
}

/// SHA-256 of a file, in hexadecimal: what `sha256sum` prints.
///
/// # Errors
/// One that cannot be read.
pub fn checksum(path: &Path) -> io::Result<String> {
    let mut file = File::open(path)?;
    let (mut hash, mut buffer) = (Sha256::new(), vec![0; 1 << 18]);
    loop {
        match file.read(&mut buffer)? {
            0 => return Ok(in_digits(&hash.finalize())),
            n => hash.update(&buffer[..n]),
        }
    }
}

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
    fn the_checksum_is_the_published_one() {
        // FIPS 180-4, example of one block
        assert_eq!(hexadecimal(b"abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
    }

    #[test]
    fn an_input_that_changed_or_vanished_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        std::fs::write(&path, "abc").unwrap();
        let input = Input { name: "runs/a".into(), path: "a".into(), sha256: checksum(&path).unwrap() };
        let mut checked = Checked::default();
        assert_eq!(checked.path(folder.path(), &input).unwrap(), path);
        std::fs::write(&path, "abcd").unwrap();
        assert!(checked.path(folder.path(), &input).unwrap_err().contains("runs/a changed"));
        std::fs::remove_file(&path).unwrap();
        assert!(checked.path(folder.path(), &input).unwrap_err().contains("runs/a vanished"));
    }
}
