//! Velocity profiles and wall shear as a table and as a picture.

use std::io::Write;

use crate::report::svg::{LineChart, Series, Style};
use crate::report::text::number::{rounded, significant};
use crate::simulate::profiles::{Moment, Profiles};

/// Number of profiles in a picture.
const DRAWN: usize = 5;

/// First line of the table.
pub fn header(radius_m: &[f64]) -> String {
    let rings = radius_m.iter().map(|r| format!(",v_m_s[r={}mm]", significant(1e3 * r, 5)));
    format!("{HEADING}{}", rings.collect::<String>())
}

/// How it begins.
pub const HEADING: &str = "time_s,mean_velocity_m_s,wall_shear_Pa,steady_wall_shear_Pa";

/// Writes one row a time: mean velocity, wall shear, that of a steady flow of the same mean, and the velocity in each
/// ring from the axis to the wall.
///
/// # Errors
/// As `out`.
pub fn write_csv(profiles: &Profiles, mut out: impl Write) -> std::io::Result<()> {
    writeln!(out, "{}", header(&profiles.radius_m))?;
    for Moment { time_s, mean_m_s, shear_pa, steady_shear_pa, velocity_m_s } in &profiles.moments {
        let row = [*time_s, *mean_m_s, *shear_pa, *steady_shear_pa].into_iter().chain(velocity_m_s.iter().copied());
        writeln!(out, "{}", row.map(|v| rounded(v).to_string()).collect::<Vec<_>>().join(","))?;
    }
    out.flush()
}

/// The velocity over the radius at a few times, evenly among those at hand.
pub fn over_the_radius(profiles: &Profiles) -> LineChart {
    let count = profiles.moments.len();
    let every = count.div_ceil(DRAWN).max(1);
    let series = profiles.moments.iter().step_by(every).enumerate().map(|(n, moment)| Series {
        label: format!("{} s", significant(moment.time_s, 3)),
        // Up to the wall, where it is 0.
        points: (profiles.radius_m.iter().map(|r| 1e3 * r).zip(moment.velocity_m_s.iter().copied())).collect(),
        style: Style::line(n),
    });
    LineChart {
        title: format!("Velocity profiles at {} m", significant(profiles.position_m, 4)),
        x_label: "distance from the axis, mm".into(),
        y_label: "velocity, m/s".into(),
        series: series.collect(),
        ..LineChart::default()
    }
}

/// The wall shear in time beside that of a steady flow.
pub fn wall_shear(profiles: &Profiles) -> LineChart {
    let line = |n: usize, label: &str, of: fn(&Moment) -> f64| Series {
        label: label.into(),
        points: profiles.moments.iter().map(|m| (m.time_s, of(m))).collect(),
        style: Style::line(n),
    };
    LineChart {
        title: "Wall shear".into(),
        x_label: "time after the start of the closure, s".into(),
        y_label: "shear, Pa".into(),
        series: vec![
            line(0, "of the profile", |m| m.shear_pa),
            line(1, "of a steady flow of the same mean", |m| m.steady_shear_pa),
        ],
        ..LineChart::default()
    }
}

/// Both, one below the other.
pub fn picture(profiles: &Profiles) -> String {
    let (width, height) = (900.0, 400.0);
    let charts = [over_the_radius(profiles), wall_shear(profiles)].map(|chart| chart.to_svg(width, height));
    let placed = charts.iter().enumerate().map(|(n, chart)| {
        let place = format!("<svg y=\"{}\" width=\"{width}\" height=\"{height}\" ", n as f64 * height);
        chart.replacen("<svg ", &place, 1)
    });
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {}\">{}</svg>",
        2.0 * height,
        placed.collect::<String>()
    )
}
