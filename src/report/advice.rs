//! What to do next after the result of a page, with the commands to copy. The command line words them.

use crate::report::text::escape::escape;

/// A word as a shell takes it.
pub fn quoted(text: &str) -> String {
    let plain = text.chars().all(|c| c.is_alphanumeric() || "/._-+:\\=,".contains(c));
    if plain && !text.is_empty() { text.to_owned() } else { format!("'{}'", text.replace('\'', "'\\''")) }
}

/// A sentence, and the commands that do what it says.
#[derive(Debug, Clone, PartialEq)]
pub struct Advice {
    /// Why, in a sentence.
    pub why: String,
    /// Commands, as a shell takes them.
    pub commands: Vec<String>,
}

impl Advice {
    /// A sentence, and commands of this program.
    pub fn new(why: impl Into<String>, commands: &[String]) -> Self {
        Advice { why: why.into(), commands: commands.iter().map(|c| format!("surgescope {c}")).collect() }
    }

    /// The line of a page. A click selects a command whole; the page's script adds a button that copies it.
    pub(crate) fn html(&self) -> String {
        let commands: String =
            self.commands.iter().map(|c| format!("<code class=\"command\">{}</code>", escape(c))).collect();
        format!(
            "<div class=\"advice\"><p><strong>What to do next:</strong> {}</p>{commands}</div>\n",
            escape(&self.why)
        )
    }
}
