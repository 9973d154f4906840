//! What reaches the terminal, and what a command may write.

pub mod hints;
pub(crate) mod last_words;
pub(crate) mod live;
