//! The numbers in a message: JSON by its own structure, protobuf by the descriptors that the file carries.

use prost::Message as _;
use prost_reflect::{DescriptorPool, DynamicMessage, Kind, MessageDescriptor, ReflectMessage, Value};
use prost_types::FileDescriptorSet;
use serde_json::Value as Json;

/// Most fields of one message that are looked at: an image in JSON is none of ours.
const MOST: usize = 2000;
/// Messages inside messages, this deep.
const DEEPEST: usize = 32;

/// How a channel's messages are read.
pub(crate) enum Format {
    Json,
    Protobuf(MessageDescriptor),
}

/// What was found in a message, by its path in it.
pub(crate) struct Field {
    pub path: String,
    /// NaN where text, a null, or an empty list or object stands in the place of a number.
    pub value: f64,
    /// It is true or false, as 1 or 0.
    pub is_switch: bool,
}

impl Field {
    fn number(path: &str, value: f64) -> Field {
        Field { path: path.to_string(), value, is_switch: false }
    }

    fn switch(path: &str, on: bool) -> Field {
        Field { path: path.to_string(), value: f64::from(u8::from(on)), is_switch: true }
    }
}

impl Format {
    /// The format of a channel: its encoding and its schema's name, encoding and data. `Err` says why it cannot be
    /// read.
    pub(crate) fn of(encoding: &str, schema: Option<(&str, &str, &[u8])>) -> Result<Format, String> {
        match (encoding, schema) {
            ("json", _) => Ok(Format::Json),
            ("protobuf", Some((name, _, data))) => {
                let message = pool(data)?.get_message_by_name(name);
                message.map(Format::Protobuf).ok_or_else(|| format!("its protobuf schema lacks the message {name}"))
            }
            ("protobuf", None) => Err("it has protobuf messages without a schema".into()),
            ("ros1" | "cdr", _) => Err(format!(
                "it has messages of ROS ({encoding}), which are not read here: convert the topic to JSON or CSV, for example with PlotJuggler"
            )),
            (other, _) => Err(format!("it has messages in '{other}', of which only JSON and protobuf are read here")),
        }
    }

    /// Every number in a message, by its path: `pressure.value`, `samples[3]`; also what stands in the place of one.
    pub(crate) fn numbers(&self, data: &[u8]) -> Result<Vec<Field>, String> {
        let mut found = Vec::new();
        match self {
            Format::Json => {
                let value = serde_json::from_slice(data).map_err(|e| {
                    let has = |word: &[u8]| data.windows(word.len()).any(|part| part == word);
                    let hint = if has(b"NaN") || has(b"Infinity") {
                        ", because NaN and Infinity are not JSON: write null"
                    } else {
                        ""
                    };
                    format!("is not JSON{hint}: {e}")
                })?;
                json_numbers(&value, "", 0, &mut found);
            }
            Format::Protobuf(descriptor) => {
                let message =
                    DynamicMessage::decode(descriptor.clone(), data).map_err(|e| format!("does not decode: {e}"))?;
                message_numbers(&message, "", 0, &mut found);
            }
        }
        Ok(found)
    }
}

/// The types of a schema.
fn pool(data: &[u8]) -> Result<DescriptorPool, String> {
    let says = |e: &dyn std::fmt::Display| format!("its protobuf schema does not decode: {e}");
    let set = FileDescriptorSet::decode(data).map_err(|e| says(&e))?;
    // The library panics where it does not know the syntax, as of the editions that newer compilers write.
    for file in &set.file {
        if let Some(other) = file.syntax.as_deref().filter(|s| !["proto2", "proto3"].contains(s)) {
            let name = file.name();
            return Err(format!(
                "its protobuf schema {name} has the syntax '{other}'; only proto2 and proto3 are read here"
            ));
        }
    }
    DescriptorPool::decode(data).map_err(|e| says(&e))
}

fn joined(path: &str, name: &str) -> String {
    if path.is_empty() { name.to_string() } else { format!("{path}.{name}") }
}

fn json_numbers(value: &Json, path: &str, depth: usize, found: &mut Vec<Field>) {
    if found.len() >= MOST || depth > DEEPEST {
        return;
    }
    match value {
        Json::Number(number) => found.extend(number.as_f64().map(|n| Field::number(path, n))),
        Json::Bool(on) => found.push(Field::switch(path, *on)),
        // what is empty stands in the place of a number, too
        Json::Array(items) if items.is_empty() => found.push(Field::number(path, f64::NAN)),
        Json::Object(entries) if entries.is_empty() => found.push(Field::number(path, f64::NAN)),
        Json::Array(items) => {
            for (i, item) in items.iter().enumerate().take(MOST) {
                json_numbers(item, &format!("{path}[{i}]"), depth + 1, found);
            }
        }
        Json::Object(entries) => entries.iter().for_each(|(k, v)| json_numbers(v, &joined(path, k), depth + 1, found)),
        Json::Null | Json::String(_) => found.push(Field::number(path, f64::NAN)),
    }
}

fn message_numbers(message: &DynamicMessage, path: &str, depth: usize, found: &mut Vec<Field>) {
    for field in message.descriptor().fields() {
        // a field of proto3 that is zero is not written, and yet it was measured
        let plain = !field.is_list() && !field.is_map() && !field.supports_presence();
        if plain || message.has_field(&field) {
            let path = joined(path, field.name());
            let is_enum = matches!(field.kind(), Kind::Enum(_));
            if !is_enum {
                value_numbers(&message.get_field(&field), &path, depth, found);
            }
        }
    }
}

fn value_numbers(value: &Value, path: &str, depth: usize, found: &mut Vec<Field>) {
    if found.len() >= MOST || depth > DEEPEST {
        return;
    }
    let number = match value {
        Value::Bool(on) => return found.push(Field::switch(path, *on)),
        Value::I32(n) => f64::from(*n),
        Value::I64(n) => *n as f64,
        Value::U32(n) => f64::from(*n),
        Value::U64(n) => *n as f64,
        Value::F32(n) => f64::from(*n),
        Value::F64(n) => *n,
        Value::Message(inner) => return message_numbers(inner, path, depth + 1, found),
        Value::List(items) => {
            for (i, item) in items.iter().enumerate().take(MOST) {
                value_numbers(item, &format!("{path}[{i}]"), depth + 1, found);
            }
            return;
        }
        _ => return,
    };
    found.push(Field::number(path, number));
}

#[cfg(test)]
mod tests {
    use prost_types::FileDescriptorProto;

    use super::*;

    #[test]
    fn a_schema_of_an_unknown_syntax_is_refused_in_words() {
        for syntax in ["editions", "proto4", ""] {
            let syntax_of = Some(syntax.to_string());
            let file = FileDescriptorProto { name: Some("a.proto".into()), syntax: syntax_of, ..Default::default() };
            let data = FileDescriptorSet { file: vec![file] }.encode_to_vec();
            let Err(why) = Format::of("protobuf", Some(("a.M", "protobuf", &data))) else {
                panic!("{syntax} was taken")
            };
            assert!(why.contains(&format!("a.proto has the syntax '{syntax}'")), "{why}");
        }
    }
}
