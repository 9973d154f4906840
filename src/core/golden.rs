//! The minimum of a function of one variable.

/// Where a function that falls and then rises is least between two values (golden section, Kiefer 1953, Proc. AMS 4,
/// 502).
pub(crate) fn least_between(of: impl Fn(f64) -> f64, low: f64, high: f64) -> f64 {
    least_looked_at(|x| (of(x), x), low, high, 40)
}

/// The same where the function is looked at so many times, twice at least: what comes with its least value there.
pub(crate) fn least_looked_at<T>(of: impl Fn(f64) -> (f64, T), mut low: f64, mut high: f64, times: usize) -> T {
    let golden = 0.5 * (5f64.sqrt() - 1.0);
    let look = |at: f64| (at, of(at));
    let (mut a, mut b) = (look(high - golden * (high - low)), look(low + golden * (high - low)));
    for _ in 2..times {
        if a.1.0 < b.1.0 {
            high = b.0;
            (a, b) = (look(high - golden * (high - low)), a);
        } else {
            low = a.0;
            (a, b) = (b, look(low + golden * (high - low)));
        }
    }
    if a.1.0 < b.1.0 { a.1.1 } else { b.1.1 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_least_value_is_between_and_looked_for_as_often_as_asked() {
        for least in [-0.999, -0.3, 0.0, 0.7, 0.999] {
            // Rounding hides what is nearer than the root of the smallest difference of values.
            assert!((least_between(|x| (x - least).abs(), -1.0, 1.0) - least).abs() < 1e-7);
            let looks = std::cell::Cell::new(0);
            let at = |x: f64| {
                looks.set(looks.get() + 1);
                ((x - least).powi(2), x)
            };
            let near = least_looked_at(at, -1.0, 1.0, 6);
            // Each look but the first two leaves 0.618 of the stretch.
            assert!((near - least).abs() < 2.0 * 0.6181f64.powi(5) && looks.get() == 6, "{near} {least}");
        }
    }
}
