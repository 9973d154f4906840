//! Messages about changes: problems that appear or end, and steps of the trigger. And the progress line of every
//! second.

use crate::cli::console::live::numbers::{bytes, lasting};
use crate::cli::console::live::tone::Tone;
use crate::record::health::alert::SensorFault;
use crate::record::health::snapshot::{Disk, Phase, Snapshot, TriggerView};

/// A disk that is full sooner than this is called out, s.
pub(crate) const SHORT_OF_ROOM_S: f64 = 600.0;

/// What has changed from one snapshot to the next, in sentences; with what to do about it, unless that is shown
/// elsewhere.
pub(crate) fn changes(before: Option<&Snapshot>, now: &Snapshot, advised: bool) -> Vec<(Tone, String)> {
    let nothing = Snapshot::default();
    let before = before.unwrap_or(&nothing);
    let mut news = Vec::new();
    for (i, device) in now.devices.iter().enumerate() {
        let name = &device.count.name;
        match (before.devices.get(i).and_then(|device| device.trouble.as_ref()), &device.trouble) {
            (old, Some(trouble)) if old != Some(trouble) => news.push((Tone::Alarm, format!("{name}: {trouble}"))),
            (Some(_), None) => news.push((Tone::Plain, format!("{name} sends"))),
            _ => {}
        }
        let known = before.devices.get(i).map_or(0, |device| device.count.said);
        let new = usize::try_from(device.count.said.saturating_sub(known)).unwrap_or(usize::MAX);
        let said = &device.count.stderr;
        let lines = said.iter().skip(said.len().saturating_sub(new));
        news.extend(lines.map(|line| (Tone::Plain, format!("{name} says: {line}"))));
    }
    for sensor in &now.sensors {
        let old = before.sensors.iter().find(|old| old.name == sensor.name).and_then(|old| old.fault);
        let of_device = sensor.device.and_then(|i| now.devices.get(i)).is_some_and(|device| device.trouble.is_some());
        let name = &sensor.name;
        match (old, sensor.fault) {
            (_, Some(SensorFault::Silent)) if of_device => {}
            (old, Some(fault)) if old.is_none_or(|old| old.word() != fault.word()) => {
                let advice = if advised { format!("; {}", fault.advice()) } else { String::new() };
                news.push((Tone::Alarm, format!("{name} {}{advice}", fault.seen(sensor.unit))));
            }
            (Some(SensorFault::Silent), None) => {}
            (Some(old), None) => news.push((Tone::Plain, format!("{name} is no longer {}", old.word()))),
            _ => {}
        }
    }
    let short = |disk: &Disk| disk.lasts_s() < SHORT_OF_ROOM_S;
    if let Some(disk) = now.disk.filter(|disk| short(disk) && !before.disk.as_ref().is_some_and(short)) {
        news.push((Tone::Alarm, room(&disk)));
    }
    if let Some(trigger) = &now.trigger {
        news.extend(fired(before.trigger.as_ref(), trigger));
    }
    let when = now.recorded_s.map_or_else(String::new, |s| format!("{s:.1} s  "));
    news.into_iter().map(|(tone, text)| (tone, format!("{when}{text}"))).collect()
}

/// A disk that will soon be full.
pub(crate) fn room(disk: &Disk) -> String {
    format!(
        "the disk is full in {}, {} left: free some space, or end the recording before",
        lasting(disk.lasts_s()),
        bytes(disk.free_bytes)
    )
}

fn fired(before: Option<&TriggerView>, now: &TriggerView) -> Vec<(Tone, String)> {
    let (old, shots) = (before.map(|trigger| trigger.phase), before.map_or(0, |trigger| trigger.fired));
    let mut news = Vec::new();
    // a shot may have come and gone since the last look
    for shot in shots + 1..=now.fired {
        news.push((Tone::Good, format!("shot {shot} has fired")));
    }
    let known = before.map_or(0, |trigger| trigger.lost.len());
    news.extend(now.lost.iter().skip(known).map(|text| (Tone::Alarm, text.clone())));
    let again = if now.fired > 0 { " again" } else { "" };
    match (old, now.phase) {
        (Some(Phase::Settling { .. }), Phase::Settling { .. }) if now.fired == shots => {}
        (_, Phase::Settling { wanted_s, .. }) => {
            news.push((Tone::Plain, format!("not armed{again}: waiting for {wanted_s} s of quiet")));
        }
        (Some(Phase::Armed), Phase::Armed) if now.fired == shots => {}
        (_, Phase::Armed) => news.push((Tone::Good, format!("armed{again}: fires when {}", now.condition))),
        (old, Phase::Over) if old != Some(Phase::Over) => news.push((Tone::Good, "all shots are recorded".to_owned())),
        _ => {}
    }
    news
}

/// The line of every second.
pub(crate) fn progress(now: &Snapshot) -> String {
    let Snapshot { samples, gaps, samples_per_s, .. } = now;
    let recorded_s = now.recorded_s.unwrap_or(0.0);
    let trigger = match &now.trigger {
        None => String::new(),
        Some(trigger) => match trigger.phase {
            Phase::Settling { quiet_s, wanted_s } => format!("  not armed: quiet for {quiet_s:.1} of {wanted_s} s"),
            Phase::Armed => "  armed".to_owned(),
            Phase::Fired { .. } => format!("  shot {}", trigger.fired),
            Phase::Over => "  all shots are recorded".to_owned(),
        },
    };
    format!("{recorded_s:.1} s  {samples} samples  {gaps} gaps  {samples_per_s:.0} samples/s{trigger}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::console::live::view::fixtures::{armed, faulty, healthy};

    fn texts(before: Option<&Snapshot>, now: &Snapshot) -> Vec<String> {
        changes(before, now, true).into_iter().map(|(_, text)| text).collect()
    }

    #[test]
    fn what_is_wrong_is_said_once_and_so_is_that_it_is_over() {
        assert_eq!(texts(None, &healthy()), [""; 0]);
        let said = texts(Some(&healthy()), &faulty());
        assert_eq!(said.len(), 4, "{said:#?}");
        assert!(said[0].starts_with("12.4 s  logger: the port vanished: plug /dev/ttyUSB1 in again"), "{said:#?}");
        assert!(said[1].contains("P1 saturated: at the upper end of its range, 998.9 kPa"));
        assert!(said[2].contains("P2 noisy: standard deviation 14.2 kPa, where its accuracy allows 5.5"));
        assert!(said[3].contains("full in 8 min, 400 MB left: free some space"), "{said:#?}");
        assert_eq!(texts(Some(&faulty()), &faulty()), [""; 0]);
        let over = texts(Some(&faulty()), &healthy());
        assert_eq!(
            over,
            ["12.4 s  logger sends", "12.4 s  P1 is no longer saturated", "12.4 s  P2 is no longer noisy"]
        );
    }

    #[test]
    fn the_trigger_says_each_step_and_no_shot_is_left_out() {
        let settling = Phase::Settling { quiet_s: 0.5, wanted_s: 2.0 };
        let fired = Phase::Fired { since_s: 1.0, lasts_s: 20.0 };
        let steps =
            [armed(settling, 0), armed(Phase::Armed, 0), armed(fired, 1), armed(settling, 1), armed(Phase::Armed, 1)];
        let mut said = texts(None, &steps[0]);
        steps.windows(2).for_each(|pair| said.extend(texts(Some(&pair[0]), &pair[1])));
        let expected = [
            "not armed: waiting for 2 s of quiet",
            "armed: fires when P1 reaches 500 kPa",
            "shot 1 has fired",
            "not armed again: waiting for 2 s of quiet",
            "armed again: fires when P1 reaches 500 kPa",
        ];
        assert_eq!(said, expected.map(|text| format!("12.4 s  {text}")));
        let missed = texts(Some(&armed(Phase::Armed, 1)), &armed(Phase::Over, 3));
        assert_eq!(
            missed,
            ["shot 2 has fired", "shot 3 has fired", "all shots are recorded"].map(|t| format!("12.4 s  {t}"))
        );
        let mut lost = armed(fired, 2);
        lost.trigger.as_mut().unwrap().lost.push("shot 2 is lost".to_owned());
        assert_eq!(texts(Some(&armed(fired, 2)), &lost), ["12.4 s  shot 2 is lost"]);
        assert_eq!(texts(Some(&lost), &lost), [""; 0]);
        let waiting = progress(&armed(settling, 0));
        assert!(waiting.ends_with("60000 samples/s  not armed: quiet for 0.5 of 2 s"), "{waiting}");
        assert_eq!(progress(&armed(fired, 2)), "12.4 s  744000 samples  3 gaps  60000 samples/s  shot 2");
    }
}
