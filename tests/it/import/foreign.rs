//! Tables as loggers write them: what they do not say is guessed, shown, and imported only when somebody agrees.

use std::path::Path;

use surgescope::storage::import::{SourceOptions, decode_source};

use super::{Bench, mended};

/// 200 rows of a bench with two pressures, in bar, at 1 kHz: `row(i, time_s, p1, p2)`.
fn table(head: &str, row: impl Fn(usize, f64, f64, f64) -> String) -> String {
    let rows = (0..200).map(|i| {
        let time_s = i as f64 * 1e-3;
        row(i, time_s, 2.0 + (0.05 * i as f64).sin(), 1.5 + (0.05 * i as f64).cos()) + "\n"
    });
    head.to_owned() + &rows.collect::<String>()
}

/// Two pressure sensors in bar, 100 m and 60 m from the supply.
fn bench() -> Bench {
    Bench::new(&[("P1", "pressure", "bar", ""), ("P2", "pressure", "bar", "position_m = 60.0")])
}

/// The recording holds the pressures of [`table`].
fn holds_the_table(bench: &Bench, within: f64) {
    let recording = bench.recording();
    let [p1, p2] = &recording.series[..] else { panic!() };
    assert_eq!((p1.time_s.len(), p2.time_s.len()), (200, 200));
    for i in 0..200 {
        let at = 0.05 * i as f64;
        assert!((p1.time_s[i] - p1.time_s[0] - i as f64 * 1e-3).abs() < 1e-5, "{}", p1.time_s[i]);
        assert!((p1.value[i] - 2.0 - at.sin()).abs() < within && (p2.value[i] - 1.5 - at.cos()).abs() < within);
    }
}

#[test]
fn tables_of_many_loggers_are_understood() {
    let commas = |text: String| text.replace('.', ",");
    let tables = [
        // Lines above the headings, a counter before the time, decimal commas, no unit of time.
        (
            "labview.txt",
            table(
                "LabVIEW Measurement\nOperator\tKim\n***End_of_Header***\n\nIndex\tZeit\tDruck 1 (bar)\tDruck 2 (mbar)\n",
                |i, t, a, b| commas(format!("{i}\t{:.1}\t{a:.6}\t{:.4}", 1e3 * t, 1e3 * b)),
            ),
            &["time-unit", "preamble", "unit", "counters"][..],
        ),
        // Days, as spreadsheets and ProCoDA count them.
        (
            "procoda.csv",
            table("Day fraction since midnight;PT-01 [kPa];PT-02 [psi]\n", |_, t, a, b| {
                format!("{:.10};{:.5};{:.6}", 0.3 + t / 86400.0, 100.0 * a, b * 14.503_773_773)
            }),
            &["time-unit", "unit"],
        ),
        // No headings, blanks between the columns.
        (
            "plain.dat",
            table("", |_, t, a, b| format!("  {t:.4}   {a:.6}  {b:.6}")),
            &["headings", "time-unit", "separator"],
        ),
        // A row of units of which the first is empty; every third line comes twice.
        (
            "twice.csv",
            table("Time,Upper pressure,Lower pressure\nms,bar,bar\n", |i, t, a, b| {
                let line = format!("{:.1},{a:.6},{b:.6}", 1e3 * t);
                if i % 3 == 0 { format!("{line}\n{line}") } else { line }
            }),
            &["duplicate-times"],
        ),
        // Remarks now and then, a last cell that is mostly empty, a heading without a column.
        (
            "remarks.csv",
            table("No;Time (s);Bemerkung;P1 (bar);P2 (bar);Temp (F);\n", |i, t, a, b| {
                let remark = if i == 150 { "Ventil zu" } else { "" };
                let warm = if i % 50 == 0 { "68.1" } else { "" };
                format!("{i};{t:.4};{remark};{a:.6};{b:.6};{warm};")
            }),
            &["words", "left-out"],
        ),
        // Units behind an underscore.
        ("suffix.csv", table("t_s,P1_bar,P2_kPa\n", |_, t, a, b| format!("{t:.4},{a:.6},{:.4}", 100.0 * b)), &["unit"]),
    ];
    for (name, text, notes) in tables {
        let bench = bench();
        bench.put(name, &text);
        // Nobody is there to agree: nothing is written, and the answer says what would be. Units behind underscores are
        // no guess.
        let is_guessed = name != "suffix.csv";
        if is_guessed {
            bench.refuses(&[name], &["--yes", "as understood"]);
        }
        let is_left_out = notes.contains(&"left-out");
        let (document, said) = bench.import(if is_left_out { 3 } else { 0 }, &[name, "--yes"]);
        notes.iter().for_each(|what| assert_eq!(mended(&document, what)["file"], name));
        assert!(said.contains("as understood") == is_guessed && said.contains("P2"), "{said}");
        let understood = &document["understood"][0]["sensors"][1];
        assert_eq!((&understood["sensor"], &understood["unit"]), (&"P2".into(), &"bar".into()));
        assert!((understood["rate_hz"].as_f64().unwrap() - 1000.0).abs() < 0.1, "{understood}");
        holds_the_table(&bench, 1e-4);
    }
}

#[test]
fn counted_samples_and_volts_need_a_rate_and_a_line() {
    let bench = bench();
    let text = table("# sample,P1 (V),P2 (V)\n", |i, _, a, b| format!("{i},{:.6},{:.6}", 0.5 + 0.4 * a, 0.5 + 0.8 * b));
    bench.put("volts.csv", text);
    bench.refuses(&["volts.csv", "--yes"], &["no column holds times", "'sample' counts samples", "--rate"]);
    bench.refuses(&["volts.csv", "--yes", "--rate", "1000"], &["is in 'V'", "--scale"]);
    let scales = ["--scale", "P1=2.5*x-1.25", "--scale", "P2=0.5..4.5 -> 0..5"];
    bench.import(0, &[&["volts.csv", "--yes", "--rate", "1000"], &scales[..]].concat());
    holds_the_table(&bench, 1e-5);
    // the unit alone, where no heading says it
    let psi = table("# sample,P1,P2\n", |i, _, a, b| format!("{i},{:.6},{:.6}", a * 14.503_774, b * 14.503_774));
    bench.put("psi.csv", psi);
    bench.import(0, &["psi.csv", "--yes", "--rate", "1000", "--scale", "P1=psi", "--scale", "P2=psi"]);
    holds_the_table(&bench, 1e-5);
    bench.refuses(&["volts.csv", "--rate", "1000", "--scale", "P1=0*x+1"], &["write it like 'P1=1..5 -> 0..10 bar'"]);
    // a unit that is not understood is not dropped
    bench.refuses(&["volts.csv", "--rate", "1000", "--scale", "P1=1..5 -> 0..1MPa"], &["write it like"]);
}

/// Columns that may be any of several sensors are not given to one of them.
#[test]
fn what_cannot_be_guessed_is_asked() {
    let bench = bench();
    bench.put("three.csv", table("Time (s),A (bar),B (bar),C (bar)\n", |_, t, a, b| format!("{t:.4},{a},{b},{a}")));
    bench.refuses(&["three.csv", "--yes"], &["--map 'A (bar)=P1'"]);
    let mapped = ["three.csv", "--yes", "--map", "A=P1", "--map", "B=P2"];
    bench.import(0, &[&mapped[..], &["--ignore", "C"]].concat());
    let (_, said) = bench.import(3, &mapped);
    assert!(said.contains("left out") && said.contains("C (bar)"), "{said}");
    holds_the_table(&bench, 1e-9);
}

#[test]
fn a_single_pressure_is_that_at_the_valve() {
    let bench = bench();
    bench.put("one.csv", table("t_s,pressure (bar)\n", |_, t, a, _| format!("{t:.4},{a:.6}")));
    let (document, _) = bench.import(0, &["one.csv", "--yes"]);
    assert_eq!(mended(&document, "without")["guessed"], true);
    assert_eq!(bench.recording().series.iter().map(|s| s.time_s.len()).collect::<Vec<_>>(), [200, 0]);
}

/// A comma is a decimal one where blanks separate the columns, and thousands may be grouped.
#[test]
fn decimal_commas_are_no_separators() {
    let bench = bench();
    let text = table("t_s  Druck\n", |_, t, a, _| format!("{t:.4}  {a:.6}").replace('.', ","));
    bench.put("blanks.txt", text);
    bench.import(0, &["blanks.txt", "--yes"]);
    let p1 = &bench.recording().series[0].value;
    assert!(p1.len() == 200 && (p1[30] - 2.0 - 1.5f64.sin()).abs() < 1e-5, "{p1:?}");
    bench.put(
        "grouped.csv",
        table("Nr;Zeit (s);P1 (mbar)\n", |i, t, a, _| {
            let (time, mbar) = (format!("{t:.4}").replace('.', ","), (1e3 * a) as u32);
            format!("{i};{time};{}.{:03},5", mbar / 1000, mbar % 1000)
        }),
    );
    bench.import(0, &["grouped.csv", "--yes"]);
    let p1 = &bench.recording().series[0].value;
    assert!(p1.len() == 200 && (p1[30] - 2.0 - 1.5f64.sin()).abs() < 1e-3, "{p1:?}");
}

/// Written by openpyxl (tools/xlsx_fixture.py): the table is in the second sheet, its times are dates of Excel.
#[test]
fn a_workbook_is_read() {
    let bench = bench();
    bench.put("book.xlsx", std::fs::read("tests/fixtures/openpyxl.xlsx").unwrap());
    let (document, _) = bench.import(0, &["book.xlsx", "--yes"]);
    assert_eq!(mended(&document, "date-times")["guessed"], false);
    sixty_samples(&bench);
    // The date in one column and the time of the day in the next.
    bench.put("two.xlsx", std::fs::read("tests/fixtures/openpyxl-two.xlsx").unwrap());
    let (document, _) = bench.import(3, &["two.xlsx", "--yes"]);
    assert!(mended(&document, "time-column")["text"].as_str().unwrap().contains("their dates in 'Date'"));
    sixty_samples(&bench);
    // Days since 1904.
    bench.put("mac.xlsx", std::fs::read("tests/fixtures/openpyxl-1904.xlsx").unwrap());
    let (document, _) = bench.import(0, &["mac.xlsx", "--yes"]);
    assert_eq!(mended(&document, "date-system")["guessed"], false);
    sixty_samples(&bench);
    bench.put("broken.xlsx", b"PK\x03\x04 and nothing else");
    bench.refuses(&["broken.xlsx"], &["no workbook", "save it as CSV"]);
}

/// A table goes on in the next sheet, with its headings or without; another table is named, and settings are none.
#[test]
fn a_table_over_several_sheets_is_one() {
    let bench = bench();
    bench.put("sheets.xlsx", std::fs::read("tests/fixtures/openpyxl-sheets.xlsx").unwrap());
    let (document, _) = bench.import(3, &["sheets.xlsx", "--yes"]);
    assert_eq!(mended(&document, "sheets")["count"], 3);
    let not_read = mended(&document, "not-read");
    assert!(not_read["count"] == 1 && not_read["text"].as_str().unwrap().contains("'second run'"), "{not_read}");
    let p1 = &bench.recording().series[0];
    assert_eq!((p1.value.len(), p1.gaps.len()), (60, 0));
    assert!(
        (0..60)
            .all(|i| (p1.time_s[i] - 0.005 * i as f64).abs() < 1e-9
                && (p1.value[i] - 1.5 - 0.01 * i as f64).abs() < 1e-9)
    );
    bench.import(0, &["sheets.xlsx", "--yes", "--ignore", "second run"]);
}

/// 60 samples at 200 Hz from 2026-03-14T09:26:53 on.
fn sixty_samples(bench: &Bench) {
    let recording = bench.recording();
    let p1 = &recording.series[0];
    assert_eq!((p1.value.len(), recording.run.start_unix_ns), (60, 1_773_480_413_000_000_000));
    assert!((p1.time_s[59] - 0.295).abs() < 1e-5 && (p1.value[59] - 2.09).abs() < 1e-9, "{:?}", p1.time_s);
}

/// Headings in several lines, dates beside times, units in lines of their own or behind commas.
#[test]
fn the_headers_of_loggers_are_understood() {
    let clock = |t: f64| format!("09:26:{:09.6}", 53.0 + t);
    let tables = [
        (
            "toa5.dat",
            table(
                "\"TOA5\",\"CR6Series\",\"CR6\",\"8431\",\"CR6.Std.10\",\"CPU:surge.CR6\",\"24211\",\"Surge\"\n\
                 \"TIMESTAMP\",\"RECORD\",\"P_valve\",\"P_mid\"\n\"TS\",\"RN\",\"bar\",\"kPa\"\n\"\",\"\",\"Smp\",\"Smp\"\n",
                |i, t, a, b| format!("\"2026-03-14 {}\",{i},{a:.6},{:.5}", clock(t), 100.0 * b),
            ),
            "date-times",
        ),
        (
            "stand.csv",
            table(
                "Pr\u{fc}fstand 2;;\nVersuch 7;;\nZeit;p_Ventil;p_Mitte\nhh:mm:ss,000;mbar \u{dc}berdruck;mbar \u{dc}berdruck\n",
                |_, t, a, b| format!("{};{:.4};{:.4}", clock(t), 1e3 * a, 1e3 * b).replace('.', ","),
            ),
            "preamble",
        ),
        (
            "halle.csv",
            table("Halle 3\nDatum;14.03.2026\n\nZeit [d];P1 [bar];P2 [bar];Temp [°C]\n", |_, t, a, b| {
                format!("{:.10};{a:.6};{b:.6};19.5", 46095.25 + t / 86400.0).replace('.', ",")
            }),
            "decimal-comma",
        ),
        (
            "logger.lvm",
            table(
                "LabVIEW Measurement\t\nDate\t2026/03/14\n***End_of_Header***\t\n\t\nChannels\t2\t\t\nSamples\t200\t200\t\n\
                 Y_Unit_Label\tbar\tmbar\t\nX_Dimension\tTime\tTime\t\nX0\t0.0\t0.0\t\nDelta_X\t0.001\t0.001\t\n\
                 ***End_of_Header***\t\t\t\nX_Value\tP at valve\tP below\tComment\n",
                |_, t, a, b| format!("{t:.6}\t{a:.6}\t{:.4}\t", 1e3 * b),
            ),
            "time-column",
        ),
        (
            "hobo.csv",
            table(
                "\"Plot Title: 7\"\n\"#\",\"Date Time, GMT+01:00\",\"Pres, kPa (LGR S/N: 1, LBL: valve)\",\"Pres, bar (LGR S/N: 2)\"\n",
                |i, t, a, b| format!("{},03/14/26 {} AM,{:.5},{b:.6}", i + 1, clock(t), 100.0 * a),
            ),
            "date-times",
        ),
        (
            "dated.csv",
            table("Run,P1 (bar),P2 (bar),Time,Date\n", |_, t, a, b| format!("7,{a:.6},{b:.6},{},03/04/2026", clock(t))),
            "date-order",
        ),
    ];
    for (name, text, note) in tables {
        let bench = bench();
        bench.put(name, &text);
        // a column that no sensor takes is named, and lost
        let is_whole = !["halle.csv", "dated.csv"].contains(&name);
        let (document, _) = bench.import(if is_whole { 0 } else { 3 }, &[name, "--yes"]);
        assert_eq!(mended(&document, note)["file"], name);
        holds_the_table(&bench, 1e-4);
    }
}

/// Nothing in a file says what the atmosphere was: the standard one is a guess.
#[test]
fn absolute_pressures_need_an_agreement() {
    let bench = bench();
    let head = "Time (s),P1 (bar abs),\"Abs Pres, kPa (logger 7)\"\n";
    bench.put("abs.csv", table(head, |_, t, a, b| format!("{t:.4},{:.6},{:.5}", a + 1.013_25, 100.0 * b + 101.325)));
    bench.refuses(&["abs.csv"], &["'P1 (bar abs)' is absolute", "--yes", "'P1=x-1.01325 bar'", "'P2=x-101.325 kPa'"]);
    let (document, _) = bench.import(0, &["abs.csv", "--yes"]);
    assert_eq!(mended(&document, "absolute")["guessed"], true);
    holds_the_table(&bench, 1e-4);
    bench.import(0, &["abs.csv", "--yes", "--scale", "P1=x-1.01325", "--scale", "P2=x-101.325 kPa"]);
    holds_the_table(&bench, 1e-4);
}

/// Written by SciPy and h5py (tools/arrays_fixture.py).
#[test]
fn files_of_arrays_are_tables() {
    for (name, options, besides) in [
        ("scipy.mat", &["--scale", "P2=1e-6*x"][..], Some("zero")),
        ("h5py.h5", &[], Some("calibration")),
        ("h5py-v73.mat", &["--map", "data 2=P1", "--map", "data 3=P2"], None),
        (
            "scipy-scope.mat",
            &["--map", "A=P1", "--map", "B=P2", "--scale", "P1=bar", "--scale", "P2=bar"],
            Some("Version"),
        ),
    ] {
        let bench = bench();
        let bytes = std::fs::read(format!("tests/fixtures/{name}")).unwrap();
        bench.put(name, &bytes);
        let (document, _) = bench.import(besides.map_or(0, |_| 3), &[&[name, "--yes"], options].concat());
        // what is not read is named; it is no loss where the file itself says so
        if let Some(besides) = besides {
            assert!(mended(&document, "not-read")["text"].as_str().unwrap().contains(&format!("'{besides}'")));
            bench.import(0, &[&[name, "--yes", "--ignore", besides], options].concat());
        }
        holds_the_table(&bench, 1e-5);
        // Cut off anywhere, it is refused or read as far as it goes.
        for length in (0..bytes.len()).step_by(37) {
            let read = decode_source(&bytes[..length], Path::new(name), &SourceOptions::default());
            assert!(read.is_err() || length > bytes.len() / 2, "{name} cut at {length}");
        }
    }
}

/// Written by SciPy and h5py: the second pressure has a clock of its own.
#[test]
fn arrays_go_by_their_own_times() {
    for (name, options, lost) in [
        ("scipy-clocks.mat", &[][..], &["tank", "names", "cells{1}", "spectrum"][..]),
        ("h5py-groups.h5", &[], &["camera", "remarks"]),
        ("h5py-table.h5", &["--scale", "P1=bar"], &["table/state"]),
    ] {
        let bench = bench();
        bench.put(name, std::fs::read(format!("tests/fixtures/{name}")).unwrap());
        let (document, said) = bench.import(3, &[&[name, "--yes"], options].concat());
        let not_read = mended(&document, "not-read");
        assert_eq!(not_read["count"], lost.len(), "{said}");
        lost.iter()
            .for_each(|what| assert!(not_read["text"].as_str().unwrap().contains(&format!("'{what}'")), "{said}"));
        let recording = bench.recording();
        let [p1, p2] = &recording.series[..] else { panic!() };
        assert_eq!((p1.value.len(), p2.value.len()), (200, 100), "{name}");
        for i in 0..100 {
            let at = i as f64;
            assert!(
                (p1.time_s[i] - 1e-3 * at).abs() < 1e-9 && (p1.value[i] - 2.0 - (0.05 * at).sin()).abs() < 1e-6,
                "{name}"
            );
            assert!(
                (p2.time_s[i] - 2e-3 * at).abs() < 1e-9 && (p2.value[i] - 1.5 - (0.1 * at).cos()).abs() < 1e-6,
                "{name}"
            );
        }
    }
}

/// Two groups with arrays of the same names are two runs, or two of something: nobody guesses which is which.
#[test]
fn groups_of_one_shape_are_not_taken_for_sensors_of_one_run() {
    let bench = bench();
    bench.put("runs.h5", std::fs::read("tests/fixtures/h5py-runs.h5").unwrap());
    bench.refuses(&["runs.h5", "--yes"], &["'run 1/P1' and 'run 2/P1' are both the sensor 'P1'", "--map", "--ignore"]);
    let second = ["--map", "run 2/P1=P1", "--map", "run 2/P2=P2"];
    let first = ["--ignore", "run 1/P1", "--ignore", "run 1/P2"];
    bench.import(0, &[&["runs.h5", "--yes"], &second[..], &first].concat());
    let recording = bench.recording();
    assert_eq!((recording.series[0].value[0], recording.series[1].value[0]), (4.0, 5.0));
}

/// A file without times needs a rate and nothing else.
#[test]
fn lines_are_samples_where_there_is_a_rate() {
    let bench = bench();
    bench.put("lines.txt", table("P1 (bar)\tP2 (bar)\n", |_, _, a, b| format!("{a:.6}\t{b:.6}")));
    bench.refuses(&["lines.txt", "--yes"], &["--rate"]);
    bench.import(0, &["lines.txt", "--yes", "--rate", "1000"]);
    holds_the_table(&bench, 1e-5);
}
