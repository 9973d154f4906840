//! What reaches the terminal, and what a command may write.

pub(crate) mod last_words;
pub(crate) mod live;
