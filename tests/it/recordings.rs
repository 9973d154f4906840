//! What a user relies on when recordings come and go: import, export, recovery, and words that help when the input is
//! bad.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;

use serde_json::Value;
use surgescope::recording::RunInfo;
use surgescope::rig::Rig;
use surgescope::storage as log;
use surgescope::storage::Writer;
use tempfile::TempDir;

use crate::common::{here, surgescope};

const CSV: &str =
    "time_s,P1,P2,Q1\n0.0000,431.25,4.312,1.50\n0.0005,431.30,4.310,\n0.0010,455.75,,\n0.0015,430.00,4.299,\n";

fn rig_text(name: &str, sensors: &[(&str, &str, &str)]) -> String {
    let mut text = format!(
        r#"name = "{name}"

[fluid]
name = "water"
temperature_degC = 20.0

[[pipe]]
name = "main"
length_m = 50.0
inner_diameter_mm = 20.0
wall_thickness_mm = 2.0
material = "copper"

[upstream]
kind = "reservoir"

[downstream]
kind = "valve"
closing_time_s = 0.1
"#
    );
    for (name, kind, unit) in sensors {
        text += &format!("\n[[sensor]]\nname = \"{name}\"\nkind = \"{kind}\"\nposition_m = 25.0\nunit = \"{unit}\"\n");
    }
    text
}

/// A folder with a rig file, in which commands run.
struct Bench {
    folder: TempDir,
}

impl Bench {
    fn new() -> Bench {
        let bench = Bench { folder: tempfile::tempdir().unwrap() };
        let sensors = [("P1", "pressure", "kPa"), ("P2", "pressure", "bar"), ("Q1", "flow", "m3/h")];
        bench.put("rig.toml", rig_text("bench", &sensors));
        bench
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn put(&self, name: &str, content: impl AsRef<[u8]>) {
        fs::write(self.path(name), content).unwrap();
    }

    fn get(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).unwrap()
    }

    fn run(&self, args: &str) -> Output {
        surgescope(args.split_whitespace()).current_dir(self.folder.path()).output().unwrap()
    }

    /// Runs a command that must end with `code`; what it printed.
    fn expect(&self, code: i32, args: &str) -> (String, String) {
        let output = self.run(args);
        let (out, err) = (String::from_utf8(output.stdout).unwrap(), String::from_utf8(output.stderr).unwrap());
        assert_eq!(output.status.code(), Some(code), "{args}\n{out}\n{err}");
        (out, err)
    }

    /// Runs a command that must refuse its input, in words that hold each of `words`, and leave no output.
    fn refuses(&self, args: &str, words: &[&str]) {
        let output = args.split_whitespace().skip_while(|a| *a != "-o").nth(1).unwrap();
        let existed = self.path(output).exists();
        let (out, err) = self.expect(2, args);
        assert!(out.is_empty(), "{out}");
        for word in words {
            assert!(err.contains(word), "'{word}' is not in: {err}");
        }
        assert!(!err.contains("panicked"), "{err}");
        assert_eq!(self.path(output).exists(), existed);
        let left = fs::read_dir(self.folder.path()).unwrap().filter_map(|e| e.unwrap().file_name().into_string().ok());
        assert_eq!(left.filter(|name| name.ends_with(".tmp")).count(), 0, "a temporary file stays behind");
    }

    fn imported(&self) -> Vec<u8> {
        self.put("run.csv", CSV);
        self.expect(0, "import run.csv --rig rig.toml -o run.mcap");
        self.get("run.mcap")
    }

    fn torn(&self, name: &str, samples: i64) -> PathBuf {
        let rig = Rig::load(&self.path("rig.toml")).unwrap();
        let path = self.path(name);
        let mut writer = Writer::create(&path, &rig, &RunInfo::default()).unwrap();
        for i in 0..samples {
            writer.sample(0, i * 500_000, 400.0 + i as f64).unwrap();
        }
        drop(writer);
        path
    }
}

fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap()
}

#[test]
fn import_and_export_give_the_file_back_byte_by_byte() {
    let bench = Bench::new();
    bench.imported();
    bench.expect(0, "export run.mcap -o again.csv");
    assert_eq!(String::from_utf8(bench.get("again.csv")).unwrap(), CSV);
    assert_eq!(log::read(&bench.path("run.mcap")).unwrap().rig.source.as_bytes(), bench.get("rig.toml"));
}

#[test]
fn import_does_not_depend_on_when_it_runs() {
    let bench = Bench::new();
    let first = bench.imported();
    bench.expect(0, "import run.csv --rig rig.toml -o second.mcap");
    assert_eq!(bench.get("second.mcap"), first);
    bench.expect(0, "import run.csv --rig rig.toml -o third.mcap --start 2026-03-14T09:26:53.5+01:00");
    let recording = log::read(&bench.path("third.mcap")).unwrap();
    assert_eq!(recording.run.start_unix_ns, 1_773_476_813_500_000_000);
    assert_eq!(recording.series[0].time_s[1], 0.0005);
}

#[test]
fn json_counts_what_there_is() {
    let bench = Bench::new();
    bench.put("run.csv", CSV);
    for command in
        ["import run.csv --rig rig.toml -o run.mcap", "export run.mcap -o again.csv", "recover run.mcap -o new.mcap"]
    {
        let document = json(&bench.expect(0, &format!("{command} --json")).0);
        assert_eq!(document["file"], command.split(' ').next_back().unwrap());
        assert_eq!(document["rig"], "bench");
        assert_eq!(document["duration_s"], 0.0015);
        let sensors = document["sensors"].as_array().unwrap();
        let counts: Vec<_> =
            sensors.iter().map(|s| (s["name"].as_str().unwrap(), s["samples"].as_u64().unwrap())).collect();
        assert_eq!(counts, [("P1", 4), ("P2", 3), ("Q1", 1)]);
        assert_eq!(sensors[0]["gaps"], 0);
    }
}

#[test]
fn an_empty_or_header_only_csv_is_refused() {
    let bench = Bench::new();
    bench.put("empty.csv", "");
    bench.refuses("import empty.csv --rig rig.toml -o x.mcap", &["empty.csv", "the file is empty", "time_s,P1,P2"]);
    bench.put("header.csv", "time_s,P1,P2,Q1\n");
    bench.refuses("import header.csv --rig rig.toml -o x.mcap", &["header.csv:1", "no line of samples"]);
}

#[test]
fn a_missing_column_is_named_with_those_that_are_there() {
    let bench = Bench::new();
    bench.put("run.csv", CSV.replace("P2", "p2"));
    let words = [
        "run.csv:1",
        "no column for the pressure sensor 'P2'",
        "time_s, P1, p2, Q1; did you mean 'p2'? Rename the column",
    ];
    bench.refuses("import run.csv --rig rig.toml -o x.mcap", &words);
}

#[test]
fn times_that_run_backwards_are_refused_and_the_mean_of_those_that_repeat_is_said() {
    let bench = Bench::new();
    bench.put("back.csv", CSV.replace("0.0015", "0.0007"));
    let words =
        ["back.csv:5", "0.0007 does not come after 0.0010 of line 4", "if another run begins here, split the file"];
    bench.refuses("import back.csv --rig rig.toml -o x.mcap", &words);
    bench.put("twice.csv", CSV.replace("0.0015", "0.0010"));
    let (_, err) = bench.expect(3, "import twice.csv --rig rig.toml -o twice.mcap");
    assert!(
        err.contains("twice.csv:5: 1 time occurs more than once with different values: the mean was taken"),
        "{err}"
    );
    assert_eq!(log::read(&bench.path("twice.mcap")).unwrap().series[0].value, [431.25, 431.3, 442.875]);
}

#[test]
fn text_and_ragged_lines_are_refused() {
    let bench = Bench::new();
    bench.put("text.csv", CSV.replace("455.75", "4 bar"));
    let words = ["text.csv:4", "column 'P1'", "4 bar", "not a number", "leave the cell empty"];
    bench.refuses("import text.csv --rig rig.toml -o x.mcap", &words);
    bench.put("ragged.csv", CSV.replace("455.75", "455,75"));
    bench.refuses("import ragged.csv --rig rig.toml -o x.mcap", &["ragged.csv:4", "5 cells where the header has 4"]);
    bench.put("latin1.csv", b"time_s,P1,P2,Q1\n0,1,2,\xb0\n");
    bench.refuses("import latin1.csv --rig rig.toml -o x.mcap", &["latin1.csv:2", "not UTF-8"]);
}

#[test]
fn the_rig_of_another_recording_is_refused() {
    let bench = Bench::new();
    bench.put("run.csv", CSV);
    bench.put("other.toml", rig_text("other", &[("PT101", "pressure", "kPa"), ("PT102", "pressure", "kPa")]));
    let words =
        ["no column for the pressure sensor 'PT101' of rig 'other'", "time_s, P1, P2, Q1", "the rig file of this test"];
    bench.refuses("import run.csv --rig other.toml -o x.mcap", &words);
}

#[test]
fn a_sensor_of_the_rig_that_was_not_recorded_must_be_said() {
    let bench = Bench::new();
    bench.put("run.csv", "time_s,P1,P2\n0.0,1,2\n0.1,1,2\n");
    bench.refuses("import run.csv --rig rig.toml -o x.mcap", &["the flow sensor 'Q1'", "--without Q1"]);
    bench.expect(0, "import run.csv --rig rig.toml -o x.mcap --without Q1");
    bench.expect(0, "export x.mcap -o again.csv");
    assert_eq!(bench.get("again.csv"), bench.get("run.csv"));
}

#[test]
fn files_that_are_not_there_and_folders_are_refused() {
    let bench = Bench::new();
    bench.refuses("import none.csv --rig rig.toml -o x.mcap", &["none.csv does not exist"]);
    bench.refuses("import . --rig rig.toml -o x.mcap", &["is a folder"]);
    bench.refuses("export none.mcap -o x.csv", &["none.mcap does not exist"]);
    bench.put("run.csv", CSV);
    bench.refuses("import run.csv --rig rig.toml -o no/such/x.mcap", &["the folder no/such does not exist"]);
}

#[test]
fn nothing_is_ever_overwritten() {
    let bench = Bench::new();
    bench.imported();
    bench.put("mine", "mine");
    for command in [
        "import run.csv --rig rig.toml -o mine",
        "export run.mcap -o mine",
        "recover run.mcap -o mine",
        "recover run.mcap -o run.mcap",
    ] {
        let before = bench.get("run.mcap");
        bench.refuses(command, &["exists already", "choose another name"]);
        assert_eq!((bench.get("mine"), bench.get("run.mcap")), (b"mine".to_vec(), before));
    }
}

#[test]
fn a_file_that_is_no_recording_is_refused() {
    let bench = Bench::new();
    bench.put("run.csv", CSV);
    bench.refuses("export run.csv -o x.csv", &["run.csv is not an MCAP file", "surgescope import"]);
    bench.put("empty.mcap", "");
    bench.refuses("export empty.mcap -o x.csv", &["empty.mcap is not an MCAP file", "it is empty"]);
}

#[test]
fn an_mcap_of_another_program_is_refused() {
    let bench = Bench::new();
    let mut other = mcap::Writer::new(fs::File::create(bench.path("camera.mcap")).unwrap()).unwrap();
    let channel = other.add_channel(0, "/camera", "json", &Default::default()).unwrap();
    let header = mcap::records::MessageHeader { channel_id: channel, sequence: 0, log_time: 1, publish_time: 1 };
    other.write_to_known_channel(&header, b"{}").unwrap();
    other.finish().unwrap();
    let words = ["camera.mcap is an MCAP file, but not a surgescope recording", "rig.toml"];
    bench.refuses("export camera.mcap -o x.csv", &words);
    bench.refuses("recover camera.mcap -o x.mcap", &words);
}

#[test]
fn a_cut_recording_is_refused_and_recovered() {
    let bench = Bench::new();
    let bytes = bench.imported();
    bench.put("cut.mcap", &bytes[..bytes.len() - 100]);
    bench.refuses("export cut.mcap -o x.csv", &["cut.mcap has no end", "surgescope recover cut.mcap"]);
    let torn = bench.torn("torn.mcap", 1000);
    let before = bench.get("torn.mcap");
    bench.refuses("export torn.mcap -o x.csv", &["torn.mcap has no end", "surgescope recover torn.mcap"]);
    let (out, err) = bench.expect(3, "recover torn.mcap -o saved.mcap");
    assert!(out.contains("P1: 1000 samples") && out.contains("last good sample: 0.4995 s"), "{out}");
    assert!(err.contains("has no end"), "{err}");
    assert_eq!(fs::read(&torn).unwrap(), before, "the torn file stays as it is");
    let saved = log::read(&bench.path("saved.mcap")).unwrap();
    assert_eq!(saved.series[0].value[999], 1399.0);
    assert!(saved.run.notes.iter().any(|(key, _)| key == "lost before recovery"));

    bench.put("torn2.mcap", &before[..before.len() - 1]);
    let document = json(&bench.expect(3, "recover torn2.mcap -o saved2.mcap --json").0);
    assert_eq!(document["whole"], false);
    let (lost, kept) = (document["bytes_lost"].as_u64().unwrap(), document["sensors"][0]["samples"].as_u64().unwrap());
    assert!(lost > 0 && lost < 16_000 && kept > 600 && kept < 1000, "{document}");
    assert_eq!(document["lost"][0]["reason"], "the file ends within a record");
    bench.expect(0, "recover saved.mcap -o copy.mcap");
}

#[test]
fn a_damaged_recording_is_refused_and_the_rest_recovered() {
    let bench = Bench::new();
    let mut bytes = bench.imported();
    let place = find(&bytes, b"zstd") + 40;
    bytes[place] ^= 0x10;
    bench.put("bad.mcap", &bytes);
    bench.refuses("export bad.mcap -o x.csv", &["bad.mcap is damaged", "surgescope recover bad.mcap"]);
    let document = json(&bench.expect(3, "recover bad.mcap -o saved.mcap --json").0);
    assert!(document["bytes_lost"].as_u64().unwrap() > 0, "{document}");
}

#[test]
fn a_recording_whose_channel_is_not_in_its_rig_is_refused() {
    let bench = Bench::new();
    let other = rig_text("other", &[("P1", "pressure", "kPa"), ("P9", "pressure", "bar"), ("Q1", "flow", "m3/h")]);
    swap_rig(&bench, "p9.mcap", &other);
    bench.refuses(
        "export p9.mcap -o x.csv",
        &["samples of 'P2', which its own rig file lacks", "P1, P9, Q1", "did it mean 'P1'?"],
    );
    swap_rig(
        &bench,
        "unit.mcap",
        &rig_text("u", &[("P1", "pressure", "kPa"), ("P2", "pressure", "kPa"), ("Q1", "flow", "m3/h")]),
    );
    bench.refuses("export unit.mcap -o x.csv", &["samples of 'P2' are in 'bar'", "kPa"]);
    swap_rig(&bench, "broken.mcap", "name = 1");
    bench.refuses("export broken.mcap -o x.csv", &["the rig file inside broken.mcap is not valid", "because:"]);
}

/// Writes a recording of `CSV` whose rig file is another.
fn swap_rig(bench: &Bench, name: &str, rig_text: &str) {
    bench.put("run.csv", CSV);
    let mut recording = log::import_csv(&bench.path("run.csv"), &Rig::load(&bench.path("rig.toml")).unwrap()).unwrap();
    recording.rig.source = rig_text.into();
    log::write(&bench.path(name), &recording).unwrap();
}

fn find(bytes: &[u8], what: &[u8]) -> usize {
    bytes.windows(what.len()).position(|w| w == what).unwrap()
}

#[test]
fn a_recording_with_gaps_exports_and_says_that_they_do_not_show() {
    let bench = Bench::new();
    let rig = Rig::load(&bench.path("rig.toml")).unwrap();
    let path: &Path = &bench.path("live.mcap");
    let mut writer = Writer::create(path, &rig, &RunInfo::default()).unwrap();
    writer.samples(0, 0, 1e6, &[1.0, 2.5]).unwrap();
    writer.gap(0, surgescope::recording::Gap { from_s: 0.001, to_s: 0.01, samples: Some(8) }).unwrap();
    writer.samples(0, 10_000_000, 1e6, &[3.0]).unwrap();
    writer.samples(1, 500_000, 1e6, &[7.0]).unwrap();
    writer.finish().unwrap();
    let (_, err) = bench.expect(0, "export live.mcap -o live.csv");
    assert!(err.contains("a CSV file cannot mark gaps: the recording has 1"), "{err}");
    let text = String::from_utf8(bench.get("live.csv")).unwrap();
    assert_eq!(text, "time_s,P1,P2,Q1\n0,1,,\n0.0005,,7,\n0.001,2.5,,\n0.01,3,,\n");
}

fn shipped(name: &str) -> String {
    here("recordings").join(name).display().to_string()
}

#[test]
fn a_time_series_replaces_only_one_like_it_unless_told_to() {
    let bench = Bench::new();
    let simulate = "simulate --rig rig.toml --duration 0.2 --csv-times 0.01 --set reaches=24";
    let (_, err) = bench.expect(0, &format!("{simulate} -o new.csv"));
    let used = err
        .lines()
        .find_map(|l| l.strip_prefix("not set, defaults used: "))
        .expect("the program lists what was not set");
    for value in ["initial_velocity_m_s=1 ", "closing_time_s=0.1 ", "friction_factor=0.0", "valve_head_m="] {
        assert!(used.contains(value), "{value} is not in {used}");
    }
    assert!(!used.contains("reaches=") && !used.contains("duration_s="), "these were set: {used}");
    let first = bench.get("new.csv");
    assert!(first.starts_with(b"time_s,P1,P2\n"));
    bench.expect(0, &format!("{simulate} --set initial_velocity_m_s=0.5 -o new.csv"));
    assert_ne!(bench.get("new.csv"), first, "an older one like it is replaced");

    bench.put("measured.csv", CSV);
    let words = ["measured.csv exists and does not begin with 'time_s,P1,P2'", "--overwrite"];
    bench.refuses(&format!("{simulate} -o measured.csv"), &words);
    assert_eq!(bench.get("measured.csv"), CSV.as_bytes());
    bench.expect(0, &format!("{simulate} -o measured.csv --overwrite"));
    assert!(bench.get("measured.csv").starts_with(b"time_s,P1,P2\n"));

    let (recording, rig) = (bench.imported(), bench.get("rig.toml"));
    bench.refuses(
        &format!("{simulate} --overwrite -o run.mcap"),
        &["run.mcap exists already; recordings are never overwritten"],
    );
    bench.refuses(&format!("{simulate} --overwrite -o ./rig.toml"), &["./rig.toml is the rig file"]);
    bench.refuses(&format!("{simulate} -o no/such/x.csv"), &["the folder no/such does not exist"]);
    bench.refuses(&format!("{simulate} -o ."), &["is a folder"]);
    assert_eq!((bench.get("run.mcap"), bench.get("rig.toml")), (recording, rig));
}

#[test]
fn a_report_replaces_only_a_report_and_costs_no_result() {
    let bench = Bench::new();
    let calibrate = format!("calibrate {} --report", shipped("hdpe-nothing-missing.mcap"));
    bench.imported();
    for (name, says) in [
        ("run.mcap", "is not a surgescope report"),
        ("rig.toml", "is not a surgescope report"),
        ("no/x.html", "the folder no does not exist"),
    ] {
        let before = bench.path(name).exists().then(|| bench.get(name));
        let (out, err) = bench.expect(2, &format!("{calibrate} {name}"));
        assert!(out.is_empty() && err.contains(says), "{err}");
        assert_eq!(bench.path(name).exists().then(|| bench.get(name)), before);
    }
    bench.put(
        "old.html",
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta name=\"generator\" content=\"surgescope 0.0.1\">",
    );
    let (out, _) = bench.expect(0, &format!("{calibrate} old.html"));
    assert!(out.starts_with("RMSE") && bench.get("old.html").ends_with(b"</html>\n"), "{out}");
    if Path::new("/dev/full").exists() {
        let (again, err) = bench.expect(2, &format!("{calibrate} /dev/full"));
        assert!(err.contains("cannot write /dev/full"), "{err}");
        assert_eq!(again.lines().next(), out.lines().next(), "the tables were printed before");
    }
}

#[test]
fn a_recording_counts_once() {
    let bench = Bench::new();
    fs::copy(shipped("hdpe-nothing-missing.mcap"), bench.path("run.mcap")).unwrap();
    let (_, err) = bench.expect(2, "calibrate run.mcap ./run.mcap");
    assert!(err.contains("run.mcap and ./run.mcap are one recording"), "{err}");
    let (_, err) = bench.expect(2, "calibrate run.mcap run.mcap");
    assert!(err.contains("run.mcap is given twice"), "{err}");
}

#[test]
fn what_cannot_be_right_together_is_told_before_the_fit() {
    let bench = Bench::new();
    let slow = rig_text("slow", &[("P1", "pressure", "kPa")]).replace("length_m = 50.0", "length_m = 5000.0");
    bench.put("slow.toml", slow.replace("position_m = 25.0", "position_m = 5000.0"));
    bench.expect(0, "simulate --rig rig.toml --set reaches=24 --csv-times 0.001 --duration 3 -o run.csv");
    // the same wave in a pipe said to be a hundred times as long
    let text = String::from_utf8(bench.get("run.csv")).unwrap();
    let times = text.lines().skip(1).map(|l| l.split(',').collect::<Vec<_>>());
    // at a higher head, for no water stands so far below a vacuum as the elastic model lets it fall
    let number = |cell: &str| cell.parse::<f64>().unwrap();
    let rows: String = times.map(|c| format!("{:.4},{:.4}\n", 1.0 + number(c[0]), 500.0 + number(c[1]))).collect();
    let steady: f64 = rows.split(',').nth(1).unwrap().lines().next().unwrap().parse().unwrap();
    let lead: String =
        (0..1000).map(|i| format!("{:.4},{}\n", f64::from(i) * 1e-3, steady + 0.01 * f64::from(i % 7))).collect();
    bench.put("slow.csv", format!("time_s,P1\n{lead}{rows}"));
    bench.expect(0, "import slow.csv --rig slow.toml -o slow.mcap");
    let (out, _) = bench.expect(0, "inspect slow.mcap");
    let note = out.lines().find_map(|l| l.strip_prefix("note: the wave travels at")).expect("a doubt").to_owned();
    assert!(note.contains("are the pipe's length"), "{note}");
    // An unknown parameter ends the command before the fit; the warning comes before it.
    let (_, err) = bench.expect(2, "calibrate slow.mcap --hold nothing=1");
    assert!(err.contains("warning: slow.mcap: the wave travels at"), "{err}");
}

#[test]
fn settings_that_belong_elsewhere_are_told_where() {
    let bench = Bench::new();
    for (set, says) in [
        ("J1_per_GPa=0.1", "it belongs to the effect 'viscoelastic-wall': add --effects viscoelastic-wall:1"),
        ("tau3_s=0.1", "add --effects viscoelastic-wall:3"),
        ("closure_start_s=1", "time 0 is the start of the closure"),
        ("offset_m[P1]=1", "simulated ones have no offset"),
        ("wave_sped_m_s=400", "did you mean 'wave_speed_m_s'?"),
        ("xyzzy=1", "this model has closing_time_s, friction_factor"),
    ] {
        let (_, err) = bench.expect(2, &format!("simulate --rig rig.toml --set {set}"));
        assert!(err.contains(says), "{set}: {err}");
        assert_eq!(err.contains("did you mean"), set.starts_with("wave_sped"), "{err}");
    }
    let (_, err) = bench.expect(2, "simulate --rig rig.toml --effects viscoelastic-wall:1 --set J2_per_GPa=0.1");
    assert!(
        err.contains("it needs the effect 'viscoelastic-wall:2', and this model has 'viscoelastic-wall:1'"),
        "{err}"
    );
}

#[test]
fn negative_numbers_are_values_and_not_unknown_options() {
    let bench = Bench::new();
    let recording = shipped("hdpe-creep.mcap");
    for (command, says) in [
        ("simulate --rig rig.toml --duration -1", "must be above 0"),
        ("simulate --rig rig.toml --csv-times -1", "must be above 0"),
        ("record --rig rig.toml -o x.mcap --simulate --rate -1", "must be above 0"),
        ("record --rig rig.toml -o x.mcap --simulate --speed -1", "must not be negative"),
        ("record --rig rig.toml -o x.mcap --duration -1", "must be above 0"),
        ("record --rig rig.toml -o x.mcap --silence -1", "must be above 0"),
        ("demo --speed -1", "must be above 0"),
        (&format!("calibrate {recording} --most-reaches -1"), "a whole number from 8 to 100000"),
        (&format!("calibrate {recording} --most-reaches 4"), "a whole number from 8 to 100000"),
    ] {
        let (_, err) = bench.expect(2, command);
        assert!(err.contains(says) && !err.contains("unexpected argument"), "{command}: {err}");
    }
}

#[test]
fn a_duration_has_no_digits_that_nobody_measured() {
    let bench = Bench::new();
    bench.put("run.csv", "time_s,P1,P2,Q1\n0.1,1,2,3\n0.3,1,2,3\n0.4,1,2,3\n");
    let (out, _) = bench.expect(0, "import run.csv --rig rig.toml -o run.mcap");
    assert!(out.contains(": 0.3 s of rig 'bench'"), "{out}");
}
