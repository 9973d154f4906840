//! Where a probe reads between the nodes, and how.

use crate::model::trace::monotone;

/// Where a probe reads.
#[derive(Debug, Clone)]
pub struct Stencil {
    /// Index of its segment.
    pub segment: usize,
    /// The two nodes between which it lies; twice the same where it stands on a node.
    pub around: [usize; 2],
    /// The next node on either side, where the segment has one.
    pub further: [Option<usize>; 2],
    /// How far it lies from the first of the two, in reaches.
    pub part: f64,
}

impl Stencil {
    /// What the probe reads of values at the nodes.
    #[inline(always)]
    pub fn read(&self, of: impl Fn(usize) -> f64) -> f64 {
        let b = of(self.around[0]);
        if self.part == 0.0 {
            return b;
        }
        let c = of(self.around[1]);
        // At an end of the segment the curve goes on as a parabola.
        let four = match self.further {
            [Some(a), Some(d)] => [of(a), b, c, of(d)],
            [Some(a), None] => [of(a), b, c, of(a) + 3.0 * (c - b)],
            [None, Some(d)] => [of(d) - 3.0 * (c - b), b, c, of(d)],
            [None, None] => [2.0 * b - c, b, c, 2.0 * c - b],
        };
        monotone(four, self.part)
    }
}
