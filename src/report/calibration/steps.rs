//! The steps of a stepwise calibration for the terminal.

use crate::fit::outcome::fit::StepTaken;
use crate::report::text::number::significant;
use crate::report::text::table::Table;

/// The steps that were taken, each in a line or two, and why; nothing where there are none.
pub fn steps(taken: &[StepTaken]) -> String {
    if taken.is_empty() {
        return String::new();
    }
    let mut table = Table::new(&["<step", "<round", "from the", "moved to", "<error/noise", "<after", ""]);
    let mut reasons: Vec<String> = Vec::new();
    for (i, step) in taken.iter().enumerate() {
        // Offsets are many and tell little.
        let moved = step.parameters.iter().filter(|(name, _)| !name.starts_with("offset"));
        let mut moved = in_lines(moved.map(|(name, value)| format!("{name} {}", significant(*value, 5))), MOVED_WIDTH);
        if moved.len() > MOVED_LINES {
            moved.truncate(MOVED_LINES);
            moved[MOVED_LINES - 1] += " …";
        }
        for (line, moved) in moved.into_iter().enumerate() {
            let first = |text: String| if line == 0 { text } else { String::new() };
            table.row([
                first((i + 1).to_string()),
                first(step.round.to_string()),
                first(step.feature.clone()),
                moved,
                first(significant(step.before_over_noise, 4)),
                first(significant(step.after_over_noise, 4)),
                first(if step.kept { "" } else { "taken back" }.into()),
            ]);
        }
        let names: Vec<&str> = step.parameters.iter().map(|(name, _)| name.as_str()).collect();
        let first = names.first().copied().unwrap_or_default();
        let reason = format!("{first}{}: {}", if names.len() > 1 { ", …" } else { "" }, step.why);
        if !reasons.contains(&reason) {
            reasons.push(reason);
        }
    }
    format!("{table}\nWhy:\n  {}\n", reasons.join("\n  "))
}

/// Widest that the values which a step has moved stand in one line.
const MOVED_WIDTH: usize = 44;
/// Most such lines of a step; all values are in the document of --json.
const MOVED_LINES: usize = 2;

/// Items with commas between, as many in a line as its width has room for, at least one line.
fn in_lines(items: impl Iterator<Item = String>, width: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    for item in items {
        let last = lines.len() - 1;
        if lines[last].is_empty() {
            lines[last] = item;
        } else if lines[last].chars().count() + item.chars().count() + 3 <= width {
            lines[last] += &format!(", {item}");
        } else {
            lines[last].push(',');
            lines.push(item);
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_fit_a_terminal() {
        let name = |i| format!("initial_velocity_{i}_m_s");
        let step = |kept, n: usize| StepTaken {
            round: 1,
            parameters: (0..n).map(|i| (name(i), 0.123_456)).collect(),
            feature: "opening read back from the head at the valve".to_owned(),
            why: "it shows there".to_owned(),
            before_over_noise: 123.4,
            after_over_noise: 2.0,
            kept,
        };
        let text = steps(&[step(true, 1), step(false, 9)]);
        assert!(text.lines().all(|l| l.chars().count() <= 132), "{text}");
        let lines: Vec<&str> = text.lines().collect();
        assert!(
            lines[2].contains("   1 ") && !lines[2].contains("taken back") && lines[3].ends_with("taken back"),
            "{text}"
        );
        assert!(lines[4].trim_start().starts_with("initial_velocity_1_m_s") && lines[4].ends_with(" …"), "{text}");
    }
}
