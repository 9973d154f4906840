//! What would explain the rest: where nothing in the catalogue does, the forcing that is missing, without a shape
//! given.
//!
//! 1. What the fitted model leaves of a run is averaged in [`cells`].
//! 2. At each of the [`places`], the [`response`] to a [`pulse`] is simulated: the head of the supply, a flow out at
//!    the valve or along the pipe, a head added at a sensor, a strain of the wall.
//! 3. The forcing at a place is a linear [`inverse`] problem about one that is supposed ([`forced`]). Its evidence has
//!    a closed form, by which the places are [`ranking`].
//! 4. The forcing at the best places is described: its [`waveform`], the [`law`] that it follows, and both in
//!    [`words`].

pub(crate) mod cells;
pub mod draft;
pub mod explanation;
pub(crate) mod forced;
pub(crate) mod inverse;
pub mod law;
pub(crate) mod places;
pub(crate) mod pulse;
pub(crate) mod ranking;
pub(crate) mod resolution;
pub(crate) mod response;
#[cfg(test)]
mod tests;
pub mod waveform;
pub(crate) mod words;

use crate::diagnose::evidence::tempered;
use crate::diagnose::measures::least_fall;
use crate::diagnose::rest::cells::{CELLS, Run, Times};
use crate::diagnose::rest::explanation::{Explanation, Site};
use crate::diagnose::rest::law::{Followed, law_of};
use crate::diagnose::rest::places::{Spot, places};
use crate::diagnose::rest::ranking::{Contender, contenders, doubt, normal, nothing, resolved};
use crate::diagnose::rest::resolution::{coarsest, resolutions};
use crate::diagnose::rest::response::{met, response};
use crate::diagnose::rest::waveform::Waveform;
use crate::diagnose::rest::words::{Look, sentence};
use crate::fit::data::run_data::RunData;
use crate::fit::outcome::fit::Fit;
use crate::fit::outcome::thresholds::STRONG_EVIDENCE;
use crate::fit::problem::error::FitError;
use crate::fit::progress::{OnProgress, Progress};
use crate::fit::search::calibrate::{Begin, Fitter};
use crate::fit::search::from_signals::growing;
use crate::fit::search::options::{Effort, Options};
use crate::fit::search::thresholds::COARSE_REACHES;
use crate::model::{Model, ModelError, stop};
use crate::rig::Rig;

/// What would explain what a fitted model leaves of `runs`: the most probable place first, then those that cannot be
/// told from it. Nothing where nothing is left.
///
/// # Errors
/// As [`Fitter::fit`].
pub fn explain(
    rig: &Rig,
    runs: &[RunData],
    fit: &Fit,
    options: &Options,
    progress: &OnProgress<'_>,
) -> Result<Vec<Explanation>, FitError> {
    if fit.mean_square() < 1.0 + least_fall(runs) {
        return Ok(Vec::new());
    }
    let without_lines = fit_without_lines(rig, runs, fit, options, progress)?;
    let fit = without_lines.as_ref().unwrap_or(fit);
    progress(&Progress::from("what would explain the rest"));
    let model = Model::new(rig, &runs[0].conditions.water, &fit.effects);
    let model = model.constrained(&options.constraints).informed(&options.priors);
    let values = fit.values();
    let shared = &values[..model.shared.len()];
    let coarse = model.fitting_reaches(shared, COARSE_REACHES.max(model.least_reaches(shared)));
    let mut all: Vec<Kind> = Vec::new();
    for r in 0..runs.len() {
        let again = || Run::new(&model, &runs[r..=r], fit, coarse);
        let mut run = again()?;
        let whole = coarsest(&run);
        doubt(&mut run, &whole)?;
        let spots = places(rig, &run);
        let times = resolved(&run, &spots, &resolutions(&run))?;
        let found = contenders(run, again, &spots, &times)?;
        // What no forcing leaves is judged where the variables are best without.
        let Some(errors) = found.first().map(|c| c.data.errors) else { continue };
        let nothing = nothing(&again()?, &times, errors)?;
        for contender in found {
            let name = contender.spot.name(&contender.run);
            let evidence = contender.found.evidence - nothing;
            match all.iter_mut().find(|kind| kind.name == name) {
                Some(kind) => kind.runs.push((contender, times, evidence)),
                None => all.push(Kind { name, runs: vec![(contender, times, evidence)] }),
            }
        }
    }
    stop::check()?;
    all.sort_by(|a, b| b.log_odds(rig).total_cmp(&a.log_odds(rig)));
    let Some(best) = all.first() else { return Ok(Vec::new()) };
    if tempered(best.evidence()) < STRONG_EVIDENCE {
        return Ok(Vec::new());
    }
    let top = best.log_odds(rig);
    let odds: f64 = all.iter().map(|kind| (kind.log_odds(rig) - top).exp()).sum::<f64>() + (-top).exp();
    let probability = |kind: &Kind| (kind.log_odds(rig) - top).exp() / odds;
    // Places whose waves are the same share their probability, the supply first: nothing but the waveform's shape
    // speaks for one of them.
    let alike = all.iter().position(|kind| is_same_wave(best, kind));
    let shared = alike.map(|i| 0.5 * (probability(best) + probability(&all[i])));
    let mut shown: Vec<(&Kind, f64)> = all
        .iter()
        .enumerate()
        .filter(|(i, kind)| top - kind.log_odds(rig) < STRONG_EVIDENCE || alike == Some(*i))
        .map(|(i, kind)| (kind, shared.filter(|_| i == 0 || alike == Some(i)).unwrap_or_else(|| probability(kind))))
        .collect();
    shown.sort_by(|a, b| b.1.total_cmp(&a.1).then(b.0.is_supply().cmp(&a.0.is_supply())));
    Ok(shown
        .into_iter()
        .filter_map(|(kind, probability)| described(kind, probability).transpose())
        .collect::<Result<_, _>>()?)
}

/// The fit to what the runs hold beside the tones that stand before the closure, which are integrated out as hum is:
/// otherwise they pull the variables away, and hide elements of creep, which would pass for a strain of the wall. None
/// where there are no such tones.
fn fit_without_lines(
    rig: &Rig,
    runs: &[RunData],
    fit: &Fit,
    options: &Options,
    progress: &OnProgress<'_>,
) -> Result<Option<Fit>, FitError> {
    if runs.iter().flat_map(|run| &run.sensors).all(|sensor| sensor.lines.is_empty()) {
        return Ok(None);
    }
    let mut quiet = runs.to_vec();
    quiet.iter_mut().flat_map(|run| &mut run.sensors).for_each(|sensor| sensor.hum.extend(&sensor.lines));
    let fitter = Fitter::new(rig, &quiet, options, progress);
    let from = |begin| fitter.fit(&fit.effects, begin, Effort::Whole);
    let (on, anew) = (from(Begin::At(&fit.values()))?, from(Begin::Signals)?);
    let best = if anew.mean_square() < on.mean_square() { anew } else { on };
    let Some(i) = growing(&best.effects) else { return Ok(Some(best)) };
    let most = best.effects[i].effect.elements().map_or(1, |range| *range.end());
    fitter.with_more_elements(&best, i, most, Effort::Converged).map(Some)
}

/// A kind of place in the runs that have it, each with its times and the evidence over no forcing.
struct Kind<'a> {
    name: String,
    runs: Vec<(Contender<'a>, Times, f64)>,
}

impl Kind<'_> {
    fn is_supply(&self) -> bool {
        self.runs.iter().all(|(contender, ..)| contender.spot == Spot::Supply)
    }

    /// Evidence over all runs.
    fn evidence(&self) -> f64 {
        self.runs.iter().map(|(.., evidence)| evidence).sum()
    }

    /// The run that shows it most.
    fn shown(&self) -> Option<&(Contender<'_>, Times, f64)> {
        self.runs.iter().max_by(|a, b| a.2.total_cmp(&b.2))
    }

    /// Where it is along a pipe by all its runs, with the standard error, m; and the square by which these disagree, in
    /// units of their errors.
    fn position_m(&self) -> Option<(f64, f64, f64)> {
        let along = || self.runs.iter().map(|(c, ..)| c).filter(|c| c.spot.position_m().is_some());
        // All runs say alike of a place before all sensors: somewhere there.
        let says_more = if along().all(|c| c.spot.before_sensors_m(&c.run).is_some()) { 1 } else { self.runs.len() };
        let all: Vec<(f64, f64)> = along().take(says_more).map(Contender::position_m).collect();
        let weight: f64 = all.iter().map(|(_, error)| error.powi(-2)).sum();
        let mean = all.iter().map(|(at, error)| at * error.powi(-2)).sum::<f64>() / weight;
        let square = all.iter().map(|(at, error)| ((at - mean) / error).powi(2)).sum();
        (!all.is_empty()).then_some((mean, weight.sqrt().recip(), square))
    }

    /// Logarithm of its odds over no forcing. All places of a pipe are as probable beforehand, and it is one place in
    /// all runs: of one that is found at a place, only the part counts that it is known to, the integral of
    /// `Π exp(-(x - xᵣ)²/2σᵣ²)` over the length.
    fn log_odds(&self, rig: &Rig) -> f64 {
        let part = self.position_m().zip(self.shown()).map_or(0.0, |((_, error_m, square), (c, ..))| {
            (error_m * std::f64::consts::TAU.sqrt() / rig.line_length_m(c.spot.line(rig))).min(1.0).ln() - 0.5 * square
        });
        tempered(self.evidence()) + part
    }
}

/// Whether one of two places is the supply and the other lies between it and all sensors: waves that pass the first
/// sensor are all that either sends, so there is a waveform of each that no sensor can tell from the other's.
fn is_same_wave(one: &Kind, other: &Kind) -> bool {
    let is_before = |kind: &Kind| kind.runs.iter().all(|(c, ..)| c.spot.before_sensors_m(&c.run).is_some());
    (one.is_supply() && is_before(other)) || (is_before(one) && other.is_supply())
}

/// The forcing at a place in the run that shows it most.
fn described(kind: &Kind, probability: f64) -> Result<Option<Explanation>, ModelError> {
    let Some((contender, times, _)) = kind.shown() else { return Ok(None) };
    let (run, spot, found) = (&contender.run, &contender.spot, &contender.found);
    let site = match spot {
        Spot::Supply => Site::Supply,
        Spot::Valve => Site::Valve,
        Spot::Wall => Site::Wall,
        Spot::Sensor(s) => Site::Sensor(run.data().sensors[*s].sensor.name.clone()),
        Spot::Pipe(pipe, _) => {
            let Some((position_m, error_m, _)) = kind.position_m() else { return Ok(None) };
            Site::Pipe { pipe: pipe.clone(), position_m, error_m }
        }
    };
    let Some(solution) = normal(run, &contender.data, spot, times)?.solved(found) else { return Ok(None) };
    // A sum of splines at a knot. At the valve, the modes of a wall's strain add up with alternating signs, each in its
    // own measure.
    let at_knot = |c: &[f64], k: usize| (c[k - 1] + 4.0 * c[k] + c[(k + 1).min(c.len() - 1)]) / 6.0;
    let sum = |of: &[Vec<f64>], k: usize| -> f64 {
        of.iter().zip([1.0, -1.0 / 3.0]).map(|(component, sign)| sign * at_knot(component, k)).sum()
    };
    let after = times.before..times.knots;
    let waveform = Waveform {
        time_s: after.clone().map(|k| times.knot_at_s(k)).collect(),
        value: after.clone().map(|k| sum(&solution.forcing, k)).collect(),
        sd: after.clone().map(|k| solution.sd.iter().map(|c| c[k].powi(2)).sum::<f64>().sqrt()).collect(),
    };
    let data = run.data();
    let pulsation = waveform.pulsation(data, run.start_s());
    let mut at = met(run, spot, times)?;
    let answers = response(run, spot, times)?;
    let sensors = data.sensors.len();
    for (component, forcing) in answers.iter().zip(&solution.forcing) {
        for (series, answer) in [(&mut at.head_m, &component[sensors]), (&mut at.flow_m3_s, &component[sensors + 1])] {
            for (cell, value) in series.iter_mut().enumerate() {
                for (k, f) in forcing.iter().enumerate() {
                    *value += times.since(cell, k).and_then(|i| answer.get(i)).map_or(0.0, |a| a * f);
                }
            }
        }
    }
    let at_knots = |series: &[f64]| -> Vec<f64> {
        let near = |k: usize| 0.5 * (series[(k * CELLS).saturating_sub(1)] + series[(k * CELLS).min(series.len() - 1)]);
        (0..waveform.value.len()).map(near).collect()
    };
    let rig = run.problem.model.rig;
    let elevation_m = rig.elevation_m(crate::diagnose::rest::response::place(run, spot));
    let followed = Followed {
        step_s: times.knot_s,
        head_m: &at_knots(&at.head_m),
        before_m: at.head_m[0],
        elevation_m,
        flow_m3_s: &at_knots(&at.flow_m3_s),
        is_the_head: site == Site::Supply,
    };
    let law = law_of(&waveform.value, &waveform.sd, &followed);
    let onset_s = waveform.onset_s();
    let says = sentence(&Look { site: &site, waveform: &waveform, onset_s, pulsation, law });
    Ok(Some(Explanation {
        site,
        probability,
        evidence: kind.evidence(),
        says,
        run: data.file.clone(),
        onset_s,
        pulsation,
        law,
        left_over_noise: (found.left * contender.data.errors.excess).sqrt(),
        time_s: waveform.time_s,
        value: waveform.value,
        sd: waveform.sd,
    }))
}
