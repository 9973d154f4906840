//! EPANET's network files (`.inp`, Rossman 2000, EPANET 2 Users Manual, appendix C): sections of lines, read into nodes
//! and links in SI.

use std::collections::HashMap;
use std::fmt;
use std::str::FromStr;

use crate::units::GRAVITY_M_S2;

/// One m of a foot and one mm of an inch.
const FOOT_M: f64 = 0.3048;
const INCH_MM: f64 = 25.4;
/// psi of a foot of water, as EPANET rounds it.
const PSI_OF_FOOT: f64 = 0.4333;
/// Units of flow: their names, m³/s, and whether lengths are in feet and diameters in inches.
const FLOWS: [(&str, f64, bool); 11] = [
    ("CFS", 0.028_316_846_592, true),
    ("GPM", 6.309_019_64e-5, true),
    ("MGD", 0.043_812_636_388_9, true),
    ("IMGD", 0.052_616_782_407_4, true),
    ("AFD", 0.014_276_410_157, true),
    ("LPS", 1e-3, false),
    ("LPM", 1e-3 / 60.0, false),
    ("MLD", 1e3 / 86400.0, false),
    ("CMH", 1.0 / 3600.0, false),
    ("CMD", 1.0 / 86400.0, false),
    ("CMS", 1.0, false),
];

/// How friction is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Friction {
    /// Coefficients of Hazen and Williams.
    HazenWilliams,
    /// Roughnesses, mm.
    Darcy,
    /// Manning's coefficients.
    Manning,
}

/// What a node is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum NodeKind {
    /// With what is drawn off, m³/s.
    Junction(f64),
    /// Of a constant head, m.
    Reservoir(f64),
    /// With its level, m, and area, m².
    Tank(f64, f64),
}

/// A node.
#[derive(Debug, Clone, PartialEq)]
pub struct Node {
    /// Its name.
    pub name: String,
    /// What it is.
    pub kind: NodeKind,
    /// Its elevation, m.
    pub elevation_m: f64,
    /// Of an emitter there, area times discharge coefficient, m²; 0 without one.
    pub emitter_m2: f64,
    /// Where it is drawn.
    pub at: Option<[f64; 2]>,
}

/// What a link is.
#[derive(Debug, Clone, PartialEq)]
pub enum LinkKind {
    /// A pipe.
    Pipe {
        /// Length, m.
        length_m: f64,
        /// Inner diameter, mm.
        diameter_mm: f64,
        /// Coefficient of its friction ([`Friction`]).
        roughness: f64,
        /// Coefficient of a minor loss.
        minor: f64,
        /// Whether it has a check valve.
        check: bool,
    },
    /// A pump.
    Pump {
        /// Points of its curve, m³/s and m; none where it has only a power.
        points: Vec<(f64, f64)>,
        /// Its relative speed.
        speed: f64,
    },
    /// A valve.
    Valve {
        /// Its bore, mm.
        diameter_mm: f64,
        /// Its type: `TCV`, `PRV`, …
        kind: String,
        /// Its setting; of a throttle valve (TCV) without one its minor loss.
        setting: f64,
    },
}

/// A link that is open.
#[derive(Debug, Clone, PartialEq)]
pub struct Link {
    /// Its name.
    pub name: String,
    /// The nodes where it begins and ends, by index.
    pub ends: [usize; 2],
    /// What it is.
    pub kind: LinkKind,
}

/// What a file describes.
#[derive(Debug, Clone)]
pub struct Network {
    /// Its nodes.
    pub nodes: Vec<Node>,
    /// Its links; closed ones are left out.
    pub links: Vec<Link>,
    /// How its friction is written.
    pub friction: Friction,
    /// What the file has and this does not.
    pub left_out: Vec<String>,
}

/// What is wrong with a file, and in which line.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {what}")]
pub struct Fault {
    /// The line, from 1.
    pub line: usize,
    /// What is wrong.
    pub what: String,
}

/// The words of a line.
struct Row<'a> {
    line: usize,
    words: Vec<&'a str>,
}

impl Row<'_> {
    fn fault(&self, what: impl fmt::Display) -> Fault {
        Fault { line: self.line, what: what.to_string() }
    }

    fn word(&self, i: usize, what: &str) -> Result<&str, Fault> {
        self.words.get(i).copied().ok_or_else(|| self.fault(format!("{what} is missing")))
    }

    fn number(&self, i: usize, what: &str) -> Result<f64, Fault> {
        let word = self.word(i, what)?;
        let number = f64::from_str(word).ok().filter(|v| v.is_finite());
        number.ok_or_else(|| self.fault(format!("{what} must be a number, not '{word}'")))
    }

    fn positive(&self, i: usize, what: &str) -> Result<f64, Fault> {
        let number = self.number(i, what)?;
        if number > 0.0 { Ok(number) } else { Err(self.fault(format!("{what} must be above 0, not {number}"))) }
    }

    /// A number that may be left out.
    fn or(&self, i: usize, default: f64, what: &str) -> Result<f64, Fault> {
        if i < self.words.len() { self.number(i, what) } else { Ok(default) }
    }

    fn says(&self, i: usize, word: &str) -> bool {
        self.words.get(i).is_some_and(|w| w.eq_ignore_ascii_case(word))
    }
}

/// Reads a file.
///
/// # Errors
/// A line that is not as EPANET has it, a node or curve that is not there, a unit that is not known.
pub fn read(text: &str) -> Result<Network, Fault> {
    let mut sections: HashMap<String, Vec<Row>> = HashMap::new();
    let mut section = String::new();
    for (i, line) in text.lines().enumerate() {
        let line = line.split(';').next().unwrap_or_default().trim();
        if let Some(name) = line.strip_prefix('[') {
            section = name.trim_end_matches(']').to_ascii_uppercase();
        } else if !line.is_empty() {
            let row = Row { line: i + 1, words: line.split_whitespace().collect() };
            sections.entry(section.clone()).or_default().push(row);
        }
    }
    let rows = |name: &str| sections.get(name).map_or(&[][..], Vec::as_slice);
    let option = |name: &str| rows("OPTIONS").iter().find(|row| row.says(0, name));
    let (flow_m3_s, american) = match option("UNITS") {
        None => (FLOWS[1].1, true),
        Some(row) => {
            let unit = row.word(1, "the unit of flow")?;
            let known = FLOWS.iter().find(|(name, ..)| name.eq_ignore_ascii_case(unit));
            known.map(|u| (u.1, u.2)).ok_or_else(|| row.fault(format!("the unit of flow '{unit}' is not known")))?
        }
    };
    let (length, millimetres) = if american { (FOOT_M, INCH_MM) } else { (1.0, 1.0) };
    let friction = match option("HEADLOSS") {
        Some(row) if row.says(1, "D-W") => Friction::Darcy,
        Some(row) if row.says(1, "C-M") => Friction::Manning,
        Some(row) if !row.says(1, "H-W") => return Err(row.fault("the formula of headloss must be H-W, D-W or C-M")),
        _ => Friction::HazenWilliams,
    };
    let times = option("DEMAND").filter(|row| row.says(1, "MULTIPLIER")).map_or(Ok(1.0), |row| row.number(2, "it"))?;

    // Of a pattern, what it says of time 0.
    let mut patterns: HashMap<&str, f64> = HashMap::new();
    for row in rows("PATTERNS") {
        if !patterns.contains_key(row.words[0]) {
            patterns.insert(row.words[0], row.number(1, "the multiplier")?);
        }
    }
    let usual = option("PATTERN").map_or(Ok("1"), |row| row.word(1, "the pattern"))?;
    let pattern = |row: &Row, i: usize, default: &str| match row.words.get(i) {
        None => Ok(patterns.get(default).copied().unwrap_or(1.0)),
        Some(name) => patterns.get(name).copied().ok_or_else(|| row.fault(format!("there is no pattern '{name}'"))),
    };
    let mut demands: HashMap<&str, f64> = HashMap::new();
    for row in rows("DEMANDS") {
        *demands.entry(row.words[0]).or_default() += row.number(1, "the demand")? * pattern(row, 2, usual)?;
    }
    let exponent = option("EMITTER").filter(|row| row.says(1, "EXPONENT"));
    if let Some(row) = exponent
        && !rows("EMITTERS").is_empty()
        && row.number(2, "the exponent of emitters")? != 0.5
    {
        return Err(row.fault("only emitters of exponent 0.5 are taken, which are openings"));
    }
    // Flow at a head of 1 m: coefficients are those at 1 psi, or at 1 m.
    let head_m = if american { FOOT_M / PSI_OF_FOOT } else { 1.0 };
    let mut emitters: HashMap<&str, f64> = HashMap::new();
    for row in rows("EMITTERS") {
        let flow_m3_s = row.number(1, "the emitter's coefficient")? * flow_m3_s / head_m.sqrt();
        emitters.insert(row.words[0], flow_m3_s / (2.0 * GRAVITY_M_S2).sqrt());
    }
    let mut nodes: Vec<Node> = Vec::new();
    let mut named: HashMap<&str, usize> = HashMap::new();
    for (section, kind) in [("JUNCTIONS", 0), ("RESERVOIRS", 1), ("TANKS", 2)] {
        for row in rows(section) {
            let name = row.words[0];
            let height_m = length * row.or(1, 0.0, "the height")?;
            let kind = match kind {
                0 => {
                    let own = match demands.get(name) {
                        Some(&demand) => demand,
                        None => row.or(2, 0.0, "the demand")? * pattern(row, 3, usual)?,
                    };
                    NodeKind::Junction(own * times * flow_m3_s)
                }
                1 => NodeKind::Reservoir(height_m * pattern(row, 2, "")?),
                _ => {
                    let diameter_m = length * row.positive(5, "the tank's diameter")?;
                    let level_m = height_m + length * row.number(2, "the tank's level")?;
                    NodeKind::Tank(level_m, std::f64::consts::FRAC_PI_4 * diameter_m * diameter_m)
                }
            };
            if named.insert(name, nodes.len()).is_some() {
                return Err(row.fault(format!("there are two nodes '{name}'")));
            }
            let elevation_m = if matches!(kind, NodeKind::Reservoir(_)) { 0.0 } else { height_m };
            let emitter_m2 = emitters.get(name).copied().unwrap_or_default();
            nodes.push(Node { name: name.to_owned(), kind, elevation_m, emitter_m2, at: None });
        }
    }
    for row in rows("COORDINATES") {
        if let Some(&n) = named.get(row.words[0]) {
            nodes[n].at = Some([row.number(1, "the coordinate")?, row.number(2, "the coordinate")?]);
        }
    }
    let mut curves: HashMap<&str, Vec<(f64, f64)>> = HashMap::new();
    for row in rows("CURVES") {
        let point = (row.number(1, "the curve's x")?, row.number(2, "the curve's y")?);
        curves.entry(row.words[0]).or_default().push(point);
    }
    let mut left_out = Vec::new();
    let status = |name: &str| rows("STATUS").iter().rev().find(|row| row.words[0] == name);
    let mut links = Vec::new();
    for section in ["PIPES", "PUMPS", "VALVES"] {
        for row in rows(section) {
            let end = |i: usize| {
                let name = row.word(i, "a node")?;
                named.get(name).copied().ok_or_else(|| row.fault(format!("there is no node '{name}'")))
            };
            let ends = [end(1)?, end(2)?];
            let name = row.words[0];
            let shut = status(name).is_some_and(|row| row.says(1, "CLOSED"));
            if shut || (section == "PIPES" && row.says(7, "CLOSED")) {
                left_out.push(format!("'{name}', which is closed"));
                continue;
            }
            let kind = match section {
                "PIPES" => LinkKind::Pipe {
                    length_m: length * row.positive(3, "the pipe's length")?,
                    diameter_mm: millimetres * row.positive(4, "the pipe's diameter")?,
                    // Of Darcy's formula in mm, or in 1/1000 ft.
                    roughness: match friction {
                        Friction::Darcy => length * row.number(5, "the pipe's roughness")?,
                        _ => row.positive(5, "the pipe's roughness")?,
                    },
                    minor: row
                        .or(6, 0.0, "the minor loss")
                        .or_else(|fault| if row.words.len() == 7 { Ok(0.0) } else { Err(fault) })?,
                    check: row.words[6..].iter().any(|w| w.eq_ignore_ascii_case("CV")),
                },
                "PUMPS" => {
                    let curve = row.words.iter().position(|w| w.eq_ignore_ascii_case("HEAD"));
                    let points = match curve {
                        None => Vec::new(),
                        Some(i) => {
                            let name = row.word(i + 1, "the pump's curve")?;
                            let own =
                                curves.get(name).ok_or_else(|| row.fault(format!("there is no curve '{name}'")))?;
                            own.iter().map(|(q, h)| (q * flow_m3_s, h * length)).collect()
                        }
                    };
                    let speed = row.words.iter().position(|w| w.eq_ignore_ascii_case("SPEED"));
                    let speed = speed.map_or(Ok(1.0), |i| row.number(i + 1, "the pump's speed"))?;
                    let set = status(name).and_then(|row| f64::from_str(row.words.get(1)?).ok());
                    LinkKind::Pump { points, speed: set.unwrap_or(speed) }
                }
                _ => LinkKind::Valve {
                    diameter_mm: millimetres * row.positive(3, "the valve's diameter")?,
                    kind: row.word(4, "the valve's type")?.to_ascii_uppercase(),
                    setting: match row.or(5, 0.0, "the valve's setting").unwrap_or(0.0) {
                        0.0 => row.or(6, 0.0, "the minor loss")?,
                        setting => setting,
                    },
                },
            };
            links.push(Link { name: name.to_owned(), ends, kind });
        }
    }
    if !patterns.is_empty() {
        left_out.push("the course of patterns: demands and heads are those at time 0".to_owned());
    }
    for (section, words) in [("CONTROLS", "controls"), ("RULES", "rules")] {
        left_out.extend((!rows(section).is_empty()).then(|| words.to_owned()));
    }
    let minor = links.iter().filter(|l| matches!(l.kind, LinkKind::Pipe { minor, .. } if minor > 0.0)).count();
    left_out.extend((minor > 0 && friction == Friction::Darcy).then(|| format!("the minor losses of {minor} pipes")));
    Ok(Network { nodes, links, friction, left_out })
}

#[cfg(test)]
mod tests {
    use super::*;

    const SMALL: &str = "[JUNCTIONS]\n;ID Elev Demand\n 10 710 0\n 11 700 150 ;\n[RESERVOIRS]\n 9 800\n[TANKS]\n 2 850 120 100 150 50.5 0\n\
        [PIPES]\n 10 10 11 10530 18 100 0 Open\n 110 2 11 200 18 100 0 Open\n[PUMPS]\n 9 9 10 HEAD 1\n[CURVES]\n 1 1500 250\n\
        [OPTIONS]\n Units GPM\n Headloss H-W\n[COORDINATES]\n 10 20 70\n[CONTROLS]\n LINK 9 OPEN IF NODE 2 BELOW 110\n[END]\n";

    /// Feet, inches and US gallons a minute become metres, millimetres and m³/s.
    #[test]
    fn units_are_converted_and_what_is_left_out_is_said() {
        let network = read(SMALL).unwrap();
        assert_eq!(network.friction, Friction::HazenWilliams);
        let NodeKind::Junction(drawn_m3_s) = network.nodes[1].kind else { panic!() };
        assert!((drawn_m3_s * 1e3 - 9.46353).abs() < 1e-4);
        let NodeKind::Tank(level_m, area_m2) = network.nodes[3].kind else { panic!() };
        assert!((level_m - 970.0 * 0.3048).abs() < 1e-9 && (area_m2 - 186.081).abs() < 1e-2, "{area_m2}");
        let LinkKind::Pipe { length_m, diameter_mm, .. } = network.links[0].kind else { panic!() };
        assert!((length_m - 3209.544).abs() < 1e-9 && (diameter_mm - 457.2).abs() < 1e-9);
        let LinkKind::Pump { points, .. } = &network.links[2].kind else { panic!() };
        assert!((points[0].0 - 0.094635).abs() < 1e-6 && (points[0].1 - 76.2).abs() < 1e-9);
        assert_eq!((network.nodes[0].at, network.nodes[1].at), (Some([20.0, 70.0]), None));
        assert_eq!(network.left_out, ["controls"]);
    }

    /// 2 US gallons a minute at 1 psi: 2 · 6.309e-5 m³/s at 0.7034 m, of which √(2g h) is 3.714 m/s. A pattern counts
    /// with its first number.
    #[test]
    fn emitters_are_openings_and_patterns_are_those_of_time_0() {
        let more = "[EMITTERS]\n 10 2\n[PATTERNS]\n 1 1.5 0.7\n 1 0.2\n h 0.9\n[OPTIONS]";
        let network = read(&SMALL.replacen("[OPTIONS]", more, 1).replacen(" 9 800", " 9 800 h", 1)).unwrap();
        assert!((network.nodes[0].emitter_m2 * 1e6 - 33.97).abs() < 0.01, "{}", network.nodes[0].emitter_m2);
        let NodeKind::Junction(drawn_m3_s) = network.nodes[1].kind else { panic!() };
        assert!((drawn_m3_s * 1e3 - 1.5 * 9.46353).abs() < 1e-4);
        let NodeKind::Reservoir(head_m) = network.nodes[2].kind else { panic!() };
        assert!((head_m - 720.0 * 0.3048).abs() < 1e-9);
    }

    #[test]
    fn what_cannot_be_read_is_told_with_its_line() {
        for (from, to, says) in [
            ("GPM", "XYZ", "line 17: the unit of flow 'XYZ' is not known"),
            ("10530 18", "long 18", "line 10: the pipe's length must be a number, not 'long'"),
            ("10530 18", "10530 0", "line 10: the pipe's diameter must be above 0, not 0"),
            (" 110 2 11", " 110 2 12", "line 11: there is no node '12'"),
            ("HEAD 1", "HEAD 7", "line 13: there is no curve '7'"),
            ("H-W", "X-Y", "line 18: the formula of headloss must be H-W, D-W or C-M"),
            (" 9 800", " 10 800", "line 6: there are two nodes '10'"),
            (" 10 710 0", " 10 710 0 summer", "line 3: there is no pattern 'summer'"),
            (
                "Units GPM",
                "Emitter Exponent 0.6\n Units GPM\n[EMITTERS]\n 10 3\n[OPTIONS]",
                "line 17: only emitters of exponent 0.5 are taken, which are openings",
            ),
        ] {
            assert_eq!(read(&SMALL.replacen(from, to, 1)).unwrap_err().to_string(), says);
        }
    }
}
