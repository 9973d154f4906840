//! How `watch` and `record --calibrate` fit a run by themselves, and what they show of it.

use clap::ValueEnum;
use indicatif::ProgressBar;

use crate::cli::console::print::{tell, tell_warning};
use crate::model::effects::{Chosen, parse_list};
use crate::watch::evaluate::{Notice, Settings};
use crate::watch::verdict::Accept;

/// Options of commands that fit runs by themselves.
#[derive(Debug, Clone, clap::Args)]
pub struct Evaluation {
    /// Effects to start with where no model of the rig was accepted yet [default: viscoelastic-wall for plastic,
    /// unsteady-friction for metal].
    #[arg(long, value_name = "A,B", value_parser = parse_list)]
    effects: Option<::std::vec::Vec<Chosen>>,
    /// Which models become the rig's without `surgescope accept`.
    #[arg(long, value_enum, default_value_t = AcceptWhich::Clean)]
    accept: AcceptWhich,
}

/// Which models are accepted by themselves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum AcceptWhich {
    /// Those of runs in which nothing is missing and whose values are within the rig's history
    Clean,
    /// None
    Never,
}

impl Evaluation {
    /// The same for the library.
    pub fn settings(&self) -> Settings {
        let accept = match self.accept {
            AcceptWhich::Clean => Accept::Clean,
            AcceptWhich::Never => Accept::Never,
        };
        Settings { effects: self.effects.clone(), accept }
    }
}

/// Shows what happens while a run is evaluated.
pub fn show(bar: &ProgressBar, notice: Notice) {
    match notice {
        Notice::Progress(text) => bar.set_message(text),
        Notice::Warning(text) => bar.suspend(|| tell_warning!("{text}")),
        Notice::Left(text) => bar.suspend(|| tell!("{text}")),
    }
}
