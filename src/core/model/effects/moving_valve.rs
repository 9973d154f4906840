//! The valve, and with it the pipe's end, on elastic supports: rising pressure pushes it outward, and the pipe takes in
//! water.

use crate::model::effect::{Attachment, Effect, Element, Place, check};
use crate::model::error::ModelError;
use crate::model::node::Shunt;
use crate::model::oscillator::Oscillator;
use crate::model::parameter::Parameter;
use crate::model::scene::{Scene, Site};
use crate::units::GRAVITY_M_S2;

/// See the module.
///
/// `u` is the outward travel of the end since the closure, driven by the head's deviation `h`. The parameters are the
/// static travel per head, `C = A ρ g/k`, which gives the stiffness, and the natural frequency without water, which
/// gives the mass.
pub struct MovingValve;

impl Effect for MovingValve {
    fn name(&self) -> &'static str {
        "moving-valve"
    }
    fn summary(&self) -> &'static str {
        "the valve, or the pipe's end, moves on its supports"
    }
    fn equation(&self) -> &'static str {
        "u'' + 2ζω u' + ω² u = ω² C h,  ω = 2πf, C = A ρ g/k;  Q_pipe = Q_valve + A u'"
    }
    fn source(&self) -> &'static str {
        "m u'' + c u' + k u = A ρ g h: Wiggert & Tijsseling (2001), Appl. Mech. Rev. 54(5):455-481, junction coupling; exact for a head \
         linear over each step"
    }
    fn trace(&self) -> &'static str {
        "a ripple of one frequency on plateaus, at all sensors; a later, rounded first rise"
    }

    /// Travel that takes in as much water as a hundredth of the pipe, one oscillation in a quarter of the period.
    fn parameters(&self, site: &Site, _elements: usize) -> Vec<Parameter> {
        let pipe = site.rig.pipe_at_valve();
        let wave_speed = pipe.wave_speed_start(site.water).0;
        let whole_mm_per_m = 1e3 * GRAVITY_M_S2 * site.rig.length_m() / wave_speed.powi(2);
        vec![
            Parameter::log(
                "valve_frequency_Hz",
                "Hz",
                "natural frequency of the valve on its supports",
                4.0 / site.period_s,
                (0.2 / site.period_s).min(1.0),
                (400.0 / site.period_s).max(500.0),
            ),
            Parameter::log(
                "valve_compliance_mm_per_m",
                "mm/m",
                "how far a steady head moves the valve",
                1e-2 * whole_mm_per_m,
                1e-6 * whole_mm_per_m,
                3.0 * whole_mm_per_m,
            )
            .vanishing_at(0.0),
            Parameter::log("valve_damping_ratio", "1", "damping of that swing; 1 is critical", 0.05, 1e-3, 2.0),
        ]
    }

    /// Slower and faster oscillations, because a fit finds no path between them.
    fn other_starts(&self, _elements: usize) -> Vec<Vec<f64>> {
        [0.4, 2.5, 6.0].iter().map(|&by| vec![by, 1.0, 1.0]).collect()
    }

    fn attachments<'a>(&self, values: &'a [f64], scene: &'a Scene) -> Result<Vec<Attachment<'a>>, ModelError> {
        let (frequency_hz, compliance, damping) = (values[0], values[1], values[2]);
        check("valve_frequency_Hz", frequency_hz, frequency_hz > 0.0, "more than zero")?;
        check("valve_compliance_mm_per_m", compliance, compliance >= 0.0, "zero or more")?;
        check("valve_damping_ratio", damping, damping > 0.0, "more than zero")?;
        let swing = Oscillator::new(std::f64::consts::TAU * frequency_hz, damping, scene.dt_s, 0.0);
        Ok(vec![Attachment {
            place: Place::Valve,
            make: Box::new(move |spot| {
                let volume_m2 = spot.area_m2 * compliance * 1e-3;
                Element::Shunt(Box::new(MovingEnd { swing, volume_m2, steady_m: 0.0, before_m: 0.0 }))
            }),
        }])
    }
}

/// The moving end as a shunt: its oscillator moves in units of the head, `u/C`.
struct MovingEnd {
    swing: Oscillator,
    /// Water taken in per head, `A C`, m².
    volume_m2: f64,
    steady_m: f64,
    /// Deviation of the head one step ago, m.
    before_m: f64,
}

impl Shunt for MovingEnd {
    fn settle(&mut self, head_m: f64) -> f64 {
        (self.steady_m, self.before_m) = (head_m, 0.0);
        0.0
    }
    fn outflow(&self, head_m: f64) -> (f64, f64) {
        let (rate, slope) = self.swing.next_rate(self.before_m, head_m - self.steady_m);
        (self.volume_m2 * rate, self.volume_m2 * slope)
    }
    fn advance(&mut self, head_m: f64) {
        self.swing.advance(self.before_m, head_m - self.steady_m);
        self.before_m = head_m - self.steady_m;
    }
}
