//! How this program is started again, by itself or by an engine: its file, unless it runs within another program, such
//! as Python.

use std::io;
use std::path::PathBuf;
use std::sync::OnceLock;

static SCRIPT: OnceLock<PathBuf> = OnceLock::new();

/// Says which script has called the program from within another one; the first counts.
pub fn called_by(script: PathBuf) {
    let _ = SCRIPT.set(script);
}

/// What starts this program.
///
/// # Errors
/// A system that does not tell.
pub(crate) fn own_program() -> io::Result<PathBuf> {
    match SCRIPT.get() {
        Some(script) => std::path::absolute(script),
        None => std::env::current_exe(),
    }
}
