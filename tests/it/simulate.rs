//! What `surgescope simulate` refuses, and what it says: before a run where it can be known before, and where it went
//! wrong otherwise.

use std::process::Output;
use std::time::Instant;

use crate::common::{run, text};

const RIG: &str = "rigs/imperial-pe.toml";

/// The program's answer to effects and settings on a rig of 277 m.
fn simulated(effects: &str, more: &[&str]) -> Output {
    let folder = tempfile::tempdir().unwrap();
    let csv = folder.path().join("out.csv");
    let output = run(&[&["simulate", "--rig", RIG, "--effects", effects, "-o", text(&csv)], more].concat());
    assert_eq!(csv.exists(), output.status.success(), "a file stands where a run was done, and only there");
    output
}

fn refused(effects: &str, more: &[&str], words: &[&str]) {
    let output = simulated(effects, more);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{effects} {more:?}: {said}");
    assert!(output.stdout.is_empty());
    for word in words {
        assert!(said.contains(word), "{effects} {more:?}: no '{word}' in: {said}");
    }
}

#[test]
fn a_parameter_out_of_range_is_named_with_its_range() {
    let cases = [
        ("none", "wave_speed_m_s=-3", "more than zero"),
        ("none", "initial_velocity_m_s=-1", "zero or more"),
        ("none", "closing_time_s=-1", "zero or more"),
        ("none", "valve_head_m=-5", "above the discharge head"),
        ("none", "friction_scale=-1", "zero or more"),
        ("viscoelastic-wall:1", "J1_per_GPa=-1", "zero or more"),
        ("viscoelastic-wall:1", "tau1_s=0", "more than zero"),
        ("unsteady-friction", "unsteady_friction_scale=-1", "zero or more"),
        ("unsteady-friction/brunone", "brunone_scale=21", "from 0 to 20"),
        ("entrained-gas", "gas_fraction=1.5", ""),
        ("vapour-cavity", "cavity_lag_s=-1", "zero or more"),
        ("leak", "leak_cda_mm2=-1", "zero or more"),
        ("section-change", "section_wave_speed_ratio=0", "more than zero"),
        ("valve-law", "inflection_opening=1.2", ""),
        ("valve-seat-leak", "seat_cda_mm2=-0.01", "zero or more"),
        ("valve-seat-leak/stroke", "residual_opening=-0.01", ""),
        ("supply-drift", "supply_time_constant_s=0", "more than zero"),
        ("air-pocket", "polytropic_exponent=0.9", ""),
        ("moving-valve", "valve_damping_ratio=0", ""),
        ("sensor-lag@P1", "lag_time_s=-1", "zero or more"),
        ("sensor-gain@P1", "gain_error=-1", ""),
    ];
    for (effect, setting, allowed) in cases {
        let name = setting.split('=').next().unwrap();
        refused(effect, &["--set", setting], &[name, "outside its physical range", allowed]);
    }
    refused("none", &["--set", "wave_speed_m_s=nan"], &["'nan' is not a number"]);
    refused("none", &["--set", "reaches=1.5"], &["reaches = 1.5 must be a whole number"]);
}

#[test]
fn an_effect_outside_the_pipe_is_refused() {
    for (effect, name) in [
        ("leak", "leak_position_m"),
        ("blockage", "blockage_position_m"),
        ("side-branch", "branch_position_m"),
        ("section-change", "section_start_m"),
        ("section-change", "section_end_m"),
    ] {
        for place in ["-1", "277.5"] {
            refused(
                effect,
                &["--set", &format!("{name}={place}")],
                &[&format!("{name} = {place}"), "supply and valve"],
            );
        }
    }
}

/// 1 m of 277 m takes 277 reaches, and one for each of its joints.
#[test]
fn too_few_reaches_for_a_section_are_refused_with_how_many_it_takes() {
    let section =
        |reaches| ["--set", "section_start_m=100", "section_end_m=101", "section_wave_speed_ratio=1", reaches];
    let other =
        |reaches| ["--set", "section_start_m=100", "section_end_m=101", "section_wave_speed_ratio=0.999", reaches];
    refused(
        "section-change",
        &other("reaches=50"),
        &["50 reaches are too few", "need at least 279", "--set reaches=279"],
    );
    for enough in [other("reaches=279"), section("reaches=50")] {
        let output = simulated("section-change", &enough);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    }
    refused("none", &["--set", "reaches=1"], &["reaches = 1 must be a whole number from 2"]);
}

#[test]
fn a_run_larger_than_memory_is_refused_before_it_takes_any() {
    for more in [
        &["--duration", "1e9"][..],
        &["--duration", "1e300"],
        &["--duration", "100", "--set", "reaches=10000000"],
        &["--duration", "100", "--set", "wave_speed_m_s=1e9"],
    ] {
        let start = Instant::now();
        refused(
            "viscoelastic-wall:2",
            more,
            &["GiB of memory", "are free for it; shorten the duration or take fewer reaches"],
        );
        assert!(start.elapsed().as_secs() < 5, "{more:?} took {:?}", start.elapsed());
    }
}

#[test]
fn a_solution_that_stops_being_finite_names_effect_node_and_time() {
    for (effects, named) in [("none", "no effects"), ("unsteady-friction,leak", "unsteady-friction, leak")] {
        refused(
            effects,
            &["--set", "initial_velocity_m_s=1e200", "friction_factor=0"],
            &[
                "stopped being finite 0.00",
                " s after the start of the closure",
                "at the node 27",
                "m from the supply",
                named,
            ],
        );
    }
}

/// A pipe with a gauge at the valve and one between two nodes of any grid, in metres of water at 20 °C.
const COPPER: &str = r#"
name = "copper"
[fluid]
name = "water"
temperature_degC = 20.0
[[pipe]]
name = "main"
length_m = 100.0
inner_diameter_mm = 19.0
wall_thickness_mm = 1.5
material = "copper"
[upstream]
kind = "reservoir"
[downstream]
kind = "valve"
closing_time_s = 0.03
[[sensor]]
name = "P1"
kind = "pressure"
position_m = 100.0
unit = "m(H2O)"
[[sensor]]
name = "P2"
kind = "pressure"
position_m = 62.137
unit = "m(H2O)"
"#;

/// Lowest and highest head of each gauge after a sudden closure at 1 m/s and 1300 m/s without friction, read far
/// between the steps.
fn range_of_a_sudden_closure(effects: &str) -> [(f64, f64); 2] {
    let folder = tempfile::tempdir().unwrap();
    let (rig, csv) = (folder.path().join("rig.toml"), folder.path().join("out.csv"));
    std::fs::write(&rig, COPPER).unwrap();
    let output = run(&[
        "simulate",
        "--rig",
        text(&rig),
        "--effects",
        effects,
        "-o",
        text(&csv),
        "--csv-times",
        "0.00003719",
        "--duration",
        "0.6",
        "--set",
        "closing_time_s=0",
        "friction_factor=0",
        "wave_speed_m_s=1300",
        "initial_velocity_m_s=1",
        "valve_head_m=60",
    ]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let table = std::fs::read_to_string(&csv).unwrap();
    let rows: Vec<Vec<f64>> =
        table.lines().skip(1).map(|line| line.split(',').map(|v| v.parse().unwrap()).collect()).collect();
    [1, 2].map(|column| {
        rows.iter().map(|row| row[column]).fold((f64::MAX, f64::MIN), |(low, high), v| (low.min(v), high.max(v)))
    })
}

/// Joukowsky (1898): `a V / g` above and, once the wave has come back, below the steady head. No front overshoots, be
/// it between steps or nodes.
#[test]
fn a_sudden_closure_rises_and_falls_by_joukowskys_head() {
    let rise = 1300.0 / 9.81;
    for (low, high) in range_of_a_sudden_closure("none") {
        assert!((high - 60.0 - rise).abs() < 1e-6, "{high} m is not {} m", 60.0 + rise);
        assert!((low - 60.0 + rise).abs() < 1e-6, "{low} m is not {} m", 60.0 - rise);
    }
}

/// Water at 20 °C boils at 2339 Pa absolute (IAPWS 1992): 98.986 kPa below the air. The gas that starts the cavities
/// keeps them a little above that.
#[test]
fn no_head_is_written_below_that_of_vapour() {
    for (low, _) in range_of_a_sudden_closure("vapour-cavity") {
        let vapour_m = (2339.0 - 101_325.0) / (998.2 * 9.81);
        assert!(low > vapour_m - 1e-3 && low < vapour_m + 0.3, "{low} m is not {vapour_m} m");
    }
}
