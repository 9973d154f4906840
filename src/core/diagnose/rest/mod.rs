//! What would explain the rest: where nothing in the catalogue does, the forcing that is missing, without a shape given.
//!
//! 1. What the fitted model leaves of a run is averaged in [`cells`].
//! 2. At each of the [`places`], the [`response`] to a [`pulse`] is simulated: the head of the supply, a flow out at the valve or along the pipe, a head
//!    added at a sensor, a strain of the wall.
//! 3. The forcing at a place is a linear [`inverse`] problem with a closed-form evidence, by which the places are [`ranking`].
//! 4. The forcing at the best places is described: its [`waveform`], the [`law`] that it follows, and both in [`words`].

pub(crate) mod cells;
pub mod explanation;
pub(crate) mod inverse;
pub mod law;
pub(crate) mod places;
pub(crate) mod pulse;
pub(crate) mod ranking;
pub(crate) mod resolution;
pub(crate) mod response;
pub mod waveform;
pub(crate) mod words;

use crate::diagnose::evidence::tempered;
use crate::diagnose::limits::{INDISTINGUISHABLE, LEAST_EVIDENCE};
use crate::diagnose::measures::{least_fall, over_noise};
use crate::diagnose::rest::cells::{CELLS, Run, Times};
use crate::diagnose::rest::explanation::{Explanation, Site};
use crate::diagnose::rest::law::{Followed, law_of};
use crate::diagnose::rest::places::{Spot, places, spacing_m};
use crate::diagnose::rest::ranking::{Ranked, Ranking, normal, ranked};
use crate::diagnose::rest::resolution::times;
use crate::diagnose::rest::response::{met, response};
use crate::diagnose::rest::waveform::Waveform;
use crate::diagnose::rest::words::{Look, sentence};
use crate::fit::data::run_data::RunData;
use crate::fit::outcome::fit::Fit;
use crate::fit::progress::{OnProgress, Progress};
use crate::fit::search::options::Options;
use crate::fit::search::thresholds::COARSE_REACHES;
use crate::model::{Model, ModelError};
use crate::rig::Rig;

/// A run with its ranked places.
struct Judged<'a> {
    run: Run<'a>,
    times: Times,
    ranking: Ranking,
}

impl Judged<'_> {
    /// Evidence of a place over no forcing.
    fn evidence(&self, place: &Ranked) -> f64 {
        place.found.evidence - self.ranking.nothing.evidence
    }

    fn of(&self, key: &Key) -> Option<&Ranked> {
        self.ranking.places.iter().find(|p| key_of(&p.spot, &self.run) == *key)
    }
}

/// A place, the same for all runs.
#[derive(Debug, Clone, PartialEq)]
enum Key {
    Spot(Spot),
    Sensor(String),
}

fn key_of(spot: &Spot, run: &Run) -> Key {
    match spot {
        Spot::Sensor(s) => Key::Sensor(run.data().sensors[*s].sensor.name.clone()),
        other => Key::Spot(other.clone()),
    }
}

/// What would explain what a fitted model leaves of `runs`: the most probable place first, then those that cannot be told from it. Nothing where
/// nothing is left.
///
/// # Errors
/// As [`Model::simulate`].
pub fn explain(
    rig: &Rig,
    runs: &[RunData],
    fit: &Fit,
    options: &Options,
    progress: &OnProgress<'_>,
) -> Result<Vec<Explanation>, ModelError> {
    if over_noise(fit, runs).powi(2) < 1.0 + least_fall(runs, 0.0) {
        return Ok(Vec::new());
    }
    progress(&Progress::from("what would explain the rest"));
    let model = Model::new(rig, &runs[0].conditions.water, &fit.effects);
    let model = model.constrained(&options.constraints).informed(&options.priors);
    let values = fit.values();
    let shared = &values[..model.shared.len()];
    let coarse = model.fitting_reaches(shared, COARSE_REACHES.max(model.least_reaches(shared)));
    let judged = (0..runs.len()).map(|r| {
        let mut run = Run::new(&model, &runs[r..=r], fit, coarse)?;
        let times = times(&run)?;
        let spots = places(rig, &run);
        let ranking = ranked(&mut run, &spots, &times)?;
        Ok(Judged { run, times, ranking })
    });
    let judged: Vec<Judged> = judged.collect::<Result<_, ModelError>>()?;
    let Some(first) = judged.first() else { return Ok(Vec::new()) };
    let keys = first.ranking.places.iter().map(|p| key_of(&p.spot, &first.run));
    let total = |key: &Key| -> f64 {
        judged.iter().map(|j| j.of(key).map_or(f64::NEG_INFINITY, |place| j.evidence(place))).sum()
    };
    let mut all: Vec<(Key, f64)> = keys.map(|key| (key.clone(), total(&key))).collect();
    all.sort_by(|a, b| b.1.total_cmp(&a.1));
    // Each kind of place by its best member: along a pipe, by the mean over its places.
    let mut kinds: Vec<(Key, f64, f64)> = Vec::new();
    for (key, evidence) in &all {
        if !kinds.iter().any(|(other, ..)| is_same_pipe(other, key)) {
            let own = all.iter().filter(|(other, _)| is_same_pipe(other, key));
            let (n, sum) = own.fold((0.0, 0.0), |(n, sum), (_, e)| (n + 1.0, sum + tempered(e - evidence).exp()));
            kinds.push((key.clone(), *evidence, tempered(*evidence) + f64::ln(sum / n)));
        }
    }
    kinds.sort_by(|a, b| b.2.total_cmp(&a.2));
    let Some(&(_, best, top)) = kinds.first() else { return Ok(Vec::new()) };
    if best < LEAST_EVIDENCE {
        return Ok(Vec::new());
    }
    let odds: f64 = kinds.iter().map(|(_, _, log_odds)| (log_odds - top).exp()).sum::<f64>() + (-top).exp();
    let shown = kinds.iter().filter(|(_, _, log_odds)| top - log_odds < INDISTINGUISHABLE);
    let described = shown.filter_map(|(key, evidence, log_odds)| {
        let site = site_of(rig, &judged, &all, key).transpose()?;
        let probability = (log_odds - top).exp() / odds;
        site.and_then(|site| described(&judged, key, site, probability, *evidence)).transpose()
    });
    described.collect()
}

/// Whether two places are on one pipe, or the same.
fn is_same_pipe(one: &Key, other: &Key) -> bool {
    match (one, other) {
        (Key::Spot(Spot::Pipe(a, _)), Key::Spot(Spot::Pipe(b, _))) => a == b,
        (a, b) => a == b,
    }
}

/// A place for people. Along a pipe it is looked for between the places that were tried.
fn site_of(rig: &Rig, judged: &[Judged], all: &[(Key, f64)], key: &Key) -> Result<Option<Site>, ModelError> {
    let (pipe, best_m) = match key {
        Key::Sensor(name) => return Ok(Some(Site::Sensor(name.clone()))),
        Key::Spot(Spot::Supply) => return Ok(Some(Site::Supply)),
        Key::Spot(Spot::Valve) => return Ok(Some(Site::Valve)),
        Key::Spot(Spot::Wall) => return Ok(Some(Site::Wall)),
        Key::Spot(Spot::Sensor(_)) => return Ok(None),
        Key::Spot(Spot::Pipe(pipe, best_m)) => (pipe, *best_m),
    };
    let mut tried: Vec<(f64, f64)> = all
        .iter()
        .filter_map(|(other, evidence)| match other {
            Key::Spot(Spot::Pipe(p, at_m)) if p == pipe => Some((*at_m, *evidence)),
            _ => None,
        })
        .collect();
    let spacing_m = spacing_m(rig, pipe.as_deref());
    for part in [-0.75, -0.5, -0.25, 0.25, 0.5, 0.75] {
        let spot = Spot::Pipe(pipe.clone(), best_m + part * spacing_m);
        let mut sum = 0.0;
        for j in judged {
            let Some(near) = j.of(key) else { return Ok(None) };
            let normal = normal(&j.run, &j.ranking.data, &spot, &j.times)?;
            sum += normal.best(near.found.belief.memory).map_or(f64::NEG_INFINITY, |f| f.evidence)
                - j.ranking.nothing.evidence;
        }
        tried.push((best_m + part * spacing_m, sum));
    }
    // Each stands for the stretch to its neighbours.
    tried.sort_by(|a, b| a.0.total_cmp(&b.0));
    let top = tried.iter().map(|t| t.1).fold(f64::NEG_INFINITY, f64::max);
    let weight = |i: usize| {
        let (low, high) = (tried[i.saturating_sub(1)].0, tried[(i + 1).min(tried.len() - 1)].0);
        (high - low) * tempered(tried[i].1 - top).exp()
    };
    let total: f64 = (0..tried.len()).map(weight).sum();
    let position_m = (0..tried.len()).map(|i| weight(i) * tried[i].0).sum::<f64>() / total;
    let square: f64 = (0..tried.len()).map(|i| weight(i) * (tried[i].0 - position_m).powi(2)).sum::<f64>() / total;
    // No finer than they were tried.
    let error_m = square.sqrt().hypot(0.25 * spacing_m / 12f64.sqrt());
    Ok(Some(Site::Pipe { pipe: pipe.clone(), position_m, error_m }))
}

/// The forcing at a place in the run that shows it most.
fn described(
    judged: &[Judged],
    key: &Key,
    site: Site,
    probability: f64,
    evidence: f64,
) -> Result<Option<Explanation>, ModelError> {
    let shown = judged.iter().filter_map(|j| Some((j, j.of(key)?)));
    let Some((j, place)) = shown.max_by(|a, b| a.0.evidence(a.1).total_cmp(&b.0.evidence(b.1))) else {
        return Ok(None);
    };
    let (run, times) = (&j.run, &j.times);
    let spot = match (&site, &place.spot) {
        (Site::Pipe { pipe, position_m, .. }, _) => Spot::Pipe(pipe.clone(), *position_m),
        (_, spot) => spot.clone(),
    };
    let normal = normal(run, &j.ranking.data, &spot, times)?;
    let Some(found) = normal.best(place.found.belief.memory) else { return Ok(None) };
    let Some(solution) = normal.solved(&found) else { return Ok(None) };
    // At the valve, the modes of a wall's strain add up with alternating signs.
    let sum = |of: &[Vec<f64>], k: usize| -> f64 {
        of.iter().zip([1.0, -1.0].iter().cycle()).map(|(component, sign)| sign * component[k]).sum()
    };
    let after = times.before..times.knots;
    let waveform = Waveform {
        time_s: after.clone().map(|k| times.knot_at_s(k)).collect(),
        value: after.clone().map(|k| sum(&solution.forcing, k)).collect(),
        sd: after.clone().map(|k| solution.sd.iter().map(|c| c[k].powi(2)).sum::<f64>().sqrt()).collect(),
    };
    let data = run.data();
    let pulsation = waveform.pulsation(data, run.start_s());
    let mut at = met(run, &spot, times)?;
    let answers = response(run, &spot, times)?;
    let sensors = data.sensors.len();
    for (component, forcing) in answers.iter().zip(&solution.forcing) {
        for (series, answer) in [(&mut at.head_m, &component[sensors]), (&mut at.flow_m3_s, &component[sensors + 1])] {
            for (cell, value) in series.iter_mut().enumerate() {
                for (k, f) in forcing.iter().enumerate() {
                    let since = cell as i64 + CELLS as i64 * (times.before as i64 - k as i64 + 1);
                    *value += usize::try_from(since).ok().and_then(|i| answer.get(i)).map_or(0.0, |a| a * f);
                }
            }
        }
    }
    let at_knots = |series: &[f64]| -> Vec<f64> {
        let near = |k: usize| 0.5 * (series[(k * CELLS).saturating_sub(1)] + series[(k * CELLS).min(series.len() - 1)]);
        (0..waveform.value.len()).map(near).collect()
    };
    let rig = run.problem.model.rig;
    let elevation_m = rig.elevation_m(crate::diagnose::rest::response::place(run, &spot));
    let followed = Followed {
        step_s: times.knot_s,
        head_m: &at_knots(&at.head_m),
        before_m: at.head_m[0],
        elevation_m,
        flow_m3_s: &at_knots(&at.flow_m3_s),
    };
    let law = law_of(&waveform.value, &waveform.sd, &followed);
    let onset_s = waveform.onset_s();
    let says = sentence(&Look { site: &site, waveform: &waveform, onset_s, pulsation, law });
    Ok(Some(Explanation {
        site,
        probability,
        evidence,
        says,
        run: data.file.clone(),
        onset_s,
        pulsation,
        law,
        left_over_noise: found.left.sqrt(),
        time_s: waveform.time_s,
        value: waveform.value,
        sd: waveform.sd,
    }))
}
