//! Factors, zeros and the vacuum that stand beside a table. Nobody can tell whether the numbers below have them yet:
//! like a factor in a heading they become part of the unit, which nobody knows then, and the user is asked what the
//! numbers stand for.

use crate::storage::import::csv::heading::{factor_of, key_of};
use crate::storage::import::kinds::{is_absolute_name, is_absolute_unit, pressure_unit};

/// Keys of factors, without signs and in lower case; so is every key that ends with one of the first two.
const FACTORS: [&str; 17] = [
    "factor",
    "faktor",
    "scale",
    "scaling",
    "multiplier",
    "slope",
    "gain",
    "skalierung",
    "steigung",
    "facteur",
    "multiplicateur",
    "fattore",
    "multiplicador",
    "divisor",
    "divider",
    "teiler",
    "lsb",
];
/// Keys of what is to be added or taken off.
const ZEROS: [&str; 10] =
    ["offset", "addoffset", "intercept", "zero", "zerooffset", "zeropoint", "nullpunkt", "yoffset", "tare", "tara"];
/// Parts of a unit.
const PARTS: [&str; 9] = [
    "tenth",
    "tenths",
    "hundredth",
    "hundredths",
    "thousandth",
    "thousandths",
    "zehntel",
    "hundertstel",
    "tausendstel",
];
/// How words for a product begin.
const PRODUCTS: [&str; 4] = ["multipl", "divide", "dividier", "scaled"];
/// Words for the steps of a converter.
const STEPS: [&str; 6] = ["count", "counts", "lsb", "digit", "digits", "bit"];
/// How words for what a sensor shows begin.
const READINGS: [&str; 8] = ["pressure", "druck", "drück", "reading", "value", "werte", "pression", "presi"];
/// What stands between a word and its number.
const BETWEEN: [&str; 6] = ["is", "of", "by", "with", "mit", "durch"];
/// Keys of the zero of pressures.
const REFERENCES: [&str; 8] =
    ["reference", "pressuretype", "type", "mode", "pressuremode", "sensormode", "bezug", "druckart"];

/// Whether a cell under such a key changes the numbers: it is a number, and neither the factor 1 nor the zero 0. A
/// number per volt belongs to the transducer.
pub(crate) fn changes(key: &str, cell: &str) -> bool {
    let is_factor = FACTORS.contains(&key) || FACTORS[..2].iter().any(|end| key.ends_with(end));
    if !is_factor && !ZEROS.contains(&key) {
        return false;
    }
    let neutral = if is_factor { 1.0 } else { 0.0 };
    let mut words = cell.split_whitespace();
    let number = words.next().and_then(number);
    number.is_some_and(|number| number != neutral) && !words.any(|unit| unit.contains('/'))
}

/// Keys of lines on the transducer.
const TRANSDUCER: [&str; 9] = [
    "sensitivity",
    "empfindlichkeit",
    "kennwert",
    "sensibilité",
    "range",
    "measuringrange",
    "messbereich",
    "fullscale",
    "excitation",
];

/// Whether a key is that of a line on the transducer: the factor and the zero beside it are its own, and numbers in a
/// unit have passed them.
pub(crate) fn is_of_transducer(key: &str) -> bool {
    TRANSDUCER.contains(&key)
}

/// The part of a remark that says how large the numbers are: `slope 0.1`, `values multiplied by 10`,
/// `raw values are tenths of a bar`, `pressures x10`, `1 count = 0.1 bar`, `Tare: 1.0 bar`.
pub(crate) fn factor_in_words(remark: &str) -> Option<&str> {
    let clauses = remark.split(", ").flat_map(|part| part.split([';', '(', ')'])).map(str::trim);
    clauses.into_iter().find(|clause| {
        let lower = clause.to_lowercase();
        let words: Vec<&str> = lower.split(|c: char| c.is_whitespace() || "=:/".contains(c)).collect();
        let words: Vec<&str> = words.into_iter().filter(|w| !w.is_empty() && !BETWEEN.contains(w)).collect();
        let has = |begins: &[&str]| words.iter().position(|word| begins.iter().any(|begin| word.starts_with(begin)));
        let is = |known: &[&str]| words.iter().any(|word| known.contains(word));
        let is_scaled = |at: usize| words[at..].iter().any(|word| number(word).is_some_and(|n| n != 1.0));
        let is_unit = |word: &str| word.len() > 1 && pressure_unit("", word).is_some();
        let of_pressure = || has(&READINGS).is_some() || clause.split(|c: char| !c.is_alphanumeric()).any(is_unit);
        // `Tare valve: 1.0 bar` names the sensor in between
        let keyed = || {
            let value = words.iter().skip(1).take(2).find(|word| number(word).is_some());
            value.is_some_and(|value| changes(words[0], value))
        };
        is(&PARTS)
            || keyed()
            || has(&PRODUCTS).is_some_and(is_scaled)
            || (is(&STEPS) && words.iter().any(|word| is_unit(word)) && is_scaled(0))
            || (of_pressure() && factor_of(&clause.replace('=', " ")).is_some())
    })
}

/// Whether a remark says that the pressures count from the vacuum: `pressures are absolute`, `Range 0...30 bar abs`.
pub(crate) fn is_absolute(remark: &str) -> bool {
    let lower = remark.to_lowercase();
    let words: Vec<&str> = lower.split(|c: char| !c.is_alphanumeric()).filter(|w| !w.is_empty()).collect();
    let has = |begins: &[&str]| words.iter().any(|word| begins.iter().any(|begin| word.starts_with(begin)));
    let is = |known: &[&str]| words.iter().any(|word| known.contains(word));
    let of_unit = words.windows(2).any(|w| is_absolute_unit(&w.join(" "))) || words.iter().any(|w| is_absolute_unit(w));
    (of_unit || is_absolute_name(&lower) && has(&READINGS))
        && !is(&["not", "no", "gauge", "relative", "relativ", "nicht", "non", "error", "max", "min"])
}

/// Whether a property and its value say so, by the name or in words.
pub(crate) fn property_is_absolute(name: &str, value: &str) -> bool {
    is_absolute_by(&key_of(name), value) || is_absolute(value)
}

/// Whether a key and what stands behind it say so: `Pressure type: absolute`, `Reference;absolute;absolute`,
/// `Reference: vacuum`.
pub(crate) fn is_absolute_by(key: &str, cell: &str) -> bool {
    let says = |word: &str| ["absolute", "absolut", "abs", "vacuum", "vakuum"].contains(&word);
    REFERENCES.contains(&key) && cell.to_lowercase().split(|c: char| !c.is_alphabetic()).any(says)
}

fn number(word: &str) -> Option<f64> {
    word.trim_start_matches(['x', '×', '*', '/']).replace(',', ".").parse::<f64>().ok().filter(|n| n.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_factor_is_asked_for_and_one_by_one_is_none() {
        for (key, cell) in
            [("factor", "0.1"), ("multiplier", "0,01"), ("offset", "1.5"), ("slope", "x10"), ("gain", "2 bar")]
        {
            assert!(changes(key, cell), "{key} {cell}");
        }
        for (key, cell) in [
            ("factor", "1"),
            ("offset", "0.000 kPa"),
            ("gain", "auto"),
            ("scale", "0.1 bar/V"),
            ("range", "10"),
            ("scaling", ""),
        ] {
            assert!(!changes(key, cell), "{key} {cell}");
        }
    }

    #[test]
    fn remarks_on_the_size_of_the_numbers() {
        for (remark, said) in [
            ("slope 0.1, intercept 0", "slope 0.1"),
            ("raw values are tenths of a bar", "raw values are tenths of a bar"),
            ("pressures (multiply by 0.01)", "multiply by 0.01"),
            ("logger 7, factor = 10", "factor = 10"),
            ("all pressures x10", "all pressures x10"),
            ("units: bar*10", "units: bar*10"),
            ("1 count = 0.1 bar", "1 count = 0.1 bar"),
            ("P[bar]=0.1*x", "P[bar]=0.1*x"),
            ("Divisor: 10", "Divisor: 10"),
            ("Tare valve: 1.000 bar (subtracted)", "Tare valve: 1.000 bar"),
        ] {
            assert_eq!(factor_in_words(remark), Some(said), "{remark}");
        }
        for remark in [
            "raw data",
            "slope 1, intercept 0",
            "UTC offset 2",
            "Vertical Scale 0.5",
            "multiple runs, 7 of 9",
            "factor of safety",
        ] {
            assert_eq!(factor_in_words(remark), None, "{remark}");
        }
        for remark in [
            "pressures are absolute",
            "Druck absolut",
            "PAA-33X 0...30 bar abs",
            "sensor 0-300 psia",
            "压力 绝压 value",
        ] {
            assert!(is_absolute(remark), "{remark}");
        }
        assert!(
            is_absolute_by("reference", "Vacuum")
                && is_absolute_by("type", "A (absolute)")
                && !is_absolute_by("note", "absolute")
        );
        for remark in
            ["absolute time", "gauge pressures, not absolute", "absolute error of the pressure 0.1 %", "ABS pipe"]
        {
            assert!(!is_absolute(remark), "{remark}");
        }
    }
}
