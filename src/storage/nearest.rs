//! Suggestions for misspelt names, and lists of names.

/// A longer name is no slip of another one, and comparing it would take long.
const LONGEST: usize = 200;

/// The name among `known` that `name` was probably meant to be.
pub(crate) fn nearest<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let lower = name.to_lowercase();
    known
        .into_iter()
        .filter(|k| k.len().max(name.len()) <= LONGEST)
        .map(|k| (strsim::damerau_levenshtein(&lower, &k.to_lowercase()), k))
        .filter(|(distance, k)| *distance <= 1.max(name.len().max(k.len()) / 3))
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, k)| k)
}

/// Names, not without end.
pub(crate) fn listed(names: &[String]) -> String {
    const MOST: usize = 30;
    let more = if names.len() > MOST { format!(" and {} more", names.len() - MOST) } else { String::new() };
    if names.is_empty() { "none".into() } else { names[..names.len().min(MOST)].join(", ") + &more }
}
