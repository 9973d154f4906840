//! Loops compiled twice: for every machine of the architecture, and for those with wider registers, chosen at run time.

/// Defines a function whose loops are also compiled for AVX2 and run so where the processor has it: its own, and those of functions that are
/// always inlined into it.
///
/// The results are the same to the last bit: the wider registers hold more of the same operations, none are fused.
macro_rules! widened {
    ($(#[$doc:meta])* $visibility:vis fn $name:ident($($arg:ident: $of:ty),* $(,)?) $(-> $result:ty)? $body:block) => {
        $(#[$doc])*
        #[allow(clippy::too_many_arguments)] // slices of one segment
        $visibility fn $name($($arg: $of),*) $(-> $result)? {
            #[inline(always)]
            #[allow(clippy::too_many_arguments)]
            fn any($($arg: $of),*) $(-> $result)? $body

            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx2")]
                #[allow(clippy::too_many_arguments)]
                fn with_avx2($($arg: $of),*) $(-> $result)? {
                    any($($arg),*)
                }
                if std::arch::is_x86_feature_detected!("avx2") {
                    // SAFETY: the processor has just said that it has what the function needs.
                    return unsafe { with_avx2($($arg),*) };
                }
            }
            any($($arg),*)
        }
    };
}
pub(crate) use widened;
