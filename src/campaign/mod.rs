//! A campaign: thousands of fits, diagnoses or simulations, planned once, run in shards by any engine, gathered in one
//! table.
//!
//! Nothing in here schedules. A plan file becomes a folder with one task a line; a runner takes one shard of them, and
//! any number of runners may work in one folder, on one machine or on many that share its file system:
//!
//! | file of the folder | what it holds |
//! | --- | --- |
//! | `plan.toml` | the plan as it was given |
//! | `tasks.jsonl` | a task a line, sorted by its name, which is a hash of all that goes into it |
//! | `marks` | a byte a task: missing, done, failed; a runner at work on a task holds the lock of its byte |
//! | `results/*.jsonl` | what runners have found: a file a runner, a line a task, which names the program |
//! | `results/aside/` | results of other programs that were put aside |
//! | `failures/*.jsonl` | why tasks failed, likewise |
//! | `jobs/` | jobs of engines that schedule, and what their shards said |
//! | `inputs/` | copies of the inputs, where they were asked for |

pub mod checksum;
pub mod child;
pub mod engine;
pub mod error;
pub mod folder;
pub mod input;
pub mod lines;
pub mod marks;
pub mod perform;
pub mod plan;
pub mod plan_file;
pub mod program;
pub mod run;
pub mod shard;
pub mod status;
pub mod store;
pub mod table;
pub mod task;
