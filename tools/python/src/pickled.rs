//! Results as bytes, for pickles: another process of the same version reads them.

use pyo3::prelude::*;
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::error::sentence;

/// Which version wrote it.
const VERSION: &str = env!("CARGO_PKG_VERSION");

/// The bytes of a result, with the version that wrote them.
///
/// # Errors
/// None in practice: all results can be written.
pub fn packed(result: &impl Serialize) -> PyResult<Vec<u8>> {
    rmp_serde::to_vec_named(&(VERSION, result)).map_err(|error| sentence(error.to_string()))
}

/// The result of such bytes.
///
/// # Errors
/// Bytes of a version whose results have another form.
pub fn unpacked<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, String> {
    let read: Result<(String, T), _> = rmp_serde::from_slice(bytes);
    read.map(|(_, result)| result).map_err(|error| {
        let written: Result<(String, serde::de::IgnoredAny), _> = rmp_serde::from_slice(bytes);
        let by = written.map_or_else(|_| "another program".to_owned(), |(version, _)| format!("surgescope {version}"));
        format!("this result was pickled by {by}, and this is surgescope {VERSION}, which cannot read it: {error}")
    })
}
