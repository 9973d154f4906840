//! What a rig file says wrongly of a test, and the recording tells: a fit does not go astray by it, and says so.

use serde_json::Value;
use tempfile::TempDir;

use crate::common::{CREEP, ended, here, over_noise, parameter, run, text};

/// Calibrates the shipped creep recording with a changed rig file; the answer and what was said besides.
fn calibrated(from: &str, to: &str) -> (Value, String) {
    calibrated_with(&[(from, to)])
}

fn calibrated_with(changes: &[(&str, &str)]) -> (Value, String) {
    let folder = TempDir::new().unwrap();
    let rig = folder.path().join("rig.toml");
    let mut whole = std::fs::read_to_string(here("rigs/demo-hdpe.toml")).unwrap();
    for (from, to) in changes {
        assert!(whole.contains(from), "{from} is not in the rig file");
        whole = whole.replacen(from, to, 1);
    }
    std::fs::write(&rig, whole).unwrap();
    let effects = ["--effects", "viscoelastic-wall:2", "--most-reaches", "64"];
    let (code, out, said) = ended(run(&[&["calibrate", CREEP, "--json", "--rig", text(&rig)], &effects[..]].concat()));
    assert_eq!(code, 0, "{said}");
    (serde_json::from_str(&out).unwrap(), said)
}

/// The valve of that recording closes in 0.29 s.
#[test]
fn a_closing_time_far_off_is_found_in_the_first_rise() {
    for nominal in ["0.01", "1.5", "3.0"] {
        let (fit, said) = calibrated("closing_time_s = 0.30", &format!("closing_time_s = {nominal}"));
        assert!(over_noise(&fit) < 1.05, "{nominal}: {}", over_noise(&fit));
        let closing = parameter(&fit, "closing_time_s");
        assert!((closing["value"].as_f64().unwrap() / 0.29 - 1.0).abs() < 0.03, "{closing}");
        assert!(said.contains("closing_time_s of the rig file is far from it"), "{said}");
    }
    let (_, said) = calibrated("closing_time_s = 0.30", "closing_time_s = 0.20");
    assert!(!said.contains("far from it"), "{said}");
}

/// A range that ends below the first peaks, as an amplifier that clips.
#[test]
fn samples_at_the_end_of_a_range_are_left_out_and_said() {
    let (fit, said) = calibrated("range = [-100.0, 1000.0]", "range = [-100.0, 300.0]");
    assert!(over_noise(&fit) < 1.05, "{}", over_noise(&fit));
    assert!(said.contains("samples of P1 stand at the end of what it can show and are left out"), "{said}");
    assert!(!said.contains("of P2 stand"), "{said}");
}

/// P2 of that recording stands at 81.31 m. A tape that slips moves the sensor in the file, not the fit; a file that
/// calls itself exact is believed.
#[test]
fn a_sensor_that_stands_elsewhere_is_found_and_said() {
    let mut least = f64::INFINITY;
    for wrong in ["80.91", "81.81"] {
        let (fit, said) = calibrated("position_m = 81.31", &format!("position_m = {wrong}"));
        assert!(over_noise(&fit) < 1.05, "{wrong}: {}", over_noise(&fit));
        least = least.min(over_noise(&fit));
        let place = parameter(&fit, "position_m[P2]");
        let (value, error) = (place["value"].as_f64().unwrap(), place["standard_error"].as_f64().unwrap());
        assert!((value - 81.31).abs() < (3.0 * error).min(0.2), "{place}");
        assert!(said.contains("P2 stands at 81.") && said.contains(&format!("the rig file says {wrong} m")), "{said}");
    }
    let exact = "position_m = 80.91\nposition_tolerance_m = 0\nunit = \"kPa\"";
    let tape = "length_tolerance_percent = 0\nmaterial = ";
    let (fit, said) = calibrated_with(&[("position_m = 81.31\nunit = \"kPa\"", exact), ("material = ", tape)]);
    assert!(fit["parameters"].as_array().unwrap().iter().all(|p| p["name"] != "position_m[P2]"));
    assert!(over_noise(&fit) > 1.02 * least && !said.contains("stands at"), "{}: {said}", over_noise(&fit));
}

/// The valve of that recording closes in 0.29 s: a file that is sure of another time holds the fit to it.
#[test]
fn a_closing_time_is_held_as_firmly_as_the_file_knows_it() {
    let closing = |percent: &str| {
        let nominal = format!("closing_time_s = 0.20\nclosing_time_tolerance_percent = {percent}");
        let (fit, _) = calibrated("closing_time_s = 0.30", &nominal);
        parameter(&fit, "closing_time_s")["value"].as_f64().unwrap()
    };
    assert_eq!(closing("0"), 0.20);
    assert!((closing("50") / 0.29 - 1.0).abs() < 0.03, "{}", closing("50"));
}

/// Travel times give metres only by the tape: its error is stated beside that of the recording.
#[test]
fn the_share_of_the_tape_measure_is_stated() {
    let share = |fit: &Value, name: &str| {
        let p = parameter(fit, name);
        p["rig_error"].as_f64().unwrap() / p["value"].as_f64().unwrap()
    };
    let (fit, _) =
        calibrated("material = ", "length_tolerance_percent = 0.2\nwall_thickness_tolerance_percent = 3\nmaterial = ");
    assert!((share(&fit, "wave_speed_m_s") - 0.002).abs() < 1e-9);
    assert!((share(&fit, "J1_per_GPa") - 0.03f64.hypot(0.01)).abs() < 1e-9);
    assert!(parameter(&fit, "closing_time_s").get("rig_error").is_none());
}
