//! Column separation as measured in the copper pipe of the University of Adelaide (Bergant & Simpson 1999, J. Hydraul.
//! Eng. 125(8):835-848): what the models make of it, and what they need for that. `docs/src/measured/adelaide.md` says
//! what follows from it; `cargo test --test it model::adelaide -- --nocapture` prints its numbers.

use surgescope_core::rig::Rig;

use crate::column::{
    ATMOSPHERE_PA, CAVITIES_S, G, HIGHEST_KPA, Record, SECOND_PEAK_KPA, SUPPLY_M, WAVE_SPEED_M_S, cavities_s,
    highest_kpa, rig, scaled,
};

const STEADY: &str = "vapour-cavity";
const UNSTEADY: &str = "vapour-cavity,unsteady-friction";
const BRUNONE: &str = "vapour-cavity,unsteady-friction/brunone";

/// A run of the rig; effects at their defaults but for `values` of the first ones.
fn run(rig: &Rig, effects: &str, values: &[f64], velocity: f64, supply_m: f64, reaches: usize) -> Record {
    scaled(rig, effects, values, velocity, supply_m, 1.0, reaches)
}

/// What both tests of the rig come to, as parts of what was measured, less one.
struct Against {
    highest: f64,
    second_peak: f64,
    cavities: [f64; 2],
}

fn against(effects: &str, values: &[f64], supply_m: f64, reaches: usize) -> Against {
    let moderate = run(&rig(), effects, values, 0.3, supply_m, reaches);
    let severe = run(&rig(), effects, values, 1.4, supply_m, reaches);
    let lasts = cavities_s(&severe);
    let found = Against {
        highest: highest_kpa(&moderate, 0.0, 1.0) / HIGHEST_KPA - 1.0,
        second_peak: highest_kpa(&severe, 0.33, 0.47) / SECOND_PEAK_KPA - 1.0,
        cavities: [0, 1].map(|i| lasts[i] / CAVITIES_S[i] - 1.0),
    };
    println!(
        "| `{effects}` {values:?} | {supply_m:.1} | {reaches} | {:+.1} | {:+.1} | {:+.1} | {:+.1} |",
        100.0 * found.highest,
        100.0 * found.second_peak,
        100.0 * found.cavities[0],
        100.0 * found.cavities[1],
    );
    found
}

/// The pulse at 0.3 m/s without friction. With `y` the supply's head above that of vapour at the valve, the closure's
/// `aV/g` is more than `y`, so that a cavity opens after `2L/a`; the water leaves it with `g/a (aV/g - y)`, comes back
/// `2y` slower and fills it before another `2L/a` is over. The head then rises by `3y - aV/g`, and by `2y` more when
/// what the supply sends back arrives: to `H_vapour + 5y - aV/g`, for as long as the cavity took to fill. Five times
/// the head of the supply.
#[test]
fn the_short_pulse_has_its_closed_form() {
    let mut rig = rig();
    rig.pipes[0].friction_factor = Some(0.0);
    let water = rig.fluid.properties(rig.fluid.temperature_degc);
    let per_m = water.density_kg_m3 * G;
    for supply_m in [20.6, SUPPLY_M] {
        let vapour_m = 2.03 + (water.vapour_pressure_pa - ATMOSPHERE_PA) / per_m;
        let (y, rise) = (supply_m - vapour_m, WAVE_SPEED_M_S * 0.3 / G);
        assert!(y < rise && rise < 2.0 * y);
        let exact = ((vapour_m + 5.0 * y - rise - 2.03) * per_m + ATMOSPHERE_PA) / 1e3;
        println!("without friction, supply {supply_m} m: {exact:.0} kPa");
        for reaches in [64, 128, 256] {
            let highest = highest_kpa(&run(&rig, STEADY, &[], 0.3, supply_m, reaches), 0.0, 1.0);
            assert!((highest / exact - 1.0).abs() < 0.01, "{supply_m} m, {reaches} reaches: {highest} {exact} kPa");
        }
    }
}

/// With the supply as published, and steady friction, the severe test is met within 10% (peak) and 5% (cavities); the
/// pulse of the moderate one is 6% too high on every grid, 4.6% with unsteady friction: not within 3%.
#[test]
fn with_the_published_head_the_severe_test_is_met_and_the_pulse_is_too_high() {
    for reaches in [32, 64, 128, 256] {
        let steady = against(STEADY, &[], SUPPLY_M, reaches);
        assert!(steady.second_peak.abs() < 0.10 && steady.cavities.iter().all(|c| c.abs() < 0.05), "{reaches}");
        assert!((0.055..0.07).contains(&steady.highest), "{reaches} reaches: {}", steady.highest);
        let unsteady = against(UNSTEADY, &[], SUPPLY_M, reaches);
        assert!(unsteady.second_peak.abs() < 0.10 && unsteady.cavities.iter().all(|c| c.abs() < 0.10), "{reaches}");
        assert!((0.04..0.05).contains(&unsteady.highest), "{reaches} reaches: {}", unsteady.highest);
    }
}

/// One number taken from the measurement, the supply's head from the first cavity at 1.4 m/s: then everything else is
/// met, the pulse at 0.3 m/s within 3%. (On 64 reaches the second cavity comes and goes by 1% with the collapse of the
/// small ones beside it, and is up to 5.7% short.)
#[test]
fn with_the_head_from_the_first_cavity_all_is_met() {
    let (mut low, mut high) = (19.0, 23.0);
    while high - low > 0.05 {
        let middle = 0.5 * (low + high);
        let lasts = cavities_s(&run(&rig(), UNSTEADY, &[], 1.4, middle, 128));
        if lasts[0] > CAVITIES_S[0] { low = middle } else { high = middle }
    }
    let supply_m = 0.5 * (low + high);
    assert!((supply_m - 20.6).abs() < 0.2, "{supply_m}");
    for reaches in [128, 256, 512] {
        let found = against(UNSTEADY, &[], supply_m, reaches);
        assert!(found.highest.abs() < 0.03, "{reaches} reaches: pulse {}", found.highest);
        assert!(found.second_peak.abs() < 0.10, "{reaches} reaches: second peak {}", found.second_peak);
        assert!(found.cavities.iter().all(|c| c.abs() < 0.05), "{reaches} reaches: {:?}", found.cavities);
    }
}

/// One number of the water that nobody published, its free gas, of which two to three millionths cushion the short
/// cavity of the moderate test and leave the severe one as it is: with the head as published, and steady friction,
/// everything is met.
#[test]
fn with_a_trace_of_free_gas_all_is_met_at_the_published_head() {
    for gas in [2e-6, 2.5e-6, 3e-6] {
        for reaches in [128, 256, 512] {
            let found = against("entrained-gas", &[gas], SUPPLY_M, reaches);
            assert!(found.highest.abs() < 0.03, "{gas}, {reaches} reaches: pulse {}", found.highest);
            assert!(found.second_peak.abs() < 0.10, "{gas}, {reaches} reaches: second peak {}", found.second_peak);
            assert!(found.cavities.iter().all(|c| c.abs() < 0.05), "{gas}, {reaches} reaches: {:?}", found.cavities);
        }
    }
    // It is the gas: a tenth of it leaves the pulse as high as without.
    assert!(against("entrained-gas", &[2e-7], SUPPLY_M, 256).highest > 0.05);
}

/// Other ways to a lower pulse, each at the published head. With free gas and unsteady friction both, the cavities are
/// 5 and 9% short; instantaneous accelerations bring it down too, and leave the second cavity 15 to 19% short.
#[test]
fn what_else_lowers_the_pulse_misses_elsewhere() {
    let gas = [64, 256].map(|reaches| against("entrained-gas,unsteady-friction", &[1e-6, 2e-4], SUPPLY_M, reaches));
    assert!((gas[0].highest - gas[1].highest).abs() > 0.02);
    assert!(gas.iter().all(|g| g.highest.abs() < 0.03 && g.cavities[1] < -0.08));
    let brunone = [64, 256].map(|reaches| against(BRUNONE, &[], SUPPLY_M, reaches));
    assert!((brunone[0].highest - brunone[1].highest).abs() > 0.01);
    assert!(brunone.iter().all(|b| b.highest < 0.04 && b.cavities[1] < -0.12));
}

/// What the pulse owes to each number of the rig, kPa.
#[test]
fn the_pulse_hangs_on_the_supply_head() {
    let pulse = |velocity, supply_m| highest_kpa(&run(&rig(), UNSTEADY, &[], velocity, supply_m, 128), 0.0, 1.0);
    let by_head = pulse(0.3, 22.5) - pulse(0.3, 21.5);
    let by_velocity = pulse(0.305, SUPPLY_M) - pulse(0.295, SUPPLY_M);
    println!("pulse: {by_head:+.0} kPa per metre of supply head, {by_velocity:+.1} kPa per 0.01 m/s");
    assert!((35.0..50.0).contains(&by_head), "{by_head}");
    assert!((-13.5..0.0).contains(&by_velocity), "{by_velocity}");
}
