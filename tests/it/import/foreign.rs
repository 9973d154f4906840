//! Tables as loggers write them: what they do not say is guessed, shown, and imported only when somebody agrees.

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
            &["time-unit", "preamble", "unit", "left-out"][..],
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
        // Nobody is there to agree: nothing is written, and the answer says what would be.
        bench.refuses(&[name], &["--yes", "as understood"]);
        let (document, said) = bench.import(0, &[name, "--yes"]);
        notes.iter().for_each(|what| assert_eq!(mended(&document, what)["file"], name));
        assert!(said.contains("as understood") && said.contains("P2"), "{said}");
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
    let scales = ["--scale", "P1=2.5*x-1.25", "--scale", "P2=1.25x-0.625"];
    bench.import(0, &[&["volts.csv", "--yes", "--rate", "1000"], &scales[..]].concat());
    holds_the_table(&bench, 1e-5);
    bench.refuses(&["volts.csv", "--rate", "1000", "--scale", "P1=0*x+1"], &["write it like 'P1=250*x-125'"]);
}

/// Columns that may be any of several sensors are not given to one of them.
#[test]
fn what_cannot_be_guessed_is_asked() {
    let bench = bench();
    bench.put("three.csv", table("Time (s),A (bar),B (bar),C (bar)\n", |_, t, a, b| format!("{t:.4},{a},{b},{a}")));
    bench.refuses(&["three.csv", "--yes"], &["--map 'A (bar)=P1'"]);
    let (_, said) = bench.import(0, &["three.csv", "--yes", "--map", "A=P1", "--map", "B=P2"]);
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
    assert_eq!(mended(&document, "time-unit")["guessed"], true);
    let p1 = &bench.recording().series[0];
    assert_eq!(p1.value.len(), 60);
    assert!((p1.time_s[59] - 0.295).abs() < 1e-5 && (p1.value[59] - 2.09).abs() < 1e-9, "{:?}", p1.time_s);
    bench.put("broken.xlsx", b"PK\x03\x04 and nothing else");
    bench.refuses(&["broken.xlsx"], &["no workbook", "save it as CSV"]);
}
