//! Results that another version or build of the program has found.

use crate::campaign::folder::Folder;
use crate::campaign::program::{OtherProgram, PROGRAM};
use crate::cli::console::print::tell_warning;
use crate::shown::Shown as _;

/// Says that results of other programs count as done, and how to have them found again.
pub fn warn_of_others(folder: &Folder, others: &[OtherProgram]) {
    for other in others {
        tell_warning!(
            "{} results are of another program: {}. This is {PROGRAM}, which may find other numbers. They count as done; to have their tasks done \
             again, write `surgescope campaign status {} --retry=other-program`, or plan into a new folder",
            other.results,
            other.program.shown(),
            folder.root().shown()
        );
    }
}
