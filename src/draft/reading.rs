//! How a file is to be read: what a person writes of its text and times, and what to ask where the file does not say
//! it.

use serde::Deserialize;

use crate::draft::answers::RATE;
use crate::draft::remark::{Remark, Weight, taken};
use crate::shown::options::named;
use crate::storage::LogError;
use crate::storage::import::{MessageTime, Repair, SourceOptions, encoding_named, time_unit, zone_seconds};

/// Fields about the reading of a file; one that was left empty is an empty text.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Reading {
    /// Samples per second of a file that counts them.
    pub rate: String,
    /// Unit of the times.
    pub time_unit: String,
    /// `dmy` or `mdy`.
    pub date_order: String,
    /// Zone of date-times.
    pub zone: String,
    /// Which time of a message counts, `log` or `publish`.
    pub message_time: String,
    /// The field of a message with its time.
    pub time_field: String,
    /// Code page of the text.
    pub encoding: String,
}

/// The fields by the names of the library's options.
const FIELDS: [&str; 7] = ["rate", "time_unit", "date_order", "zone", "message_time", "time_field", "encoding"];

impl Reading {
    /// As the readers want it. What else a file does not say is guessed, and [`asked`](Reading::asked) for.
    pub fn options(&self, remarks: &mut Vec<Remark>) -> SourceOptions {
        let order = |text: &str| match text {
            "dmy" => Ok(true),
            "mdy" => Ok(false),
            _ => Err("choose day or month first".to_owned()),
        };
        let zone = |text: &str| match text.to_ascii_uppercase().as_str() {
            "UTC" | "Z" | "GMT" => Ok(0),
            _ => zone_seconds(text).ok_or_else(|| "write it like +01:00, -05:00 or UTC".to_owned()),
        };
        let unit = |text: &str| time_unit(text).ok_or_else(|| "it must be s, ms, us, ns, min, h or d".to_owned());
        let which = |text: &str| match text {
            "log" => Ok(MessageTime::Log),
            "publish" => Ok(MessageTime::Publish),
            _ => Err("choose one of the times".to_owned()),
        };
        let of_messages = taken(&self.message_time, "message_time", which, remarks);
        let in_a_field = Some(self.time_field.trim()).filter(|text| !text.is_empty());
        SourceOptions {
            guess: true,
            rate_hz: taken(&self.rate, "rate", |text| RATE.parse(text), remarks),
            time_unit_s: taken(&self.time_unit, "time_unit", unit, remarks),
            day_first: taken(&self.date_order, "date_order", order, remarks),
            zone_s: taken(&self.zone, "zone", zone, remarks),
            encoding: taken(&self.encoding, "encoding", encoding_named, remarks),
            message_time: in_a_field
                .map(|field| MessageTime::Field(field.to_owned()))
                .or(of_messages)
                .unwrap_or_default(),
            ..SourceOptions::default()
        }
    }

    /// What to ask of a file that cannot be read: the fields that its error names.
    pub fn unread(error: &LogError) -> Vec<Remark> {
        let needed = |field| Remark::new(Weight::Open, field, "the file does not say it");
        fields_in(&error.to_string()).into_iter().map(needed).collect()
    }

    /// What the reader of a file guessed of its times is asked for; what it took else, and names a field for, stands
    /// beside that field.
    pub fn asked(&self, repairs: &[Repair]) -> Vec<Remark> {
        let open = [("time-unit", "time_unit", &self.time_unit), ("date-order", "date_order", &self.date_order)];
        let guess = |what: &str| repairs.iter().find(|repair| repair.guessed && repair.what == what);
        let ask = |field: &str, guess: &Repair| {
            Remark::new(Weight::Open, field, format!("the file does not say it; it looks as if {}", guess.text))
        };
        let unanswered = open.iter().filter(|(.., text)| text.trim().is_empty());
        let mut remarks: Vec<Remark> =
            unanswered.filter_map(|(what, field, _)| Some(ask(field, guess(what)?))).collect();
        for repair in repairs.iter().filter(|repair| open.iter().all(|(what, ..)| repair.what != *what)) {
            let named = fields_in(&repair.text).into_iter();
            remarks.extend(named.map(|field| Remark::new(Weight::Assumed, field, repair.text.clone())));
        }
        remarks
    }
}

/// The fields that a text names as options.
fn fields_in(text: &str) -> Vec<&'static str> {
    let options: Vec<String> = named(text).iter().map(|option| option.name.replace('-', "_")).collect();
    FIELDS.into_iter().filter(|field| options.iter().any(|option| option == field)).collect()
}
