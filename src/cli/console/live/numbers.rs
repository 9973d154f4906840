//! Numbers as a view shows them: short, and no wider than they need to be.

/// Samples a second.
pub(crate) fn rate(per_s: f64) -> String {
    match per_s {
        r if r >= 99_950.0 => format!("{:.0}k", r / 1e3),
        r if r >= 9_999.5 => format!("{:.1}k", r / 1e3),
        r if r >= 9.95 || r == 0.0 => format!("{r:.0}"),
        r => format!("{r:.2}"),
    }
}

/// A count.
pub(crate) fn count(n: u64) -> String {
    match n {
        0..1_000_000 => n.to_string(),
        1_000_000..1_000_000_000 => format!("{:.2}M", n as f64 / 1e6),
        _ => format!("{:.2}G", n as f64 / 1e9),
    }
}

/// Bytes, in powers of ten as disks are sold.
pub(crate) fn bytes(n: u64) -> String {
    let n = n as f64;
    match n {
        _ if n >= 1e12 => format!("{:.1} TB", n / 1e12),
        _ if n >= 1e9 => format!("{:.1} GB", n / 1e9),
        _ => format!("{:.0} MB", n / 1e6),
    }
}

/// A time that something lasts.
pub(crate) fn lasting(seconds: f64) -> String {
    match seconds {
        s if s < 120.0 => format!("{s:.0} s"),
        s if s < 7200.0 => format!("{:.0} min", s / 60.0),
        s if s < 172_800.0 => format!("{:.0} h", s / 3600.0),
        s if s < 3.2e7 => format!("{:.0} days", s / 86_400.0),
        _ => "over a year".to_owned(),
    }
}

/// A value to a tenth of what it may be off.
pub(crate) fn value(value: f64, accuracy: f64) -> String {
    let digits = if accuracy > 0.0 { (1.0 - accuracy.log10().floor()).clamp(0.0, 6.0) as usize } else { 3 };
    format!("{value:.digits$}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short_at_every_size() {
        assert_eq!(
            [0.0, 0.25, 10.0, 1000.0, 20_000.0, 500_000.0].map(rate),
            ["0", "0.25", "10", "1000", "20.0k", "500k"]
        );
        assert_eq!([7, 999_999, 1_240_000, 3_100_000_000].map(count), ["7", "999999", "1.24M", "3.10G"]);
        assert_eq!([52_000_000, 12_340_000_000, 2_000_000_000_000].map(bytes), ["52 MB", "12.3 GB", "2.0 TB"]);
        let times = [9.0, 600.0, 86_400.0, 864_000.0, f64::INFINITY].map(lasting);
        assert_eq!(times, ["9 s", "10 min", "24 h", "10 days", "over a year"]);
        assert_eq!(
            [(245.333, 2.75), (22.2, 0.11), (7.3, 0.0365), (101_325.0, 500.0), (1.0, 0.0)].map(|(v, a)| value(v, a)),
            ["245.3", "22.20", "7.300", "101325", "1.000"]
        );
    }
}
