//! The least and the greatest of some values.

use std::borrow::Borrow;

/// The least and the greatest value that is a number; of none of them, infinity and minus infinity.
pub fn ends<V: Borrow<f64>>(values: impl IntoIterator<Item = V>) -> (f64, f64) {
    let none = (f64::INFINITY, f64::NEG_INFINITY);
    values.into_iter().fold(none, |(low, high), v| (low.min(*v.borrow()), high.max(*v.borrow())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_number_is_no_end() {
        assert_eq!(ends([2.0, f64::NAN, -1.0]), (-1.0, 2.0));
        let one = vec![3.0];
        assert_eq!(ends(&one), (3.0, 3.0));
        assert_eq!(ends::<f64>([]), (f64::INFINITY, f64::NEG_INFINITY));
    }
}
