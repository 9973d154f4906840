//! Predictions and cross-validations as text and JSON.

pub mod cross_validation;
pub mod text;
