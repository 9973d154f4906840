//! Runs of one rig at several temperatures: each fitted by itself, with trends, and all together under laws of the
//! temperature.
//!
//! Apart, every run has its own wave speed and creep; a weighted line through the values shows how they depend on
//! temperature. Together, the compliances J_k are shared, the retardation times shift by one factor,
//! `tau_k(T) = a_T tau_k(T0)`, and the wall's modulus follows a law of its own; the water's bulk modulus and density at
//! each temperature determine the rest of the wave speed. Comparing the two fits shows whether the laws describe the
//! runs.

pub mod apart;
pub(crate) mod compare;
pub mod family;
pub(crate) mod joint;
pub mod law;
pub mod member;
pub(crate) mod start;
pub(crate) mod thresholds;
pub mod trend;

pub use crate::temperature::compare::{Comparison, Verdict, chance};
pub use crate::temperature::family::{Family, Plan, family, same_rig};
pub use crate::temperature::joint::Together;
pub use crate::temperature::joint::summary::{LawParameter, RunError};
pub use crate::temperature::member::{FamilyError, Member, Source};
