//! Factors, zeros and the vacuum that stand beside a table. Nobody can tell whether the numbers below have them yet: like a factor in a heading they
//! become part of the unit, which nobody knows then, and the user is asked what the numbers stand for.

/// Keys of factors, without signs and in lower case.
const FACTORS: [&str; 16] = [
    "factor",
    "scalefactor",
    "scalingfactor",
    "scale",
    "scaling",
    "multiplier",
    "slope",
    "gain",
    "faktor",
    "skalierung",
    "skalierungsfaktor",
    "steigung",
    "facteur",
    "multiplicateur",
    "fattore",
    "multiplicador",
];
/// Keys of what is to be added or taken off.
const ZEROS: [&str; 6] = ["offset", "intercept", "zerooffset", "zeropoint", "nullpunkt", "yoffset"];
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
const PRODUCTS: [&str; 5] = ["multipl", "multiplizier", "divide", "dividier", "scaled"];
/// What stands between a word and its number.
const BETWEEN: [&str; 6] = ["is", "of", "by", "with", "mit", "durch"];

/// Whether a cell under such a key changes the numbers: it is a number, and neither the factor 1 nor the zero 0. A number per volt belongs to the
/// transducer.
pub(crate) fn changes(key: &str, cell: &str) -> bool {
    let neutral = match () {
        () if FACTORS.contains(&key) => 1.0,
        () if ZEROS.contains(&key) => 0.0,
        () => return false,
    };
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

/// Whether a key is that of a line on the transducer: the factor and the zero beside it are its own, and numbers in a unit have passed them.
pub(crate) fn is_of_transducer(key: &str) -> bool {
    TRANSDUCER.contains(&key)
}

/// The part of a remark that says how large the numbers are: `slope 0.1`, `values multiplied by 10`, `raw values are tenths of a bar`.
pub(crate) fn factor_in_words(remark: &str) -> Option<&str> {
    let clauses = remark.split(", ").flat_map(|part| part.split([';', '(', ')'])).map(str::trim);
    clauses.into_iter().find(|clause| {
        let lower = clause.to_lowercase();
        let words: Vec<&str> = lower.split(|c: char| c.is_whitespace() || "=:".contains(c)).collect();
        let words: Vec<&str> = words.into_iter().filter(|w| !w.is_empty() && !BETWEEN.contains(w)).collect();
        let keyed = || Some(changes(words.first()?, words.get(1)?));
        let product = words.iter().position(|word| PRODUCTS.iter().any(|begin| word.starts_with(begin)));
        let multiplied = |at: usize| words[at..].iter().any(|word| number(word).is_some_and(|n| n != 1.0));
        words.iter().any(|word| PARTS.contains(word)) || keyed() == Some(true) || product.is_some_and(multiplied)
    })
}

/// Whether a remark says that the pressures count from the vacuum.
pub(crate) fn is_absolute(remark: &str) -> bool {
    let lower = remark.to_lowercase();
    let words: Vec<&str> = lower.split(|c: char| !c.is_alphanumeric()).collect();
    let has = |begins: &[&str]| words.iter().any(|word| begins.iter().any(|begin| word.starts_with(begin)));
    let is = |known: &[&str]| words.iter().any(|word| known.contains(word));
    is(&["absolute", "absolut", "abs", "absolue", "absolues", "absolutdruck"])
        && (has(&["pressure", "druck", "drück", "reading", "value", "werte", "pression"]) || is(&["absolutdruck"]))
        && !is(&["not", "no", "gauge", "relative", "relativ", "nicht", "non", "error", "max", "min"])
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
        assert!(is_absolute("pressures are absolute") && is_absolute("Druck absolut"));
        for remark in
            ["absolute time", "gauge pressures, not absolute", "absolute error of the pressure 0.1 %", "ABS pipe"]
        {
            assert!(!is_absolute(remark), "{remark}");
        }
    }
}
