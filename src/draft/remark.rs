//! What there is to say of a field of a form.

use serde::Serialize;

/// How much a remark weighs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Weight {
    /// What is written cannot be taken.
    Wrong,
    /// Nothing is written, and it is needed.
    Open,
    /// Nothing is written, and this is taken.
    Assumed,
}

/// Something about a field.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Remark {
    /// The field, as the form names it; of a column `columns.2.unit`, of the file itself `file`.
    pub field: String,
    /// A sentence, or part of one.
    pub says: String,
    /// How much it weighs.
    pub weight: Weight,
}

impl Remark {
    /// A remark.
    pub fn new(weight: Weight, field: impl Into<String>, says: impl Into<String>) -> Remark {
        Remark { field: field.into(), says: says.into(), weight }
    }
}

/// Takes what was written in a field; nothing where it is empty or wrong.
pub fn taken<T>(
    text: &str,
    field: &str,
    parse: impl Fn(&str) -> Result<T, String>,
    remarks: &mut Vec<Remark>,
) -> Option<T> {
    let text = text.trim();
    let parsed = (!text.is_empty()).then(|| parse(text))?;
    parsed.map_err(|why| remarks.push(Remark::new(Weight::Wrong, field, why))).ok()
}
