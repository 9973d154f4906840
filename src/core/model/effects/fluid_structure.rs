//! Pipes that move along their axis: stress waves in their walls, Poisson's contraction, and a valve that the water
//! pushes.

use crate::model::effect::{Effect, check};
use crate::model::error::ModelError;
use crate::model::parameter::Parameter;
use crate::model::scene::{Scene, Site};
use crate::model::steady::Steady;
use crate::model::wall::end::Hold;
use crate::model::wall::modes::Wall;
use crate::model::wall::waves::{LEAST_STEPS, LEAST_STEPS_ON_FLOOR, WallWaves};
use crate::rig::{Constraint, Pipe, Rig};
use crate::units::GRAVITY_M_S2;

/// See [`wall`](crate::model::wall) for the equations.
///
/// The supply's end is free where the rig file says `constraint = "free"` of the pipe there, and anchored elsewhere.
/// Joints of pipes are free to move.
///
/// Poisson's ratio and the speed of stress waves are those of the pipe at the valve. Other pipes have them in the ratio
/// of the rig file's values: of its Poisson's ratios, and of the typical moduli and densities of its materials.
pub struct FluidStructure;

/// The same with dry friction of the valve's support.
pub struct DryFriction;

/// The same with dry friction all along the pipe.
pub struct Floor;

/// What rubs: head whose push just overcomes it, m.
#[derive(Clone, Copy, Default)]
struct Dry {
    /// At the valve's support.
    valve_m: f64,
    /// All along the pipe.
    floor_m: f64,
}

const NAME: &str = "fluid-structure";
const DRY: &str = "fluid-structure/dry";
const FLOOR: &str = "fluid-structure/floor";
/// Coefficient of dry friction of a pipe that lies on a floor, about.
const USUAL_FRICTION: f64 = 0.3;
const WHY: &str = "both move the valve";
const TWICE: &str = "both describe the same wall, which would count twice";

impl Effect for FluidStructure {
    fn name(&self) -> &'static str {
        NAME
    }
    fn summary(&self) -> &'static str {
        "a wall that moves along the pipe: stress waves, Poisson's contraction, the valve on a spring (or /dry: with dry friction)"
    }
    fn equation(&self) -> &'static str {
        "dV/dt + g dH/dx = 0,  dH/dt + (c²/g) dV/dx = 2ν (c²/g) du/dx;\n\
         ρ_w du/dt = ds/dx,  ds/dt = E du/dx + ν (D/2e) ρg dH/dt;  at the valve V - u = V_valve, A_w s + k ∫u dt = A ρg H;\n\
         at a joint of two pipes H, u, A (V - u) and A_w s - A ρg H are continuous"
    }
    fn source(&self) -> &'static str {
        "Skalak (1956), Trans. ASME 78:105-116; Tijsseling (1996), J. Fluids Struct. 10:109-146, and (2003), 18:179-196; in a thin wall, \
         and both pairs of waves each on its own"
    }
    fn trace(&self) -> &'static str {
        "small steps ahead of each front, at the speed of sound in the wall; ripples of the wall's own period on plateaus, and a first rise \
         that is lower and then beats"
    }
    fn variants(&self) -> &'static [&'static dyn Effect] {
        &[&DryFriction, &Floor]
    }
    fn excludes(&self) -> &'static [(&'static str, &'static str)] {
        &[(DRY, TWICE), (FLOOR, TWICE), ("moving-valve", WHY)]
    }
    fn impossible(&self, rig: &Rig) -> Option<&'static str> {
        (rig.graph.lines.len() > 1).then_some("it is written for pipes in series")
    }
    fn least_steps(&self, values: &[f64], rig: &Rig, pipe: &Pipe, wave_speed_m_s: f64) -> f64 {
        LEAST_STEPS * stress_speed_m_s(rig, pipe, values[1]) / wave_speed_m_s
    }
    fn parameters(&self, site: &Site, _elements: usize) -> Vec<Parameter> {
        let pipe = site.rig.pipe_at_valve();
        let material = pipe.material();
        let [low, high] = material.youngs_modulus_range_pa.map(|pa| bar_speed_m_s(pipe, pa));
        let yields = |pipe: &Pipe| pipe.length_m / pipe.wave_speed_start(site.water).0.powi(2);
        let whole_mm_per_m = 1e3 * GRAVITY_M_S2 * site.rig.way_pipes().map(yields).sum::<f64>();
        // No pipe's ratio goes beyond a half.
        let most = site.rig.way_pipes().map(Pipe::poisson_ratio).fold(0.0, f64::max);
        vec![
            Parameter::linear(
                "wall_poisson_ratio",
                "1",
                "Poisson's ratio of the wall of the pipe at the valve",
                pipe.poisson_ratio(),
                0.0,
                0.5 * (pipe.poisson_ratio() / most),
            )
            .vanishing_at(0.0),
            Parameter::log(
                "stress_wave_speed_m_s",
                "m/s",
                "speed of stress waves along a bar of that wall's material",
                bar_speed_m_s(pipe, material.youngs_modulus_pa),
                low,
                high,
            ),
            Parameter::log(
                "valve_give_mm_per_m",
                "mm/m",
                "how far a steady head would move the valve's support alone",
                1e-2 * whole_mm_per_m,
                1e-6 * whole_mm_per_m,
                1e3 * whole_mm_per_m,
            )
            .vanishing_at(0.0),
        ]
    }
    fn other_starts(&self, _elements: usize) -> Vec<Vec<f64>> {
        vec![vec![1.0, 1.0, 0.01], vec![1.0, 1.0, 100.0]]
    }
    fn wall_waves(&self, values: &[f64], scene: &Scene, steady: &Steady) -> Result<Option<WallWaves>, ModelError> {
        wall_waves(self.name(), values, Dry::default(), scene, steady)
    }
}

/// Speed of stress waves along a bar of a pipe's material, where its modulus is this.
fn bar_speed_m_s(pipe: &Pipe, modulus_pa: f64) -> f64 {
    (modulus_pa / pipe.material().density_kg_m3).sqrt()
}

/// Speed of stress waves in a pipe where that in the one at the valve is `at_valve_m_s`.
fn stress_speed_m_s(rig: &Rig, pipe: &Pipe, at_valve_m_s: f64) -> f64 {
    let typical_m_s = |pipe: &Pipe| bar_speed_m_s(pipe, pipe.material().youngs_modulus_pa);
    at_valve_m_s * (typical_m_s(pipe) / typical_m_s(rig.pipe_at_valve()))
}

/// Section of water as heavy as a pipe full of it, m².
fn heavy_m2(pipe: &Pipe, density_kg_m3: f64) -> f64 {
    let wall_over_water =
        4.0 * pipe.wall_thickness_m / pipe.inner_diameter_m * pipe.material().density_kg_m3 / density_kg_m3;
    pipe.area_m2() * (1.0 + wall_over_water)
}

/// The walls of all forms, by their first three values and what rubs.
fn wall_waves(
    effect: &str,
    values: &[f64],
    Dry { valve_m: dry_m, floor_m }: Dry,
    scene: &Scene,
    steady: &Steady,
) -> Result<Option<WallWaves>, ModelError> {
    let (poisson_ratio, at_valve_m_s, give_mm_per_m) = (values[0], values[1], values[2]);
    let (rig, graph) = (scene.rig, &scene.rig.graph);
    if graph.lines.len() > 1 {
        return Err(ModelError::OneLine { effect: effect.to_owned() });
    }
    let (pipes, last) = (&rig.pipes, rig.pipe_at_valve());
    let ratio_of = |pipe: &Pipe| poisson_ratio * (pipe.poisson_ratio() / last.poisson_ratio());
    let possible = pipes.iter().all(|pipe| (0.0..=0.5).contains(&ratio_of(pipe)));
    check("wall_poisson_ratio", poisson_ratio, possible, "from 0 to 0.5 in every pipe")?;
    check("stress_wave_speed_m_s", at_valve_m_s, at_valve_m_s > 0.0, "more than zero")?;
    check("valve_give_mm_per_m", give_mm_per_m, give_mm_per_m >= 0.0, "zero or more")?;
    check("dry_friction_m", dry_m, dry_m >= 0.0, "zero or more")?;
    check("floor_friction_m", floor_m, floor_m >= 0.0, "zero or more")?;
    if poisson_ratio == 0.0 && give_mm_per_m == 0.0 {
        return Ok(None);
    }
    // The floor's friction goes with the weight of what lies on it.
    let weight = |pipe: &Pipe| pipe.length_m * heavy_m2(pipe, steady.density_kg_m3);
    let whole: f64 = pipes.iter().map(weight).sum();
    let wall = |pipe: &Pipe| Wall {
        poisson_ratio: ratio_of(pipe),
        stress_speed_m_s: stress_speed_m_s(rig, pipe, at_valve_m_s),
        density_ratio: steady.density_kg_m3 / pipe.material().density_kg_m3,
        wall_ratio: pipe.inner_diameter_m / pipe.wall_thickness_m,
        area_m2: pipe.area_m2(),
        length_m: pipe.length_m,
        floor_m: floor_m * (last.area_m2() / pipe.area_m2()) * (weight(pipe) / whole),
    };
    let walls: Vec<Wall> = pipes.iter().map(wall).collect();
    let supply = if pipes[0].constraint == Constraint::Free { Hold::Open } else { Hold::Anchored };
    let valve = Hold::Valve { give: 1e-3 * give_mm_per_m, dry_m };
    WallWaves::new(&walls, [(graph.supply(), supply), (graph.valve, valve)], steady).map(Some)
}

impl Effect for DryFriction {
    fn name(&self) -> &'static str {
        DRY
    }
    fn summary(&self) -> &'static str {
        "a wall that moves along the pipe, its valve on a spring with dry friction"
    }
    fn equation(&self) -> &'static str {
        "as fluid-structure, with A_w s + k ∫u dt + F sign(u) = A ρg H at the valve while it slides; it sticks where abs(A ρg H - A_w s - k ∫u \
         dt) < F, F = A ρg h_dry"
    }
    fn source(&self) -> &'static str {
        "Coulomb; Ferràs, Manso, Schleiss & Covas (2016), J. Hydraul. Eng. 142: a straight copper pipe; here at the valve's support alone"
    }
    fn trace(&self) -> &'static str {
        "as fluid-structure for high waves; none of the valve's motion once they are low"
    }
    fn extends(&self) -> Option<&'static dyn Effect> {
        Some(&FluidStructure)
    }
    fn excludes(&self) -> &'static [(&'static str, &'static str)] {
        &[(NAME, TWICE), (FLOOR, TWICE), ("moving-valve", WHY)]
    }
    fn impossible(&self, rig: &Rig) -> Option<&'static str> {
        FluidStructure.impossible(rig)
    }
    fn least_steps(&self, values: &[f64], rig: &Rig, pipe: &Pipe, wave_speed_m_s: f64) -> f64 {
        FluidStructure.least_steps(values, rig, pipe, wave_speed_m_s)
    }
    fn parameters(&self, site: &Site, elements: usize) -> Vec<Parameter> {
        let mut parameters = FluidStructure.parameters(site, elements);
        parameters.push(Parameter::log(
            "dry_friction_m",
            "m",
            "head whose push on the valve just moves it",
            1.0,
            1e-3,
            1e3,
        ));
        parameters
    }
    fn wall_waves(&self, values: &[f64], scene: &Scene, steady: &Steady) -> Result<Option<WallWaves>, ModelError> {
        wall_waves(self.name(), values, Dry { valve_m: values[3], ..Dry::default() }, scene, steady)
    }
}

impl Effect for Floor {
    fn name(&self) -> &'static str {
        FLOOR
    }
    fn summary(&self) -> &'static str {
        "a wall that moves along the pipe, with dry friction on what it lies on"
    }
    fn equation(&self) -> &'static str {
        "as fluid-structure, with ρ_w du/dt = ds/dx - (F/A_w L) sign(u) while the wall slides; it sticks where less than that is enough; \
         F = A ρg h_floor"
    }
    fn source(&self) -> &'static str {
        "Coulomb; Ferràs, Manso, Schleiss & Covas (2016), J. Hydraul. Eng. 142: a straight copper pipe"
    }
    fn trace(&self) -> &'static str {
        "as fluid-structure for high waves; a wall that stands still, and no ripples, once they are low"
    }
    fn excludes(&self) -> &'static [(&'static str, &'static str)] {
        &[(NAME, TWICE), (DRY, TWICE), ("moving-valve", WHY)]
    }
    fn extends(&self) -> Option<&'static dyn Effect> {
        Some(&FluidStructure)
    }
    /// Nobody has measured yet how well a diagnosis tells it from the other forms.
    fn searched(&self) -> bool {
        false
    }
    fn impossible(&self, rig: &Rig) -> Option<&'static str> {
        FluidStructure.impossible(rig)
    }
    fn least_steps(&self, values: &[f64], rig: &Rig, pipe: &Pipe, wave_speed_m_s: f64) -> f64 {
        LEAST_STEPS_ON_FLOOR * stress_speed_m_s(rig, pipe, values[1]) / wave_speed_m_s
    }
    fn parameters(&self, site: &Site, elements: usize) -> Vec<Parameter> {
        let weight = |pipe: &Pipe| pipe.length_m * heavy_m2(pipe, site.water.density_kg_m3);
        let whole_m3 = site.rig.way_pipes().map(weight).sum::<f64>();
        let whole_m = USUAL_FRICTION * whole_m3 / site.rig.pipe_at_valve().area_m2();
        let mut parameters = FluidStructure.parameters(site, elements);
        parameters.push(Parameter::log(
            "floor_friction_m",
            "m",
            "head whose push on the valve the friction all along the pipes just holds",
            whole_m,
            1e-4 * whole_m,
            1e1 * whole_m,
        ));
        parameters
    }
    fn wall_waves(&self, values: &[f64], scene: &Scene, steady: &Steady) -> Result<Option<WallWaves>, ModelError> {
        wall_waves(self.name(), values, Dry { floor_m: values[3], ..Dry::default() }, scene, steady)
    }
}
