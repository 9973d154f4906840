//! The last seconds of every sensor, out of which a shot takes what came before its trigger fired. Bounded in time, and
//! in bytes.

use std::collections::VecDeque;

use crate::record::clock::device_clock::seconds;
use crate::record::session::shot::Batch;
use crate::recording::Gap;

/// Samples that wait for a trigger's sensor which is behind them take no more memory than this, bytes: 22 s of three
/// sensors at 500 kHz. What the time before a shot needs is kept, whatever it takes.
pub(crate) const MOST_BYTES: usize = 256 << 20;
/// So many batches come between two looks at what is no longer needed.
const FORGET_EVERY: usize = 100;

/// What is still needed of a sensor; times as logged, ns.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Needed {
    /// From here on, for a shot to come.
    pub(crate) from_ns: i64,
    /// Of that, from here on even where the memory is used up.
    pub(crate) surely_ns: i64,
}

/// See the module.
pub(crate) struct Kept {
    /// In the order in which they came.
    batches: VecDeque<Batch>,
    gaps: Vec<(usize, Gap)>,
    /// The last sample of each sensor that was dropped, ns as logged.
    dropped_ns: Vec<Option<i64>>,
    most_bytes: usize,
    /// Batches since it was last looked for what is no longer needed.
    unsifted: usize,
}

impl Kept {
    /// Nothing yet of so many sensors.
    pub(crate) fn new(sensors: usize, most_bytes: usize) -> Kept {
        Kept { batches: VecDeque::new(), gaps: Vec::new(), dropped_ns: vec![None; sensors], most_bytes, unsifted: 0 }
    }

    pub(crate) fn push(&mut self, batch: Batch) {
        self.batches.push_back(batch);
        self.unsifted += 1;
    }

    pub(crate) fn gap(&mut self, sensor: usize, gap: Gap) {
        self.gaps.push((sensor, gap));
    }

    /// What is kept of a sensor.
    pub(crate) fn of(&self, sensor: usize) -> impl DoubleEndedIterator<Item = &Batch> + Clone {
        self.batches.iter().filter(move |batch| batch.sensor == sensor)
    }

    /// Gaps of all sensors.
    pub(crate) fn gaps(&self) -> impl Iterator<Item = (usize, Gap)> + '_ {
        self.gaps.iter().copied()
    }

    /// The last sample of a sensor that is no longer kept, ns as logged.
    pub(crate) fn dropped_ns(&self, sensor: usize) -> Option<i64> {
        self.dropped_ns.get(sensor).copied().flatten()
    }

    /// True once in a while.
    pub(crate) fn is_due(&self) -> bool {
        self.unsifted >= FORGET_EVERY
    }

    /// Drops what is no longer `needed` of each sensor, and the oldest where it is too much; of each sensor its last
    /// batch stays.
    pub(crate) fn forget(&mut self, needed: &[Needed]) {
        self.unsifted = 0;
        let mut last = vec![0; needed.len()];
        for (i, batch) in self.batches.iter().enumerate() {
            last[batch.sensor] = i;
        }
        let is_old = |batch: &Batch| batch.last_ns() < needed[batch.sensor].from_ns;
        let bytes: usize = self.batches.iter().filter(|batch| !is_old(batch)).map(Batch::bytes).sum();
        let mut excess = bytes.saturating_sub(self.most_bytes);
        let mut i = 0;
        let dropped_ns = &mut self.dropped_ns;
        self.batches.retain(|batch| {
            i += 1;
            let too_much = excess > 0 && batch.last_ns() < needed[batch.sensor].surely_ns;
            let stays = last[batch.sensor] + 1 == i || !(is_old(batch) || too_much);
            if !stays {
                dropped_ns[batch.sensor] = dropped_ns[batch.sensor].max(Some(batch.last_ns()));
                if !is_old(batch) {
                    excess = excess.saturating_sub(batch.bytes());
                }
            }
            stays
        });
        self.gaps.retain(|(sensor, gap)| gap.to_s >= seconds(needed[*sensor].from_ns));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;

    /// Batches of two sensors, 1000 samples of 1 ms each, up to so many seconds.
    fn kept(most_bytes: usize, seconds: i64) -> Kept {
        let mut kept = Kept::new(2, most_bytes);
        for k in 0..seconds {
            for sensor in 0..2 {
                let values = vec![k as f64; 1000];
                kept.push(Batch { sensor, first_ns: 1000 * k * MS, period_ns: 1e6, values });
            }
        }
        kept
    }

    /// Seconds at which the batches of a sensor begin.
    fn begins(kept: &Kept, sensor: usize) -> Vec<i64> {
        kept.of(sensor).map(|batch| batch.first_ns / (1000 * MS)).collect()
    }

    fn bytes(kept: &Kept) -> usize {
        kept.batches.iter().map(Batch::bytes).sum()
    }

    #[test]
    fn what_is_too_much_goes_the_oldest_first_and_is_known_to_be_gone() {
        let batch = bytes(&kept(0, 1)) / 2;
        assert!((8000..8200).contains(&batch), "{batch}");
        let mut kept = kept(10 * batch, 30);
        let needed = [Needed { from_ns: 0, surely_ns: 25_000 * MS }, Needed { from_ns: 28_000 * MS, surely_ns: 0 }];
        kept.forget(&needed);
        // 8 of the first sensor and the 2 that are needed of the second
        assert_eq!((begins(&kept, 0), begins(&kept, 1)), ((22..30).collect(), vec![28, 29]));
        assert_eq!((kept.dropped_ns(0), kept.dropped_ns(1)), (Some(21_999 * MS), Some(27_999 * MS)));
        assert_eq!(bytes(&kept), 10 * batch);
    }

    #[test]
    fn what_a_shot_surely_needs_stays_whatever_it_takes() {
        let mut kept = kept(1000, 30);
        kept.forget(&[Needed { from_ns: 0, surely_ns: 5000 * MS }, Needed { from_ns: 0, surely_ns: 40_000 * MS }]);
        assert_eq!((begins(&kept, 0), begins(&kept, 1)), ((5..30).collect(), vec![29]), "and the last of each");
    }
}
