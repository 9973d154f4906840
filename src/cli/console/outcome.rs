//! How a command ends, and its exit code.

use std::error::Error;

/// How a command ended, when it did not fail.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// Done: exit 0.
    Done,
    /// The answer is 'no' (a check failed): exit 1.
    No,
    /// Done, but data was lost on the way: exit 3.
    DataLost,
}

impl Outcome {
    /// The exit code.
    pub fn code(self) -> u8 {
        match self {
            Outcome::Done => 0,
            Outcome::No => 1,
            Outcome::DataLost => 3,
        }
    }
}

/// Exit code of an error.
pub(crate) const FAILED: u8 = 2;

/// Any error, for a person to read.
pub type AnyError = Box<dyn Error + Send + Sync>;

/// What a command returns; an error is bad input or usage: exit 2.
pub type CommandResult = Result<Outcome, AnyError>;
