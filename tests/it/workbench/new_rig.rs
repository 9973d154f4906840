//! A rig made from a table and the answers of a form: what is written is what the commands write, and a refusal writes
//! nothing.

use std::collections::BTreeSet;
use std::path::Path;

use serde_json::{Value, json};

use crate::common::{LEAK, here};
use crate::workbench::client::{Workbench, base64, done_in};

const LOGGER: &str = "recordings/logger.csv";

/// Names of the files in a folder.
fn files(folder: &Path) -> BTreeSet<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect()
}

fn with_logger() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::copy(here(LOGGER), folder.path().join("logger.csv")).unwrap();
    folder
}

/// The answers that make a rig of the shipped table, some of them changed.
fn answers(changed: &Value) -> Value {
    let mut form = json!({
        "material": "copper", "length": "100", "size": "22x1.5", "temperature": "18", "reading": { "time_unit": "ms" }, "name": "rig",
    });
    form.as_object_mut().unwrap().extend(changed.as_object().unwrap().clone());
    form
}

fn asked(bench: &Workbench, table: &str, form: &Value) -> Value {
    bench.post("/api/new-rig", &json!({ "table": table, "form": form }), 200)
}

fn accepted(bench: &Workbench, table: &str, form: &Value, expected: u16) -> Value {
    bench.post("/api/new-rig", &json!({ "table": table, "form": form, "accept": true }), expected)
}

/// The message beside a field, and its weight.
fn remark<'a>(answer: &'a Value, field: &str) -> Option<(&'a str, &'a str)> {
    let all = answer["remarks"].as_array().unwrap();
    let of_field = all.iter().find(|remark| remark["field"] == field)?;
    Some((of_field["weight"].as_str().unwrap(), of_field["says"].as_str().unwrap()))
}

#[test]
fn a_table_and_answers_become_the_rig_the_recording_and_the_fit_of_the_commands() {
    let folder = with_logger();
    let bench = Workbench::open(folder.path(), &["logger.csv"]);
    let state = bench.state();
    assert_eq!((&state["table"], &state["open"], &state["runs"]), (&json!("logger.csv"), &Value::Null, &json!([])));
    let empty = asked(&bench, "logger.csv", &json!({}));
    let kinds: Vec<&str> =
        empty["columns"].as_array().unwrap().iter().map(|c| c["is"].as_str().unwrap_or("none")).collect();
    assert_eq!(kinds, ["pressure", "pressure", "flow"], "{empty}");
    let table = std::fs::read_to_string(folder.path().join("logger.csv")).unwrap();
    let first: f64 = table.lines().nth(4).unwrap().split(';').nth(2).unwrap().parse().unwrap();
    assert_eq!((&empty["columns"][0]["unit"], &empty["columns"][0]["first"][0]), (&json!("bar"), &json!(first)));
    for field in ["material", "length", "size", "time_unit"] {
        assert_eq!(remark(&empty, field).unwrap().0, "open", "{field}: {empty}");
    }
    assert!(remark(&empty, "time_unit").unwrap().1.contains("in ms") && empty["rig"].is_null());

    let form = answers(&json!({}));
    let looked = asked(&bench, "logger.csv", &form);
    assert!(looked["rig"]["text"].is_string() && looked["written"].is_null(), "{looked}");
    assert!(looked["understood"].to_string().contains("Sample"), "{looked}");
    assert_eq!(looked["writes"], json!(["rig.toml", "logger.mcap"]));
    // what is not said is taken with its reason, and never as said
    assert!(remark(&looked, "columns.1.place").unwrap().1.contains("measure it"), "{looked}");
    assert_eq!(remark(&looked, "supply").unwrap().0, "assumed");
    assert!(remark(&looked, "temperature").is_none());
    assert_eq!(looked["pipe"]["inner_diameter_mm"], 19.0);
    assert!((looked["columns"][1]["position_m"].as_f64().unwrap() - 62.0).abs() < 0.5, "{looked}");
    assert_eq!(files(folder.path()), BTreeSet::from(["logger.csv".to_owned()]));

    let written = accepted(&bench, "logger.csv", &form, 200);
    assert_eq!(written["written"], json!(["rig.toml", "logger.mcap"]));
    let state = bench.fitted();
    assert_eq!(state["open"]["runs"][0]["name"], "logger.mcap");

    let pipe = ["--material", "copper", "--length-m", "100", "--pipe", "22x1.5", "--temperature-degC", "18"];
    let new = [&["rig", "new", "logger.csv", "--yes", "--name", "rig", "-o", "by-command.toml"], &pipe[..]].concat();
    assert_eq!(done_in(folder.path(), &new)["doubts"], looked["rig"]["doubts"]);
    let text = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
    assert_eq!(text("rig.toml"), text("by-command.toml"));
    let import = ["import", "logger.csv", "--rig", "by-command.toml", "--yes", "-o", "by-command.mcap"];
    done_in(folder.path(), &import);
    let fit = done_in(folder.path(), &["calibrate", "by-command.mcap", "--effects", "none"]);
    let [own, by_command] = [&state["model"]["rmse_m"], &fit["runs"][0]["rmse_m"]].map(|v| v.as_f64().unwrap());
    assert!((own / by_command - 1.0).abs() < 1e-6, "{own} m on the page, {by_command} m by the commands");

    // the pipe has a leak 35 m from the supply
    bench.job("/api/add", &json!({ "effect": "leak" }));
    let model = bench.state()["model"].clone();
    let [rmse_m, noise_m] = ["rmse_m", "noise_m"].map(|name| model[name].as_f64().unwrap());
    assert!(rmse_m < 1.2 * noise_m, "{rmse_m} m with the leak, noise {noise_m} m");
    let parameters = model["parameters"].as_array().unwrap();
    let place_m = parameters.iter().find(|p| p["name"] == "leak_position_m").unwrap()["value"].as_f64().unwrap();
    assert!((place_m - 35.0).abs() < 0.1, "{place_m} m");
}

#[test]
fn what_is_wrong_or_missing_is_said_beside_its_field_and_nothing_is_written() {
    let folder = with_logger();
    std::fs::write(folder.path().join("bare.csv"), "time_s,P1,P2\n0,250,251\n0.1,252,250\n0.2,251,250\n").unwrap();
    let bench = Workbench::open(folder.path(), &["."]);
    assert_eq!(bench.state()["tables"], json!(["bare.csv", "logger.csv"]));
    let before = files(folder.path());
    let column = |column: &str, key: &str, value: &str| json!({ "columns": [{ "column": column, key: value }] });
    let valve = asked(&bench, "logger.csv", &json!({}))["columns"][0]["name"].as_str().unwrap().to_owned();
    let named: Vec<Value> = (asked(&bench, "logger.csv", &json!({}))["columns"].as_array().unwrap().iter())
        .map(|column| json!({ "column": column["name"], "is": "none" }))
        .collect();
    assert_eq!(named.len(), 3);
    for (changed, field, weight, words) in [
        (json!({ "material": "" }), "material", "open", "needed"),
        (json!({ "material": "coper" }), "material", "wrong", "did you mean copper?"),
        (json!({ "length": "" }), "length", "open", "needed"),
        (json!({ "length": "0" }), "length", "wrong", "from 0.1"),
        (json!({ "length": "80 furlongs" }), "length", "wrong", "furlongs"),
        (json!({ "size": "7" }), "size", "wrong", "63 SDR11"),
        (json!({ "size": "" }), "size", "open", "inner diameter"),
        (json!({ "wall": "2" }), "size", "wrong", "either the size"),
        (json!({ "size": "", "wall": "2" }), "inner_diameter", "open", "needed"),
        (json!({ "size": "", "wall": "20", "inner_diameter": "19" }), "wall", "wrong", "from 0.01 to 19 mm"),
        (json!({ "supply": "well" }), "supply", "wrong", "reservoir or pump"),
        (json!({ "temperature": "200" }), "temperature", "wrong", "from 0 to 100"),
        (json!({ "closing_time": "soon" }), "closing_time", "wrong", "soon"),
        (json!({ "flow": "0.25 L/s" }), "flow", "wrong", "flow already"),
        (json!({ "reading": {} }), "time_unit", "open", "in ms"),
        (json!({ "reading": { "time_unit": "weeks" } }), "time_unit", "wrong", "must be s, ms"),
        (column(&valve, "place", "101"), "columns.0.place", "wrong", "from 0 to 100 m"),
        (column(&valve, "unit", "L/s"), "columns.0.unit", "wrong", "no unit of a pressure"),
        (column(&valve, "unit", "1..5 -> 0..10"), "columns.0.unit", "wrong", "unit of the result"),
        (column(&valve, "unit", "1 to 5"), "columns.0.unit", "wrong", "1..5 -> 0..10 bar"),
        (column(&valve, "is", "gauge"), "columns.0.is", "wrong", "choose"),
        (json!({ "columns": named }), "columns", "open", "No column is a pressure"),
    ] {
        let form = answers(&changed);
        let looked = asked(&bench, "logger.csv", &form);
        let (found, says) = remark(&looked, field).unwrap_or_else(|| panic!("{changed}: nothing of {field}: {looked}"));
        assert!(found == weight && says.contains(words) && looked["rig"].is_null(), "{changed}: {looked}");
        let refused = accepted(&bench, "logger.csv", &form, 400);
        let why = refused["error"].as_str().unwrap();
        assert!(why.contains("nothing was written") && why.contains(words), "{changed}: {refused}");
    }
    // a unit that nobody states is asked for, with what speaks for which
    let bare = answers(&json!({ "reading": {} }));
    let looked = asked(&bench, "bare.csv", &bare);
    let (weight, says) = remark(&looked, "columns.0.unit").unwrap();
    assert!(weight == "open" && says.contains("no unit is stated"), "{looked}");
    accepted(&bench, "bare.csv", &bare, 400);
    let refused = accepted(&bench, "../logger.csv", &answers(&json!({})), 400);
    assert!(refused["error"].as_str().unwrap().contains("no such table"), "{refused}");
    accepted(&bench, "logger.csv", &json!({ "lenght": "100" }), 400);
    assert_eq!(files(folder.path()), before);
    assert!(bench.state()["open"].is_null());
}

#[test]
fn a_table_that_was_dropped_is_asked_for_its_rate_and_ranges_and_replaces_nothing() {
    let folder = with_logger();
    let plain = std::fs::read_to_string(folder.path().join("logger.csv")).unwrap();
    let rows = plain.lines().skip(4).enumerate().map(|(i, line)| {
        let bar: f64 = line.split(';').nth(2).unwrap().parse().unwrap();
        format!("{i},{:.5}\n", 1.0 + 0.2 * bar)
    });
    let volts = format!("sample,ch0_V\n{}", rows.collect::<String>());
    for name in ["logger.csv", "rig.toml", "volts.mcap"] {
        std::fs::write(folder.path().join(name), "not to be replaced").unwrap();
    }
    std::fs::remove_file(folder.path().join("volts.mcap")).unwrap();
    let bench = Workbench::open(folder.path(), &["."]);
    std::fs::write(folder.path().join("volts.mcap"), "not to be replaced").unwrap();
    let dropped = bench.post("/api/import", &json!({ "name": "volts.csv", "content": base64(volts.as_bytes()) }), 200);
    assert_eq!(dropped, json!({ "needs_rig": "volts.csv", "further": [] }));
    // what an error of the library names by an option, the page names by its field
    let unread = asked(&bench, "volts.csv", &answers(&json!({ "reading": {} })));
    let (_, says) = remark(&unread, "file").unwrap();
    assert!(says.contains("the field “samples per second”") && says.starts_with("volts.csv"), "{says}");
    assert_eq!(remark(&unread, "rate").unwrap().0, "open");
    let rated = json!({ "reading": { "rate": "1000" } });
    let looked = asked(&bench, "volts.csv", &answers(&rated));
    assert_eq!(remark(&looked, "columns").unwrap().0, "open", "{looked}");
    let name = looked["columns"][0]["name"].clone();
    let pressure = json!({ "reading": { "rate": "1000" }, "flow": "11.15 L/min", "columns": [{ "column": name, "is": "pressure" }] });
    let looked = asked(&bench, "volts.csv", &answers(&pressure));
    let (weight, says) = remark(&looked, "columns.0.unit").unwrap();
    assert!(weight == "open" && says.contains("'V'"), "volts are no pressure by themselves: {looked}");
    let ranged = json!({ "reading": { "rate": "1000" }, "flow": "11.15 L/min",
        "columns": [{ "column": name, "is": "pressure", "unit": "1..5 -> 0..20 bar", "place": "100" }] });
    let written = accepted(&bench, "volts.csv", &answers(&ranged), 200);
    assert_eq!(written["written"], json!(["rig-2.toml", "volts-2.mcap"]));
    let state = bench.fitted();
    assert_eq!(state["open"]["runs"][0]["name"], "volts-2.mcap");
    for name in ["rig.toml", "volts.mcap"] {
        assert_eq!(std::fs::read_to_string(folder.path().join(name)).unwrap(), "not to be replaced");
    }
    let seen = done_in(folder.path(), &["inspect", "volts-2.mcap"]);
    // 11.15 L/min in 19 mm
    let velocity = seen["steady_velocity_m_s"]["value"].as_f64().unwrap();
    assert!((velocity - 0.6554).abs() < 1e-3, "{velocity}");
}

/// Pressures that cannot be are taken no more than by `import`, on a rig that is there as on one that is made.
#[test]
fn readings_that_cannot_be_are_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::copy(here(LEAK), folder.path().join("run.mcap")).unwrap();
    done_in(folder.path(), &["export", "run.mcap", "-o", "plain.csv"]);
    let plain = std::fs::read_to_string(folder.path().join("plain.csv")).unwrap();
    let mut lines = plain.lines().filter(|line| !line.starts_with('#'));
    let heading = lines.next().unwrap();
    let valve = heading.split(',').position(|name| name == "P2").unwrap();
    let turned = lines.map(|line| {
        let cells = line.split(',').enumerate();
        let cell =
            |(i, cell): (usize, &str)| if i == valve { format!("-{cell}").replace("--", "") } else { cell.into() };
        cells.map(cell).collect::<Vec<String>>().join(",") + "\n"
    });
    let content = base64(format!("{heading}\n{}", turned.collect::<String>()).as_bytes());
    let bench = Workbench::open(folder.path(), &["run.mcap"]);
    bench.fitted();
    let dropped = |scales: Value, accept: bool| json!({ "name": "turned.csv", "content": content, "scales": scales, "accept": accept });
    let looked = bench.post("/api/import", &dropped(json!([]), false), 200);
    let problem = looked["problem"].as_str().unwrap();
    assert!(problem.contains("sensor P2 is") && !problem.contains("option `"), "{looked}");
    bench.post("/api/import", &dropped(json!([]), true), 400);
    assert!(!folder.path().join("turned.mcap").exists());
    bench.post("/api/import", &dropped(json!([["P2", "-1*x m(H2O)"]]), true), 200);
    assert!(folder.path().join("turned.mcap").exists());
}

/// What a file leaves open is a field of the page, and what is written there counts.
#[test]
fn the_order_of_day_and_month_of_a_dropped_table_is_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::copy(here(LEAK), folder.path().join("run.mcap")).unwrap();
    done_in(folder.path(), &["export", "run.mcap", "-o", "plain.csv"]);
    let plain = std::fs::read_to_string(folder.path().join("plain.csv")).unwrap();
    let mut lines = plain.lines().filter(|line| !line.starts_with('#'));
    let mut table = lines.next().unwrap().replace("time_s", "time") + "\n";
    for line in lines {
        let (time_s, rest) = line.split_once(',').unwrap();
        let time_s = time_s.parse::<f64>().unwrap() + 10.0;
        table += &format!("03/04/2026 10:{:02}:{:09.6},{rest}\n", (time_s / 60.0) as u32, time_s % 60.0);
    }
    let bench = Workbench::open(folder.path(), &["run.mcap"]);
    bench.fitted();
    let content = base64(table.as_bytes());
    let dropped = |reading: Value, accept: bool| json!({ "name": "dated.csv", "content": content, "reading": reading, "accept": accept });
    let looked = bench.post("/api/import", &dropped(json!({}), false), 200);
    let (weight, says) = remark(&looked, "date_order").unwrap();
    assert!(weight == "open" && says.contains("03/04/2026"), "{looked}");
    assert!(!looked.to_string().contains("option `"), "{looked}");
    let answered = bench.post("/api/import", &dropped(json!({ "date_order": "mdy" }), false), 200);
    assert!(remark(&answered, "date_order").is_none(), "{answered}");
    let wrong = bench.post("/api/import", &dropped(json!({ "date_order": "ymd" }), true), 400);
    assert!(wrong["error"].as_str().unwrap().contains("day or month first"), "{wrong}");
    assert!(!folder.path().join("dated.mcap").exists());
    bench.post("/api/import", &dropped(json!({ "date_order": "mdy", "zone": "+01:00" }), true), 200);
    let state = bench.until("the import", |s| s["open"]["runs"][0]["name"] == "dated.mcap" && !s["model"].is_null());
    let recorded = state["open"]["runs"][0]["recorded_at"].as_str().unwrap();
    assert!(recorded.starts_with("2026-03-04T09:00:"), "{recorded}");
}

/// The shipped table in two: by its sensors with the same times, or one half after the other.
fn in_two(by_sensors: bool) -> [String; 2] {
    let table = std::fs::read_to_string(here(LOGGER)).unwrap();
    let lines: Vec<Vec<&str>> = table.lines().skip(3).map(|line| line.split(';').collect()).collect();
    // sample, time, valve, middle, flow
    let of = |rows: &[Vec<&str>], columns: &[usize]| -> String {
        let line = |cells: &Vec<&str>| columns.iter().map(|i| cells[*i]).collect::<Vec<_>>().join(";") + "\n";
        rows.iter().map(line).collect()
    };
    if by_sensors {
        [of(&lines, &[1, 2, 4]), of(&lines, &[1, 3])]
    } else {
        let all = [1, 2, 3, 4];
        let half = lines.len() / 2;
        [of(&lines[..half], &all), of(&lines[..1], &all) + &of(&lines[half..], &all)]
    }
}

#[test]
fn tables_of_one_closure_are_joined_as_the_commands_join_them() {
    for (by_sensors, dropped) in [(true, false), (false, false), (true, true)] {
        let folder = tempfile::tempdir().unwrap();
        let [first, second] = in_two(by_sensors);
        std::fs::write(folder.path().join("a.csv"), &first).unwrap();
        std::fs::write(folder.path().join("b.csv"), &second).unwrap();
        let pipe = ["--material", "copper", "--length-m", "100", "--pipe", "22x1.5", "--temperature-degC", "18"];
        let new = ["rig", "new", "a.csv", "b.csv", "--yes", "--time-unit", "ms", "-o", "../by-command.toml"];
        let place = folder.path().join("own");
        std::fs::create_dir(&place).unwrap();
        for name in ["a.csv", "b.csv"] {
            std::fs::rename(folder.path().join(name), place.join(name)).unwrap();
        }
        done_in(&place, &[&new[..], &pipe[..]].concat());
        let import = [
            "import",
            "a.csv",
            "b.csv",
            "--rig",
            "../by-command.toml",
            "--time-unit",
            "ms",
            "-o",
            "../by-command.mcap",
        ];
        done_in(&place, &import);
        let bench = Workbench::open(&place, &["."]);
        if dropped {
            std::fs::remove_file(place.join("a.csv")).unwrap();
            std::fs::remove_file(place.join("b.csv")).unwrap();
            let further = json!([{ "name": "b.csv", "content": base64(second.as_bytes()) }]);
            let files = json!({ "name": "a.csv", "content": base64(first.as_bytes()), "further": further });
            let taken = bench.post("/api/import", &files, 200);
            assert_eq!(taken, json!({ "needs_rig": "a.csv", "further": ["b.csv"] }));
        }
        let form = answers(&json!({}));
        let alone = asked(&bench, "a.csv", &form);
        assert_eq!(alone["beside"], json!(["b.csv"]), "the other table is named");
        let both = |accept: bool| json!({ "table": "a.csv", "further": ["b.csv"], "form": form, "accept": accept });
        let looked = bench.post("/api/new-rig", &both(false), 200);
        assert_eq!(looked["columns"].as_array().unwrap().len(), 3, "{looked}");
        assert!(looked["understood"].to_string().contains("b.csv: a part of one record") || by_sensors, "{looked}");
        let written = bench.post("/api/new-rig", &both(true), 200);
        assert_eq!(written["written"], json!(["rig.toml", "a.mcap"]));
        bench.fitted();
        let summary = |folder: &Path, name: &str| {
            let seen = done_in(folder, &["inspect", name]);
            [seen["wave_speed_m_s"].clone(), seen["steady_velocity_m_s"].clone(), seen["sensors"].clone()]
        };
        assert_eq!(summary(&place, "a.mcap"), summary(folder.path(), "by-command.mcap"), "{by_sensors}");
    }
}

#[test]
fn tables_that_are_not_of_one_closure_are_refused_with_the_reason() {
    let folder = with_logger();
    std::fs::copy(here(LOGGER), folder.path().join("again.csv")).unwrap();
    let bench = Workbench::open(folder.path(), &["."]);
    let both = |accept: bool| json!({ "table": "logger.csv", "further": ["again.csv"], "form": answers(&json!({})), "accept": accept });
    let looked = bench.post("/api/new-rig", &both(false), 200);
    let (weight, says) = remark(&looked, "file").unwrap();
    assert!(weight == "wrong" && says.contains("again.csv") && says.contains("at the same times"), "{looked}");
    bench.post("/api/new-rig", &both(true), 400);
    assert_eq!(files(folder.path()).len(), 2, "nothing is written");
    // what the tables leave open is asked for all the same
    let unsaid = json!({ "table": "logger.csv", "further": ["again.csv"], "form": answers(&json!({ "reading": {} })) });
    let looked = bench.post("/api/new-rig", &unsaid, 200);
    assert_eq!(remark(&looked, "time_unit").unwrap().0, "open", "{looked}");
}
