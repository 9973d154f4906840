//! `--ignore P2`: a recording without a sensor.

/// Sensors that are left out.
#[derive(Debug, clap::Args)]
pub struct Ignored {
    /// Leave out these sensors, as if they had not been recorded.
    #[arg(long = "ignore", value_name = "SENSOR,…", value_delimiter = ',')]
    pub sensors: Vec<String>,
}
