//! Values on the command line: numbers in their ranges, `NAME=VALUE` pairs, an effect. Each is a clap value parser.

use std::ops::RangeInclusive;

use crate::fit::outcome::posterior::WANTED;
use crate::model::effects::{Chosen, parse_list, pipe_is_no_setting};
pub(crate) use crate::units::written::number;

/// One effect, such as `leak` or `viscoelastic-wall:2`.
///
/// # Errors
/// No effect of the catalogue, or several.
pub fn one_effect(text: &str) -> Result<Chosen, String> {
    let mut list = parse_list(text).map_err(|e| e.to_string())?;
    match (list.pop(), list.is_empty()) {
        (Some(one), true) => Ok(one),
        _ => Err("name one effect; `surgescope effects` lists them".to_owned()),
    }
}

/// A number above 0.
///
/// # Errors
/// See [`number`].
pub fn positive(text: &str) -> Result<f64, String> {
    number(text).and_then(|v| if v > 0.0 { Ok(v) } else { Err("must be above 0".to_owned()) })
}

/// A number not below 0.
///
/// # Errors
/// See [`number`].
pub fn not_negative(text: &str) -> Result<f64, String> {
    number(text).and_then(|v| if v >= 0.0 { Ok(v) } else { Err("must not be negative".to_owned()) })
}

/// A number of reaches of a grid, 8 to 100000.
///
/// # Errors
/// See [`number`].
pub fn reaches(text: &str) -> Result<usize, String> {
    whole(text, &(8..=100_000))
}

/// A number of independent draws of a posterior.
///
/// # Errors
/// None that is a number in [`WANTED`].
pub fn draws(text: &str) -> Result<usize, String> {
    whole(text, &WANTED)
}

fn whole(text: &str, range: &RangeInclusive<usize>) -> Result<usize, String> {
    let number = text.trim().parse().ok().filter(|n| range.contains(n));
    number.ok_or_else(|| format!("must be a whole number from {} to {}", range.start(), range.end()))
}

/// `NAME=TEXT`.
///
/// # Errors
/// Without `=` or without a name.
pub fn pair(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((name, value)) if !name.trim().is_empty() => Ok((name.trim().to_owned(), value.to_owned())),
        _ => Err("write it as NAME=VALUE".to_owned()),
    }
}

/// `NAME=NUMBER`.
///
/// # Errors
/// See [`pair`] and [`number`].
pub fn setting(text: &str) -> Result<(String, f64), String> {
    // An option that takes several of these takes a file behind them for one more.
    let (name, value) = pair(text).map_err(|e| format!("{e}, and name files before this option"))?;
    if let Some(why) = pipe_is_no_setting(&name) {
        return Err(why);
    }
    Ok((name, number(&value)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_are_read_and_slips_are_explained() {
        assert_eq!(setting("wave_speed_m_s = 395").unwrap(), ("wave_speed_m_s".to_owned(), 395.0));
        assert!(setting("run.mcap").unwrap_err().contains("NAME=VALUE, and name files before this option"));
        assert!(setting("a=b").unwrap_err().contains("'b' is not a number"));
        assert!(setting("leak_pipe=branch").unwrap_err().contains("leak@PIPE"));
        assert!(setting("a=NaN").is_err() && positive("0").is_err() && not_negative("-1").is_err());
        assert_eq!(not_negative("0"), Ok(0.0));
        assert_eq!((reaches("8"), reaches("100000")), (Ok(8), Ok(100_000)));
        assert_eq!(draws("100"), Ok(100));
        assert!(draws("99").unwrap_err().contains("from 100 to 100000"));
        for bad in ["7", "100001", "-1", "1e3", "64.5", ""] {
            assert!(reaches(bad).unwrap_err().contains("from 8 to 100000"), "{bad}");
        }
    }
}
