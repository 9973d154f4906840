//! From a finished recording to its verdict, by itself.
//!
//! | file | what it does |
//! | --- | --- |
//! | [`evaluate`] | one finished recording: fitted, diagnosed, entered in the index |
//! | [`folder`] | which recordings lie in a folder, and whether each has its end |
//! | [`start`] | the model to start from: the rig's last accepted one, or what its material asks for |
//! | [`verdict`] | a diagnosis against the rig's history: what to keep, what to say, whether to accept |

pub mod evaluate;
pub mod folder;
pub mod start;
pub mod verdict;
