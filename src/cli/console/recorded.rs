//! What a session recorded, for people.

use std::fmt::Write as _;

use crate::record::session::output::{DeviceCount, Summary};

/// Samples and gaps of each sensor, frames of each device, and all that went wrong.
pub(crate) fn table(summary: &Summary) -> String {
    let names = summary.sensors.iter().map(|s| &s.name).chain(summary.devices.iter().map(|d| &d.name));
    let width = names.map(|name| name.chars().count()).max().unwrap_or(0).max("sensor".len());
    let mut text = format!("{:.3} s recorded\n", summary.duration_s);
    let _ = writeln!(text, "{:width$}  {:>10}  {:>10}", "sensor", "samples", "gaps");
    for sensor in &summary.sensors {
        let _ = writeln!(text, "{:width$}  {:>10}  {:>10}", sensor.name, sensor.samples, sensor.gaps);
    }
    if !summary.devices.is_empty() {
        let _ =
            writeln!(text, "{:width$}  {:>10}  {:>10}  {:>10}  {:>10}", "device", "frames", "bad", "lost", "repeated");
    }
    for device in &summary.devices {
        let _ = writeln!(
            text,
            "{:width$}  {:>10}  {:>10}  {:>10}  {:>10}",
            device.name, device.frames, device.bad_frames, device.lost_frames, device.duplicated_frames
        );
    }
    for alert in &summary.alerts {
        let _ = writeln!(text, "{} {}; {}", alert.sensor, alert.message(0), alert.advice);
    }
    for shot in &summary.shots {
        let _ = writeln!(text, "shot: {shot}");
    }
    for cut in &summary.cut_short {
        let (file, kept_s, asked_s) = (&cut.file, cut.kept_s, cut.asked_s);
        let _ = match kept_s {
            0.0 => writeln!(text, "cut short: {file} ends before the trigger fired"),
            kept_s => writeln!(text, "cut short: {file} has {kept_s:.3} of {asked_s} s after the trigger fired"),
        };
    }
    for absent in &summary.absent {
        let (file, sensors) = (&absent.file, absent.sensors.join(", "));
        let _ = writeln!(
            text,
            "absent: {file} has no samples of {sensors}, which had sent nothing when it ended: check that the device is on, and sends more often than --silence"
        );
    }
    for lost in &summary.lost_shots {
        let _ = writeln!(text, "{lost}");
    }
    if summary.unheeded_edges > 0 {
        let _ = writeln!(
            text,
            "The valve's command switched {} while the trigger waited for --pre seconds of quiet: no shot contains that.",
            if summary.unheeded_edges == 1 { "once".to_owned() } else { format!("{} times", summary.unheeded_edges) }
        );
    }
    for device in &summary.devices {
        let _ = describe(&mut text, device);
    }
    if summary.data_lost {
        let gaps: u64 = summary.sensors.iter().map(|sensor| sensor.gaps).sum();
        text.push_str(match gaps {
            0 => "Samples were lost before the first or after the last sample of their sensors: no gap marks them.\n",
            _ => "Samples were lost; each hole is recorded as a gap.\n",
        });
    }
    text
}

/// What went wrong with a device.
fn describe(text: &mut String, device: &DeviceCount) -> std::fmt::Result {
    let name = &device.name;
    if let Some(clock) = &device.clock {
        writeln!(text, "clock of {name}: {clock}")?;
    }
    for warning in device.clock_warning.iter().chain(&device.poll_warning) {
        writeln!(text, "{name}: {warning}")?;
    }
    for (count, what) in [
        (device.late_answers, "answers came after their time-out and were discarded"),
        (device.reconnects, "times it vanished and came back"),
        (device.restarts, "times it restarted"),
        (device.clock_steps, "times its clock was set; its samples stay in sequence"),
        (device.squeezed_frames, "frames began before the previous one ended; their samples are closer together"),
        (
            device.restamped_frames,
            "frames had a time that contradicts their neighbours; they were placed by their sequence number",
        ),
        (device.queue_waits, "times it waited because the disk did not keep up"),
    ] {
        if count > 0 {
            writeln!(text, "{name}: {count} {what}")?;
        }
    }
    if let Some(late_s) = device.began_late_s {
        writeln!(text, "{name}: its first sample came {late_s:.1} s after the recording began; a gap marks that")?;
    }
    if device.incomplete {
        let what =
            if device.frames == 0 { "it sent nothing that can be used" } else { "it stopped sending before the end" };
        writeln!(text, "{name}: {what}")?;
    }
    Ok(())
}
