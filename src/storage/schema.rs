//! The protobuf messages of a log, and the descriptor that travels in each file so that any MCAP tool can decode them.
//!
//! The syntax is proto2: its `required` fields stand in the bytes even when they are zero, so that an empty message is
//! damage and never a sample of value 0.

use prost::Message;
use prost_types::field_descriptor_proto::{Label, Type};
use prost_types::{DescriptorProto, FieldDescriptorProto, FieldOptions, FileDescriptorProto, FileDescriptorSet};

/// One sample, `surgescope.Sample`. The message's log time is the sample's time.
#[derive(Clone, PartialEq, Message)]
pub struct Sample {
    /// Value in the sensor's unit.
    #[prost(double, optional, tag = "1")]
    pub value: Option<f64>,
    /// Recording time, s, only where it does not fall on a whole nanosecond.
    #[prost(double, optional, tag = "2")]
    pub time_s: Option<f64>,
}

/// Successive samples of a fast sensor, `surgescope.Block`. The message's log time is that of the first.
#[derive(Clone, PartialEq, Message)]
pub struct Block {
    /// Sample period, ns: sample i lies `round(i·period_ns)` after the first.
    #[prost(double, optional, tag = "1")]
    pub period_ns: Option<f64>,
    /// Values in the sensor's unit.
    #[prost(double, repeated, packed = "true", tag = "2")]
    pub values: Vec<f64>,
    /// Recording times, s, one a value, only where the period does not give them exactly.
    #[prost(double, repeated, packed = "true", tag = "3")]
    pub times_s: Vec<f64>,
}

/// Period and values, eight bytes each, of a block as the recorder writes nearly all of them: a period, then values,
/// and nothing else.
pub fn plain_block(data: &[u8]) -> Option<(f64, &[u8])> {
    let (period_ns, rest) = data.strip_prefix(&[0x09])?.split_first_chunk()?;
    let mut rest = rest.strip_prefix(&[0x12])?;
    let mut length = 0;
    for shift in (0..28).step_by(7) {
        let (byte, after) = rest.split_first()?;
        (length, rest) = (length | usize::from(byte & 0x7F) << shift, after);
        if byte & 0x80 == 0 {
            break;
        }
    }
    let period_ns = f64::from_le_bytes(*period_ns);
    let plain = rest.len() == length && length.is_multiple_of(8) && period_ns.is_finite() && period_ns >= 0.0;
    plain.then_some((period_ns, rest))
}

/// A stretch known to be lost, `surgescope.Gap`. The message's log time is the end of it.
#[derive(Clone, PartialEq, Message)]
pub struct Gap {
    /// Recording time of the last sample before it, s.
    #[prost(double, optional, tag = "1")]
    pub from_s: Option<f64>,
    /// Recording time of the first sample after it, s.
    #[prost(double, optional, tag = "2")]
    pub to_s: Option<f64>,
    /// Number of samples lost, where it is known.
    #[prost(uint64, optional, tag = "3")]
    pub samples: Option<u64>,
}

/// Which message a channel carries.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// [`Sample`].
    Sample,
    /// [`Block`].
    Block,
    /// [`Gap`].
    Gap,
}

impl Kind {
    /// All three, in the order of their discriminants.
    pub const ALL: [Kind; 3] = [Kind::Sample, Kind::Block, Kind::Gap];

    /// Name of the schema record.
    pub fn schema_name(self) -> &'static str {
        match self {
            Kind::Sample => "surgescope.Sample",
            Kind::Block => "surgescope.Block",
            Kind::Gap => "surgescope.Gap",
        }
    }

    /// Topic of a sensor's messages of this kind.
    pub fn topic(self, sensor: &str) -> String {
        match self {
            Kind::Sample => format!("/{sensor}"),
            Kind::Block => format!("/{sensor}/blocks"),
            Kind::Gap => format!("/{sensor}/gaps"),
        }
    }
}

/// What a model shows at the time of a sample, `surgescope.Modelled`. No recorder writes it: its channels stand beside
/// the data.
#[derive(Clone, PartialEq, Message)]
pub struct Modelled {
    /// Value in the sensor's unit.
    #[prost(double, optional, tag = "1")]
    pub value: Option<f64>,
}

/// Name of the schema of [`Modelled`].
pub const MODELLED: &str = "surgescope.Modelled";

/// Which of a model's two channels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shows {
    /// What the sensor would show if the model were the truth.
    Model,
    /// Measured minus modelled.
    Residual,
}

impl Shows {
    /// Both, in the order of their discriminants.
    pub const ALL: [Shows; 2] = [Shows::Model, Shows::Residual];

    /// How the channel's metadata call it.
    pub fn name(self) -> &'static str {
        match self {
            Shows::Model => "model",
            Shows::Residual => "residual",
        }
    }

    /// Topic of a sensor's channel.
    pub fn topic(self, sensor: &str) -> String {
        format!("/{sensor}/{}", self.name())
    }
}

/// The serialized `FileDescriptorSet` of the three messages, the data of each schema record.
pub fn descriptor_set() -> Vec<u8> {
    encoded(
        "surgescope.proto",
        vec![
            message(
                "Sample",
                vec![
                    field("value", 1, Label::Required, Type::Double),
                    field("time_s", 2, Label::Optional, Type::Double),
                ],
            ),
            message(
                "Block",
                vec![
                    field("period_ns", 1, Label::Required, Type::Double),
                    field("values", 2, Label::Repeated, Type::Double),
                    field("times_s", 3, Label::Repeated, Type::Double),
                ],
            ),
            message(
                "Gap",
                vec![
                    field("from_s", 1, Label::Required, Type::Double),
                    field("to_s", 2, Label::Required, Type::Double),
                    field("samples", 3, Label::Optional, Type::Uint64),
                ],
            ),
        ],
    )
}

/// The same of [`Modelled`].
pub fn modelled_descriptor_set() -> Vec<u8> {
    let value = field("value", 1, Label::Required, Type::Double);
    encoded("surgescope_modelled.proto", vec![message("Modelled", vec![value])])
}

fn field(name: &str, number: i32, label: Label, kind: Type) -> FieldDescriptorProto {
    FieldDescriptorProto {
        name: Some(name.into()),
        number: Some(number),
        label: Some(label.into()),
        r#type: Some(kind.into()),
        json_name: Some(camel_case(name)),
        options: (label == Label::Repeated).then(|| FieldOptions { packed: Some(true), ..Default::default() }),
        ..Default::default()
    }
}

fn message(name: &str, field: Vec<FieldDescriptorProto>) -> DescriptorProto {
    DescriptorProto { name: Some(name.into()), field, ..Default::default() }
}

fn encoded(name: &str, message_type: Vec<DescriptorProto>) -> Vec<u8> {
    let file = FileDescriptorProto {
        name: Some(name.into()),
        package: Some("surgescope".into()),
        syntax: Some("proto2".into()),
        message_type,
        ..Default::default()
    };
    FileDescriptorSet { file: vec![file] }.encode_to_vec()
}

fn camel_case(name: &str) -> String {
    let mut words = name.split('_');
    let first = words.next().unwrap_or_default().to_string();
    words.fold(first, |camel, word| {
        let (head, tail) = word.split_at(1.min(word.len()));
        camel + &head.to_uppercase() + tail
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_descriptor_names_every_message_and_field_as_it_is_encoded() {
        let set = FileDescriptorSet::decode(&descriptor_set()[..]).unwrap();
        let messages = &set.file[0].message_type;
        for kind in Kind::ALL {
            let name = kind.schema_name().strip_prefix("surgescope.").unwrap();
            assert!(messages.iter().any(|m| m.name() == name), "{name}");
        }
        // Field 1 of Sample is a double: tag byte (1 << 3) | 1, then eight bytes.
        let bytes = Sample { value: Some(0.0), time_s: None }.encode_to_vec();
        assert_eq!(bytes, [0x09, 0, 0, 0, 0, 0, 0, 0, 0]);
        assert_eq!(messages[1].field[2].json_name(), "timesS");
    }
}
