//! The last seconds of a sensor in one line of text.

use crate::robust::median;

const LEVELS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];

/// A cell whose values reach so many times as far as those of most cells holds a spike or a front.
const SPIKE: f64 = 2.0;

/// Draws least and most values in so many cells. Cells show their most and their least value by turns, so that noise is
/// seen as a band; one that holds a spike, even of one sample, shows it; one without samples is blank. What moves by
/// less than `least_span` in all is a level line. `newest` is the number of the last value since some beginning: values
/// that share a cell go on doing so while the line moves.
pub(crate) fn sparkline(trace: &[Option<[f64; 2]>], newest: i64, cells: usize, least_span: f64) -> String {
    if cells == 0 || trace.is_empty() {
        return String::new();
    }
    let per_cell = trace.len().div_ceil(cells);
    let oldest = newest + 1 - trace.len() as i64;
    let begun = (-oldest).rem_euclid(per_cell as i64);
    let first_cell = (oldest + begun).div_euclid(per_cell as i64);
    let ranges: Vec<Option<[f64; 2]>> = trace[begun as usize..].chunks(per_cell).map(range).collect();
    let Some([least, most]) = range(&ranges) else { return " ".repeat(ranges.len()) };
    let (low, span) = if most - least >= least_span {
        (least, most - least)
    } else {
        (0.5 * (least + most) - 0.5 * least_span, least_span)
    };
    let of_all = |what: &dyn Fn(&[f64; 2]) -> f64| median(&mut ranges.iter().flatten().map(what).collect::<Vec<_>>());
    let middle = of_all(&|[a, b]| 0.5 * (a + b));
    let usual = of_all(&|[a, b]| b - a);
    let cell = |(number, range): (i64, &Option<[f64; 2]>)| {
        let Some([least, most]) = range else { return ' ' };
        let upper = if most - least > SPIKE * usual { most - middle >= middle - least } else { number % 2 == 0 };
        let share = if span > 0.0 { (if upper { most } else { least } - low) / span } else { 0.5 };
        LEVELS[((share * (LEVELS.len() - 1) as f64).round() as usize).min(LEVELS.len() - 1)]
    };
    (first_cell..).zip(&ranges).map(cell).collect()
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
        let noise = vec![Some([-1.0, 1.0]); 20];
        assert_eq!(sparkline(&noise, 19, 10, 0.1), "█▁█▁█▁█▁█▁");
        assert_eq!(sparkline(&noise, 21, 10, 0.1), "▁█▁█▁█▁█▁█", "the band moves as it is");
        assert_eq!(sparkline(&[None, None], 1, 2, 1.0), "  ");
        assert_eq!(sparkline(&[Some([1.0, 1.0])], 0, 5, 0.0), "▅");
        assert_eq!(sparkline(&trace, 19, 0, 1.0), "");
    }
}
