//! The values of a channel and how they lie in the raw data of a segment.

use crate::storage::import::tdms::bytes::Bytes;
use crate::storage::import::tdms::property::{Properties, Property};

/// What a channel holds.
#[derive(Debug, Clone)]
pub(crate) enum Values {
    Numbers(Vec<f64>),
    /// Nanoseconds since 1970 UTC.
    Times(Vec<i64>),
    /// Text and other things that no sensor gives, counted.
    Other(usize),
}

impl Values {
    pub(crate) fn len(&self) -> usize {
        match self {
            Values::Numbers(v) => v.len(),
            Values::Times(v) => v.len(),
            Values::Other(n) => *n,
        }
    }
}

/// A channel over all segments.
#[derive(Debug, Clone)]
pub(crate) struct Channel {
    pub path: String,
    pub values: Values,
    /// Where its start or increment changed from one segment to the next: the first value behind that, and how it was
    /// before.
    pub earlier: Vec<(usize, Timing)>,
}

/// When the values of a channel were taken, by its `wf_` properties.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Timing {
    /// Nanoseconds since 1970 UTC.
    pub start_ns: Option<i64>,
    pub increment_s: Option<f64>,
    pub offset_s: f64,
}

impl Timing {
    pub(crate) fn of(properties: &Properties) -> Timing {
        let number = |key: &str| match properties.get(key) {
            Some(Property::Number(n)) if n.is_finite() => Some(*n),
            _ => None,
        };
        let start_ns = match properties.get("wf_start_time") {
            Some(Property::Time(ns)) => Some(*ns),
            _ => None,
        };
        let increment_s = number("wf_increment").filter(|dt| *dt > 0.0);
        Timing { start_ns, increment_s, offset_s: number("wf_start_offset").unwrap_or(0.0) }
    }

    /// True where values behind `after` are a stretch of their own: it differs, and does not merely add what was
    /// missing before.
    pub(crate) fn ends_with(self, after: Timing) -> bool {
        self.increment_s.is_some()
            && self != after
            && (self.start_ns.is_some() || self.increment_s != after.increment_s)
    }
}

/// Raw data index: what a channel has in each chunk of a segment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Index {
    pub code: u32,
    pub count: u64,
    /// Bytes of its values in a chunk.
    pub bytes: u64,
}

const TEXT: u32 = 0x20;
const TIME: u32 = 0x44;

/// Bytes of a value; `None` for types of no fixed size, or unknown ones.
pub(crate) fn size(code: u32) -> Option<u64> {
    match code {
        1 | 5 | 0x21 => Some(1),
        2 | 6 => Some(2),
        3 | 7 | 9 | 0x19 => Some(4),
        4 | 8 | 10 | 0x1a | 0x0008_000c => Some(8),
        TIME | 0x0010_000d => Some(16),
        0x0b | 0x1b => Some(16),
        _ => None,
    }
}

/// A type whose values are numbers.
pub(crate) fn is_number(code: u32) -> bool {
    matches!(code, 1..=10 | 0x19 | 0x1a | 0x21)
}

impl Index {
    /// Reads what follows the length of a raw data index.
    pub(crate) fn read(bytes: &mut Bytes<'_>) -> Result<Index, String> {
        let code = bytes.u32()?;
        let dimension = bytes.u32()?;
        if dimension != 1 {
            return Err(format!("a channel has {dimension} dimensions where TDMS has 1: the file is damaged"));
        }
        let count = bytes.u64()?;
        let bytes = match size(code) {
            Some(size) => count.checked_mul(size).ok_or("a channel is longer than any file: the file is damaged")?,
            None if code == TEXT => bytes.u64()?,
            None => return Err(format!("a channel has values of the unknown type 0x{code:x}")),
        };
        Ok(Index { code, count, bytes })
    }
}

impl Channel {
    pub(crate) fn new(path: &str, code: u32) -> Channel {
        let values = match code {
            TIME => Values::Times(Vec::new()),
            code if is_number(code) => Values::Numbers(Vec::new()),
            _ => Values::Other(0),
        };
        Channel { path: path.to_string(), values, earlier: Vec::new() }
    }

    /// Takes in the values that start `offset` bytes into `raw`, `stride` bytes apart, `count` of them or as many as
    /// there are.
    pub(crate) fn extend(
        &mut self,
        raw: Bytes<'_>,
        code: u32,
        offset: usize,
        stride: usize,
        count: u64,
    ) -> Result<(), String> {
        let Some(size) = size(code) else {
            if let Values::Other(n) = &mut self.values {
                *n = n.saturating_add(count as usize);
            }
            return Ok(());
        };
        let there = raw.len().saturating_sub(offset).saturating_add(stride - size as usize) / stride.max(1);
        let count = usize::try_from(count).unwrap_or(usize::MAX).min(there);
        let other_type = || format!("channel {} changes its type from segment to segment", self.path);
        let mut from = raw;
        from.take(offset.min(raw.len()))?;
        match &mut self.values {
            Values::Numbers(values) if is_number(code) => {
                values.reserve(count);
                for _ in 0..count {
                    let mut place = from;
                    values.push(place.number(code)?);
                    from.take(stride.min(from.len()))?;
                }
            }
            Values::Times(values) if code == TIME => {
                for _ in 0..count {
                    let mut place = from;
                    values.push(place.time()?);
                    from.take(stride.min(from.len()))?;
                }
            }
            Values::Other(n) if code != TIME && !is_number(code) => *n = n.saturating_add(count),
            _ => return Err(other_type()),
        }
        Ok(())
    }
}
