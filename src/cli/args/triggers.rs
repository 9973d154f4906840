//! `record --trigger`: shots around the valve's closure instead of one long recording.

use std::error::Error;
use std::path::PathBuf;

use crate::cli::args::values::{number, positive};
use crate::cli::console::print::tell;
use crate::record::session::live_test::Options;
use crate::record::session::output::check_folder;
use crate::record::session::shots::Plan;
use crate::record::session::trigger::{Condition, Settings};
use crate::rig::{Rig, SensorKind};
use crate::shown::Shown as _;

/// Options of a triggered recording.
#[derive(Debug, clap::Args)]
pub struct Triggers {
    /// Record each shot in its own file. The trigger is an `edge` of the valve's command (a sensor of kind trigger),
    /// `level=V` reached from below, or a rise of `slope=V` per second (over 20 ms), V in the sensor's unit. It is
    /// armed after --pre seconds of quiet.
    #[arg(long, value_name = "edge|level=V|slope=V", value_parser = condition, requires = "out_dir", conflicts_with = "output",
          allow_hyphen_values = true)]
    trigger: Option<Condition>,
    /// Sensor of the trigger [default: for an edge, the rig's only trigger channel; otherwise the pressure sensor
    /// nearest to the valve].
    #[arg(long, value_name = "SENSOR", requires = "trigger")]
    trigger_sensor: Option<String>,
    /// Seconds of a shot before the trigger.
    #[arg(long, value_name = "S", default_value_t = 2.0, value_parser = positive, requires = "trigger", allow_negative_numbers = true)]
    pre: f64,
    /// Seconds of a shot after the trigger.
    #[arg(long, value_name = "S", default_value_t = 20.0, value_parser = positive, requires = "trigger", allow_negative_numbers = true)]
    post: f64,
    /// Stop after this many shots.
    #[arg(long, value_name = "N", requires = "trigger", value_parser = clap::value_parser!(u32).range(1..))]
    shots: Option<u32>,
    /// Folder of the shots, named RIG-START-NUMBER.mcap with the start in UTC; created if missing.
    #[arg(long, value_name = "DIR", requires = "trigger")]
    out_dir: Option<PathBuf>,
}

/// `edge`, `level=V` or `slope=V`.
fn condition(text: &str) -> Result<Condition, String> {
    match text.split_once('=') {
        None if text.trim() == "edge" => Ok(Condition::Edge),
        Some((name, value)) if name.trim() == "level" => Ok(Condition::Level(number(value)?)),
        Some((name, value)) if name.trim() == "slope" => Ok(Condition::Slope(positive(value)?)),
        _ => Err("must be edge, level=V or slope=V".to_owned()),
    }
}

impl Triggers {
    /// The options of a session on `rig`, with the shots in them where they are asked for; makes their folder.
    ///
    /// # Errors
    /// A rig without a sensor to fire, a folder that cannot be made or written to.
    pub fn applied(&self, options: &Options, rig: &Rig) -> Result<Options, Box<dyn Error + Send + Sync>> {
        let (Some(condition), Some(folder)) = (self.trigger, &self.out_dir) else { return Ok(options.clone()) };
        let sensor = self.sensor(condition, rig)?;
        check_folder(folder)?;
        let nanoseconds = |s: f64| (s * 1e9).round() as i64;
        let trigger = Settings { condition, pre_ns: nanoseconds(self.pre), post_ns: nanoseconds(self.post) };
        tell!(
            "shots from {} s before to {} s after the trigger on {} are written to {}",
            self.pre,
            self.post,
            rig.sensors[sensor].name,
            folder.shown()
        );
        let most = self.shots.map(|n| n as usize);
        let plan = Plan { trigger, sensor, most, folder: folder.clone() };
        Ok(Options { shots: Some(plan), ..options.clone() })
    }

    fn sensor(&self, condition: Condition, rig: &Rig) -> Result<usize, String> {
        if let Some(name) = &self.trigger_sensor {
            let known = || rig.sensors.iter().map(|s| s.name.as_str()).collect::<Vec<_>>().join(", ");
            let place = rig.sensors.iter().position(|s| s.name == *name);
            return place
                .ok_or_else(|| format!("rig '{}' has no sensor '{name}' to trigger on; it has {}", rig.name, known()));
        }
        if condition == Condition::Edge {
            let channels: Vec<usize> =
                (0..rig.sensors.len()).filter(|&i| rig.sensors[i].kind == SensorKind::Trigger).collect();
            return match channels[..] {
                [one] => Ok(one),
                _ => Err(format!(
                    "rig '{}' has {} sensors of kind trigger: choose one with --trigger-sensor, or use level=V or slope=V",
                    rig.name,
                    channels.len()
                )),
            };
        }
        let nearest = rig.pressure_sensors().max_by(|a, b| a.1.position_m.total_cmp(&b.1.position_m));
        nearest.map(|(i, _)| i).ok_or_else(|| format!("rig '{}' has no pressure sensor to trigger on", rig.name))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn conditions_are_read_and_slips_are_explained() {
        assert_eq!(condition("edge"), Ok(Condition::Edge));
        assert_eq!(condition("level=-3.5"), Ok(Condition::Level(-3.5)));
        assert_eq!(condition("slope = 200"), Ok(Condition::Slope(200.0)));
        assert!(condition("slope=0").is_err() && condition("level").is_err() && condition("level=high").is_err());
    }
}
