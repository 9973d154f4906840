//! The simulations that a problem takes its residuals from.

use crate::fit::numeric::least_squares::Problem;
use crate::fit::problem::fit_problem::{FitProblem, Modelled};
use crate::fit::problem::latest::Kept;
use crate::model::energy::Energy;
use crate::model::trace::Probe;
use crate::model::{Conditions, Model, ModelError, Resolution, RunValues, Simulated};
use crate::rig::Place;

/// [`Model::simulate`] or [`Model::simulate_with_energy`].
type Simulate<'a> =
    fn(&Model<'a>, &Conditions, &[f64], &RunValues, Resolution, &[Probe]) -> Result<Simulated, ModelError>;

impl<'a> FitProblem<'a> {
    /// Simulates a run: traces at its sensors, as each sensor shows them, without offsets.
    ///
    /// # Errors
    /// As [`Model::simulate`].
    pub fn modelled(&self, r: usize, values: &[f64], reaches: usize) -> Result<Modelled, ModelError> {
        let simulated = match reaches == self.window().reaches {
            true => self.in_window(r, values, false)?,
            false => self.simulated(r, values, reaches, &self.places(r, values), Model::simulate)?,
        };
        self.sensed(r, values, simulated)
    }

    /// What a run's gauges show of a simulation.
    pub(super) fn sensed(&self, r: usize, values: &[f64], simulated: Simulated) -> Result<Modelled, ModelError> {
        let (run, shared) = (&self.runs[r], &values[..self.model.shared.len()]);
        let meter_flow_m3_s = run.meter.as_ref().map(|m| simulated.steady_flow_m3_s(m.place));
        let sensed = run.sensors.iter().zip(simulated.traces);
        let traces = sensed.map(|(s, trace)| self.model.sensed(shared, &s.sensor, trace)).collect::<Result<_, _>>()?;
        Ok(Modelled { traces, meter_flow_m3_s })
    }

    /// A simulation in the window: the latest one if it can be reused, else a new one, which is stored if `keep`.
    pub(super) fn in_window(&self, r: usize, values: &[f64], keep: bool) -> Result<Simulated, ModelError> {
        if let Some(latest) = self.latest(r, values) {
            return Ok(latest);
        }
        let (reaches, mut places) = (self.window.reaches, self.places(r, values));
        if !keep {
            return self.simulated(r, values, reaches, &places, Model::simulate);
        }
        let sensors = places.len();
        // Where one of them would stand a step further.
        for (i, sensor) in self.runs[r].sensors.iter().enumerate() {
            let own = self.place_variable(&sensor.sensor);
            places.extend(own.map(|j| Place { position_m: values[j] + self.difference_step(j), ..places[i] }));
        }
        let mut simulated = self.simulated(r, values, reaches, &places, Model::simulate)?;
        let (causes, needed_s) = (self.causes(r, values), self.needed_s(r, values));
        self.latest[r].keep(Kept { causes, needed_s, places, simulated: simulated.clone() });
        simulated.traces.truncate(sensors);
        Ok(simulated)
    }

    /// The latest simulation, if it can be reused for these values.
    pub(super) fn latest(&self, r: usize, values: &[f64]) -> Option<Simulated> {
        self.latest[r].read(&self.causes(r, values), self.needed_s(r, values), &self.places(r, values))
    }

    /// Everything that the waves of a run depend on, of the values.
    fn causes(&self, r: usize, values: &[f64]) -> Vec<f64> {
        let at_sensor = |j: &usize| {
            let at = self.model.effects.iter().enumerate().filter(|(_, chosen)| chosen.sensor.is_some());
            at.map(|(i, _)| self.model.parameters_of(i)).any(|own| own.contains(j))
        };
        let shared = (0..self.model.shared.len()).filter(|j| !at_sensor(j));
        let [run @ .., start] = self.run_variables(r);
        let driven = self.runs[r].conditions.supply_deviation.is_some().then_some(start);
        shared.chain(run).chain(driven).map(|j| values[j]).collect()
    }

    /// Where a run's sensors stand.
    fn places(&self, r: usize, values: &[f64]) -> Vec<Place> {
        self.runs[r].sensors.iter().map(|s| self.place(&s.sensor, values)).collect()
    }

    /// Time from the start of a run's closure to its last sample that enters, s.
    fn duration_s(&self, r: usize, values: &[f64]) -> f64 {
        let start_s = self.closure_start_s(r, values);
        self.rows.last_s(r, start_s) - start_s
    }

    /// Simulated time that is needed, s: that duration and what late sensors still show.
    fn needed_s(&self, r: usize, values: &[f64]) -> f64 {
        self.duration_s(r, values) + self.model.beyond_s(&values[..self.model.shared.len()])
    }

    /// Where the energy goes in a run, from the start of its closure to its last sample that enters.
    ///
    /// # Errors
    /// As [`Model::simulate`].
    pub fn energy(&self, r: usize, values: &[f64], reaches: usize) -> Result<Option<Energy>, ModelError> {
        let places = self.places(r, values);
        Ok(self.simulated(r, values, reaches, &places, Model::simulate_with_energy)?.energy)
    }

    /// Simulates a run by one of the model's methods: heads at these places.
    fn simulated(
        &self,
        r: usize,
        values: &[f64],
        reaches: usize,
        places: &[Place],
        simulate: Simulate<'a>,
    ) -> Result<Simulated, ModelError> {
        let start_s = self.closure_start_s(r, values);
        let probes: Vec<Probe> = places.iter().map(|&place| Probe::Head(place)).collect();
        let mut conditions = self.runs[r].conditions.clone();
        if let Some((time_s, _)) = &mut conditions.supply_deviation {
            time_s.iter_mut().for_each(|t| *t -= start_s);
        }
        let resolution = Resolution { reaches, duration_s: self.duration_s(r, values) };
        let shared = &values[..self.model.shared.len()];
        simulate(self.model, &conditions, shared, &self.run_values(r, values), resolution, &probes)
    }
}
