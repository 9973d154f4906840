//! Numbers that read well and are none: readings that fell out, stand still or only repeat, counters that begin anew,
//! signs and levels that the file leaves out.

use super::{Bench, mended};

/// Rows of the tables here, at 1 kHz.
const ROWS: usize = 1200;

/// A pressure with noise: steady, a front within 10 ms at 0.5 s, and waves that die away.
fn pressure_bar(i: usize) -> f64 {
    let noise = ((i * 7919) % 101) as f64 / 101.0 - 0.5;
    let after_s = (i as f64 - 500.0) * 1e-3;
    let rise = (100.0 * after_s).clamp(0.0, 1.0);
    5.0 + 0.02 * noise + 3.0 * rise * (15.0 * (after_s - 0.01).max(0.0)).cos() * (-after_s.max(0.0)).exp()
}

/// One pressure in bar, 100 m from the supply.
fn bench() -> Bench {
    Bench::new(&[("P1", "pressure", "bar", "")])
}

fn table(head: &str, row: impl Fn(usize, f64) -> String) -> String {
    head.to_owned() + &(0..ROWS).map(|i| row(i, pressure_bar(i)) + "\n").collect::<String>()
}

/// All samples are those of the pressure, but for those of the rows that are `left` out.
fn holds_the_rest(bench: &Bench, left: impl Fn(usize) -> bool) {
    let series = &bench.recording().series[0];
    let kept: Vec<usize> = (0..ROWS).filter(|i| !left(*i)).collect();
    assert_eq!(series.time_s.len(), kept.len());
    for (&i, (time_s, value)) in kept.iter().zip(series.time_s.iter().zip(&series.value)) {
        assert!(
            (time_s - i as f64 * 1e-3).abs() < 1e-9 && (value - pressure_bar(i)).abs() < 1e-4,
            "{i}: {time_s} {value}"
        );
    }
}

#[test]
fn readings_that_fell_out_are_gaps_however_they_are_written() {
    let falls_out = |i: usize| [150, 505, 700].contains(&i) || (900..925).contains(&i);
    for (head, stray) in [("time_s,P1\n", "0"), ("Time (s),P1 (bar)\n", "0.0000"), ("Time (s),P1 (bar)\n", "100.0")] {
        let bench = bench();
        let row = |i: usize, p: f64| {
            if falls_out(i) { format!("{},{stray}", i as f64 * 1e-3) } else { format!("{},{p:.4}", i as f64 * 1e-3) }
        };
        bench.put("run.csv", table(head, row));
        let (document, _) = bench.import(3, &["run.csv", "--yes"]);
        assert_eq!(mended(&document, "missing-values")["count"], 28, "{stray}");
        holds_the_rest(&bench, falls_out);
        assert_eq!(bench.recording().series[0].gaps.iter().filter_map(|gap| gap.samples).sum::<u64>(), 28);
    }
}

/// A trough that touches the pressure of the air, a trigger, a valve that shuts and a flow that stops hold zeros of
/// their own.
#[test]
fn zeros_that_the_neighbours_do_not_contradict_are_readings() {
    let bench = Bench::new(&[
        ("P1", "pressure", "bar", ""),
        ("G", "trigger", "1", ""),
        ("V", "valve-position", "%", ""),
        ("Q", "flow", "L/s", "position_m = 0.0"),
    ]);
    let rows: Vec<[f64; 4]> = (0..ROWS)
        .map(|i| {
            let wave = 1.0 + (std::f64::consts::PI * i as f64 / 100.0).cos();
            let noise = ((i * 7919) % 101) as f64 / 5050.0;
            let trigger = if (300..302).contains(&i) || (800..802).contains(&i) { 0.0 } else { 5.0 };
            let valve = 100.0 - (i as f64 - 500.0).clamp(0.0, 100.0);
            [(1e4 * wave).round() / 1e4, trigger, valve, if i < 500 { 0.5 + noise } else { 0.0 }]
        })
        .collect();
    let line = |(i, [p, g, v, q]): (usize, &[f64; 4])| format!("{:.3},{p},{g},{v},{q:.4}\n", i as f64 * 1e-3);
    bench.put("run.csv", "time_s,P1,G,V,Q\n".to_owned() + &rows.iter().enumerate().map(line).collect::<String>());
    bench.import(0, &["run.csv"]);
    let recording = bench.recording();
    for (sensor, series) in recording.series.iter().enumerate() {
        assert_eq!(series.value.len(), ROWS, "{sensor}");
        assert!(series.value.iter().zip(&rows).all(|(value, row)| (value - row[sensor]).abs() < 1e-4), "{sensor}");
    }
    assert!(recording.series[0].value.contains(&0.0));
}

#[test]
fn a_reading_that_stands_still_while_its_noise_goes_on_is_a_gap() {
    let bench = bench();
    let held = |i: usize| (480..560).contains(&i);
    let row = |i: usize, p: f64| format!("{},{:.4}", i as f64 * 1e-3, if held(i) { pressure_bar(480) } else { p });
    bench.put("run.csv", table("time_s,P1\n", row));
    let (document, err) = bench.import(3, &["run.csv"]);
    assert_eq!(mended(&document, "held")["count"], 79);
    assert_eq!(mended(&document, "held")["line"], 482);
    assert!(err.contains("stands still") && err.contains("the front may lie there"), "{err}");
    holds_the_rest(&bench, |i| held(i) && i > 480);
    // a valve that waits half open moves without noise, and so does a quiet pressure
    let bench = Bench::new(&[("P1", "pressure", "bar", ""), ("V", "valve-position", "%", "")]);
    let valve = |i: usize| 100.0 - 0.5 * ((i as f64 - 300.0).clamp(0.0, 100.0) + (i as f64 - 600.0).clamp(0.0, 100.0));
    let row = |i: usize, p: f64| format!("{},{:.2},{}", i as f64 * 1e-3, (10.0 * p).round() / 10.0, valve(i));
    bench.put("run.csv", table("time_s,P1,V\n", row));
    bench.import(0, &["run.csv"]);
    assert!(bench.recording().series.iter().all(|series| series.value.len() == ROWS && series.gaps.is_empty()));
}

#[test]
fn a_sensor_read_more_slowly_than_its_table_is_taken_at_its_own_rate() {
    let bench = bench();
    let row = |i: usize, _: f64| format!("{},{:.4}", i as f64 * 1e-3, pressure_bar(i - i % 8));
    bench.put("run.csv", table("time_s,P1\n", row));
    let (document, _) = bench.import(3, &["run.csv"]);
    assert_eq!(mended(&document, "repeats")["count"], ROWS - ROWS / 8);
    holds_the_rest(&bench, |i| i % 8 != 0);
}

#[test]
fn a_log_of_what_changes_has_gaps_and_is_no_whole_record() {
    let bench = bench();
    let (mut last, mut kept) = (f64::NAN, Vec::new());
    for i in 0..ROWS {
        if (pressure_bar(i) - last).abs() < 0.05 && i % 250 > 0 {
            continue;
        }
        last = pressure_bar(i);
        kept.push(i);
    }
    let rows: String = kept.iter().map(|&i| format!("{},{:.4}\n", i as f64 * 1e-3, pressure_bar(i))).collect();
    bench.put("run.csv", format!("time_s,P1\n{rows}"));
    let (document, _) = bench.import(3, &["run.csv"]);
    assert!(document["mended"].as_array().unwrap().iter().any(|m| m["lost"] == true), "{document}");
    assert!(bench.recording().series[0].gaps.iter().any(|gap| gap.from_s < 0.3 && gap.to_s > 0.4));
}

/// A counter of one byte loses samples, once where it begins anew.
#[test]
fn a_counter_that_begins_anew_counts_what_is_missing() {
    let bench = bench();
    let lost = |i: usize| (250..262).contains(&i) || (801..804).contains(&i);
    let rows: String =
        (0..ROWS).filter(|i| !lost(*i)).map(|i| format!("{},{:.4}\n", i % 256, pressure_bar(i))).collect();
    bench.put("run.csv", format!("Sample rate: 1000 Hz\nseq,P1 (bar)\n{rows}"));
    let (document, _) = bench.import(0, &["run.csv", "--yes"]);
    assert_eq!(
        (&mended(&document, "counter-wrap")["count"], &mended(&document, "missing-times")["count"]),
        (&1.into(), &15.into())
    );
    holds_the_rest(&bench, lost);
}

#[test]
fn numbers_written_without_their_sign_get_it_back_where_somebody_agrees() {
    let bench = bench();
    let unsigned = |p: f64| ((1e3 * (p - 3.5)).round() as i64).rem_euclid(65_536);
    bench.put("run.csv", table("Time (s),P1 (mbar)\n", |i, p| format!("{},{}", i as f64 * 1e-3, unsigned(p))));
    bench.refuses(&["run.csv"], &["--yes"]);
    let (document, _) = bench.import(0, &["run.csv", "--yes"]);
    assert!(mended(&document, "sign")["text"].as_str().unwrap().contains("without their sign"));
    let series = &bench.recording().series[0];
    assert!(series.value.iter().enumerate().all(|(i, v)| (v - pressure_bar(i) + 3.5).abs() < 1e-3));
}

#[test]
fn heads_above_the_sea_are_asked_for() {
    let head_m = |p: f64| format!("{:.3}", 10.2 * p + 212.5);
    for head in [
        "# head above sea level\ntime_s,P1 (m)\n",
        "Reference: m a.s.l.\ntime_s,P1 (m)\n",
        "# NAVD88\ntime_s,P1 (m)\n",
        "time_s,P1 (m ü. NN)\n",
        "time_s,P1 (m a.s.l.)\n",
        "time_s,HGL P1 (m)\n",
    ] {
        let bench = bench();
        bench.put("run.csv", table(head, |i, p| format!("{},{}", i as f64 * 1e-3, head_m(p))));
        let map: &[&str] = if head.contains("HGL") { &["--map", "HGL P1=P1"] } else { &[] };
        bench.refuses(&[&["run.csv", "--yes"], map].concat(), &["x-ELEVATION m(H2O)"]);
        bench.import(0, &[&["run.csv", "--yes", "--scale", "P1=x-212.5 m(H2O)"], map].concat());
        let density = 998.2;
        let series = &bench.recording().series[0];
        let is_right = |(i, v): (usize, &f64)| (v - pressure_bar(i) * 10.2 * density * 9.81e-5).abs() < 0.01;
        assert!(series.value.iter().enumerate().all(is_right), "{head}: {}", series.value[0]);
    }
    // a pressure does not count from there
    let bench = bench();
    bench.put(
        "run.csv",
        table("# logger at 212 m above sea level\ntime_s,P1 (bar)\n", |i, p| format!("{},{p:.4}", i as f64 * 1e-3)),
    );
    bench.import(0, &["run.csv"]);
    holds_the_rest(&bench, |_| false);
}

/// Sparks on the line, each of its own height; a peak as high as all the rest is a reading.
#[test]
fn single_readings_far_outside_of_their_neighbours_are_gaps() {
    let sparks = [(200, 60.25), (503, -41.5), (900, 77.0)];
    let bench = bench();
    let row = |i: usize, p: f64| {
        let spark = sparks.iter().find(|(at, _)| *at == i).map(|(_, value)| *value);
        format!("{},{:.4}", i as f64 * 1e-3, spark.unwrap_or(if i == 1000 { p + 5.0 } else { p }))
    };
    bench.put("run.csv", table("time_s,P1\n", row));
    let (document, _) = bench.import(3, &["run.csv"]);
    assert_eq!(mended(&document, "missing-values")["count"], 3);
    let series = &bench.recording().series[0];
    assert_eq!((series.value.len(), series.gaps.len()), (ROWS - 3, 3));
    assert!((series.value.iter().copied().fold(0.0, f64::max) - pressure_bar(1000) - 5.0).abs() < 1e-4);
}

/// From the last line to the first, and the same channel filtered beside.
#[test]
fn lines_are_turned_around_and_a_filtered_channel_is_left_out() {
    let bench = bench();
    let rows: String = (0..ROWS).rev().map(|i| format!("{},{:.4}\n", i as f64 * 1e-3, pressure_bar(i))).collect();
    bench.put("run.csv", format!("time_s,P1\n{rows}"));
    let (document, _) = bench.import(0, &["run.csv"]);
    assert_eq!(mended(&document, "reversed")["count"], 1);
    holds_the_rest(&bench, |_| false);
    let row = |i: usize, p: f64| format!("{},{p:.4},{:.4}", i as f64 * 1e-3, 0.5 * (p + pressure_bar(i.max(50) - 50)));
    bench.put("run.csv", table("Time (s),P1 raw (bar),P1 filtered (bar)\n", row));
    let (document, _) = bench.import(3, &["run.csv", "--yes"]);
    assert!(mended(&document, "extremes")["text"].as_str().unwrap().contains("P1 filtered"));
    holds_the_rest(&bench, |_| false);
}

/// With a rig that is there as with one that is made: what cannot be is not taken, unless somebody says what it stands
/// for.
#[test]
fn readings_that_cannot_be_are_refused_until_somebody_says_what_they_stand_for() {
    for (factor, why) in [(100.0, "more than a laboratory pipe withstands"), (-1.0, "below a vacuum")] {
        let bench = bench();
        bench.put("run.csv", table("time_s,P1\n", |i, p| format!("{},{:.4}", i as f64 * 1e-3, factor * p)));
        bench.refuses(&["run.csv"], &[why, "--scale 'P1=FACTOR*x bar'"]);
        bench.import(0, &["run.csv", "--scale", &format!("P1={}*x", 1.0 / factor)]);
        holds_the_rest(&bench, |_| false);
        bench.import(0, &["run.csv", "--scale", "P1=bar"]);
    }
    let bench = bench();
    bench.put(
        "run.csv",
        table("time_s,P1\n", |i, p| format!("{},{:.4}", i as f64 * 1e-3, if i == 700 { -4.0 } else { p })),
    );
    bench.refuses(&["run.csv"], &["shows -4 bar, less than a vacuum", "empty its cell"]);
}
