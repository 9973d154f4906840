//! Questions on the terminal. All are lines of text: what is typed can be corrected, and Ctrl-C leaves the terminal as
//! it was.

use std::cell::{Cell, RefCell};

use dialoguer::Input;

use crate::draft::answers::Measured;

type AnyError = Box<dyn std::error::Error + Send + Sync>;

/// What takes the last answer back.
pub const BACK: &str = "<";

/// The last answer was taken back: the dialogue starts over, and the questions before it answer themselves.
#[derive(Debug, thiserror::Error)]
#[error("one question back")]
pub struct Back;

/// Questions one after the other, of which each may depend on the answers before it.
#[derive(Default)]
pub struct Dialogue {
    answers: RefCell<Vec<String>>,
    next: Cell<usize>,
    /// The answer that was taken back, and may be taken again.
    before: RefCell<Option<String>>,
}

impl Dialogue {
    /// Asks until `questions` are answered, the last one again where it was taken back.
    ///
    /// # Errors
    /// Those of the questions, but [`Back`].
    pub fn ask<T>(&self, questions: impl Fn() -> Result<T, AnyError>) -> Result<T, AnyError> {
        loop {
            self.next.set(0);
            match questions() {
                Err(error) if error.is::<Back>() => {}
                answered => return answered,
            }
        }
    }

    /// Whether the next question is a new one.
    pub fn is_new(&self) -> bool {
        self.next.get() == self.answers.borrow().len()
    }

    /// A line that `parse` takes: the question comes again until then. Enter alone gives the usual answer.
    ///
    /// # Errors
    /// [`Back`]; a terminal that is gone.
    pub fn line<T>(
        &self,
        question: &str,
        usual: Option<&str>,
        parse: impl Fn(&str) -> Result<T, String>,
    ) -> Result<T, AnyError> {
        if self.is_new() {
            let before = self.before.take().filter(|text| !text.is_empty());
            let usual = before.as_deref().or(usual);
            let text = typed(question, usual, |text| match (text, usual) {
                (BACK, _) | ("", Some(_)) => Ok(()),
                (text, _) => parse(text).map(drop),
            })?;
            if text == BACK {
                self.before.replace(self.answers.borrow_mut().pop());
                return Err(Back.into());
            }
            let text = if text.is_empty() { usual.unwrap_or_default().to_owned() } else { text };
            self.answers.borrow_mut().push(text);
        }
        let answers = self.answers.borrow();
        let text = &answers[self.next.replace(self.next.get() + 1)];
        Ok(parse(text)?)
    }

    /// A number within a range, in its unit or with another one behind it.
    ///
    /// # Errors
    /// As [`Dialogue::line`].
    pub fn number(&self, question: &str, asked: &Measured) -> Result<f64, AnyError> {
        self.line(&format!("{question}, {}", asked.unit), None, |text| asked.parse(text))
    }

    /// Another number than the usual one; none where Enter leaves it at that.
    ///
    /// # Errors
    /// As [`Dialogue::line`].
    pub fn other_number(&self, question: &str, asked: &Measured, usual: f64) -> Result<Option<f64>, AnyError> {
        let question = format!("{question}, {} [{usual}]", asked.unit);
        self.line(&question, None, |text| if text.is_empty() { Ok(None) } else { asked.parse(text).map(Some) })
    }
}

/// A line as it was typed; Enter alone is empty.
fn typed(
    question: &str,
    usual: Option<&str>,
    check: impl Fn(&str) -> Result<(), String>,
) -> Result<String, dialoguer::Error> {
    let prompt = usual.map_or(question.to_owned(), |usual| format!("{question} [{usual}]"));
    let input = Input::<String>::new().with_prompt(prompt).allow_empty(true);
    let text = input.validate_with(|text: &String| check(text.trim())).interact_text()?;
    Ok(text.trim().to_owned())
}

/// Yes or no; Enter alone is yes.
///
/// # Errors
/// A terminal that is gone.
pub fn agreed(question: &str) -> Result<bool, AnyError> {
    Ok(yes_or_no(&typed(&format!("{question} (yes or no)"), Some("yes"), |text| yes_or_no(text).map(drop))?)?)
}

fn yes_or_no(text: &str) -> Result<bool, String> {
    match text.to_lowercase().as_str() {
        "" | "y" | "yes" => Ok(true),
        "n" | "no" => Ok(false),
        _ => Err("write yes or no".into()),
    }
}
