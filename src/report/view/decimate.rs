//! Fewer points, every peak kept: of each stretch of samples the smallest and the largest value of every curve survive.

/// Indices to keep, ascending, of curves that share one axis of `len` samples.
///
/// The axis is cut into `buckets` stretches of equal numbers of samples; in each, the first minimum and the first
/// maximum of every curve are kept, and the first sample that is not a number, so that gaps stay gaps. First and last
/// sample are always kept. With no more than two samples a bucket everything is kept.
pub fn keep(curves: &[&[f64]], len: usize, buckets: usize) -> Vec<usize> {
    if buckets == 0 || len <= 2 * buckets {
        return (0..len).collect();
    }
    let mut kept = vec![0, len - 1];
    for bucket in 0..buckets {
        let range = bucket * len / buckets..(bucket + 1) * len / buckets;
        for curve in curves {
            extremes(curve, range.clone(), &mut kept);
        }
    }
    kept.sort_unstable();
    kept.dedup();
    kept
}

fn extremes(curve: &[f64], range: std::ops::Range<usize>, kept: &mut Vec<usize>) {
    let (mut low, mut high, mut gap) = (None, None, None);
    for i in range {
        let Some(&v) = curve.get(i) else { break };
        if !v.is_finite() {
            gap = gap.or(Some(i));
            continue;
        }
        if low.is_none_or(|(_, l)| v < l) {
            low = Some((i, v));
        }
        if high.is_none_or(|(_, h)| v > h) {
            high = Some((i, v));
        }
    }
    kept.extend(low.map(|(i, _)| i));
    kept.extend(high.map(|(i, _)| i));
    kept.extend(gap);
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn range_of(values: impl Iterator<Item = f64>) -> (f64, f64) {
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)))
    }

    proptest! {
        #[test]
        fn every_bucket_keeps_the_extrema_of_every_curve(
            pairs in prop::collection::vec((-1e3..1e3f64, -1e3..1e3f64), 1..600),
            buckets in 1usize..60,
        ) {
            let (a, b): (Vec<f64>, Vec<f64>) = pairs.into_iter().unzip();
            let kept = keep(&[&a, &b], a.len(), buckets);
            prop_assert!(kept.windows(2).all(|w| w[0] < w[1]));
            prop_assert_eq!(kept.first(), Some(&0));
            prop_assert_eq!(kept.last(), Some(&(a.len() - 1)));
            prop_assert!(kept.len() <= a.len() && kept.len() <= (4 * buckets + 2).max(2 * buckets));
            for curve in [&a, &b] {
                for bucket in 0..buckets {
                    let range = bucket * a.len() / buckets..(bucket + 1) * a.len() / buckets;
                    let all = range_of(range.clone().map(|i| curve[i]));
                    let left = range_of(kept.iter().filter(|i| range.contains(i)).map(|&i| curve[i]));
                    prop_assert_eq!(all, left);
                }
            }
        }
    }

    #[test]
    fn a_single_spike_in_a_long_record_survives() {
        let mut curve = vec![0.0; 100_000];
        curve[54_321] = 1.0;
        assert!(keep(&[&curve], curve.len(), 1000).contains(&54_321));
    }

    #[test]
    fn gaps_and_empty_curves_do_no_harm() {
        assert!(keep(&[], 0, 10).is_empty());
        assert!(keep(&[&[]], 0, 0).is_empty());
        let mut curve = vec![1.0; 1000];
        curve[500..520].fill(f64::NAN);
        assert!(keep(&[&curve], 1000, 100).iter().any(|&i| curve[i].is_nan()));
        assert!(!keep(&[&[f64::NAN; 50]], 50, 5).is_empty());
    }
}
