//! How files of other programs are read: names, units of time, zones. Shared by all of `import`'s formats.

use chrono::DateTime;
use encoding_rs::Encoding;

use crate::cli::args::values::positive;
use crate::draft::answers::flow;
use crate::report::advice::quoted;
use crate::storage::import::{Line, MessageTime, SourceOptions, encoding_named, time_symbol, time_unit, zone_seconds};
use crate::units::Unit;

/// Options for what a file does not state.
#[derive(Debug, Clone, clap::Args)]
pub struct ForeignArgs {
    /// Assign a column, channel or field to a sensor: 'Druck 1=P1', "/'Group'/'Channel'=P1", /topic.field.sub=P1.
    #[arg(long, value_name = "NAME=SENSOR", value_parser = mapping)]
    map: Vec<(String, String)>,
    /// Ignore a column; '*' ignores all columns without a sensor of that name.
    #[arg(long, value_name = "NAME")]
    ignore: Vec<String>,
    /// Time zone of date-times without one, such as +01:00 [default: UTC].
    #[arg(long, value_name = "ZONE", value_parser = zone, allow_hyphen_values = true)]
    zone: Option<i32>,
    /// Whether 03/04/2026 is the third of April (dmy) or the fourth of March (mdy), if the dates of the file leave it
    /// open.
    #[arg(long, value_name = "ORDER", value_parser = ["dmy", "mdy"])]
    date_order: Option<String>,
    /// Unit of times without one in their heading: s, ms, us, ns, min, h or d (days); also of --time-field.
    #[arg(long, value_name = "UNIT", value_parser = unit)]
    time_unit: Option<f64>,
    /// Samples per second, where a column counts samples instead of giving times.
    #[arg(long, value_name = "HZ", value_parser = positive, allow_negative_numbers = true)]
    pub rate: Option<f64>,
    /// What a column's numbers stand for, in a unit or in the sensor's: 'P1=0.5..4.5 -> 0..1000 kPa' for a transducer
    /// of 0.5 to 4.5 V, or its line, 'P1=250*x-125 kPa'; or the unit that they are in, 'P1=psi'.
    #[arg(long, value_name = "SENSOR=A*x+B", value_parser = scale)]
    pub scale: Vec<(String, Line)>,
    /// Flow before the closure, where it was measured by hand (bucket and clock): '0.25 L/s'. It becomes a reading of
    /// the rig's flow sensor.
    #[arg(long, value_name = "FLOW", value_parser = flow)]
    pub flow: Option<(f64, Unit)>,
    /// Code page of a text that is not UTF-8, where the guess is wrong: cp932, cp1250, cp1251, gbk, latin1, utf-16, ….
    #[arg(long, value_name = "NAME", value_parser = encoding_named)]
    encoding: Option<&'static Encoding>,
    /// Time of an MCAP message: when it was logged or published.
    #[arg(long, value_name = "WHICH", value_parser = ["log", "publish"], conflicts_with = "time_field")]
    message_time: Option<String>,
    /// Field of an MCAP message with its time: a number, or seconds and nanoseconds.
    #[arg(long, value_name = "FIELD")]
    time_field: Option<String>,
}

impl ForeignArgs {
    /// As the readers want them.
    pub fn options(self) -> SourceOptions {
        let message_time = match (self.time_field, self.message_time.as_deref()) {
            (Some(field), _) => MessageTime::Field(field),
            (None, Some("publish")) => MessageTime::Publish,
            _ => MessageTime::Log,
        };
        SourceOptions {
            map: self.map,
            ignore: self.ignore,
            zone_s: self.zone,
            day_first: self.date_order.map(|order| order == "dmy"),
            time_unit_s: self.time_unit,
            message_time,
            rate_hz: self.rate,
            scales: self.scale,
            flow: self.flow,
            encoding: self.encoding,
            guess: false,
            elsewhere: Vec::new(),
            period_s: None,
        }
    }
}

impl std::fmt::Display for ForeignArgs {
    /// The options as a shell takes them, each after a blank.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut option = |name: &str, value: &str| write!(f, " --{name} {}", quoted(value));
        self.map.iter().try_for_each(|(from, to)| option("map", &format!("{from}={to}")))?;
        self.ignore.iter().try_for_each(|name| option("ignore", name))?;
        self.scale.iter().try_for_each(|(name, line)| option("scale", &format!("{name}={line}")))?;
        self.flow.iter().try_for_each(|(value, unit)| option("flow", &format!("{value} {unit}")))?;
        self.rate.iter().try_for_each(|hz| option("rate", &hz.to_string()))?;
        self.time_unit.iter().try_for_each(|unit_s| option("time-unit", time_symbol(*unit_s)))?;
        self.date_order.iter().try_for_each(|order| option("date-order", order))?;
        self.encoding.iter().try_for_each(|encoding| option("encoding", encoding.name()))?;
        self.message_time.iter().try_for_each(|which| option("message-time", which))?;
        self.time_field.iter().try_for_each(|field| option("time-field", field))?;
        self.zone.iter().try_for_each(|east_s| {
            let (hours, minutes) = (east_s.abs() / 3600, east_s.abs() / 60 % 60);
            option("zone", &format!("{}{hours:02}:{minutes:02}", if *east_s < 0 { '-' } else { '+' }))
        })
    }
}

fn mapping(text: &str) -> Result<(String, String), String> {
    let (name, sensor) = text.rsplit_once('=').ok_or("write it like 'Column name=P1'")?;
    match (name.trim(), sensor.trim()) {
        ("", _) | (_, "") => Err("write it like 'Column name=P1'".into()),
        (name, sensor) => Ok((name.into(), sensor.into())),
    }
}

/// `P1=250*x-125 kPa`, `P1=0.03*x`, `P1=x-2`, `P1=1..5 -> 0..10 bar`, `P1=psi`.
fn scale(text: &str) -> Result<(String, Line), String> {
    let wrong = || format!("'{text}': write it like 'P1=1..5 -> 0..10 bar' or 'P1=2.5*x-2.5 bar' or 'P1=psi'");
    let (name, line) = text.rsplit_once('=').ok_or_else(wrong)?;
    let line = line.parse().map_err(|_| wrong())?;
    if name.trim().is_empty() { Err(wrong()) } else { Ok((name.trim().to_owned(), line)) }
}

fn zone(text: &str) -> Result<i32, String> {
    match text.to_ascii_uppercase().as_str() {
        "UTC" | "Z" | "GMT" => Ok(0),
        _ => {
            zone_seconds(text).ok_or_else(|| "write it like +01:00, -05:00 or UTC; zone names are not supported".into())
        }
    }
}

fn unit(text: &str) -> Result<f64, String> {
    time_unit(text).ok_or_else(|| "must be s, ms, us, ns, min, h or d".into())
}

/// A start, for all files or for one: `2026-03-14T09:26:53Z`, `fast.csv=2026-03-14T09:26:53.25Z`.
pub fn start(text: &str) -> Result<(Option<String>, u64), String> {
    let (file, time) = match text.rsplit_once('=') {
        Some((file, time)) => (Some(file.to_string()), time),
        None => (None, text),
    };
    let time = DateTime::parse_from_rfc3339(time).map_err(|e| format!("{e}; write it like 2026-03-14T09:26:53Z"))?;
    let ns = time.timestamp_nanos_opt().and_then(|ns| u64::try_from(ns).ok());
    ns.map(|ns| (file, ns)).ok_or_else(|| "must lie between 1970 and 2262".into())
}
