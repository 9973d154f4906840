//! Recordings that come while the workbench is open: dropped on the page, or recorded.

use serde_json::json;

use crate::common::{CREEP, LEAK, here};
use crate::workbench::client::{Workbench, base64, done_in};

#[test]
fn a_messy_table_is_looked_at_then_imported_and_opened() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::copy(here(LEAK), folder.path().join("run.mcap")).unwrap();
    done_in(folder.path(), &["export", "run.mcap", "-o", "plain.csv"]);
    let plain = std::fs::read_to_string(folder.path().join("plain.csv")).unwrap();
    let lines: Vec<&str> = plain.lines().filter(|line| !line.starts_with('#')).collect();
    let columns = lines[0].split(',').count();
    // decimal commas, another name for a sensor, a line of remarks
    let messy: String = std::iter::once(
        "Zeit [s];".to_owned() + &lines[0].split_once(',').unwrap().1.replace(',', ";").replace("P1", "Druck1") + "\n",
    )
    .chain(lines[1..].iter().map(|line| line.replace(',', ";").replace('.', ",") + "\n"))
    .collect();
    let bench = Workbench::open(folder.path(), &["run.mcap"]);
    bench.fitted();
    let dropped = |map: serde_json::Value, accept: bool| json!({ "name": "../messy.csv", "content": base64(messy.as_bytes()), "map": map, "accept": accept });
    let looked = bench.post("/api/import", &dropped(json!([["Druck1", "P1"]]), false), 200);
    assert!(looked["written"].is_null() && !folder.path().join("messy.mcap").exists());
    let sensors = looked["understood"]["sensors"].as_array().unwrap();
    assert!(
        sensors.iter().any(|s| s["sensor"] == "P1" && s["column"].as_str().unwrap().contains("Druck1")),
        "{looked}"
    );
    assert!(columns >= 2 && !looked["mended"].as_array().unwrap().is_empty(), "{looked}");

    let written = bench.post("/api/import", &dropped(json!([["Druck1", "P1"]]), true), 200);
    assert_eq!(written["written"], "messy.mcap");
    let state = bench.until("the import", |s| s["open"]["runs"][0]["name"] == "messy.mcap" && !s["model"].is_null());
    assert!(state["runs"].as_array().unwrap().iter().any(|run| run["name"] == "messy.mcap" && run["open"] == true));
    let again = bench.post("/api/import", &dropped(json!([["Druck1", "P1"]]), true), 200);
    assert_eq!(again["written"], "messy-2.mcap", "nothing is overwritten");
    // a file that comes during a job is opened after it
    bench.post("/api/diagnose", &json!({}), 202);
    let hidden = json!({ "name": ".hid\nden.csv", "content": base64(messy.as_bytes()), "map": [["Druck1", "P1"]], "accept": true });
    let during = bench.post("/api/import", &hidden, 200);
    assert_eq!(during["written"], "hidden.mcap");
    assert!(during["job"].is_null(), "{during}");
    bench.post("/api/cancel", &json!({}), 202);
    bench.until("the import", |s| s["open"]["runs"][0]["name"] == "hidden.mcap" && !s["model"].is_null());
    // what no sensor read is not shown as measured
    let narrow: String = lines.iter().map(|l| l.split(',').take(3).collect::<Vec<_>>().join(",") + "\n").collect();
    let narrow = json!({ "name": "narrow.csv", "content": base64(narrow.as_bytes()), "accept": true });
    assert_eq!(bench.post("/api/import", &narrow, 200)["written"], "narrow.mcap");
    let state = bench.until("the import", |s| s["open"]["runs"][0]["name"] == "narrow.mcap");
    assert!(state["open"]["runs"][0]["temperature_degC"].is_null(), "{state}");
    let refused =
        bench.post("/api/import", &json!({ "name": "x.csv", "content": base64(b"hello\n"), "accept": true }), 400);
    assert!(refused["error"].as_str().unwrap().len() > 10, "{refused}");
    // a file of another rig is read with the rig of one of its runs
    std::fs::copy(here(CREEP), folder.path().join("plastic.mcap")).unwrap();
    done_in(folder.path(), &["export", "plastic.mcap", "-o", "plastic.csv"]);
    let bench = Workbench::open(folder.path(), &["."]);
    let state = bench.until("the list", |s| s["runs"].as_array().is_some_and(|runs| runs.len() > 1));
    let named =
        |name: &str| state["runs"].as_array().unwrap().iter().find(|run| run["name"] == name).unwrap()["id"].clone();
    let content = base64(&std::fs::read(folder.path().join("plastic.csv")).unwrap());
    let of = |rig_of: serde_json::Value| json!({ "name": "p.csv", "content": content, "rig_of": rig_of });
    let sensors = |name: &str| bench.post("/api/import", &of(named(name)), 200)["sensors"].clone();
    assert_ne!(sensors("plastic.mcap"), sensors("run.mcap"));
    let understood = bench.post("/api/import", &of(named("plastic.mcap")), 200)["understood"]["sensors"].clone();
    assert_eq!(understood.as_array().unwrap().len(), 5, "{understood}");
    let refused = bench.post("/api/import", &of(json!("77")), 400);
    assert_eq!(refused["error"], "there is no such run");
    // a recording keeps its own rig, byte for byte
    let recording = std::fs::read(here(CREEP)).unwrap();
    let whole = |accept: bool| json!({ "name": "own.mcap", "content": base64(&recording), "accept": accept });
    let looked = bench.post("/api/import", &whole(false), 200);
    assert_eq!((looked["as_it_is"].as_bool(), looked["rig"].as_str()), (Some(true), Some("hdpe-creep")), "{looked}");
    bench.post("/api/import", &whole(true), 200);
    assert!(std::fs::read(folder.path().join("own.mcap")).unwrap() == recording);
    // one bad cell is named, whatever else the file lacks
    let bad = json!({ "name": "bad.csv", "content": base64(b"time_s,P1\n0,1.5\n0.001,n.a\n0.002,1.6\n") });
    let refused = bench.post("/api/import", &bad, 400)["error"].as_str().unwrap().to_owned();
    assert!(refused.contains("'n.a' is not a number"), "{refused}");
    let text = json!({ "name": "x.mcap", "content": base64(messy.as_bytes()), "accept": false });
    let refused = bench.post("/api/import", &text, 400);
    assert_eq!(refused["error"], "x.mcap is not an MCAP file");
}

/// Two loggers of one closure, each with a sensor of its own: dropped together they become what `import A B` makes of
/// them.
#[test]
fn two_files_of_one_closure_are_joined_as_the_command_joins_them() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::copy(here(CREEP), folder.path().join("run.mcap")).unwrap();
    done_in(folder.path(), &["export", "run.mcap", "-o", "whole.csv"]);
    let whole = std::fs::read_to_string(folder.path().join("whole.csv")).unwrap();
    let lines: Vec<Vec<&str>> =
        whole.lines().filter(|line| !line.starts_with('#')).map(|line| line.split(',').collect()).collect();
    let names = lines[0].clone();
    let second = names.iter().position(|name| *name == "P2").unwrap();
    // the second logger started 2.5 s before the first
    let of = |own: &dyn Fn(usize) -> bool, later_s: f64, start: &str| {
        let row = |(i, cells): (usize, &Vec<&str>)| {
            let time =
                if i == 0 { cells[0].to_owned() } else { format!("{:.6}", cells[0].parse::<f64>().unwrap() + later_s) };
            let rest = (1..cells.len()).filter(|&c| own(c)).map(|c| format!(",{}", cells[c]));
            let row = time + &rest.collect::<String>() + "\n";
            (row.trim_end().trim_end_matches(',').contains(',')).then_some(row)
        };
        format!("# start: 2026-03-14T09:26:{start}Z\n") + &lines.iter().enumerate().filter_map(row).collect::<String>()
    };
    let files = [("one.csv", of(&|c| c != second, 0.0, "53.5")), ("two.csv", of(&|c| c == second, 2.5, "51.0"))];
    for (name, text) in &files {
        std::fs::write(folder.path().join(name), text).unwrap();
    }
    let bench = Workbench::open(folder.path(), &["run.mcap"]);
    bench.fitted();
    let file = |i: usize| json!({ "name": files[i].0, "content": base64(files[i].1.as_bytes()) });
    let dropped = |accept: bool| json!({ "name": files[0].0, "content": file(0)["content"], "further": [file(1)], "accept": accept });
    let looked = bench.post("/api/import", &dropped(false), 200);
    assert!(looked["problem"].is_null(), "{looked}");
    let seen: Vec<&str> =
        looked["understood"]["sensors"].as_array().unwrap().iter().map(|s| s["sensor"].as_str().unwrap()).collect();
    assert!(names[1..].iter().all(|name| seen.iter().filter(|s| s == &name).count() == 1), "{seen:?}");
    let said = looked["joined"][0].as_str().unwrap();
    assert!(said.starts_with("two.csv: aligned by the front"), "{said}");
    let by_time = json!({ "name": files[0].0, "content": file(0)["content"], "further": [file(1)], "align": "time" });
    let said = bench.post("/api/import", &by_time, 200)["joined"][0].as_str().unwrap().to_owned();
    assert!(said.starts_with("two.csv: aligned by absolute time: time 0 s is at -2.5"), "{said}");
    assert_eq!(bench.post("/api/import", &dropped(true), 200)["written"], "one.mcap");
    let rig = here("rigs/demo-hdpe.toml");
    done_in(folder.path(), &["import", "one.csv", "two.csv", "--rig", rig.to_str().unwrap(), "-o", "by-command.mcap"]);
    let read = |name: &str| surgescope::storage::read(&folder.path().join(name)).unwrap();
    assert_eq!(read("one.mcap").series, read("by-command.mcap").series);
    // two runs are no parts of one; a copy is
    let with = |other: String| json!({ "name": "a.csv", "content": file(0)["content"], "further": [{ "name": "b.csv", "content": base64(other.as_bytes()) }] });
    assert!(bench.post("/api/import", &with(files[0].1.clone()), 200)["problem"].is_null());
    let changed = |line: &str| {
        line.split_once(',').map_or(line.to_owned(), |(time, rest)| format!("{time},{}", rest.replace(".1", ".2")))
    };
    let of_another_run = files[0].1.lines().map(|line| changed(line) + "\n").collect();
    let problem = bench.post("/api/import", &with(of_another_run), 200)["problem"].as_str().unwrap().to_owned();
    assert!(problem.contains("at the same times") && problem.contains("import each alone"), "{problem}");
    assert!(!problem.contains("option `"), "{problem}");
    // a recording goes with no other file
    let recording = base64(&std::fs::read(here(CREEP)).unwrap());
    let mixed = json!({ "name": "a.csv", "content": file(0)["content"], "further": [{ "name": "b.mcap", "content": recording }] });
    let refused = bench.post("/api/import", &mixed, 400)["error"].as_str().unwrap().to_owned();
    assert!(refused.starts_with("b.mcap is a whole recording"), "{refused}");
}

#[cfg(unix)]
#[test]
fn a_simulated_shot_is_recorded_live_and_diagnosed_by_itself() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::copy(here(LEAK), folder.path().join("run.mcap")).unwrap();
    let bench = Workbench::open(folder.path(), &["run.mcap"]);
    bench.fitted();
    let mut events = bench.events();
    let wanted = json!({
        "simulate": true, "effects": ["leak"], "set": { "leak_position_m": 20.0 }, "rate_hz": 500.0, "duration_s": 2.0,
    });
    let started = bench.post("/api/record", &wanted, 202);
    assert_eq!(started["running"], true);
    let again = bench.post("/api/record", &wanted, 400);
    assert!(again["error"].as_str().unwrap().contains("running"), "{again}");
    let (_, live) = events.find(|(name, data)| name == "live" && data["samples"].as_u64() > Some(0)).unwrap();
    let sensor = &live["sensors"][0];
    assert!(sensor["trace"].as_array().is_some_and(|trace| !trace.is_empty()) && sensor["level"].is_number(), "{live}");
    // what turns its values into the heads that the page may show them as: the model's, at the rig file's temperature
    let (rig, open) = (&bench.state()["recording"]["rig"], &bench.state()["open"]);
    let own = &rig["heads"][sensor["name"].as_str().unwrap()];
    let model = &open["runs"][0]["sensors"][0];
    assert_eq!((&rig["name"], &own["symbol"]), (&open["rig"]["name"], &sensor["unit"]));
    let per_m = |of: &serde_json::Value| of["per_m"].as_f64().unwrap();
    assert!((per_m(own) / per_m(&model["unit"]) - 1.0).abs() < 0.01, "{rig} {model}");
    let (_, found) = events.find(|(name, _)| name == "diagnosis").expect("a diagnosis");
    assert!(found["candidates"].as_array().is_some_and(|all| !all.is_empty()), "{found}");
    let state = bench.until("the end", |state| state["job"].is_null());
    let ended = &state["recording"]["ended"];
    assert_eq!((&state["recording"]["running"], &ended["data_lost"]), (&json!(false), &json!(false)), "{ended}");
    assert_ne!(state["open"]["runs"][0]["name"], "run.mcap", "the new recording is open");
    let file = std::path::Path::new(ended["file"].as_str().unwrap()).file_name().unwrap().to_str().unwrap();
    assert!(done_in(folder.path(), &["inspect", file]).is_object());
}

/// A rig file may come from anybody: what it starts is shown, and started only when the person agrees to just that.
#[cfg(unix)]
#[test]
fn a_command_is_started_only_when_it_was_seen_and_agreed_to() {
    use std::fmt::Write as _;
    let folder = tempfile::tempdir().unwrap();
    let mut rig = std::fs::read_to_string(here("rigs/paper-ppr.toml")).unwrap();
    let sensor = rig.find("kind = \"pressure\"").unwrap();
    rig.insert_str(sensor, "device = \"daq\"\nchannel = 0\n");
    let script = "touch started; i=0; while [ $i -lt 200 ]; do echo $((i * 1000)),$((300 + i)); i=$((i + 1)); done";
    let words = json!(["sh", "-c", script]);
    let _ = write!(rig, "\n[[device]]\nname = \"daq\"\nprotocol = \"lines\"\ncommand = [\"sh\", \"-c\", '{script}']\n");
    std::fs::write(folder.path().join("rig.toml"), &rig).unwrap();
    let started = || folder.path().join("started").exists();

    let bench = Workbench::open(folder.path(), &["rig.toml"]);
    let shown = &bench.state()["commands"][0];
    assert_eq!((&shown["device"], &shown["words"]), (&json!("daq"), &words));
    assert!(shown["shown"].as_str().unwrap().contains("touch started"), "{shown}");
    for wanted in
        [json!({}), json!({ "commands": { "daq": ["sh", "-c", "true"] } }), json!({ "commands": { "doq": words } })]
    {
        let refused = bench.post("/api/record", &wanted, 400)["error"].as_str().unwrap().to_owned();
        assert!(refused.contains("device 'daq' starts the program `sh -c") && refused.contains("agree"), "{refused}");
    }
    assert!(!started());
    bench.post("/api/record", &json!({ "commands": { "daq": words } }), 202);
    let state = bench.until("the end", |state| state["recording"]["running"] == false);
    assert!(started() && state["recording"]["ended"]["file"].is_string(), "{}", state["recording"]);
    std::fs::remove_file(folder.path().join("started")).unwrap();

    // the same rig in a recording, as it may come by mail: nothing is shown to agree to, and nothing is started
    let mailed = tempfile::tempdir().unwrap();
    let rig_file = folder.path().join("rig.toml");
    let rig_file = rig_file.to_str().unwrap();
    done_in(
        mailed.path(),
        &["simulate", "--rig", rig_file, "--set", "initial_velocity_m_s=0.5", "--seed", "1", "-o", "mailed.mcap"],
    );
    let bench = Workbench::open(mailed.path(), &["mailed.mcap"]);
    let state = bench.fitted();
    let refused = bench.post("/api/record", &json!({ "commands": { "daq": words } }), 400);
    assert_eq!(state["commands"], json!([]));
    assert!(refused["error"].as_str().unwrap().contains("did not come from a rig file"), "{refused}");
    assert!(!started() && !mailed.path().join("started").exists());
}
