//! Whether a search has ended at an optimum, in words.

use crate::fit::problem::method::Method;

/// Why an end is no optimum, from where a step predicts a reduction by this `share` of the sum of squares, and by so
/// much in units of what one independent sample leaves; and what to do.
pub(crate) fn not_at_optimum(share: f64, reduction: f64, method: Method) -> String {
    let share = 100.0 * share.min(1.0);
    let digits = if share < 0.1 { 3 } else { usize::from(share < 10.0) };
    format!(
        "the search did not reach an optimum (a descent from its end would take {share:.digits$}% off the sum of squares, and some values \
         may be off by {:.0} standard errors); {}",
        reduction.sqrt().max(1.0),
        method.advice()
    )
}
