//! The page of the source paper's rules, in Markdown.

use std::fmt::Write as _;

use crate::claim::Finding;
use crate::judge::Verdict;
use crate::study::Rules;
use surgescope::report::text::number::significant;

/// What a reader must know of the closures and the measures.
const NOTES: &str = "
The longer rig has the same waves (its closing time is scaled up and its friction down) but the paper's walls, whose retardation times are given in \
seconds: an order of magnitude of τ that is right for one length is wrong for another, while a rule about τ/T moves along.

Damping has three measures, and they do not agree: the difference P1−P2 of the paper's analysis of variance, its equation 21 at the second peak, \
(P − P′)/P with P before and P′ after J is raised, and the logarithmic decrement of the swing from peak to trough, mean over three cycles. The first two \
also count that a softer wall makes a lower wave to begin with; the decrement does not. The time of a peak jumps from one end of a \
flat plateau to the other, so phase is read where the head crosses its mean level; rules about the paper's time differences (13 to 15) take the \
peaks, as the paper does. Where the verdict of an analysis of variance depends on how far the other parameters are drawn, no such rule can be read from it.

## Verdicts

";

/// The page.
pub fn rules_page(rules: &Rules) -> String {
    let mut out = String::from("# The source paper's rules, one by one\n\n");
    let _ = writeln!(
        out,
        "The paper studies which creep parameter of a two-element Kelvin-Voigt wall moves phase and damping, and derives rules. Each is \
         tested here by simulation on rig `{}` ({} simulations, {} reaches), on {} closures. τ is a retardation time, T the period 4L/a. \"Holds \
         only for\" gives the part of the paper's own range in which the rule is true for a small step of J (0.1 to 0.2 1/GPa) and for that of its Figure 12 \
         (1 to 2 1/GPa) alike; where a closure has a verdict by several measures, each has its own. This page is written by\n",
        rules.rig,
        rules.runs,
        rules.reaches,
        rules.cases.len()
    );
    let first = &rules.cases[0];
    let _ = writeln!(
        out,
        "```sh,norun\ncargo run --release -p surgescope-tools --bin paper_rules -- rigs/{}.toml initial_velocity_m_s={} closing_time_s={}\n```\n",
        rules.rig, first.velocity_m_s, first.closing_time_s
    );
    out.push_str("| closure | T, s | velocity, m/s | closing time, s |\n| --- | --- | --- | --- |\n");
    for case in &rules.cases {
        let _ = writeln!(
            out,
            "| {} | {} | {} | {} |",
            case.name,
            significant(case.period_s, 4),
            case.velocity_m_s,
            significant(case.closing_time_s, 2)
        );
    }
    out.push_str(NOTES);
    let names: Vec<&str> = rules.cases.iter().map(|c| c.name.as_str()).collect();
    let _ =
        writeln!(out, "| | the paper says | {} |\n| --- | --- |{}", names.join(" | "), " --- |".repeat(names.len()));
    for (i, rule) in rules.rules.iter().enumerate() {
        let cells: Vec<String> = rule.findings.iter().map(verdicts).collect();
        let _ = writeln!(out, "| [{0}](#rule-{0}) | {1} | {2} |", i + 1, rule.says, cells.join(" | "));
    }
    out.push_str("\n## Numbers\n");
    for (i, rule) in rules.rules.iter().enumerate() {
        let _ =
            writeln!(out, "\n### Rule {}\n\n{} ({}).\nTest: {}.\n", i + 1, sentence(rule.says), rule.place, rule.test);
        for (case, finding) in rules.cases.iter().zip(&rule.findings) {
            let _ = writeln!(out, "- {}: {}. {}", case.name, verdicts(finding), finding.numbers);
        }
    }
    out
}

/// All verdicts of a closure in one cell: one word where they agree.
fn verdicts(finding: &Finding) -> String {
    let all = &finding.verdicts;
    match all.first() {
        Some((_, first)) if all.iter().all(|(_, v)| v == first) => bold(first),
        _ => all.iter().map(|(name, v)| format!("{name}: {}", bold(v))).collect::<Vec<_>>().join("; "),
    }
}

fn bold(verdict: &Verdict) -> String {
    match verdict {
        Verdict::HoldsWhere(part) => format!("**holds only for** {part}"),
        other => format!("**{other}**"),
    }
}

fn sentence(text: &str) -> String {
    let mut letters = text.chars();
    // Greek letters are symbols here: a capital τ would be another.
    letters.next().map_or(String::new(), |first| std::iter::once(first.to_ascii_uppercase()).chain(letters).collect())
}
