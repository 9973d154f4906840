//! The places of one run, ranked by evidence.
//!
//! A fit that lacks a forcing has moved its variables to make up for it. So they first go back to what the instruments
//! say; all places are screened there. The best place of each kind then contends: variables and forcing move together,
//! and a place along a pipe with them (Gauss-Newton). What a forcing leaves counts as error there.

use rayon::prelude::*;

use crate::diagnose::evidence::tempered;
use crate::diagnose::rest::cells::{Run, Times};
use crate::diagnose::rest::forced::Forced;
use crate::diagnose::rest::inverse::{Belief, Data, Errors, Found, Normal, PROCESSES, Process, columns};
use crate::diagnose::rest::places::Spot;
use crate::diagnose::rest::response::{Response, response};
use crate::diagnose::rest::waveform::{CYCLES, KNOTS_A_CYCLE};
use crate::model::ModelError;
use crate::model::parameter::Scale;
use crate::product::dot;

/// Times that the variables move with a forcing.
const ROUNDS: usize = 3;
/// Steps of the search for a forcing's power: while it is looked for, and of what is shown.
const QUICK: usize = 4;
const THOROUGH: usize = 8;
/// Times that the variables move alone, before any forcing is looked for.
const DOUBTS: usize = 3;
/// Change of a logarithm within which its slopes are trusted, as a standard deviation.
const TRUSTED: f64 = 0.3;
/// What is not known of a variable before the fit is as wide as this many errors of the record.
const WIDE: f64 = 1e4;
/// The best place of a kind, with the run's model as it is with a forcing there.
pub(crate) struct Contender<'a> {
    pub(crate) run: Run<'a>,
    pub(crate) spot: Spot,
    pub(crate) found: Found,
    pub(crate) data: Data,
    /// Along a pipe, the places about it that were tried, m, with their evidence.
    pub(crate) tried: Vec<(f64, f64)>,
}

impl Contender<'_> {
    /// Position along a pipe and its standard error, m: before all sensors anywhere as probable, else the mean over
    /// those that were tried, each for the stretch to its neighbours.
    pub(crate) fn position_m(&self) -> (f64, f64) {
        if let Some(first_m) = self.spot.before_sensors_m(&self.run) {
            return (0.5 * first_m, first_m / 12f64.sqrt());
        }
        let mut tried = self.tried.clone();
        tried.sort_by(|a, b| a.0.total_cmp(&b.0));
        let top = tried.iter().map(|t| t.1).fold(f64::NEG_INFINITY, f64::max);
        let last = tried.len().saturating_sub(1);
        let weight =
            |i: usize| (tried[(i + 1).min(last)].0 - tried[i.saturating_sub(1)].0) * tempered(tried[i].1 - top).exp();
        let total: f64 = (0..tried.len()).map(weight).sum();
        let mean = (0..tried.len()).map(|i| weight(i) * tried[i].0).sum::<f64>() / total;
        let square = (0..tried.len()).map(|i| weight(i) * (tried[i].0 - mean).powi(2)).sum::<f64>() / total;
        // No finer than they were tried.
        let step_m = tried.windows(2).map(|w| w[1].0 - w[0].0).fold(f64::INFINITY, f64::min);
        (mean, square.sqrt().hypot(step_m / 12f64.sqrt()))
    }
}

/// What the run leaves at its variables' values, beside the forcing that is supposed, with errors as they are believed
/// to be; and how far each free variable may move.
fn data(run: &Run, forced: Option<&Forced>, times: &Times) -> Result<(Data, Vec<(f64, f64)>), ModelError> {
    let cells = run.rows(times);
    let mut y = run.left_in(&run.x, &cells, true)?;
    let done = |x: &[f64]| forced.map_or_else(|| Ok(vec![0.0; y.len()]), |forced| forced.in_rows(run, x, &cells.0));
    let mut slopes = run.slopes(&cells, done)?;
    slopes.extend(run.errors_of_model(times, &cells, &y));
    let rows = cells.0;
    if let Some(forced) = forced {
        y.iter_mut().zip(forced.bend_m(run, &rows)?).for_each(|(y, bend)| *y -= bend);
    }
    for column in slopes.iter_mut().chain([&mut y]) {
        column.iter_mut().zip(&rows).for_each(|(c, row)| *c /= row.sd_m);
    }
    let mut reach = Vec::new();
    for (slope, &j) in slopes.iter_mut().zip(&run.free) {
        let wide = WIDE / dot(slope, slope).sqrt().max(f64::MIN_POSITIVE);
        let (towards, sd) = match run.beliefs[j] {
            Some((mean, sd)) if sd < wide => (mean - run.x[j], sd),
            // Not farther than the slopes mean anything.
            _ if run.problem.parameters[j].scale == Scale::Log => (0.0, wide.min(TRUSTED)),
            _ => (0.0, wide),
        };
        y.iter_mut().zip(&*slope).for_each(|(y, s)| *y -= s * towards);
        slope.iter_mut().for_each(|s| *s *= sd);
        reach.push((towards, sd));
    }
    Ok((Data { rows, errors: Errors::BELIEVED, y, slopes }, reach))
}

/// Moves the variables to where they are when what the model leaves counts as an error: samples whose errors are alike
/// count once. A fit that lacks something has gone wherever that makes up for it, far from what the instruments say;
/// from there no place looks right, and what is left is not where the forcing is.
///
/// # Errors
/// As [`Run::left_in`].
pub(crate) fn doubt(run: &mut Run, times: &Times) -> Result<(), ModelError> {
    for _ in 0..DOUBTS {
        let cells = run.rows(times);
        let left = run.left_in(&run.x, &cells, true)?;
        let left: Vec<f64> = left.iter().zip(&cells.0).map(|(l, row)| l / row.sd_m).collect();
        let (believed, reach) = data(run, None, times)?;
        let alone = Normal::of(&believed.under(Errors::of(&left)), Vec::new(), 0);
        let moves = alone.best(PROCESSES[0], QUICK).and_then(|found| alone.mean(&found)).unwrap_or_default().1;
        run.step(&steps(&moves, &reach));
    }
    Ok(())
}

/// Steps of the variables from moves in units of what was known of them.
fn steps(moves: &[f64], reach: &[(f64, f64)]) -> Vec<f64> {
    moves.iter().zip(reach).map(|(m, (towards, sd))| towards + m * sd).collect()
}

/// The normal equations of a place.
///
/// # Errors
/// As [`response`].
pub(crate) fn normal(run: &Run, data: &Data, spot: &Spot, times: &Times) -> Result<Normal, ModelError> {
    let response = response(run, spot, times)?;
    Ok(Normal::of(data, columns(data, &response, times), response.len()))
}

/// Those of the `times` at which a forcing, wherever it is, gains most evidence over none; one place of each kind is
/// looked at.
///
/// # Errors
/// As [`Run::left_in`].
pub(crate) fn resolved(run: &Run, spots: &[Spot], times: &[Times]) -> Result<Times, ModelError> {
    let off_middle_m = |spot: &Spot| spot.off_middle_m(run.problem.model.rig);
    let spots = best_of_each_kind(run, spots.iter().map(|spot| (spot.clone(), -off_middle_m(spot))).collect());
    let gains = times.iter().map(|times| Ok((gain(run, &spots, times)?, *times)));
    let gains = gains.collect::<Result<Vec<_>, ModelError>>()?;
    let best = gains.into_iter().max_by(|a, b| a.0.total_cmp(&b.0));
    Ok(best.map_or(times[0], |(_, times)| times))
}

/// The evidence over none of a forcing at the best of some places, with errors as it leaves them: knots too coarse for
/// a forcing leave much of it, and what they leave is no noise.
fn gain(run: &Run, spots: &[Spot], times: &Times) -> Result<f64, ModelError> {
    let believed = data(run, None, times)?.0;
    let processes = [vec![PROCESSES[1]], tones(&believed, times)].concat();
    let rests: Vec<_> = spots.par_iter().map(|spot| rest(run, &believed, spot, times, &processes)).collect();
    // A place that cannot be simulated is no candidate.
    let found = spots.iter().zip(rests).filter_map(|(spot, rest)| Some((spot, rest.ok()??)));
    let best = found.max_by(|a, b| a.1.0.evidence.total_cmp(&b.1.0.evidence));
    let Some((spot, (found, rest))) = best else { return Ok(f64::NEG_INFINITY) };
    let data = believed.under(Errors::of(&rest));
    let with = normal(run, &data, spot, times)?.best(found.belief.process, QUICK);
    let without = Normal::of(&data, Vec::new(), 0).judged(found.belief);
    Ok(with.zip(without).map_or(f64::NEG_INFINITY, |(with, without)| with.evidence - without.evidence))
}

/// The best place of each kind, the best first.
fn best_of_each_kind(run: &Run, mut scored: Vec<(Spot, f64)>) -> Vec<Spot> {
    scored.sort_by(|a, b| b.1.total_cmp(&a.1));
    let mut best: Vec<Spot> = Vec::new();
    for (spot, _) in scored {
        if !best.iter().any(|other| other.is_alike(&spot, run)) {
            best.push(spot);
        }
    }
    best
}

/// What the best forcing at a place leaves of each row, in units of what its error is believed to be, with the process
/// that it is.
fn rest(
    run: &Run,
    data: &Data,
    spot: &Spot,
    times: &Times,
    processes: &[Process],
) -> Result<Option<(Found, Vec<f64>)>, ModelError> {
    let response = response(run, spot, times)?;
    let columns = columns(data, &response, times);
    let normal = Normal::of(data, columns.clone(), response.len());
    let found = processes.iter().filter_map(|process| normal.best(*process, QUICK)).reduce(better);
    let mean = found.as_ref().and_then(|found| normal.mean(found));
    Ok(found.zip(mean).map(|(found, mean)| (found, data.rest(&columns, &mean))))
}

/// The contenders of a run that is in [`doubt`]: of each kind of place the best one, with the model's variables where
/// they are with it.
///
/// # Errors
/// As [`Run::left_in`].
pub(crate) fn contenders<'a>(
    run: Run<'a>,
    again: impl Fn() -> Result<Run<'a>, ModelError> + Sync,
    spots: &[Spot],
    times: &Times,
) -> Result<Vec<Contender<'a>>, ModelError> {
    let screened = data(&run, None, times)?.0;
    let judged = |spot: &Spot| {
        let found = normal(&run, &screened, spot, times).ok()?.best(PROCESSES[1], QUICK)?;
        Some((spot.clone(), found.evidence))
    };
    let best = best_of_each_kind(&run, spots.par_iter().filter_map(judged).collect());
    let tones = tones(&screened, times);
    let x = run.x.clone();
    let settled = |spot: Spot| -> Result<Option<Settled<'a>>, ModelError> {
        let mut own = again()?;
        own.x.clone_from(&x);
        let Some((_, rest)) = rest(&own, &screened, &spot, times, &[PROCESSES[1]])? else { return Ok(None) };
        settled(own, spot, times, &tones, Errors::of(&rest))
    };
    let settled: Vec<Option<Settled>> = best.into_par_iter().map(settled).collect::<Result<_, _>>()?;
    let settled: Vec<Settled> = settled.into_iter().flatten().collect();
    // What the best place leaves says how the errors are, for all of them.
    let rest = |s: &Settled| rest(&s.run, &data(&s.run, s.forced.as_ref(), times)?.0, &s.spot, times, &[s.process]);
    let rests: Vec<Option<(Found, Vec<f64>)>> = settled.par_iter().map(rest).collect::<Result<_, _>>()?;
    let best = rests.into_iter().flatten().max_by(|a, b| a.0.evidence.total_cmp(&b.0.evidence));
    let Some((_, rest)) = best else { return Ok(Vec::new()) };
    let errors = Errors::of(&rest);
    let judged: Vec<Option<Contender>> =
        settled.into_par_iter().map(|settled| settled.judged(times, errors)).collect::<Result<_, _>>()?;
    Ok(judged.into_iter().flatten().collect())
}

/// The evidence for no forcing at a run's variables, with given errors.
///
/// # Errors
/// As [`Run::left_in`].
pub(crate) fn nothing(run: &Run, times: &Times, errors: Errors) -> Result<f64, ModelError> {
    let alone = Normal::of(&data(run, None, times)?.0.under(errors), Vec::new(), 0);
    Ok(alone.best(PROCESSES[0], QUICK).map_or(f64::NEG_INFINITY, |found| found.evidence))
}

/// A place, with the variables where they are best with a forcing there.
struct Settled<'a> {
    run: Run<'a>,
    spot: Spot,
    forced: Option<Forced>,
    process: Process,
    /// Distance of the places about it that are still of interest, m.
    step_m: f64,
}

impl<'a> Settled<'a> {
    /// With errors as they are.
    fn judged(self, times: &Times, errors: Errors) -> Result<Option<Contender<'a>>, ModelError> {
        let Settled { run, spot, forced, process, step_m } = self;
        let data = data(&run, forced.as_ref(), times)?.0.under(errors);
        let here = normal(&run, &data, &spot, times)?;
        let Some(found) = here.best(process, THOROUGH) else { return Ok(None) };
        let mut tried = vec![(spot.clone(), found.clone())];
        for near in spot.moved(&run, &[-2.0, -1.0, -0.5, 0.5, 1.0, 2.0].map(|by| by * step_m)) {
            if near != spot
                && let Some(found) = normal(&run, &data, &near, times)?.judged(found.belief)
            {
                tried.push((near, found));
            }
        }
        let Some((spot, found)) = tried.iter().max_by(|a, b| a.1.evidence.total_cmp(&b.1.evidence)).cloned() else {
            return Ok(None);
        };
        let tried = tried.into_iter().filter_map(|(spot, found)| Some((spot.position_m()?, found.evidence))).collect();
        Ok(Some(Contender { run, spot, found, data, tried }))
    }
}

/// Moves the variables, and along a pipe the place, to where they are with a forcing there. What it leaves counts as
/// error, at first the given ones: otherwise the variables go wherever that makes up for what its knots cannot follow.
fn settled<'a>(
    mut run: Run<'a>,
    mut spot: Spot,
    times: &Times,
    tones: &[Process],
    mut errors: Errors,
) -> Result<Option<Settled<'a>>, ModelError> {
    let mut process = PROCESSES[1];
    let mut forced = None;
    // The variables move a place by some spacings.
    let mut step_m = 4.0 * spot.spacing_m(run.problem.model.rig);
    for round in 1..=ROUNDS {
        let (believed, reach) = data(&run, forced.as_ref(), times)?;
        let data = believed.under(errors);
        step_m *= 0.5;
        let mut best: Option<(Spot, Found, Normal, Response)> = None;
        for near in spot.moved(&run, &[0.0, -step_m, step_m]) {
            let response = response(&run, &near, times)?;
            let normal = Normal::of(&data, columns(&data, &response, times), response.len());
            // A step along a pipe changes the forcing's power little.
            let found = best.as_ref().map_or_else(|| normal.best(process, QUICK), |(_, b, ..)| normal.judged(b.belief));
            let Some(found) = found else { continue };
            if best.as_ref().is_none_or(|(_, b, ..)| found.evidence > b.evidence) {
                best = Some((near, found, normal, response));
            }
        }
        let Some((near, found, normal, response)) = best else { return Ok(None) };
        // Which process it is shows at one power.
        let others = PROCESSES.iter().chain(tones).filter(|p| **p != process && round == 2);
        let at_its_power = |p: &Process| normal.judged(Belief { process: *p, ..found.belief });
        let likeliest = others.filter_map(at_its_power).reduce(better);
        let likeliest = likeliest.and_then(|other| normal.best(other.belief.process, QUICK));
        let found = likeliest.into_iter().fold(found, better);
        let Some(mean) = normal.mean(&found) else { return Ok(None) };
        (spot, process) = (near, found.belief.process);
        errors = Errors::of(&believed.rest(&columns(&believed, &response, times), &mean));
        run.step(&steps(&mean.1, &reach));
        // What is added to a reading changes no flow.
        let flows = !matches!(spot, Spot::Sensor(_));
        forced = flows.then(|| Forced { spot: spot.clone(), times: *times, knots: mean.0 });
    }
    Ok(Some(Settled { run, spot, forced, process, step_m }))
}

/// The tones that what is left may be.
fn tones(data: &Data, times: &Times) -> Vec<Process> {
    strongest(data, times).map(Process::tones).as_slice().as_flattened().to_vec()
}

/// Knots a cycle of the strongest tone in what is left, over all sensors.
fn strongest(data: &Data, times: &Times) -> Option<f64> {
    let sensors = data.rows.iter().map(|row| row.sensor).max()? + 1;
    let cells = times.cells();
    let power = |cycles: f64| -> f64 {
        let mut sums = vec![[0.0; 2]; sensors];
        for (row, y) in data.rows.iter().zip(&data.y) {
            let Some(cell) = row.cell else { continue };
            let (sin, cos) = (std::f64::consts::TAU * cycles * cell as f64 / cells as f64).sin_cos();
            sums[row.sensor][0] += y * cos;
            sums[row.sensor][1] += y * sin;
        }
        sums.iter().map(|[a, b]| a * a + b * b).sum()
    };
    // A third of a cycle apart.
    let most = times.end_s() / (KNOTS_A_CYCLE * times.knot_s);
    let scan = (0..).map(|i| CYCLES + f64::from(i) / 3.0).take_while(|cycles| *cycles < most).collect::<Vec<_>>();
    let cycles = scan.into_par_iter().map(|c| (power(c), c)).max_by(|a, b| a.0.total_cmp(&b.0))?.1;
    Some(times.end_s() / cycles / times.knot_s)
}

fn better(a: Found, b: Found) -> Found {
    if b.evidence > a.evidence { b } else { a }
}
