//! A rig file from an EPANET network: valves and pumps, links there, become nodes to which pipes lead.

use std::fmt::Write as _;

use crate::draft::epanet::{Friction, Link, LinkKind, Network, NodeKind};
use crate::rig::draft::quoted;
use crate::units::GRAVITY_M_S2;

/// Velocity at which Hazen and Williams' friction is taken, m/s: Darcy's factor falls with its power of -0.148.
const TAKEN_AT_M_S: f64 = 1.0;

/// A message names no more nodes than this.
const MOST_NAMED: usize = 12;

/// What a network file does not say.
pub struct Told<'a> {
    /// Name of the rig.
    pub name: &'a str,
    /// Temperature of the water, °C.
    pub temperature_degc: f64,
    /// Material and thickness (mm) of all walls.
    pub material: &'a str,
    /// See `material`.
    pub wall_thickness_mm: f64,
    /// The valve that closes, or the dead end where the flow is shut off; where there is one valve, none.
    pub valve: Option<&'a str>,
    /// Its closing time, s.
    pub closing_time_s: f64,
    /// Symbol of the unit of its pressure sensor.
    pub unit: &'a str,
}

/// A rig file, with what was assumed.
pub struct Drafted {
    /// The file.
    pub text: String,
    /// What was assumed.
    pub assumed: Vec<String>,
}

/// A node of the rig: its name, its table's lines, and where it is drawn.
struct Made {
    name: String,
    lines: String,
    at: Option<[f64; 2]>,
}

/// Writes the rig file.
///
/// # Errors
/// No valve, or several and none named; what a rig file cannot have, with its name.
pub fn draft(network: &Network, told: &Told) -> Result<Drafted, String> {
    let Network { nodes, links, friction, .. } = network;
    let is_pipe = |link: &Link| matches!(link.kind, LinkKind::Pipe { .. });
    let mut pipes_at = vec![0; nodes.len()];
    links.iter().filter(|l| is_pipe(l)).flat_map(|l| l.ends).for_each(|n| pipes_at[n] += 1);
    let passed: Vec<&Link> = links.iter().filter(|l| !is_pipe(l)).collect();
    let closing = closing(network, told.valve)?;
    let mut assumed = Vec::new();

    // Where pipes begin and end: at their nodes, or at the valve or pump that takes a node's place, before it or behind it.
    let mut place: Vec<Option<(usize, bool)>> = vec![None; nodes.len()];
    for (i, link) in passed.iter().enumerate() {
        for (end, behind) in link.ends.into_iter().zip([false, true]) {
            match nodes[end].kind {
                NodeKind::Junction(drawn) => {
                    let shut_off = closing == Closing::Link(link.name.as_str()) && behind && pipes_at[end] == 0;
                    if drawn != 0.0 && !shut_off {
                        return Err(format!(
                            "'{}' stands at the junction '{}', at which flow is drawn off: move the demand to the next junction",
                            link.name, nodes[end].name
                        ));
                    }
                    if place[end].replace((i, behind)).is_some() {
                        return Err(format!(
                            "two valves or pumps meet at '{}': put a pipe between them",
                            nodes[end].name
                        ));
                    }
                }
                NodeKind::Reservoir(_) | NodeKind::Tank(..) if pipes_at[end] > 0 && behind => {
                    return Err(format!(
                        "'{}' leads into '{}' without a pipe: put one between them",
                        link.name, nodes[end].name
                    ));
                }
                NodeKind::Reservoir(_) | NodeKind::Tank(..) => {}
            }
        }
    }
    let taken: Vec<&str> = nodes.iter().map(|n| n.name.as_str()).collect();
    let name_of = |link: &Link| match taken.contains(&link.name.as_str()) {
        true => format!("{} {}", if matches!(link.kind, LinkKind::Pump(_)) { "pump" } else { "valve" }, link.name),
        false => link.name.clone(),
    };
    let passed_names: Vec<String> = passed.iter().map(|link| name_of(link)).collect();

    // Of a reservoir only the level is known: the pipe is taken to lead away from it level.
    let height_m = |n: usize| match nodes[n].kind {
        NodeKind::Reservoir(_) => {
            let pipe = links.iter().find(|link| is_pipe(link) && link.ends.contains(&n));
            pipe.map_or(0.0, |link| nodes[link.ends[0] + link.ends[1] - n].elevation_m)
        }
        _ => nodes[n].elevation_m,
    };
    let mut made: Vec<Made> = Vec::new();
    let closes = format!("kind = \"valve\"\nclosing_time_s = {}\n", told.closing_time_s);
    for (n, node) in nodes.iter().enumerate() {
        // Pumps take the level of the water that they stand in, valves that into which they lead.
        if place[n].is_some() || pipes_at[n] == 0 {
            continue;
        }
        let mut lines = match node.kind {
            NodeKind::Junction(_) if closing == Closing::End(n) => closes.clone(),
            NodeKind::Junction(drawn) if drawn != 0.0 => {
                format!("kind = \"junction\"\ndemand_m3_h = {}\n", short(drawn * 3600.0))
            }
            NodeKind::Junction(_) => "kind = \"junction\"\n".to_owned(),
            NodeKind::Reservoir(head_m) => format!("kind = \"reservoir\"\nhead_m = {}\n", short(head_m)),
            NodeKind::Tank(head_m, area_m2) => {
                format!("kind = \"tank\"\nhead_m = {}\narea_m2 = {}\n", short(head_m), short(area_m2))
            }
        };
        lines += &elevation(height_m(n));
        made.push(Made { name: node.name.clone(), lines, at: node.at });
    }
    for (link, name) in passed.iter().zip(&passed_names) {
        let [before, behind] = link.ends;
        let level = |n: usize| match nodes[n].kind {
            NodeKind::Reservoir(head_m) | NodeKind::Tank(head_m, _) => Some(head_m),
            NodeKind::Junction(_) => None,
        };
        let mut lines = match &link.kind {
            _ if closing == Closing::Link(link.name.as_str()) => closes.clone(),
            LinkKind::Pump(points) if points.is_empty() => {
                return Err(format!("the pump '{}' has no curve of heads: give it one (HEAD)", link.name));
            }
            LinkKind::Pump(points) => {
                let points: Vec<String> =
                    points.iter().map(|(q, h)| format!("[{}, {}]", short(q * 3600.0), short(*h))).collect();
                let suction = level(before).map_or(String::new(), |h| format!("suction_head_m = {}\n", short(h)));
                format!("kind = \"pump\"\ncurve_m3_h_m = [{}]\n{suction}", points.join(", "))
            }
            // K v²/2g over the valve's bore.
            LinkKind::Valve { diameter_mm, kind, setting } if kind == "TCV" && *setting > 0.0 => {
                let cda_mm2 = std::f64::consts::FRAC_PI_4 * diameter_mm * diameter_mm / setting.sqrt();
                format!("kind = \"valve\"\ncda_mm2 = {}\n", short(cda_mm2))
            }
            LinkKind::Valve { kind, .. } => {
                return Err(format!(
                    "'{}' is a {kind}: of valves that do not close, only throttle valves (TCV) with a loss above 0 can be taken",
                    link.name
                ));
            }
            LinkKind::Pipe { .. } => continue,
        };
        let at_junction = [before, behind].into_iter().find(|&n| matches!(nodes[n].kind, NodeKind::Junction(_)));
        lines += &elevation(at_junction.map_or(0.0, height_m));
        if !matches!(link.kind, LinkKind::Pump(_))
            && let Some(head_m) = level(behind)
        {
            let _ = writeln!(lines, "discharge_head_m = {}", short(head_m));
        }
        made.push(Made { name: name.clone(), lines, at: nodes[before].at.or(nodes[behind].at) });
    }

    let mut text = format!(
        "name = {}\n\n[fluid]\nname = \"water\"\ntemperature_degC = {}\n",
        quoted(told.name),
        told.temperature_degc
    );
    let all_drawn = made.iter().all(|node| node.at.is_some());
    for Made { name, lines, at } in &made {
        let at = at.filter(|_| all_drawn).map_or(String::new(), |[x, y]| format!("at = [{x:?}, {y:?}]\n"));
        let _ = write!(text, "\n[[node]]\nname = {}\n{lines}{at}", quoted(name));
    }
    for link in links {
        let LinkKind::Pipe { length_m, diameter_mm, roughness, check, .. } = link.kind else { continue };
        if check {
            return Err(format!(
                "the pipe '{}' has a check valve: make it a link of its own (a valve) between two pipes",
                link.name
            ));
        }
        // Whether a pipe must end at a node (or else begin there).
        let must_end = |n: usize| match place[n] {
            Some((_, behind)) => Some(!behind),
            None => (closing == Closing::End(n)).then_some(true),
        };
        let [from, to] = directed(link, must_end)?;
        let end = |n: usize| place[n].map_or(nodes[n].name.as_str(), |(i, _)| passed_names[i].as_str());
        let friction = match friction {
            Friction::Darcy => format!("roughness_mm = {}", short(roughness)),
            Friction::HazenWilliams | Friction::Manning => {
                format!("friction_factor = {}", short(darcy_factor(*friction, roughness, diameter_mm * 1e-3)))
            }
        };
        let _ = write!(
            text,
            "\n[[pipe]]\nname = {}\nfrom = {}\nto = {}\nlength_m = {}\ninner_diameter_mm = {}\nwall_thickness_mm = {}\nmaterial = {}\n{friction}\n",
            quoted(&link.name),
            quoted(end(from)),
            quoted(end(to)),
            short(length_m),
            short(diameter_mm),
            told.wall_thickness_mm,
            quoted(told.material)
        );
    }
    let valve = match closing {
        Closing::End(n) => nodes[n].name.clone(),
        Closing::Link(name) => {
            passed.iter().position(|l| l.name == name).map_or_else(String::new, |i| passed_names[i].clone())
        }
    };
    let _ = write!(
        text,
        "\n[[sensor]]\nname = \"P1\"\nkind = \"pressure\"\nnode = {}\nunit = {}\n",
        quoted(&valve),
        quoted(told.unit)
    );
    assumed.push(format!("a pressure sensor P1 at '{valve}', which closes"));
    if *friction == Friction::HazenWilliams {
        assumed.push(format!("friction factors that have Hazen and Williams' loss at {TAKEN_AT_M_S} m/s"));
    }
    Ok(Drafted { text, assumed })
}

fn elevation(height_m: f64) -> String {
    if height_m == 0.0 { String::new() } else { format!("elevation_m = {}\n", short(height_m)) }
}

/// What closes: a valve by its name, or a dead end.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Closing<'a> {
    Link(&'a str),
    End(usize),
}

fn closing<'a>(network: &'a Network, named: Option<&str>) -> Result<Closing<'a>, String> {
    let mut links_at = vec![0; network.nodes.len()];
    network.links.iter().flat_map(|link| link.ends).for_each(|n| links_at[n] += 1);
    let a_pipe = |n: usize| {
        let mut own = network.links.iter().filter(|link| link.ends.contains(&n));
        links_at[n] == 1 && own.all(|link| matches!(link.kind, LinkKind::Pipe { .. }))
    };
    let valves = network.links.iter().filter(|link| matches!(link.kind, LinkKind::Valve { .. }));
    let valves: Vec<&str> = valves.map(|link| link.name.as_str()).collect();
    let is_end = |n: &usize| matches!(network.nodes[*n].kind, NodeKind::Junction(_)) && a_pipe(*n);
    let say = |what: &str| {
        let names: Vec<&str> = network.nodes.iter().map(|n| n.name.as_str()).collect();
        let ends: Vec<&str> = (0..names.len()).filter(is_end).map(|n| names[n]).collect();
        let or = |all: &[&str]| match all.len() {
            0 => "none".to_owned(),
            n if n > MOST_NAMED => format!("{}, … {n} in all", all[..MOST_NAMED].join(", ")),
            _ => all.join(", "),
        };
        format!(
            "{what}: give option `valve NAME`; the network has valves ({}) and dead ends where a flow can be shut off ({})",
            or(&valves),
            or(&ends)
        )
    };
    match named {
        Some(name) => {
            let end = (0..network.nodes.len()).find(|&n| network.nodes[n].name == name).filter(is_end);
            let valve = valves.iter().find(|v| **v == name).map(|v| Closing::Link(v));
            valve.or(end.map(Closing::End)).ok_or_else(|| say(&format!("'{name}' is no valve or dead end")))
        }
        None => match valves[..] {
            [valve] => Ok(Closing::Link(valve)),
            [] => Err(say("no valve says where the flow is shut off")),
            _ => Err(say("several valves could close")),
        },
    }
}

/// The nodes where a pipe begins and ends in the rig: it leads to what stands before a valve or pump, and from what is behind.
fn directed(link: &Link, must_end: impl Fn(usize) -> Option<bool>) -> Result<[usize; 2], String> {
    let [a, b] = link.ends;
    match [a, b].map(must_end) {
        [Some(false) | None, Some(true) | None] => Ok([a, b]),
        [Some(true) | None, Some(false) | None] => Ok([b, a]),
        _ => Err(format!(
            "the pipe '{}' lies between two valves or pumps that both lead into it or out of it: put a junction into it",
            link.name
        )),
    }
}

/// Darcy's factor with the loss of Hazen and Williams at [`TAKEN_AT_M_S`], or of Manning.
fn darcy_factor(friction: Friction, coefficient: f64, diameter_m: f64) -> f64 {
    let area_m2 = std::f64::consts::FRAC_PI_4 * diameter_m * diameter_m;
    let flow_m3_s = TAKEN_AT_M_S * area_m2;
    // Loss over length, with lengths in m and flows in m³/s.
    let slope = match friction {
        Friction::HazenWilliams => 10.667 * coefficient.powf(-1.852) * diameter_m.powf(-4.871) * flow_m3_s.powf(1.852),
        _ => 10.294 * coefficient * coefficient * diameter_m.powf(-16.0 / 3.0) * flow_m3_s * flow_m3_s,
    };
    2.0 * GRAVITY_M_S2 * diameter_m * slope / (TAKEN_AT_M_S * TAKEN_AT_M_S)
}

/// A number without the noise of conversions, as TOML has it.
fn short(value: f64) -> String {
    let text = format!("{value:.9e}").parse::<f64>().unwrap_or(value);
    format!("{text:?}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draft::epanet::read;
    use crate::rig::{self, Rig};

    /// Two pipes and a loop from a reservoir by a pump, a valve in the middle, a tank at the end.
    const NETWORK: &str = "[JUNCTIONS]\n A 0 0\n B 5 36\n C 0 0\n D 0 0\n E 0 7.2\n[RESERVOIRS]\n R 10\n S 1\n[TANKS]\n T 0 30 0 40 4\n[PIPES]\n\
        p1 B A 100 200 0.1 0 Open\n p2 B C 80 200 0.1 0 Open\n p3 T B 60 150 0.1 0 Open\n p4 D E 40 150 0.1 0 Open\n[PUMPS]\n 9 R A HEAD h\n\
        [VALVES]\n V C D 150 TCV 10\n[CURVES]\n h 100 50\n[OPTIONS]\n Units CMH\n Headloss D-W\n";

    fn told(valve: Option<&str>) -> Told<'_> {
        let (material, wall_thickness_mm) = ("steel", 4.0);
        Told {
            name: "net",
            temperature_degc: 20.0,
            material,
            wall_thickness_mm,
            valve,
            closing_time_s: 0.2,
            unit: "bar",
        }
    }

    #[test]
    fn valves_and_pumps_become_nodes() {
        let made = draft(&read(NETWORK).unwrap(), &told(None)).unwrap();
        let rig = Rig::from_toml(&made.text, "net.toml").unwrap_or_else(|e| panic!("{e}\n{}", made.text));
        let names: Vec<&str> = rig.graph.nodes.iter().map(|n| n.name.as_str()).collect();
        assert_eq!(names, ["B", "E", "T", "9", "V"]);
        let ends: Vec<(&str, &str)> = rig.graph.lines.iter().map(|l| (names[l.from], names[l.to])).collect();
        assert_eq!(ends, [("9", "B"), ("B", "V"), ("T", "B"), ("V", "E")]);
        assert!(matches!(&rig.graph.nodes[3].kind, rig::NodeKind::Pump(pump) if pump.suction_head_m == Some(10.0)));
        assert!(
            matches!(rig.graph.nodes[0].kind, rig::NodeKind::Junction { demand_m3_s } if (demand_m3_s - 0.01).abs() < 1e-12)
        );
        assert_eq!((rig.valve.closing_time_s, rig.pipes[0].roughness_m), (0.2, Some(1e-4)));
        assert!((rig.pipes[2].elevation_end_m - 5.0).abs() < 1e-12);
        // Another end closes, to which its pipe is turned: the valve stays open, with its loss.
        let turned = NETWORK.replace("p4 D E", "p4 E D");
        let made = draft(&read(&turned).unwrap(), &told(Some("E"))).unwrap();
        let rig = Rig::from_toml(&made.text, "net.toml").unwrap_or_else(|e| panic!("{e}\n{}", made.text));
        let area_m2 = std::f64::consts::FRAC_PI_4 * 0.15 * 0.15;
        let valve = rig.graph.nodes.iter().find(|n| n.name == "V").unwrap();
        assert!(matches!(&valve.kind, rig::NodeKind::Opening(o) if (o.cda_m2 - area_m2 / 10f64.sqrt()).abs() < 1e-9));
    }

    #[test]
    fn what_a_rig_cannot_have_is_refused_by_name() {
        let refused = |from: &str, to: &str, valve: Option<&str>| {
            let text = NETWORK.replacen(from, to, 1);
            draft(&read(&text).unwrap(), &told(valve)).err().unwrap_or_default()
        };
        for (from, to, valve, says) in [
            (" V C D 150 TCV 10\n", "", None, "no valve says where the flow is shut off"),
            (
                "",
                "",
                Some("B"),
                "'B' is no valve or dead end: give option `valve NAME`; the network has valves (V) and dead ends",
            ),
            ("TCV 10", "PRV 10", Some("E"), "'V' is a PRV"),
            ("HEAD h", "POWER 3", None, "the pump '9' has no curve"),
            (" C 0 0", " C 0 9", None, "'V' stands at the junction 'C', at which flow is drawn off"),
            ("0.1 0 Open\n p2", "0.1 0 CV\n p2", None, "the pipe 'p1' has a check valve"),
        ] {
            let said = refused(from, to, valve);
            assert!(said.contains(says), "{to}: {said}");
        }
    }

    /// Head of a known slope: Hazen and Williams' C of 100 in 457.2 mm at 1 m/s loses 2.82 m over 1 km.
    #[test]
    fn friction_has_the_loss_of_its_formula() {
        let f = darcy_factor(Friction::HazenWilliams, 100.0, 0.4572);
        let slope = f / 0.4572 / (2.0 * GRAVITY_M_S2);
        let q: f64 = std::f64::consts::FRAC_PI_4 * 0.4572 * 0.4572;
        // The customary form in ft and ft³/s: 4.727 C^-1.852 d^-4.871 q^1.852.
        let customary = 4.727 * 100f64.powf(-1.852) * 1.5f64.powf(-4.871) * (q / 0.028_316_846_592).powf(1.852);
        assert!((slope / customary - 1.0).abs() < 2e-3, "{slope} {customary}");
    }
}
