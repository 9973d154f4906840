//! The workbench as a script sees it. What it does is compared with what the commands do.

pub mod client;
mod loop_by_hand;
mod new_rig;
mod record;
mod runs;
mod security;
