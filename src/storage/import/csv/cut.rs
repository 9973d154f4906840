//! A last line that ends within its last number, which reads as a number all the same.

/// So many lines must show how a column is written.
const ENOUGH: usize = 3;

/// True where the last line has no end and its last cell is written shorter than all above it: with fewer decimals, or,
/// where none has any, with fewer characters. A logger that was switched off leaves `…,5` of `…,501.000`.
pub(crate) fn is_cut_off(text: &str, separator: char) -> bool {
    if text.ends_with('\n') {
        return false;
    }
    let mut rows = text.lines().filter(|line| !line.trim().is_empty() && !line.starts_with('#'));
    rows.next(); // the headings
    let Some(last) = rows.next_back() else { return false };
    let (mut fewest, mut most, mut length, mut count) = (usize::MAX, 0, usize::MAX, 0);
    for line in rows {
        let cell = last_cell(line, separator);
        if !cell.is_empty() && !cell.starts_with(|c: char| c.is_ascii_digit() || matches!(c, '+' | '-' | '.' | ',')) {
            continue; // a row of units
        }
        let decimals = decimals_of(cell);
        (fewest, most) = (fewest.min(decimals), most.max(decimals));
        length = length.min(cell.len());
        count += 1;
    }
    let cell = last_cell(last, separator);
    count >= ENOUGH && (decimals_of(cell) < fewest || (most == 0 && cell.len() < length))
}

fn last_cell(line: &str, separator: char) -> &str {
    line.rsplit(separator).next().unwrap_or_default().trim().trim_matches('"')
}

/// Characters behind the decimal mark, those of an exponent too.
fn decimals_of(cell: &str) -> usize {
    cell.rsplit_once(['.', ',']).map_or(0, |(_, decimals)| decimals.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_cut_in_its_middle_is_told_from_one_that_is_short() {
        let of = |column: &[&str], last: &str| {
            let rows: Vec<String> = column.iter().map(|cell| format!("0.1,{cell}\n")).collect();
            is_cut_off(&format!("# c\ntime_s,P1\n{}0.2,{last}", rows.concat()), ',')
        };
        let even = ["500.000", "501.000", "499.500"];
        for (cut, last) in
            [(true, ""), (true, "5"), (true, "501."), (true, "501.00"), (false, "501.000"), (false, "501.0000")]
        {
            assert_eq!(of(&even, last), cut, "{last}");
        }
        assert!(of(&["1.5e-03", "1.5e-03", "2.5e-03"], "1.5e-0"));
        assert!(of(&["1024", "-1023", "1001"], "10") && of(&["1024", "1023", "1001"], "-"));
        assert!(!of(&["1024", "23", "1001"], "10"), "numbers of any length");
        assert!(!of(&["500.5", "501", "499.25"], "5"), "decimals of any number");
        assert!(!of(&["500.0", "", "499.5"], "5"), "cells that may be empty");
        assert!(!of(&["500.0", "501.0"], "5"), "too few lines to say so");
        assert!(!is_cut_off("time_s,P1\n0,1.0\n1,1.0\n2,1.0\n3,1\n", ','), "a line with its end is whole");
        assert!(is_cut_off("time_s;P1\ns;bar\n0;1,0\n1;1,0\n2;1,0\n3;1", ';'), "a row of units, decimal commas");
    }
}
