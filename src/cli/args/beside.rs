//! `simulate --recording`: what the model is to be shown beside.

use std::path::PathBuf;

/// Options of `simulate`.
#[derive(Debug, clap::Args)]
pub struct Beside {
    /// Simulate these recordings instead of a made-up run, and write a row for each of their samples from shortly
    /// before the closure: file, sensor, time_s, unit, value (the head in m; of a flow meter, the flow before the
    /// closure).
    #[arg(long, value_name = "MCAP", num_args = 1.., conflicts_with_all = ["valve", "duration", "csv_times", "energy"])]
    pub recording: Vec<PathBuf>,
    /// Write the rows of this older table; its values do not matter.
    #[arg(long, value_name = "CSV", requires = "recording")]
    pub times: Option<PathBuf>,
}
