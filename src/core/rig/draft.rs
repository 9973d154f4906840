//! A rig file to begin with: what is known, what was assumed, and what to look at again, as commented TOML.

use crate::rig::SensorKind;
use crate::units::Unit;

/// Standard deviation of a position that is only guessed, as a share of the length: a front that air or a slow valve
/// rounds off arrives late.
const GUESSED_SHARE: f64 = 0.1;

/// What a rig file needs.
#[derive(Debug, Clone)]
pub struct Draft {
    /// The rig's name.
    pub name: String,
    /// Water temperature, °C.
    pub temperature_degc: Told<f64>,
    /// Name of the wall's material.
    pub material: String,
    /// Length, m.
    pub length_m: f64,
    /// Inner diameter, mm.
    pub inner_diameter_mm: f64,
    /// Wall thickness, mm.
    pub wall_thickness_mm: f64,
    /// What feeds the pipe: `reservoir`, `pump` or `measured`.
    pub supply: Told<String>,
    /// Closing time of the valve, s.
    pub closing_time_s: Told<f64>,
    /// Head behind the valve, m.
    pub discharge_head_m: f64,
    /// Its sensors.
    pub sensors: Vec<DraftSensor>,
}

/// A value, and where it comes from unless it was given.
#[derive(Debug, Clone, PartialEq)]
pub struct Told<T> {
    /// The value.
    pub value: T,
    /// Why it is this one; empty where it was given.
    pub why: String,
}

impl<T> Told<T> {
    /// A value that the user gave.
    pub fn given(value: T) -> Told<T> {
        Told { value, why: String::new() }
    }

    /// A value that nobody gave.
    pub fn assumed(value: T, why: impl Into<String>) -> Told<T> {
        Told { value, why: why.into() }
    }
}

/// A sensor to be.
#[derive(Debug, Clone)]
pub struct DraftSensor {
    /// Its name: the heading of its column.
    pub name: String,
    /// What it measures.
    pub kind: SensorKind,
    /// Unit of its samples.
    pub unit: Told<Unit>,
    /// Distance from the supply, m.
    pub position_m: Told<f64>,
    /// The column of a file that it is, by its full name.
    pub column: Option<String>,
}

impl Draft {
    /// What nobody gave, a line each.
    pub fn assumed(&self) -> Vec<String> {
        let of = |key: &str, value: String, why: &str| (!why.is_empty()).then(|| format!("{key} = {value}: {why}"));
        let number_of = |key: &str, told: &Told<f64>| of(key, number(told.value), &told.why);
        let mut lines: Vec<String> = [
            number_of("temperature_degC", &self.temperature_degc),
            number_of("closing_time_s", &self.closing_time_s),
            of("supply", self.supply.value.clone(), &self.supply.why),
        ]
        .into_iter()
        .flatten()
        .collect();
        for s in &self.sensors {
            let unit = (!s.unit.why.is_empty()).then(|| format!("{} in {}: {}", s.name, s.unit.value, s.unit.why));
            let place = (!s.position_m.why.is_empty())
                .then(|| format!("{} at {} m: {}", s.name, number(s.position_m.value), s.position_m.why));
            lines.extend(unit.into_iter().chain(place));
        }
        lines
    }

    /// The rig file, each value that was assumed with its reason.
    pub fn text(&self) -> String {
        let line = |key: &str, value: String, why: &str, about: &str| {
            let remark = if why.is_empty() { about.to_owned() } else { format!("assumed: {why}") };
            // A comment ends with its line.
            let remark = remark.replace(char::is_control, " ");
            let set = format!("{key} = {value}");
            if remark.is_empty() { set + "\n" } else { format!("{set:<34} # {remark}\n") }
        };
        let num = |key: &str, told: &Told<f64>, about: &str| line(key, number(told.value), &told.why, about);
        let given = |key: &str, value: f64, about: &str| line(key, number(value), "", about);
        let mut text = format!(
            "# A rig for surgescope. Check it with `surgescope rig check`; see it with `surgescope rig show`.\n\
             # Positions count from the supply (0) to the valve. Every key carries its unit.\n\
             {}\n[fluid]\nname = \"water\"\n{}\n[[pipe]]\nname = \"main\"\n{}{}{}{}",
            line("name", quoted(&self.name), "", ""),
            num("temperature_degC", &self.temperature_degc, "used where a recording has no temperature"),
            given("length_m", self.length_m, "along the pipe, with its bends"),
            given("inner_diameter_mm", self.inner_diameter_mm, ""),
            given("wall_thickness_mm", self.wall_thickness_mm, ""),
            line("material", quoted(&self.material), "", "starts and bounds of wave speed and creep"),
        );
        text += "# length_tolerance_percent = 0.5   # how well you know it: one standard deviation\n";
        text += &format!(
            "\n[upstream]\n{}\n[downstream]\nkind = \"valve\"\n{}{}",
            line("kind", quoted(&self.supply.value), &self.supply.why, "reservoir, pump or measured"),
            num("closing_time_s", &self.closing_time_s, "nominal; a fit finds the true one"),
            given("discharge_head_m", self.discharge_head_m, "head behind the valve"),
        );
        for s in &self.sensors {
            text += &format!(
                "\n[[sensor]]\nname = {}\nkind = \"{}\"\n{}{}",
                quoted(&s.name),
                s.kind.name(),
                num("position_m", &s.position_m, ""),
                line("unit", quoted(s.unit.value.symbol), &s.unit.why, ""),
            );
            let is_guess = !s.position_m.why.is_empty() && (0.0..self.length_m).contains(&s.position_m.value);
            if s.kind == SensorKind::Pressure && is_guess {
                let about = "as long as nobody has measured the position";
                text += &line("position_tolerance_m", number(GUESSED_SHARE * self.length_m), "", about);
            }
            if s.kind == SensorKind::Pressure {
                let [low, high] = [-1e5, 16e5].map(|pa| s.unit.value.from_si(pa, 1000.0));
                let range = format!("# range = [{low:.1}, {high:.1}]");
                text += &format!(
                    "{range:<34} # of its data sheet, in its unit\n{:<34} # of its data sheet\n",
                    "# accuracy_percent_fs = 0.25"
                );
            }
        }
        text
    }
}

/// A number with at most four decimals, always as TOML takes it.
fn number(value: f64) -> String {
    let text = format!("{value:.4}");
    let text = text.trim_end_matches('0');
    if text.ends_with('.') { format!("{text}0") } else { text.to_owned() }
}

/// A text as TOML takes it.
pub fn quoted(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}
