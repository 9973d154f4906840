//! The quantities that are compared, and the tables in which they stand.

use std::fmt;

/// Start of the closure on the recording's clock, s.
pub const CLOSURE_START: &str = "closure_start_s";
/// Period of the oscillation, s.
pub const PERIOD: &str = "period_s";
/// Wave speed from the times before and after the first peak, m/s.
pub const WAVE_SPEED_CROSSINGS: &str = "wave_speed_crossings_m_s";
/// Standard deviation of a sensor's white noise, m.
pub const NOISE: &str = "noise_m";
/// Head of a sensor's first peak, m.
pub const FIRST_PEAK: &str = "first_peak_m";
/// RMSE of the fitted model over all samples, m.
pub const RMSE: &str = "rmse_m";
/// The same over the noise.
pub const RMSE_OVER_NOISE: &str = "rmse_over_noise";
/// Mean absolute error over the extrema, percent.
pub const MAPE: &str = "mape_extrema_percent";

/// A table of the file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Table {
    /// `[inspect]`: what the recording shows without a model.
    Inspect,
    /// `[inspect.sensor.NAME]`: the same of one pressure sensor.
    Sensor(String),
    /// `[calibrate]`: how near the fitted model comes.
    Calibrate,
    /// `[calibrate.parameter]`: its parameters.
    Parameter,
}

impl Table {
    /// The quantities that may stand in it; none where any name may.
    pub fn keys(&self) -> Option<&'static [&'static str]> {
        match self {
            Table::Inspect => Some(&[CLOSURE_START, PERIOD, WAVE_SPEED_CROSSINGS]),
            Table::Sensor(_) => Some(&[NOISE, FIRST_PEAK]),
            Table::Calibrate => Some(&[RMSE, RMSE_OVER_NOISE, MAPE]),
            Table::Parameter => None,
        }
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Table::Inspect => f.write_str("inspect"),
            Table::Sensor(name) => write!(f, "inspect.sensor.{}", key(name)),
            Table::Calibrate => f.write_str("calibrate"),
            Table::Parameter => f.write_str("calibrate.parameter"),
        }
    }
}

/// A quantity by its place in the file; shown as `inspect.sensor.P1.noise_m`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Quantity {
    /// Its table.
    pub table: Table,
    /// Its name there; the unit is part of it.
    pub name: String,
}

impl Quantity {
    /// A quantity of a table.
    pub fn new(table: Table, name: impl Into<String>) -> Self {
        Quantity { table, name: name.into() }
    }
}

impl fmt::Display for Quantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}", self.table, key(&self.name))
    }
}

/// A name as a TOML key: in quotes where it needs them.
pub fn key(name: &str) -> String {
    let bare = !name.is_empty() && name.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_' || b == b'-');
    if bare { name.to_owned() } else { toml::Value::String(name.to_owned()).to_string() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_written_as_toml_keys() {
        assert_eq!(Quantity::new(Table::Sensor("P1".into()), NOISE).to_string(), "inspect.sensor.P1.noise_m");
        let odd = Quantity::new(Table::Parameter, "offset_m[P 1]");
        assert_eq!(odd.to_string(), "calibrate.parameter.\"offset_m[P 1]\"");
        let text = format!("[{}]\n{} = 1", Table::Sensor("a \"b\" c".into()), key("x.y"));
        let parsed: toml::Table = text.parse().unwrap();
        assert_eq!(parsed["inspect"]["sensor"]["a \"b\" c"]["x.y"].as_integer(), Some(1));
    }
}
