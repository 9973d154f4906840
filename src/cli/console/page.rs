//! The page that `--report` asks for.

use std::path::Path;

use crate::cli::console::advice::{self, Again};
use crate::cli::console::outcome::AnyError;
use crate::cli::console::print::with_flags;
use crate::report::page::html;
use crate::report::{Page, page_title};
use crate::storage::output;
use crate::study::Study;
use crate::study::open::Loaded;

/// Writes a page whose heading names the recordings, and which says what to do next with them.
///
/// # Errors
/// If the file cannot be written, or has become something else than a page meanwhile.
pub fn write_page(path: &Path, study: &Study, page: Page, again: &Again) -> Result<(), AnyError> {
    let advice = advice::of(&page, again);
    let files: Vec<&str> = study.recordings().iter().map(|l| l.file.as_str()).collect();
    let title = page_title(&files, page.rig);
    // a page outlives the terminal that showed the warnings
    let of = |l: &Loaded| l.window.map(|window| format!("{}: {}", l.file, window.in_words()));
    let windows: Vec<String> = study.recordings().iter().filter_map(of).collect();
    let warnings: Vec<String> = windows.into_iter().chain(page.warnings.iter().cloned()).collect();
    let temperatures_degc = study.recordings().iter().map(|l| (l.file.clone(), l.features.temperature_degc)).collect();
    let page = html(&Page { title, warnings: &warnings, temperatures_degc, advice, ..page });
    output::check_report(path)?;
    Ok(output::write(path, &with_flags(&page))?)
}
