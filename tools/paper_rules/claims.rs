//! The rules themselves: what the paper says, and the question that decides.

use std::f64::consts::TAU;

use crate::claim::{Claim, Evidence, Finding};
use crate::designs::{EQUAL_STEP, PLAN, SCATTERS, Significance};
use crate::judge::{Verdict, judge, two_digits};
use crate::sweep::{OTHER_TAUS_S, Point, STEPS};

/// A shift of less than this is none, percent of `4L/a`.
const NO_SHIFT_PERCENT: f64 = 1.0;
/// The paper's orders of magnitude, s.
const TENTH_S: f64 = 0.1;
const HUNDREDTH_S: f64 = 0.01;
/// Retardation times at which numbers are given, s.
const SHOWN_S: [f64; 5] = [1e-3, 1e-2, 0.1, 1.0, 10.0];
/// Half an order of magnitude, as a factor: what is of the order of 0.1 lies within it.
const HALF_AN_ORDER: f64 = 3.162_277_660_168_379_5;

/// What is read off a point.
type Measure = fn(&Point) -> f64;

/// Every rule, in the order of the page.
pub const CLAIMS: &[Claim] = &[
    Claim {
        says: "above τ1 = 10⁻¹ s, J1 does not affect the phase",
        place: "abstract; text to Fig. 11(b), 12(a); conclusions",
        test: "the fourth crossing of the mean level moves by less than 1 % of T",
        ask: |e| still(e, 0, |tau| tau > TENTH_S),
    },
    Claim {
        says: "above τ2 = 10⁻¹ s, J2 does not affect the phase",
        place: "abstract; text to Fig. 12(c); conclusions",
        test: "as above",
        ask: |e| still(e, 1, |tau| tau > TENTH_S),
    },
    Claim {
        says: "below τ1 = 10⁻¹ s, raising J1 shifts the phase",
        place: "text to Fig. 11(a)",
        test: "the fourth crossing comes later by 1 % of T or more",
        ask: shifts,
    },
    Claim {
        says: "the effect of J on damping is greatest where τ is of the order of 10⁻¹ s",
        place: "text to Fig. 11, 12; conclusions",
        test: "the τ of the greatest change lies within half an order of magnitude of 0.1 s, for both steps of both elements",
        ask: greatest,
    },
    Claim {
        says: "below τ1 = 10⁻² s, raising J1 lowers the damping (the rule is reversed)",
        place: "abstract; conclusions",
        test: "three measures: P1−P2, the second peak (eq. 21), the logarithmic decrement",
        ask: |e| damps(e, 0, -1.0, |tau| tau < HUNDREDTH_S),
    },
    Claim {
        says: "from τ1 = 10⁻² s on, raising J1 raises the damping",
        place: "abstract; conclusions",
        test: "as above",
        ask: |e| damps(e, 0, 1.0, |tau| tau >= HUNDREDTH_S),
    },
    Claim {
        says: "below τ1 = 10⁻¹ s, raising J1 raises the damping (contradicts the reversal below 10⁻² s)",
        place: "text to Fig. 11(a)",
        test: "as above",
        ask: |e| damps(e, 0, 1.0, |tau| tau < TENTH_S),
    },
    Claim {
        says: "raising J2 raises the damping, whatever τ2",
        place: "abstract; conclusions",
        test: "as above",
        ask: |e| damps(e, 1, 1.0, |_| true),
    },
    Claim {
        says: "raising J2 lowers the damping (contradicts the last)",
        place: "text to Fig. 11(c), (d)",
        test: "as above",
        ask: |e| damps(e, 1, -1.0, |_| true),
    },
    Claim {
        says: "creep does not move the first peak in time, and in height by 10 % at most",
        place: "text to Fig. 11",
        test: "time by less than 1 % of T; height above the steady head by 10 % or less; both elements, the step of Fig. 12",
        ask: first_peak,
    },
    Claim {
        says: "what J does depends on its own τ only",
        place: "conclusions",
        test: "what J1 does to the decrement, at three τ2, within 10 % of that at the paper's τ2",
        ask: own_tau_only,
    },
    Claim {
        says: "the larger J1, the more a further increase damps; the larger J2, the less",
        place: "conclusions",
        test: "J in equal steps from 0.25 to 2 1/GPa at the paper's τ: each step raises the damping, by more (J1), by less (J2) than the last",
        ask: steps,
    },
    Claim {
        says: "τ1 and τ2 move the phase less significantly than the damping",
        place: "text to Fig. 9",
        test: "F of the three time differences below F of the three peak differences (medians), others drawn within ±1 % and within ±5 %",
        ask: taus_significance,
    },
    Claim {
        says: "J1 is highly significant for both damping and phase",
        place: "text to Fig. 10(a)",
        test: "p < 0.01 for all six differences",
        ask: |e| highly(e, "J1_per_GPa"),
    },
    Claim {
        says: "J2 acts on the damping first, on the phase less",
        place: "text to Fig. 10(b)",
        test: "F of the time differences below F of the peak differences (medians)",
        ask: |e| less_phase(e, "J2_per_GPa"),
    },
    Claim {
        says: "take τ1 ≤ 10⁻² s and τ2 ≥ 1 s: then J1 moves phase and damping, J2 the damping only",
        place: "reference orders, body",
        test: "at 0.01 s, J1 shifts the phase by 1 % of T or more and changes the decrement by 1 % or more; at 1 s and above, J2 shifts by less and damps",
        ask: |e| separate(e, |tau| tau >= 1.0 / 1.001),
    },
    Claim {
        says: "take τ1 ≤ 10⁻² s and τ2 ≤ 1 s (contradicts the last)",
        place: "reference orders, conclusions",
        test: "as above, with J2 at 1 s and below",
        ask: |e| separate(e, |tau| tau <= 1.001),
    },
    Claim {
        says: "τ2 must be greater than τ1 (once: τ1 greater than τ2)",
        place: "process of analysis; text to Fig. 12",
        test: "the wall's elements named the other way round give another head",
        ask: order,
    },
    Claim {
        says: "each case was simulated three times to mitigate errors: F(3,8)",
        place: "single-parameter analysis",
        test: "four levels of τ1, the same run three times each: the variance within a level is above zero",
        ask: repeats,
    },
];

fn one(name: &str, verdict: Verdict) -> Vec<(String, Verdict)> {
    vec![(name.to_owned(), verdict)]
}

/// What is true at each retardation time for both steps.
fn truth(e: &Evidence, element: usize, is: impl Fn(&Point) -> Option<bool>) -> Vec<(f64, Option<bool>)> {
    let [small, large] = &e.sweeps.elements[element];
    let both = |(s, l): (&Point, &Point)| (s.tau_s, is(s).zip(is(l)).map(|(a, b)| a && b));
    small.iter().zip(large).map(both).collect()
}

fn finite(value: f64, is: impl Fn(f64) -> bool) -> Option<bool> {
    value.is_finite().then(|| is(value))
}

/// A number with its sign, a true minus; "none" where there is no number.
fn signed(value: f64, decimals: usize) -> String {
    if value.is_finite() { format!("{value:+.decimals$}").replace('-', "−") } else { "none".into() }
}

/// `small (large)` at the retardation times that are shown.
fn shown(e: &Evidence, element: usize, decimals: usize, of: impl Fn(&Point) -> f64) -> String {
    let at = |tau: f64| {
        let near = |points: &[Point]| {
            let distance = |p: &&Point| (p.tau_s / tau).ln().abs();
            points.iter().min_by(|a, b| distance(a).total_cmp(&distance(b))).map_or(f64::NAN, &of)
        };
        let [small, large] = &e.sweeps.elements[element];
        let text = |v: f64| signed(v, decimals);
        format!("{} ({})", text(near(small)), text(near(large)))
    };
    SHOWN_S.map(at).join(", ")
}

fn intro(element: usize) -> String {
    let k = element + 1;
    let [(a, b), (c, d)] = STEPS;
    let taus = SHOWN_S.map(|t| format!("{t}")).join(", ");
    format!("J{k} from {a} to {b} (in brackets {c} to {d}) 1/GPa at τ{k} = {taus} s")
}

fn still(e: &Evidence, element: usize, claimed: impl Fn(f64) -> bool) -> Finding {
    let is = |p: &Point| finite(p.phase_percent(), |v| v.abs() < NO_SHIFT_PERCENT);
    Finding {
        verdicts: one("phase", judge(&truth(e, element, is), claimed, e.sweeps.period_s)),
        numbers: format!("{}: {} % of T.", intro(element), shown(e, element, 2, Point::phase_percent)),
    }
}

fn shifts(e: &Evidence) -> Finding {
    let is = |p: &Point| finite(p.phase_percent(), |v| v >= NO_SHIFT_PERCENT);
    Finding {
        verdicts: one("phase", judge(&truth(e, 0, is), |tau| tau < TENTH_S, e.sweeps.period_s)),
        numbers: format!("{}: {} % of T.", intro(0), shown(e, 0, 2, Point::phase_percent)),
    }
}

fn greatest(e: &Evidence) -> Finding {
    let peak = |points: &[Point], of: &dyn Fn(&Point) -> f64| {
        let known = points.iter().filter(|p| of(p).is_finite());
        known.max_by(|a, b| of(a).total_cmp(&of(b))).map_or(f64::NAN, |p| p.tau_s)
    };
    let measures: [(&str, Measure); 2] = [("eq. 21", |p| p.peak_percent(2)), ("decrement", Point::decrement)];
    let mut verdicts = Vec::new();
    let mut numbers = Vec::new();
    for (name, of) in measures {
        let taus: Vec<f64> = e.sweeps.elements.iter().flatten().map(|points| peak(points, &of)).collect();
        let near = |t: &f64| (1.0 / HALF_AN_ORDER..=HALF_AN_ORDER).contains(&(t / TENTH_S));
        verdicts.push((name.to_owned(), Verdict::of(taus.iter().all(near))));
        let list = |scale: f64| taus.iter().map(|t| two_digits(t / scale).to_string()).collect::<Vec<_>>().join(", ");
        numbers.push(format!("{name}: greatest at {} s, that is τ/T = {}", list(1.0), list(e.sweeps.period_s)));
    }
    let [(a, b), (c, d)] = STEPS;
    Finding {
        verdicts,
        numbers: format!(
            "For J1 from {a} to {b}, J1 from {c} to {d}, J2 likewise: {}. Small compliances in theory: τ/T = 1/2π = {:.2}.",
            numbers.join("; "),
            1.0 / TAU
        ),
    }
}

fn damps(e: &Evidence, element: usize, sign: f64, claimed: impl Fn(f64) -> bool + Copy) -> Finding {
    let measures: [(&str, usize, &str, Measure); 3] = [
        ("P1−P2", 2, " m", Point::drop12_m),
        ("eq. 21", 1, " %", |p| p.peak_percent(2)),
        ("decrement", 4, "", Point::decrement),
    ];
    let mut verdicts = Vec::new();
    let mut numbers = Vec::new();
    for (name, decimals, unit, of) in measures {
        let is = |p: &Point| finite(of(p), |v| sign * v > 0.0);
        verdicts.push((name.to_owned(), judge(&truth(e, element, is), claimed, e.sweeps.period_s)));
        numbers.push(format!("{name} {}{unit}", shown(e, element, decimals, of)));
    }
    Finding { verdicts, numbers: format!("{}: {}.", intro(element), numbers.join("; ")) }
}

fn first_peak(e: &Evidence) -> Finding {
    let points = || e.sweeps.elements.iter().map(|steps| &steps[1]);
    let truth = |is: &dyn Fn(&Point) -> Option<bool>| -> Vec<(f64, Option<bool>)> {
        let [a, b] = &e.sweeps.elements;
        a[1].iter().zip(&b[1]).map(|(a, b)| (a.tau_s, is(a).zip(is(b)).map(|(a, b)| a && b))).collect()
    };
    let time = truth(&|p| finite(p.delay_percent(1), |v| v.abs() < NO_SHIFT_PERCENT));
    let height = truth(&|p| finite(p.peak_percent(1), |v| v.abs() <= 10.0));
    let most = |of: fn(&Point) -> f64| {
        let largest =
            |points: &Vec<Point>| points.iter().map(of).filter(|v| v.is_finite()).fold(0.0, |m: f64, v| m.max(v.abs()));
        points().map(|p| format!("{:.1}", largest(p))).collect::<Vec<_>>().join(" and ")
    };
    let period_s = e.sweeps.period_s;
    Finding {
        verdicts: vec![
            ("time".to_owned(), judge(&time, |_| true, period_s)),
            ("height".to_owned(), judge(&height, |_| true, period_s)),
        ],
        numbers: format!(
            "J1 and J2 from 1 to 2 1/GPa over all τ: time by up to {} % of T, height by up to {} %.",
            most(|p| p.delay_percent(1)),
            most(|p| p.peak_percent(1))
        ),
    }
}

fn own_tau_only(e: &Evidence) -> Finding {
    const PAPERS: usize = 1;
    let reference = &e.sweeps.others[PAPERS];
    let scale = reference.iter().map(|p| p.decrement().abs()).filter(|v| v.is_finite()).fold(0.0, f64::max);
    let others = || e.sweeps.others.iter().enumerate().filter(|(k, _)| *k != PAPERS);
    let truth: Vec<(f64, Option<bool>)> = reference
        .iter()
        .enumerate()
        .map(|(i, p)| {
            let near = others().map(|(_, o)| finite(o[i].decrement() / p.decrement(), |r| (0.9..=1.1).contains(&r)));
            (p.tau_s, near.reduce(|a, b| Some(a? && b?)).flatten())
        })
        .collect();
    let apart = |o: &Vec<Point>| {
        let worst = o.iter().zip(reference).map(|(a, b)| (a.decrement() - b.decrement()).abs() / scale);
        100.0 * worst.filter(|v| v.is_finite()).fold(0.0, f64::max)
    };
    let list: Vec<String> = others().map(|(k, o)| format!("{:.0} % at τ2 = {} s", apart(o), OTHER_TAUS_S[k])).collect();
    Finding {
        verdicts: one("decrement", judge(&truth, |_| true, e.sweeps.period_s)),
        numbers: format!(
            "J1 from 0.1 to 0.2 1/GPa, J2 = 1.5 1/GPa: the change of the decrement differs from that at τ2 = {} s by up to {} of its greatest value.",
            OTHER_TAUS_S[PAPERS],
            list.join(", ")
        ),
    }
}

fn steps(e: &Evidence) -> Finding {
    let mut verdicts = Vec::new();
    let mut numbers = Vec::new();
    for (name, output, sign, decimals) in
        [("P1−P2", "drop12_m", 1.0, 2), ("peak 2", "peak2_m", -1.0, 2), ("decrement", "damping_per_cycle", 1.0, 3)]
    {
        for (element, grows) in [(0, true), (1, false)] {
            let added: Vec<f64> = e.designs.added(element, output).iter().map(|v| sign * v).collect();
            let known = added.iter().all(|v| v.is_finite());
            let moves = added.windows(2).all(|w| if grows { w[1] > w[0] } else { w[1] < w[0] });
            let holds = moves && added.iter().all(|v| *v > 0.0);
            let k = element + 1;
            verdicts.push((format!("J{k}, {name}"), if known { Verdict::of(holds) } else { Verdict::Unknown }));
            let list: Vec<String> = added.iter().map(|v| signed(*v, decimals)).collect();
            numbers.push(format!("J{k}, {name}: {}", list.join(", ")));
        }
    }
    Finding {
        verdicts,
        numbers: format!(
            "Each step of {EQUAL_STEP} 1/GPa adds to the damping by {} (of peak 2: what it falls, m).",
            numbers.join("; ")
        ),
    }
}

fn of<'a>(e: &'a Evidence, parameter: &'a str) -> impl Iterator<Item = &'a Significance> {
    e.designs.significances.iter().filter(move |s| s.parameter == parameter)
}

fn median(mut values: [f64; 3]) -> f64 {
    values.sort_by(f64::total_cmp);
    values[1]
}

fn significance_numbers(e: &Evidence, parameters: &[&str]) -> String {
    let text = |v: f64| if v.is_finite() { two_digits(v).to_string() } else { "none".into() };
    let list = |values: [f64; 3]| values.map(text).join(", ");
    let mut parts = Vec::new();
    for parameter in parameters {
        for s in of(e, parameter) {
            parts.push(format!(
                "{parameter}, others ±{} %: damping {}, phase {}",
                100.0 * s.scatter,
                list(s.damping),
                list(s.phase)
            ));
        }
    }
    format!("F of differences 1-2, 1-3, 1-4 ({} levels × {} runs). {}.", PLAN.levels, PLAN.repeats, parts.join("; "))
}

fn taus_significance(e: &Evidence) -> Finding {
    let mut verdicts = Vec::new();
    for parameter in ["tau1_s", "tau2_s"] {
        verdicts.extend(less(e, parameter));
    }
    Finding { verdicts, numbers: significance_numbers(e, &["tau1_s", "tau2_s"]) }
}

fn less(e: &Evidence, parameter: &str) -> Vec<(String, Verdict)> {
    let label = |s: &Significance| format!("{parameter}, ±{} %", 100.0 * s.scatter);
    of(e, parameter).map(|s| (label(s), Verdict::of(median(s.phase) < median(s.damping)))).collect()
}

fn less_phase(e: &Evidence, parameter: &str) -> Finding {
    Finding { verdicts: less(e, parameter), numbers: significance_numbers(e, &[parameter]) }
}

fn highly(e: &Evidence, parameter: &str) -> Finding {
    // Of F with 3 and 96 degrees of freedom.
    let critical = surgescope::sensitivity::anova::critical(0.01, PLAN.levels - 1, PLAN.levels * (PLAN.repeats - 1));
    let mut verdicts = Vec::new();
    for (s, scatter) in of(e, parameter).zip(SCATTERS) {
        for (kind, f) in [("damping", s.damping), ("phase", s.phase)] {
            verdicts.push((format!("{kind}, ±{} %", 100.0 * scatter), Verdict::of(f.iter().all(|f| *f > critical))));
        }
    }
    Finding {
        verdicts,
        numbers: format!("{} p < 0.01 from F = {critical:.2} on.", significance_numbers(e, &[parameter])),
    }
}

fn separate(e: &Evidence, of_second: impl Fn(f64) -> bool) -> Finding {
    let [small, _] = &e.sweeps.elements[0];
    let at = |points: &[Point]| points.iter().position(|p| p.tau_s > HUNDREDTH_S / 1.001);
    let first = at(small).map(|i| &small[i]);
    let phase = first.map_or(f64::NAN, Point::phase_percent);
    let change = first.map_or(f64::NAN, |p| 100.0 * p.relative_decrement());
    let period_s = e.sweeps.period_s;
    let quiet = |p: &Point| finite(p.phase_percent(), |v| v.abs() < NO_SHIFT_PERCENT);
    let damps = |p: &Point| finite(p.decrement(), |v| v > 0.0);
    let both = |p: &Point| Some(quiet(p)? && damps(p)?);
    Finding {
        verdicts: vec![
            ("J1, phase".to_owned(), Verdict::of(phase.abs() >= NO_SHIFT_PERCENT)),
            ("J1, damping".to_owned(), Verdict::of(change.abs() >= 1.0)),
            ("J2".to_owned(), judge(&truth(e, 1, both), of_second, period_s)),
        ],
        numbers: format!(
            "J1 from 0.1 to 0.2 1/GPa at τ1 = 0.01 s: phase {} % of T, decrement {} % of itself. {}: phase {} % of T, decrement {}.",
            signed(phase, 1),
            signed(change, 1),
            intro(1),
            shown(e, 1, 2, Point::phase_percent),
            shown(e, 1, 4, Point::decrement)
        ),
    }
}

fn order(e: &Evidence) -> Finding {
    let [a, b] = &e.designs.swapped;
    let apart = a.iter().zip(b).map(|(a, b)| (a - b).abs()).filter(|d| d.is_finite()).fold(0.0, f64::max);
    let said = if apart == 0.0 { "differs at all".to_owned() } else { format!("differs by more than {apart:.0e}") };
    Finding {
        verdicts: one("head", Verdict::of(apart > 1e-6)),
        numbers: format!(
            "No peak, time, phase or decrement {said}: elements add up, and which one is called the first is a matter of names."
        ),
    }
}

fn repeats(e: &Evidence) -> Finding {
    let Some(found) = e.designs.literal else {
        return Finding { verdicts: one("F", Verdict::Unknown), numbers: "No second peak.".into() };
    };
    Finding {
        verdicts: one("F", Verdict::of(found.ss_within > 0.0)),
        numbers: format!(
            "P1−P2: sum of squares within levels {}, between levels {:.3} m² ({} and {} degrees of freedom), so F = {}. A simulation repeats itself exactly: F says nothing, whatever else is drawn between repeats decides it.",
            found.ss_within, found.ss_between, found.df_between, found.df_within, found.f
        ),
    }
}
