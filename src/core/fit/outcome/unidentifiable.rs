//! Combinations of parameters that the recordings do not determine.

/// Parameters that the recordings do not determine, or not apart from each other.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Unidentifiable {
    /// Their names.
    pub parameters: Vec<String>,
    /// The run they belong to, where that is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub run: Option<String>,
    /// The combination of two that the recordings determine: their ratio, product, or a product of powers.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seen_combination: Option<String>,
    /// Standard error of that, percent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub standard_error_percent: Option<f64>,
    /// The same in words.
    pub in_words: String,
}
