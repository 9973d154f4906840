//! Which branches an input takes, by the counters that LLVM's SanitizerCoverage puts into code built by
//! `tools/fuzz/run`.

use std::sync::Mutex;

/// Start address and length of each module's counters.
static COUNTERS: Mutex<Vec<(usize, usize)>> = Mutex::new(Vec::new());

/// Called by each instrumented module before `main`, as SanitizerCoverage documents it; never called in other builds.
#[unsafe(no_mangle)]
pub extern "C" fn __sanitizer_cov_8bit_counters_init(start: *mut u8, stop: *mut u8) {
    if let Ok(mut counters) = COUNTERS.lock() {
        counters.push((start as usize, stop as usize - start as usize));
    }
}

fn each_counter(mut work: impl FnMut(usize, &mut u8)) {
    let Ok(counters) = COUNTERS.lock() else { return };
    let mut first = 0;
    for &(start, length) in counters.iter() {
        // SAFETY: LLVM hands over the bounds of a static array of bytes; no other thread runs.
        let bytes = unsafe { std::slice::from_raw_parts_mut(start as *mut u8, length) };
        for (i, byte) in bytes.iter_mut().enumerate().filter(|(_, byte)| **byte != 0) {
            work(first + i, byte);
        }
        first += length;
    }
}

/// Forgets the input before.
pub fn reset() {
    each_counter(|_, byte| *byte = 0);
}

/// Branches and roughly how often they were taken, over all inputs.
#[derive(Default)]
pub struct Seen {
    classes: Vec<u8>,
}

impl Seen {
    /// Takes in the last input's counters: did it take a branch, or take it more often, than any before?
    pub fn anything_new(&mut self) -> bool {
        let mut new = false;
        each_counter(|i, byte| {
            if self.classes.len() <= i {
                self.classes.resize(i + 1, 0);
            }
            // classes of counts as AFL has them: 1, 2, 3, 4 to 7, …
            let class = 1u8 << (8 - byte.leading_zeros()).min(7);
            new |= self.classes[i] & class == 0;
            self.classes[i] |= class;
        });
        new
    }

    /// Number of branches taken so far.
    pub fn branches(&self) -> usize {
        self.classes.iter().filter(|c| **c != 0).count()
    }
}
