//! Each run by itself, and how its values depend on temperature.

use crate::fit::numeric::quantiles::Z_95;
use crate::fit::outcome::fit::{Fit, FittedParameter};
use crate::fit::problem::parameters::placed_sensor;
use crate::fit::progress::Progress;
use crate::fit::search::calibrate::calibrate;
use crate::fit::search::options::Options;
use crate::model::effects::Chosen;
use crate::rig::{Pipe, Rig, WaterProperties};
use crate::temperature::compare::chance;
use crate::temperature::law::{Role, inverse_kelvin, modulus_name, roles};
use crate::temperature::member::{FamilyError, Member};
use crate::temperature::thresholds::OPEN_RELATIVE_ERROR;
use crate::temperature::trend::Line;

/// A quantity of the model that may depend on temperature: a shared parameter, or the modulus behind a wave speed.
#[derive(Debug, Clone)]
pub struct Quantity {
    /// Name with its unit.
    pub name: String,
    /// Unit as displayed.
    pub unit: &'static str,
    /// Its value in each run that determines it.
    pub points: Vec<Point>,
    /// The line through them.
    pub trend: Option<Trend>,
    /// Its values by the laws of the joint fit, over temperature; by run where a law is free.
    pub law: Vec<Banded>,
}

/// A value of one run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// The run's place in the family.
    pub run: usize,
    /// Temperature, °C.
    pub temperature_degc: f64,
    /// Value.
    pub value: f64,
    /// Standard error.
    pub standard_error: f64,
    /// 95% interval; that of the logarithm for a logarithmic variable.
    pub interval: (f64, f64),
}

/// A value at a temperature with its 95% interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Banded {
    /// Temperature, °C.
    pub temperature_degc: f64,
    /// Value.
    pub value: f64,
    /// 95% interval.
    pub interval: (f64, f64),
}

/// The form in which a quantity is a straight line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// The value over the temperature; the slope in its unit per kelvin.
    Plain,
    /// Its logarithm over the temperature; the slope in 1/K.
    Exponential,
    /// Its logarithm over the inverse of the absolute temperature; the slope is an activation energy, J/mol.
    Arrhenius,
}

impl Form {
    /// In a word.
    pub fn name(self) -> &'static str {
        match self {
            Form::Plain => "linear",
            Form::Exponential => "exponential",
            Form::Arrhenius => "arrhenius",
        }
    }
}

/// How a quantity depends on temperature, from the separate fits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Trend {
    /// The form in which it is a line.
    pub form: Form,
    /// The line, from the reference temperature.
    pub line: Line,
    /// That temperature, °C.
    pub reference_degc: f64,
}

impl Trend {
    /// Through points whose temperatures are known to `temperature_sd_k`: by the line's slope that adds to the error of
    /// a value (effective variance, Orear 1982, Am. J. Phys. 50:912).
    fn of(form: Form, points: &[Point], reference_degc: f64, temperature_sd_k: f64) -> Option<Trend> {
        let place = |p: &Point| abscissa(form, reference_degc, p.temperature_degc);
        let x: Vec<f64> = points.iter().map(place).collect();
        let (y, sd): (Vec<f64>, Vec<f64>) = points
            .iter()
            .map(|p| match form {
                Form::Plain => (p.value, p.standard_error),
                _ => (p.value.ln(), p.standard_error / p.value),
            })
            .unzip();
        let mut line = Line::through(&x, &y, &sd)?;
        for _ in 0..3 {
            let effective: Vec<f64> = points
                .iter()
                .zip(x.iter().zip(&sd))
                .map(|(p, (x, sd))| {
                    let off = abscissa(form, reference_degc, p.temperature_degc + temperature_sd_k) - x;
                    sd.hypot(line.slope * off)
                })
                .collect();
            line = Line::through(&x, &y, &effective)?;
        }
        Some(Trend { form, line, reference_degc })
    }

    /// The quantity at a temperature.
    pub fn at(&self, temperature_degc: f64) -> Banded {
        let (mid, half) = self.line.at(abscissa(self.form, self.reference_degc, temperature_degc));
        let shown = |y: f64| if self.form == Form::Plain { y } else { y.exp() };
        Banded { temperature_degc, value: shown(mid), interval: (shown(mid - half), shown(mid + half)) }
    }
}

fn abscissa(form: Form, reference_degc: f64, degc: f64) -> f64 {
    match form {
        Form::Arrhenius => inverse_kelvin(reference_degc, degc),
        _ => degc - reference_degc,
    }
}

/// Fits each run by itself. Where the number of elements is open the first run's evidence decides it for all.
///
/// # Errors
/// As [`calibrate`].
pub(crate) fn apart(
    rig: &Rig,
    members: &[Member],
    effects: &[Chosen],
    options: &Options,
    progress: &(dyn Fn(&str, &Progress) + Sync),
) -> Result<Vec<Fit>, FamilyError> {
    let mut fits: Vec<Fit> = Vec::new();
    for member in members {
        let effects = fits.first().map_or(effects, |f| &f.effects[..]);
        let run = std::slice::from_ref(&member.data);
        fits.push(calibrate(rig, run, effects, options, &|p| progress(&member.data.file, p))?);
    }
    Ok(fits)
}

/// The quantities that may depend on temperature, from fits of one model.
///
/// # Errors
/// A wave speed that no wall allows.
pub(crate) fn quantities(
    rig: &Rig,
    members: &[Member],
    fits: &[Fit],
    (reference_degc, temperature_sd_k): (f64, f64),
    remarks: &mut Vec<String>,
) -> Result<Vec<Quantity>, FamilyError> {
    let Some(first) = fits.first() else { return Ok(Vec::new()) };
    let shared: Vec<&FittedParameter> =
        first.parameters.iter().filter(|p| p.run.is_none() && placed_sensor(&p.name).is_none()).collect();
    let names: Vec<&str> = shared.iter().map(|p| p.name.as_str()).collect();
    let mut found = Vec::new();
    for (j, role) in roles(rig.pipes.len(), &names).into_iter().enumerate() {
        let own = |r: usize| &fits[r].parameters[j];
        let mut points = Vec::new();
        for (r, member) in members.iter().enumerate() {
            let p = own(r);
            let relative = p.standard_error() / p.value.abs();
            if p.at_bound || p.held || relative.is_nan() || relative > OPEN_RELATIVE_ERROR {
                remarks.push(format!("{}: {} is not determined, so the line leaves it out", member.data.file, p.name));
                continue;
            }
            points.push(point(r, member.temperature_degc, p.value, relative, role != Role::Other));
        }
        let form = match role {
            Role::WaveSpeed(_) | Role::Other => Form::Plain,
            Role::Compliance => Form::Exponential,
            Role::Retardation => Form::Arrhenius,
        };
        let moduli = match role {
            Role::WaveSpeed(i) => Some(moduli(&rig.pipes[i], members, &points)?),
            _ => None,
        };
        let quantity = |name: String, unit, form, points: Vec<Point>| {
            let trend = Trend::of(form, &points, reference_degc, temperature_sd_k);
            Quantity { name, unit, points, trend, law: Vec::new() }
        };
        found.push(quantity(shared[j].name.clone(), shared[j].unit, form, points));
        if let Some(moduli) = moduli {
            found.push(quantity(modulus_name(&shared[j].name), "GPa", Form::Exponential, moduli));
        }
    }
    for q in &found {
        if let Some(Trend { line, .. }) = q.trend.filter(|t| t.line.is_contradicted()) {
            remarks.push(format!(
                "{}: the runs scatter about its line by more than their errors (chance {}); its interval is that of the scatter",
                q.name,
                chance(line.chance.unwrap_or(f64::NAN))
            ));
        }
    }
    Ok(found)
}

fn point(run: usize, temperature_degc: f64, value: f64, relative: f64, log: bool) -> Point {
    let half = Z_95 * relative;
    let interval = if log {
        (value * (-half).exp(), value * half.exp())
    } else {
        (value - half * value.abs(), value + half * value.abs())
    };
    Point { run, temperature_degc, value, standard_error: relative * value.abs(), interval }
}

/// The moduli behind wave speeds, GPa.
fn moduli(pipe: &Pipe, members: &[Member], speeds: &[Point]) -> Result<Vec<Point>, FamilyError> {
    let of = |p: &Point| {
        let member = &members[p.run];
        let (modulus_gpa, stretch) = modulus(pipe, &member.data.conditions.water, p.value)
            .ok_or(FamilyError::NoWall { file: member.data.file.clone(), wave_speed_m_s: p.value })?;
        Ok(point(p.run, p.temperature_degc, modulus_gpa, stretch * p.standard_error / p.value, true))
    };
    speeds.iter().map(of).collect()
}

/// Young's modulus behind a wave speed, GPa, and how its logarithm depends on that of the wave speed: `2/(1 - (a/c)²)`
/// by Korteweg's law.
fn modulus(pipe: &Pipe, water: &WaterProperties, wave_speed_m_s: f64) -> Option<(f64, f64)> {
    let modulus_pa = pipe.youngs_modulus_for_wave_speed(water, wave_speed_m_s)?;
    Some((modulus_pa * 1e-9, 2.0 / (1.0 - (wave_speed_m_s / water.sound_speed_m_s()).powi(2))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_trend_gives_back_the_energy_and_the_rate_that_made_its_points() {
        let at = [20.0, 30.0, 45.0];
        let tau = at.map(|t| (t, 0.05 * (60e3 * inverse_kelvin(20.0, t)).exp()));
        let points: Vec<Point> = tau.iter().enumerate().map(|(r, (t, v))| point(r, *t, *v, 0.01, true)).collect();
        let trend = Trend::of(Form::Arrhenius, &points, 20.0, 0.0).unwrap();
        assert!((trend.line.slope / 60e3 - 1.0).abs() < 1e-9 && (trend.at(20.0).value / 0.05 - 1.0).abs() < 1e-9);
        let (low, high) = trend.at(33.0).interval;
        assert!(low < trend.at(33.0).value && trend.at(33.0).value < high && high / low < 1.05);
        let falling: Vec<Point> =
            at.iter().enumerate().map(|(r, t)| point(r, *t, 2.0 * (-0.015 * t).exp(), 0.01, true)).collect();
        assert!((Trend::of(Form::Exponential, &falling, 20.0, 0.0).unwrap().line.slope + 0.015).abs() < 1e-12);
        // A thermometer of 1 K is worth 1.5% of each value here, beside its own 1%.
        let doubtful = Trend::of(Form::Exponential, &falling, 20.0, 1.0).unwrap().line;
        let sure = Trend::of(Form::Exponential, &falling, 20.0, 0.0).unwrap().line;
        assert!((doubtful.slope_error / sure.slope_error - 0.015f64.hypot(0.01) / 0.01).abs() < 1e-6);
    }
}
