//! What this process and its children used, from /proc.

use std::fs::read_to_string;

/// Ticks of /proc a second, on every Linux that is not decades old.
const TICKS_PER_S: f64 = 100.0;

fn stat(path: &str, fields: [usize; 2]) -> f64 {
    let text = read_to_string(path).unwrap_or_default();
    // The second field is a name in parentheses, which may hold spaces.
    let rest = text.rsplit(')').next().unwrap_or_default();
    let number =
        |field: usize| rest.split_whitespace().nth(field - 3).and_then(|t| t.parse::<f64>().ok()).unwrap_or(0.0);
    fields.into_iter().map(number).sum::<f64>() / TICKS_PER_S
}

/// CPU seconds of this process.
pub fn own_cpu_s() -> f64 {
    stat("/proc/self/stat", [14, 15])
}

/// CPU seconds of the children that have ended.
pub fn children_cpu_s() -> f64 {
    stat("/proc/self/stat", [16, 17])
}

/// CPU seconds of the threads of this process whose names begin so.
pub fn threads_cpu_s(name: &str) -> f64 {
    let tasks = std::fs::read_dir("/proc/self/task").into_iter().flatten().flatten();
    let named = tasks.filter(|task| read_to_string(task.path().join("comm")).is_ok_and(|comm| comm.starts_with(name)));
    named.map(|task| stat(&task.path().join("stat").to_string_lossy(), [14, 15])).sum()
}

/// Memory of this process now, MiB.
pub fn memory_mib() -> f64 {
    let status = read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
    line.and_then(|line| line.split_whitespace().next()?.parse::<f64>().ok()).unwrap_or(0.0) / 1024.0
}
