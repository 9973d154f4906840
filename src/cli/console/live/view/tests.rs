use crate::cli::console::live::view::fixtures::{armed, faulty, healthy, sensor};
use crate::cli::console::live::view::*;

fn drawn(snapshot: &Snapshot, columns: usize, rows: usize) -> String {
    let lines = view(snapshot, Size { columns, rows });
    assert!(lines.len() < rows, "{} lines on {rows} rows", lines.len());
    for line in &lines {
        assert!(measure_text_width(&line.text) < columns, "{} columns: {line:?}", columns);
    }
    lines.iter().map(|line| format!("{}\n", line.text)).collect()
}

#[test]
fn everything_has_room_on_80_columns() {
    let expected = "\
12.4 s   60.0k samples/s   3 gaps   disk 12.3 GB, lasts 3 h   Ctrl-C ends
device  samples/s  frames  bad  lost  queue  waits
daq         60.0k    1240    0     0     2%      0
logger      60.0k     124    0     0     2%      0
sensor       level     Hz  gaps  last 10 s
P1       245.3 kPa  20.0k     0  ▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁█▁▁▁▁▁▁▁▁▁▁▁▁▁
P2       251.0 kPa  20.0k     3  ▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁█▁▁▁▁▁▁▁▁▁▁▁▁▁
T1      22.20 degC     10     0  ▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄▄
";
    assert_eq!(drawn(&healthy(), 80, 24), expected);
}

#[test]
fn what_matters_most_is_left_on_40_columns() {
    let expected = "\
12.4 s   60.0k samples/s   3 gaps
Ctrl-C ends
  ! the disk is full in 8 min, 400 MB
    left: free some space, or end the
    recording before
device  samples/s  frames  bad  lost
daq         60.0k    1240   17     0
logger      60.0k     124    0     0
  ! the port vanished: plug
    /dev/ttyUSB1 in again, it is waited
    for 60 s
sensor       level  gaps  last 10 s
P1       245.3 kPa     0  ▁▁▁▁▁▁█▁▁▁▁▁
  ! saturated: at the upper end of its
    range, 998.9 kPa; check its wiring
    and supply, or use a larger range
    (or another 'scale'), before you
    close the valve
P2       251.0 kPa     3  ▁▁▁▁▁▁█▁▁▁▁▁
  ! noisy: standard deviation 14.2 kPa,
    where its accuracy allows 5.5; look
    for a loose plug, mains hum,
    trapped air or a pulsating pump
    before you close the valve
T1      22.20 degC     0  ▄▄▄▄▄
";
    assert_eq!(drawn(&faulty(), 40, 40), expected);
}

#[test]
fn the_trigger_says_what_it_waits_for() {
    let second_line = |phase, fired| drawn(&armed(phase, fired), 80, 24).lines().nth(1).unwrap().to_owned();
    let settling = Phase::Settling { quiet_s: 0.7, wanted_s: 2.0 };
    assert_eq!(
        second_line(settling, 0),
        "NOT ARMED: quiet for 0.7 of 2 s   fires when P1 reaches 500 kPa   0 of 3 shots"
    );
    assert_eq!(
        second_line(Phase::Armed, 1),
        "ARMED AGAIN: close the valve   fires when P1 reaches 500 kPa   1 of 3 shots"
    );
    let fired = Phase::Fired { since_s: 3.12, lasts_s: 20.0 };
    assert_eq!(second_line(fired, 2), "SHOT 2: 3.1 of 20 s   fires when P1 reaches 500 kPa   2 of 3 shots");
    let lines = view(&armed(Phase::Armed, 0), Size { columns: 80, rows: 24 });
    assert_eq!(lines[1].tone, Tone::Good);
    let mut noisy = armed(Phase::Armed, 0);
    noisy.sensors[1].fault = faulty().sensors[1].fault;
    let lines = view(&noisy, Size { columns: 80, rows: 24 });
    assert!(lines[1].text.starts_with("ARMED, but look at P2 first") && lines[1].tone == Tone::Alarm, "{lines:?}");
}

#[test]
fn more_sensors_than_rows_keep_those_that_something_is_wrong_with() {
    let mut snapshot = healthy();
    snapshot.devices.truncate(1);
    snapshot.sensors = (0..60).map(|i| sensor(&format!("P{i}"), "kPa", 250.0, 0)).collect();
    let fits = drawn(&snapshot, 80, 65);
    assert!(fits.contains("P59") && !fits.contains("more sensors"), "{fits}");
    snapshot.sensors[57].fault = Some(SensorFault::Flat { at: 250.0 });
    let text = drawn(&snapshot, 80, 12);
    assert!(text.contains("P57") && text.contains("! flat: constant at 250 kPa"), "{text}");
    assert!(text.contains("P0 ") && text.contains("more sensors, all fine"), "{text}");
    assert_eq!(text.lines().count(), 11);
    // where not even those have room, the view says so
    snapshot.sensors.iter_mut().for_each(|sensor| sensor.fault = Some(SensorFault::Flat { at: 250.0 }));
    let text = drawn(&snapshot, 80, 12);
    assert!(text.contains("… 58 more sensors, 58 of them with alerts"), "{text}");
}

#[test]
fn where_no_advice_has_room_the_called_out_sensors_stand_before_the_healthy_ones() {
    let mut snapshot = healthy();
    snapshot.devices.truncate(1);
    snapshot.sensors = (0..4).map(|i| sensor(&format!("P{i}"), "kPa", 250.0, 0)).collect();
    snapshot.sensors[1..].iter_mut().for_each(|sensor| sensor.fault = Some(SensorFault::Flat { at: 250.0 }));
    let text = drawn(&snapshot, 40, 10);
    assert!(["P1 ", "P2 ", "P3 "].iter().all(|name| text.contains(name)), "{text}");
    assert!(text.contains("… 1 more sensors, all fine") && !text.contains("P0"), "{text}");
}

#[test]
fn any_size_is_drawn_within_its_bounds() {
    for snapshot in [healthy(), faulty(), armed(Phase::Armed, 1), Snapshot::default()] {
        for columns in 1..120 {
            for rows in [1, 2, 3, 5, 8, 13, 24, 50] {
                let lines = view(&snapshot, Size { columns, rows });
                assert!(!lines.is_empty() && lines.len() < rows.max(2));
                let widest = lines.iter().map(|line| measure_text_width(&line.text)).max().unwrap();
                assert!(widest < columns.max(2), "{widest} of {columns}");
            }
        }
    }
    assert_eq!(drawn(&Snapshot::default(), 80, 24), "waiting for the first sample   Ctrl-C ends\n");
}
