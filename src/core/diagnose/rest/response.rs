//! Green's functions: what each sensor shows after a pulse of forcing at a place, by simulation.
//!
//! The pulse follows the closure at once, when the valve rests, and is so small that the model answers linearly. What
//! it answers depends on the time since the pulse alone, but for friction, which goes with the flow, and for the
//! closure itself. So one simulation stands for a pulse at any time.

use crate::diagnose::rest::cells::{CELLS, Run, Times};
use crate::diagnose::rest::places::{MODES, Spot};
use crate::diagnose::rest::pulse::{self, Curve, REACH, spline};
use crate::model::effects::Chosen;
use crate::model::trace::{Probe, Trace};
use crate::model::{Model, ModelError, Resolution};
use crate::rig::Place;

/// Share of the surge that a pulse makes: small beside it, large beside rounding.
const SMALL: f64 = 1e-4;
/// Periods between the end of the closure and the pulse.
const QUIET_PERIODS: f64 = 0.1;

/// The answers to a unit pulse that stands at one knot: of each component of the forcing, of each sensor of the run and
/// then of head (m) and flow (m³/s) at the place itself, by cells since one knot before it.
pub(crate) type Response = Vec<Vec<Vec<f64>>>;

/// Head, m, and flow, m³/s, that a model has at a place, by cells after the closure.
pub(crate) struct Met {
    pub(crate) head_m: Vec<f64>,
    pub(crate) flow_m3_s: Vec<f64>,
}

/// What the model alone has at a place.
///
/// # Errors
/// As [`Model::simulate`].
pub(crate) fn met(run: &Run, spot: &Spot, times: &Times) -> Result<Met, ModelError> {
    let traces = traces(run, &run.x, spot, &[], times.end_s())?;
    let [head, flow] = [2, 1].map(|from_last| {
        let trace = &traces[traces.len() - from_last];
        (0..times.cells()).map(|c| trace.at((c as f64 + 0.5) * times.cell_s())).collect()
    });
    Ok(Met { head_m: head, flow_m3_s: flow })
}

/// Where a forcing acts, or where it is seen.
pub(crate) fn place(run: &Run, spot: &Spot) -> Place {
    let rig = run.problem.model.rig;
    let graph = &rig.graph;
    match spot {
        Spot::Supply => match graph.way.first() {
            Some(&(line, true)) => Place { line, position_m: rig.line_length_m(line) },
            Some(&(line, false)) => Place { line, position_m: 0.0 },
            None => 0.0.into(),
        },
        Spot::Valve | Spot::Wall => {
            let line = graph.line_to_valve();
            Place { line, position_m: rig.line_length_m(line) }
        }
        Spot::Pipe(_, position_m) => Place { line: spot.line(rig), position_m: *position_m },
        Spot::Sensor(s) => run.problem.place(&run.data().sensors[*s].sensor, &run.problem.values(&run.x)),
    }
}

/// See the module.
///
/// # Errors
/// As [`Model::simulate`].
pub(crate) fn response(run: &Run, spot: &Spot, times: &Times) -> Result<Response, ModelError> {
    let sensors = run.data().sensors.len();
    if let Spot::Sensor(own) = spot {
        let value = |cell: usize| spline((cell as f64 + 0.5) / CELLS as f64 - REACH as f64);
        let shown = |s: usize| if s == *own { (0..2 * REACH * CELLS).map(value).collect() } else { Vec::new() };
        return Ok(vec![(0..sensors + 2).map(shown).collect()]);
    }
    let surge_m =
        run.data().sensors.iter().map(|s| crate::extent::ends(&s.head_m)).fold(0.0, |m, (l, h)| f64::max(m, h - l));
    let model = run.problem.model;
    let values = run.problem.values(&run.x);
    let own = run.problem.run_values(0, &values);
    let at_s = own.closing_time_s + QUIET_PERIODS * run.period_s() + REACH as f64 * times.knot_s;
    let area_m2 = model.rig.pipe_at_valve().area_m2();
    let speed_m_s = values[0];
    // Joukowsky's head and the strain that holds as much water.
    let size = match spot {
        Spot::Supply | Spot::Sensor(_) => SMALL * surge_m,
        Spot::Valve | Spot::Pipe(..) => SMALL * surge_m * crate::units::GRAVITY_M_S2 * area_m2 / speed_m_s,
        Spot::Wall => SMALL * surge_m * crate::units::GRAVITY_M_S2 / (2.0 * speed_m_s.powi(2)),
    };
    let full = size;
    let modes = if *spot == Spot::Wall { MODES } else { 1 };
    let still = traces(run, &run.x, spot, &[], times.end_s() + at_s)?;
    (0..modes)
        .map(|mode| {
            let pulse = Curve { sizes: vec![size], first_s: at_s, width_s: times.knot_s };
            let moved = traces(run, &run.x, spot, &[forcing(spot, pulse, mode)], times.end_s() + at_s)?;
            let of = |(with, without): (&Trace, &Trace)| {
                let begin_s = at_s - REACH as f64 * times.knot_s;
                let answer = |cell: usize| {
                    let cell_s = begin_s + cell as f64 * times.cell_s();
                    (cell_mean(with, cell_s, times) - cell_mean(without, cell_s, times)) / full
                };
                (0..times.cells() + (times.before + REACH) * CELLS).map(answer).collect()
            };
            Ok(moved.iter().zip(&still).map(of).collect())
        })
        .collect()
}

/// Mean of a trace over a cell that begins at a time.
pub(super) fn cell_mean(trace: &Trace, begin_s: f64, times: &Times) -> f64 {
    [1.0 / 6.0, 0.5, 5.0 / 6.0].map(|part| trace.at(begin_s + part * times.cell_s())).iter().sum::<f64>() / 3.0
}

/// A forcing at a place, of the wall in one of its modes: a wave has less of the higher ones.
pub(super) fn forcing(spot: &Spot, mut curve: Curve, mode: usize) -> (Chosen, Vec<f64>) {
    curve.sizes.iter_mut().for_each(|size| *size /= (2 * mode + 1) as f64);
    match spot {
        Spot::Supply => pulse::at_supply(curve),
        Spot::Valve => pulse::at_valve(curve),
        Spot::Pipe(pipe, position_m) => pulse::on_pipe(curve, pipe.clone(), *position_m),
        Spot::Wall | Spot::Sensor(_) => pulse::in_wall(curve, mode),
    }
}

/// Heads at the run's sensors, as each shows them, then head and flow at a place, under some forcings.
pub(super) fn traces(
    run: &Run,
    x: &[f64],
    spot: &Spot,
    forcings: &[(Chosen, Vec<f64>)],
    duration_s: f64,
) -> Result<Vec<Trace>, ModelError> {
    let (model, values) = (run.problem.model, run.problem.values(x));
    let shared = &values[..model.shared.len()];
    let effects: Vec<Chosen> = model.effects.iter().chain(forcings.iter().map(|f| &f.0)).cloned().collect();
    let data = run.data();
    let forced = Model::new(model.rig, &data.conditions.water, &effects);
    let with: Vec<f64> = shared.iter().chain(forcings.iter().flat_map(|f| &f.1)).copied().collect();
    let mut conditions = data.conditions.clone();
    if let Some((time_s, _)) = &mut conditions.supply_deviation {
        let start_s = run.start_s();
        time_s.iter_mut().for_each(|t| *t -= start_s);
    }
    let seen = data.sensors.iter().map(|s| Probe::head(run.problem.place(&s.sensor, &values)));
    let at = place(run, spot);
    let probes: Vec<Probe> = seen.chain([Probe::head(at), Probe::flow(at)]).collect();
    let resolution = Resolution { reaches: run.coarse, duration_s };
    let simulated = forced.simulate(&conditions, &with, &run.problem.run_values(0, &values), resolution, &probes)?;
    let mut gauges = data.sensors.iter();
    let shown = |trace: Trace| match gauges.next() {
        Some(gauge) => model.sensed(shared, &gauge.sensor, trace),
        None => Ok(trace),
    };
    simulated.traces.into_iter().map(shown).collect()
}
