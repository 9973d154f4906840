//! Numbers as people write them: with a decimal comma, with a unit behind them.

/// A finite number; a single comma is a decimal one, unless it may as well group thousands.
///
/// # Errors
/// In words, to stand behind the name of what was asked for; likewise below.
pub fn number(text: &str) -> Result<f64, String> {
    let plain = match text.trim().split_once(',') {
        Some((whole, digits)) if digits.len() == 3 && !matches!(whole, "" | "0" | "-0") => {
            return Err(format!("'{text}' may be two numbers: write a decimal point, and nothing between thousands"));
        }
        Some((whole, digits)) => format!("{whole}.{digits}"),
        None => text.trim().to_owned(),
    };
    plain.parse().ok().filter(|v: &f64| v.is_finite()).ok_or_else(|| format!("'{text}' is not a number"))
}

/// Units that people write behind a length, a time or a temperature, in the unit that goes before them.
const WRITTEN_UNITS: [(&str, &[(&str, f64)]); 4] = [
    ("m", &[("mm", 1e-3), ("cm", 1e-2), ("km", 1e3), ("in", 0.0254), ("ft", 0.3048)]),
    ("mm", &[("m", 1e3), ("cm", 10.0), ("in", 25.4)]),
    ("s", &[("ms", 1e-3), ("min", 60.0)]),
    ("°C", &[("C", 1.0), ("degC", 1.0)]),
];

/// A number in `unit`, or with another unit behind it, as in `1200 mm` for metres.
///
/// # Errors
/// See [`number`]; also a unit that is not known.
pub fn measure(text: &str, unit: &str) -> Result<f64, String> {
    let text = text.trim();
    let (value, written) = text.split_at(text.trim_end_matches(|c: char| c.is_alphabetic() || c == '°').len());
    if written.is_empty() || written == unit {
        return number(value);
    }
    let others = WRITTEN_UNITS.iter().find(|(own, _)| *own == unit).map_or(&[][..], |(_, others)| *others);
    match others.iter().find(|(name, _)| *name == written) {
        Some((_, factor)) => Ok(number(value)? * factor),
        None => Err(format!("'{written}' is no unit that is known here: write the number in {unit}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commas_and_units_are_understood() {
        assert_eq!((number("80,0"), number(" 1.5")), (Ok(80.0), Ok(1.5)));
        assert_eq!(number("0,020"), Ok(0.02));
        assert!(number("1,000").unwrap_err().contains("two numbers") && number("1,2,3").is_err());
        assert_eq!(
            (measure("80 m", "m"), measure("1200mm", "m"), measure("2,5 cm", "mm")),
            (Ok(80.0), Ok(1.2), Ok(25.0))
        );
        assert_eq!((measure("20 °C", "°C"), measure("50 ms", "s"), measure("7", "s")), (Ok(20.0), Ok(0.05), Ok(7.0)));
        assert!(measure("3 furlongs", "m").unwrap_err().contains("in m") && measure("m", "m").is_err());
    }
}
