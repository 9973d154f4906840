//! Tables as devices and programs write them, by their manuals and by public reports: what is written is read, and what
//! is not is asked for. Values and times are those that stand in the text.

use std::path::Path;

use surgescope::storage::import::{SourceFile, SourceOptions, decode_source};

/// 2026-03-14T09:26:53.250Z, ns since 1970, by `date -u +%s`.
const START_NS: u64 = 1_773_480_413_250_000_000;
/// Rows of most tables.
const ROWS: usize = 60;

fn read(text: &str, options: &SourceOptions) -> Result<SourceFile, String> {
    decode_source(text.as_bytes(), Path::new("table.csv"), options).map_err(|e| e.to_string())
}

fn guessing() -> SourceOptions {
    SourceOptions { guess: true, ..SourceOptions::default() }
}

/// The pressure of a row, bar.
fn bar(i: usize) -> f64 {
    2.8 + 0.25 * (0.3 * i as f64).sin()
}

/// A head, then a row for each sample: its number, its time in ms, and the pressure in bar.
fn table(head: &str, row: impl Fn(usize, f64) -> String) -> String {
    let rows = (0..ROWS).map(|i| row(i, bar(i)) + "\n");
    head.to_owned() + &rows.collect::<String>()
}

/// Samples at 1 kHz of one track in a unit, to the digits that were written.
fn is_read(name: &str, text: &str, options: &SourceOptions, unit: &str, per_bar: f64) -> SourceFile {
    let file = read(text, options).unwrap_or_else(|why| panic!("{name}: {why}"));
    let track = &file.tracks[0];
    assert_eq!(track.unit.as_deref(), Some(unit), "{name}: {:?}", track.name);
    assert_eq!(track.series.value.len(), ROWS, "{name}");
    for (i, (t, v)) in track.series.time_s.iter().zip(&track.series.value).enumerate() {
        assert!((t - track.series.time_s[0] - 1e-3 * i as f64).abs() < 1e-6, "{name}: {t} s");
        assert!((v - per_bar * bar(i)).abs() < 1e-3 * per_bar, "{name}: {v} {unit}, not {}", per_bar * bar(i));
    }
    file
}

/// A unit is found wherever it stands.
#[test]
fn a_unit_is_found_wherever_it_is_written() {
    let psi = 14.503_774;
    let plain = |i: usize, p: f64| format!("{i},{:.3},{:.3}", psi * p, psi * p);
    for (name, head) in [
        ("slash", "t/ms,P1/psi,P2/psi\n"),
        ("MATLAB", "Time_ms_,P1_psi_,P2_psi_\n"),
        ("a break within the heading", "\"Time\n(ms)\",\"P1\n(psi)\",\"P2\r\n(psi)\"\n"),
        ("point", "t.ms,P1.psi,P2.psi\n"),
        ("upper case", "T_MS,P1_PSI,P2_PSI\n"),
        ("words", "t in ms,P1 in psi,P2 in psi\n"),
        ("a line of units", "Time,P1,P2\nms,psi,psi\n"),
        ("units and kinds of values", "Time,P1,P2\nms,psi,psi\n,Smp,Smp\n"),
        ("a line that says so", "Channel,CH1,CH2\nUnit,psi,psi\nSensitivity,0.5,0.5\nOffset,0,0\nTime (ms),P1,P2\n"),
        ("a table of channels", "CH,Name,Range,Unit\nP1,Valve,10V,psi\nP2,Middle,10V,psi\nData\nTime (ms),P1,P2\n"),
    ] {
        is_read(name, &table(head, plain), &guessing(), if name == "upper case" { "PSI" } else { "psi" }, psi);
    }
    let column = |i: usize, p: f64| format!("{},{i},{:.3},psi,{:.3},psi", i + 1, psi * p, psi * p);
    let file = is_read("a column", &table("No,Time (ms),P1,Unit,P2,Unit\n", column), &guessing(), "psi", psi);
    assert_eq!(file.tracks.len(), 2, "a counter is no sensor");
    let beside = |i: usize, p: f64| format!("0.{i:03} sec,{p:.4} bar");
    is_read("behind each number", &table("Time,P1\n", beside), &guessing(), "bar", 1.0);
    // two statements that differ are no unit
    let two = table("Time,P1 (bar),P2 (bar)\nms,psi,psi\n", plain);
    let why = read(&two, &guessing()).unwrap_err();
    assert!(
        why.contains(":2:") && why.contains("'bar' by its heading and in 'psi'") && why.contains("option `scale"),
        "{why}"
    );
    // nothing is made of nothing
    let none = read(&table("Time (ms),P1,P2\n", plain), &guessing()).unwrap();
    assert!(none.tracks.iter().all(|t| t.unit.is_none()));
}

#[test]
fn labview_states_units_intervals_and_starts() {
    let head = "LabVIEW Measurement\t\nSeparator\tTab\nDate\t2026/03/14\nTime\t09:20:00.5\n***End_of_Header***\t\n\t\nChannels\t1\t\n\
                Samples\t60\t\nDate\t2026/03/14\t\nTime\t09:26:53.25\t\nY_Unit_Label\tpsi\t\nX_Dimension\tTime\t\nX0\t0.0E+0\t\n\
                Delta_X\t1.000000E-3\t\n***End_of_Header***\t\t\n";
    let psi = 14.503_774;
    let timed = |i: usize, p: f64| format!("{:.6}\t{:.4}", 1e-3 * i as f64, psi * p);
    let file = is_read("one", &table(&format!("{head}X_Value\tP1\tComment\n"), timed), &guessing(), "psi", psi);
    assert_eq!(file.start.unwrap().unix_ns, START_NS);
    let none = |_: usize, p: f64| format!("\t{:.4}", psi * p);
    is_read("none", &table(&format!("{head}X_Value\tP1\tComment\n"), none), &guessing(), "psi", psi);
    // each value has the times on its left
    let multi = table(
        "Y_Unit_Label\tbar\t\tbar\t\nDelta_X\t1E-3\t\t2E-3\t\n***End_of_Header***\nX_Value\tP1\tX_Value\tP2\tComment\n",
        |i, p| format!("{:.3}\t{p:.4}\t{:.3}\t{p:.4}", 1e-3 * i as f64, 0.2 + 2e-3 * i as f64),
    );
    let file = read(&multi, &guessing()).unwrap();
    let [a, b] = &file.tracks[..] else { panic!("{:?}", file.tracks) };
    assert!((a.series.time_s[59] - 0.059).abs() < 1e-9 && (b.series.time_s[0] - 0.2).abs() < 1e-9);
    assert!((b.series.time_s[59] - 0.2 - 59.0 * 2e-3).abs() < 1e-9 && a.unit == b.unit, "{:?}", b.series.time_s);
}

/// Oscilloscopes: names and units in two lines, settings in the first columns, a counter with a stated increment. Volts
/// are no pressure.
#[test]
fn oscilloscopes_state_when_and_give_volts() {
    let volts = |i: usize, p: f64| format!("{i},{:.4},,", 0.25 * p);
    is_read(
        "Rigol",
        &table("X,CH1,Start,Increment,\nSequence,Volt,-1.0e-02,1.0e-03\n", volts),
        &guessing(),
        "Volt",
        0.25,
    );
    let keysight = |i: usize, p: f64| format!("{:.6E},{:+.4E}", 1e-3 * i as f64 - 0.01, 0.25 * p);
    let file = is_read("Keysight", &table("x-axis,1\nsecond,Volt\n", keysight), &guessing(), "Volt", 0.25);
    assert!((file.tracks[0].series.time_s[0] + 0.01).abs() < 1e-9 && file.tracks[0].name == "1");
    let beside =
        ["Record Length,6.0e1", "Sample Interval,1.0e-03", "Source,CH1", "Vertical Units,V", "Horizontal Units,s"];
    let tektronix =
        |i: usize, p: f64| format!("{},,{:.6},{:.5},", beside.get(i).unwrap_or(&","), 1e-3 * i as f64 - 0.01, 0.25 * p);
    is_read("Tektronix", &table("", tektronix), &guessing(), "V", 0.25);
    // in a file of a few rows, settings stand beside most of them
    let all = table("", tektronix);
    let few: String = all.lines().take(8).map(|line| format!("{line}\n")).collect();
    let file = read(&few, &guessing()).unwrap();
    let track = &file.tracks[0];
    assert_eq!((file.tracks.len(), track.unit.as_deref(), track.series.value.len()), (1, Some("V"), 8));
    assert!((track.series.time_s[7] - track.series.time_s[0] - 0.007).abs() < 1e-9, "{:?}", track.series.time_s);
}

/// LabVIEW, channels that were started one after the other: each `Time` is its own channel's.
#[test]
fn channels_of_labview_with_starts_of_their_own_stand_apart_by_them() {
    let head = "LabVIEW Measurement\t\nSeparator\tTab\nDecimal_Separator\t.\nX_Columns\tMulti\n***End_of_Header***\t\n\t\n\
                Channels\t2\t\t\t\nDate\t2026/03/14\t\t2026/03/14\t\nTime\t09:26:53.25\t\t09:26:53.253\t\n\
                Y_Unit_Label\tbar\t\tbar\t\nDelta_X\t0.001\t\t0.001\t\n***End_of_Header***\t\t\t\t\n\
                X_Value\tValve\tX_Value\tMiddle\tComment\n";
    let row = |i: usize, p: f64| format!("{:.3}\t{p:.4}\t{:.3}\t{p:.4}\t", 1e-3 * i as f64, 1e-3 * i as f64);
    let file = read(&table(head, row), &guessing()).unwrap();
    let first_s = |track: usize| file.tracks[track].series.time_s[0];
    assert!((first_s(1) - first_s(0) - 0.003).abs() < 1e-9, "{} and {} s", first_s(0), first_s(1));
    assert_eq!(file.start.unwrap().unix_ns, START_NS);
}

#[test]
fn clocks_in_several_columns_and_of_two_devices() {
    let started = |name: &str, text: &str| {
        let file = is_read(name, text, &guessing(), "bar", 1.0);
        let start = file.start.unwrap_or_else(|| panic!("{name} has no start")).unix_ns as i64;
        start + (file.tracks[0].series.time_s[0] * 1e9).round() as i64
    };
    let ms = |i: usize| 250 + i;
    for (name, text) in [
        (
            "milliseconds aside",
            table("Number,Date&Time,ms,P1\nNO.,Time,ms,bar\n", |i, p| {
                format!("{},2026/03/14 09:26:53,{},{p:+.4}", i + 1, ms(i))
            }),
        ),
        (
            "three columns",
            table("No,Date,Time,us,P1 (bar)\n", |i, p| format!("{i},2026/03/14,09:26:53,{}000,{p:.4}", ms(i))),
        ),
        (
            "the device's clock beside the computer's",
            table("pc_timestamp,t_ms,P1 (bar)\n", |i, p| {
                format!("2026-03-14 09:26:53.{}000,{},{p:.4}", 250 + 16 * (i / 16), 35_000 + i)
            }),
        ),
        ("names of months", table("Time,P1 (bar)\n", |i, p| format!("14-Mar-2026 09:26:53.{},{p:.4}", ms(i)))),
        (
            "a colon before the milliseconds",
            table("Time,P1 (bar)\n", |i, p| format!("2026-03-14 09:26:53:{},{p:.4}", ms(i))),
        ),
        ("a year of Thailand", table("Date,Time,P1 (bar)\n", |i, p| format!("14/03/2569,9:26:53.{},{p:.4}", ms(i)))),
        (
            "a semicolon before the milliseconds",
            table("Time,P1 (bar)\n", |i, p| format!("3/14/2026 9:26:53;{},{p:.4}", ms(i))),
        ),
        ("the day of the year", table("Time,P1 (bar)\n", |i, p| format!("2026-073T09:26:53.{}Z,{p:.4}", ms(i)))),
        ("a time code", table("IRIG,P1 (bar)\n", |i, p| format!("2026:073:09:26:53.{},{p:.4}", ms(i)))),
        (
            "names and types behind signs",
            table("\"#NAMES\"\n\"t_stamp\",\"P1_bar\"\n\"#TYPES\"\n\"date\",\"D\"\n\"#ROWS\",\"60\"\n", |i, p| {
                format!("\"2026-03-14 09:26:53.{}\",\"{p:.4}\"", ms(i))
            }),
        ),
        ("since 1970", table("timestamp,P1 (bar)\n", |i, p| format!("1773480413.{},{p:.4}", ms(i)))),
        ("since 1970 in ms", table("Time,P1 (bar)\n", |i, p| format!("1773480413{},{p:.4}", ms(i)))),
    ] {
        assert_eq!(started(name, &text), START_NS as i64, "{name}");
    }
    is_read(
        "minutes and seconds",
        &table("Time,P1 (bar)\n", |i, p| format!("59:59.{:03},{p:.4}", 940 + i)),
        &guessing(),
        "bar",
        1.0,
    );
    // thousandths that no zeros fill up; within each second they count from 0
    for (name, mark) in [("a point", '.'), ("a colon", ':'), ("a semicolon", ';')] {
        let text =
            table("Time,P1 (bar)\n", |i, p| format!("9:26:{}{mark}{},{p:.4}", 53 + (970 + i) / 1000, (970 + i) % 1000));
        is_read(name, &text, &guessing(), "bar", 1.0);
    }
    // pictures of a film are none
    let film = table("Time,P1 (bar)\n", |i, p| format!("9:26:{}:{:02},{p:.4}", 53 + i / 25, i % 25));
    assert!(read(&film, &guessing()).unwrap_err().contains("is not a time"), "{:?}", read(&film, &guessing()));
    let of_day = table("Time,P1 (bar)\n", |i, p| format!("073:23:59:{:02}.{:03},{p:.4}", 59, 940 + i));
    is_read("the day of a year that is not said", &of_day, &guessing(), "bar", 1.0);
    let nameless = table("Date,Time,,P1 (bar)\n", |i, p| {
        format!("14.03.2026,09:26:{},{},{p:.4}", 53 + (970 + i) / 1000, (970 + i) % 1000)
    });
    is_read("milliseconds without a name", &nameless, &guessing(), "bar", 1.0);
    // what is meant as a time and not understood
    let unread = table("Clock time,P1 (bar)\n", |i, p| format!("9h26m53s{},{p:.4}", ms(i)));
    let why = read(&unread, &guessing()).unwrap_err();
    assert!(why.contains("'9h26m53s250'") && why.contains("write them like 2026-03-14 09:26:53.250"), "{why}");
    let over = table("Time,P1 (bar)\n", |i, p| {
        let ms = 59 * 60_000 + 59_970 + i;
        format!("{:02}:{:02}.{:03},{p:.4}", ms / 60_000 % 60, ms / 1000 % 60, ms % 1000)
    });
    assert_eq!(
        is_read("the full hour", &over, &guessing(), "bar", 1.0).repairs.iter().filter(|r| r.what == "hour").count(),
        1
    );
    let wrap =
        table("micros,P1 (bar)\n", |i, p| format!("{},{p:.4}", (4_294_937_296_u64 + 1000 * i as u64) % (1 << 32)));
    is_read("a counter of 32 bits", &wrap, &guessing(), "bar", 1.0);
    // summer time ends: the hour from two to three comes twice
    let autumn = table("Time,P1 (bar)\n", |i, p| {
        let s = 7200 + 3570 + i - if i >= 30 { 3600 } else { 0 };
        format!("2026-10-25 {:02}:{:02}:{:02},{p:.4}", s / 3600, s / 60 % 60, s % 60)
    });
    let file = read(&autumn, &guessing()).unwrap();
    let time_s = &file.tracks[0].series.time_s;
    assert!(time_s.windows(2).all(|w| (w[1] - w[0] - 1.0).abs() < 1e-9) && time_s.len() == ROWS, "{time_s:?}");
}

/// Marks behind numbers, and tables in JSON.
#[test]
fn marks_behind_numbers_are_said_and_json_is_a_table() {
    let marked = table("Time (ms),P1 (bar)\n", |i, p| {
        format!(
            "{i},{p:.4}{}",
            if i % 9 == 4 {
                "H"
            } else if i == 6 {
                "*"
            } else {
                ""
            }
        )
    });
    let file = is_read("marks", &marked, &guessing(), "bar", 1.0);
    let marks = file.repairs.iter().find(|r| r.what == "marks").unwrap();
    assert!(marks.guessed && marks.count == 8 && marks.text.contains("'H' 7 ×"), "{marks:?}");
    let records: Vec<String> = (0..ROWS).map(|i| format!("{{\"t_ms\":{i},\"P1 (bar)\":{:.4}}}", bar(i))).collect();
    is_read("records", &format!("[{}]", records.join(",")), &guessing(), "bar", 1.0);
    is_read("lines", &records.join("\n"), &guessing(), "bar", 1.0);
    let values: Vec<String> = (0..ROWS).map(|i| format!("{:.4}", bar(i))).collect();
    is_read(
        "columns",
        &format!("{{\"sample_rate\":1000,\"P1 (bar)\":[{}]}}", values.join(",")),
        &guessing(),
        "bar",
        1.0,
    );
    assert!(read("{\"a\":{\"b\":1}}", &guessing()).unwrap_err().contains("no table of records or of columns"));
}

/// Times to the second at 20 Hz need a rate; given, pauses stay pauses, and a wrong one is refused.
#[test]
fn stamps_to_the_second_need_their_rate() {
    let at = |rate: usize, pause_s: usize| {
        (0..60)
            .map(|i| format!("2026-03-14 09:26:{:02},{:.4}\n", i / rate + if i >= 40 { pause_s } else { 0 }, bar(i)))
            .collect::<String>()
    };
    let head = "Time,P1 (bar)\n";
    let why = read(&(head.to_owned() + &at(20, 0)), &guessing()).unwrap_err();
    assert!(why.contains("option `rate`") && why.contains("it seems to be 20"), "{why}");
    let rated = |hz: f64| SourceOptions { rate_hz: Some(hz), ..guessing() };
    let file = read(&(head.to_owned() + &at(20, 0)), &rated(20.0)).unwrap();
    assert!(file.tracks[0].series.time_s.iter().enumerate().all(|(i, t)| (t - 0.05 * i as f64).abs() < 1e-9));
    let paused = read(&(head.to_owned() + &at(20, 7)), &rated(20.0)).unwrap();
    let series = &paused.tracks[0].series;
    assert!((series.time_s[40] - 9.0).abs() < 1e-9 && series.gaps.len() == 1, "{:?}", series.gaps);
    let why = read(&(head.to_owned() + &at(20, 0)), &rated(5.0)).unwrap_err();
    assert!(why.contains("5 samples a second") && why.contains("option `rate`"), "{why}");
    // a rate that stands in the file needs nobody
    let stated = format!("Sample rate: 20 Hz\n{head}{}", at(20, 0));
    assert!((read(&stated, &guessing()).unwrap().tracks[0].series.time_s[59] - 2.95).abs() < 1e-9);
}

#[test]
fn missing_values_are_gaps_and_are_counted_by_their_spelling() {
    for spelling in ["NaN", "NAN", "---", "#N/A", "OL", "inf", "∞", "+++++", "-9999", "-999.0", "9.9E+37", "No Data"]
    {
        let text = table("Time (ms),P1 (bar),P2 (bar)\n", |i, p| {
            format!("{i},{p:.4},{}", if i == 20 || i == 21 { spelling.to_owned() } else { format!("{p:.4}") })
        });
        let file = read(&text, &guessing()).unwrap_or_else(|why| panic!("{spelling}: {why}"));
        let [p1, p2] = &file.tracks[..] else { panic!("{spelling}") };
        assert_eq!((p1.series.value.len(), p1.series.gaps.len()), (60, 0), "{spelling}");
        assert_eq!((p2.series.value.len(), p2.series.gaps.len()), (58, 1), "{spelling}");
        assert!((p2.series.gaps[0].from_s - 0.019).abs() < 1e-9 && p2.series.gaps[0].samples == Some(2));
        let said = file.repairs.iter().find(|r| r.what == "missing-values").unwrap();
        assert!(said.lost && said.count == 2 && said.line == Some(22) && said.text.contains("2 ×"), "{}", said.text);
    }
    // a cell that is no number where a unit says that numbers are meant is no word to leave out
    let text = table("Time (ms),P1 (bar),P2 (bar)\n", |i, p| format!("{i},{p:.4},about {p:.1}"));
    assert!(read(&text, &guessing()).unwrap_err().contains("column 'P2 (bar)': 'about 2.8' is not a number"));
}

#[test]
fn marks_between_thousands_and_headings_that_count() {
    let mbar = |p: f64| {
        let mbar = (1000.0 * p).round() as u64;
        format!("{}.{:03}", mbar / 1000, mbar % 1000)
    };
    let text = table("time_ms;P1 (mbar)\n", |i, p| if i == 30 { "30;998".into() } else { format!("{i};{}", mbar(p)) });
    let file = read(&text, &guessing()).unwrap();
    assert!((file.tracks[0].series.value[0] - 2800.0).abs() < 1.0 && file.tracks[0].series.value[30] == 998.0);
    assert!(file.repairs.iter().any(|r| r.what == "thousands" && r.guessed));
    let pandas = is_named(&table("0,1,2\n", |i, p| format!("0.{i:03},{p:.4},{p:.4}")));
    assert_eq!(pandas, ["1", "2"]);
    let twice = is_named(&table("time_s,Pressure (bar),Pressure (bar)\n", |i, p| format!("0.{i:03},{p:.4},{p:.4}")));
    assert_eq!(twice, ["Pressure", "Pressure 2"]);
    let numbered = is_named(&table("\"time_s\" \"P1.bar\"\n", |i, p| format!("\"{}\" 0.{i:03} {p:.4}", i + 1)));
    assert_eq!(numbered, ["P1"], "R numbers the rows and does not say so");
}

fn is_named(text: &str) -> Vec<String> {
    let file = read(text, &guessing()).unwrap();
    assert!(file.tracks.iter().all(|t| t.series.value.len() == ROWS && (t.series.time_s[59] - 0.059).abs() < 1e-9));
    file.tracks.into_iter().map(|t| t.short).collect()
}

/// Headings that come again, blocks that began later, sums under the table, numbers above it.
#[test]
fn lines_among_the_rows_are_read_or_named() {
    let row = |i: usize| format!("{i};{:.4}\n", bar(i));
    let rows = |from: usize, to: usize| (from..to).map(row).collect::<String>();
    let head = "Time (ms);P1 (bar)\n";
    let again = format!("{head}{}{head}{}Min;2.55\nMax;3.05\n", rows(0, 30), rows(30, 60));
    let file = is_read("headings again", &again, &guessing(), "bar", 1.0);
    let named = |what: &str| file.repairs.iter().find(|r| r.what == what).map(|r| (r.count, r.line));
    assert_eq!((named("headings-again"), named("remarks")), (Some((1, Some(32))), Some((2, Some(63)))));
    let block = |start: &str, from: usize| {
        let rows: String = (0..30).map(|i| format!("{i};{:.4}\n", bar(from + i))).collect();
        format!("Start: 2026-03-14 {start}\n{head}{rows}")
    };
    let blocks = block("09:26:53.250", 0) + &block("09:26:53.280", 30);
    is_read("blocks", &blocks, &guessing(), "bar", 1.0);
    // times that begin anew, and nothing says when
    let two = format!("{head}{}{head}{}", rows(0, 30), rows(0, 30));
    assert!(read(&two, &guessing()).unwrap_err().contains("does not come after"));
    let above = format!("Calibration;2026;03\n1;2.5\n2;2.6\n3;2.4\n\n{head}{}", rows(0, 60));
    is_read("numbers above", &above, &guessing(), "bar", 1.0);
}
