//! No memory is allocated while a simulation steps: twice the steps cost not one allocation more.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use surgescope::model::effects::{CATALOGUE, Chosen};
use surgescope::model::trace::Probe;
use surgescope::model::{Conditions, Model, Resolution, RunValues};
use surgescope::rig::Rig;

struct Counting;

thread_local! {
    // Each test's own thread counts for itself.
    static COUNT: Cell<usize> = const { Cell::new(0) };
}

// SAFETY: every call is handed on to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let _ = COUNT.try_with(|c| c.set(c.get() + 1));
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { System.dealloc(pointer, layout) }
    }
    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        let _ = COUNT.try_with(|c| c.set(c.get() + 1));
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Allocations of a simulation of so many seconds.
fn allocations(rig: &Rig, effects: &[Chosen], duration_s: f64, with_energy: bool) -> usize {
    let water = rig.fluid.properties(20.0);
    let model = Model::new(rig, &water, effects);
    let shared: Vec<f64> = model.shared.iter().map(|p| p.start).collect();
    let run = RunValues { initial_velocity_m_s: 0.3, valve_head_m: 40.0, closing_time_s: 0.1, friction_scale: 1.0 };
    let conditions = Conditions::of(water);
    let resolution = Resolution { reaches: 50, duration_s };
    let probes = [Probe::head(rig.length_m()), Probe::flow(0.3 * rig.length_m())];
    let before = COUNT.with(Cell::get);
    let simulated = if with_energy {
        model.simulate_with_energy(&conditions, &shared, &run, resolution, &probes)
    } else {
        model.simulate(&conditions, &shared, &run, resolution, &probes)
    };
    assert!(simulated.unwrap().traces[0].values.len() > 50);
    COUNT.with(Cell::get) - before
}

#[test]
fn stepping_allocates_nothing() {
    let rig = Rig::from_toml(include_str!("../rigs/imperial-pe.toml"), "imperial-pe.toml").unwrap();
    let variants = CATALOGUE.iter().flat_map(|e| std::iter::once(*e).chain(e.variants().iter().copied()));
    let alone = variants.map(|effect| vec![Chosen::of(effect)]);
    for effects in std::iter::once(vec![]).chain(alone) {
        for with_energy in [false, true] {
            let once = allocations(&rig, &effects, 10.0, with_energy);
            let twice = allocations(&rig, &effects, 20.0, with_energy);
            assert!(once > 0, "the allocator counts");
            assert_eq!(once, twice, "{effects:?}, energy {with_energy}");
        }
    }
}
