//! Units at the edges: every value inside the program is SI, every value a user sees is in the unit of its sensor.

pub mod written;

use std::fmt;
use std::str::FromStr;

/// Acceleration of free fall used throughout, m/s² (the value of the reference solutions).
pub const GRAVITY_M_S2: f64 = 9.81;

/// What a unit measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Gauge pressure; SI unit Pa.
    Pressure,
    /// Volume flow; SI unit m³/s.
    Flow,
    /// Temperature; kept in °C, the scale of every property correlation used.
    Temperature,
    /// A pure number (valve position, trigger).
    Ratio,
}

/// A display unit as written in a rig file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unit {
    /// The spelling of the rig file, e.g. `kPa`.
    pub symbol: &'static str,
    /// What it measures.
    pub quantity: Quantity,
    /// SI value = `factor` × displayed value + `offset`; NaN marks a metre of water, whose factor is ρg of the rig's
    /// water.
    factor: f64,
    offset: f64,
}

const fn unit(symbol: &'static str, quantity: Quantity, factor: f64, offset: f64) -> Unit {
    Unit { symbol, quantity, factor, offset }
}

/// Every unit a rig file may name.
pub const UNITS: [Unit; 31] = [
    unit("Pa", Quantity::Pressure, 1.0, 0.0),
    unit("kPa", Quantity::Pressure, 1e3, 0.0),
    unit("MPa", Quantity::Pressure, 1e6, 0.0),
    unit("bar", Quantity::Pressure, 1e5, 0.0),
    unit("psi", Quantity::Pressure, 6_894.757_293_168, 0.0),
    unit("m(H2O)", Quantity::Pressure, f64::NAN, 0.0),
    unit("mbar", Quantity::Pressure, 100.0, 0.0),
    unit("hPa", Quantity::Pressure, 100.0, 0.0),
    unit("atm", Quantity::Pressure, 101_325.0, 0.0),
    unit("ksi", Quantity::Pressure, 6_894_757.293_168, 0.0),
    unit("dbar", Quantity::Pressure, 1e4, 0.0),
    unit("kgf/cm2", Quantity::Pressure, 98_066.5, 0.0),
    // Conventional columns: water of 1000 kg/m3 and mercury of 13595.1 kg/m3 under 9.80665 m/s2 (NIST SP 811).
    unit("cmH2O", Quantity::Pressure, 98.0665, 0.0),
    unit("mmH2O", Quantity::Pressure, 9.80665, 0.0),
    unit("inH2O", Quantity::Pressure, 249.088_91, 0.0),
    unit("ftH2O", Quantity::Pressure, 12.0 * 249.088_91, 0.0),
    unit("mmHg", Quantity::Pressure, 133.322_387_415, 0.0),
    unit("inHg", Quantity::Pressure, 25.4 * 133.322_387_415, 0.0),
    unit("m3/s", Quantity::Flow, 1.0, 0.0),
    unit("m3/h", Quantity::Flow, 1.0 / 3600.0, 0.0),
    unit("L/s", Quantity::Flow, 1e-3, 0.0),
    unit("L/min", Quantity::Flow, 1e-3 / 60.0, 0.0),
    unit("L/h", Quantity::Flow, 1e-3 / 3600.0, 0.0),
    unit("mL/s", Quantity::Flow, 1e-6, 0.0),
    unit("mL/min", Quantity::Flow, 1e-6 / 60.0, 0.0),
    // The gallon of the United States.
    unit("gpm", Quantity::Flow, 3.785_411_784e-3 / 60.0, 0.0),
    unit("degC", Quantity::Temperature, 1.0, 0.0),
    unit("K", Quantity::Temperature, 1.0, -273.15),
    unit("degF", Quantity::Temperature, 5.0 / 9.0, -160.0 / 9.0),
    unit("1", Quantity::Ratio, 1.0, 0.0),
    unit("%", Quantity::Ratio, 0.01, 0.0),
];

impl Unit {
    /// What most gauges of a laboratory show.
    pub const BAR: Unit = unit("bar", Quantity::Pressure, 1e5, 0.0);

    /// A pure number.
    pub const ONE: Unit = unit("1", Quantity::Ratio, 1.0, 0.0);

    /// The SI value (Pa, m³/s, °C or 1) of a displayed one; `density_kg_m3` is that of the rig's water, which
    /// `m(H2O)` is a column of.
    pub fn to_si(self, displayed: f64, density_kg_m3: f64) -> f64 {
        displayed * self.scale(density_kg_m3) + self.offset
    }

    /// The displayed value of an SI one; the inverse of [`Unit::to_si`].
    pub fn from_si(self, si: f64, density_kg_m3: f64) -> f64 {
        (si - self.offset) / self.scale(density_kg_m3)
    }

    fn scale(self, density_kg_m3: f64) -> f64 {
        if self.factor.is_nan() { density_kg_m3 * GRAVITY_M_S2 } else { self.factor }
    }
}

impl FromStr for Unit {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        UNITS.iter().copied().find(|u| u.symbol == text).ok_or_else(|| {
            let known: Vec<_> = UNITS.iter().map(|u| u.symbol).collect();
            format!("unknown unit '{text}'; known are {}", known.join(", "))
        })
    }
}

impl fmt::Display for Unit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.symbol)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_unit_goes_to_si_and_back() {
        for unit in UNITS {
            let back = unit.from_si(unit.to_si(12.5, 998.2), 998.2);
            assert!((back - 12.5).abs() < 1e-12, "{unit}: {back}");
        }
    }

    #[test]
    fn published_conversions() {
        let si = |text: &str, v: f64| text.parse::<Unit>().unwrap().to_si(v, 1000.0);
        assert_eq!(si("bar", 1.0), 1e5);
        assert!((si("psi", 14.503_773_773) - 1e5).abs() < 1e-3);
        assert_eq!(si("m(H2O)", 10.0), 98_100.0);
        assert!((si("m3/h", 3.6) - 1e-3).abs() < 1e-18);
        assert!((si("L/min", 60.0) - 1e-3).abs() < 1e-18);
        assert_eq!(si("K", 293.15), 20.0);
        assert!((si("degF", 68.0) - 20.0).abs() < 1e-12);
        assert!((si("gpm", 1.0) - 6.309_019_64e-5).abs() < 1e-13);
        assert!((si("mmHg", 760.0) - si("atm", 1.0)).abs() < 0.1);
        assert!((si("cmH2O", 10.0) - si("mmH2O", 100.0)).abs() < 1e-9);
        assert!((si("inH2O", 1.0) - 25.4 * si("mmH2O", 1.0)).abs() < 1e-4);
        assert_eq!(si("ksi", 1.0), 1e3 * si("psi", 1.0));
    }
}
