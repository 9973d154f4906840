//! A forcing that is supposed: what it does beyond the sum of its linear answers.
//!
//! A large forcing changes the flow, on which friction depends, and the model's variables do other things with it than
//! without. So a round that looks for a forcing starts from what the one of the round before does in a simulation, and
//! its linear answers stand for the change alone (defect correction: Stetter 1978, Numer. Math. 29, 425).

use crate::diagnose::rest::cells::{Row, Run, Times};
use crate::diagnose::rest::places::Spot;
use crate::diagnose::rest::pulse::{Curve, REACH};
use crate::diagnose::rest::response::{cell_mean, forcing, response, traces};
use crate::model::ModelError;
use crate::model::trace::Trace;

/// See the module.
#[derive(Debug, Clone)]
pub(crate) struct Forced {
    /// Where it acts.
    pub(crate) spot: Spot,
    /// Its knots.
    pub(crate) times: Times,
    /// Its values at them, of each component.
    pub(crate) knots: Vec<Vec<f64>>,
}

impl Forced {
    /// Its first knot that begins after the closure does. Earlier ones stay linear.
    fn first(&self) -> usize {
        self.times.before + REACH
    }

    /// What it does in each row, under the model at `x`, m.
    ///
    /// # Errors
    /// As [`Model::simulate`].
    pub(crate) fn in_rows(&self, run: &Run, x: &[f64], rows: &[Row]) -> Result<Vec<f64>, ModelError> {
        Ok(of_rows(rows, &self.done_m(run, x)?))
    }

    /// What it does in each row beyond the sum of its linear answers, m.
    ///
    /// # Errors
    /// As [`Model::simulate`].
    pub(crate) fn bend_m(&self, run: &Run, rows: &[Row]) -> Result<Vec<f64>, ModelError> {
        let linear = of_rows(rows, &self.linear_m(run)?);
        Ok(self.in_rows(run, &run.x, rows)?.iter().zip(linear).map(|(done, linear)| done - linear).collect())
    }

    /// What it does to each sensor in each cell, under the model at `x`, m.
    ///
    /// # Errors
    /// As [`Model::simulate`].
    pub(crate) fn done_m(&self, run: &Run, x: &[f64]) -> Result<Vec<Vec<f64>>, ModelError> {
        let Forced { spot, times, knots } = self;
        let component = |(mode, sizes): (usize, &Vec<f64>)| {
            let (sizes, first_s) = (sizes[self.first()..].to_vec(), times.knot_at_s(self.first()));
            forcing(spot, Curve { sizes, first_s, width_s: times.knot_s }, mode)
        };
        let forcings: Vec<_> = knots.iter().enumerate().map(component).collect();
        let with = traces(run, x, spot, &forcings, times.end_s())?;
        let without = traces(run, x, spot, &[], times.end_s())?;
        let of = |(with, without): (&Trace, &Trace)| {
            let in_cell = |cell: usize| {
                let begin_s = cell as f64 * times.cell_s();
                cell_mean(with, begin_s, times) - cell_mean(without, begin_s, times)
            };
            (0..times.cells()).map(in_cell).collect()
        };
        Ok(with.iter().zip(&without).take(run.data().sensors.len()).map(of).collect())
    }

    /// The sum of its linear answers, likewise.
    ///
    /// # Errors
    /// As [`Model::simulate`].
    pub(crate) fn linear_m(&self, run: &Run) -> Result<Vec<Vec<f64>>, ModelError> {
        let Forced { spot, times, knots } = self;
        let answers = response(run, spot, times)?;
        let in_cell = |s: usize, cell: usize| -> f64 {
            let begun = (self.first()..times.knots).map_while(|k| Some((k, times.since(cell, k)?)));
            let at = |(k, since): (usize, usize)| -> f64 {
                let sizes = answers.iter().zip(knots).map(|(answer, sizes)| (answer[s].get(since), sizes[k]));
                sizes.map(|(answer, size)| answer.map_or(0.0, |a| a * size)).sum()
            };
            begun.map(at).sum()
        };
        let of = |s: usize| (0..times.cells()).map(|cell| in_cell(s, cell)).collect();
        Ok((0..run.data().sensors.len()).map(of).collect())
    }
}

/// Values by sensors and cells, in each row; zero before the closure.
fn of_rows(rows: &[Row], values: &[Vec<f64>]) -> Vec<f64> {
    rows.iter().map(|row| row.cell.map_or(0.0, |cell| values[row.sensor][cell])).collect()
}
