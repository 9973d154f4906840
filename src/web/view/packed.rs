//! Curves as bytes: a line of JSON that says what follows, then the numbers.
//!
//! A u32 with the length of the JSON (little endian); the JSON, filled with blanks so that the numbers begin at a
//! multiple of eight; then each column of the JSON's `columns` as little-endian 64-bit numbers, NaN where there is a
//! gap.

use serde_json::{Map, Value, json};

/// Columns of numbers with what there is to say about them.
#[derive(Debug, Default)]
pub struct Packed {
    about: Map<String, Value>,
    columns: Vec<(String, Vec<f64>)>,
}

impl Packed {
    /// Says something about the columns.
    pub fn say(&mut self, key: &str, value: Value) {
        self.about.insert(key.to_owned(), value);
    }

    /// Adds a column.
    pub fn push(&mut self, name: impl Into<String>, values: Vec<f64>) {
        self.columns.push((name.into(), values));
    }

    /// The columns.
    pub fn columns(&self) -> &[(String, Vec<f64>)] {
        &self.columns
    }

    /// The bytes.
    pub fn bytes(mut self) -> Vec<u8> {
        let names: Vec<&str> = self.columns.iter().map(|(name, _)| name.as_str()).collect();
        self.about.insert("columns".into(), json!(names));
        let mut head = Value::Object(self.about).to_string();
        while !(4 + head.len()).is_multiple_of(8) {
            head.push(' ');
        }
        let numbers: usize = self.columns.iter().map(|(_, values)| values.len()).sum();
        let mut bytes = Vec::with_capacity(4 + head.len() + 8 * numbers);
        bytes.extend((head.len() as u32).to_le_bytes());
        bytes.extend(head.as_bytes());
        for (_, values) in &self.columns {
            values.iter().for_each(|value| bytes.extend(value.to_le_bytes()));
        }
        bytes
    }

    /// Columns of one length as CSV; what is no number is an empty cell.
    pub fn csv(&self) -> String {
        let names: Vec<&str> = self.columns.iter().map(|(name, _)| name.as_str()).collect();
        let mut text = names.join(",") + "\n";
        for i in 0..self.columns.first().map_or(0, |(_, values)| values.len()) {
            let cell = |(_, values): &(String, Vec<f64>)| match values[i] {
                value if value.is_finite() => value.to_string(),
                _ => String::new(),
            };
            text += &(self.columns.iter().map(cell).collect::<Vec<_>>().join(",") + "\n");
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_begin_where_a_typed_array_may() {
        let mut packed = Packed::default();
        packed.say("points", json!(2));
        packed.push("time_s", vec![0.5, f64::NAN]);
        let bytes = packed.bytes();
        let length = u32::from_le_bytes(bytes[..4].try_into().unwrap()) as usize;
        assert_eq!((4 + length) % 8, 0);
        let head: Value = serde_json::from_slice(&bytes[4..4 + length]).unwrap();
        assert_eq!((&head["columns"][0], &head["points"]), (&json!("time_s"), &json!(2)));
        let at = |i: usize| f64::from_le_bytes(bytes[4 + length + 8 * i..][..8].try_into().unwrap());
        assert!(at(0) == 0.5 && at(1).is_nan() && bytes.len() == 4 + length + 16);
    }
}
