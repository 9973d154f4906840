//! Measures the recorder against what a lab needs of it; the results stand in `docs/src/measured/recorder.md`.
//!
//! ```sh
//! cargo run --release -p surgescope-tools --bin recorder -- wire 20000 60 target/release/surgescope   # over a pseudo-terminal, in a process of its own
//! cargo run --release -p surgescope-tools --bin recorder -- wire 20000 60 target/release/surgescope view   # with its live view on a terminal
//! cargo run --release -p surgescope-tools --bin recorder -- memory 500000 30                          # frames made in this process
//! cargo run --release -p surgescope-tools --bin recorder -- kills 200 target/release/surgescope       # kill -9 at random moments
//! cargo run --release -p surgescope-tools --bin recorder -- through command 20000 60 target/release/surgescope   # a process as the device, or tcp
//! cargo run --release -p surgescope-tools --bin recorder -- kills 40 target/release/surgescope command   # kill -9 with a process as the device, or tcp
//! cargo run --release -p surgescope-tools --bin recorder -- lives 10 target/release/surgescope        # a process that dies ten times
//! cargo run --release -p surgescope-tools --bin recorder -- device 100000 60 rig.toml                  # the device alone: plays after a line
//! cargo run --release -p surgescope-tools --bin recorder -- check 100000 run.mcap                     # what was recorded of it
//! cargo run --release -p surgescope-tools --bin recorder -- day 24 100                                # a day at 100 Hz, as fast as it goes
//! ```
//!
//! Every sample recorded is compared with the one that was sent; a wrong or missing one ends the program with an error.

mod day;
mod device;
mod kills;
mod lives;
mod ramp;
mod speak;
mod usage;
mod wire;

use std::process::ExitCode;

/// What a measurement returns: an error says what did not hold.
pub type Measured = Result<(), Box<dyn std::error::Error + Send + Sync>>;

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    let number = |text: &str| text.parse::<f64>().map_err(|_| format!("'{text}' is no number"));
    let measured = match words[..] {
        ["wire", rate, seconds, program, ref view @ ..] if view.is_empty() || view == ["view"] => number(rate)
            .and_then(|rate| Ok((rate, number(seconds)?)))
            .map_err(Into::into)
            .and_then(|(rate, seconds)| wire::over_a_pseudoterminal(rate, seconds, program, !view.is_empty())),
        ["memory", rate, seconds] => number(rate)
            .and_then(|rate| Ok((rate, number(seconds)?)))
            .map_err(Into::into)
            .and_then(|(rate, seconds)| wire::in_this_process(rate, seconds)),
        ["device", rate, seconds, rig_file] => number(rate)
            .and_then(|rate| Ok((rate, number(seconds)?)))
            .map_err(Into::into)
            .and_then(|(rate, seconds)| device::play(rate, seconds, rig_file)),
        ["check", rate, file] => number(rate).map_err(Into::into).and_then(|rate| device::check(rate, file)),
        ["kills", count, program, ref way @ ..] if way.len() < 2 => number(count)
            .and_then(|count| Ok((count as usize, way.first().map(|way| way.parse()).transpose()?)))
            .map_err(Into::into)
            .and_then(|(count, way)| kills::run(count, program, way)),
        ["through", way, rate, seconds, program] => way
            .parse()
            .and_then(|way| Ok((way, number(rate)?, number(seconds)?)))
            .map_err(Into::into)
            .and_then(|(way, rate, seconds)| wire::through(way, rate, seconds, program)),
        ["lives", deaths, program] => {
            number(deaths).map_err(Into::into).and_then(|deaths| lives::run(deaths as usize, program))
        }
        // the device of the three above, started by the recorder
        [word @ ("speak" | "die"), rate, seconds, started] => number(rate)
            .and_then(|rate| Ok((rate, number(seconds)?)))
            .map_err(Into::into)
            .and_then(|(rate, seconds)| speak::run(rate, seconds, started, word == "die")),
        ["day", hours, rate] => number(hours)
            .and_then(|hours| Ok((hours, number(rate)?)))
            .map_err(Into::into)
            .and_then(|(hours, rate)| day::run(hours, rate)),
        _ => Err("usage: recorder wire RATE_HZ SECONDS PROGRAM [view] | memory RATE_HZ SECONDS | kills COUNT PROGRAM [command|tcp] | through command|tcp RATE_HZ SECONDS PROGRAM | lives DEATHS PROGRAM | day HOURS RATE_HZ | \
                device RATE_HZ SECONDS RIG | check RATE_HZ FILE"
            .into()),
    };
    match measured {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}
