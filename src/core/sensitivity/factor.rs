//! A parameter and the range over which it varies.

use serde::Serialize;

use crate::model::parameter::{Parameter, Scale};
use crate::sensitivity::SensitivityError;

/// A parameter of the model under study.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Factor {
    /// Its name, with the unit.
    pub name: String,
    /// The unit.
    pub unit: &'static str,
    /// Its value while it does not vary.
    pub value: f64,
    /// Lower end of the range.
    pub lower: f64,
    /// Upper end of the range.
    pub upper: f64,
    /// Whether it varies evenly in ratio rather than in difference.
    pub even_in_ratio: bool,
    /// Its index among the model's values: shared ones first, then the run's.
    #[serde(skip)]
    pub slot: usize,
}

impl Factor {
    /// The value at a place in the range, from 0 to 1.
    pub fn at(&self, place: f64) -> f64 {
        if self.even_in_ratio {
            self.lower * (self.upper / self.lower).powf(place)
        } else {
            self.lower + place * (self.upper - self.lower)
        }
    }

    /// `count` values over the range, ends included; the middle if `count` is one.
    pub fn levels(&self, count: usize) -> Vec<f64> {
        if count == 1 {
            return vec![self.at(0.5)];
        }
        (0..count).map(|i| self.at(i as f64 / (count - 1) as f64)).collect()
    }
}

/// A range that the user gave.
#[derive(Debug, Clone, PartialEq)]
pub struct Range {
    /// Name of the parameter.
    pub name: String,
    /// Least value.
    pub low: f64,
    /// Greatest value.
    pub high: f64,
}

/// How far parameters vary if no range is given.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Reach {
    /// Over their bounds in the catalogue. A run's own parameters (velocity, head, closing time, friction) have only
    /// formal bounds, so they vary by ±[`RUN_SHARE`] of their values.
    Bounds,
    /// From the value divided by this factor to the value times it, within the bounds; over the bounds if the value is
    /// not above 0.
    Factor(f64),
    /// By plus and minus this share of their values, regardless of bounds: uncertainty of a set value; by bounds as
    /// above if the value is not above 0.
    Share(f64),
}

/// Default share of a run's own values: what is measured before each closure is known at least as well.
pub const RUN_SHARE: f64 = 0.2;

impl Reach {
    fn of(self, parameter: &Parameter, value: f64, of_run: bool) -> (f64, f64) {
        let (low, high) = match self {
            Reach::Bounds if of_run => (value * (1.0 - RUN_SHARE), value * (1.0 + RUN_SHARE)),
            Reach::Bounds => (parameter.lower, parameter.upper),
            Reach::Factor(factor) => (value / factor, value * factor),
            Reach::Share(share) if value > 0.0 => return (value * (1.0 - share), value * (1.0 + share)),
            Reach::Share(_) => (parameter.lower, parameter.upper),
        };
        if value > 0.0 {
            (low.max(parameter.lower), high.min(parameter.upper))
        } else {
            (parameter.lower, parameter.upper)
        }
    }
}

/// The parameters with their ranges. `own` is how many of the last parameters belong to the run.
///
/// # Errors
/// A range for a parameter that does not exist, that runs backwards or beyond the parameter's bounds; a value with no
/// range around it.
pub fn factors(
    parameters: &[Parameter],
    values: &[f64],
    own: usize,
    reach: Reach,
    ranges: &[Range],
) -> Result<Vec<Factor>, SensitivityError> {
    for (i, range) in ranges.iter().enumerate() {
        known(&range.name, parameters)?;
        if ranges[..i].iter().any(|r| r.name == range.name) {
            return Err(SensitivityError::RangeTwice { name: range.name.clone() });
        }
    }
    let of_run = parameters.len() - own;
    let factor = |(slot, (p, &value)): (usize, (&Parameter, &f64))| {
        let given = ranges.iter().find(|r| r.name == p.name);
        let (lower, upper) = match given {
            Some(range) => checked(range, p)?,
            None => reach.of(p, value, slot >= of_run),
        };
        if lower >= upper {
            return Err(SensitivityError::NoRange {
                name: p.name.clone(),
                value,
                lower: p.lower,
                upper: p.upper,
                unit: p.unit,
            });
        }
        let even_in_ratio = p.scale == Scale::Log && lower > 0.0;
        Ok(Factor { name: p.name.clone(), unit: p.unit, value, lower, upper, even_in_ratio, slot })
    };
    parameters.iter().zip(values).enumerate().map(factor).collect()
}

fn checked(range: &Range, p: &Parameter) -> Result<(f64, f64), SensitivityError> {
    let Range { ref name, low, high } = *range;
    // The comparison also refuses NaN.
    if low >= high || low.is_nan() || high.is_nan() {
        return Err(SensitivityError::Order { name: name.clone(), low, high });
    }
    if low < p.lower || high > p.upper {
        let (lower, upper) = (p.lower, p.upper);
        return Err(SensitivityError::Beyond { name: name.clone(), low, high, lower, upper, unit: p.unit });
    }
    Ok((low, high))
}

/// The index of a parameter by its name.
///
/// # Errors
/// If there is none; the nearest is named.
pub fn known(name: &str, parameters: &[Parameter]) -> Result<usize, SensitivityError> {
    if let Some(at) = parameters.iter().position(|p| p.name == name) {
        return Ok(at);
    }
    let likeness = |p: &&Parameter| strsim::jaro_winkler(name, &p.name);
    let nearest = parameters.iter().max_by(|a, b| likeness(a).total_cmp(&likeness(b)));
    Err(SensitivityError::UnknownParameter {
        name: name.to_owned(),
        nearest: nearest.map_or(String::new(), |p| p.name.clone()),
        known: parameters.iter().map(|p| p.name.as_str()).collect::<Vec<_>>().join(", "),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parameters() -> Vec<Parameter> {
        vec![
            Parameter::log("tau1_s", "s", "", 0.1, 1e-3, 10.0),
            Parameter::linear("offset_m", "m", "", 0.0, -2.0, 2.0),
            Parameter::log("initial_velocity_m_s", "m/s", "", 1.0, 1e-4, 50.0),
        ]
    }

    fn range(name: &str, low: f64, high: f64) -> Range {
        Range { name: name.into(), low, high }
    }

    #[test]
    fn bounds_are_narrowed_by_a_factor_or_a_range() {
        let values = [0.1, 0.0, 1.0];
        let all = factors(&parameters(), &values, 1, Reach::Bounds, &[range("offset_m", -1.0, 0.5)]).unwrap();
        let ends: Vec<(f64, f64)> = all.iter().map(|f| (f.lower, f.upper)).collect();
        assert_eq!(ends, [(1e-3, 10.0), (-1.0, 0.5), (0.8, 1.2)]);
        assert!((all[0].at(0.5) - 0.1).abs() < 1e-12 && (all[1].at(0.5) + 0.25).abs() < 1e-12);
        assert_eq!(all[1].levels(4), [-1.0, -0.5, 0.0, 0.5]);
        let near = factors(&parameters(), &[0.1, 0.0, 40.0], 1, Reach::Factor(2.0), &[]).unwrap();
        let ends: Vec<(f64, f64)> = near.iter().map(|f| (f.lower, f.upper)).collect();
        assert_eq!(ends, [(0.05, 0.2), (-2.0, 2.0), (20.0, 50.0)]);
    }

    #[test]
    fn slips_are_explained() {
        let said = |values: &[f64], ranges: &[Range]| {
            factors(&parameters(), values, 1, Reach::Factor(1.5), ranges).unwrap_err().to_string()
        };
        let usual = [0.1, 0.0, 1.0];
        assert!(said(&usual, &[range("tau_1", 0.1, 0.2)]).contains("did you mean 'tau1_s'"));
        assert!(said(&usual, &[range("tau1_s", 0.2, 0.1)]).contains("less than the second"));
        assert!(said(&usual, &[range("tau1_s", 0.1, f64::NAN)]).contains("is not a range"));
        assert!(said(&usual, &[range("tau1_s", 1e-4, 0.1)]).contains("reaches beyond"));
        assert!(said(&usual, &[range("tau1_s", 0.1, 0.2), range("tau1_s", 0.1, 0.2)]).contains("twice"));
        assert!(said(&[100.0, 0.0, 1.0], &[]).contains("option `range tau1_s=LOW:HIGH`"));
    }
}
