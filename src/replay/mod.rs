//! Results kept beside recordings, and whether they still hold: `surgescope replay`.
//!
//! Beside `NAME.mcap` stands `NAME.expected.toml`: for each quantity that `inspect` and `calibrate` give for it, a
//! value and how far it may move. A person can read and edit it.
//!
//! ```toml
//! effects = "viscoelastic-wall:3"   # what to calibrate with; without this line the recording is only inspected
//!
//! [inspect]
//! period_s = { value = 1.7557, tolerance = 0.0066 }
//!
//! [inspect.sensor.P1]
//! noise_m = { value = 0.0321, tolerance = 0.0016 }
//!
//! [calibrate]
//! rmse_m = { value = 0.0294, tolerance = 0.0006 }
//!
//! [calibrate.parameter]
//! wave_speed_m_s = { value = 342.5, tolerance = 0.5 }
//! ```
//!
//! | file | what it does |
//! | --- | --- |
//! | [`quantity`] | the tables of that file and the quantities in them |
//! | [`found`] | the quantities of a recording as they are now, with the tolerance that each deserves |
//! | [`expected`] | reads and writes the file |
//! | [`compare`] | what moved, and a table of it |

pub mod compare;
pub mod expected;
pub mod found;
pub mod quantity;
