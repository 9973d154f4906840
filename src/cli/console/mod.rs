//! What reaches the terminal, and what a command may write.

pub mod advice;
pub(crate) mod ask;
pub(crate) mod document;
pub(crate) mod hints;
pub(crate) mod last_words;
pub(crate) mod live;
pub mod outcome;
pub mod own_program;
pub(crate) mod page;
pub(crate) mod print;
pub(crate) mod progress;
pub(crate) mod recorded;
pub mod refusal;
pub(crate) mod stop;
pub mod understood;
