//! Sentences of the library as the page says them: where they name an option (option `without P3`), the page has a
//! field or a choice.

use std::borrow::Cow;

use serde_json::Value;

use crate::shown::options::{Named, reworded};

/// The page's words for an option, and for one with a value.
fn words(option: Named) -> String {
    let value = option.value.map_or(String::new(), |value| format!(" {value}"));
    let of = option.value.map_or(String::new(), |value| format!(" for {value}"));
    match &option.name.replace('-', "_")[..] {
        "without" => format!("the choice “not recorded”{of}"),
        "ignore" => format!("the choice “no sensor”{of}"),
        "map" => match option.value.and_then(|value| value.trim_matches('\'').rsplit_once('=')) {
            Some((column, sensor)) => format!("the column ‘{column}’ beside the sensor {sensor}"),
            None => "the list of columns".to_owned(),
        },
        "scale" => match option.value.and_then(|value| value.trim_matches('\'').split_once('=')) {
            Some((column, line)) => format!("the unit or the ranges ‘{line}’ beside {column}"),
            None => "the field for another unit, or for V or mA".to_owned(),
        },
        "rate" => format!("the field “samples per second”{value}"),
        "time_unit" => format!("the field “unit of the times”{value}"),
        "date_order" => match option.value {
            Some("dmy") => "the choice “day first”".to_owned(),
            Some("mdy") => "the choice “month first”".to_owned(),
            _ => "the choice “day or month first”".to_owned(),
        },
        "zone" => format!("the field “time zone”{value}"),
        "message_time" => match option.value {
            Some("publish") => "the choice “when it was published”".to_owned(),
            Some("log") => "the choice “when it was logged”".to_owned(),
            _ => "the field “time of a message”".to_owned(),
        },
        "align" => match option.value {
            Some(by) => format!("the choice “aligned by {by}”"),
            None => "the choice “aligned by”".to_owned(),
        },
        // the page has no field for it, but files have a place
        "start" => "a line such as ‘# start: 2026-03-14T09:26:53.5Z’ at the head of each file".to_owned(),
        "encoding" => format!("the field “code page”{value}"),
        "time_field" => format!("the field “field of a message with its time”{value}"),
        "flow" => format!("the field “flow before the closure”{value}"),
        "unit" => format!("the field “unit”{value}"),
        "sensor" => match option.value.and_then(|value| value.trim_matches('\'').split_once('=')) {
            Some((sensor, place)) => format!("the place {place} beside {sensor}"),
            None => format!("the place{of}"),
        },
        // the page has none of it
        name => format!("the setting “{}{value}”", name.replace('_', " ")),
    }
}

/// The command that saves what is in a torn recording, for which the page has a button.
const RECOVER: &str = "`surgescope recover ";

/// A sentence as the page says it.
pub fn worded(text: &str) -> Cow<'_, str> {
    let said = reworded(text, words);
    let Some((before, (_, after))) = said.split_once(RECOVER).and_then(|(b, rest)| Some((b, rest.split_once('`')?)))
    else {
        return said;
    };
    Cow::Owned(format!("{before}“Recover” in the list of runs{after}"))
}

/// The same of every text in a line of JSON.
pub fn in_json(text: String) -> String {
    fn inside(value: &mut Value) {
        match value {
            Value::String(text) => {
                if let Cow::Owned(said) = worded(text) {
                    *text = said;
                }
            }
            Value::Array(all) => all.iter_mut().for_each(inside),
            Value::Object(all) => all.values_mut().for_each(inside),
            _ => {}
        }
    }
    if !text.contains("option `") && !text.contains(RECOVER) {
        return text;
    }
    let Ok(mut value) = serde_json::from_str(&text) else { return text };
    inside(&mut value);
    value.to_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shown::options::named;
    use crate::storage::CsvProblem;

    /// Whatever a reader of files asks for, the page has a field for it.
    #[test]
    fn every_option_that_an_import_names_is_one_of_the_page() {
        let mut folders = vec![std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("src/storage/import")];
        let mut sources = vec![
            folders[0].with_file_name("error.rs"),
            folders[0].join("../../draft/answers.rs"),
            folders[0].join("../../core/align/mod.rs"),
        ];
        while let Some(folder) = folders.pop() {
            for entry in std::fs::read_dir(folder).unwrap() {
                let path = entry.unwrap().path();
                if path.is_dir() { folders.push(path) } else { sources.push(path) }
            }
        }
        let texts: Vec<String> = sources.iter().map(|path| std::fs::read_to_string(path).unwrap()).collect();
        let all: Vec<Named> = texts.iter().flat_map(|text| named(text)).collect();
        assert!(all.len() > 20, "only {} options are named", all.len());
        for option in all {
            // what stands in braces is a value's name in the source
            let value = option.value.filter(|value| !value.contains('{'));
            let said = words(Named { value, ..option });
            assert!(!said.contains("the setting") && !said.contains('_'), "{option:?}: {said}");
        }
    }

    #[test]
    fn an_error_of_the_library_is_worded_for_the_page_and_keeps_what_it_names() {
        let missing = CsvProblem::MissingColumn {
            sensor: "P \"3".into(),
            kind: "pressure",
            rig: "lab".into(),
            found: "a".into(),
            hint: ".".into(),
        };
        let said = worded(&missing.to_string()).into_owned();
        assert!(said.ends_with("leave the sensor out with the choice “not recorded” for P \"3"), "{said}");
        let json =
            in_json(serde_json::json!({ "error": missing.to_string(), "at": [missing.to_string(), 1.5] }).to_string());
        let value: Value = serde_json::from_str(&json).unwrap();
        assert_eq!(
            (&value["error"], &value["at"][0], &value["at"][1]),
            (&said.clone().into(), &said.into(), &1.5.into())
        );
        let day = worded("'3/4' may be two dates: add option `date_order dmy` or option `date_order mdy`").into_owned();
        assert!(day.ends_with("add the choice “day first” or the choice “month first”"), "{day}");
        assert_eq!(worded("raise option `most_reaches 64`"), "raise the setting “most reaches 64”");
        let torn = crate::storage::LogError::Torn("a b.mcap".into()).to_string();
        assert!(worded(&torn).ends_with("“Recover” in the list of runs saves what is in it"), "{}", worded(&torn));
        assert_eq!(worded("option `map 'Druck 1=P1'`"), "the column ‘Druck 1’ beside the sensor P1");
    }
}
