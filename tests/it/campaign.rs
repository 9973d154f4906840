//! Campaigns: what is planned, shards against one run, runners that die or meet, inputs that change, jobs of engines.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use serde_json::Value;
use tempfile::TempDir;

use crate::common::{CREEP, LEAK, NOTHING, document, done, ended, here, refused, run, surgescope, text};

/// Six fits a recording, on a coarse grid.
const FITS: &str = r#"kind = "calibrate"
recordings = ["*.mcap"]
effects = [["none"], ["unsteady-friction"], ["viscoelastic-wall:1"]]
starts = 2
[options]
most_reaches = 16
random_starts = 1
"#;

/// A folder with recordings, `a.mcap` and so on, and a plan.
struct Study {
    place: TempDir,
}

impl Study {
    fn new(plan: &str, recordings: &[&str]) -> Study {
        let place = tempfile::tempdir().unwrap();
        for (recording, name) in recordings.iter().zip('a'..) {
            fs::copy(here(recording), place.path().join(format!("{name}.mcap"))).unwrap();
        }
        fs::write(place.path().join("plan.toml"), plan).unwrap();
        Study { place }
    }

    fn file(&self, name: &str) -> PathBuf {
        self.place.path().join(name)
    }

    /// Plans it into a folder of its own: the folder, and how many tasks there are.
    fn planned(&self, name: &str) -> (PathBuf, u64) {
        let folder = self.file(name);
        let said = done(&["campaign", "plan", text(&self.file("plan.toml")), "-o", text(&folder)]);
        (folder, said["tasks"].as_u64().unwrap())
    }

    fn refusal(&self, plan: &str, words: &[&str]) {
        let (path, folder) = (self.file("refused.toml"), self.file("refused"));
        fs::write(&path, plan).unwrap();
        refused(&["campaign", "plan", text(&path), "-o", text(&folder)], words);
        assert!(!folder.join("tasks.jsonl").exists(), "{plan}");
    }
}

fn runner(folder: &Path, more: &[&str]) -> Command {
    surgescope(["campaign", "run", text(folder), "--json"].iter().chain(more))
}

fn ran(folder: &Path, more: &[&str]) -> Value {
    document(runner(folder, more).output().unwrap())
}

/// The exit code of `status`, and what it says.
fn status(folder: &Path) -> (i32, Value) {
    let (code, out, err) = ended(run(&["campaign", "status", text(folder), "--json"]));
    (code, serde_json::from_str(&out).unwrap_or_else(|e| panic!("{e}: {err}")))
}

fn counts(status: &Value) -> [u64; 3] {
    ["done", "failed", "missing"].map(|name| status[name].as_u64().unwrap())
}

fn table(folder: &Path) -> String {
    let path = folder.with_extension("csv");
    let (code, _, err) = ended(run(&["results", text(folder), "-o", text(&path)]));
    assert!(code == 0 || code == 3, "{code}: {err}");
    fs::read_to_string(path).unwrap()
}

fn lines_of_results(folder: &Path) -> usize {
    let Ok(files) = fs::read_dir(folder.join("results")) else { return 0 };
    files.map(|file| fs::read_to_string(file.unwrap().path()).unwrap().lines().count()).sum()
}

#[test]
fn equal_plans_have_equal_tasks_and_a_folder_keeps_its_own() {
    let study = Study::new(FITS, &[NOTHING, LEAK]);
    let (one, tasks) = study.planned("one");
    let (two, _) = study.planned("two");
    let lines = fs::read_to_string(one.join("tasks.jsonl")).unwrap();
    assert_eq!(lines, fs::read_to_string(two.join("tasks.jsonl")).unwrap());
    assert_eq!(lines.lines().count() as u64, tasks);
    // two recordings, three models, two seeds
    assert_eq!(tasks, 12);
    assert_eq!(study.planned("one"), (one.clone(), 12));
    assert_eq!(counts(&status(&one).1), [0, 0, 12]);

    let other = study.file("other.toml");
    fs::write(&other, FITS.replace("starts = 2", "starts = 3")).unwrap();
    refused(&["campaign", "plan", text(&other), "-o", text(&one)], &["another campaign of 12 tasks", "another folder"]);
    assert_eq!(lines, fs::read_to_string(one.join("tasks.jsonl")).unwrap());
}

#[test]
fn a_slip_of_a_plan_is_refused_with_its_line() {
    let study = Study::new(FITS, &[LEAK]);
    study.refusal(&FITS.replace("*.mcap", "runs/*.mcap"), &["refused.toml:2", "runs/*.mcap"]);
    study.refusal(&FITS.replace("\"calibrate\"", "\"calibrat\""), &["refused.toml:1", "did you mean 'calibrate'"]);
    study.refusal(&FITS.replace("starts", "start"), &["refused.toml:4", "did you mean 'starts'"]);
    study.refusal(&FITS.replace("most_reaches", "most_reach"), &["refused.toml:6", "did you mean 'most_reaches'"]);
    study.refusal(&FITS.replace("unsteady-friction", "unsteady-fiction"), &["refused.toml:3", "unsteady-friction"]);
    let rig = here("rigs/demo-hdpe.toml");
    let simulations = format!("kind = \"simulate\"\nrigs = [{rig:?}]\n[set]\nwave_sped = 300.0\n");
    study.refusal(&simulations, &["demo-hdpe.toml", "did you mean 'wave_speed_m_s'"]);
    let grid = format!("kind = \"simulate\"\nrigs = [{rig:?}]\n[set]\nwave_speed_m_s = [300.0, 310.0, -320.0]\n");
    study.refusal(&grid, &["demo-hdpe.toml", "wave_speed_m_s = -320", "more than zero"]);
    let drawn = format!("kind = \"simulate\"\nrigs = [{rig:?}]\nstarts = 40\n[range]\nclosing_time_s = [-0.1, 1.0]\n");
    study.refusal(&drawn, &["demo-hdpe.toml", "closing_time_s = -"]);
    let design = format!("kind = \"sensitivity\"\nrigs = [{rig:?}]\n");
    study.refusal(&format!("{design}only = [\"J1_per_GPa\"]\n"), &["demo-hdpe.toml", "J1_per_GPa"]);
    study.refusal(&format!("{design}[options]\nsensor = \"P9\"\n"), &["demo-hdpe.toml", "P9"]);
    refused(&["campaign", "run", text(study.place.path())], &["no folder of a campaign", "campaign plan"]);
}

#[test]
fn shards_give_the_table_of_one_run_and_finished_tasks_are_skipped() {
    let study = Study::new(FITS, &[NOTHING]);
    let (whole, tasks) = study.planned("whole");
    let (parts, _) = study.planned("parts");
    assert_eq!(ran(&whole, &["--shard", "1/1", "--threads", "1"])["done"], tasks);
    let first = ran(&parts, &["--shard", "2/2", "--threads", "2"]);
    assert_eq!(counts(&status(&parts).1), [first["done"].as_u64().unwrap(), 0, tasks - 3]);
    assert_eq!(status(&parts).0, 1);
    ran(&parts, &["--shard", "1/2"]);
    let serial = table(&whole);
    assert_eq!(serial.lines().count() as u64, 1 + tasks);
    assert_eq!(serial, table(&parts));
    assert_eq!(status(&parts).0, 0);

    let again = ran(&whole, &[]);
    assert_eq!((&again["done"], &again["finished_before"]), (&Value::from(0), &Value::from(tasks)));
    assert_eq!(lines_of_results(&whole) as u64, tasks);
}

#[test]
fn an_input_that_changed_or_vanished_fails_its_tasks_and_no_other() {
    let plan = FITS.replace("starts = 2", "starts = 1").replace(", [\"viscoelastic-wall:1\"]", "");
    let study = Study::new(&plan, &[NOTHING, LEAK, CREEP]);
    let (folder, tasks) = study.planned("campaign");
    let changed = fs::read(study.file("b.mcap")).unwrap();
    fs::write(study.file("b.mcap"), [&changed[..], b"x"].concat()).unwrap();
    fs::remove_file(study.file("c.mcap")).unwrap();
    assert_eq!(ran(&folder, &[])["failed"], 2 * tasks / 3);
    let (code, said) = status(&folder);
    assert_eq!((code, counts(&said)), (1, [tasks / 3, 2 * tasks / 3, 0]));
    for reason in ["b.mcap changed since", "c.mcap vanished"] {
        let with = |failure: &&Value| failure["reason"].as_str().unwrap().contains(reason);
        assert_eq!(said["failures"].as_array().unwrap().iter().filter(with).count() as u64, tasks / 3, "{said}");
    }

    // put right, they are tried again where that is asked for
    fs::write(study.file("b.mcap"), changed).unwrap();
    assert_eq!(ran(&folder, &[])["done"], 0);
    run(&["campaign", "status", text(&folder), "--retry"]);
    assert_eq!(ran(&folder, &[])["done"], tasks / 3);
    assert_eq!(counts(&status(&folder).1), [2 * tasks / 3, tasks / 3, 0]);
}

/// Lets the results of a campaign be those of another build of the program.
fn by_another_program(folder: &Path) {
    for file in fs::read_dir(folder.join("results")).unwrap() {
        let path = file.unwrap().path();
        let of = |line: &str| {
            let mut result: Value = serde_json::from_str(line).unwrap();
            assert!(result["program"].as_str().unwrap().starts_with("surgescope "), "{result}");
            result.as_object_mut().unwrap().remove("check");
            result["program"] = "surgescope 0.0.9".into();
            surgescope::campaign::lines::sealed(&result.to_string())
        };
        let lines: String = fs::read_to_string(&path).unwrap().lines().map(of).collect();
        fs::write(path, lines).unwrap();
    }
}

#[test]
fn results_of_another_program_are_called_out_and_found_again_where_that_is_asked_for() {
    let study = Study::new(FITS, &[NOTHING]);
    let (folder, tasks) = study.planned("campaign");
    let first = ran(&folder, &["--shard", "1/2"])["done"].as_u64().unwrap();
    assert_eq!(status(&folder).1["other_programs"], serde_json::json!([]));
    by_another_program(&folder);
    let (code, _, err) = ended(runner(&folder, &[]).output().unwrap());
    assert!(code == 0 && err.contains("3 results are of another program: surgescope 0.0.9"), "{err}");
    let said = status(&folder).1;
    assert_eq!(said["other_programs"], serde_json::json!([{ "program": "surgescope 0.0.9", "results": first }]));
    let (_, _, err) = ended(run(&["results", text(&folder), "-o", text(&study.file("mixed.csv"))]));
    assert!(err.contains("the rows are of 2 programs"), "{err}");
    let mixed = fs::read_to_string(study.file("mixed.csv")).unwrap();
    assert_eq!(mixed.lines().filter(|row| row.contains(",surgescope 0.0.9,")).count() as u64, first);

    run(&["campaign", "status", text(&folder), "--retry=other-program"]);
    assert_eq!(counts(&status(&folder).1), [tasks - first, 0, first]);
    assert_eq!(ran(&folder, &[])["done"], first);
    let (whole, _) = study.planned("whole");
    ran(&whole, &[]);
    assert_eq!(table(&folder), table(&whole));
    assert!(fs::read_dir(folder.join("results/aside")).unwrap().count() > 0);
}

#[test]
fn a_folder_without_marks_is_looked_at_without_writing_to_it() {
    let study = Study::new(FITS, &[NOTHING]);
    let (folder, tasks) = study.planned("campaign");
    let done = ran(&folder, &["--shard", "1/3"])["done"].as_u64().unwrap();
    fs::remove_file(folder.join("marks")).unwrap();
    assert_eq!(counts(&status(&folder).1), [done, 0, tasks - done]);
    assert!(!folder.join("marks").exists());
}

#[test]
fn a_task_over_its_time_limit_fails_with_the_reason() {
    let study = Study::new(FITS, &[NOTHING]);
    let (folder, tasks) = study.planned("campaign");
    assert_eq!(ran(&folder, &["--time-limit", "0.001"])["failed"], tasks);
    let (code, said) = status(&folder);
    assert_eq!((code, counts(&said)), (1, [0, tasks, 0]));
    assert!(said["failures"][0]["reason"].as_str().unwrap().contains("time limit of 0.001 s"), "{said}");
}

#[test]
fn status_only_looks() {
    let study = Study::new(FITS, &[NOTHING]);
    let (folder, tasks) = study.planned("campaign");
    let marks = folder.join("marks");
    let mut rights = fs::metadata(&marks).unwrap().permissions();
    rights.set_readonly(true);
    fs::set_permissions(&marks, rights).unwrap();
    let before = fs::metadata(&marks).unwrap().modified().unwrap();
    assert_eq!(counts(&status(&folder).1), [0, 0, tasks]);
    assert_eq!(fs::metadata(&marks).unwrap().modified().unwrap(), before);
}

#[cfg(target_os = "linux")]
#[test]
fn a_task_whose_process_is_killed_fails_and_the_rest_goes_on() {
    let study = Study::new(&FITS.replace("starts = 2", "starts = 4"), &[NOTHING]);
    let (folder, tasks) = study.planned("campaign");
    let mut running = runner(&folder, &["--threads", "1"]).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let began = Instant::now();
    let threads = format!("/proc/{}/task", running.id());
    let mut killed = false;
    while !killed {
        assert!(began.elapsed() < Duration::from_secs(60), "no process of a task");
        // a thread starts it, so it is among the children of all threads
        let all = fs::read_dir(&threads)
            .unwrap()
            .filter_map(|thread| fs::read_to_string(thread.unwrap().path().join("children")).ok());
        if let Some(child) = all.collect::<String>().split_whitespace().next() {
            sleep(Duration::from_millis(200));
            killed = Command::new("kill").args(["-KILL", child]).status().unwrap().success();
        }
    }
    assert!(running.wait().unwrap().success());
    let (_, said) = status(&folder);
    assert_eq!(counts(&said), [tasks - 1, 1, 0], "{said}");
    assert!(said["failures"][0]["reason"].as_str().unwrap().contains("SIGKILL"), "{said}");
}

#[test]
fn two_runners_on_one_shard_do_each_task_once() {
    let study = Study::new(FITS, &[NOTHING, LEAK]);
    let (folder, tasks) = study.planned("campaign");
    let start = || runner(&folder, &["--threads", "1"]).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
    let done: u64 = [start(), start()]
        .map(|child| document(child.wait_with_output().unwrap())["done"].as_u64().unwrap())
        .iter()
        .sum();
    assert_eq!((done, lines_of_results(&folder) as u64), (tasks, tasks));
    assert_eq!(counts(&status(&folder).1), [tasks, 0, 0]);
}

#[test]
fn a_runner_that_is_killed_loses_nothing_that_was_finished() {
    let study = Study::new(&FITS.replace("starts = 2", "starts = 4"), &[NOTHING]);
    let (serial, tasks) = study.planned("serial");
    let (folder, _) = study.planned("killed");
    let mut killed = runner(&folder, &["--threads", "1"]).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let began = Instant::now();
    while lines_of_results(&folder) == 0 {
        assert!(began.elapsed() < Duration::from_secs(60), "no result");
        sleep(Duration::from_millis(5));
    }
    killed.kill().unwrap();
    killed.wait().unwrap();
    let before = lines_of_results(&folder) as u64;
    assert!((1..tasks).contains(&before), "{before} of {tasks}");
    let went_on = ran(&folder, &[]);
    // a result may have been written and not yet marked: it is done over, and the table has it once
    assert!(went_on["done"].as_u64().unwrap() - (tasks - before) <= 1, "{went_on}, {before} before");
    ran(&serial, &["--threads", "1"]);
    assert_eq!(table(&serial), table(&folder));
    assert_eq!(status(&folder).0, 0);
}

#[test]
fn jobs_of_engines_run_the_shards() {
    let study = Study::new(FITS, &[LEAK]);
    let (folder, _) = study.planned("it's one");
    for (engine, words) in [
        ("hq", ["#HQ --array 1-4", "$HQ_TASK_ID/4"]),
        ("slurm", ["#SBATCH --array=1-4", "$SLURM_ARRAY_TASK_ID/4"]),
        ("snakemake", ["SHARDS = 4", "{wildcards.shard}/{SHARDS}"]),
    ] {
        let said = done(&["campaign", "submit", text(&folder), "--to", engine, "--shards", "4"]);
        assert_eq!((&said["shards"], &said["started"]), (&Value::from(4), &Value::from(false)));
        let file = said["file"].as_str().unwrap();
        let job = fs::read_to_string(file).unwrap();
        for word in words.into_iter().chain(["campaign run", "--shard", env!("CARGO_BIN_EXE_surgescope")]) {
            assert!(job.contains(word), "{engine}: no {word:?} in {job}");
        }
        assert!(!job.contains('@'), "{job}");
        if engine != "snakemake" {
            assert!(Command::new("bash").arg("-n").arg(file).status().unwrap().success(), "{job}");
        }
    }
    // an array's task, as the engine starts it
    let job = folder.join("jobs/hq.sh");
    assert!(Command::new("sh").arg(job).env("HQ_TASK_ID", "2").status().unwrap().success());
    assert_eq!(counts(&status(&folder).1)[0], 2);
}

/// A task with an effect that its rig has of its own is planned, copied and run like any other; where the effect
/// changes, the task is another one.
#[test]
fn the_effects_of_a_rigs_own_go_with_it() {
    const PLAN: &str =
        "kind = \"simulate\"\nrigs = [\"rig.toml\"]\neffects = [[\"relief-valve\"]]\n[set]\nset_head_m = 36.0\n";
    let study = Study::new(PLAN, &[]);
    let effect = study.file("effects/relief-valve.toml");
    fs::copy(here("rigs/demo-hdpe.toml"), study.file("rig.toml")).unwrap();
    fs::create_dir(study.file("effects")).unwrap();
    run(&["effects", "new", "relief-valve", "-o", text(&effect)]);
    let tasks = |folder: &Path| fs::read_to_string(folder.join("tasks.jsonl")).unwrap();

    let copy = study.file("copy");
    done(&["campaign", "plan", text(&study.file("plan.toml")), "-o", text(&copy), "--copy"]);
    let (there, _) = study.planned("there");
    fs::write(&effect, format!("# written again\n{}", fs::read_to_string(&effect).unwrap())).unwrap();
    let (again, _) = study.planned("again");
    let name = |folder: &Path| serde_json::from_str::<Value>(&tasks(folder)).unwrap()["task"].clone();
    assert_eq!(name(&copy), name(&there));
    assert_ne!(name(&again), name(&there), "another effect is another task");

    assert_eq!(ran(&there, &[])["failed"], 1);
    let said = status(&there).1;
    assert!(said["failures"][0]["reason"].as_str().unwrap().contains("relief-valve.toml changed"), "{said}");
    fs::remove_dir_all(study.file("effects")).unwrap();
    let moved = tempfile::tempdir().unwrap();
    fs::rename(&copy, moved.path().join("copy")).unwrap();
    let ran = ran(&moved.path().join("copy"), &[]);
    assert_eq!((&ran["done"], &ran["failed"]), (&Value::from(1), &Value::from(0)), "{ran}");
}
