//! What `surgescope simulate` refuses, and what it says: before a run where it can be known before, and where it went wrong otherwise.

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
    refused("section-change", &other("reaches=50"), &["50 reaches are too few", "need at least 279", "--set reaches=279"]);
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
