//! Columns of words beside the values that say of each row whether they are any: `Quality`, `Status`.

use crate::storage::import::csv::layout::Layout;

/// How the names of such columns begin or end, in lower case.
const NAMES: [&str; 9] = ["quality", "qualität", "qualitaet", "status", "validity", "valid", "state", "ok", "good"];
/// How the words begin that say no.
const BAD: [&str; 14] = [
    "bad",
    "false",
    "nok",
    "invalid",
    "error",
    "fault",
    "fail",
    "uncertain",
    "not connected",
    "no comm",
    "comm fail",
    "ungültig",
    "schlecht",
    "fehler",
];

/// OPC's code of a good value.
const GOOD: &str = "192";

/// Which column says it of which values.
#[derive(Debug, Default)]
pub(crate) struct States(Vec<(usize, usize)>);

impl States {
    /// Of columns of `words` with their names: the next one on the right of a value, before the next value; or one for
    /// all.
    pub(crate) fn find(names: &[String], words: &[usize], values: &[usize]) -> States {
        let is_state = |i: &&usize| {
            let lower = names[**i].to_lowercase();
            lower.split(|c: char| !c.is_alphanumeric()).any(|word| NAMES.contains(&word))
        };
        let states: Vec<usize> = words.iter().filter(is_state).copied().collect();
        let own = |value: usize| {
            let next = values.iter().copied().filter(|v| *v > value).min().unwrap_or(usize::MAX);
            states.iter().copied().find(|state| (value..next).contains(state))
        };
        let of_all = || if let [one] = states[..] { Some(one) } else { None };
        States(values.iter().filter_map(|&value| Some((value, own(value).or_else(of_all)?))).collect())
    }

    /// Columns of OPC's qualities among columns of numbers: 192 is a good value, and what is less than 64 a bad one.
    pub(crate) fn of_opc(layout: &Layout<'_>, values: &[usize]) -> Vec<usize> {
        let is_quality = |i: &&usize| layout.columns[**i].name.to_lowercase().contains("quality");
        let is_code = |cell: &str| cell.parse::<u16>().is_ok_and(|code| code < 256);
        let is_opc = |i: &&usize| {
            layout.column(**i).all(|cell| cell.is_empty() || is_code(cell))
                && layout.column(**i).any(|cell| cell == GOOD)
        };
        values.iter().filter(is_quality).filter(is_opc).copied().collect()
    }

    /// The column that says it of a value.
    pub(crate) fn of(&self, value: usize) -> Option<usize> {
        self.0.iter().find(|(v, _)| *v == value).map(|(_, state)| *state)
    }

    /// Whether a column is one.
    pub(crate) fn has(&self, column: usize) -> bool {
        self.0.iter().any(|(_, state)| *state == column)
    }
}

/// Whether a word or one of OPC's codes says that the value beside it is none.
pub(crate) fn is_bad(word: &str) -> bool {
    let lower = word.trim().to_lowercase();
    lower.parse::<u16>().is_ok_and(|code| code < 64) || BAD.iter().any(|begin| lower.starts_with(begin))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_value_has_its_own_state_or_all_have_one() {
        let names = ["t", "Valve", "Valve Quality", "Middle", "Middle Quality"].map(str::to_owned);
        let own = States::find(&names, &[2, 4], &[1, 3]);
        assert_eq!((own.of(1), own.of(3), own.has(2)), (Some(2), Some(4), true));
        let names = ["t", "Valve", "Middle", "Remark", "Status"].map(str::to_owned);
        let one = States::find(&names, &[3, 4], &[1, 2]);
        assert_eq!((one.of(1), one.of(2), one.has(3)), (Some(4), Some(4), false));
        assert!(
            is_bad("Bad, Sensor Failure")
                && is_bad("Uncertain")
                && is_bad("0")
                && !is_bad("192")
                && !is_bad("Good")
                && !is_bad("OK")
        );
    }
}
