//! What is drawn: a rig, a run, and the effect hidden in it.

use super::forcing::{self, Forced};

/// Every kind of case.
pub const KINDS: [&str; 20] = [
    "nothing",
    "unknown",
    "viscoelastic-wall",
    "unsteady-friction",
    "entrained-gas",
    "vapour-cavity",
    "leak",
    "blockage",
    "section-change",
    "valve-law",
    "valve-seat-leak",
    "supply-drift",
    "air-pocket",
    "moving-valve",
    "side-branch",
    "sensor-lag",
    "clock-skew",
    "sensor-gain",
    "inlet-jet",
    "fluid-structure",
];

/// What is never hidden with others: it changes the rig or the start model, or is no effect.
const ALONE: [&str; 6] =
    ["nothing", "unknown", "viscoelastic-wall", "unsteady-friction", "vapour-cavity", "fluid-structure"];

/// What may be hidden with others.
pub fn together() -> impl Iterator<Item = &'static str> {
    KINDS.into_iter().filter(|kind| !ALONE.contains(kind))
}

/// The hidden effect; places in m from the supply.
#[derive(Debug, Clone, PartialEq)]
pub enum Hidden {
    /// Head of the supply swings: amplitude m, frequency Hz.
    Pulsation(f64, f64),
    /// A sensor hums from the closure on: sensor, amplitude m, frequency Hz.
    Hum(usize, f64, f64),
    /// A sensor reads h + c h² of its deviation: sensor, c 1/m.
    Bent(usize, f64),
    Creep,
    UnsteadyFriction,
    /// Volume per volume of pipe at the pressure of the air, lag behind the pressure s.
    Gas(f64, f64),
    Cavity,
    /// Place, flow under the head there before the closure m³/s.
    Leak(f64, f64),
    /// Place, loss before the closure m.
    Blockage(f64, f64),
    /// From, to, ratio of wave speeds.
    Section(f64, f64, f64),
    /// Inflection: share of the time, opening.
    TwoStage(f64, f64),
    SeatLeak(f64),
    /// Change of head m, time constant s.
    Drift(f64, f64),
    /// Volume m³.
    Air(f64),
    /// Frequency Hz, static travel m under the Joukowsky head, damping ratio.
    MovingValve(f64, f64, f64),
    /// Place, length.
    Branch(f64, f64),
    /// Sensor, frequency Hz.
    Lag(usize, f64),
    /// Sensor, s.
    Skew(usize, f64),
    /// Sensor, factor.
    Gain(usize, f64),
    /// The supply's mouth: loss of the entering flow before the closure m, that of a leaving flow over it, length of the
    /// water that moves outside m.
    Mouth(f64, f64, f64),
    /// A wall that moves: Poisson's ratio, speed of stress waves in a bar of it m/s, density kg/m³, travel
    /// of the valve's spring m per m of head, head whose push on the valve the friction of the floor just holds m.
    Wall(f64, f64, f64, f64, f64),
    /// What no effect of the catalogue is.
    Forced(Forced),
}

/// One case.
pub struct Case {
    pub name: String,
    pub material: &'static str,
    pub length_m: f64,
    pub diameter_m: f64,
    pub wall_m: f64,
    pub wave_speed_m_s: f64,
    pub temperature_c: f64,
    pub velocity_m_s: f64,
    pub second_velocity_m_s: Option<f64>,
    pub valve_head_m: f64,
    pub closing_s: f64,
    pub duration_s: f64,
    pub lead_s: f64,
    pub sample_s: f64,
    pub sensors_m: Vec<f64>,
    pub noise_m: f64,
    /// Creep that the start model knows of or that is hidden: compliance 1/Pa, retardation s.
    pub creep: Vec<(f64, f64)>,
    /// Darcy factor where it is known; otherwise that of a smooth pipe.
    pub friction: Option<f64>,
    pub unsteady_friction: bool,
    pub start_effects: Vec<&'static str>,
    pub hidden: Vec<Hidden>,
}

impl Case {
    /// What `of` makes of the hidden effect that it knows.
    pub fn find<T>(&self, of: impl Fn(&Hidden) -> Option<T>) -> Option<T> {
        self.hidden.iter().find_map(of)
    }
    pub fn area_m2(&self) -> f64 {
        std::f64::consts::PI / 4.0 * self.diameter_m.powi(2)
    }
    pub fn joukowsky_m(&self) -> f64 {
        self.wave_speed_m_s * self.velocity_m_s / 9.81
    }
    /// Kestin, Sokolov & Wakeham (1978).
    pub fn viscosity_m2_s(&self) -> f64 {
        let below = 20.0 - self.temperature_c;
        let by = below / (self.temperature_c + 96.0) * (1.2364 - 1.37e-3 * below + 5.7e-6 * below * below);
        1.002e-3 * 10f64.powf(by) / self.density_kg_m3()
    }
    /// McCutcheon, Martin & Barnwell (1993), fresh water.
    pub fn density_kg_m3(&self) -> f64 {
        let t = self.temperature_c;
        1000.0 * (1.0 - (t + 288.9414) / (508_929.2 * (t + 68.12963)) * (t - 3.9863).powi(2))
    }
    pub fn reynolds(&self, velocity_m_s: f64) -> f64 {
        velocity_m_s * self.diameter_m / self.viscosity_m2_s()
    }
    /// As given, or of a smooth pipe (Blasius) at the flow before the closure.
    pub fn friction_factor(&self, velocity_m_s: f64) -> f64 {
        self.friction.unwrap_or_else(|| 0.316 / self.reynolds(velocity_m_s).powf(0.25))
    }
}

/// Inner diameters of the rigs.
const DIAMETERS_M: [f64; 8] = [0.014, 0.016, 0.0221, 0.032, 0.0506, 0.0662, 0.0933, 0.15];

/// A case with an effect of this kind, and perhaps `others` of [`together`]; in plastic, where `always_plastic`.
pub fn draw(
    random: &mut fastrand::Rng,
    kind: &'static str,
    others: &[&'static str],
    always_plastic: bool,
    name: &str,
) -> Case {
    let between = |random: &mut fastrand::Rng, a: f64, b: f64| a + (b - a) * random.f64();
    let log = |random: &mut fastrand::Rng, a: f64, b: f64| a * (b / a).powf(random.f64());
    let plastic = match kind {
        "viscoelastic-wall" => true,
        "vapour-cavity" | "unknown" | "fluid-structure" => false,
        _ => random.bool(),
    } || always_plastic;
    let (material, lowest, highest, compliance) = if plastic {
        [("HDPE", 330.0, 400.0, 0.13e-9), ("PPR", 450.0, 510.0, 0.06e-9), ("PVC", 425.0, 470.0, 0.04e-9)]
            [random.usize(..3)]
    } else {
        [("copper", 1220.0, 1330.0, 0.0), ("steel", 1000.0, 1250.0, 0.0)][random.usize(..2)]
    };
    let wave_speed_m_s = between(random, lowest, highest);
    let length_m = between(random, 40.0, 150.0);
    let period_s = 4.0 * length_m / wave_speed_m_s;
    let joukowsky_m = between(random, 10.0, 50.0);
    let velocity_m_s = joukowsky_m * 9.81 / wave_speed_m_s;
    let unsteady_friction = kind == "unsteady-friction" || (!plastic && random.bool());
    let creep = if plastic {
        (0..3)
            .map(|k| (compliance * between(random, 0.6, 1.4), period_s * [0.02, 0.2, 1.2][k] * log(random, 0.7, 1.5)))
            .collect()
    } else {
        Vec::new()
    };
    let mut start_effects = Vec::new();
    if plastic && kind != "viscoelastic-wall" {
        start_effects.push("viscoelastic-wall");
    }
    if unsteady_friction && kind != "unsteady-friction" {
        start_effects.push("unsteady-friction");
    }
    let sensors = 2 + random.usize(..2);
    let sensors_m: Vec<f64> = [1.0, between(random, 0.5, 0.75), between(random, 0.2, 0.4)][..sensors]
        .iter()
        .map(|share| (share * length_m * 100.0).round() / 100.0)
        .collect();
    let which = random.usize(..sensors);
    let diameter_m = DIAMETERS_M[random.usize(..5)];
    // Turbulent, the slower run too.
    let turbulent = |d: &f64| velocity_m_s * d > 1e-6 * 8000.0;
    let diameter_m = DIAMETERS_M
        .into_iter()
        .filter(turbulent)
        .find(|d| *d >= diameter_m)
        .unwrap_or(DIAMETERS_M[DIAMETERS_M.len() - 1]);
    let area_m2 = std::f64::consts::PI / 4.0 * diameter_m * diameter_m;
    let flow_m3_s = area_m2 * velocity_m_s;
    let place_m = length_m * between(random, 0.15, 0.85);
    let closing_s = period_s * log(random, 0.08, 0.3);
    let sign = if random.bool() { 1.0 } else { -1.0 };
    let hide = |random: &mut fastrand::Rng, kind: &str, place_m: f64, which: usize, sign: f64| match kind {
        "unknown" => match random.usize(..3) {
            0 => Hidden::Pulsation(joukowsky_m * log(random, 0.01, 0.05), between(random, 3.0, 30.0)),
            1 => Hidden::Hum(which, joukowsky_m * log(random, 0.01, 0.05), 50.0),
            _ => Hidden::Bent(which, 0.1 / joukowsky_m),
        },
        "viscoelastic-wall" => Hidden::Creep,
        "unsteady-friction" => Hidden::UnsteadyFriction,
        // Bubbles of 0.1 to 1 mm exchange their heat in 0.1 to 10 ms.
        "entrained-gas" => {
            Hidden::Gas(log(random, 1e-6, 1e-4) * if plastic { 10.0 } else { 1.0 }, log(random, 1e-4, 1e-2))
        }
        "vapour-cavity" => Hidden::Cavity,
        "leak" => Hidden::Leak(place_m, flow_m3_s * log(random, 0.01, 0.08)),
        "blockage" => Hidden::Blockage(place_m, joukowsky_m * log(random, 0.03, 0.15)),
        "section-change" => {
            let from = length_m * between(random, 0.1, 0.6);
            let to = from + length_m * between(random, 0.1, 0.3);
            Hidden::Section(from, to, 1.0 + sign * between(random, 0.08, 0.3))
        }
        "valve-law" => Hidden::TwoStage(between(random, 0.2, 0.6), between(random, 0.15, 0.4)),
        "valve-seat-leak" => Hidden::SeatLeak(log(random, 0.005, 0.04)),
        "supply-drift" => {
            Hidden::Drift(sign * joukowsky_m * log(random, 0.02, 0.1), period_s * between(random, 5.0, 30.0))
        }
        "air-pocket" => Hidden::Air(flow_m3_s * period_s * log(random, 0.003, 0.03)),
        "moving-valve" => Hidden::MovingValve(
            between(random, 2.0, 6.0) / period_s,
            length_m * joukowsky_m * 9.81 / wave_speed_m_s.powi(2) * log(random, 0.02, 0.1),
            0.03,
        ),
        "inlet-jet" => Hidden::Mouth(
            joukowsky_m * log(random, 0.03, 0.15),
            between(random, 0.0, 1.0),
            length_m * log(random, 0.001, 0.01),
        ),
        "fluid-structure" => {
            let (poisson, modulus_pa, density) =
                if material == "copper" { (0.34, 120e9, 8930.0) } else { (0.3, 206e9, 7850.0) };
            let give = 9.81 * length_m / wave_speed_m_s.powi(2) * log(random, 0.02, 10.0);
            let speed = (modulus_pa * between(random, 0.95, 1.05) / density).sqrt();
            Hidden::Wall(poisson, speed, density, give, 0.0)
        }
        "side-branch" => Hidden::Branch(place_m, length_m * between(random, 0.03, 0.15)),
        "sensor-lag" => Hidden::Lag(which, log(random, 2.0, 15.0) / period_s),
        "clock-skew" => Hidden::Skew(which, sign * period_s * log(random, 0.01, 0.05)),
        _ => Hidden::Gain(which, 1.0 + sign * between(random, 0.02, 0.08)),
    };
    let mut hidden = Vec::new();
    let is_forced = forcing::KINDS.contains(&kind);
    if kind != "nothing" && !is_forced {
        hidden.push(hide(random, kind, place_m, which, sign));
    }
    for other in others {
        let place_m = length_m * between(random, 0.15, 0.85);
        let (which, sign) = (random.usize(..sensors), if random.bool() { 1.0 } else { -1.0 });
        hidden.push(hide(random, other, place_m, which, sign));
    }
    let cycles = if plastic { 30.0 } else { 20.0 };
    let cavity = kind == "vapour-cavity";
    let mut case = Case {
        name: name.to_owned(),
        material,
        length_m: (length_m * 100.0).round() / 100.0,
        diameter_m,
        wall_m: diameter_m * if plastic { 0.1 } else { 0.06 },
        wave_speed_m_s,
        temperature_c: between(random, 10.0, 30.0),
        velocity_m_s,
        second_velocity_m_s: random.bool().then(|| velocity_m_s * between(random, 0.4, 0.7)),
        // Without cavities nothing may fall to vapour pressure.
        valve_head_m: if cavity { 0.4 * joukowsky_m } else { joukowsky_m * 1.1 + between(random, 5.0, 25.0) },
        closing_s,
        duration_s: cycles * period_s,
        lead_s: between(random, 0.5, 1.0),
        sample_s: [0.0002, 0.0005, 0.001, 0.002].into_iter().rfind(|dt| *dt < period_s / 300.0).unwrap_or(0.0002),
        sensors_m,
        noise_m: joukowsky_m * between(random, 0.0015, 0.003),
        creep,
        friction: None,
        unsteady_friction,
        start_effects,
        hidden,
    };
    if is_forced {
        let hidden = forced(random, kind, &case, place_m, which);
        case.hidden.push(hidden);
    }
    case
}

/// Draws one of a kind; `place_m` and `sensor` are drawn already.
fn forced(random: &mut fastrand::Rng, kind: &str, case: &Case, place_m: f64, sensor: usize) -> Hidden {
    let between = |random: &mut fastrand::Rng, a: f64, b: f64| a + (b - a) * random.f64();
    let log = |random: &mut fastrand::Rng, a: f64, b: f64| a * (b / a).powf(random.f64());
    let (period_s, rise_m) = (4.0 * case.length_m / case.wave_speed_m_s, case.joukowsky_m());
    let flow = case.velocity_m_s * case.area_m2();
    let later = |random: &mut fastrand::Rng| between(random, 1.5, 8.0) * period_s;
    Hidden::Forced(match kind {
        "second-pump" => Forced::SecondPump {
            at_m: place_m,
            flow_m3_s: flow * log(random, 0.02, 0.1),
            from_s: later(random),
            tau_s: period_s * log(random, 0.3, 2.0),
            share: between(random, 0.1, 0.4),
            hz: log(random, 0.3, 2.0) / period_s,
        },
        "valve-reopens" => {
            let from_s = later(random);
            Forced::ValveReopens {
                share: log(random, 0.01, 0.08),
                from_s,
                until_s: from_s + between(random, 1.0, 6.0) * period_s,
                ramp_s: period_s * between(random, 0.1, 0.5),
            }
        }
        "relief-valve" => {
            let over_m = rise_m * between(random, 0.25, 0.6);
            let most = flow * log(random, 0.03, 0.15);
            Forced::ReliefValve {
                at_m: place_m,
                above_m: case.valve_head_m + over_m,
                root_c: most / (rise_m - over_m).sqrt(),
            }
        }
        "swinging-check" => Forced::SwingingCheck {
            loss: rise_m * log(random, 0.01, 0.03) / (flow * flow),
            hz: log(random, 0.3, 2.0) / period_s,
            damping: between(random, 0.1, 0.5),
        },
        "saturating-sensor" => Forced::SaturatingSensor {
            sensor,
            above_m: case.valve_head_m + rise_m * between(random, 0.1, 0.5),
            share: between(random, 0.5, 0.9),
        },
        "nonlinear-wall" => {
            Forced::NonlinearWall { by: log(random, 0.03, 0.15) * 9.81 / (2.0 * case.wave_speed_m_s.powi(2) * rise_m) }
        }
        "free-surface" => Forced::FreeSurface {
            area_m2: flow * period_s / (rise_m * log(random, 0.05, 0.3)),
            slosh_m: rise_m * log(random, 0.01, 0.05),
            hz: log(random, 0.15, 1.5) / period_s,
            decay_s: period_s * between(random, 2.0, 10.0),
        },
        "operators-hand" => {
            let touches =
                (0..3).map(|_| (later(random), log(random, 0.01, 0.06), period_s * between(random, 0.3, 2.0)));
            Forced::OperatorsHand { touches: touches.collect() }
        }
        _ => return Hidden::Pulsation(rise_m * log(random, 0.01, 0.05), log(random, 1.0, 30.0)),
    })
}
