//! Read as written, or not at all: what a heading, a column of units or a column of channels says, and what nothing
//! says.

use std::path::Path;

use serde_json::Value;
use surgescope::storage::import::{SourceFile, SourceOptions, decode_source};
use tempfile::TempDir;

use super::{Bench, mended};
use crate::common::{ended, surgescope};

/// Rows of most tables, 1 kHz.
pub(super) const ROWS: usize = 60;

/// Pressures at the valve and in the middle, bar.
pub(super) fn bar(i: usize) -> [f64; 2] {
    [2.8 + 0.25 * (0.3 * i as f64).sin(), 2.9 + 0.25 * (0.3 * i as f64).cos()]
}

pub(super) fn table(head: &str, row: impl Fn(usize, f64, f64) -> String) -> String {
    let rows = (0..ROWS).map(|i| row(i, bar(i)[0], bar(i)[1]) + "\n");
    head.to_owned() + &rows.collect::<String>()
}

pub(super) fn read_as(text: &str, options: &SourceOptions) -> Result<SourceFile, String> {
    decode_source(text.as_bytes(), Path::new("table.csv"), options).map_err(|e| e.to_string())
}

pub(super) fn read(text: &str) -> Result<SourceFile, String> {
    read_as(text, &SourceOptions { guess: true, ..SourceOptions::default() })
}

/// The two pressures of [`bar`], each in its unit.
pub(super) fn holds(name: &str, file: &SourceFile, units: [(&str, f64); 2]) {
    assert_eq!(file.tracks.len(), 2, "{name}: {:?}", file.tracks.iter().map(|t| &t.name).collect::<Vec<_>>());
    for (which, (track, (unit, per_bar))) in file.tracks.iter().zip(units).enumerate() {
        assert_eq!((track.unit.as_deref(), track.series.value.len()), (Some(unit), ROWS), "{name}: {}", track.name);
        for (i, (t, v)) in track.series.time_s.iter().zip(&track.series.value).enumerate() {
            let p = bar(i)[which] * per_bar;
            assert!(
                (t - 1e-3 * i as f64).abs() < 1e-9 && (v - p).abs() < 1e-3 * per_bar,
                "{name}: {v} at {t} s, not {p}"
            );
        }
    }
}

/// Runs the program in a folder; code, document and messages.
pub(super) fn run(folder: &TempDir, args: &[&str]) -> (i32, Value, String) {
    let (code, out, err) = ended(surgescope(args).current_dir(folder.path()).output().unwrap());
    assert!(!err.contains("panicked"), "{err}");
    (code, serde_json::from_str(&out).unwrap_or(Value::Null), err)
}

pub(super) fn folder(files: &[(&str, &str)]) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    files.iter().for_each(|(name, text)| std::fs::write(folder.path().join(name), text).unwrap());
    folder
}

pub(super) const PIPE: [&str; 10] =
    ["--material", "copper", "--length-m", "100", "--pipe", "22x1.5", "--temperature-degC", "18", "--yes", "--json"];

/// The shipped logger's record of 4 s: time_s, and pressures at the valve and in the middle in bar, which closes after
/// one second.
pub(super) fn closure() -> Vec<[f64; 3]> {
    let text = std::fs::read_to_string(crate::common::here("recordings/logger.csv")).unwrap();
    let number = |cell: &str| cell.trim().parse::<f64>().ok();
    let rows = text.lines().filter_map(|line| {
        let cells: Vec<&str> = line.split(';').collect();
        let [t, a, b] = [number(cells.get(1)?)?, number(cells.get(2)?)?, number(cells.get(3)?)?];
        Some([1e-3 * t, a, b])
    });
    rows.collect()
}

/// A factor in a heading says that numbers are larger or smaller, and not which: they are refused until somebody says
/// it.
#[test]
fn a_factor_in_a_heading_is_no_unit() {
    for heading in ["P1 x10 (bar)", "P1 [x10] (bar)", "P1/100", "0.1*P1 (bar)", "P1 (bar/10)", "P1 x 10 bar"] {
        let name = "P1";
        let bench = Bench::new(&[(name, "pressure", "bar", "")]);
        bench.put("t.csv", table(&format!("Time (ms),{heading}\n"), |i, p, _| format!("{i},{:.4}", 10.0 * p)));
        bench.refuses(&["t.csv", "--yes"], &["is in", "no known pressure unit", "--scale 'P1=FACTOR*x bar'"]);
        bench.import(0, &["t.csv", "--yes", "--scale", "P1=0.1*x bar"]);
        let value = &bench.recording().series[0].value;
        assert!((value[7] - bar(7)[0]).abs() < 1e-4, "{heading}: {} bar", value[7]);
    }
    for heading in ["t*2000", "Time x10 (ms)", "Time (0.5 ms)", "t/2"] {
        let text = table(&format!("{heading},P1 (bar)\n"), |i, p, _| format!("{},{p:.4}", 2 * i));
        let why = read(&text).unwrap_err();
        assert!(why.contains(heading) && why.contains("factor") && why.contains("option `rate`"), "{heading}: {why}");
        let millis = SourceOptions { guess: true, time_unit_s: Some(1e-3), ..SourceOptions::default() };
        assert!(read_as(&text, &millis).is_err(), "{heading}: a unit does not undo it");
        let counted = SourceOptions { guess: true, rate_hz: Some(1000.0), ..SourceOptions::default() };
        let times = &read_as(&text, &counted).unwrap().tracks[0].series.time_s;
        assert!((times[59] - 0.059).abs() < 1e-9, "{heading}: {}", times[59]);
    }
}

/// Each row of one channel: time by time, in blocks of a time, with units in a column or in the names, or with numbers
/// as names.
#[test]
fn a_table_in_long_form_is_read_by_its_channels() {
    let bars = [("bar", 1.0), ("bar", 1.0)];
    let ms = |i: usize| format!("{:.3}", 1e-3 * i as f64);
    for (name, text, units) in [
        (
            "unit of the values",
            table("time_s,channel,pressure (bar)\n", |i, a, b| {
                format!("{},Valve,{a:.4}\n{},Middle,{b:.4}", ms(i), ms(i))
            }),
            bars,
        ),
        (
            "units of the names",
            table("time_s,channel,value\n", |i, a, b| {
                format!("{},Valve (bar),{a:.4}\n{},Middle (mbar),{:.1}", ms(i), ms(i), 1e3 * b)
            }),
            [("bar", 1.0), ("mbar", 1e3)],
        ),
        (
            "a column of units",
            table("time_s,channel,value,unit\n", |i, a, b| {
                format!("{},Valve,{a:.4},bar\n{},Middle,{:.1},mbar", ms(i), ms(i), 1e3 * b)
            }),
            [("bar", 1.0), ("mbar", 1e3)],
        ),
        ("numbers", table("Time (s);Ch;P (bar)\n", |i, a, b| format!("{};1;{a:.4}\n{};2;{b:.4}", ms(i), ms(i))), bars),
    ] {
        let file = read(&text).unwrap_or_else(|why| panic!("{name}: {why}"));
        holds(name, &file, units);
        let names: Vec<&str> = file.tracks.iter().map(|t| t.short.as_str()).collect();
        let expected = if name == "numbers" { ["Ch 1", "Ch 2"] } else { ["Valve", "Middle"] };
        assert_eq!(names, expected, "{name}");
        assert!(
            file.repairs.iter().any(|r| r.what == "long-form" && r.text.contains(expected[0])),
            "{:?}",
            file.repairs
        );
    }
    // a temperature now and then is no second reading of the pressure
    let seldom = table("time_s,channel,value\n", |i, a, _| {
        let warm = if i % 10 == 0 { format!("\n{},Temp (degC),18.5", ms(i)) } else { String::new() };
        format!("{},P1 (bar),{a:.4}{warm}", ms(i))
    });
    let file = read(&seldom).unwrap();
    let [pressure, warm] = &file.tracks[..] else { panic!("{:?}", file.tracks) };
    assert!((pressure.series.value[10] - bar(10)[0]).abs() < 1e-3 && pressure.series.value.len() == ROWS);
    assert_eq!((warm.series.value.len(), warm.unit.as_deref()), (6, Some("degC")));
    // remarks and states are no channels
    let states = table("time_s,P1 (bar),state\n", |i, a, _| {
        format!("{},{a:.4},{}", ms(i), if i < 30 { "open" } else { "shut" })
    });
    assert_eq!(read(&states).unwrap().tracks.len(), 1);
}

/// Times that stand in the file are not passed over by a rate that contradicts them.
#[test]
fn a_rate_beside_times_is_refused_unless_they_repeat() {
    let rate = |hz: f64| SourceOptions { guess: true, rate_hz: Some(hz), ..SourceOptions::default() };
    let text = table("Time (ms),P1 (bar)\n", |i, p, _| format!("{i},{p:.4}"));
    let why = read_as(&text, &rate(2000.0)).unwrap_err();
    assert!(why.contains("'Time (ms)' holds times, 0.001") && why.contains("option `ignore 'Time (ms)'`"), "{why}");
    assert_eq!(read_as(&text, &rate(1000.0)).unwrap().tracks[0].series.time_s[59], 0.059);
    let ignored = SourceOptions { ignore: vec!["Time (ms)".into()], ..rate(2000.0) };
    assert!((read_as(&text, &ignored).unwrap().tracks[0].series.time_s[59] - 59.0 / 2000.0).abs() < 1e-9);
    let stamps = table("Time,P1 (bar)\n", |i, p, _| format!("09:26:53.{i:03},{p:.4}"));
    assert!(read_as(&stamps, &rate(2000.0)).unwrap_err().contains("option `rate 2000`"));
    let coarse = table("Time (s),P1 (bar)\n", |i, p, _| format!("{},{p:.4}", i / 20));
    assert!((read_as(&coarse, &rate(20.0)).unwrap().tracks[0].series.time_s[59] - 59.0 / 20.0).abs() < 1e-9);
}

#[test]
fn units_in_columns_stand_on_either_side_of_their_values() {
    let ms = |i: usize| format!("{:.3}", 1e-3 * i as f64);
    for (name, head, row) in [
        ("right", "Time (s);Valve;Unit;Middle;Unit\n", 0),
        ("left", "Time (s);Unit;Valve;Unit;Middle\n", 1),
        ("left, after a counter", "Time (s);No;Unit;Valve;Unit;Middle\n", 2),
    ] {
        let text = table(head, |i, a, b| {
            let b = 1e3 * b;
            match row {
                0 => format!("{};{a:.4};bar;{b:.1};mbar", ms(i)),
                1 => format!("{};bar;{a:.4};mbar;{b:.1}", ms(i)),
                _ => format!("{};{i};bar;{a:.4};mbar;{b:.1}", ms(i)),
            }
        });
        holds(name, &read(&text).unwrap_or_else(|why| panic!("{name}: {why}")), [("bar", 1.0), ("mbar", 1e3)]);
    }
}

/// Lines about the sensors stand between the names and the rows.
#[test]
fn names_are_those_of_the_line_that_names_the_times() {
    for head in [
        "Time;Valve;Middle\ns;bar;bar\nSensor;PT1;PT2\nSerial;12345;12346\nRange;0-16;0-16\nCal date;2025-01-01;2025-01-01\n",
        "Time;Valve;Middle\nSensor;PT1;PT2\nOffset;0.012;0.02\nRange;16;16\ns;bar;bar\n",
    ] {
        let file = read(&table(head, |i, a, b| format!("{:.3};{a:.4};{b:.4}", 1e-3 * i as f64))).unwrap();
        holds(head, &file, [("bar", 1.0), ("bar", 1.0)]);
        assert_eq!((file.tracks[0].short.as_str(), file.tracks[1].short.as_str()), ("Valve", "Middle"));
    }
}

#[test]
fn a_column_goes_by_heading_name_and_place() {
    for name in ["Druck 1 (bar)", "Druck 1", "column 2"] {
        let bench = Bench::new(&[("P1", "pressure", "bar", "")]);
        bench.put("t.csv", table("Time (ms),Druck 1 (bar)\n", |i, p, _| format!("{i},{p:.4}")));
        bench.import(0, &["t.csv", "--map", &format!("{name}=P1"), "--scale", &format!("{name}=2*x bar")]);
        assert!((bench.recording().series[0].value[7] - 2.0 * bar(7)[0]).abs() < 1e-3, "{name}");
        let folder = folder(&[("t.csv", &table("Time (ms),Druck 1 (bar)\n", |i, p, _| format!("{i},{p:.4}")))]);
        let place = format!("{name}=40");
        let (code, document, said) = run(&folder, &[&["rig", "new", "t.csv", "--sensor", &place], &PIPE[..]].concat());
        assert_eq!((code, document["sensors"][0]["position_m"].as_f64()), (0, Some(40.0)), "{name}: {said}");
    }
}

/// A refusal names the file's own columns, and options that work as they stand.
#[test]
fn refusals_lead_on_with_the_columns_own_names() {
    let bench = Bench::new(&[("P1", "pressure", "bar", ""), ("Q1", "flow", "L/s", "position_m = 0.0")]);
    bench.put(
        "other.csv",
        table("Time (ms),Druck 1 (bar),Druck 2 (bar),Q1 (L/s)\n", |i, a, b| format!("{i},{a:.4},{b:.4},0.2")),
    );
    bench.refuses(&["other.csv", "--yes"], &["the columns are Druck 1 (bar), Druck 2 (bar), Q1 (L/s)"]);
    let volts = Bench::new(&[("P1", "pressure", "bar", "")]);
    volts.put("volts.csv", table("Time (ms),P1 (V)\n", |i, p, _| format!("{i},{:.4}", 0.5 * p)));
    volts.refuses(&["volts.csv", "--yes"], &["is in 'V'", "--scale 'P1=1..5 -> 0..10 bar'"]);
    volts.import(0, &["volts.csv", "--yes", "--scale", "P1=1..5 -> 0..10 bar"]);
    // (0.5 * 2.8 - 1) * 2.5 = 1
    assert!((volts.recording().series[0].value[0] - 1.0).abs() < 1e-3);
    let folder = folder(&[("t.csv", &table("Time (ms),Valve (furlong)\n", |i, p, _| format!("{i},{p:.4}")))]);
    let (code, _, said) = run(&folder, &[&["rig", "new", "t.csv"], &PIPE[..]].concat());
    assert!(code == 2 && said.contains("--scale 'Valve (furlong)=FACTOR*x bar'"), "{said}");
    let scaled = ["rig", "new", "t.csv", "--scale", "Valve (furlong)=0.01*x bar"];
    assert_eq!(run(&folder, &[&scaled, &PIPE[..]].concat()).0, 0);
}

/// The pressure of the air and differences of two pressures are none at a place of the pipe.
#[test]
fn a_barometer_is_no_sensor_of_the_pipe() {
    let rows = |other: &str, value: &str| {
        let rows = closure().into_iter().map(|[t, a, b]| format!("{t:.3},{a:.4},{b:.4},{value}\n"));
        format!("Time (s),Valve (bar),Middle (bar),{other}\n{}", rows.collect::<String>())
    };
    for heading in ["Barometric pressure (mbar)", "dP orifice (mbar)", "ΔP (mbar)", "P_atm (mbar)"] {
        let folder = folder(&[("t.csv", &rows(heading, "1013.2"))]);
        let (code, document, said) = run(&folder, &[&["rig", "new", "t.csv"], &PIPE[..]].concat());
        assert_eq!((code, &document["left_out"][0]), (0, &Value::from(heading)), "{said}");
        let (code, _, said) = run(&folder, &["import", "t.csv", "--rig", "rig.toml", "--yes", "-o", "run.mcap"]);
        assert!(code == 3 && said.contains("left out"), "{code}: {said}");
    }
    // by its values alone it is asked for
    let air = rows("P3 (mbar)", "1013.2").replacen("1013.2", "1013.1", 1000);
    let folder = folder(&[("t.csv", &air)]);
    let new = [&["rig", "new", "t.csv"], &PIPE[..]].concat();
    let (code, _, said) = run(&folder, &new);
    assert!(code == 2 && said.contains("pressure of the air") && said.contains("--ignore 'P3'"), "{said}");
    assert_eq!(run(&folder, &[&new[..], &["--ignore", "P3"]].concat()).0, 0);
}

/// The later half of a run shows no closure: nothing in it says where the sensors stand, and both halves together do.
#[test]
fn parts_of_a_run_make_a_rig_together_in_any_order_of_their_names() {
    let rows = closure();
    let half = |rows: &[[f64; 3]]| {
        let stamp = |[t, a, b]: &[f64; 3]| format!("2026-03-14 09:26:{:06.3},{a:.4},{b:.4}\n", 53.0 + t);
        format!("Time,Valve (bar),Middle (bar)\n{}", rows.iter().map(stamp).collect::<String>())
    };
    let middle = rows.len() / 2;
    // the last row of one file stands again at the beginning of the other
    let folder = folder(&[("a.csv", &half(&rows[middle - 1..])), ("b.csv", &half(&rows[..middle]))]);
    let (code, _, said) = run(&folder, &[&["rig", "new", "a.csv"], &PIPE[..]].concat());
    assert!(
        code == 2 && said.contains("no front can be seen") && said.contains("Name the file with the closure"),
        "{said}"
    );
    let (code, document, said) = run(&folder, &[&["rig", "new", "a.csv", "b.csv"], &PIPE[..]].concat());
    assert_eq!(code, 0, "{said}");
    let [valve, mid] = [0, 1].map(|i| document["sensors"][i]["position_m"].as_f64().unwrap());
    assert!(valve == 100.0 && (mid - 62.0).abs() < 3.0, "{valve} m, {mid} m");
    let import = ["import", "a.csv", "b.csv", "--rig", "rig.toml", "--yes", "--json", "-o", "run.mcap"];
    let (code, document, said) = run(&folder, &import);
    assert_eq!(code, 0, "{said}");
    assert!(document["left_out"].to_string().contains("begins with the last 1 sample of 'Valve'"), "{document}");
    let recording = surgescope::storage::read(&folder.path().join("run.mcap")).unwrap();
    let [valve, _] = &recording.series[..] else { panic!() };
    assert_eq!(valve.value.len(), rows.len(), "no row twice, none lost");
    assert!(valve.value.iter().zip(&rows).all(|(v, [_, a, _])| (v - a).abs() < 1e-4) && valve.gaps.is_empty());
    let (code, document, _) = run(&folder, &["inspect", "run.mcap", "--json"]);
    let speed = document["wave_speed_m_s"]["crossings"]["value"].as_f64().unwrap();
    assert!(code == 0 && (speed - 1331.3).abs() < 5.0, "{speed} m/s");
    // the half without a closure says so
    let (_, document, _) =
        run(&folder, &["import", "a.csv", "--rig", "rig.toml", "--yes", "--json", "-o", "half.mcap"]);
    assert!(document["doubts"].to_string().contains("no closure"), "{document}");
    assert_eq!(mended(&document, "name")["guessed"], Value::Bool(false));
}
