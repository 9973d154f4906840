//! How much memory the machine has to give.

use crate::model::memory::USUAL_LIMIT_BYTES;

/// What one simulation may take, bytes: what the system says is free for it where it says so, but no more than usual.
pub fn limit_bytes() -> f64 {
    let text = std::fs::read_to_string("/proc/meminfo").unwrap_or_default();
    available_bytes(&text).map_or(USUAL_LIMIT_BYTES, |free| free.min(USUAL_LIMIT_BYTES))
}

/// `MemAvailable` of Linux's `/proc/meminfo`.
fn available_bytes(meminfo: &str) -> Option<f64> {
    let line = meminfo.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    let kib: f64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib * 1024.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_available_is_read_in_bytes() {
        let text =
            "MemTotal:       24683520 kB\nMemFree:          123456 kB\nMemAvailable:       2048 kB\nBuffers: 1 kB\n";
        assert_eq!(available_bytes(text), Some(2_097_152.0));
        assert_eq!(available_bytes("MemTotal: 5 kB\n"), None);
        assert_eq!(available_bytes(""), None);
        assert!(limit_bytes() > 0.0 && limit_bytes() <= USUAL_LIMIT_BYTES);
    }
}
