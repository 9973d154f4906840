//! `--solver quasi-2d`: profiles and wall shear of a simulation, and a calibration that ends with it.

use crate::common::{done, parameter, refused, run, text, value};

const RIG: &str = "rigs/adelaide-copper.toml";
const DIAMETER_M: f64 = 0.0221;

#[test]
fn profiles_have_the_mean_velocity_and_the_steady_shear() {
    let folder = tempfile::tempdir().unwrap();
    let [heads, profiles, picture] = ["heads.csv", "profiles.csv", "profiles.svg"].map(|name| folder.path().join(name));
    let output = run(&[
        "simulate",
        "--rig",
        RIG,
        "--solver",
        "quasi-2d",
        "--set",
        "initial_velocity_m_s=0.3",
        "valve_head_m=60",
        "--duration",
        "0.2",
        "--csv-times",
        "0.005",
        "-o",
        text(&heads),
        "--profiles",
        text(&profiles),
        "--profiles-svg",
        text(&picture),
        "--profiles-at",
        "10",
    ]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let table = std::fs::read_to_string(&profiles).unwrap();
    let mut lines = table.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    assert_eq!(header[..4], ["time_s", "mean_velocity_m_s", "wall_shear_Pa", "steady_wall_shear_Pa"]);
    let radius =
        |name: &&str| name.trim_start_matches("v_m_s[r=").trim_end_matches("mm]").parse::<f64>().unwrap() / 1e3;
    let radii: Vec<f64> = header[4..].iter().map(radius).collect();
    let rows: Vec<Vec<f64>> = lines.map(|line| line.split(',').map(|v| v.parse().unwrap()).collect()).collect();
    assert_eq!(rows.len(), 41);
    for row in &rows {
        // 2/R² ∫ v r dr by trapezia, v = 0 at the wall.
        let points = std::iter::once((0.0, row[4])).chain(radii.iter().copied().zip(row[4..].iter().copied()));
        let points: Vec<(f64, f64)> = points.chain([(0.5 * DIAMETER_M, 0.0)]).collect();
        let integral: f64 =
            points.windows(2).map(|p| 0.5 * (p[1].0 - p[0].0) * (p[0].0 * p[0].1 + p[1].0 * p[1].1)).sum();
        let mean = 8.0 / (DIAMETER_M * DIAMETER_M) * integral;
        assert!((mean - row[1]).abs() < 2e-3, "at {} s: {mean} {}", row[0], row[1]);
    }
    // f ρV²/8 before the closure: Re 5600, Colebrook.
    let steady = 0.0361 * 999.2 * 0.3 * 0.3 / 8.0;
    assert!((rows[0][2] / steady - 1.0).abs() < 0.01 && rows[0][2] == rows[0][3], "{:?}", &rows[0][..4]);
    // A stopped flow runs on in the core and back at the wall.
    assert!(rows.iter().any(|row| row[2] < -2.0 * steady && row[1] > 0.0), "the shear turns before the flow does");
    let drawn = std::fs::read_to_string(&picture).unwrap();
    assert!(drawn.starts_with("<svg ") && drawn.contains("Velocity profiles at 10.00 m"), "{}", &drawn[..200]);
    // Both files are this command's own: it may replace them.
    let again = ["simulate", "--rig", RIG, "--solver", "quasi-2d", "--duration", "0.01", "--profiles", text(&profiles)];
    assert!(run(&again).status.success());
}

#[test]
fn profiles_need_two_dimensions_and_a_place_on_the_line() {
    refused(&["simulate", "--rig", RIG, "--profiles", "never.csv"], &["--solver quasi-2d"]);
    refused(&["simulate", "--rig", RIG, "--profiles-at", "3"], &["name a file"]);
    let far = ["simulate", "--rig", RIG, "--solver", "quasi-2d", "--profiles-at", "40", "--profiles", "never.csv"];
    refused(&far, &["40 m", "0 to 37.23 m"]);
    let other = ["simulate", "--rig", RIG, "--effects", "unsteady-friction,unsteady-friction/quasi-2d"];
    refused(&other, &["same friction"]);
}

/// Creep in a copper pipe, recorded in two dimensions. The fit starts in one and finds both.
#[test]
fn a_calibration_ends_in_two_dimensions() {
    let folder = tempfile::tempdir().unwrap();
    let record = folder.path().join("run.mcap");
    let simulated = run(&[
        "simulate",
        "--rig",
        RIG,
        "--solver",
        "quasi-2d",
        "--effects",
        "viscoelastic-wall:1,unsteady-friction",
        "--set",
        "J1_per_GPa=0.01",
        "tau1_s=0.05",
        "initial_velocity_m_s=0.2",
        "valve_head_m=60",
        "-o",
        text(&record),
    ]);
    assert!(simulated.status.success(), "{}", String::from_utf8_lossy(&simulated.stderr));
    let fit = done(&["calibrate", text(&record), "--effects", "viscoelastic-wall:1", "--solver", "quasi-2d"]);
    let effects: Vec<&str> = fit["effects"].as_array().unwrap().iter().map(|e| e.as_str().unwrap()).collect();
    assert_eq!(effects, ["viscoelastic-wall:1", "unsteady-friction/quasi-2d"]);
    assert_eq!((value(&fit, "quasi_2d_scale"), &parameter(&fit, "quasi_2d_scale")["held"]), (1.0, &true.into()));
    let (rmse_m, noise_m) = (fit["rmse_m"].as_f64().unwrap(), fit["noise_m"].as_f64().unwrap());
    assert!(rmse_m < 1.05 * noise_m, "{rmse_m} {noise_m}");
    for (name, truth) in [("J1_per_GPa", 0.01), ("tau1_s", 0.05), ("wave_speed_m_s", 1319.0)] {
        assert!((value(&fit, name) / truth - 1.0).abs() < 0.01, "{name}: {}", value(&fit, name));
    }
}
