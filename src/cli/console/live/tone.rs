//! How a line is coloured.

/// What a line is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Tone {
    Plain,
    Heading,
    Good,
    Alarm,
}
