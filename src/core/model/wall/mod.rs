//! Stress waves in the walls of pipes in series that may move along their axis, and how they meet the water.
//!
//! Water and wall obey four equations (Skalak 1956; Tijsseling 1996, J. Fluids Struct. 10:109-146):
//!
//! ```text
//! dV/dt + g dH/dx = 0                  dH/dt + (c²/g) dV/dx = 2ν (c²/g) du/dx
//! du/dt - g r ds/dx = 0                g r ds/dt - ct² du/dx = g r ν (D/2e) dH/dt
//! ```
//!
//! `u` is the wall's velocity, `s` its axial stress as a head of water (`σ = ρ g s`), `r = ρ/ρ_wall`, `ct` the speed of
//! stress waves in a bar of the wall, `c` that of pressure waves in a wall which nothing moves. In a uniform pipe they
//! are two pairs of waves that do not see each other ([`modes`]). The line's own scheme carries the pressure waves. The
//! stress waves need no grid: they are delayed from one end of their pipe to the other (`ways`).
//!
//! At an end of the line two laws, of the water and of the wall, send both pairs back (`end`). At a joint of two pipes
//! four laws do (`joint`): head and relative flow `A (V - u)` are continuous, as are the wall's velocity and the axial
//! force. They change the characteristic that reaches the node there, and nothing else of it. A joint has to lie on a
//! node: each pipe is a run of reaches of its own ([`grid`](crate::model::grid)).
//!
//! What acts along a pipe (friction, creep, gas, an element at a place) acts on pressure waves alone. Dry friction on
//! what the pipes lie on acts on both (`floor`).

pub(crate) mod end;
pub(crate) mod floor;
pub(crate) mod joint;
pub mod modes;
pub mod waves;
pub(crate) mod ways;
