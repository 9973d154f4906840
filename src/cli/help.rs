//! The program's help: its commands by what a person is doing, and a short text on each topic.

use clap::Command;

use crate::cli::console::outcome::{CommandResult, Outcome};
use crate::cli::console::print::say_text;

/// Headings, and the commands below each; the first group is for a newcomer. `help` itself is in none.
pub(crate) const GROUPS: [(&str, &[&str]); 8] = [
    ("Start here", &["demo", "open", "import", "calibrate", "diagnose"]),
    ("Record", &["record", "ports", "rig", "recover"]),
    ("Look at a recording", &["inspect", "frequency", "valve"]),
    ("Model", &["effects", "simulate", "add", "refit", "undo", "model", "creep", "family"]),
    ("Check the model", &["predict", "cross-validate", "sensitivity", "explain", "next"]),
    ("Run by itself", &["watch", "accept", "history", "replay", "campaign"]),
    ("Exchange", &["export", "layout", "results", "pest"]),
    ("Install", &["completions", "man"]),
];

/// A short text that leads on.
pub(crate) struct Topic {
    /// What `help` is asked for.
    pub(crate) name: &'static str,
    /// In one line.
    about: &'static str,
    /// The text.
    pub(crate) text: &'static str,
}

/// All topics, in the order of a test.
pub(crate) const TOPICS: [Topic; 7] = [
    Topic {
        name: "recording",
        about: "record a live test, and what to do when it goes wrong",
        text: "\
A rig file describes pipes, sensors and devices; `rig check` finds its contradictions.

  surgescope rig check rig.toml
  surgescope ports --rig rig.toml            # can all devices be opened?
  surgescope record --rig rig.toml -o run.mcap
  surgescope record --rig rig.toml --trigger edge --out-dir shots

Recording ends with Ctrl-C, after --duration, or when the stream ends. Lost samples are recorded as
gaps; exit code 3 says that data was lost. A recording that was cut off can be saved:

  surgescope recover run.mcap -o whole.mcap

Without hardware, --simulate records a simulated test, and --replay plays a file as if it were live.
",
    },
    Topic {
        name: "importing",
        about: "turn files of other programs into recordings",
        text: "\
CSV, other tables, workbooks, TDMS and MCAP of other programs become recordings, which contain the rig
file. `rig new` writes a rig file from a few answers and the columns of a table.

  surgescope rig new run.csv -o rig.toml
  surgescope import run.csv --rig rig.toml -o run.mcap

What a file does not say is guessed and shown; --yes accepts it without a question.

  surgescope import lab.tdms --rig rig.toml --map Druck1=P1 --ignore * -o run.mcap
  surgescope import fast.csv slow.csv --rig rig.toml -o run.mcap   # one closure, two loggers

The way back:

  surgescope export run.mcap -o run.csv
",
    },
    Topic {
        name: "calibration",
        about: "fit a model, hold parameters, choose a method",
        text: "\
A model is the base model (elastic pipe, steady friction) plus effects; `effects` lists them.

  surgescope calibrate run.mcap --effects viscoelastic-wall:2 --report run.html
  surgescope calibrate run.mcap --hold closing_time_s=0.1
  surgescope calibrate run.mcap --method global-local
  surgescope calibrate run.mcap --save model.toml     # keep the model
  surgescope calibrate run.mcap -o fit.toml           # keep the result
  surgescope refit model.toml                         # after editing it

Several recordings of one rig share wave speed, creep and the like.
",
    },
    Topic {
        name: "diagnosis",
        about: "find out which effect a model lacks, and grow the model",
        text: "\
A diagnosis fits the start model, adds each effect of the catalogue in turn, and weighs the evidence.

  surgescope diagnose run.mcap --report run.html
  surgescope diagnose run.mcap --until-done
  surgescope diagnose run.mcap --apply model.toml     # add what is missing
  surgescope add leak model.toml                      # or add it yourself
  surgescope undo model.toml

The verdict is `missing-effect`, `nothing-missing` or `unknown-effect`. If the recordings cannot
distinguish two effects, the diagnosis names a test that can; `next` computes more of that:

  surgescope next model.toml                          # tests with their expected odds
",
    },
    Topic {
        name: "trust",
        about: "how far to trust a fitted model",
        text: "\
A small error is no proof of a good model. What tells more:

  surgescope cross-validate run.mcap --effects viscoelastic-wall
  surgescope predict model.toml other.mcap            # another flow or closure
  surgescope calibrate run.mcap --profile all         # intervals by profile likelihood
  surgescope sensitivity rig.toml --model model.toml

A model that predicts worse than it fits is overfitted, or lacks physics.
",
    },
    Topic {
        name: "materials",
        about: "creep tests and temperatures",
        text: "\
Creep tests of the pipe's material give priors for the wall. Runs at several temperatures show how
wave speed and creep depend on temperature.

  surgescope creep creep.csv -o creep.toml
  surgescope calibrate run.mcap --effects viscoelastic-wall --creep creep.toml
  surgescope family cold.mcap warm.mcap hot.mcap --report family.html
",
    },
    Topic {
        name: "automation",
        about: "let the program fit each recording, and check results in CI",
        text: "\
The program can fit each recording as it appears, and compare results with those kept beside recordings.

  surgescope record --rig rig.toml -o run.mcap --calibrate
  surgescope watch folder
  surgescope accept folder/run.mcap                   # later runs start from its model
  surgescope history --folder folder
  surgescope replay recordings                        # are results still the same?

All commands take --json: one document on standard output. Exit codes: 0 done, 1 the answer is no,
2 bad input, 3 done but data was lost.
",
    },
];

/// The program's help with its commands in groups.
pub(crate) fn grouped(command: Command) -> Command {
    let width = command.get_subcommands().map(|c| c.get_name().len()).max().unwrap_or(0);
    let mut text = String::new();
    for (heading, names) in GROUPS {
        text += &format!("{heading}:\n");
        for name in names {
            let about = command.find_subcommand(name).and_then(Command::get_about).map(ToString::to_string);
            text += &format!("  {name:width$}  {}\n", about.unwrap_or_default());
        }
        text.push('\n');
    }
    let topics: Vec<String> = TOPICS.iter().map(|t| format!("  help {:width$} {}", t.name, t.about)).collect();
    command
        .help_template("{about-with-newline}\n{usage-heading} {usage}\n\n{before-help}Options:\n{options}{after-help}")
        .before_help(text.trim_end().to_owned())
        .after_help(format!(
            "More:\n  help COMMAND{:1$} all options of a command\n{2}",
            "",
            width - 7,
            topics.join("\n")
        ))
}

/// Explain a command or a topic.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A command, such as calibrate, or a topic, such as recording.
    #[arg(value_name = "COMMAND|TOPIC")]
    of: Vec<String>,
}

/// Prints the help of a command, the text of a topic, or the program's help.
///
/// # Errors
/// A name that is neither.
pub fn run(args: &Args, mut command: Command) -> CommandResult {
    if let [name] = &args.of[..]
        && let Some(topic) = TOPICS.iter().find(|t| t.name == name)
    {
        say_text!(topic.text);
        return Ok(Outcome::Done);
    }
    command.build();
    let mut at = &mut command;
    for name in &args.of {
        let topics = TOPICS.map(|t| t.name).join(", ");
        let unknown =
            || format!("no command or topic '{name}': `surgescope --help` lists the commands; topics are {topics}");
        at = at.find_subcommand_mut(name).ok_or_else(unknown)?;
    }
    say_text!(at.render_long_help());
    Ok(Outcome::Done)
}
