//! Options that sentences of the library name: option `date_order dmy`, option `rate`. The library knows settings and
//! their values; whoever shows a sentence, a terminal or a page, says in its own words how one is given.

use std::borrow::Cow;

/// How a sentence names an option.
const NAMED: &str = "option `";

/// An option that a sentence names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Named<'a> {
    /// Its name: `date_order`.
    pub name: &'a str,
    /// The value that it is to have, where the sentence says one.
    pub value: Option<&'a str>,
}

impl<'a> Named<'a> {
    fn of(text: &'a str) -> Option<Named<'a>> {
        let (name, value) = text.split_once(' ').map_or((text, None), |(name, value)| (name, Some(value)));
        let is_name = !name.is_empty() && name.chars().all(|c| c.is_ascii_alphabetic() || c == '_' || c == '-');
        is_name.then_some(Named { name, value })
    }
}

/// The options that a text names, in their order.
pub fn named(text: &str) -> Vec<Named<'_>> {
    let after = text.split(NAMED).skip(1);
    after.filter_map(|rest| Named::of(rest.split_once('`')?.0)).collect()
}

/// The text with each option in other words.
pub fn reworded(text: &str, word: impl Fn(Named) -> String) -> Cow<'_, str> {
    let Some((before, mut rest)) = text.split_once(NAMED) else { return Cow::Borrowed(text) };
    let mut out = before.to_owned();
    loop {
        let option = rest.split_once('`').and_then(|(inner, after)| Some((Named::of(inner)?, after)));
        match option {
            Some((option, after)) => {
                out += &word(option);
                rest = after;
            }
            None => out += NAMED,
        }
        let Some((before, after)) = rest.split_once(NAMED) else { return Cow::Owned(out + rest) };
        out += before;
        rest = after;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_are_found_with_their_values_and_reworded() {
        let text = "add option `date_order dmy` or option `rate`, not option `9` or an `x`";
        let [first, second] = named(text)[..] else { panic!("{:?}", named(text)) };
        assert_eq!((first, second.value), (Named { name: "date_order", value: Some("dmy") }, None));
        let shown = reworded(text, |o| format!("<{}={}>", o.name, o.value.unwrap_or("?")));
        assert_eq!(shown, "add <date_order=dmy> or <rate=?>, not option `9` or an `x`");
        assert_eq!(named("option `map 'A b=P1'` and option `cut"), [Named { name: "map", value: Some("'A b=P1'") }]);
        assert_eq!(reworded("option `cut", |_| String::new()), "option `cut");
        assert!(matches!(reworded("nothing", |_| String::new()), Cow::Borrowed(_)));
    }
}
