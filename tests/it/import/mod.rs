//! What a user relies on when data come from other programs: messy tables, TDMS, foreign MCAP, several files on several
//! clocks.

mod align;
mod csv;
mod devices;
mod foreign;
mod mcap;
mod stated;
mod tdms;
mod unread;
mod written;

use std::fs;
use std::path::PathBuf;

use serde_json::Value;
use surgescope::recording::Recording;
use surgescope::storage as log;
use tempfile::TempDir;

use crate::common::{ended, surgescope};

/// A folder with a rig file, in which `import` runs.
struct Bench {
    folder: TempDir,
}

impl Bench {
    /// `sensors`: name, kind, unit, and lines of their own.
    fn new(sensors: &[(&str, &str, &str, &str)]) -> Bench {
        let bench = Bench { folder: tempfile::tempdir().unwrap() };
        let mut text = r#"name = "bench"
fluid = { name = "water", temperature_degC = 20.0 }
upstream = { kind = "reservoir" }
downstream = { kind = "valve", closing_time_s = 0.02 }
[[pipe]]
name = "main"
length_m = 100.0
inner_diameter_mm = 50.0
wall_thickness_mm = 5.0
material = "HDPE"
wave_speed_m_s = 400.0
"#
        .to_string();
        for (name, kind, unit, more) in sensors {
            let place = if more.contains("position_m") { "" } else { "position_m = 100.0" };
            text += &format!("[[sensor]]\nname = \"{name}\"\nkind = \"{kind}\"\nunit = \"{unit}\"\n{place}\n{more}\n");
        }
        bench.put("rig.toml", text);
        bench
    }

    /// Two pressure sensors.
    fn plain() -> Bench {
        Bench::new(&[("P1", "pressure", "kPa", ""), ("P2", "pressure", "bar", "position_m = 60.0")])
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn put(&self, name: &str, content: impl AsRef<[u8]>) {
        fs::write(self.path(name), content).unwrap();
    }

    /// Runs `import ARGS --rig rig.toml -o run.mcap --json`, which must end with `code`; the document and the messages.
    fn import(&self, code: i32, args: &[&str]) -> (Value, String) {
        let _ = fs::remove_file(self.path("run.mcap"));
        let mut command = surgescope(["import"]);
        command.args(args).args(["--rig", "rig.toml", "-o", "run.mcap", "--json"]);
        let (ended, out, err) = ended(command.current_dir(self.folder.path()).output().unwrap());
        assert_eq!(ended, code, "{args:?}\n{out}\n{err}");
        assert!(!err.contains("panicked"), "{err}");
        (serde_json::from_str(&out).unwrap_or(Value::Null), err)
    }

    /// An import that must be refused in words that hold each of `words`, and leave nothing.
    fn refuses(&self, args: &[&str], words: &[&str]) {
        let (_, err) = self.import(2, args);
        for word in words {
            assert!(err.contains(word), "'{word}' is not in: {err}");
        }
        assert!(!self.path("run.mcap").exists());
    }

    fn recording(&self) -> Recording {
        log::read(&self.path("run.mcap")).unwrap()
    }
}

/// The entry of a kind among what was mended.
fn mended<'d>(document: &'d Value, what: &str) -> &'d Value {
    let all = document["mended"].as_array().unwrap();
    all.iter().find(|m| m["what"] == what).unwrap_or_else(|| panic!("no '{what}' in {all:?}"))
}
