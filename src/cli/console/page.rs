//! The page that `--report` asks for.

use std::path::Path;

use crate::cli::console::outcome::AnyError;
use crate::cli::console::print::with_flags;
use crate::report::Page;
use crate::report::page::html;
use crate::storage::output;
use crate::study::Study;

/// Writes a page whose heading names the recordings.
///
/// # Errors
/// If the file cannot be written, or has become something else than a page meanwhile.
pub fn write_page(path: &Path, study: &Study, page: Page) -> Result<(), AnyError> {
    let files: Vec<&str> = study.recordings().iter().map(|l| l.file.as_str()).collect();
    let title = format!("{} on rig {}", files.join(", "), page.rig.name);
    let page = html(&Page { title, ..page });
    output::check_report(path)?;
    Ok(output::write(path, &with_flags(&page))?)
}
