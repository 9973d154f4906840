//! A small line plot in text, for the terminal: a curve and the one it is compared with.

use std::fmt::Write as _;

use crate::report::text::number::decimals_for;

/// Columns and rows of the plotting area.
const COLUMNS: usize = 72;
const ROWS: usize = 16;
/// Characters of the curve behind and the one before it.
pub const MARKS: [char; 2] = ['·', '█'];

/// Draws two curves over `x` from 0 to `x_end`, the second over the first, with the range of y at the left and of x
/// below.
///
/// Within a column a curve is drawn over all the values it takes there, so that fronts are joined. Values that are not
/// finite are left out.
pub fn plot(curves: [&dyn Fn(f64) -> f64; 2], x_end: f64, x_unit: &str) -> String {
    const PER_COLUMN: usize = 16;
    let extents = curves.map(|curve| {
        let extent = |column: usize| {
            // One value shared with the next column, so that the curve does not break.
            let at = |i: usize| curve((column * PER_COLUMN + i) as f64 / (COLUMNS * PER_COLUMN) as f64 * x_end);
            (0..=PER_COLUMN).map(at).filter(|y| y.is_finite()).fold(None, |seen: Option<(f64, f64)>, y| {
                Some(seen.map_or((y, y), |(low, high)| (low.min(y), high.max(y))))
            })
        };
        (0..COLUMNS).map(extent).collect::<Vec<_>>()
    });
    let all = || extents.iter().flatten().flatten();
    let low = all().map(|e| e.0).fold(f64::INFINITY, f64::min);
    let high = all().map(|e| e.1).fold(f64::NEG_INFINITY, f64::max);
    if low > high {
        return "nothing to draw\n".to_owned();
    }
    let span = (high - low).max(1e-9 * (1.0 + high.abs()));
    let row_of = |y: f64| (((high - y) / span * (ROWS - 1) as f64).round() as usize).min(ROWS - 1);
    let mut cells = vec![[' '; COLUMNS]; ROWS];
    for (extents, mark) in extents.iter().zip(MARKS) {
        for (column, extent) in extents.iter().enumerate() {
            let Some((below, above)) = *extent else { continue };
            for row in &mut cells[row_of(above)..=row_of(below)] {
                row[column] = mark;
            }
        }
    }
    let digits = decimals_for(span / 100.0);
    let label = |row: usize| format!("{:.digits$}", high - span * row as f64 / (ROWS - 1) as f64);
    let width = [0, ROWS - 1].map(|row| label(row).len()).into_iter().max().unwrap_or(0);
    let mut text = String::new();
    for (row, cells) in cells.iter().enumerate() {
        let shown = if row % 5 == 0 { label(row) } else { String::new() };
        let line: String = cells.iter().collect();
        let _ = writeln!(text, "{shown:>width$} │{}", line.trim_end());
    }
    let _ = writeln!(text, "{:>width$} └{}", "", "─".repeat(COLUMNS));
    let end = format!("{x_end:.2} {x_unit}");
    let _ = writeln!(text, "{:>width$}  0{end:>after$}", "", after = COLUMNS - 1);
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(text: &str) -> Vec<Vec<char>> {
        text.lines().filter_map(|l| l.split_once('│')).map(|(_, r)| format!("{r:72}").chars().collect()).collect()
    }

    #[test]
    fn a_line_runs_from_corner_to_corner_over_the_curve_behind_it() {
        let text = plot([&|_| 0.0, &|x| x], 2.0, "s");
        let rows = rows(&text);
        assert_eq!((rows.len(), rows[0].len()), (ROWS, COLUMNS));
        assert_eq!((rows[15][0], rows[0][71]), ('█', '█'));
        assert_eq!((rows[15][71], rows[0][0]), ('·', ' '));
        assert!(text.contains("2.00 s") && text.lines().next().is_some_and(|l| l.starts_with("2.00")), "{text}");
    }

    #[test]
    fn fronts_are_joined_and_odd_values_do_no_harm() {
        let step = |x: f64| if x < 0.5 { 0.0 } else { 1.0 };
        let text = plot([&|_| f64::NAN, &step], 1.0, "s");
        assert!((0..72).any(|c| rows(&text).iter().all(|r| r[c] == '█')), "{text}");
        assert_eq!(plot([&|_| f64::NAN, &|_| f64::INFINITY], 1.0, "s"), "nothing to draw\n");
        assert!(plot([&|_| 3.0, &|_| 3.0], 1.0, "s").contains('█'));
    }
}
