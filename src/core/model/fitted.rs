//! The weight of the new step that makes a one-step rule exact for a decay.

/// `θ` of `y⁺ - y = dt [θ y'⁺ + (1 - θ) y']` that is exact for `y' = -k (y - f)`, `f` linear over the step, `r = k dt`
/// (Liniger & Willoughby 1970, SIAM J. Numer. Anal. 7:47-66): the trapezoidal rule where the decay is slow, the implicit
/// rule where it is quick, so that nothing rings.
pub(crate) fn theta(r: f64) -> f64 {
    // Beside its series, where the difference loses its digits.
    if r < 1e-3 { 0.5 + r / 12.0 } else { -1.0 / (-r).exp_m1() - 1.0 / r }
}

#[cfg(test)]
mod tests {
    use super::theta;

    #[test]
    fn it_goes_from_a_half_to_one_without_a_jump() {
        assert_eq!((theta(0.0), theta(f64::INFINITY)), (0.5, 1.0));
        assert!((theta(1e-3) - theta(1e-3 - 1e-9)).abs() < 1e-9);
        for r in [0.01f64, 0.5, 3.0] {
            // y' = -k y: y⁺ (1 + θ r) = y (1 - (1 - θ) r).
            let left = (1.0 - (1.0 - theta(r)) * r) / (1.0 + theta(r) * r);
            assert!((left - (-r).exp()).abs() < 1e-12, "{r}");
        }
    }
}
