//! Cells over the radius of a pipe, thin at its wall.

/// Growth of the rings with the distance from the wall.
const GROWTH: f64 = 0.15;
/// Thickness of the rings in the core, a part of the radius.
pub(crate) const CORE: f64 = 0.07;

/// Edges of cells from the wall (0) to the axis (1): `first` thick at the wall, growing with the distance from it up to
/// a thickness in the core; all of it `finer` times as fine.
pub(crate) fn cells(first: f64, finer: f64) -> Vec<f64> {
    // Number of cells up to a distance, where 1/thickness = 1/(first + growth y) + 1/core.
    let number = |y: f64| finer * ((GROWTH * y / first).ln_1p() / GROWTH + y / CORE);
    let count = number(1.0).ceil().max(2.0);
    let edge = |i: usize| {
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..80 {
            let y = 0.5 * (low + high);
            *(if number(y) * count > number(1.0) * i as f64 { &mut high } else { &mut low }) = y;
        }
        0.5 * (low + high)
    };
    let count = count as usize;
    (0..=count)
        .map(|i| {
            if i == 0 {
                0.0
            } else if i == count {
                1.0
            } else {
                edge(i)
            }
        })
        .collect()
}
