//! JSON documents of a command.

/// One JSON document of the entries of two objects.
pub(crate) fn document(
    mut head: serde_json::Value,
    body: &impl serde::Serialize,
) -> Result<serde_json::Value, serde_json::Error> {
    if let (Some(head), serde_json::Value::Object(body)) = (head.as_object_mut(), serde_json::to_value(body)?) {
        head.extend(body);
    }
    Ok(head)
}
