//! An explanation in one sentence.

use crate::diagnose::rest::explanation::Site;
use crate::diagnose::rest::law::Law;
use crate::diagnose::rest::waveform::{Pulsation, Waveform};
use crate::number::{plus_minus, significant};

/// What a forcing looks like.
pub(crate) struct Look<'a> {
    pub(crate) site: &'a Site,
    pub(crate) waveform: &'a Waveform,
    pub(crate) onset_s: Option<f64>,
    pub(crate) pulsation: Option<Pulsation>,
    pub(crate) law: Option<(Law, f64)>,
}

/// In one sentence, without its end.
pub(crate) fn sentence(look: &Look) -> String {
    match look.pulsation {
        Some(pulsation) => format!("{}, {}", pulsating(look.site), tone(look.site, &pulsation)),
        None => format!("{}{}", what(look), how(look)),
    }
}

fn pulsating(site: &Site) -> String {
    match site {
        Site::Supply => "a pulsation of the supply".into(),
        Site::Valve => "a pulsating flow at the valve".into(),
        Site::Pipe { .. } => format!("a pulsating flow at {}", place(site)),
        Site::Sensor(name) => format!("interference on {name}, not in the pipe"),
        Site::Wall => "a pulsating strain of the wall".into(),
    }
}

fn tone(site: &Site, pulsation: &Pulsation) -> String {
    let since = match pulsation.is_there_before {
        Some(true) => ", there before the closure",
        Some(false) => ", from the closure on",
        None => "",
    };
    format!("{} Hz, {}{since}", significant(pulsation.frequency_hz, 4), amount(site, pulsation.amplitude))
}

/// A position with its error.
fn place(site: &Site) -> String {
    match site {
        Site::Pipe { pipe: None, position_m, error_m } => format!("{} m", plus_minus(*position_m, *error_m)),
        Site::Pipe { pipe: Some(pipe), position_m, error_m } => {
            format!("{} m along {pipe}", plus_minus(*position_m, *error_m))
        }
        _ => site.name(),
    }
}

/// A forcing's size in a unit that people read.
fn amount(site: &Site, value: f64) -> String {
    match site.unit() {
        "m³/s" => format!("{} L/s", significant(1e3 * value.abs(), 2)),
        "1" => format!("{} µm/m", significant(1e6 * value.abs(), 2)),
        unit => format!("{} {unit}", significant(value.abs(), 2)),
    }
}

fn what(look: &Look) -> String {
    let peak = look.waveform.peak();
    match look.site {
        Site::Supply => format!("a head of the supply that changes by up to {}", amount(look.site, peak)),
        Site::Valve if peak > 0.0 => format!("a flow through the valve of up to {}", amount(look.site, peak)),
        Site::Valve => format!("a flow from the valve back into the pipe of up to {}", amount(look.site, peak)),
        Site::Pipe { .. } => {
            let way = if peak > 0.0 { "out" } else { "in" };
            format!("a flow {way} at {} of up to {}", place(look.site), amount(look.site, peak))
        }
        Site::Sensor(name) => {
            let way = if peak > 0.0 { "high" } else { "low" };
            format!("{name} reads up to {} too {way}", amount(look.site, peak))
        }
        Site::Wall => format!("a strain of the wall of up to {}", amount(look.site, peak)),
    }
}

fn how(look: &Look) -> String {
    let onset = match look.onset_s {
        Some(t) if t > 0.0 => format!(", from {} s after the start of the closure on", significant(t, 2)),
        _ => String::new(),
    };
    let Some((law, _)) = look.law else { return onset };
    let above = |above_m: f64| significant(above_m, 3);
    let at_pipe = matches!(look.site, Site::Pipe { .. });
    match law {
        Law::OpensAbove { above_m, scale } | Law::GrowsAbove { above_m, scale } => {
            let guess = match look.site {
                Site::Pipe { .. } | Site::Valve if scale > 0.0 => ": a relief valve?",
                Site::Sensor(_) if scale < 0.0 => ": does it saturate?",
                _ => "",
            };
            let verb = if at_pipe { "opens" } else { "begins" };
            format!(" that {verb} above {} m of head{guess}", above(above_m))
        }
        Law::Orifice { scale } => {
            format!(" that goes with the root of the head{}", if at_pipe && scale > 0.0 { ": a leak?" } else { "" })
        }
        Law::Head { scale } => match look.site {
            Site::Sensor(_) => format!(" and is off in proportion to the head, by {}%", significant(100.0 * scale, 2)),
            _ => " that goes with the head".into(),
        },
        Law::HeadSquared { .. } => " that goes with the square of the head's change".into(),
        Law::FlowSquared { .. } => " that goes with Q|Q|: a loss?".into(),
        Law::Volume { scale } => match look.site {
            Site::Supply if scale < 0.0 => format!(
                " and falls with the volume that has left it: the free surface of a tank of {} m²?",
                significant(-1.0 / scale, 2)
            ),
            _ => " that goes with the volume that has flown past".into(),
        },
        Law::HeadRate { .. } => " that goes with dH/dt: something that stores water?".into(),
    }
}
