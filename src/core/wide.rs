//! Loops compiled twice: for every machine of the architecture, and for those with wider registers, chosen at run time.

/// Defines a function whose loop is also compiled for AVX2 and runs so where the processor has it.
///
/// The results are the same to the last bit: the wider registers hold more of the same operations, none are fused.
macro_rules! widened {
    ($(#[$doc:meta])* $visibility:vis fn $name:ident $([$type:ident: $bound:path])? ($($arg:ident: $of:ty),* $(,)?) $body:block) => {
        $(#[$doc])*
        #[allow(clippy::too_many_arguments)] // slices of one segment
        $visibility fn $name $(<$type: $bound>)? ($($arg: $of),*) {
            #[inline(always)]
            #[allow(clippy::too_many_arguments)]
            fn any $(<$type: $bound>)? ($($arg: $of),*) $body

            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx2")]
                #[allow(clippy::too_many_arguments)]
                fn with_avx2 $(<$type: $bound>)? ($($arg: $of),*) {
                    any($($arg),*);
                }
                if std::arch::is_x86_feature_detected!("avx2") {
                    // SAFETY: the processor has just said that it has what the function needs.
                    unsafe { with_avx2($($arg),*) };
                    return;
                }
            }
            any($($arg),*);
        }
    };
}
pub(crate) use widened;
