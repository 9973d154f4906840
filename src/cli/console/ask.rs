//! Questions on the terminal. All are lines of text: what is typed can be corrected, and Ctrl-C leaves the terminal as it was.

use dialoguer::Input;

use crate::cli::console::numbers::measure;

type AnyError = Box<dyn std::error::Error + Send + Sync>;

/// A line that `parse` takes; it is asked again until then. Enter alone gives the usual answer.
pub fn line<T>(question: &str, usual: Option<&str>, parse: impl Fn(&str) -> Result<T, String>) -> Result<T, AnyError> {
    let input = Input::<String>::new().with_prompt(question).allow_empty(true);
    let input = match usual {
        Some(usual) => input.default(usual.to_owned()),
        None => input,
    };
    let text = input.validate_with(|text: &String| parse(text.trim()).map(drop)).interact_text()?;
    Ok(parse(text.trim())?)
}

/// A number within a range, in `unit` or with another one behind it.
pub fn number(question: &str, unit: &str, usual: Option<f64>, [low, high]: [f64; 2]) -> Result<f64, AnyError> {
    let within = |text: &str| match measure(text, unit) {
        _ if text.is_empty() => Err("nothing was written".to_owned()),
        Ok(value) if (low..=high).contains(&value) => Ok(value),
        Ok(_) => Err(format!("it must be from {low} to {high} {unit}")),
        Err(error) => Err(error),
    };
    line(question, usual.map(|v| v.to_string()).as_deref(), within)
}

/// Yes or no; Enter alone is yes.
pub fn agreed(question: &str) -> Result<bool, AnyError> {
    line(&format!("{question} (yes or no)"), Some("yes"), |text| match text.to_lowercase().as_str() {
        "y" | "yes" => Ok(true),
        "n" | "no" => Ok(false),
        _ => Err("write yes or no".into()),
    })
}
