//! Names that must be unique.

use std::collections::HashSet;

use crate::rig::table::{At, Section};

/// The names of one kind of thing so far.
pub(crate) struct Names {
    sort: &'static str,
    taken: HashSet<String>,
}

impl Names {
    pub fn new(sort: &'static str) -> Self {
        Names { sort, taken: HashSet::new() }
    }

    /// Takes a name; reports it if it is already taken.
    pub fn check(&mut self, section: &Section<'_>, name: Option<&At<&str>>) {
        if let Some(name) = name
            && !self.taken.insert(name.value.to_owned())
        {
            section.fault_at(
                &name.place,
                format!("a second {} named '{}'; give each its own name", self.sort, name.value),
            );
        }
    }
}
