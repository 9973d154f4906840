//! The last seconds of a sensor in one line of text.

const LEVELS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];

/// Draws least and most values in so many cells. A cell shows the one of its values that is farthest from the middle of all, so that a spike
/// of one sample is seen; a cell without samples is blank. What moves by less than `least_span` in all is a level line. `newest` is the
/// number of the last value since some beginning: values that share a cell go on doing so while the line moves.
pub(super) fn sparkline(trace: &[Option<[f64; 2]>], newest: i64, cells: usize, least_span: f64) -> String {
    if cells == 0 || trace.is_empty() {
        return String::new();
    }
    let per_cell = trace.len().div_ceil(cells);
    let begun = (trace.len() as i64 - 1 - newest).rem_euclid(per_cell as i64) as usize;
    let ranges: Vec<Option<[f64; 2]>> = trace[begun..].chunks(per_cell).map(range).collect();
    let Some([least, most]) = range(&ranges) else { return " ".repeat(ranges.len()) };
    let mut middles: Vec<f64> = ranges.iter().flatten().map(|[a, b]| 0.5 * (a + b)).collect();
    let half = middles.len() / 2;
    let middle = *middles.select_nth_unstable_by(half, f64::total_cmp).1;
    let (low, span) = if most - least >= least_span {
        (least, most - least)
    } else {
        (0.5 * (least + most) - 0.5 * least_span, least_span)
    };
    let cell = |range: &Option<[f64; 2]>| {
        let Some([least, most]) = range else { return ' ' };
        let shown = if most - middle >= middle - least { *most } else { *least };
        let share = if span > 0.0 { (shown - low) / span } else { 0.5 };
        LEVELS[((share * (LEVELS.len() - 1) as f64).round() as usize).min(LEVELS.len() - 1)]
    };
    ranges.iter().map(cell).collect()
}

fn range(parts: &[Option<[f64; 2]>]) -> Option<[f64; 2]> {
    parts.iter().flatten().copied().reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spike_of_one_sample_is_seen_however_few_the_cells() {
        let mut trace = vec![Some([300.0, 301.0]); 100];
        trace[57] = Some([300.0, 900.0]);
        trace[83] = Some([-100.0, 301.0]);
        assert_eq!(sparkline(&trace, 99, 20, 5.0), "▄▄▄▄▄▄▄▄▄▄▄█▄▄▄▄▁▄▄▄");
        assert_eq!(sparkline(&trace, 99, 7, 5.0), "▄▄▄█▄▁▄");
        // a tenth of a second later nothing but the newest cell has changed
        trace.remove(0);
        trace.push(Some([300.0, 301.0]));
        assert_eq!(sparkline(&trace, 100, 20, 5.0), "▄▄▄▄▄▄▄▄▄▄█▄▄▄▄▁▄▄▄▄");
    }

    #[test]
    fn noise_is_a_level_line_a_step_a_step_and_a_hole_a_hole() {
        let mut trace: Vec<_> = (0..20).map(|i| Some([300.0 - 0.2 * f64::from(i % 3), 300.4])).collect();
        assert_eq!(sparkline(&trace, 19, 20, 50.0).chars().filter(|c| "▄▅".contains(*c)).count(), 20);
        trace[10..].fill(Some([600.0, 600.2]));
        trace[4..6].fill(None);
        assert_eq!(sparkline(&trace, 19, 20, 5.0), "▁▁▁▁  ▁▁▁▁██████████");
        assert_eq!(sparkline(&[None, None], 1, 2, 1.0), "  ");
        assert_eq!(sparkline(&[Some([1.0, 1.0])], 0, 5, 0.0), "▅");
        assert_eq!(sparkline(&trace, 19, 0, 1.0), "");
    }
}
