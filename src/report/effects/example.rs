//! What an effect does to the record of one sensor, shown on a rig of the project.

use crate::extent::ends;
use crate::model::effects::{Chosen, Site};
use crate::model::parameter::Parameter;
use crate::model::trace::Trace;
use crate::report::svg::{LineChart, Series, Style};
use crate::report::text::number::significant;
use crate::report::text::plot::{MARKS, plot};
use crate::rig::Rig;
use crate::simulate::scenario::{Scenario, ValveForm};

/// The rig on which an effect shows its parameters and what it does.
const RIG: &str = include_str!("../../../rigs/demo-hdpe.toml");
/// Periods shown.
pub const PERIODS: f64 = 5.0;
/// Head before the valve at which the water of that rig boils when it closes, m: some effects only show there.
const LOW_HEAD_M: f64 = 1.0;
/// Differences below this part of the record's range are hard to see.
const UNSEEN: f64 = 1.6e-2;

/// That rig.
///
/// # Errors
/// None: it ships with the project.
pub fn demo_rig() -> Result<Rig, crate::rig::RigError> {
    Rig::from_toml(RIG, "rigs/demo-hdpe.toml")
}

/// What an effect does to the record of one sensor.
pub struct Example {
    label: String,
    /// Parameters of the effect, as a fit starts with them.
    pub parameters: Vec<Parameter>,
    values: String,
    /// The model with the effect, with its rig.
    pub scenario: Scenario,
    /// The sensor shown.
    pub sensor: String,
    base: Trace,
    with: Trace,
    duration_s: f64,
}

impl Example {
    /// At the usual head with the values where a fit starts; twice as strong, or at a low head, where the effect hardly
    /// shows.
    ///
    /// # Errors
    /// An effect that cannot be simulated on the example rig.
    pub fn of(chosen: &Chosen) -> Result<Example, Box<dyn std::error::Error + Send + Sync>> {
        Example::on(&demo_rig()?, chosen)
    }

    /// The same on another rig.
    ///
    /// # Errors
    /// An effect that cannot be simulated on it.
    pub fn on(rig: &Rig, chosen: &Chosen) -> Result<Example, Box<dyn std::error::Error + Send + Sync>> {
        let usual = Example::under(rig, chosen, &[])?;
        if usual.shows() {
            return Ok(usual);
        }
        let twice = |p: &Parameter| p.vanishes_at.map(|none| (p.name.clone(), none + 2.0 * (p.start - none)));
        let strong: Vec<_> = usual.parameters.iter().filter_map(twice).collect();
        for settings in [strong, vec![("valve_head_m".into(), LOW_HEAD_M)]] {
            let other = Example::under(rig, chosen, &settings)?;
            if other.shows() {
                return Ok(other);
            }
        }
        Ok(usual)
    }

    fn under(
        rig: &Rig,
        chosen: &Chosen,
        settings: &[(String, f64)],
    ) -> Result<Example, Box<dyn std::error::Error + Send + Sync>> {
        let scenario = Scenario::new(rig.clone(), std::slice::from_ref(chosen), ValveForm::Linear, settings)?;
        let site = Site {
            rig: &scenario.rig,
            water: &scenario.water,
            period_s: scenario.period_s(),
            line: scenario.rig.graph.line_to_valve(),
        };
        let elements = scenario.effects.first().and_then(|c| c.elements).unwrap_or(1);
        let parameters = chosen.effect.parameters(&site, elements);
        let of_test: Vec<_> =
            settings.iter().filter(|(name, _)| parameters.iter().all(|p| p.name != *name)).cloned().collect();
        let base = Scenario::new(rig.clone(), &[], ValveForm::Linear, &of_test)?;
        let duration_s = PERIODS * base.period_s();
        let names: Vec<String> = scenario.rig.pressure_sensors().map(|(_, s)| s.name.clone()).collect();
        let at = names.iter().position(|n| chosen.sensor.as_ref() == Some(n)).unwrap_or(0);
        let shown = |s: &Scenario| s.simulate(duration_s).map(|traces| traces.into_iter().nth(at));
        let (Some(base), Some(with)) = (shown(&base)?, shown(&scenario)?) else {
            return Err("the example rig has no pressure sensor".into());
        };
        let value = |p: &Parameter| settings.iter().find(|s| s.0 == p.name).map_or(p.start, |s| s.1);
        let values: Vec<String> =
            parameters.iter().map(|p| format!("{} = {}", p.name, significant(value(p), 3))).collect();
        let sensor = names.into_iter().nth(at).unwrap_or_default();
        Ok(Example {
            label: chosen.label(),
            parameters,
            values: values.join(", "),
            scenario,
            sensor,
            base,
            with,
            duration_s,
        })
    }

    /// Both traces at even times: time (s), base model and model with the effect (m).
    pub fn points(&self) -> impl Iterator<Item = (f64, f64, f64)> {
        const POINTS: usize = 1000;
        (0..=POINTS).map(|i| {
            let t = self.duration_s * i as f64 / POINTS as f64;
            (t, self.base.at(t), self.with.at(t))
        })
    }

    /// Largest difference between both traces, m.
    pub fn largest_difference_m(&self) -> f64 {
        self.points().map(|(_, base, with)| (with - base).abs()).fold(0.0, f64::max)
    }

    /// Range of the base model's trace, m.
    fn range_m(&self) -> f64 {
        let (low, high) = ends(self.points().map(|p| p.1));
        high - low
    }

    /// Whether the difference can be seen.
    pub fn shows(&self) -> bool {
        self.largest_difference_m() > UNSEEN * self.range_m()
    }

    /// Both traces as a chart.
    pub fn chart(&self) -> LineChart {
        let series = |n: usize, label: &str, of: fn((f64, f64, f64)) -> f64| Series {
            label: label.into(),
            points: self.points().map(|p| (p.0, of(p))).collect(),
            style: Style::line(n),
        };
        LineChart {
            title: format!("{}: {}", self.label, self.values),
            x_label: "time after the start of the closure, s".into(),
            y_label: format!("head at {}, m", self.sensor),
            series: vec![series(0, "base model", |p| p.1), series(1, &format!("with {}", self.label), |p| p.2)],
            ..LineChart::default()
        }
    }
}

impl std::fmt::Display for Example {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let run = self.scenario.run;
        writeln!(
            f,
            "Head at {} of that rig, m, at {} m/s and {} m upstream of the valve. {} base model, {} with {}:",
            self.sensor,
            significant(run.initial_velocity_m_s, 2),
            significant(run.valve_head_m, 3),
            MARKS[0],
            MARKS[1],
            self.values
        )?;
        f.write_str(&plot([&|t| self.base.at(t), &|t| self.with.at(t)], self.duration_s, "s"))?;
        let difference = self.largest_difference_m();
        if self.shows() {
            writeln!(f, "They differ by up to {} m.", significant(difference, 2))
        } else {
            writeln!(f, "They hardly differ ({} m): this rig does not show the effect.", significant(difference, 1))
        }
    }
}
