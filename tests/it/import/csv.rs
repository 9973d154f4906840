//! Tables however they are written, and the report of what was mended.

use super::{Bench, mended};

#[test]
fn a_german_table_is_read_and_every_mending_is_said() {
    let bench = Bench::plain();
    let text = "\u{feff}# Messung 7\r\n# Betreiber: A\r\nZeitstempel;\"P1 (bar)\";P2 [kPa];\r\n\
        14.03.2026 09:26:53,500;1,5;1.200,25;\r\n14.03.2026 09:26:53,501;1,6;120,5;\r\n14.03.2026 09:26:53,501;1,6;120,5;\r\n\
        14.03.2026 09:26:53,503;;120,0;\r\n14.03.2026 09:26:53,502;1,7;120,0;\r\n14.03.2026 09:26:53,504;1,8;120,0;\r\n\
        14.03.2026 09:26:53,505;1,8;120,0;\r\n14.03.2026 09:26:53,506;1,8;120,0;\r\n14.03.2026 09:26:53,510;1,9;120,0;\r\n";
    bench.put("run.csv", text);
    let (document, err) = bench.import(0, &["run.csv", "--zone", "+01:00"]);
    for what in ["separator", "byte-order-mark", "decimal-comma", "thousands", "date-times", "order", "duplicate-times"]
    {
        assert_eq!(mended(&document, what)["file"], "run.csv");
    }
    assert_eq!(mended(&document, "duplicate-times")["line"], 6);
    assert_eq!(mended(&document, "order")["line"], 8);
    assert_eq!(mended(&document, "missing-times")["count"], 3);
    assert!(err.contains("run.csv:6: 1 line repeats a time"), "{err}");
    let recording = bench.recording();
    let [p1, p2] = &recording.series[..] else { panic!() };
    assert_eq!(p1.time_s, [0.0, 0.001, 0.002, 0.004, 0.005, 0.006, 0.01]);
    for (value, bar) in p1.value.iter().zip([1.5, 1.6, 1.7, 1.8, 1.8, 1.8, 1.9]) {
        assert!((value - 100.0 * bar).abs() < 1e-9, "{value} kPa are not {bar} bar");
    }
    assert!((p2.value[0] - 12.0025).abs() < 1e-12 && (p2.value[1] - 1.205).abs() < 1e-12);
    let gap = p2.gaps[0];
    assert_eq!((gap.from_s, gap.to_s, gap.samples), (0.006, 0.01, Some(3)));
    // 2026-03-14T08:26:53.5Z, by `date -u -d`
    assert_eq!(recording.run.start_unix_ns, 1_773_476_813_500_000_000);
    assert_eq!(recording.run.notes, [("comment".to_string(), "Messung 7\nBetreiber: A".to_string())]);
}

/// The heading's zone counts where the cells have none; an option counts before it.
#[test]
fn the_heading_of_the_times_may_state_their_zone() {
    let start_s = |heading: &str, options: &[&str]| {
        let bench = Bench::plain();
        let rows = "2026-03-14 09:26:53.000,1,2\n2026-03-14 09:26:53.100,1,2\n2026-03-14 09:26:53.200,1,2\n";
        bench.put("run.csv", format!("\"{heading}\",P1 (bar),P2 (bar)\n{rows}"));
        bench.import(0, &[&["run.csv"], options].concat());
        bench.recording().run.start_unix_ns / 1_000_000_000
    };
    let utc = start_s("Date Time", &[]);
    let east = [("Date Time, GMT+01:00", 3600), ("Date Time, GMT-0500 (logger 7)", -18000), ("time (UTC)", 0)];
    for (heading, zone_s) in east {
        assert_eq!(i128::from(utc) - i128::from(start_s(heading, &[])), zone_s, "{heading}");
    }
    assert_eq!(start_s("Date Time, GMT+01:00", &["--zone", "UTC"]), utc);
}

#[test]
fn date_times_of_many_programs_are_the_same_time() {
    let bench = Bench::plain();
    for (head, first, second, more) in [
        ("t", "2026-03-14T08:26:53.5Z", "2026-03-14T08:26:54Z", ""),
        ("Timestamp", "2026-03-14 09:26:53.500+01:00", "2026-03-14 09:26:54.000+01:00", ""),
        ("Date/Time", "2026/03/14 08:26:53.5", "2026/03/14 08:26:54.0", ""),
        ("t", "3/14/2026 8:26:53.5 AM", "3/14/2026 8:26:54 AM", ""),
        ("t", "14/03/2026 08:26:53.5", "14/03/2026 08:26:54", ""),
        ("t", "14.03.2026 08:26:53.5", "14.03.2026 08:26:54", ""),
        ("Date,Time", "14/03/2026,08:26:53.5", "14/03/2026,08:26:54", ""),
        ("t", "03/04/2026 08:26:53.5", "03/04/2026 08:26:54", "mdy"),
    ] {
        bench.put("run.csv", format!("{head},P1,P2\n{first},100,1\n{second},101,1\n"));
        let order = ["run.csv", "--date-order", more];
        bench.import(0, if more.is_empty() { &order[..1] } else { &order });
        let recording = bench.recording();
        // 4 March and 14 March 2026, 08:26:53.5 UTC, by `date -u -d`
        let start = if more.is_empty() { 1_773_476_813_500_000_000 } else { 1_772_612_813_500_000_000 };
        assert_eq!(recording.run.start_unix_ns, start, "{first}");
        assert_eq!(recording.series[0].time_s, [0.0, 0.5], "{first}");
    }
    bench.put("run.csv", "t,P1,P2\n03/04/2026 08:26:53.5,100,1\n03/04/2026 08:26:54,101,1\n");
    bench.refuses(&["run.csv"], &["run.csv:1", "may be two dates", "--date-order dmy"]);
    bench.put("run.csv", "t,P1,P2\n23:59:59.9,100,1\n00:00:00.1,101,1\n");
    let (document, _) = bench.import(0, &["run.csv"]);
    assert_eq!(mended(&document, "midnight")["count"], 1);
    assert_eq!(bench.recording().series[0].time_s, [0.0, 0.2]);
}

#[test]
fn tabs_units_of_time_a_row_of_units_and_other_encodings() {
    let bench = Bench::plain();
    bench.put("run.csv", "Time (ms)\tP1\tP2\n0\t100\t1\n12.5\t101\t1\n");
    bench.import(0, &["run.csv"]);
    assert_eq!(bench.recording().series[0].time_s, [0.0, 0.0125]);
    bench.put("run.csv", "X,P1,P2\nms,bar,bar\n0,1,1\n12.5,1.5,1\n");
    bench.import(0, &["run.csv"]);
    assert_eq!(bench.recording().series[0].time_s, [0.0, 0.0125]);
    assert!((bench.recording().series[0].value[1] - 150.0).abs() < 1e-9);
    bench.put("run.csv", "t,P1,P2\n0,100,1\n12.5,101,1\n");
    bench.refuses(&["run.csv"], &["run.csv:1", "give the unit of 't' with --time-unit"]);
    bench.import(0, &["run.csv", "--time-unit", "ms"]);
    assert_eq!(bench.recording().series[1].time_s, [0.0, 0.0125]);
    let utf16: Vec<u8> = "\u{feff}time_s,P1,P2\n0,1,2\n".encode_utf16().flat_map(u16::to_le_bytes).collect();
    bench.put("run.csv", utf16);
    let (document, _) = bench.import(0, &["run.csv"]);
    assert_eq!(mended(&document, "encoding")["count"], 1);
    bench.put("run.csv", b"# 20 \xb0C\ntime_s,P1,P2\n0,1,2\n");
    let (document, _) = bench.import(0, &["run.csv"]);
    assert_eq!(mended(&document, "encoding")["line"], 1);
}

#[test]
fn what_nobody_can_mend_is_refused_with_its_line() {
    let bench = Bench::plain();
    for (text, words) in [
        ("time_s;P1;P2\n0;1,5;2\n1;1.5;2\n", ["run.csv:3", "column 'P1': '1.5' has another decimal mark"]),
        ("time_s;P1;P2\n0;1,5;2\n1;x;2\n", ["run.csv:3", "column 'P1': 'x' is not a number"]),
        ("time_s;P1;P2\n0;1;2\n1;2\n2;1;2\n", ["run.csv:3", "2 cells where the header has 3"]),
        ("time_s,P1,P2\n0,1,2\n1,1,5,\n2,1,2\n", ["run.csv:3", "4 cells where the header has 3"]),
        ("time_s;P1 (V);P2\n0;1;2\n", ["is in 'V', which is no known pressure unit", "known are Pa, kPa"]),
        ("time_s;P1;P2;Q\n0;1;2;3\n", ["column 'Q' is no sensor of rig 'bench'", "Rename or remove"]),
        ("time_s;P1\n0;1\n", ["no column for the pressure sensor 'P2'", "--without P2"]),
        ("time_s;P1;P1 (bar);P2\n0;1;2;3\n", ["are both the sensor 'P1'", "--ignore"]),
        ("t;P1;P2\n2026-03-14T09:26:53;1;2\nlater;1;2\n", ["run.csv:3", "'later' is not a time like those"]),
        ("time_s,P1,P2\n0,1,2\nlater,1,2\n2,1,2\n", ["run.csv:3", "column 'time_s': 'later' is not a number"]),
        ("time_s,P1,P2\n0,1,2\n,1,2\n2,1,2\n", ["run.csv:3", "1 of 3 lines have no time, this one first"]),
        ("time_s,P1,P2\n,1,2\n,1,2\n", ["run.csv:2", "every line needs its time"]),
        ("time_s,P1,P2\n0,1\n", ["run.csv:2", "2 cells where the header has 3"]),
        // two runs in one file, and a time that is wrong rather than out of place
        ("time_s;P1;P2\n0;1;2\n1;1;2\n2;1;2\n3;1;2\n0;1;2\n1;1;2\n2;1;2\n", ["run.csv:6", "0 does not come after 3"]),
        ("time_s;P1;P2\n0;1;2\n1;1;2\n2;1;2\n3;1;2\n1,4;1;2\n4;1;2\n", ["run.csv:6", "falls between the other times"]),
        ("time_s;P1;P2\n0;1;2\n0;1;3\n0;1;4\n1;1;2\n1;1;3\n1;1;4\n", ["run.csv:3", "written too coarsely"]),
    ] {
        bench.put("run.csv", text);
        bench.refuses(&["run.csv"], &words);
    }
}

#[test]
fn readings_of_one_time_that_differ_become_their_mean_and_are_said() {
    let bench = Bench::plain();
    bench.put(
        "run.csv",
        "time_s,P1,P2\n0.0,100,1\n0.1,100,1\n0.1,104,\n0.2,100,1\n0.3,100,1\n0.4,,1\n0.4,100,\n0.5,100,1\n",
    );
    let (document, err) = bench.import(3, &["run.csv"]);
    let said = mended(&document, "contradicting-times");
    assert_eq!((&said["line"], &said["count"]), (&4.into(), &1.into()));
    assert!(err.contains("they differ by up to 4"), "{err}");
    assert_eq!(bench.recording().series[0].value, [100.0, 102.0, 100.0, 100.0, 100.0, 100.0]);
    assert_eq!(bench.recording().series[1].value, [1.0; 6]);
}

#[test]
fn a_file_that_ends_within_a_line_costs_that_line_and_is_said_by_the_exit_code() {
    let bench = Bench::plain();
    bench.put("run.csv", "time_s,P1,P2\n0.0,100,1\n0.1,101,1\n0.2,10");
    let (document, _) = bench.import(3, &["run.csv"]);
    assert_eq!(mended(&document, "cut-off")["line"], 4);
    assert_eq!(bench.recording().series[0].value, [100.0, 101.0]);
    // the last number is cut, and reads as one all the same
    for (separator, cut) in [(",", "5"), (",", "51.0"), (";", "5"), (",", ""), (",", "-")] {
        let row = |time: &str, last: &str| [time, "100.000", last].join(separator);
        let rows = [
            row("time_s", "P2").replace("100.000", "P1"),
            row("0.0", "51.000"),
            row("0.1", "52.000"),
            row("0.2", "51.500"),
            row("0.3", cut),
        ];
        bench.put("run.csv", rows.join("\n"));
        let (document, _) = bench.import(3, &["run.csv"]);
        assert_eq!(mended(&document, "cut-off")["line"], 5);
        assert_eq!(bench.recording().series[1].value, [51.0, 52.0, 51.5]);
    }
    // an editor, or a logger that began anew, gave the cut line its end
    bench.put("run.csv", "time_s,P1,P2\n0.0,100,1\n0.1,101,1\n0.2,10\n");
    let (document, _) = bench.import(3, &["run.csv"]);
    assert_eq!(mended(&document, "cut-off")["line"], 4);
    assert_eq!(bench.recording().series[0].value, [100.0, 101.0]);
    bench.put("run.csv", "time_s,P1,P2\n0.0,100.0,1.0\n0.1,100.0,1.0\n0.2,100.0,1.0\n0.3,100.0,2.0");
    bench.import(0, &["run.csv"]);
    assert_eq!(bench.recording().series[1].value, [1.0, 1.0, 1.0, 2.0], "whole, but for the end of its line");
}

#[test]
fn what_old_programs_and_excel_put_at_the_ends_and_the_beginning_of_lines_is_understood() {
    let bench = Bench::plain();
    bench.put("run.csv", "time_s,P1,P2\r0.0,100,1\r0.1,101,1\r");
    let (document, _) = bench.import(0, &["run.csv"]);
    assert_eq!(mended(&document, "line-ends")["count"], 1);
    assert_eq!(bench.recording().series[0].value, [100.0, 101.0]);
    for start in ["sep=;\r\n", "\u{feff}sep=;\n"] {
        bench.put("run.csv", format!("{start}time_s;P1;P2\n0,0;100;1\n0,1;101,5;1\n"));
        bench.import(0, &["run.csv"]);
        assert_eq!(bench.recording().series[0].value, [100.0, 101.5]);
    }
}

#[test]
fn an_hour_missing_from_a_wall_clock_may_be_daylight_saving_time() {
    let bench = Bench::plain();
    let rows = |zone: &str| {
        let times = ["01:59:57", "01:59:58", "01:59:59", "03:00:00", "03:00:01", "03:00:02"];
        let rows: String = times.iter().map(|time| format!("2026-03-29T{time}{zone},100,1\n")).collect();
        format!("time,P1,P2\n{rows}")
    };
    bench.put("run.csv", rows(""));
    let (document, _) = bench.import(0, &["run.csv"]);
    let text = mended(&document, "missing-times")["text"].as_str().unwrap();
    assert!(text.contains("before line 5") && text.contains("daylight saving time"), "{text}");
    bench.put("run.csv", rows("Z"));
    let (document, _) = bench.import(0, &["run.csv"]);
    let text = mended(&document, "missing-times")["text"].as_str().unwrap();
    assert!(!text.contains("daylight"), "{text}");
}

#[test]
fn columns_of_other_names_are_mapped_and_others_left_out_when_told() {
    let bench = Bench::plain();
    bench.put("run.csv", "time_s,Druck 1 (bar),Druck=2,Lufttemperatur\n0.0,1,1,20\n0.1,2,1,20\n");
    bench.refuses(&["run.csv", "--map", "Druck 1=P1"], &["'Druck=2' is no sensor"]);
    bench.refuses(&["run.csv", "--map", "Druck 1=P7"], &["column 'P7' is no sensor"]);
    bench.refuses(&["run.csv", "--map", "Druck"], &["write it like 'Column name=P1'"]);
    let args = ["run.csv", "--map", "Druck 1=P1", "--map", "Druck=2=P2", "--ignore", "*"];
    let (document, _) = bench.import(0, &args);
    assert!(mended(&document, "left-out")["text"].as_str().unwrap().contains("Lufttemperatur"));
    assert_eq!(bench.recording().series[0].value, [100.0, 200.0]);
}

#[test]
fn a_plain_file_keeps_its_comments_and_marks_its_holes_and_still_comes_back_byte_by_byte() {
    let bench = Bench::plain();
    let body = "time_s,P1,P2\n0.00,100,1\n0.01,100,\n0.02,100,\n0.03,100,1\n0.07,100,\n0.08,100,1\n";
    bench.put("run.csv", format!("# run 7\n{body}"));
    let (document, _) = bench.import(0, &["run.csv"]);
    assert_eq!(mended(&document, "missing-times")["count"], 3);
    let recording = bench.recording();
    assert_eq!(recording.run.notes, [("comment".to_string(), "run 7".to_string())]);
    assert_eq!((recording.series[0].gaps.len(), recording.series[1].gaps.len()), (1, 0));
    let mut out = Vec::new();
    surgescope::storage::export_csv(&recording, &mut out).unwrap();
    assert_eq!(String::from_utf8(out).unwrap(), body);
}

/// 2026-03-14T09:26:53Z is 1 773 480 413 s after 1970, by `date -u +%s -d 2026-03-14T09:26:53Z`.
#[test]
fn the_start_in_the_comments_is_that_of_the_recording_unless_another_is_named() {
    const START_NS: u64 = 1_773_480_413_000_000_000;
    let bench = Bench::plain();
    let plain = "time_s,P1,P2\n0.00,100,1\n0.01,100,1\n";
    for (name, body) in [("plain.csv", plain.to_string()), ("german.csv", plain.replace(',', ";").replace('.', ","))] {
        bench.put(name, format!("# start: 2026-03-14T09:26:53.5Z\n{body}"));
        let (document, said) = bench.import(0, &[name]);
        assert_eq!(bench.recording().run.start_unix_ns, START_NS + 500_000_000, "{name}");
        assert!(mended(&document, "start")["text"].as_str().unwrap().contains("2026-03-14T09:26:53.5Z"), "{said}");
        let (document, _) = bench.import(0, &[name, "--start", "2026-03-14T09:26:53Z"]);
        assert_eq!(bench.recording().run.start_unix_ns, START_NS, "{name}");
        assert!(document["mended"].as_array().unwrap().iter().all(|m| m["what"] != "start"), "{document}");
    }
    bench.put("none.csv", format!("# run 7: no start\n{plain}"));
    bench.import(0, &["none.csv"]);
    assert_eq!(bench.recording().run.start_unix_ns, 0);
}

#[test]
fn a_unit_that_cannot_be_is_doubted_and_the_likely_one_named() {
    let bench = Bench::plain();
    // P1 is in kPa by the rig, but holds bar; P2 is right. Of two sensors each is far from the other: one sentence
    // names both
    bench.put("run.csv", "time_s,P1,P2\n0.0,2.4,2.3\n0.1,2.5,2.3\n0.2,2.4,2.3\n");
    let (document, err) = bench.import(0, &["run.csv"]);
    assert_eq!(document["warnings"].as_array().unwrap().len(), 1, "{document}");
    assert!(
        err.contains("the medians of 'P1', 2.400 kPa, and 'P2', ")
            && err.contains("far apart")
            && err.contains("'P1' in bar"),
        "{err}"
    );
    bench.put("run.csv", "time_s,P1,P2\n0.0,240,2.3\n0.1,250,2.3\n0.2,240,2.3\n");
    let (document, _) = bench.import(0, &["run.csv"]);
    assert_eq!(document["warnings"].as_array().unwrap().len(), 0, "{document}");
    // a piezoelectric sensor shows no steady pressure
    let bench = Bench::new(&[
        ("P1", "pressure", "kPa", ""),
        ("PZ", "pressure", "kPa", "coupling = \"ac\"\ntime_constant_s = 1.0"),
    ]);
    bench.put("run.csv", "time_s,P1,PZ\n0.0,240,0.1\n0.1,250,-0.1\n0.2,240,0.1\n");
    let (document, _) = bench.import(0, &["run.csv"]);
    assert_eq!(document["warnings"].as_array().unwrap().len(), 0, "{document}");
}

/// Twenty lines at `time`, of which some have another first cell.
fn lines(time: impl Fn(usize) -> String, others: &[(usize, &str)]) -> String {
    let cell = |i: usize| others.iter().find(|(at, _)| *at == i).map_or_else(|| time(i), |(_, cell)| cell.to_string());
    (0..20).map(|i| format!("{},{i},1\n", cell(i))).collect()
}

#[test]
fn a_line_without_a_time_costs_that_line_and_leaves_a_gap() {
    let bench = Bench::plain();
    let even = |i: usize| format!("0.{i:02}");
    // the squares lie on no even grid: nothing but the line itself tells of what is missing
    let uneven = |i: usize| format!("{}", i * i);
    let stamp = |i: usize| format!("2026-03-14T09:26:{:02}Z", i + 10);
    for (heading, time, cell, gap) in [
        ("time_s", &even as &dyn Fn(usize) -> String, "", [0.06, 0.08]),
        ("time_s", &even, "NaN", [0.06, 0.08]),
        ("time_s", &even, "n/a", [0.06, 0.08]),
        ("time_s", &uneven, "nan", [36.0, 64.0]),
        ("t", &stamp, "", [6.0, 8.0]),
    ] {
        bench.put("run.csv", format!("{heading},P1,P2\n{}", lines(time, &[(7, cell)])));
        let (document, err) = bench.import(3, &["run.csv"]);
        let said = mended(&document, "no-time");
        assert_eq!((&said["count"], &said["line"]), (&1.into(), &9.into()));
        assert!(err.contains("run.csv:9: 1 line has no time and was left out"), "{err}");
        for series in bench.recording().series {
            assert_eq!(series.time_s.len(), 19);
            let gaps: Vec<_> = series.gaps.iter().map(|g| ([g.from_s, g.to_s], g.samples)).collect();
            assert_eq!(gaps, [(gap, Some(1))], "{heading} {cell}");
        }
    }
    // before the first time there is nothing to be apart from; two in a row are one gap
    bench.put("run.csv", format!("time_s,P1,P2\n{}", lines(uneven, &[(0, "")])));
    bench.import(3, &["run.csv"]);
    let p1 = &bench.recording().series[0];
    assert_eq!((p1.value[0], p1.gaps.len()), (1.0, 0));
    bench.put("run.csv", format!("time_s,P1,P2\n{}", lines(uneven, &[(7, ""), (8, "nan")])));
    let (document, _) = bench.import(3, &["run.csv"]);
    assert_eq!(mended(&document, "no-time")["count"], 2);
    let gap = bench.recording().series[0].gaps[0];
    assert_eq!((gap.from_s, gap.to_s, gap.samples), (36.0, 81.0, Some(2)));

    bench.put("run.csv", format!("time_s,P1,P2\n{}", lines(even, &[(7, ""), (8, ""), (12, "")])));
    bench.refuses(&["run.csv"], &["run.csv:9", "3 of 20 lines have no time"]);
    // a row of units that names none of time is one of units
    bench.put("run.csv", format!("time_s,P1,P2\n,Pa,Pa\n{}", lines(even, &[])));
    bench.import(0, &["run.csv"]);
    assert!((bench.recording().series[0].value[7] - 0.007).abs() < 1e-12, "Pa are not kPa");
}
