//! JSON documents of a command.

use serde::Serialize;
use serde_json::{Value, json};

use crate::cli::console::print::{say, take_warnings};

/// One JSON document of the entries of two objects.
pub(crate) fn document(mut head: Value, body: &impl Serialize) -> Result<Value, serde_json::Error> {
    if let (Some(head), Value::Object(body)) = (head.as_object_mut(), serde_json::to_value(body)?) {
        head.extend(body);
    }
    Ok(head)
}

/// Prints the document of a command on standard output, with what it has warned of on standard error.
///
/// # Errors
/// Standard output that cannot be written.
pub(crate) fn say_document(document: impl Serialize) -> Result<(), std::io::Error> {
    say!("{:#}", with_warnings(serde_json::to_value(document)?, take_warnings()));
    Ok(())
}

/// The same in one line, for a command that prints several.
///
/// # Errors
/// See [`say_document`].
pub(crate) fn say_line(document: impl Serialize) -> Result<(), std::io::Error> {
    say!("{}", with_warnings(serde_json::to_value(document)?, take_warnings()));
    Ok(())
}

/// The document with `told` in its list `warnings`, each that is not in there already.
fn with_warnings(mut document: Value, told: Vec<String>) -> Value {
    let list = document.as_object_mut().map(|entries| entries.entry("warnings").or_insert_with(|| json!([])));
    if let Some(Value::Array(list)) = list {
        for text in told {
            if !list.iter().any(|known| known == &text || known["text"] == text) {
                list.push(json!(text));
            }
        }
    }
    document
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_warning_stands_in_the_document_once() {
        let told = || vec!["a".to_owned(), "b".to_owned()];
        assert_eq!(with_warnings(json!({ "x": 1 }), told()), json!({ "x": 1, "warnings": ["a", "b"] }));
        assert_eq!(with_warnings(json!({ "warnings": ["b"] }), told()), json!({ "warnings": ["b", "a"] }));
        let reported = json!({ "warnings": [{ "text": "a" }, { "text": "b" }] });
        assert_eq!(with_warnings(reported.clone(), told()), reported);
        assert_eq!(with_warnings(json!({}), Vec::new()), json!({ "warnings": [] }));
    }
}
