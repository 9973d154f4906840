//! The line that shows how far a computation has come.

use std::io::{IsTerminal, stderr};
use std::path::Path;
use std::time::Duration;

use indicatif::{HumanBytes, ProgressBar, ProgressStyle};

use crate::cli::console::print::tell;
use crate::fit::outcome::fit::Fit;
use crate::shown::Shown as _;
use crate::study::Study;
use crate::study::error::Error;
use crate::study::models::Opened;

/// Works on a study and shows how far it has come, `title` first.
pub fn shown<T>(study: &mut Study, title: &str, work: impl FnOnce(&Study) -> T) -> T {
    let bar = progress_bar();
    let (line, title) = (bar.clone(), title.to_owned());
    study.on_progress(move |progress| line.set_message(format!("{title}{progress}")));
    let done = work(study);
    bar.finish_and_clear();
    done
}

/// Fits the model in force of a file again and shows how far it has come, `title` first.
///
/// # Errors
/// As [`Opened::refit`].
pub fn refit(at: &mut Opened, title: &str) -> Result<Fit, Error> {
    let bar = progress_bar();
    let (line, title) = (bar.clone(), title.to_owned());
    at.study.on_progress(move |progress| line.set_message(format!("{title}{progress}")));
    let fit = at.refit();
    bar.finish_and_clear();
    fit
}

/// Works on a file and shows that it does.
pub fn busy<T>(file: &Path, work: impl FnOnce() -> T) -> T {
    let bar = progress_bar();
    let size = std::fs::metadata(file).map(|about| about.len()).unwrap_or_default();
    let size = if size > 0 { format!(" ({})", HumanBytes(size)) } else { String::new() };
    bar.set_message(format!("{}{size}", file.shown()));
    let done = work();
    bar.finish_and_clear();
    done
}

/// Time between two lines of progress in a log.
const LOGGED_EVERY: Duration = Duration::from_secs(5);

/// A line on the terminal. Where standard error is no terminal, it becomes a line in the log every five seconds.
pub fn progress_bar() -> ProgressBar {
    if !stderr().is_terminal() {
        let bar = ProgressBar::hidden();
        let watched = bar.downgrade();
        std::thread::spawn(move || {
            loop {
                std::thread::sleep(LOGGED_EVERY);
                let Some(bar) = watched.upgrade().filter(|bar| !bar.is_finished()) else { return };
                tell!("{} s: {}", bar.elapsed().as_secs(), bar.message());
            }
        });
        return bar;
    }
    let style =
        ProgressStyle::with_template("{spinner} {elapsed} {msg}").unwrap_or_else(|_| ProgressStyle::default_spinner());
    let bar = ProgressBar::new_spinner().with_style(style);
    bar.enable_steady_tick(Duration::from_millis(100));
    bar
}
