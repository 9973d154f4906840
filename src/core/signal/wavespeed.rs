//! The wave speed in four ways, none of which needs a model of the run.

use crate::signal::features::{Crossings, Estimate};
use crate::signal::front::Front;
use crate::signal::matching::{Delay, Sense, delay};
use crate::signal::station::Station;
use crate::units::GRAVITY_M_S2;

/// If a rise takes more than this share of the time to the half fall, it may run into the fall: only its beginning is
/// matched.
const CROWDED: f64 = 0.6;
/// If a rise takes more than this share of the time to the return of the front, the closure is slower than 2L/a.
const SLOW: f64 = 0.85;
/// Relative error if the end of the closure may have been mistaken for the return of the wave.
const MISTAKEN: f64 = 0.25;
/// Share by which creep, gas and unsteady friction may lengthen the period.
const LENGTHENED: f64 = 0.1;
/// Share of the smear that counts as the error left in a delay of matched fronts.
const TAIL_LEFT: f64 = 0.1;

/// Whether the rise may run into the fall.
fn is_crowded(front: &Front) -> bool {
    front.rise > CROWDED * (front.half_fall - front.onset)
}

/// What the first peak says of the wave's way to the supply and back.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ThereAndBack {
    /// The wave speed, where the front carries it.
    pub crossings: Option<Crossings>,
    /// Relative excess of the half level's delay, which creep and unsteady friction cause.
    pub smear: f64,
    /// Whether the closure is slow, see [`Closure::slow`](crate::signal::Closure::slow).
    pub slow: bool,
}

/// The wave speed from the first front's travel time to the supply and back: matches the first peak's rise with its
/// fall.
///
/// `stations` are ordered from the valve to the supply. The first one is searched without a prior, the others near the
/// first result. The range covers every window of every sensor and the crossings of equal levels (a quarter and half of
/// the front; at the valve, half is the steady level itself, as in Table 2 of the source paper).
///
/// A fall that marks the end of a slow closure looks like the wave's return, only later; one that a joint of pipes in
/// series sends back, only earlier. The period exposes both: it is the same at every sensor, however the valve closes,
/// and nothing makes it shorter.
pub(crate) fn there_and_back(
    stations: &[&Station],
    length_m: f64,
    of_period: Option<Estimate>,
    joined: bool,
) -> ThereAndBack {
    let mut estimates: Vec<Estimate> = Vec::new();
    let mut alternatives: Vec<f64> = Vec::new();
    let mut tail = 0.0;
    let mut slow = of_period.zip(stations.first()).is_none_or(|(a, s)| rise_over_return(s, a.value) > SLOW);
    let mut doubt = 0.0;
    for station in stations {
        let Ok(front) = &station.front else { continue };
        if station.place_m <= 0.0 {
            continue;
        }
        let trace = &station.coarse;
        let speed = |points: f64| 2.0 * station.place_m / (points * trace.step_s);
        let to_half_fall = front.half_fall - front.onset;
        let (lags, reach) = match estimates.first() {
            None if is_crowded(front) => ((0.4 * to_half_fall, to_half_fall), 0.4),
            None => (((0.55 * to_half_fall).max(0.8 * front.rise), to_half_fall), 1.0),
            Some(first) => {
                let expected = 2.0 * station.place_m / first.value / trace.step_s;
                // where the fall runs into the rise, or close to the supply, a sensor adds doubt only
                if slow || front.rise > 0.7 * expected || station.place_m < 0.4 * length_m {
                    continue;
                }
                let margin = 0.06 * expected + 0.05 * front.rise + 2.0;
                ((expected - margin, expected + margin), 1.0)
            }
        };
        let Some(found) = delay(trace, front, trace, lags, Sense::Falls, reach, station.coarse_sd_m) else { continue };
        let value = speed(found.value);
        if estimates.is_empty() {
            match of_period {
                Some(a) => slow |= value < (1.0 - MISTAKEN) * a.value,
                None => {
                    // between valve and supply, a closure that outlasts the return holds the level, and the fall marks
                    // its end
                    let doubtful = station.place_m < 0.9 * length_m && front.rise > CROWDED * found.value;
                    slow = doubtful || front.rise > SLOW * found.value;
                    doubt = if doubtful { MISTAKEN } else { 0.0 };
                }
            }
            let levels = if slow { Vec::new() } else { equal_levels(station, front, length_m, &found) };
            if let Some(half) = levels.last() {
                tail = (speed(*half) / value - 1.0).abs();
            }
            alternatives.extend(levels.into_iter().map(speed));
        }
        alternatives.extend(found.windows.iter().map(|w| speed(*w)));
        estimates.push(Estimate { value, standard_error: value * found.standard_error / found.value });
    }
    let crossings = weighted_mean(&estimates).map(|joint| {
        let standard_error = joint.standard_error.hypot(TAIL_LEFT * tail * joint.value).hypot(doubt * joint.value);
        let low = alternatives.iter().copied().fold(joint.value - standard_error, f64::min);
        let high = alternatives.iter().copied().fold(joint.value + standard_error, f64::max);
        Crossings { value: joint.value, standard_error, low, high }
    });
    let carried =
        |c: &Crossings| !(slow || joined) || of_period.is_none_or(|a| (c.value / a.value - 1.0).abs() < LENGTHENED);
    ThereAndBack { crossings: crossings.filter(carried), smear: tail, slow }
}

/// How long the rise at a station lasts, as a share of the time after which a wave of this speed has returned from the
/// supply.
fn rise_over_return(station: &Station, speed_m_s: f64) -> f64 {
    let return_s = 2.0 * station.place_m / speed_m_s;
    station.front.as_ref().map_or(0.0, |front| front.rise * station.coarse.step_s / return_s)
}

/// Delays between equal levels of the rise and the fall, at a quarter and at half of the front.
fn equal_levels(station: &Station, front: &Front, valve_m: f64, found: &Delay) -> Vec<f64> {
    // at the valve the front comes back doubled; between valve and supply the valve's echo follows too closely to tell
    let echo = 2.0 * (valve_m - station.place_m) / (2.0 * station.place_m) * found.value;
    let times = if echo < 0.3 * front.rise { 2.0 } else { 1.0 };
    let trace = &station.coarse;
    [0.25, 0.5]
        .into_iter()
        .filter_map(|part| {
            let rise = front.rises_through(trace, front.base_m + part * front.height_m())?;
            let fall = front.falls_through(trace, front.top_m - times * part * front.height_m())?;
            (fall > rise).then_some(fall - rise)
        })
        .collect()
}

/// From the front's arrival at two sensors: the one nearest to the valve paired with each other one. A front that is
/// still rising when a wave of `speed_m_s` has come back from the supply has another shape at each sensor, and no
/// delay.
pub(crate) fn arrival(stations: &[&Station], smear: f64, speed_m_s: Option<f64>) -> Option<Estimate> {
    let (first, others) = stations.split_first()?;
    let mut estimates = Vec::new();
    for other in others.iter().filter(|other| speed_m_s.is_none_or(|a| rise_over_return(other, a) < 1.0)) {
        let distance = first.place_m - other.place_m;
        let Some(later) = front_delay(first, other) else { continue };
        if distance > 0.0 && later.value > 0.5 * first.coarse.step_s {
            let value = distance / later.value;
            estimates.push(Estimate { value, standard_error: value * later.standard_error / later.value });
        }
    }
    let joint = weighted_mean(&estimates)?;
    Some(Estimate { standard_error: joint.standard_error.hypot(TAIL_LEFT * smear * joint.value), ..joint })
}

/// Delay of the front at `other` relative to `first`, s, each on its own clock, by matching the two fronts.
pub(crate) fn front_delay(first: &Station, other: &Station) -> Option<Estimate> {
    let front = first.front.as_ref().ok()?;
    let later = other.front.as_ref().ok()?;
    let (target, shift) = other.on_grid_of(&first.coarse)?;
    let onset = (other.coarse.time_s(later.onset) - first.coarse.start_s) / first.coarse.step_s;
    let expected = onset - front.onset;
    let margin = 0.4 * front.rise + 3.0;
    let lags = (expected - margin - shift, expected + margin - shift);
    let sd = first.coarse_sd_m.max(other.coarse_sd_m);
    let reach = if is_crowded(front) || is_crowded(later) { 0.4 } else { 1.0 };
    let found = delay(&first.coarse, front, &target, lags, Sense::Rises, reach, sd)?;
    let step_s = first.coarse.step_s;
    Some(Estimate { value: (found.value + shift) * step_s, standard_error: found.standard_error * step_s })
}

/// From the height of the first rise: a = g ΔH / V₀ (Joukowsky 1898). `None` for a closure slower than 2L/a, whose rise
/// would only give a lower bound. Extrapolating the plateau to the middle of the front removes friction's slow rise and
/// the slow part of creep; creep during the closure lowers the rise permanently, by about the smear.
pub(crate) fn joukowsky(station: &Station, wave_speed_m_s: f64, velocity: Estimate, smear: f64) -> Option<Estimate> {
    let front = station.front.as_ref().ok()?;
    if velocity.value <= 0.0 {
        return None;
    }
    let trace = &station.coarse;
    let back = 2.0 * station.place_m / wave_speed_m_s / trace.step_s;
    let knee = front.knee(trace, back);
    let from = (knee + 0.15 * (knee - front.onset)).ceil() as usize;
    let to = (front.onset + back - 0.1 * front.rise).floor().max(0.0) as usize;
    if to < from + 4 || !trace.intact(from..to) {
        return None;
    }
    let plateau = &trace.head_m[from..to];
    let n = plateau.len() as f64;
    let mean = plateau.iter().sum::<f64>() / n;
    let middle = 0.5 * (n - 1.0);
    let slope = plateau.iter().enumerate().map(|(i, h)| (i as f64 - middle) * (h - mean)).sum::<f64>()
        / (n * (n * n - 1.0) / 12.0);
    let reach = from as f64 + middle - 0.5 * (front.onset + knee);
    let residual = plateau.iter().enumerate().map(|(i, h)| (h - mean - slope * (i as f64 - middle)).powi(2));
    let scatter = (residual.sum::<f64>() / (n - 2.0)).sqrt();
    let rise_m = mean - slope * reach - front.base_m;
    // a plateau curved by creep is not a straight line: a fifth of the extrapolation counts as error
    let rise_error = scatter.hypot(0.2 * slope * reach);
    let value = GRAVITY_M_S2 * rise_m / velocity.value;
    let relative = (rise_error / rise_m).hypot(velocity.standard_error / velocity.value).hypot(0.7 * smear);
    (rise_m > 0.0).then_some(Estimate { value, standard_error: value * relative })
}

/// Mean weighted by inverse variances; its error is widened if the values scatter more than their errors allow.
pub(crate) fn weighted_mean(estimates: &[Estimate]) -> Option<Estimate> {
    let weight = |e: &Estimate| 1.0 / (e.standard_error.powi(2) + (1e-9 * e.value).powi(2));
    let total: f64 = estimates.iter().map(weight).sum();
    if estimates.is_empty() {
        return None;
    }
    let value = estimates.iter().map(|e| weight(e) * e.value).sum::<f64>() / total;
    let chi2: f64 = estimates.iter().map(|e| weight(e) * (e.value - value).powi(2)).sum();
    let excess = (chi2 / (estimates.len() as f64 - 1.0).max(1.0)).max(1.0);
    Some(Estimate { value, standard_error: (excess / total).sqrt() })
}
