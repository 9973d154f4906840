//! Properties of TDMS objects.

use std::collections::BTreeMap;

/// A property of an object.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Property {
    Text(String),
    Number(f64),
    /// Nanoseconds since 1970 UTC.
    Time(i64),
}

/// Those of one object, by name.
pub(crate) type Properties = BTreeMap<String, Property>;
