//! Jobs for engines that schedule: each shard of a campaign is one task of theirs.

use std::fs;
use std::path::{Path, PathBuf};

use crate::campaign::error::{CampaignError, Result};
use crate::campaign::folder::Folder;

/// An engine.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Engine {
    /// HyperQueue: `pip install hyperqueue`.
    HyperQueue,
    /// Slurm.
    Slurm,
    /// Snakemake.
    Snakemake,
}

/// What a job is to do.
pub struct Job<'a> {
    /// The engine that it is for.
    pub engine: Engine,
    /// Shards.
    pub shards: usize,
    /// Cores of each.
    pub threads: usize,
    /// Words that follow those of a runner, quoted.
    pub more: &'a str,
    /// The program.
    pub program: &'a Path,
}

impl Engine {
    fn template(self) -> &'static str {
        match self {
            Engine::HyperQueue => include_str!("engines/hq.sh"),
            Engine::Slurm => include_str!("engines/slurm.sh"),
            Engine::Snakemake => include_str!("engines/Snakefile"),
        }
    }

    /// The name of its file in `jobs/`.
    fn file(self) -> &'static str {
        match self {
            Engine::HyperQueue => "hq.sh",
            Engine::Slurm => "slurm.sh",
            Engine::Snakemake => "Snakefile",
        }
    }
}

/// Writes the job into the campaign's folder, in the place of an older one; returns where it is.
///
/// # Errors
/// A folder that cannot be written to, or whose name is no text.
pub fn write(folder: &Folder, job: &Job) -> Result<PathBuf> {
    let root = folder.root().canonicalize().map_err(CampaignError::io("find", folder.root()))?;
    let logs = root.join("jobs/log");
    fs::create_dir_all(&logs).map_err(CampaignError::unwritten(&logs))?;
    let file = root.join("jobs").join(job.engine.file());
    let text = |path: &Path| path.to_str().map(str::to_owned).ok_or_else(|| CampaignError::Name(path.to_owned()));
    fs::write(&file, filled(job, &text(&root)?, &text(job.program)?, &text(&file)?))
        .map_err(CampaignError::unwritten(&file))?;
    Ok(file)
}

fn filled(job: &Job, root: &str, program: &str, file: &str) -> String {
    let literal = |text: &str| serde_json::Value::from(text).to_string();
    // a comment ends with its line
    let comment = quoted(file).replace(['\n', '\r'], "?");
    let parts = [
        ("@SHARDS@", job.shards.to_string()),
        ("@THREADS@", job.threads.to_string()),
        ("@LIMIT@", job.more.to_owned()),
        ("@FILE@", comment),
        ("@DIR@", quoted(root)),
        ("@PROGRAM@", quoted(program)),
        ("@DIR_TEXT@", literal(root)),
        ("@PROGRAM_TEXT@", literal(program)),
    ];
    let mut rest = job.engine.template();
    let mut text = String::new();
    // each place once, from left to right: what is put in is not looked at again
    while let Some(at) = rest.find('@') {
        text += &rest[..at];
        let found = parts.iter().find(|(name, _)| rest[at..].starts_with(name));
        text += found.map_or("@", |(_, value)| value);
        rest = &rest[at + found.map_or(1, |(name, _)| name.len())..];
    }
    text + rest
}

/// A word as a shell takes it.
pub fn quoted(word: &str) -> String {
    format!("'{}'", word.replace('\'', "'\\''"))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A name that a careless script would take apart, or run.
    const ROOT: &str = "/data/it's $(touch x) \"@DIR@\" {a}";

    fn job(engine: Engine) -> String {
        let job = Job { engine, shards: 7, threads: 2, more: "", program: Path::new("") };
        filled(&job, ROOT, "/opt/my tools/surgescope", "/data/f")
    }

    #[test]
    #[cfg(unix)]
    fn a_shell_reads_paths_as_they_are() {
        for (engine, variable) in [(Engine::HyperQueue, "HQ_TASK_ID"), (Engine::Slurm, "SLURM_ARRAY_TASK_ID")] {
            let text = job(engine);
            // what would be run, without running it
            let shown = text.replace("exec >>", ": ").replace("exec ", "printf '%s\\n' ");
            let out = std::process::Command::new("sh").args(["-c", &shown]).env(variable, "3").output().unwrap();
            let out = String::from_utf8(out.stdout).unwrap();
            let words: Vec<&str> = out.lines().collect();
            let expected = ["/opt/my tools/surgescope", "campaign", "run", ROOT];
            assert_eq!((&words[..4], words[5]), (&expected[..], "3/7"), "{text}");
        }
    }

    #[test]
    fn nothing_is_left_to_be_filled_in() {
        for engine in [Engine::HyperQueue, Engine::Slurm, Engine::Snakemake] {
            let text = job(engine).replace("@DIR@", "");
            assert!(!text.contains('@') && text.contains('7'), "{text}");
        }
        assert!(job(Engine::Snakemake).contains("DIR = \"/data/it's $(touch x) \\\"@DIR@\\\" {a}\""));
    }
}
