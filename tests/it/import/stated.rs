//! What stands around a table and changes its numbers: factors, zeros, the vacuum, a thinned rate, missing numbers, the
//! mean beside its extremes.

use super::written::{PIPE, ROWS, bar, closure, folder, holds, read, run, table};

/// The closure with both pressures as `number` writes them.
fn tested(head: &str, number: impl Fn(f64) -> String) -> String {
    let rows = closure().into_iter().map(|[t, a, b]| format!("{t:.3},{},{}\n", number(a), number(b)));
    head.to_owned() + &rows.collect::<String>()
}

/// Nobody can tell what a factor beside the table means for the numbers: the program asks, and takes either answer.
#[test]
fn a_factor_or_a_zero_beside_the_table_is_asked_for() {
    let tenths = |value: f64| format!("{:.3}", 10.0 * value);
    for head in [
        "Channel,Valve,Middle\nUnit,bar,bar\nFactor,0.1,0.1\ntime_s,Valve,Middle\n",
        "Channel,Valve,Middle\nUnit,bar,bar\nOffset,1.5,1.5\ntime_s,Valve,Middle\n",
        "# slope 0.1, intercept 0\ntime_s,Valve (bar),Middle (bar)\n",
        "# raw values are tenths of a bar\ntime_s,Valve (bar),Middle (bar)\n",
        "time_s,Valve (bar),Middle (bar)\nFactor,0.1,0.1\n",
        "# unit: 0.1 bar\ntime_s,Valve (bar),Middle (bar)\n",
        "# all pressures x10\ntime_s,Valve (bar),Middle (bar)\n",
        "# multiply pressures by 0.1\ntime_s,Valve (bar),Middle (bar)\n",
        "time,Valve,Middle\ns,bar,bar\n,x0.1,x0.1\n",
        "time,Valve,Middle\ns,bar,bar\nREAL,INT*10,INT*10\n",
    ] {
        let folder = folder(&[("t.csv", &tested(head, tenths))]);
        let new = [&["rig", "new", "t.csv"], &PIPE[..]].concat();
        let (code, _, said) = run(&folder, &new);
        assert!(code == 2 && said.contains("FACTOR*x bar"), "{head}: {code} {said}");
        let scaled = ["--scale", "column 2=0.1*x bar", "--scale", "column 3=0.1*x bar"];
        let (code, _, said) = run(&folder, &[&new[..], &scaled].concat());
        assert_eq!(code, 0, "{head}: {said}");
        let import =
            [&["import", "t.csv", "--rig", "rig.toml", "--yes", "--json", "-o", "run.mcap"], &scaled[..]].concat();
        assert_eq!(run(&folder, &import).0, 0, "{head}");
        let (_, found, _) = run(&folder, &["inspect", "run.mcap", "--json"]);
        // 5.877 bar are 60.0 m of water
        let steady_m = found["sensors"][0]["steady_before_m"]["value"].as_f64().unwrap();
        assert!((steady_m - 60.0).abs() < 0.1, "{head}: {steady_m}");
    }
    // one by one, nothing added, and the line of a transducer whose numbers are in bar
    for head in [
        "Factor,1,1\nOffset,0,0\ntime_s,Valve (bar),Middle (bar)\n",
        "Range,10V,10V\nRatio,4,4\nOffset,-2,-2\nUnit,bar,bar\ntime_s,Valve,Middle\n",
    ] {
        let file = read(&table(head, |i, a, b| format!("{:.3},{a:.4},{b:.4}", 1e-3 * i as f64)));
        holds(head, &file.unwrap_or_else(|e| panic!("{head}: {e}")), [("bar", 1.0), ("bar", 1.0)]);
    }
}

/// The program heeds a remark that the pressures are absolute: it takes 1.01325 bar off, and says so.
#[test]
fn a_remark_on_the_vacuum_is_heeded() {
    let absolute = |value: f64| format!("{:.4}", value + 1.01325);
    let folder = folder(&[("t.csv", &tested("# pressures are absolute\ntime_s,Valve (bar),Middle (bar)\n", absolute))]);
    assert_eq!(run(&folder, &[&["rig", "new", "t.csv"], &PIPE[..]].concat()).0, 0);
    let (code, _, said) = run(&folder, &["import", "t.csv", "--rig", "rig.toml", "--yes", "-o", "run.mcap"]);
    assert!(code == 0 && said.contains("standard atmosphere"), "{said}");
    let (_, found, _) = run(&folder, &["inspect", "run.mcap", "--json"]);
    let steady_m = found["sensors"][0]["steady_before_m"]["value"].as_f64().unwrap();
    assert!((steady_m - 60.0).abs() < 0.1, "{steady_m}");
}

/// The rate of the device is not that of the lines where it did not write each of its samples.
#[test]
fn a_thinned_rate_is_asked_for() {
    let row = |step: usize| move |i: usize, a: f64, b: f64| format!("{},{a:.4},{b:.4}", step * i);
    for (head, step) in [
        ("Sample rate: 10000 Hz\nDecimation: 10\nsample,Valve (bar),Middle (bar)\n", 1),
        ("Sample rate: 10000 Hz\nsample,Valve (bar),Middle (bar)\n", 10),
    ] {
        let said = read(&table(head, row(step))).unwrap_err();
        assert!(said.contains("10000 Hz' is stated, but") && said.contains("option `rate`"), "{said}");
    }
}

/// The same number far outside of all others stands for a missing value, also on end.
#[test]
fn a_block_of_a_number_that_no_sensor_shows_is_a_gap() {
    for (from, stray) in [(0, "-1234.5"), (30, "-6999"), (57, "30000")] {
        let row = |i: usize, a: f64, b: f64| match (from..from + 3).contains(&i) {
            true => format!("{:.3},{stray},{b:.4}", 1e-3 * i as f64),
            false => format!("{:.3},{a:.4},{b:.4}", 1e-3 * i as f64),
        };
        let file = read(&table("time_s,Valve (bar),Middle (bar)\n", row)).unwrap();
        assert_eq!(file.tracks[0].series.value.len(), ROWS - 3, "{stray}");
        assert!(file.tracks[0].series.value.iter().all(|v| (2.0..4.0).contains(v)), "{stray}");
        assert!(file.repairs.iter().any(|r| r.lost && r.text.contains("3 ×")), "{:?}", file.repairs);
    }
}

/// Of the least, the mean and the largest value of an interval the mean is the sensor.
#[test]
fn extremes_beside_the_mean_are_left_out_and_named() {
    let head = "time_s,Valve Min (bar),Valve Avg (bar),Valve Max (bar)\n";
    let file =
        read(&table(head, |i, a, _| format!("{:.3},{:.4},{a:.4},{:.4}", 1e-3 * i as f64, a - 0.3, a + 0.3))).unwrap();
    assert_eq!(file.tracks.len(), 1);
    assert!((file.tracks[0].series.value[7] - bar(7)[0]).abs() < 1e-4);
    assert!(file.repairs.iter().any(|r| r.lost && r.text.contains("Valve Min (bar), Valve Max (bar)")));
    let alone = read(&table("time_s,Valve Max (bar),Middle Max (bar)\n", |i, a, b| {
        format!("{:.3},{a:.4},{b:.4}", 1e-3 * i as f64)
    }));
    assert_eq!(alone.unwrap().tracks.len(), 2);
    let ends = table("time_s,Valve Max (bar),Valve Min (bar)\n", |i, a, _| {
        format!("{:.3},{:.4},{:.4}", 1e-3 * i as f64, a + 0.3, a - 0.3)
    });
    let error = read(&ends).unwrap_err().to_string();
    assert!(error.contains("no column holds the values between") && error.contains("`ignore 'Valve Min'`"), "{error}");
    let folder = folder(&[("t.csv", &ends)]);
    let (code, _, said) = run(&folder, &[&["rig", "new", "t.csv", "--ignore", "Valve Min"], &PIPE[..]].concat());
    assert_eq!(code, 0, "{said}");
}

/// One channel after the other, each with the times from the beginning; runs one after the other are none.
#[test]
fn channels_may_stand_one_after_the_other() {
    let rows = |name: &str, which: usize| {
        (0..ROWS).map(|i| format!("{name},{:.3},{:.4},bar\n", 1e-3 * i as f64, bar(i)[which])).collect::<String>()
    };
    let text = format!("channel,time_s,value,unit\n{}{}", rows("Valve", 0), rows("Middle", 1));
    holds("sorted", &read(&text).unwrap(), [("bar", 1.0), ("bar", 1.0)]);
    let runs = text.replace("channel,", "run,");
    assert!(read(&runs).unwrap_err().contains("times must increase"));
}

/// Units above their names, names in brackets, and spellings of other countries.
#[test]
fn units_stand_above_the_names_or_in_other_letters() {
    let row = |per_bar: f64| {
        move |i: usize, a: f64, b: f64| format!("{:.3};{:.5};{:.5}", 1e-3 * i as f64, per_bar * a, per_bar * b)
    };
    for (head, unit, per_bar) in [
        ("s;bar;bar\nt;Valve;Middle\n", "bar", 1.0),
        ("time (s);P(valve);P(middle)\n;bar;bar\n", "bar", 1.0),
        ("Время (с);Клапан, кгс/см²;Середина, кгс/см²\n", "кгс/см²", 1.01972),
        ("time_s;Valve:bar;Middle:bar\n", "bar", 1.0),
        ("Latest: Time (s);Latest: Valve (kPa);Latest: Middle (kPa)\n", "kPa", 100.0),
        ("time_s;Valve (lb/in2);Middle (lb/in2)\n", "lb/in2", 14.50377),
        ("time_s;阀门压力(千帕);中间压力(千帕)\n", "千帕", 100.0),
    ] {
        let file = read(&table(head, row(per_bar))).unwrap_or_else(|e| panic!("{head}: {e}"));
        holds(head, &file, [(unit, per_bar), (unit, per_bar)]);
    }
}

/// A column that never changes sees nothing of the test; a sensor with the wrong sign is asked about.
#[test]
fn a_setpoint_is_left_out_and_a_wrong_sign_is_asked_about() {
    let rows = closure().into_iter().map(|[t, a, b]| format!("{t:.3},6.0,{a:.4},{b:.4}\n")).collect::<String>();
    let folder = folder(&[
        ("t.csv", &format!("Time (s),Setpoint (bar),Valve (bar),Middle (bar)\n{rows}")),
        ("sign.csv", &tested("Time (s),Valve (bar),Middle (bar)\n", |value| format!("{:.4}", -value))),
    ]);
    let (code, document, said) = run(&folder, &[&["rig", "new", "t.csv"], &PIPE[..]].concat());
    assert_eq!((code, &document["left_out"][0]), (0, &"Setpoint (bar)".into()), "{said}");
    let (code, _, said) = run(&folder, &["import", "t.csv", "--rig", "rig.toml", "--yes", "-o", "run.mcap"]);
    assert!(code == 3 && said.contains("left out"), "{code}: {said}");
    let new = [&["rig", "new", "sign.csv", "-o", "sign.toml"], &PIPE[..]].concat();
    let (code, _, said) = run(&folder, &new);
    assert!(code == 2 && said.contains("inverted") && said.contains("--scale 'Valve=FACTOR*x bar'"), "{code}: {said}");
    let stray = tested("Time (s),Valve (bar),Middle (bar)\n", |value| format!("{value:.4}")).replacen(
        "\n2.000,",
        "\n2.000,-",
        1,
    );
    std::fs::write(folder.path().join("stray.csv"), stray).unwrap();
    let (code, _, said) = run(&folder, &[&["rig", "new", "stray.csv", "-o", "stray.toml"], &PIPE[..]].concat());
    assert!(code == 2 && said.contains("less than a vacuum"), "{code}: {said}");
    let turned = ["--scale", "Valve=-1*x bar", "--scale", "Middle=-1*x bar"];
    assert_eq!(run(&folder, &[&new[..], &turned].concat()).0, 0);
}

/// Who gives a column the name of a sensor means a pressure; the program still asks for its unit.
#[test]
fn a_column_with_the_name_of_a_sensor_is_one() {
    let folder = folder(&[("t.csv", &tested("time_s,CH1,CH2\n", |value| format!("{value:.4}")))]);
    let new = [&["rig", "new", "t.csv", "--map", "CH1=Valve", "--map", "CH2=Middle"], &PIPE[..]].concat();
    let (code, _, said) = run(&folder, &new);
    assert!(code == 2 && said.contains("Valve, Middle") && said.contains("--unit"), "{code}: {said}");
    assert_eq!(run(&folder, &[&new[..], &["--unit", "bar"]].concat()).0, 0);
}

/// What a column of states says of a row is heeded: a value that it calls bad is missing.
#[test]
fn a_value_that_its_quality_calls_bad_is_missing() {
    let state = |i: usize| if (20..23).contains(&i) { "Bad" } else { "Good" };
    let head = "time_s,Valve (bar),Valve Quality,Middle (bar),Middle Quality\n";
    let file = read(&table(head, |i, a, b| format!("{:.3},{a:.4},{},{b:.4},Good", 1e-3 * i as f64, state(i)))).unwrap();
    assert_eq!([0, 1].map(|which| file.tracks[which].series.value.len()), [ROWS - 3, ROWS]);
    assert!(file.repairs.iter().any(|r| r.lost && r.text.contains("'Bad' 3 ×")), "{:?}", file.repairs);
    assert!(!file.repairs.iter().any(|r| r.text.contains("left out")), "{:?}", file.repairs);
}

/// OPC's codes say the same in numbers.
#[test]
fn opcs_qualities_are_heeded() {
    let code = |i: usize| if (20..23).contains(&i) { 24 } else { 192 };
    let head = "time_s,Valve (bar),Middle (bar),Quality\n";
    let file = read(&table(head, |i, a, b| format!("{:.3},{a:.4},{b:.4},{}", 1e-3 * i as f64, code(i)))).unwrap();
    assert_eq!(file.tracks.iter().map(|t| t.series.value.len()).collect::<Vec<_>>(), [ROWS - 3, ROWS - 3]);
    assert!(file.repairs.iter().any(|r| r.lost && r.text.contains("'24' 6 ×")), "{:?}", file.repairs);
}

/// A clock that runs for another time than the date-times beside it is in another unit than it says, as WinCC's
/// `Time_ms`, which are days.
#[test]
fn two_clocks_of_one_table_must_agree() {
    let row = |per_s: f64| {
        move |i: usize, a: f64, b: f64| {
            let t = 0.1 * i as f64;
            format!("2026-03-14 09:26:{:06.3},{:.6},{a:.4},{b:.4}", 10.0 + t, per_s * t)
        }
    };
    let head = "TimeString,Time_ms,Valve (bar),Middle (bar)\n";
    let said = read(&table(head, row(11.574))).unwrap_err();
    assert!(said.contains("'Time_ms' runs for 0.0683 s, and 'TimeString' for 5.90 s"), "{said}");
    assert_eq!(read(&table(head, row(1e3))).unwrap().tracks.len(), 2);
}

/// Two remarks on the unit that differ contradict each other, wherever they stand.
#[test]
fn two_remarks_on_the_unit_must_agree() {
    let text = table("# unit: bar\ntime_s,Valve,Middle\n", |i, a, b| format!("{:.3},{a:.4},{b:.4}", 1e-3 * i as f64));
    holds("one", &read(&text).unwrap(), [("bar", 1.0), ("bar", 1.0)]);
    let said = read(&text.replace("\n0.030,", "\n# unit: psi\n0.030,")).unwrap_err();
    assert!(said.contains("'psi'") && said.contains("'bar'"), "{said}");
}

/// A remark among the samples that something changed is shown, and costs exit code 3; another one is shown.
#[test]
fn remarks_among_the_samples_are_shown() {
    let with = |remark: &str| {
        let row = |i: usize, a: f64, b: f64| {
            let remark = if i == 30 { format!("# {remark}\n") } else { String::new() };
            format!("{remark}{:.3},{a:.4},{b:.4}", 1e-3 * i as f64)
        };
        read(&table("time_s,Valve (bar),Middle (bar)\n", row)).unwrap()
    };
    for (remark, lost) in [("gain changed: values below must be doubled", true), ("valve closed by hand", false)] {
        let file = with(remark);
        assert!(
            file.repairs.iter().any(|r| r.lost == lost && r.line == Some(32) && r.text.contains(remark)),
            "{:?}",
            file.repairs
        );
    }
}
