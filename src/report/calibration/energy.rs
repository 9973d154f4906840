//! The energy book of the last model: who has taken how much of the moving water's energy, cycle by cycle.

use std::fmt::Write;

use crate::fit::outcome::fit::RunFit;
use crate::model::energy::Energy;
use crate::report::Page;
use crate::report::html::page::{minus, table};
use crate::report::text::escape::escape;
use crate::report::text::number::significant;

/// Cycles after which the book is read, besides at the end.
const AFTER: [usize; 5] = [1, 2, 4, 8, 16];

pub(crate) fn section(page: &Page) -> String {
    let (Some(energy), Some(last)) = (&page.energy, page.stages.last()) else { return String::new() };
    let Some((run, times)) = last.fit.runs.first().map(|run| (run, readings(run))) else { return String::new() };
    let Some(&(_, end_s)) = times.last() else { return String::new() };
    // The accounts in the order of the end, so that a colour is always one account's.
    let accounts: Vec<(String, f64)> = energy.takers(end_s);
    let mut out = String::from(
        "<section class=\"energy\" id=\"energy\"><h2>Where the energy goes</h2>\n<p class=\"key\" aria-hidden=\"true\">",
    );
    for (name, _) in &accounts {
        let _ = write!(out, r#"<span><i style="background:{}"></i>{}</span>"#, colour(energy, name), escape(name));
    }
    out.push_str("</p>\n<div class=\"books\" aria-hidden=\"true\">\n");
    for (word, time_s) in &times {
        let _ = write!(out, "<div class=\"book\"><span class=\"name\">{word}</span><span class=\"track\">");
        let shares = energy.shares(*time_s);
        for (name, _) in &accounts {
            let share = share_of(&shares, name);
            let _ = write!(
                out,
                r#"<i data-share="{share:.9}" style="width:{:.3}%;background:{}"></i>"#,
                100.0 * share,
                colour(energy, name)
            );
        }
        out.push_str("</span></div>\n");
    }
    out.push_str("</div>\n");
    out.push_str(&numbers(energy, &times, &accounts));
    let _ = writeln!(
        out,
        r#"<p class="note">Run {} in the model {}: {} J of motion before the closure, {} J from the supply since; each share is a part of all energy that was taken or is left. An account that gives more than it takes has no share. The balance closes to {} of the energy of motion (Karney 1990).</p>
</section>"#,
        escape(&run.file),
        escape(&last.title),
        significant(energy.initial_kinetic_j(), 4),
        minus(&significant(energy.supplied_j(end_s), 3)),
        significant(energy.largest_imbalance_j() / energy.initial_kinetic_j(), 1),
    );
    out
}

fn numbers(energy: &Energy, times: &[(String, f64)], accounts: &[(String, f64)]) -> String {
    let shares: Vec<Vec<(String, f64)>> = times.iter().map(|(_, t)| energy.shares(*t)).collect();
    let rows = accounts.iter().map(|(name, joules)| {
        let mut row = vec![escape(name)];
        row.extend(shares.iter().map(|s| format!("{:.1} %", 100.0 * share_of(s, name))));
        row.push(minus(&significant(*joules, 3)));
        row
    });
    let mut headings = vec!["taken by"];
    headings.extend(times.iter().map(|(word, _)| word.as_str()));
    headings.push("at the end, J");
    let numbers: Vec<usize> = (1..headings.len()).collect();
    table("Where the energy goes", &headings, &numbers, rows)
}

fn share_of(shares: &[(String, f64)], name: &str) -> f64 {
    shares.iter().find(|(n, _)| n == name).map_or(0.0, |s| s.1)
}

/// One colour an account, whatever its place in the order.
fn colour(energy: &Energy, name: &str) -> &'static str {
    match name {
        "left in the line" => "var(--measured)",
        "friction" => "var(--s1)",
        "valve" => "var(--s4)",
        _ => {
            let n = energy.accounts.iter().position(|a| a == name).unwrap_or(0);
            ["var(--s0)", "var(--s2)", "var(--s3)"][n % 3]
        }
    }
}

/// When the book is read, in words and in s after the start of the closure: after some cycles, and at the end of the
/// record.
fn readings(run: &RunFit) -> Vec<(String, f64)> {
    let end_s = run.sensors.iter().filter_map(|s| s.time_s.last().copied()).fold(0.0, f64::max);
    let peaks = |s: &crate::fit::outcome::fit::SensorFit| {
        let peaks: Vec<_> = s.extrema.iter().filter(|e| e.peak).collect();
        let (first, last) = (peaks.first()?, peaks.last()?);
        let cycles = last.cycle.checked_sub(first.cycle).filter(|n| *n > 0)?;
        Some((last.time_s - first.time_s) / cycles as f64)
    };
    let mut readings = Vec::new();
    if let Some(period_s) = run.sensors.iter().find_map(peaks) {
        let inside = AFTER.iter().map(|&n| (n, n as f64 * period_s)).filter(|(_, t)| *t < 0.95 * end_s);
        readings.extend(inside.map(|(n, t)| (format!("after {n} cycle{}", if n == 1 { "" } else { "s" }), t)));
    }
    if end_s > 0.0 {
        readings.push(("at the end".into(), end_s));
    }
    readings
}
