//! From a claim about a range of retardation times to a verdict.

/// Does a rule hold?
#[derive(Debug, Clone, PartialEq)]
pub enum Verdict {
    /// Everywhere that the paper says.
    Holds,
    /// Nowhere that the paper says.
    Fails,
    /// In a part of what the paper says, in words: ranges of τ/T.
    HoldsWhere(String),
    /// Nothing was there to judge by: no second peak, for one.
    Unknown,
}

impl std::fmt::Display for Verdict {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Verdict::Holds => f.write_str("holds"),
            Verdict::Fails => f.write_str("fails"),
            Verdict::HoldsWhere(part) => write!(f, "holds only for {part}"),
            Verdict::Unknown => f.write_str("not seen"),
        }
    }
}

impl Verdict {
    /// Of a plain yes or no.
    pub fn of(holds: bool) -> Verdict {
        if holds { Verdict::Holds } else { Verdict::Fails }
    }
}

/// Judges a claim by what is true at each retardation time (s), in increasing order, in the range that the claim is
/// about; `None` where there is nothing to judge by. The period (s) turns times into τ/T.
pub fn judge(truth: &[(f64, Option<bool>)], claimed: impl Fn(f64) -> bool, period_s: f64) -> Verdict {
    let known: Vec<(f64, bool)> =
        truth.iter().filter(|(tau, _)| claimed(*tau)).filter_map(|(tau, t)| Some((*tau, (*t)?))).collect();
    let holding = known.iter().filter(|k| k.1).count();
    match holding {
        _ if known.is_empty() => Verdict::Unknown,
        0 => Verdict::Fails,
        n if n == known.len() => Verdict::Holds,
        _ => Verdict::HoldsWhere(stretches(&known, period_s)),
    }
}

/// The stretches in which something is true, `τ/T ≤ 0.03 or 0.3 to 2`; ends lie half-way (in ratio) to the first time
/// at which it is not.
fn stretches(known: &[(f64, bool)], period_s: f64) -> String {
    let ratio = |tau_s: f64| two_digits(tau_s / period_s);
    let between = |i: usize| (known[i].0 * known[i + 1].0).sqrt();
    let mut parts = Vec::new();
    let mut i = 0;
    while i < known.len() {
        if !known[i].1 {
            i += 1;
            continue;
        }
        let first = i;
        while i + 1 < known.len() && known[i + 1].1 {
            i += 1;
        }
        parts.push(match (first, i + 1 == known.len()) {
            (0, true) => "all".to_owned(),
            (0, false) => format!("τ/T ≤ {}", ratio(between(i))),
            (_, true) => format!("τ/T ≥ {}", ratio(between(first - 1))),
            (_, false) => format!("{} ≤ τ/T ≤ {}", ratio(between(first - 1)), ratio(between(i))),
        });
        i += 1;
    }
    parts.join(" or ")
}

/// A number to two digits, without zeros behind them.
pub fn two_digits(value: f64) -> f64 {
    format!("{value:.1e}").parse().unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn truth(flags: &[u8]) -> Vec<(f64, Option<bool>)> {
        let tau = |i: usize| 10f64.powi(i as i32 - 3);
        flags.iter().enumerate().map(|(i, f)| (tau(i), [Some(false), Some(true), None][*f as usize])).collect()
    }

    #[test]
    fn a_claim_is_judged_within_its_range_only() {
        let above = |tau: f64| tau > 0.05;
        assert_eq!(judge(&truth(&[0, 0, 1, 1, 1]), above, 1.0), Verdict::Holds);
        assert_eq!(judge(&truth(&[1, 1, 0, 0, 0]), above, 1.0), Verdict::Fails);
        assert_eq!(judge(&truth(&[1, 1, 2, 2, 2]), above, 1.0), Verdict::Unknown);
        let part = judge(&truth(&[0, 0, 0, 1, 1]), above, 2.0);
        assert_eq!(part.to_string(), "holds only for τ/T ≥ 0.16");
        let two = judge(&truth(&[1, 0, 1, 0, 1]), |_| true, 1.0);
        assert_eq!(two.to_string(), "holds only for τ/T ≤ 0.0032 or 0.032 ≤ τ/T ≤ 0.32 or τ/T ≥ 3.2");
    }
}
