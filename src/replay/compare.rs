//! What moved: expected against found.

use std::fmt::Write as _;

use crate::replay::expected::{Expectation, Expected, rounded};
use crate::replay::found::Found;
use crate::report::text::number::significant;

/// How a quantity stands to what was expected of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// Within its tolerance.
    Held,
    /// Beyond its tolerance.
    Moved,
    /// No longer found.
    Gone,
}

/// One quantity, expected and found.
#[derive(Debug, Clone, PartialEq)]
pub struct Comparison {
    /// What was expected.
    pub expected: Expectation,
    /// The value now; none where there is none.
    pub found: Option<f64>,
}

impl Comparison {
    /// How they stand to each other. What is not a number has moved.
    pub fn verdict(&self) -> Verdict {
        match self.found {
            None => Verdict::Gone,
            Some(found) if (found - self.expected.value).abs() <= self.expected.tolerance => Verdict::Held,
            Some(_) => Verdict::Moved,
        }
    }
}

/// Each expected quantity beside the found one. What is found but not expected is not compared.
pub fn compare(expected: &Expected, found: &[Found]) -> Vec<Comparison> {
    let value = |e: &Expectation| found.iter().find(|f| f.quantity == e.quantity).map(|f| f.value);
    expected.quantities.iter().map(|e| Comparison { expected: e.clone(), found: value(e) }).collect()
}

/// How many did not hold.
pub fn moved(comparisons: &[Comparison]) -> usize {
    comparisons.iter().filter(|c| c.verdict() != Verdict::Held).count()
}

/// A table of those that moved, of all with `all`; empty where there is nothing to show.
pub fn table(comparisons: &[Comparison], all: bool) -> String {
    let shown: Vec<[String; 5]> = comparisons.iter().filter(|c| all || c.verdict() != Verdict::Held).map(row).collect();
    if shown.is_empty() {
        return String::new();
    }
    let header = ["quantity", "expected", "found", "tolerance", "verdict"].map(String::from);
    let rows: Vec<&[String; 5]> = std::iter::once(&header).chain(&shown).collect();
    let width = |column: usize| rows.iter().map(|r| r[column].chars().count()).max().unwrap_or(0);
    let widths: [usize; 4] = std::array::from_fn(width);
    rows.iter().fold(String::new(), |mut out, [name, expected, found, tolerance, verdict]| {
        let [w0, w1, w2, w3] = widths;
        let _ = writeln!(out, "  {name:<w0$}  {expected:>w1$}  {found:>w2$}  {tolerance:>w3$}  {verdict}");
        out
    })
}

fn row(comparison: &Comparison) -> [String; 5] {
    let Expectation { quantity, value, tolerance } = &comparison.expected;
    let found = comparison
        .found
        .map_or("–".into(), |v| if v.is_finite() { rounded(v, *tolerance) } else { "not a number".into() });
    let verdict = match (comparison.verdict(), comparison.found) {
        (Verdict::Held, _) => "held".into(),
        (Verdict::Gone, _) => "GONE".into(),
        (Verdict::Moved, Some(found)) if *tolerance > 0.0 && found.is_finite() => {
            format!("MOVED by {}× its tolerance", significant((found - value).abs() / tolerance, 2))
        }
        (Verdict::Moved, _) => "MOVED".into(),
    };
    [quantity.to_string(), rounded(*value, *tolerance), found, significant(*tolerance, 2), verdict]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::replay::quantity::{Quantity, Table};

    fn pair(value: f64, tolerance: f64, found: Option<f64>) -> Comparison {
        let quantity = Quantity::new(Table::Inspect, "period_s");
        Comparison { expected: Expectation { quantity, value, tolerance }, found }
    }

    #[test]
    fn a_move_beyond_the_tolerance_either_way_is_seen() {
        let verdict = |v, t, f| pair(v, t, f).verdict();
        assert_eq!(verdict(1.0, 0.1, Some(1.09)), Verdict::Held);
        assert_eq!(verdict(1.0, 0.1, Some(1.11)), Verdict::Moved);
        assert_eq!(verdict(1.0, 0.1, Some(0.89)), Verdict::Moved);
        assert_eq!(verdict(1.0, 0.0, Some(1.0)), Verdict::Held);
        assert_eq!(verdict(1.0, 0.1, Some(f64::NAN)), Verdict::Moved);
        assert_eq!(verdict(1.0, 0.1, None), Verdict::Gone);
    }

    #[test]
    fn the_table_shows_what_moved_and_all_when_asked() {
        let all = [pair(1.0, 0.1, Some(1.0)), pair(2.0, 0.1, Some(2.25)), pair(3.0, 0.1, None)];
        assert_eq!(moved(&all), 2);
        let short = table(&all, false);
        assert_eq!(short.lines().count(), 3, "{short}");
        assert!(short.contains("2.000  2.250       0.10  MOVED by 2.5× its tolerance"), "{short}");
        assert!(short.contains("GONE"), "{short}");
        assert_eq!(table(&all, true).lines().count(), 4);
        assert_eq!(table(&all[..1], false), "");
    }
}
