//! Loops compiled several times: for every machine of the architecture, and for those with wider registers, chosen at
//! run time.

/// From this many elements on the widest registers pay: shorter loops lose more to what does not fill one at their
/// ends.
pub(crate) const MANY: usize = 128;

/// Whether the processor has AVX-512, with what compilers take for granted beside it.
#[cfg(target_arch = "x86_64")]
pub(crate) fn has_avx512() -> bool {
    use std::arch::is_x86_feature_detected as has;
    has!("avx512f") && has!("avx512bw") && has!("avx512cd") && has!("avx512dq") && has!("avx512vl")
}

/// Defines a function whose loops are also compiled for AVX2 and run so where the processor has it: its own, and those
/// of functions that are always inlined into it. With `over COUNT`, the elements of its loops, also for AVX-512, which
/// runs from [`MANY`] elements on.
///
/// The results are the same to the last bit: the wider registers hold more of the same operations, none are fused.
macro_rules! widened {
    (
        $(#[$doc:meta])*
        over $count:expr;
        $visibility:vis fn $name:ident($($arg:ident: $of:ty),* $(,)?) $(-> $result:ty)? $body:block
    ) => {
        $(#[$doc])*
        #[allow(clippy::too_many_arguments)] // slices of one segment
        $visibility fn $name($($arg: $of),*) $(-> $result)? {
            #[inline(always)]
            #[allow(clippy::too_many_arguments)]
            fn any($($arg: $of),*) $(-> $result)? $body

            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx512f,avx512bw,avx512cd,avx512dq,avx512vl")]
                #[allow(clippy::too_many_arguments)]
                fn with_avx512($($arg: $of),*) $(-> $result)? {
                    any($($arg),*)
                }
                #[target_feature(enable = "avx2")]
                #[allow(clippy::too_many_arguments)]
                fn with_avx2($($arg: $of),*) $(-> $result)? {
                    any($($arg),*)
                }
                if $count >= $crate::wide::MANY && $crate::wide::has_avx512() {
                    // SAFETY: the processor has just said that it has what the function needs.
                    return unsafe { with_avx512($($arg),*) };
                }
                if std::arch::is_x86_feature_detected!("avx2") {
                    // SAFETY: as above.
                    return unsafe { with_avx2($($arg),*) };
                }
            }
            any($($arg),*)
        }
    };
    (
        $(#[$doc:meta])*
        $visibility:vis fn $name:ident($($arg:ident: $of:ty),* $(,)?) $(-> $result:ty)? $body:block
    ) => {
        $crate::wide::widened! { $(#[$doc])* over 0; $visibility fn $name($($arg: $of),*) $(-> $result)? $body }
    };
}
pub(crate) use widened;

#[cfg(test)]
mod tests {
    use super::MANY;

    widened! {
        over of.len();
        fn curved(of: &[f64], by: f64, out: &mut [f64]) {
            for i in 0..of.len().min(out.len()) {
                out[i] = of[i] * by - by / (1.0 + of[i] * of[i]).sqrt();
            }
        }
    }

    /// Whatever registers a loop of this length takes, each element is what it is alone.
    #[test]
    fn every_width_gives_the_same_bits() {
        for count in [1, 7, MANY - 1, MANY, 3 * MANY + 5] {
            let of: Vec<f64> = (0..count).map(|i| (0.37 * i as f64).sin()).collect();
            let mut out = vec![0.0; count];
            curved(&of, 0.7, &mut out);
            for (i, found) in out.iter().enumerate() {
                let mut alone = [0.0];
                curved(&of[i..=i], 0.7, &mut alone);
                assert_eq!(found.to_bits(), alone[0].to_bits(), "{i} of {count}");
            }
        }
    }
}
