//! The block of lines of a snapshot: no line wider than the terminal, no more lines than it has.

#[cfg(test)]
pub(crate) mod fixtures;

use console::{measure_text_width, truncate_str};

use crate::cli::console::live::changes::{SHORT_OF_ROOM_S, room};
use crate::cli::console::live::numbers::{bytes, count, lasting, rate, value};
use crate::cli::console::live::sparkline::sparkline;
use crate::cli::console::live::table;
use crate::cli::console::live::table::Column;
use crate::cli::console::live::tone::Tone;
use crate::record::health::alert::SensorFault;
use crate::record::health::sensor_health::BIN_NS;
use crate::record::health::snapshot::{DeviceView, Disk, Phase, SensorView, Snapshot, TriggerView};

/// A name takes no more than this.
const LONGEST_NAME: usize = 14;
/// Cells of the line of the last seconds, where there is room.
const LEAST_CELLS: usize = 10;
const MOST_CELLS: usize = 50;

/// Size of a terminal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Size {
    pub(crate) columns: usize,
    pub(crate) rows: usize,
}

/// A line to draw.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Line {
    pub(crate) tone: Tone,
    pub(crate) text: String,
}

/// Draws a snapshot.
pub(crate) fn view(snapshot: &Snapshot, size: Size) -> Vec<Line> {
    // the last column stays free: a terminal may wrap where it is written to
    let columns = size.columns.saturating_sub(1).max(1);
    // and so does the line of the cursor
    let rows = size.rows.saturating_sub(1).max(1);
    let mut lines = head(snapshot, columns);
    lines.extend(devices(&snapshot.devices, columns));
    lines.extend(sensors(snapshot, columns, rows.saturating_sub(lines.len())));
    lines.truncate(rows);
    for line in &mut lines {
        line.text = truncate_str(&line.text, columns, "…").into_owned();
    }
    lines
}

fn head(snapshot: &Snapshot, columns: usize) -> Vec<Line> {
    let mut pieces = match snapshot.recorded_s {
        None => vec!["waiting for the first sample".to_owned()],
        Some(recorded_s) => {
            let gaps = if snapshot.gaps == 1 { "gap" } else { "gaps" };
            vec![
                format!("{recorded_s:.1} s"),
                format!("{} samples/s", rate(snapshot.samples_per_s)),
                format!("{} {gaps}", snapshot.gaps),
            ]
        }
    };
    let short = snapshot.disk.filter(|disk| disk.lasts_s() < SHORT_OF_ROOM_S);
    if let (Some(disk), None) = (&snapshot.disk, &short) {
        pieces.push(left(disk));
    }
    pieces.push("Ctrl-C ends".to_owned());
    let mut lines = flowed(&pieces, columns, Tone::Plain);
    if let Some(disk) = &short {
        lines.extend(called_out(&room(disk), columns));
    }
    if let Some(trigger) = &snapshot.trigger {
        lines.extend(trigger_lines(trigger, &snapshot.sensors, columns));
    }
    lines
}

fn left(disk: &Disk) -> String {
    let free = bytes(disk.free_bytes);
    if disk.bytes_per_s > 0.0 {
        format!("disk {free}, lasts {}", lasting(disk.lasts_s()))
    } else {
        format!("disk {free}")
    }
}

fn trigger_lines(trigger: &TriggerView, sensors: &[SensorView], columns: usize) -> Vec<Line> {
    let again = if trigger.fired > 0 { " AGAIN" } else { "" };
    let (tone, state) = match trigger.phase {
        Phase::Settling { quiet_s, wanted_s } => {
            (Tone::Plain, format!("NOT ARMED{again}: quiet for {quiet_s:.1} of {wanted_s} s"))
        }
        Phase::Armed => match sensors.iter().find(|sensor| sensor.fault.is_some()) {
            None => (Tone::Good, format!("ARMED{again}: close the valve")),
            Some(sensor) => (Tone::Alarm, format!("ARMED{again}, but look at {} first", sensor.name)),
        },
        Phase::Fired { since_s, lasts_s } => {
            (Tone::Good, format!("SHOT {}: {since_s:.1} of {lasts_s} s", trigger.fired))
        }
        Phase::Over => (Tone::Good, "ALL SHOTS ARE RECORDED".to_owned()),
    };
    let shots = match trigger.most {
        Some(most) => format!("{} of {most} shots", trigger.fired),
        None => format!("shots so far: {}", trigger.fired),
    };
    flowed(&[state, format!("fires when {}", trigger.condition), shots], columns, tone)
}

fn devices(devices: &[DeviceView], columns: usize) -> Vec<Line> {
    if devices.is_empty() {
        return Vec::new();
    }
    type Cell = fn(&DeviceView) -> String;
    // what is shown of each, and the order in which it gives way
    let shown: [(&str, u8, Cell); 6] = [
        ("samples/s", 4, |device| rate(device.samples_per_s)),
        ("frames", 3, |device| count(device.count.frames)),
        ("bad", 6, |device| count(device.count.bad_frames)),
        ("lost", 5, |device| count(device.count.lost_frames)),
        ("queue", 2, |device| format!("{:.0}%", 100.0 * device.queue)),
        ("waits", 1, |device| count(device.count.queue_waits)),
    ];
    let name = |device: &DeviceView| truncate_str(&device.count.name, LONGEST_NAME, "…").into_owned();
    let mut all = vec![Column::new("device", false, 0, devices.iter().map(name))];
    all.extend(shown.map(|(heading, way, cell)| Column::new(heading, true, way, devices.iter().map(cell))));
    let mut texts = table::lines(&table::fitted(all, columns), columns).into_iter();
    let mut lines: Vec<Line> = texts.next().map(|text| Line { tone: Tone::Heading, text }).into_iter().collect();
    for (text, device) in texts.zip(devices) {
        let tone = if device.trouble.is_some() { Tone::Alarm } else { Tone::Plain };
        lines.push(Line { tone, text });
        lines.extend(device.trouble.iter().flat_map(|trouble| called_out(trouble, columns)));
    }
    lines
}

/// The sensors in `rows` lines: those that something is wrong with come before the others where not all have room.
fn sensors(snapshot: &Snapshot, columns: usize, rows: usize) -> Vec<Line> {
    let sensors = &snapshot.sensors;
    let mut texts = sensor_rows(snapshot, columns).into_iter();
    let Some(heading) = texts.next().filter(|_| !sensors.is_empty()) else { return Vec::new() };
    let mut blocks: Vec<Vec<Line>> =
        texts.zip(sensors).map(|(text, sensor)| block(text, sensor, snapshot, columns)).collect();
    let mut room = rows.saturating_sub(1);
    let all_fit = blocks.iter().map(Vec::len).sum::<usize>() <= room;
    if !all_fit {
        room = room.saturating_sub(1);
    }
    let mut kept = vec![false; blocks.len()];
    // those that something is wrong with come first, if need be without the advice; the others may have what is left
    for (ill, whole) in [(true, true), (true, false), (false, true)] {
        for (i, block) in blocks.iter_mut().enumerate() {
            if kept[i] || sensors[i].fault.is_some() != ill || room == 0 {
                continue;
            }
            if !whole {
                block.truncate(1);
            }
            if block.len() <= room {
                room -= block.len();
                kept[i] = true;
            }
        }
    }
    let ill_left_out = (0..blocks.len()).filter(|&i| !kept[i] && sensors[i].fault.is_some()).count();
    let left_out = kept.iter().filter(|kept| !**kept).count();
    let mut lines = vec![Line { tone: Tone::Heading, text: heading }];
    lines.extend(blocks.into_iter().zip(&kept).filter(|(_, kept)| **kept).flat_map(|(block, _)| block));
    if left_out > 0 {
        let (tone, what) = match ill_left_out {
            0 => (Tone::Plain, "all fine".to_owned()),
            n => (Tone::Alarm, format!("{n} of them with alerts")),
        };
        lines.push(Line { tone, text: format!("… {left_out} more sensors, {what}") });
    }
    lines
}

/// A heading and a line for each sensor; the last seconds take what room the other columns leave.
fn sensor_rows(snapshot: &Snapshot, columns: usize) -> Vec<String> {
    let sensors = &snapshot.sensors;
    let name = |sensor: &SensorView| truncate_str(&sensor.name, LONGEST_NAME, "…").into_owned();
    let level = |sensor: &SensorView| match sensor.level {
        None => "-".to_owned(),
        Some(level) if sensor.unit == "1" => value(level, sensor.accuracy),
        Some(level) => format!("{} {}", value(level, sensor.accuracy), sensor.unit),
    };
    let hertz = |sensor: &SensorView| sensor.rate_hz.map_or("-".to_owned(), rate);
    let gaps_give_way = if sensors.iter().all(|sensor| sensor.gaps == 0) { 1 } else { 3 };
    let fixed = vec![
        Column::new("sensor", false, 0, sensors.iter().map(name)),
        Column::new("level", true, 0, sensors.iter().map(level)),
        Column::new("Hz", true, 2, sensors.iter().map(hertz)),
        Column::new("gaps", true, gaps_give_way, sensors.iter().map(|sensor| count(sensor.gaps))),
    ];
    // better no rate than no picture
    let mut all = table::fitted(fixed, columns.saturating_sub(LEAST_CELLS + 2));
    let cells = columns.saturating_sub(table::width(&all) + 2).min(MOST_CELLS);
    if cells >= LEAST_CELLS {
        let newest = (snapshot.recorded_s.unwrap_or(0.0) * 1e9) as i64 / BIN_NS;
        // ± its accuracy
        let line = |sensor: &SensorView| sparkline(&sensor.trace, newest, cells, 2.0 * sensor.accuracy);
        all.push(Column::new("last 10 s", false, 1, sensors.iter().map(line)));
    }
    table::lines(&all, columns)
}

fn block(text: String, sensor: &SensorView, snapshot: &Snapshot, columns: usize) -> Vec<Line> {
    let Some(fault) = sensor.fault else { return vec![Line { tone: Tone::Plain, text }] };
    let mut lines = vec![Line { tone: Tone::Alarm, text }];
    let of_device = sensor.device.and_then(|i| snapshot.devices.get(i)).is_some_and(|device| device.trouble.is_some());
    if fault != SensorFault::Silent || !of_device {
        lines.extend(called_out(&format!("{}; {}", fault.seen(sensor.unit), fault.advice()), columns));
    }
    lines
}

fn called_out(text: &str, columns: usize) -> Vec<Line> {
    let lines = wrapped(&format!("! {text}"), columns.saturating_sub(2), 2).into_iter();
    lines.map(|text| Line { tone: Tone::Alarm, text: format!("  {text}") }).collect()
}

/// Pieces beside each other, as many on a line as fit.
fn flowed(pieces: &[String], columns: usize, tone: Tone) -> Vec<Line> {
    let mut lines: Vec<String> = Vec::new();
    for piece in pieces {
        match lines.last_mut() {
            Some(line) if measure_text_width(line) + 3 + measure_text_width(piece) <= columns => {
                line.push_str("   ");
                line.push_str(piece);
            }
            _ => lines.push(piece.clone()),
        }
    }
    lines.into_iter().map(|text| Line { tone, text }).collect()
}

/// Words on lines of so many columns, all but the first indented.
pub(crate) fn wrapped(text: &str, columns: usize, indent: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split(' ') {
        match lines.last_mut() {
            Some(line) if measure_text_width(line) + 1 + measure_text_width(word) <= columns => {
                line.push(' ');
                line.push_str(word);
            }
            None => lines.push(word.to_owned()),
            Some(_) => lines.push(format!("{:indent$}{word}", "")),
        }
    }
    lines
}

#[cfg(test)]
mod tests;
