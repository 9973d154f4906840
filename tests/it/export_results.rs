//! Results on disk: one fit as a file, many as a table, a calibration as a problem of PEST that runs where it stands.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::path::{Path, PathBuf};

use serde_json::Value;
use surgescope::results::fit_file::Form;
use surgescope::results::fit_record::FitRecord;

use crate::common::{self, CREEP, NOTHING, done, here, printed, surgescope, text};

fn refused(arguments: &[&str], said: &str) {
    common::refused(arguments, &[said]);
}

/// Two recordings of one rig: a shipped one, and the same cut off after two thirds.
fn two_runs(folder: &Path) -> [PathBuf; 2] {
    let recording = surgescope::storage::read(&here(NOTHING)).unwrap();
    let (rig, csv) = (folder.join("rig.toml"), folder.join("short.csv"));
    std::fs::write(&rig, &recording.rig.source).unwrap();
    done(&["export", NOTHING, "-o", text(&csv)]);
    let whole = std::fs::read_to_string(&csv).unwrap();
    let lines: Vec<&str> = whole.lines().collect();
    std::fs::write(&csv, lines[..lines.len() * 2 / 3].join("\n")).unwrap();
    let paths = [folder.join("run a.mcap"), folder.join("run b.mcap")];
    std::fs::copy(here(NOTHING), &paths[0]).unwrap();
    done(&["import", text(&csv), "--rig", text(&rig), "-o", text(&paths[1])]);
    paths
}

#[test]
fn a_fit_is_read_back_as_it_was_written() {
    let folder = tempfile::tempdir().unwrap();
    let (toml, json) = (folder.path().join("fit.toml"), folder.path().join("fit.json"));
    let fit = ["calibrate", NOTHING, "--effects", "viscoelastic-wall:2", "--hold", "friction_scale=1"];
    let told = done(&[&fit[..], &["--profile", "tau1_s", "-o", text(&toml)]].concat());
    done(&[&fit[..], &["-o", text(&json)]].concat());
    let (from_toml, from_json) = (FitRecord::read(&toml).unwrap(), FitRecord::read(&json).unwrap());

    // What the file says is what the command said.
    assert_eq!(from_toml.effects, ["viscoelastic-wall:2"]);
    assert_eq!(from_toml.parameters.len(), told["parameters"].as_array().unwrap().len());
    for (p, told) in from_toml.parameters.iter().zip(told["parameters"].as_array().unwrap()) {
        assert_eq!(
            (p.name.as_str(), p.unit.as_str()),
            (told["name"].as_str().unwrap(), told["unit"].as_str().unwrap())
        );
        assert!((p.value - told["value"].as_f64().unwrap()).abs() <= 1e-15 * p.value.abs());
        assert!(p.lower <= p.value && p.value <= p.upper, "{p:?}");
        assert_eq!(p.correlation.len(), from_toml.parameters.len());
    }
    let of = |name: &str| from_toml.parameters.iter().find(|p| p.name == name).unwrap();
    let held_at = from_toml.parameters.iter().position(|p| p.name == "friction_scale").unwrap();
    let held = of("friction_scale");
    assert!(held.held && held.value == 1.0 && held.standard_error == Some(0.0), "{held:?}");
    assert!(of("wave_speed_m_s").standard_error.is_some_and(|e| e > 0.0 && e < 1.0));
    assert_eq!(of("wave_speed_m_s").correlation[0], 1.0);
    assert!(of("wave_speed_m_s").correlation[held_at].is_nan(), "the error of what is held has no correlation");
    assert_eq!((of("tau1_s").scale.as_str(), of("valve_head_m").scale.as_str()), ("log", "linear"));
    // Intervals, and what a profile has computed: as the command said it, and in the table of fits.
    let both = |p: &Value| [0, 1].map(|end| p["interval_95"][end].as_f64());
    for (p, told) in from_toml.parameters.iter().zip(told["parameters"].as_array().unwrap()).filter(|(p, _)| !p.held) {
        let ends = p.interval_95.map(|end| Some(end).filter(|e| e.is_finite()));
        let near =
            |(a, b): (&Option<f64>, &Option<f64>)| a.zip(*b).map_or(a == b, |(a, b)| (a / b - 1.0).abs() < 1e-12);
        assert!(ends.iter().zip(&both(told)).all(near), "{p:?} {told}");
        assert_eq!(p.profile.is_some(), p.name == "tau1_s");
    }
    assert!(of("tau1_s").profile.as_ref().unwrap().len() > 2);
    let (long, wide) = (folder.path().join("long.csv"), folder.path().join("wide.csv"));
    done(&["results", text(&toml), "--long", "-o", text(&long)]);
    done(&["results", text(&toml), "-o", text(&wide)]);
    let [low, high] = of("tau1_s").interval_95;
    let row = rows(&long).into_iter().find(|r| r["parameter"] == "tau1_s").unwrap();
    assert_eq!((row["lower_95"].parse(), row["upper_95"].parse()), (Ok(low), Ok(high)));
    assert_eq!(row["interval_by"], "profile");
    assert_eq!(rows(&wide)[0]["tau1_s_upper_95"].parse(), Ok(high));
    refused(&["results", text(&toml), text(&toml), "-o", text(&folder.path().join("t.csv"))], "a fit counts once");
    let zero = of("offset_m[P1]").prior.unwrap();
    assert!(zero.mean == 0.0 && zero.sd > 0.0);
    let run = &from_toml.runs[0];
    assert_eq!((run.file.as_str(), run.sensors.len()), ("hdpe-nothing-missing.mcap", 2));
    assert!(
        (run.duration_s.unwrap() - 10.634).abs() < 1e-9 && (run.temperature_degc.unwrap() - 16.4).abs() < 0.1,
        "{run:?}"
    );
    assert!(run.rmse_m < 1.1 * run.noise_m && from_toml.rmse_m == run.rmse_m);

    // Both forms give every bit back; what is no number survives both.
    for form in [Form::Toml, Form::Json] {
        let again = FitRecord::parse(&from_toml.text(form).unwrap(), form, "it").unwrap();
        assert_eq!(format!("{again:?}"), format!("{from_toml:?}"));
    }
    let same = |f: &FitRecord| f.parameters.iter().map(|p| format!("{} {:.9e}", p.name, p.value)).collect::<Vec<_>>();
    assert_eq!(same(&from_toml), same(&from_json));
}

#[test]
fn a_fit_replaces_nothing_unasked() {
    let folder = tempfile::tempdir().unwrap();
    let (notes, copy) = (folder.path().join("notes.toml"), folder.path().join("copy.json"));
    std::fs::write(&notes, "mine").unwrap();
    std::fs::copy(here(NOTHING), &copy).unwrap();
    refused(&["calibrate", NOTHING, "-o", "fit.yaml"], "use a name that ends in .toml or .json");
    refused(&["calibrate", NOTHING, "-o", text(&notes)], "replace it with --overwrite");
    refused(&["calibrate", NOTHING, "-o", text(&copy), "--overwrite"], "recordings are never overwritten");
    let new = folder.path().join("new.toml");
    refused(&["calibrate", NOTHING, "-o", text(&new), "--save", text(&new)], "-o and --save both write to");
    assert!(!new.exists());
    assert_eq!(std::fs::read_to_string(&notes).unwrap(), "mine");
    done(&["calibrate", NOTHING, "-o", text(&notes), "--overwrite"]);
    assert_eq!(FitRecord::read(&notes).unwrap().effects, [""; 0]);
    std::fs::write(&notes, std::fs::read_to_string(&notes).unwrap().replace("surgescope-fit-1", "surgescope-fit-9"))
        .unwrap();
    assert!(FitRecord::read(&notes).unwrap_err().to_string().contains("reads 'surgescope-fit-1'"));
    refused(&["results", text(&notes), "-o", text(&folder.path().join("t.csv"))], "reads 'surgescope-fit-1'");
}

fn rows(path: &Path) -> Vec<HashMap<String, String>> {
    csv::Reader::from_path(path).unwrap().deserialize().map(Result::unwrap).collect()
}

#[test]
fn many_fits_are_one_table() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let [a, b] = two_runs(folder.path());
    let fits = at("fits");
    std::fs::create_dir(&fits).unwrap();
    let of_two = fits.join("1.toml");
    done(&["calibrate", text(&a), text(&b), "--effects", "viscoelastic-wall:1", "-o", text(&of_two)]);
    done(&["calibrate", CREEP, "-o", text(&fits.join("2.json")), "--save", text(&fits.join("models.toml"))]);

    let (wide, long) = (at("wide.csv"), at("long.csv"));
    let told = done(&["results", text(&fits), "-o", text(&wide)]);
    assert_eq!((told["fits"].as_u64(), told["rows"].as_u64()), (Some(2), Some(3)), "the file of models is no fit");
    done(&["results", text(&fits), "--long", "-o", text(&long)]);
    refused(&["results", text(&fits), "-o", text(&wide)], "replace it with --overwrite");
    refused(&["results", text(&of_two), "-o", text(&at("t.xlsx"))], "must end with .csv or .parquet");
    let told = done(&["results", text(&fits), "-o", text(&at("t.parquet"))]);
    assert_eq!((told["fits"].as_u64(), told["rows"].as_u64()), (Some(2), Some(3)));
    refused(&["results", text(&at("fits/models.toml")), "-o", text(&at("t.csv"))], "is not a surgescope fit");

    let fit = FitRecord::read(&of_two).unwrap();
    let wide = rows(&wide);
    assert_eq!(
        wide.iter().map(|r| r["file"].as_str()).collect::<Vec<_>>(),
        ["run a.mcap", "run b.mcap", "hdpe-creep.mcap"]
    );
    for (row, run) in wide.iter().zip(&fit.runs) {
        for p in fit.parameters.iter().filter(|p| p.run.as_ref().is_none_or(|r| *r == run.file)) {
            assert_eq!(row[&p.name].parse::<f64>().unwrap(), p.value, "{} of {}", p.name, run.file);
            let error = row[&format!("{}_standard_error", p.name)].parse().ok();
            assert_eq!(error, p.standard_error, "{} of {}", p.name, run.file);
        }
        assert_eq!(row["rmse_m"].parse::<f64>().unwrap(), run.rmse_m);
        assert_eq!(row["effects"], "viscoelastic-wall:1");
    }
    assert_eq!(wide[0]["wave_speed_m_s"], wide[1]["wave_speed_m_s"]);
    assert_ne!(wide[0]["closing_time_s"], wide[1]["closing_time_s"]);
    assert_eq!((wide[2]["tau1_s"].as_str(), wide[0]["offset_m[P3]"].as_str()), ("", ""), "what a fit does not have");
    let long = rows(&long);
    assert_eq!(long.iter().filter(|r| r["fit"] == text(&of_two)).count(), fit.parameters.len());
    assert_eq!(long.iter().filter(|r| r["parameter"] == "closing_time_s" && r["run"] == "run b.mcap").count(), 1);
}

/// A problem of PEST as its manual says it is read.
struct Problem {
    sections: BTreeMap<String, Vec<Vec<String>>>,
    folder: PathBuf,
}

impl Problem {
    fn read(folder: &Path) -> Problem {
        let control = std::fs::read_to_string(folder.join("problem.pst")).unwrap();
        let mut lines = control.lines();
        assert_eq!(lines.next(), Some("pcf"));
        let mut sections: BTreeMap<String, Vec<Vec<String>>> = BTreeMap::new();
        let mut section = String::new();
        for line in lines {
            match line.strip_prefix("* ") {
                Some(name) => section = name.to_owned(),
                None => {
                    let words = line.split_whitespace().map(str::to_owned).collect();
                    sections.entry(section.clone()).or_default().push(words);
                }
            }
        }
        Problem { sections, folder: folder.to_owned() }
    }

    fn section(&self, name: &str) -> &[Vec<String>] {
        self.sections.get(name).map_or(&[], Vec::as_slice)
    }

    fn start(&self) -> HashMap<String, f64> {
        self.section("parameter data").iter().map(|p| (p[0].clone(), p[3].parse().unwrap())).collect()
    }

    /// The template filled in, the model command run, its output read by the instructions: observation by name.
    fn run(&self, values: &HashMap<String, f64>) -> HashMap<String, f64> {
        let io = self.section("model input/output");
        let file = |name: &str| std::fs::read_to_string(self.folder.join(name)).unwrap();
        let template = file(&io[0][0]);
        let body = template.strip_prefix("ptf ~\n").unwrap();
        let filled = |(i, part): (usize, &str)| match i % 2 {
            0 => part.to_owned(),
            // A space on either side counts to the field: 25 letters, as PEST has room for at the most, and two more.
            _ => format!("{:>25}", format!("{:.15E}", values[part.trim()])),
        };
        let text: String = body.split('~').enumerate().map(filled).collect();
        std::fs::write(self.folder.join(&io[0][1]), text).unwrap();
        let command = &self.section("model command line")[0];
        assert_eq!(command[0], "surgescope");
        let words: Vec<&str> = command[1..].iter().map(String::as_str).collect();
        printed(surgescope(words).current_dir(&self.folder).output().unwrap());
        let (instructions, shown) = (file(&io[1][0]), file(&io[1][1]));
        let mut lines = shown.lines();
        let mut found = HashMap::new();
        for instruction in instructions.strip_prefix("pif ~\n").unwrap().lines() {
            let words: Vec<&str> = instruction.split(' ').collect();
            let (first, name) = (words[0], words[words.len() - 1]);
            assert!(words[1..words.len() - 1].iter().all(|w| *w == "~,~"), "{instruction}");
            let ahead: usize = first.strip_prefix('l').unwrap().parse().unwrap();
            let line = lines.nth(ahead - 1).unwrap();
            let rest = line.splitn(words.len() - 1, ',').last().unwrap();
            let name = name.strip_prefix('!').and_then(|n| n.strip_suffix('!')).unwrap();
            found.insert(name.to_owned(), rest.parse().unwrap());
        }
        assert_eq!(lines.next(), None, "lines that nobody reads");
        found
    }

    fn phi(&self, values: &HashMap<String, f64>) -> f64 {
        let shown = self.run(values);
        let observed = self.section("observation data");
        let residual = |o: &Vec<String>| (o[1].parse::<f64>().unwrap() - shown[&o[0]]) * o[2].parse::<f64>().unwrap();
        // name 1.0 * log(parameter) = value weight group
        let prior = |p: &Vec<String>| {
            assert_eq!((p[1].as_str(), p[2].as_str(), p[4].as_str(), p.len()), ("1.0", "*", "=", 8), "{p:?}");
            let log = p[3].strip_prefix("log(").and_then(|n| n.strip_suffix(')'));
            let value = log.map_or_else(|| values[&p[3]], |name| values[name].log10());
            (p[5].parse::<f64>().unwrap() - value) * p[6].parse::<f64>().unwrap()
        };
        let own = observed.iter().map(residual).chain(self.section("prior information").iter().map(prior));
        own.map(|r| r * r).sum()
    }
}

#[test]
fn a_problem_of_pest_runs_where_it_stands_and_has_our_objective_function() {
    let folder = tempfile::tempdir().unwrap();
    let runs = two_runs(folder.path());
    let place = folder.path().join("pest");
    let asked = [
        "pest",
        text(&runs[0]),
        text(&runs[1]),
        "--effects",
        "viscoelastic-wall:2",
        "--fitted",
        "--hold",
        "friction_scale=1",
        "--every",
        "20",
        "-o",
        text(&place),
    ];
    let told = done(&asked);
    refused(&asked, "is not empty");
    assert!(!place.join("modelled.csv").exists(), "the model has not run yet");
    let problem = Problem::read(&place);

    // Sizes are what the control file says, and names what PEST takes.
    let sizes: Vec<usize> = problem.section("control data")[1].iter().map(|n| n.parse().unwrap()).collect();
    let names = |section: &str| problem.section(section).iter().map(|l| l[0].clone()).collect::<Vec<_>>();
    let groups = names("observation groups");
    let found = [
        names("parameter data").len(),
        names("observation data").len(),
        names("parameter groups").len(),
        names("prior information").len(),
        groups.len(),
    ];
    assert_eq!(sizes, found);
    // five shared, and the place of P2; velocity, head, closing time, friction, start and two offsets each
    assert_eq!(found[0], 5 + 1 + 2 * 7);
    assert_eq!(
        [&told["parameters"], &told["observations"], &told["priors"]].map(|n| n.as_u64().unwrap() as usize),
        [found[0], found[1], found[3]]
    );
    for (section, longest) in [
        ("parameter data", 12),
        ("parameter groups", 12),
        ("observation groups", 12),
        ("observation data", 20),
        ("prior information", 20),
    ] {
        let own = names(section);
        assert_eq!(own.iter().collect::<HashSet<_>>().len(), own.len(), "a name of {section} is given twice");
        let fine = |n: &String| {
            n.len() <= longest && n.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_')
        };
        assert!(own.iter().all(fine), "{section}: {own:?}");
    }
    for p in problem.section("parameter data") {
        let [value, lower, upper] = [3, 4, 5].map(|i| p[i].parse::<f64>().unwrap());
        assert!(lower <= value && value <= upper && (p[1] != "log" || lower > 0.0), "{p:?}");
        assert!(names("parameter groups").contains(&p[6]));
        assert_eq!(p[1] == "fixed", p[0].starts_with("friction"), "{p:?}");
    }
    assert!(problem.section("observation data").iter().all(|o| groups.contains(&o[3])));
    assert!(problem.section("prior information").iter().all(|p| !p[3].contains("friction")));

    // The model, run in the folder, gives the objective function that we have, and the fit is at its bottom.
    let start = problem.start();
    let phi = problem.phi(&start);
    assert!((phi / told["phi"].as_f64().unwrap() - 1.0).abs() < 1e-9, "{phi} and {}", told["phi"]);
    let freedom = (found[1] + found[3]) as f64;
    assert!(phi > 0.8 * freedom && phi < 1.2 * freedom, "{phi} of {freedom}: the fit is down to the noise");
    let moved = |factor: f64| {
        let mut values = start.clone();
        let own = names("parameter data").into_iter().find(|n| n.starts_with("wave_speed")).unwrap();
        *values.get_mut(&own).unwrap() *= factor;
        problem.phi(&values)
    };
    assert!(moved(0.99) > 1.5 * phi && moved(1.01) > 1.5 * phi, "{phi} {} {}", moved(0.99), moved(1.01));
}

#[test]
fn simulations_beside_recordings_take_values_from_files() {
    let folder = tempfile::tempdir().unwrap();
    let (values, out) = (folder.path().join("values.txt"), folder.path().join("out.csv"));
    let beside = |more: &[&str]| -> Vec<String> {
        let own = ["simulate", "--recording", NOTHING, "--values", text(&values), "-o", text(&out)];
        own.iter().chain(more).map(|s| (*s).to_owned()).collect()
    };
    let refuse =
        |more: &[&str], said: &str| refused(&beside(more).iter().map(String::as_str).collect::<Vec<_>>(), said);
    std::fs::write(&values, "wave_speed_m_s = 360\n[hdpe-nothing-missing.mcap]\noffset_m[P1] = 0.5\n").unwrap();
    refuse(&["--set", "leak_cda_mm2=1"], "no parameter 'leak_cda_mm2'");
    refuse(&["--duration", "1"], "cannot be used with");
    let times = folder.path().join("times.csv");
    std::fs::write(&times, "file,sensor,time_s,unit,value\nhdpe-nothing-missing.mcap,P7,1,m,0\n").unwrap();
    refuse(
        &["--times", text(&times)],
        "row 1: hdpe-nothing-missing.mcap has no pressure sensor or flow meter named 'P7'",
    );
    // Long before the closure the model shows the steady head, and the sensor its offset over it.
    std::fs::write(
        &times,
        "file,sensor,time_s,unit,value\nhdpe-nothing-missing.mcap,P1,0.5,m,\nhdpe-nothing-missing.mcap,Q1,,m3/s,\n",
    )
    .unwrap();
    let all = beside(&["--times", text(&times), "--set", "valve_head_m=18", "initial_velocity_m_s=0.3", "reaches=64"]);
    done(&all.iter().map(String::as_str).collect::<Vec<_>>());
    let shown = rows(&out);
    assert_eq!(shown.len(), 2);
    let value = |i: usize| shown[i]["value"].parse::<f64>().unwrap();
    assert!((value(0) - 18.5).abs() < 1e-6, "{}", value(0));
    let rig = surgescope::storage::read(&here(NOTHING)).unwrap().rig;
    assert!((value(1) / (0.3 * rig.pipes[0].area_m2()) - 1.0).abs() < 1e-12, "{}", value(1));

    // Without recordings a file of values is so many settings.
    std::fs::write(&values, "wave_speed_m_s = 3.5D+02\nvalve_head_m=25\n").unwrap();
    let told = done(&[
        "simulate",
        "--rig",
        "rigs/imperial-pe.toml",
        "--values",
        text(&values),
        "--set",
        "valve_head_m=30",
        "--duration",
        "1",
    ]);
    assert_eq!(
        (told["settings"]["wave_speed_m_s"].as_f64(), told["settings"]["valve_head_m"].as_f64()),
        (Some(350.0), Some(30.0))
    );
    std::fs::write(&values, "wave_speed_m_s = 350\n[a.mcap]\nvalve_head_m=25\n").unwrap();
    refused(
        &["simulate", "--rig", "rigs/imperial-pe.toml", "--values", text(&values)],
        "has values of 'a.mcap': name this recording with --recording",
    );
    refused(&["simulate"], "--rig");
    refused(&["results", "no-such-folder", "-o", "table.csv"], "no-such-folder does not exist: check the path");
}
