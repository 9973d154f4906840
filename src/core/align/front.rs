//! Alignment by the pressure front, which reaches each sensor after its travel time from the valve.

use crate::align::clock::{Clock, Method, Part, SURE, short};
use crate::number::plus_minus;
use crate::recording::Recording;
use crate::rig::Rig;
use crate::signal;
use crate::signal::{Estimate, FrontPair, front_pairs};

/// The clock of `other` from every pair of fronts: each pair gives a shift, minus the travel time between its sensors.
pub(crate) fn by_front(first: &Part, other: &Part) -> Result<Clock, String> {
    let rig = &first.recording.rig;
    let temperature_degc = rig.fluid.temperature_degc;
    let pairs = front_pairs(&first.recording, &other.recording, temperature_degc);
    if pairs.is_empty() {
        let shows = |part: &Part| front_pairs(&part.recording, &part.recording, temperature_degc).is_empty();
        let who = if shows(first) { &first.file } else { &other.file };
        return Err(format!(
            "no pressure sensor of {who} shows the first front: the steady level before it, its rise, its fall, and then a trough below that level"
        ));
    }
    let (speed, measured) = wave_speed(&first.recording, &other.recording, rig);
    let shifts: Vec<Estimate> = pairs
        .iter()
        .map(|pair| {
            // a sensor nearer to the supply sees the front later
            let way_s = pair.distance_m / speed.value;
            let way_error = way_s.abs() * speed.standard_error / speed.value;
            Estimate { value: way_s - pair.later_s.value, standard_error: way_error.hypot(pair.later_s.standard_error) }
        })
        .collect();
    let (agreeing, warning) = agreeing(&pairs, &shifts, rig);
    let weight = |e: &Estimate| e.standard_error.max(1e-12).powi(-2);
    let total: f64 = agreeing.iter().map(weight).sum();
    let offset_s = agreeing.iter().map(|e| weight(e) * e.value).sum::<f64>() / total;
    let chi2: f64 = agreeing.iter().map(|e| weight(e) * (e.value - offset_s).powi(2)).sum();
    let count = agreeing.len() as f64;
    let excess = (chi2 / (count - 1.0).max(1.0)).max(1.0);
    // pairs share sensors and the wave speed, so together they are no better than the best of them
    let best = agreeing.iter().map(|e| e.standard_error).fold(f64::INFINITY, f64::min);
    let residual_s = (agreeing.iter().map(|e| (e.value - offset_s).powi(2)).sum::<f64>() / count).sqrt();
    // half of the pairs contradict the other half, and either may be right
    let open_s = if warning.is_some() && agreeing.len() == shifts.len() { residual_s } else { 0.0 };
    let mut remarks = Vec::new();
    if pairs.iter().any(|p| p.distance_m != 0.0) {
        let whence = if measured { "as measured" } else { "as the rig's walls suggest" };
        remarks.push(format!("wave speed {} m/s, {whence}", plus_minus(speed.value, speed.standard_error)));
    }
    Ok(Clock {
        offset_s,
        uncertainty_s: open_s.max(best * excess.sqrt()),
        at_s: pairs.iter().map(|p| p.at_s).sum::<f64>() / pairs.len() as f64,
        events: agreeing.len(),
        residual_s: (agreeing.len() > 1).then_some(residual_s),
        remarks,
        warnings: warning.into_iter().collect(),
        ..Clock::own(&other.file, Method::Front)
    })
}

/// The shifts on which more than half of all pairs agree; all shifts if no such majority exists. Also returns a warning
/// about the other pairs.
///
/// Pairs disagree if their shifts differ by more than their errors allow and by more than half a rise: a front changes
/// its shape on its way.
fn agreeing(pairs: &[FrontPair], shifts: &[Estimate], rig: &Rig) -> (Vec<Estimate>, Option<String>) {
    let agree = |i: usize, j: usize| {
        let error = shifts[i].standard_error.hypot(shifts[j].standard_error);
        let most = (SURE * error).max(0.5 * pairs[i].rise_s.max(pairs[j].rise_s));
        (shifts[i].value - shifts[j].value).abs() <= most
    };
    let all = 0..shifts.len();
    let with = |i: usize| all.clone().filter(move |&j| agree(i, j));
    let Some(centre) = all.clone().rev().max_by_key(|&i| with(i).count()) else { return (Vec::new(), None) };
    let of = |i: usize| [pairs[i].first, pairs[i].second].map(|sensor| rig.sensors[sensor].name.as_str()).join(" and ");
    let off = |i: usize| format!("{} by {}", of(i), short(shifts[i].value - shifts[centre].value));
    let others: Vec<String> = all.clone().filter(|&i| !agree(centre, i)).map(off).collect();
    if others.is_empty() {
        return (shifts.to_vec(), None);
    }
    let is_most = 2 * with(centre).count() > shifts.len();
    let taken = if is_most { "they are left out" } else { "their mean is used, but is not reliable" };
    let warning = format!(
        "pairs of sensors contradict each other: compared with {}, these differ: {}; {taken}. Check the sensors' positions in the rig file, or align by another method",
        of(centre),
        others.join(", ")
    );
    (if is_most { with(centre).map(|i| shifts[i]).collect() } else { shifts.to_vec() }, Some(warning))
}

/// The wave speed that the recordings show, else the rig's nominal one; the second value says whether it was measured.
fn wave_speed(first: &Recording, other: &Recording, rig: &Rig) -> (Estimate, bool) {
    let water = rig.fluid.properties(rig.fluid.temperature_degc);
    let (start, low, high) = rig.wave_speed_start(&water);
    let shown = |recording: &Recording| signal::inspect(recording).ok()?.wave_speed.best();
    let measured = [first, other].into_iter().filter_map(shown).filter(|e| (low..=high).contains(&e.value));
    match measured.min_by(|a, b| a.standard_error.total_cmp(&b.standard_error)) {
        Some(speed) => (speed, true),
        None => (Estimate { value: start, standard_error: (high - low) / 12f64.sqrt() }, false),
    }
}
