//! A campaign: planned once, run in shards by whoever comes, gathered in one table.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Stdio};
use std::time::Duration;

use serde_json::Value;
use tempfile::TempDir;

use crate::common::{done, ended, here, refused, run, surgescope, text};

/// A folder with two recordings and a plan of twelve short fits.
struct Bench {
    folder: TempDir,
}

impl Bench {
    fn new() -> Bench {
        let folder = tempfile::tempdir().unwrap();
        fs::create_dir(folder.path().join("runs")).unwrap();
        for name in ["hdpe-creep.mcap", "hdpe-nothing-missing.mcap"] {
            fs::copy(here("recordings").join(name), folder.path().join("runs").join(name)).unwrap();
        }
        let plan = "kind = \"calibrate\"\nrecordings = [\"runs/*.mcap\"]\neffects = [[\"none\"], [\"viscoelastic-wall:1\"]]\n\
                    starts = 3\nseed = 1\n[options]\nmost_reaches = 32\n";
        fs::write(folder.path().join("plan.toml"), plan).unwrap();
        Bench { folder }
    }

    fn at(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn planned(&self, name: &str) -> PathBuf {
        let dir = self.at(name);
        let told = done(&["campaign", "plan", text(&self.at("plan.toml")), "-o", text(&dir)]);
        assert_eq!(told["tasks"], 12);
        dir
    }

    fn table(&self, dir: &Path) -> Vec<u8> {
        let table = dir.with_extension("csv");
        done(&["results", text(dir), "-o", text(&table)]);
        fs::read(table).unwrap()
    }
}

fn shard(dir: &Path, shard: &str) -> Child {
    surgescope(["campaign", "run", text(dir), "--shard", shard, "--threads", "1"])
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap()
}

/// Exit code and document.
fn status(dir: &Path) -> (i32, Value) {
    let (code, out, err) = ended(run(&["campaign", "status", text(dir), "--json"]));
    (code, serde_json::from_str(&out).unwrap_or_else(|_| panic!("{err}")))
}

#[test]
fn shards_runners_beside_each_other_and_a_killed_one_give_the_table_of_one_run() {
    let bench = Bench::new();
    let (serial, shards, beside, killed) =
        (bench.planned("a"), bench.planned("b"), bench.planned("c"), bench.planned("d"));
    let names = |dir: &Path| fs::read_to_string(dir.join("tasks.jsonl")).unwrap();
    assert_eq!(names(&serial), names(&shards), "a task is named by its content");
    assert_eq!(status(&serial).0, 1, "nothing is done yet");

    assert!(shard(&serial, "1/1").wait().unwrap().success());
    let whole = bench.table(&serial);
    assert_eq!(whole.iter().filter(|&&byte| byte == b'\n').count(), 13);
    for part in ["3/3", "1/3", "2/3"] {
        assert!(shard(&shards, part).wait().unwrap().success());
    }
    let mut both = [shard(&beside, "1/1"), shard(&beside, "1/1")];
    both.iter_mut().for_each(|runner| assert!(runner.wait().unwrap().success()));
    let mut torn = shard(&killed, "1/1");
    std::thread::sleep(Duration::from_millis(400));
    torn.kill().unwrap();
    torn.wait().unwrap();
    assert!(shard(&killed, "1/1").wait().unwrap().success());
    for dir in [&shards, &beside, &killed] {
        let (code, now) = status(dir);
        assert_eq!(
            (code, &now["done"], &now["failed"], &now["missing"]),
            (0, &12.into(), &0.into(), &0.into()),
            "{now}"
        );
        assert!(bench.table(dir) == whole, "{dir:?}: the table is another one");
    }
    // what is done is skipped
    let results = |dir: &Path| {
        let files = fs::read_dir(dir.join("results")).unwrap();
        files.map(|file| file.unwrap().metadata().unwrap().len()).sum::<u64>()
    };
    let before = results(&serial);
    assert!(shard(&serial, "1/1").wait().unwrap().success());
    assert_eq!(results(&serial), before);
}

#[test]
fn what_cannot_be_done_has_its_reason_and_the_rest_goes_on() {
    let bench = Bench::new();
    let dir = bench.planned("campaign");
    let (changed, vanished) = (bench.at("runs/hdpe-creep.mcap"), bench.at("runs/hdpe-nothing-missing.mcap"));
    let whole = fs::read(&changed).unwrap();
    fs::write(&changed, [&whole[..], b"more"].concat()).unwrap();
    // the runner has done its part; what failed is for `status` to say
    assert!(shard(&dir, "1/1").wait().unwrap().success());
    let (code, now) = status(&dir);
    assert_eq!((code, &now["done"], &now["failed"]), (1, &6.into(), &6.into()), "{now}");
    let failures = now["failures"].as_array().unwrap();
    assert_eq!(failures.len(), 6);
    assert!(failures.iter().all(|f| f["reason"].as_str().unwrap().contains("hdpe-creep.mcap changed")), "{now}");
    // mended, they are tried again when asked for
    fs::write(&changed, whole).unwrap();
    let (code, ..) = ended(run(&["campaign", "status", text(&dir), "--retry"]));
    assert_eq!(code, 1);
    assert!(shard(&dir, "1/1").wait().unwrap().success());
    assert_eq!(status(&dir).0, 0);

    let short = bench.planned("short");
    fs::remove_file(vanished).unwrap();
    run(&["campaign", "run", text(&short), "--time-limit", "0.001"]);
    let (_, now) = status(&short);
    let reasons: Vec<&str> =
        now["failures"].as_array().unwrap().iter().map(|f| f["reason"].as_str().unwrap()).collect();
    assert_eq!(reasons.iter().filter(|r| r.contains("vanished")).count(), 6, "{reasons:?}");
    assert_eq!(reasons.iter().filter(|r| r.contains("took longer than")).count(), 6, "{reasons:?}");
}

#[test]
fn a_plan_is_refused_in_words_and_never_replaces_another() {
    let bench = Bench::new();
    let dir = bench.planned("campaign");
    let plan = |text: &str| {
        fs::write(bench.at("other.toml"), text).unwrap();
        bench.at("other.toml")
    };
    let file = plan("kind = \"calibrate\"\nrecordings = [\"none/*.mcap\"]\neffects = [[\"none\"]]\n");
    refused(&["campaign", "plan", text(&file), "-o", text(&bench.at("x"))], &["none/*.mcap"]);
    let file = plan("kind = \"calibrat\"\nrecordings = [\"runs/*.mcap\"]\n");
    refused(
        &["campaign", "plan", text(&file), "-o", text(&bench.at("x"))],
        &["other.toml:1", "did you mean 'calibrate'"],
    );
    let file = plan("kind = \"calibrate\"\nrecordings = [\"runs/*.mcap\"]\neffects = [[\"leek\"]]\n");
    refused(&["campaign", "plan", text(&file), "-o", text(&bench.at("x"))], &["leek", "leak"]);
    let file = plan("kind = \"calibrate\"\nrecordings = [\"runs/*.mcap\"]\neffects = [[\"leak\"]]\n");
    let before = fs::read(dir.join("tasks.jsonl")).unwrap();
    refused(&["campaign", "plan", text(&file), "-o", text(&dir)], &["another"]);
    assert_eq!(fs::read(dir.join("tasks.jsonl")).unwrap(), before);
    refused(&["campaign", "status", text(&bench.at("runs"))], &["campaign"]);
}

/// The jobs are scripts that a shell reads, and each starts a shard of this campaign.
#[test]
fn each_engine_gets_a_job_of_its_own() {
    let bench = Bench::new();
    let dir = bench.planned("it's a campaign");
    for (engine, name) in [("hq", "hq.sh"), ("slurm", "slurm.sh"), ("snakemake", "Snakefile")] {
        done(&["campaign", "submit", text(&dir), "--to", engine]);
        let job = fs::read_to_string(dir.join("jobs").join(name)).unwrap();
        assert!(job.contains("campaign run") && job.contains("--shard"), "{job}");
        if name.ends_with(".sh") {
            let read = std::process::Command::new("bash").arg("-n").arg(dir.join("jobs").join(name)).status().unwrap();
            assert!(read.success(), "{job}");
        }
    }
}
