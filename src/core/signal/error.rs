//! Why a recording has no features, in sentences.

/// Why a recording has no features.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SignalError {
    /// No pressure sensor recorded anything.
    #[error(
        "no pressure sensor recorded at least eight samples in a row (the rig has {sensors} pressure sensors); \
         check the sensors' names and wiring in the rig file"
    )]
    NoPressure {
        /// Pressure sensors of the rig.
        sensors: usize,
    },
    /// The head does not change.
    #[error(
        "no closure in this recording: over {duration_s:.3} s the head at {sensor} moves by {swing_m:.3} m, and no \
         front stands out; let the valve close while the recording runs, and check that the sensor's position in the rig file is right"
    )]
    NoClosure {
        /// The sensor nearest to the valve.
        sensor: String,
        /// Duration, s.
        duration_s: f64,
        /// Highest minus lowest head, m.
        swing_m: f64,
    },
    /// The record ends before the wave comes back.
    #[error(
        "the recording is too short: the head at {sensor} rises but does not fall back in the {left_s:.3} s that are left; \
         record at least two periods (8L/a) after the closure"
    )]
    TooShort {
        /// The sensor nearest to the valve.
        sensor: String,
        /// Time from the rise to the end, s.
        left_s: f64,
    },
}
