//! The joint posterior of a fit: what to say of it, and its draws, two parameters at a time.

use std::fmt::Write;

use crate::fit::outcome::fit::{Fit, FittedParameter};
use crate::fit::outcome::posterior::Posterior;
use crate::model::parameter::Scale as Moved;
use crate::report::svg::Scale;
use crate::report::text::escape::escape;
use crate::report::text::number::{fixed, significant};

/// Most parameters of a chart. With more, those whose intervals are in doubt go first, then those that all runs share.
const MOST: usize = 7;
/// Most draws of a panel.
const POINTS: usize = 400;
/// Side of a panel, its distance to the next, and the room left of and below all, px.
const PANEL: f64 = 118.0;
const GAP: f64 = 8.0;
const ROOM: f64 = 58.0;
/// Bars of a distribution.
const BARS: usize = 24;

/// Which intervals of a fit are in doubt and why, and how its posterior was sampled; empty where there is nothing to
/// say.
pub fn text(fit: &Fit) -> String {
    let mut out = String::new();
    if let Some(sampled) = &fit.posterior {
        let _ = writeln!(out, "posterior: {}", how(sampled));
        return out;
    }
    let doubtful: Vec<String> = fit.parameters.iter().filter_map(in_doubt).collect();
    if !doubtful.is_empty() {
        let _ = writeln!(
            out,
            "Intervals in doubt, for errors there are not normal: {}. Option `posterior` samples them.",
            doubtful.join(", ")
        );
    }
    out
}

fn in_doubt(p: &FittedParameter) -> Option<String> {
    use crate::fit::outcome::doubt::Doubt;
    let why = match p.doubt.filter(|_| p.profile.is_none())? {
        Doubt::Bound => "a bound within",
        Doubt::Curved => "curved",
        Doubt::Open => "open",
    };
    let run = p.run.as_ref().map_or(String::new(), |run| format!(" of {run}"));
    Some(format!("{}{run} ({why})", p.name))
}

/// How a posterior was sampled, in words.
fn how(sampled: &Posterior) -> String {
    format!(
        "{} draws of {} chains, worth {} independent ones or more (R̂ {} or less); {} of the moves were made",
        sampled.chains * sampled.sweeps,
        sampled.chains,
        fixed(sampled.effective_draws, 0),
        fixed(sampled.r_hat, 3),
        format_args!("{}%", fixed(100.0 * sampled.acceptance, 0)),
    )
}

/// What speaks against the posterior of a fit that was to be sampled: that its chains have not met, or that there is
/// none.
pub fn reservation(fit: &Fit) -> Option<String> {
    match &fit.posterior {
        Some(sampled) => (!sampled.converged).then(|| not_converged(sampled)),
        None => Some("the fit has no posterior: its noise or its slopes are not finite".to_owned()),
    }
}

/// Why a posterior does not stand for the intervals, and what to do.
fn not_converged(sampled: &Posterior) -> String {
    format!(
        "the posterior has not converged, so the intervals are not from it: its draws are worth {} independent ones where {} were asked for, and R̂ is {}; \
         hold what is known, ask for more draws, or look at the chart of the report for two basins",
        fixed(sampled.effective_draws, 0),
        sampled.wanted,
        fixed(sampled.r_hat, 3)
    )
}

/// The draws of a posterior as a picture, and what to say of them.
pub(crate) struct Chart {
    /// How it was sampled, in words.
    pub(crate) how: String,
    /// What speaks against it.
    pub(crate) reservation: Option<String>,
    /// SVG without any style of its own, which the workbench's page would refuse.
    pub(crate) picture: String,
    width: f64,
}

/// None where nothing was sampled.
pub(crate) fn chart(fit: &Fit) -> Option<Chart> {
    let sampled = fit.posterior.as_ref()?;
    let shown = shown(fit, sampled);
    if shown.is_empty() || sampled.draws.is_empty() {
        return None;
    }
    Some(Chart {
        how: capitalised(&how(sampled)),
        reservation: reservation(fit),
        picture: corner(fit, sampled, &shown),
        width: ROOM + side(shown.len()),
    })
}

/// The chart with its heading; nothing where nothing was sampled.
pub(crate) fn section(fit: &Fit) -> String {
    let Some(Chart { how, reservation, picture, width }) = chart(fit) else { return String::new() };
    let caution = reservation.map_or_else(String::new, |reservation| {
        format!("<p class=\"note\"><strong>Warning:</strong> {}.</p>\n", escape(&reservation))
    });
    format!(
        "<h3>Joint posterior</h3>\n{caution}<p class=\"note\">{}. Each dot is a draw: a set of values that the recordings and what was known before allow. Dots along a line or a bow are values that trade with each other. On the diagonal, how often each value was drawn, with the fit's value as a line.</p>\n<figure class=\"corner\" style=\"max-width:{width}px\">{picture}</figure>\n",
        escape(&how)
    )
}

/// Panels in a row, px.
fn side(panels: usize) -> f64 {
    panels as f64 * (PANEL + GAP)
}

fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or(String::new(), |first| first.to_uppercase().chain(letters).collect())
}

/// Positions among the sampled parameters of those that the chart shows.
fn shown(fit: &Fit, sampled: &Posterior) -> Vec<usize> {
    let mut order: Vec<usize> = (0..sampled.of.len()).collect();
    let parameter = |a: &usize| &fit.parameters[sampled.of[*a]];
    order.sort_by_key(|a| (parameter(a).doubt.is_none(), parameter(a).run.is_some(), *a));
    order.truncate(MOST);
    order.sort_unstable();
    order
}

/// One parameter along an axis of the chart.
struct Axis<'a> {
    parameter: &'a FittedParameter,
    draws: Vec<f64>,
    range: (f64, f64),
    log: bool,
}

impl<'a> Axis<'a> {
    fn of(parameter: &'a FittedParameter, draws: Vec<f64>) -> Self {
        let (low, high) = draws.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
        // Over less than a factor of two a logarithm looks like a line, whose numbers are easier to read.
        let log = parameter.scale == Moved::Log && low > 0.0 && high > 2.0 * low;
        let range = if log { (low / 1.05, high * 1.05) } else { crate::report::svg::axis::padded((low, high)) };
        Axis { parameter, draws, range, log }
    }

    fn scale(&self, from_px: f64, to_px: f64) -> Scale {
        Scale::new(self.range, from_px, to_px, self.log)
    }

    fn label(&self) -> String {
        let name = &self.parameter.name;
        match &self.parameter.run {
            Some(run) => format!("{name} · {run}"),
            None => name.clone(),
        }
    }
}

fn corner(fit: &Fit, sampled: &Posterior, shown: &[usize]) -> String {
    let axes: Vec<Axis> = shown
        .iter()
        .map(|&a| Axis::of(&fit.parameters[sampled.of[a]], sampled.draws.iter().map(|draw| draw[a]).collect()))
        .collect();
    let side = side(axes.len());
    let (width, height) = (ROOM + side, side + ROOM);
    let mut out = format!(
        r##"<svg xmlns="http://www.w3.org/2000/svg" class="chart" viewBox="0 0 {width} {height}" role="img" aria-label="Draws of the joint posterior, two parameters at a time" font-family="system-ui, sans-serif" font-size="11" fill="#222">"##
    );
    for (row, y) in axes.iter().enumerate() {
        let top = row as f64 * (PANEL + GAP);
        for (column, x) in axes[..=row].iter().enumerate() {
            let left = ROOM + column as f64 * (PANEL + GAP);
            let _ = write!(
                out,
                r##"<rect class="grid" x="{left}" y="{top}" width="{PANEL}" height="{PANEL}" fill="none" stroke="#ddd"/>"##
            );
            let across = x.scale(left, left + PANEL);
            if row == column {
                bars(&mut out, x, &across, (left, top));
            } else {
                dots(&mut out, (x, &across), (y, &y.scale(top + PANEL, top)));
            }
            if row + 1 == axes.len() {
                below(&mut out, x, &across, (left, top + PANEL));
            }
        }
        if row > 0 {
            beside(&mut out, y, &y.scale(top + PANEL, top), top);
        }
    }
    out.push_str("</svg>");
    out
}

/// A dot is a line without length under a round cap: many of them are one path.
fn dots(out: &mut String, (x, across): (&Axis, &Scale), (y, up): (&Axis, &Scale)) {
    let every = x.draws.len().div_ceil(POINTS).max(1);
    let mut d = String::new();
    for (a, b) in x.draws.iter().zip(&y.draws).step_by(every) {
        let _ = write!(d, "M{:.1} {:.1}h0", across.px(*a), up.px(*b));
    }
    let _ = write!(
        out,
        r##"<path class="series-0" d="{d}" fill="none" stroke="#0072b2" stroke-width="2.4" stroke-linecap="round" stroke-opacity="0.45"/>"##
    );
}

fn bars(out: &mut String, x: &Axis, across: &Scale, (left, top): (f64, f64)) {
    let width = PANEL / BARS as f64;
    let mut counts = [0usize; BARS];
    for v in &x.draws {
        counts[(((across.px(*v) - left) / width).max(0.0) as usize).min(BARS - 1)] += 1;
    }
    let most = counts.iter().max().copied().unwrap_or(0).max(1) as f64;
    for (k, count) in counts.iter().enumerate().filter(|(_, count)| **count > 0) {
        let height = 0.92 * PANEL * *count as f64 / most;
        let _ = write!(
            out,
            r##"<rect class="series-0" x="{:.1}" y="{:.1}" width="{width:.1}" height="{height:.1}" fill="#0072b2" fill-opacity="0.6"/>"##,
            left + k as f64 * width,
            top + PANEL - height,
        );
    }
    let at = across.px(x.parameter.value);
    if (left..=left + PANEL).contains(&at) {
        let _ = write!(
            out,
            r##"<path class="series-1" d="M{at:.1} {top}v{PANEL}" fill="none" stroke="#c8500a" stroke-width="1.5"/>"##
        );
    }
}

/// Two numbers and a name under a column.
fn below(out: &mut String, x: &Axis, across: &Scale, (left, bottom): (f64, f64)) {
    let _ = write!(out, r#"<g class="label">"#);
    for t in ends(x) {
        let _ = write!(
            out,
            r#"<text x="{:.1}" y="{:.1}" text-anchor="middle">{}</text>"#,
            across.px(t),
            bottom + 14.0,
            significant(t, 4)
        );
    }
    let _ = write!(
        out,
        r#"<text x="{:.1}" y="{:.1}" text-anchor="middle" textLength="{:.0}" lengthAdjust="spacingAndGlyphs">{}</text></g>"#,
        left + 0.5 * PANEL,
        bottom + 32.0,
        room_of(&x.label()),
        escape(&x.label())
    );
}

/// The same left of a row.
fn beside(out: &mut String, y: &Axis, up: &Scale, top: f64) {
    let _ = write!(out, r#"<g class="label">"#);
    for t in ends(y) {
        let _ = write!(
            out,
            r#"<text x="{:.1}" y="{:.1}" text-anchor="end">{}</text>"#,
            ROOM - 4.0,
            up.px(t) + 4.0,
            significant(t, 4)
        );
    }
    let _ = write!(
        out,
        r#"<text transform="translate(11 {:.1}) rotate(-90)" text-anchor="middle" textLength="{:.0}" lengthAdjust="spacingAndGlyphs">{}</text></g>"#,
        top + 0.5 * PANEL,
        room_of(&y.label()),
        escape(&y.label())
    );
}

/// A name keeps to its panel.
fn room_of(label: &str) -> f64 {
    (6.0 * label.chars().count() as f64).min(PANEL)
}

/// Two places along an axis that are labelled.
fn ends(axis: &Axis) -> [f64; 2] {
    let at = |share: f64| {
        let (low, high) = axis.range;
        if axis.log { low * (high / low).powf(share) } else { low + share * (high - low) }
    };
    [at(0.2), at(0.8)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::outcome::doubt::Doubt;

    fn parameter(name: &str, value: f64, doubt: Option<Doubt>) -> FittedParameter {
        FittedParameter { name: name.into(), value, doubt, ..FittedParameter::default() }
    }

    fn sampled() -> Posterior {
        Posterior {
            converged: true,
            r_hat: 1.0034,
            effective_draws: 1210.4,
            wanted: 1000,
            chains: 48,
            sweeps: 500,
            acceptance: 0.234,
            evaluations: 48_000,
            of: vec![0, 1],
            draws: (0..100).map(|i| vec![f64::from(i), f64::from(i * i)]).collect(),
        }
    }

    #[test]
    fn the_chart_has_a_panel_for_each_pair_and_a_distribution_for_each_parameter() {
        let parameters = [parameter("a", 50.0, None), parameter("b", 900.0, None)];
        let axes: Vec<Axis> = parameters
            .iter()
            .zip([1, 2])
            .map(|(p, k)| Axis::of(p, (0..100).map(|i| f64::from(i).powi(k)).collect()))
            .collect();
        let mut bars_drawn = String::new();
        bars(&mut bars_drawn, &axes[0], &axes[0].scale(0.0, PANEL), (0.0, 0.0));
        // a value for each of a hundred places, evenly: all bars within the padding are about as high
        assert!(bars_drawn.matches("<rect").count() >= BARS - 3 && bars_drawn.contains("series-1"), "{bars_drawn}");
        let mut dots_drawn = String::new();
        let scales = [axes[0].scale(0.0, PANEL), axes[1].scale(PANEL, 0.0)];
        dots(&mut dots_drawn, (&axes[0], &scales[0]), (&axes[1], &scales[1]));
        assert_eq!(dots_drawn.matches("h0").count(), 100);
    }

    #[test]
    fn what_is_said_names_numbers_and_what_to_do() {
        assert_eq!(
            how(&sampled()),
            "24000 draws of 48 chains, worth 1210 independent ones or more (R̂ 1.003 or less); 23% of the moves were made"
        );
        let short = not_converged(&Posterior { converged: false, effective_draws: 80.0, r_hat: 1.2, ..sampled() });
        assert!(
            short.contains("worth 80") && short.contains("1000 were asked for") && short.contains("1.200"),
            "{short}"
        );
        assert_eq!(in_doubt(&parameter("tau1_s", 1.0, Some(Doubt::Curved))).unwrap(), "tau1_s (curved)");
        assert_eq!(in_doubt(&parameter("tau1_s", 1.0, None)), None);
    }
}
