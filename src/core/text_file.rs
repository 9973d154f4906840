//! Text files that people write: rigs, models, values.

use std::fs::File;
use std::io::{Error, ErrorKind, Read as _, Result};
use std::path::Path;

/// None is longer, bytes: what is, or never ends, is something else.
const LONGEST: u64 = 512 << 20;

/// The whole content of a text file.
///
/// # Errors
/// One that cannot be read, is no UTF-8, or is longer than 512 MiB.
pub fn read_text(path: &Path) -> Result<String> {
    let mut text = String::new();
    File::open(path)?.take(LONGEST + 1).read_to_string(&mut text)?;
    if text.len() as u64 > LONGEST {
        return Err(Error::new(ErrorKind::InvalidData, "it is longer than 512 MiB"));
    }
    Ok(text)
}
