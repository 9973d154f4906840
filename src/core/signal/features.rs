//! What a recording shows, as plain data.

use crate::signal::noise::Noise;

/// A value with its standard error, in the same unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// The value.
    pub value: f64,
    /// Its standard error.
    pub standard_error: f64,
}

/// What a recording shows.
#[derive(Debug, Clone, PartialEq)]
pub struct Features {
    /// When the valve closed.
    pub closure: Closure,
    /// Temperature of the run, °C: from its sensor, or from the rig file.
    pub temperature_degc: f64,
    /// Flow before the closure, m³/s, where a flow sensor recorded it.
    pub flow_m3_s: Option<Estimate>,
    /// The same as velocity in the pipe at the valve, m/s.
    pub steady_velocity_m_s: Option<Estimate>,
    /// Each pressure sensor that recorded something, in the rig's order.
    pub sensors: Vec<SensorFeatures>,
    /// Index in `sensors` of the one nearest to the valve with a clear front; closure, period and damping are read
    /// there.
    pub reference: usize,
    /// Period of the oscillation, s (4L/a, lengthened by creep, gas and unsteady friction).
    pub period: Option<Estimate>,
    /// Frequency at which the spectrum of the oscillation at the reference sensor peaks, Hz.
    pub fundamental_hz: Option<f64>,
    /// Logarithmic decrement of each cycle at the reference sensor.
    pub damping_per_cycle: Vec<f64>,
    /// The wave speed in four ways.
    pub wave_speed: WaveSpeeds,
}

/// The valve's closure. Times are on the recording's clock.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Closure {
    /// Its start, s.
    pub start_s: f64,
    /// Standard error of the start, s.
    pub start_se_s: f64,
    /// Its observed end, s: from the valve position, from the end of the first rise, or, of a slow one, from where the
    /// head starts to repeat itself; none if nothing shows it.
    pub end_s: Option<f64>,
    /// Whether it takes longer, or nearly longer, than the wave's return to the sensor (2L/a at the valve), so that the
    /// fall of the first peak starts within its rise: the front then carries neither the wave speed nor Joukowsky's
    /// head.
    pub slow: bool,
    /// Whether the start comes from a trigger channel.
    pub from_trigger: bool,
    /// Time at which the pressure starts to rise at the valve, s.
    pub pressure_onset_s: f64,
}

/// What one pressure sensor shows.
#[derive(Debug, Clone, PartialEq)]
pub struct SensorFeatures {
    /// Index among the rig's sensors.
    pub sensor: usize,
    /// Its name.
    pub name: String,
    /// Distance from the supply, m.
    pub position_m: f64,
    /// Number of samples recorded.
    pub samples: usize,
    /// Median sample interval, s.
    pub interval_s: f64,
    /// Time of its first sample, s.
    pub begin_s: f64,
    /// Time of its last sample, s.
    pub end_s: f64,
    /// Its noise, in m.
    pub noise: Noise,
    /// Head before the closure, m.
    pub steady_before_m: Estimate,
    /// Head over the last whole period of the record, m; none if the record is shorter than two periods.
    pub steady_after_m: Option<Estimate>,
    /// Arrival of the front, s; none if the sensor shows none (at the supply).
    pub front_arrival_s: Option<Estimate>,
    /// From where to where samples are missing within a period of that front, s.
    pub missing_at_front_s: Option<[f64; 2]>,
    /// The first peak.
    pub first_peak: Option<Extremum>,
    /// All peaks and troughs in turn, one each half cycle, as long as they stand out from the noise at every sensor.
    pub extrema: Vec<Extremum>,
    /// Logarithmic decrement of each cycle.
    pub damping_per_cycle: Vec<f64>,
}

/// A peak or a trough.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Extremum {
    /// Time, s on the recording's clock.
    pub time_s: f64,
    /// Head, m, lightly smoothed.
    pub head_m: f64,
    /// Whether it is a peak.
    pub peak: bool,
    /// Cycle from 1.
    pub cycle: usize,
}

impl Extremum {
    /// Its half cycle, from 0: peaks have even numbers.
    pub(crate) fn half_cycle(&self) -> usize {
        2 * (self.cycle - 1) + usize::from(!self.peak)
    }
}

/// The wave speed in four ways, m/s; of several pipes the mean (length by travel time).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WaveSpeeds {
    /// From the first rise and the velocity before the closure; needs a flow sensor and a closure faster than 2L/a.
    pub joukowsky: Option<Estimate>,
    /// From the times before and after the first peak.
    pub crossings: Option<Crossings>,
    /// From the front's arrival at two sensors.
    pub arrival: Option<Estimate>,
    /// From the period after the closure, 4L/T; of several pipes in series what [their
    /// joints](crate::rig::Rig::cycle_m) make of it. What lengthens the period (creep, gas, unsteady friction) lowers
    /// it.
    pub period: Option<Estimate>,
}

/// The wave speed from the times before and after the first peak, m/s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crossings {
    /// Best value, from matching the falling front with the rising one.
    pub value: f64,
    /// Its standard error.
    pub standard_error: f64,
    /// Lowest value that another level or window gives.
    pub low: f64,
    /// Highest value that another level or window gives.
    pub high: f64,
}

impl Features {
    /// What the record shows before the closure, s, where that is too little to call it steady; on a line of this
    /// length. A record too short for a period still has 4L/a.
    pub fn short_lead_s(&self, length_m: f64) -> Option<f64> {
        let of_speed = || self.wave_speed.best().map(|a| 4.0 * length_m / a.value);
        let period_s = self.period.map(|p| p.value).or_else(of_speed)?;
        let lead_s = self.closure.start_s - self.sensors.get(self.reference)?.begin_s;
        (lead_s < LEAST_LEAD * period_s).then_some(lead_s.max(0.0))
    }
}

/// Share of a period before the closure below which a record shows no steady flow.
const LEAST_LEAD: f64 = 0.1;

impl WaveSpeeds {
    /// The most reliable of them as a start value: crossings, else arrival, else the period, else Joukowsky.
    pub fn best(&self) -> Option<Estimate> {
        let crossings = self.crossings.map(|c| Estimate { value: c.value, standard_error: c.standard_error });
        crossings.or(self.arrival).or(self.period).or(self.joukowsky)
    }
}
