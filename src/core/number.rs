//! How many digits a number deserves: every value that people read is written here, to its uncertainty where that is
//! known.

/// A value with its standard error in the last digits, `395.1(4)` meaning 395.1 ± 0.4.
///
/// The error gets one digit, or two where its leading digits are below 36, so that rounding never changes it by more
/// than 15 % (the rule of the Particle Data Group). An infinite or unknown error says so; an error of zero stands for
/// an exact value.
pub fn with_error(value: f64, error: f64) -> String {
    if !value.is_finite() {
        return "not a number".into();
    }
    if !error.is_finite() {
        return format!("{} (undetermined)", significant(value, 4));
    }
    if error <= 0.0 {
        return significant(value, 6);
    }
    let magnitude = value.abs().max(error);
    if !(1e-4..1e7).contains(&magnitude) {
        let exponent = magnitude.log10().floor() as i32;
        let scale = 10f64.powi(exponent);
        return format!("{}e{exponent}", plain_with_error(value / scale, error / scale));
    }
    plain_with_error(value, error)
}

/// The power of ten of an error's last digit that counts: its first, or its second where it begins below 3.55.
fn last_place(error: f64) -> i32 {
    let exponent = error.log10().floor() as i32;
    if error / 10f64.powi(exponent) < 3.55 { exponent - 1 } else { exponent }
}

/// A value and its standard error, `0.4604 ± 0.0003`, both to the digits that the error has; the value alone where
/// readings do not differ, for that is no error of 0.
pub fn plus_minus(value: f64, error: f64) -> String {
    if !value.is_finite() || !error.is_finite() {
        return with_error(value, error);
    }
    // what rounding leaves of readings that do not differ is no error
    if error <= 1e-9 * value.abs() {
        return significant(value, 4);
    }
    format!("{} ± {}", to_error(value, error), to_error(error, error))
}

/// A value to the digits that its error has, `0.4604` where it is known to 0.0003; to four where the error is not
/// known.
pub fn to_error(value: f64, error: f64) -> String {
    if !value.is_finite() {
        return "–".into();
    }
    if !error.is_finite() || error <= 1e-9 * value.abs() {
        return significant(value, 4);
    }
    let place = last_place(error);
    let step = 10f64.powi(place);
    if place >= 0 {
        format!("{:.0}", (value / step).round() * step)
    } else {
        format!("{value:.*}", place.unsigned_abs() as usize)
    }
}

fn plain_with_error(value: f64, error: f64) -> String {
    let last_place = last_place(error);
    let step = 10f64.powi(last_place);
    if last_place >= 0 {
        // Whole numbers: the error is written out, not counted in last digits.
        return format!("{:.0}({:.0})", (value / step).round() * step, (error / step).round() * step);
    }
    format!("{value:.*}({:.0})", last_place.unsigned_abs() as usize, error / step)
}

/// An interval, `395.0 to 395.3`, to as many digits as its width needs; an infinite end is open, and nothing stands for
/// no width and for an interval that is not known.
pub fn interval((low, high): (f64, f64)) -> String {
    if low.is_nan() || high.is_nan() {
        return String::new();
    }
    match (low.is_finite(), high.is_finite()) {
        (false, false) => "open".into(),
        (true, false) => format!("from {}", significant(low, 3)),
        (false, true) => format!("up to {}", significant(high, 3)),
        _ if low >= high => String::new(),
        // of a 95% interval the width is four standard errors
        _ if low.abs().max(high.abs()) >= 1e-4 => {
            let error = 0.25 * (high - low);
            format!("{} to {}", to_error(low, error), to_error(high, error))
        }
        _ => format!("{} to {}", significant(low, 3), significant(high, 3)),
    }
}

/// A number to `digits` significant digits, trailing zeros kept: `significant(0.0304, 2)` is `0.030`.
pub fn significant(value: f64, digits: usize) -> String {
    if !value.is_finite() {
        return "–".into();
    }
    if value == 0.0 {
        return "0".into();
    }
    let digits = digits.max(1) as i32;
    // Through the exponent format, so that 9.99 to two digits is 10 and not 10.0.
    let exponent = exponent_of(value, digits);
    if !(-5..7).contains(&exponent) {
        return format!("{value:.*e}", (digits - 1) as usize);
    }
    let places = digits - 1 - exponent;
    if places >= 0 {
        return format!("{value:.*}", places as usize);
    }
    let step = 10f64.powi(-places);
    format!("{:.0}", (value / step).round() * step)
}

fn exponent_of(value: f64, digits: i32) -> i32 {
    let text = format!("{value:.*e}", (digits - 1) as usize);
    text.rsplit('e').next().and_then(|e| e.parse().ok()).unwrap_or(0)
}

/// An error in metres: two digits below one metre, three above, as `0.034` and `1.92`.
pub fn error_m(value: f64) -> String {
    significant(value, if value.abs() < 0.995 { 2 } else { 3 })
}

/// How many times the noise an error is, `1.1`, `64`, `350`; a dash where the noise is unknown.
pub fn times(value: f64, noise: f64) -> String {
    let ratio = value / noise;
    if noise > 0.0 && ratio.is_finite() { significant(ratio, if ratio >= 100.0 { 3 } else { 2 }) } else { "–".into() }
}

/// The same with its unit, `64× noise`, for people; says so where the noise is unknown.
pub fn times_noise(value: f64, noise: f64) -> String {
    match times(value, noise).as_str() {
        "–" => "noise unknown".into(),
        ratio => format!("{ratio}× noise"),
    }
}

/// A duration in s with a unit that fits.
pub fn duration(seconds: f64) -> String {
    match seconds {
        s if !s.is_finite() => "–".into(),
        s if s < 1.0 => format!("{:.0} ms", s * 1e3),
        s if s < 120.0 => format!("{} s", significant(s, 3)),
        s => format!("{} min", significant(s / 60.0, 3)),
    }
}

/// Fixed decimals with a sign, `+0.12`; a dash where it is not a number.
pub fn signed(value: f64, decimals: usize) -> String {
    if !value.is_finite() {
        return "–".into();
    }
    let text = format!("{value:+.decimals$}");
    // A rounded zero has no sign.
    if text.bytes().all(|b| matches!(b, b'+' | b'-' | b'0' | b'.')) { text.replace(['+', '-'], "") } else { text }
}

/// Fixed decimals; a dash where it is not a number.
pub fn fixed(value: f64, decimals: usize) -> String {
    if value.is_finite() { format!("{value:.decimals$}") } else { "–".into() }
}

/// Decimals in which a quantity of this resolution is worth printing: its second digit for 0.015, its first for 0.03.
pub fn decimals_for(resolution: f64) -> usize {
    if resolution > 0.0 && resolution.is_finite() { (-resolution.log10()).ceil().clamp(0.0, 9.0) as usize } else { 3 }
}

/// A probability in words that do not claim more than it can, `0.87`, `> 0.99`.
pub fn probability(p: f64) -> String {
    match p {
        p if p > 0.995 => "> 0.99".into(),
        p if p < 0.005 => "< 0.01".into(),
        p => format!("{p:.2}"),
    }
}

/// Twelve significant digits, without the tail of binary fractions.
pub fn rounded(value: f64) -> f64 {
    format!("{value:.11e}").parse().unwrap_or(value)
}

/// Three digits, thousands in groups: `31,900,000`.
pub fn grouped(value: f64) -> String {
    if !value.is_finite() || value.abs() < 1e4 {
        return significant(value, 3);
    }
    let step = 10f64.powf(value.abs().log10().floor() - 2.0);
    let digits = format!("{:.0}", (value.abs() / step).round() * step);
    let grouped: Vec<&str> = digits.as_bytes().rchunks(3).rev().filter_map(|c| std::str::from_utf8(c).ok()).collect();
    format!("{}{}", if value < 0.0 { "-" } else { "" }, grouped.join(","))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interval_has_the_digits_of_its_width() {
        assert_eq!(interval((395.012, 395.274)), "395.01 to 395.27");
        assert_eq!(interval((0.021, 0.083)), "0.021 to 0.083");
        assert_eq!(interval((0.5, f64::INFINITY)), "from 0.500");
        assert_eq!(interval((f64::NEG_INFINITY, 0.25)), "up to 0.250");
        assert_eq!(interval((f64::NEG_INFINITY, f64::INFINITY)), "open");
        assert_eq!(interval((1.0, 1.0)), "");
        assert_eq!(interval((f64::NAN, f64::NAN)), "");
    }

    #[test]
    fn errors_stand_in_the_last_digits() {
        assert_eq!(with_error(395.123, 0.4), "395.1(4)");
        assert_eq!(with_error(0.103_44, 0.0021), "0.1034(21)");
        assert_eq!(with_error(1318.6, 23.0), "1319(23)");
        assert_eq!(with_error(123_456.0, 6789.0), "123000(7000)");
        assert_eq!(with_error(1.2341e-7, 0.02e-7), "1.234(20)e-7");
        assert_eq!(with_error(0.02, 0.5), "0.0(5)");
        assert_eq!(with_error(-3.0, 0.996), "-3.0(10)");
    }

    #[test]
    fn values_have_the_digits_of_their_errors() {
        assert_eq!(plus_minus(0.5021, 0.000_012_3), "0.502100 ± 0.000012");
        assert_eq!(plus_minus(0.897_379_231, 0.000_44), "0.8974 ± 0.0004");
        assert_eq!(plus_minus(395.1, 12.4), "395 ± 12");
        assert_eq!(plus_minus(1.25, 0.2), "1.25 ± 0.20");
        assert_eq!(plus_minus(0.897_379_231, 1e-17), "0.8974");
        assert_eq!(plus_minus(1.25, f64::INFINITY), "1.250 (undetermined)");
        assert_eq!(to_error(1241.83, 92.0), "1240");
    }

    #[test]
    fn what_the_data_do_not_determine_is_said() {
        assert_eq!(with_error(0.1, f64::INFINITY), "0.1000 (undetermined)");
        assert_eq!(with_error(0.1, f64::NAN), "0.1000 (undetermined)");
        assert_eq!(with_error(f64::NAN, 0.1), "not a number");
        assert_eq!(with_error(12.0, 0.0), "12.0000");
    }

    #[test]
    fn significant_digits_survive_rounding_up() {
        assert_eq!(significant(0.0304, 2), "0.030");
        assert_eq!(significant(9.99, 2), "10");
        assert_eq!(significant(0.0996, 2), "0.10");
        assert_eq!(significant(1234.0, 2), "1200");
        assert_eq!(significant(1.5e-9, 2), "1.5e-9");
        assert_eq!(error_m(1.9234), "1.92");
        assert_eq!(error_m(0.0338), "0.034");
        assert_eq!(error_m(0.9999), "1.00");
    }

    #[test]
    fn a_rounded_zero_has_no_sign() {
        assert_eq!(signed(-0.0004, 2), "0.00");
        assert_eq!(signed(-0.4, 1), "-0.4");
        assert_eq!(signed(12.5, 1), "+12.5");
    }

    #[test]
    fn ratios_need_a_known_noise() {
        assert_eq!(times(0.034, 0.03), "1.1");
        assert_eq!(times(1.92, 0.03), "64");
        assert_eq!(times(1.0, 0.0), "–");
        assert_eq!(times(f64::NAN, 0.03), "–");
        assert_eq!(times_noise(1.92, 0.03), "64× noise");
        assert_eq!(times_noise(1.92, f64::NAN), "noise unknown");
    }

    #[test]
    fn thousands_stand_in_groups() {
        assert_eq!(grouped(32_127_829.4), "32,100,000");
        assert_eq!(grouped(-12_345.0), "-12,300");
        assert_eq!(grouped(18_299_089.4), "18,300,000");
        assert_eq!(grouped(-8.44), "-8.44");
        assert_eq!(grouped(1234.5), "1230");
    }
}
