//! Sensitivity against scipy, exact indices, and through the program.

use std::f64::consts::PI;

use serde_json::Value;
use surgescope::model::effects::parse_list;
use surgescope::model::{Conditions, Model};
use surgescope::rig::Rig;
use surgescope::sensitivity::anova::one_way;
use surgescope::sensitivity::features::{OUTPUTS, index};
use surgescope::sensitivity::subject::{Subject, sensor};
use surgescope::sensitivity::{morris, sobol};

use crate::common::{self, done, here, printed, run};

/// The paper's pipe with a flow that its supply can drive, and a quick closure.
const PAPER: [&str; 6] = [
    "rigs/paper-ppr.toml",
    "--effects",
    "viscoelastic-wall:2",
    "--set",
    "initial_velocity_m_s=1",
    "closing_time_s=0.06",
];

/// What it prints.
fn sensitivity(arguments: &[&str]) -> String {
    printed(run(&[&["sensitivity"], arguments].concat()))
}

fn json(arguments: &[&str]) -> Value {
    done(&[&["sensitivity"], arguments].concat())
}

fn refused(arguments: &[&str]) -> String {
    common::refused(&[&["sensitivity"], arguments].concat(), &[])
}

#[test]
fn f_and_p_are_scipys() {
    let text = std::fs::read_to_string(here("tests/reference/anova_scipy.json"));
    let fixture: Value = serde_json::from_str(&text.unwrap()).unwrap();
    let cases = fixture["cases"].as_array().unwrap();
    assert!(cases.len() >= 12);
    for case in cases {
        let groups: Vec<Vec<f64>> = serde_json::from_value(case["groups"].clone()).unwrap();
        let found = one_way(&groups).unwrap();
        let (f, p) = (case["f"].as_f64().unwrap(), case["p"].as_f64().unwrap());
        // Relative, which for p is more than the absolute 1e-9 that was asked for.
        assert!((found.f / f - 1.0).abs() < 1e-9, "{}: F {} against {f}", case["name"], found.f);
        assert!((found.p / p - 1.0).abs() < 1e-9, "{}: p {:e} against {p:e}", case["name"], found.p);
    }
}

fn ishigami(u: &[f64]) -> f64 {
    let x = [0, 1, 2].map(|i| PI * (2.0 * u[i] - 1.0));
    x[0].sin() + 7.0 * x[1].sin().powi(2) + 0.1 * x[2].powi(4) * x[0].sin()
}

/// First-order and total indices; S1 and ST1 by hand from the variances of the terms.
fn ishigami_indices() -> [(f64, f64); 3] {
    let v1 = 0.5 * (1.0 + 0.1 * PI.powi(4) / 5.0).powi(2);
    let (v2, v13) = (49.0 / 8.0, 0.01 * PI.powi(8) * (1.0 / 18.0 - 1.0 / 50.0));
    let v = v1 + v2 + v13;
    [(v1 / v, (v1 + v13) / v), (v2 / v, v2 / v), (0.0, v13 / v)]
}

#[test]
fn sobol_indices_of_the_ishigami_function_converge_to_the_exact_ones() {
    let exact = ishigami_indices();
    for (found, published) in exact.iter().zip([(0.3139, 0.5576), (0.4424, 0.4424), (0.0, 0.2437)]) {
        assert!((found.0 - published.0).abs() < 5e-5 && (found.1 - published.1).abs() < 5e-5);
    }
    for rows in [256, 1024, 4096, 16384] {
        // A term of the sums has a standard deviation of about one: plain Monte Carlo errs by 1/√N, and four times that
        // is never met. The sequence has to do better than plain Monte Carlo's one standard error.
        let tolerance = 1.0 / (rows as f64).sqrt();
        for seed in 1..=5 {
            let design = sobol::design(3, rows, seed).unwrap();
            let values: Vec<f64> = design.points.iter().map(|u| ishigami(u)).collect();
            let shares = design.shares(&values);
            for (i, (indices, exact)) in shares.parameters.iter().zip(exact).enumerate() {
                let (first, total) = (indices.first, indices.total);
                assert!((first.value - exact.0).abs() < tolerance, "{rows} rows, S{i}: {first:?} against {}", exact.0);
                assert!((total.value - exact.1).abs() < tolerance, "{rows} rows, ST{i}: {total:?} against {}", exact.1);
            }
        }
    }
}

#[test]
fn morris_ranks_the_ishigami_function() {
    let design = morris::design(3, 500, 1);
    let values: Vec<f64> = design.points.iter().map(|u| ishigami(u)).collect();
    let effects = design.effects(&values);
    // On four levels sin² takes a step of 2/3 from 0 to 3/4 or back: 7 × 3/4 / (2/3), without spread in size.
    assert!((effects[1].mu_star - 7.875).abs() < 1e-9 && effects[1].mu.abs() < 1.0, "{effects:?}");
    // x3 acts through x1 alone: by the oddness of the sine no mean effect, but spread.
    assert!(effects[2].mu.abs() < 3.0 * effects[2].mu_star_error && effects[2].sigma > 5.0, "{effects:?}");
}

#[test]
fn features_hardly_depend_on_the_grid() {
    let rig = Rig::load(&here("rigs/paper-ppr.toml")).unwrap();
    let water = rig.fluid.properties(24.0);
    let model = Model::new(&rig, &water, &parse_list("viscoelastic-wall:2").unwrap());
    let values = vec![470.0, 0.1, 0.0225, 1.5, 1.1, 1.0, 57.0, 0.06, 1.0];
    let conditions = Conditions::of(water);
    let at = |reaches| {
        let sensor = sensor(&rig, None).unwrap();
        let subject =
            Subject { model: model.clone(), conditions: conditions.clone(), values: values.clone(), reaches, sensor };
        subject.features(&values).unwrap().values()
    };
    let (usual, fine) = (at(96), at(384));
    for (output, (a, b)) in OUTPUTS.iter().zip(usual.iter().zip(&fine)) {
        // Phase is a part of a period by itself; everything else relative.
        let error = if output.name == "phase_cycles" { (a - b).abs() } else { (a / b - 1.0).abs() };
        assert!(error < 0.01, "{}: {a} on 96 reaches, {b} on 384", output.name);
    }
    // Joukowsky's rise: 470 m/s × 1 m/s / g, less what creep and friction take until the peak.
    let rise = fine[index("peak1_m")] / (470.0 / 9.81);
    assert!((0.9..1.1).contains(&rise), "{rise}");
}

#[test]
fn one_document_with_every_method_the_same_for_the_same_seed() {
    let few = [
        "--method",
        "anova,morris,sobol,map",
        "--within",
        "1.5",
        "--rows",
        "32",
        "--trajectories",
        "4",
        "--cells",
        "3",
    ];
    let study = json(&[&PAPER[..], &few].concat());
    assert_eq!(study, json(&[&PAPER[..], &few].concat()));
    assert_ne!(study["morris"], json(&[&PAPER[..], &few, &["--seed", "2"]].concat())["morris"]);
    let analyses = study["anova"]["analyses"].as_array().unwrap();
    let names: Vec<&str> = analyses.iter().map(|a| a["parameter"].as_str().unwrap()).collect();
    assert_eq!(names, ["J1_per_GPa", "tau1_s", "J2_per_GPa", "tau2_s"]);
    for analysis in analyses {
        assert_eq!(
            (&analysis["outputs"][0]["df_between"], &analysis["outputs"][0]["df_within"]),
            (&3.into(), &8.into())
        );
        assert!(analysis["outputs"][0]["f"].as_f64().unwrap() > 0.0);
    }
    assert_eq!(study["anova"]["runs"], 48);
    assert_eq!((&study["morris"]["runs"], &study["sobol"]["runs"]), (&40.into(), &(32 * 11).into()));
    let maps = study["maps"].as_array().unwrap();
    assert_eq!(maps.len(), 3);
    assert_eq!(maps[0]["raised"], serde_json::json!(["J1_per_GPa", "J2_per_GPa"]));
    assert_eq!(maps[1]["raised"], serde_json::json!(["J1_per_GPa"]));
}

#[test]
fn the_wave_speed_rules_the_times_and_the_velocity_the_first_peak() {
    let study = json(&[&PAPER[..], &["--method", "sobol", "--within", "1.2", "--rows", "128"]].concat());
    let place = |name: &str| {
        let factors = study["sobol"]["factors"].as_array().unwrap();
        factors.iter().position(|f| f["name"] == name).unwrap()
    };
    let total = |output: &str, parameter: &str| {
        let outputs = study["sobol"]["outputs"].as_array().unwrap();
        let column = outputs.iter().find(|o| o["output"]["name"] == output).unwrap();
        column["parameters"][place(parameter)]["total"]["value"].as_f64().unwrap()
    };
    assert!(total("time3_s", "wave_speed_m_s") > 0.95);
    assert!(total("peak1_m", "initial_velocity_m_s") > 0.3 && total("peak1_m", "wave_speed_m_s") > 0.3);
    assert!(total("peak1_m", "valve_head_m") < 0.01);
}

#[test]
fn maps_and_page_are_written() {
    let folder = tempfile::tempdir().unwrap();
    let page = folder.path().join("page.html");
    let (folder_name, page_name) = (folder.path().to_str().unwrap(), page.to_str().unwrap());
    let to = [
        "--method",
        "map,morris",
        "--cells",
        "4",
        "--trajectories",
        "2",
        "--within",
        "2",
        "--csv",
        folder_name,
        "--report",
        page_name,
    ];
    sensitivity(&[&PAPER[..], &to].concat());
    let csv = std::fs::read_to_string(folder.path().join("tau1_s-J1_per_GPa.csv")).unwrap();
    let mut lines = csv.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    assert_eq!(header[..3], ["tau1_s", "tau1_periods", "J1_per_GPa"]);
    assert!(header.contains(&"peak2_percent by J1_per_GPa"));
    let rows: Vec<Vec<f64>> = lines.map(|l| l.split(',').map(|v| v.parse().unwrap()).collect()).collect();
    assert_eq!(rows.len(), 16);
    let period_s = 4.0 * 37.8 / 470.0;
    assert!(rows.iter().all(|r| r.len() == header.len() && (r[1] * period_s / r[0] - 1.0).abs() < 1e-9));
    let html = std::fs::read_to_string(&page).unwrap();
    assert!(html.starts_with("<!doctype html>") && html.contains("data-page=\"sensitivity\"") && !html.contains("NaN"));
    // Each compliance is raised in two of the three maps, and three of its changes are drawn.
    for raised in ["J1_per_GPa", "J2_per_GPa"] {
        assert_eq!(html.matches(&format!("<figcaption>raising {raised}:")).count(), 6);
    }
    assert!(html.contains("id=\"morris\"") && !html.contains("id=\"sobol\""));
}

/// No estimate stands in a table without its interval: that of the JSON, halved.
#[test]
fn tables_carry_intervals() {
    let few = [&PAPER[..], &["--method", "morris,sobol", "--rows", "32", "--trajectories", "4"]].concat();
    let text = sensitivity(&few);
    let study = json(&few);
    let total = &study["sobol"]["outputs"][0]["parameters"][0]["total"];
    let number = |key: &str| total[key].as_f64().unwrap();
    let cell = format!("{:.2}±{:.2}", number("value"), 0.5 * (number("high") - number("low")));
    assert!(text.contains(&cell), "{cell}: {text}");
    assert_eq!(text.matches("half its 95% interval").count(), 2, "{text}");
    assert!(text.split("\nSobol").next().unwrap().matches('±').count() > 10, "{text}");
}

#[test]
fn slips_are_explained() {
    let with = |more: &[&str]| refused(&[&PAPER[..], more].concat());
    assert!(with(&["--range", "tau_1=0.1:0.2"]).contains("did you mean 'tau1_s'"));
    assert!(with(&["--range", "tau1_s=0.2:0.1"]).contains("less than the second"));
    assert!(with(&["--range", "tau1_s=0.1"]).contains("NAME=LOW:HIGH"));
    assert!(with(&["--range", "wave_speed_m_s=100:9000"]).contains("reaches beyond"));
    assert!(with(&["--only", "tau3_s"]).contains("unknown parameter 'tau3_s'"));
    assert!(with(&["--within", "0.5"]).contains("above 1"));
    assert!(with(&["--method", "sobol", "--rows", "7"]).contains("from 16 to 65536"));
    assert!(with(&["--sensor", "P9"]).contains("no pressure sensor 'P9'"));
    let elastic = ["rigs/demo-hdpe.toml", "--method", "map"];
    assert!(refused(&elastic).contains("viscoelastic-wall:2"));
    // As printed, the paper's friction eats more than its supply: nothing can be simulated, and the program says so.
    assert!(refused(&["rigs/paper-ppr.toml", "--method", "morris"]).contains("valve_head_m"));
}

#[test]
fn a_flow_that_its_supply_cannot_drive_is_refused_with_what_to_set() {
    let said = refused(&["rigs/paper-ppr.toml", "--effects", "viscoelastic-wall:2"]);
    assert!(said.contains("nothing would flow; set a smaller initial_velocity_m_s, or valve_head_m"), "{said}");
}
