//! The draft of an effect of one's own from an explanation: the law that its forcing follows, with parameters that
//! start where it was recovered.

use crate::diagnose::rest::explanation::{Explanation, Site};
use crate::diagnose::rest::law::Law;
use crate::number::significant;
use crate::units::GRAVITY_M_S2;

/// A parameter of a draft.
struct Number {
    name: &'static str,
    says: &'static str,
    unit: &'static str,
    start: f64,
    bounds: [f64; 2],
    vanishes: bool,
}

impl Number {
    /// A strength: nothing is left of it at 0.
    fn strength(name: &'static str, says: &'static str, unit: &'static str, start: f64) -> Number {
        let bounds = if start > 0.0 { [0.0, 20.0 * start] } else { [20.0 * start, 0.0] };
        Number { name, says, unit, start, bounds, vanishes: true }
    }

    /// A number about a value.
    fn about(name: &'static str, says: &'static str, unit: &'static str, start: f64, by: f64) -> Number {
        Number { name, says, unit, start, bounds: [start - by, start + by], vanishes: false }
    }

    fn table(&self) -> String {
        let number = |v: f64| format!("{v:e}");
        let start = significant(self.start, 4);
        let vanishes = if self.vanishes { "vanishes_at = 0\n" } else { "" };
        let [low, high] = self.bounds.map(number);
        format!(
            "\n[parameter.{}]\nsays = \"{}\"\nunit = \"{}\"\nstart = {start}\nbounds = [{low}, {high}]\n{vanishes}",
            self.name, self.says, self.unit
        )
    }
}

/// The file of an effect with the law that an explanation follows; none where it follows none that an effect can have
/// at its place.
pub fn draft(name: &str, explanation: &Explanation) -> Option<String> {
    let (at, gives, law, numbers) = match (&explanation.site, explanation.pulsation, explanation.law?.0) {
        (Site::Pipe { .. } | Site::Valve, None, Law::OpensAbove { above_m, scale }) => {
            let cda_mm2 = 1e6 * scale / (2.0 * GRAVITY_M_S2).sqrt();
            let law = "if(H > set_head_m, cda_mm2 * 1e-6 * sqrt(2 * g * (H - set_head_m)), 0)";
            let numbers = vec![
                Number::about("set_head_m", "head above which it opens", "m", above_m, 0.5 * above_m.abs().max(1.0)),
                Number::strength("cda_mm2", "area of its opening times its discharge coefficient", "mm²", cda_mm2),
            ];
            (node_or_valve(&explanation.site), "flow_out_m3_s", law, numbers)
        }
        (Site::Pipe { .. } | Site::Valve, None, Law::GrowsAbove { above_m, scale }) => {
            let law = "if(H > set_head_m, flow_mL_s_m * 1e-6 * (H - set_head_m), 0)";
            let numbers = vec![
                Number::about("set_head_m", "head above which it opens", "m", above_m, 0.5 * above_m.abs().max(1.0)),
                Number::strength("flow_mL_s_m", "flow for each metre of head above that", "mL/s/m", 1e6 * scale),
            ];
            (node_or_valve(&explanation.site), "flow_out_m3_s", law, numbers)
        }
        (Site::Sensor(_), _, Law::GrowsAbove { above_m, scale }) => {
            let law = "H + if(H > from_head_m, share * (H - from_head_m), 0)";
            let numbers = vec![
                Number::about("from_head_m", "head from which it is off", "m", above_m, 0.5 * above_m.abs().max(1.0)),
                Number {
                    bounds: [-1.0, 1.0],
                    ..Number::strength("share", "error for each metre above that", "1", scale)
                },
            ];
            ("sensor", "reading_m", law, numbers)
        }
        _ => return None,
    };
    Some(file(name, explanation, (at, gives, law), &numbers))
}

/// The same of a tone of the supply.
pub fn draft_of_pulsation(name: &str, explanation: &Explanation) -> Option<String> {
    let tone = explanation.pulsation.filter(|_| explanation.site == Site::Supply)?;
    let hz = tone.frequency_hz;
    let numbers = [
        Number {
            bounds: [0.0, 5.0 * tone.amplitude],
            ..Number::strength("swing_m", "its amplitude", "m", tone.amplitude)
        },
        Number::about("frequency_Hz", "its frequency", "Hz", hz, 0.05 * hz),
        Number::about("phase_rad", "its phase when the closure starts", "rad", tone.phase_rad, std::f64::consts::PI),
    ];
    Some(file(
        name,
        explanation,
        ("supply", "head_m", "H + swing_m * (sin(2 * pi * frequency_Hz * t + phase_rad) - sin(phase_rad))"),
        &numbers,
    ))
}

fn node_or_valve(site: &Site) -> &'static str {
    if *site == Site::Valve { "valve" } else { "node" }
}

fn file(name: &str, of: &Explanation, (at, gives, law): (&str, &str, &str), numbers: &[Number]) -> String {
    let says = of.says.replace(['"', '\\'], "");
    let tables: String = numbers.iter().map(Number::table).collect();
    format!(
        "# Drafted from what would explain the rest. `surgescope effects check` shows its trace, and `diagnose` weighs it against the others.\n\
         name = \"{name}\"\nsays = \"Drafted: {says}\"\nat = \"{at}\"\ngives = \"{gives}\"\nlaw = \"{law}\"\n{tables}"
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::rest::waveform::Pulsation;
    use crate::model::own::file::read;

    fn explained(site: Site, law: Option<Law>, pulsation: Option<Pulsation>) -> Explanation {
        Explanation {
            site,
            probability: 0.9,
            evidence: 100.0,
            says: "a flow out at 41 ± 2 m".into(),
            run: "run.mcap".into(),
            time_s: Vec::new(),
            value: Vec::new(),
            sd: Vec::new(),
            onset_s: None,
            pulsation,
            law: law.map(|law| (law, 0.9)),
            left_over_noise: 1.0,
        }
    }

    /// Every draft is read as an effect, and starts at what was recovered.
    #[test]
    fn drafts_are_effects() {
        let pipe = || Site::Pipe { pipe: None, position_m: 41.0, error_m: 2.0 };
        let relief = explained(pipe(), Some(Law::OpensAbove { above_m: 52.0, scale: 2e-5 }), None);
        let d = read(&draft("relief", &relief).unwrap(), "relief.toml", "relief").unwrap();
        let cda = d.parameters.iter().find(|p| p.name == "cda_mm2").unwrap();
        assert!(
            (cda.start * 1e-6 * (2.0 * GRAVITY_M_S2).sqrt() / 2e-5 - 1.0).abs() < 1e-3 && cda.vanishes_at == Some(0.0)
        );
        let grows = Law::GrowsAbove { above_m: 50.0, scale: -0.3 };
        for (site, law) in [(Site::Sensor("P1".into()), grows), (Site::Valve, grows), (pipe(), grows)] {
            let text = draft("off", &explained(site, Some(law), None)).unwrap();
            assert!(read(&text, "off.toml", "off").is_ok(), "{text}");
        }
        let tone = Pulsation { frequency_hz: 2.31, amplitude: 1.4, phase_rad: 0.4, is_there_before: Some(true) };
        let text = draft_of_pulsation("swing", &explained(Site::Supply, None, Some(tone))).unwrap();
        let d = read(&text, "swing.toml", "swing").unwrap();
        assert_eq!(d.parameters.iter().map(|p| p.start).collect::<Vec<_>>(), [1.4, 2.31, 0.4]);
        assert_eq!(draft("none", &explained(Site::Wall, Some(grows), None)), None);
        assert_eq!(draft("none", &explained(pipe(), None, None)), None);
    }
}
