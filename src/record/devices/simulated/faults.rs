//! How a simulated device misbehaves, and what it did.

use std::str::FromStr;

/// Probabilities per frame (line, answer) of one fault each. The first and the last frame go through unharmed, so that
/// the sequence tells of every fault.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Faults {
    /// One bit flips on the wire.
    pub flip: f64,
    /// It is not sent.
    pub drop: f64,
    /// It is sent twice.
    pub duplicate: f64,
    /// A burst of noise comes before it.
    pub noise: f64,
    /// Only its beginning is sent.
    pub cut: f64,
    /// Its check sum is wrong; lines have none.
    pub crc: f64,
    /// Nothing is sent for a third of a second, then everything that waited.
    pub stall: f64,
    /// The device restarts: a fifth of a second is not sent, its clock and its sequence begin anew.
    pub reset: f64,
    /// A Modbus answer comes about when its time-out ends.
    pub late: f64,
    /// The line sends back what is sent on it, as a two-wire adapter does; of slaves that are asked.
    pub echo: bool,
    /// How much faster than this computer's the device's clock runs, millionths.
    pub drift_ppm: f64,
    /// Seed of the dice.
    pub seed: u64,
}

/// One fault of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Fault {
    Flip,
    Drop,
    Duplicate,
    Noise,
    Cut,
    Crc,
    Stall,
    Reset,
    Late,
}

impl Faults {
    fn chances(&self) -> [(Fault, f64); 9] {
        [
            (Fault::Drop, self.drop),
            (Fault::Flip, self.flip),
            (Fault::Duplicate, self.duplicate),
            (Fault::Noise, self.noise),
            (Fault::Cut, self.cut),
            (Fault::Crc, self.crc),
            (Fault::Stall, self.stall),
            (Fault::Reset, self.reset),
            (Fault::Late, self.late),
        ]
    }

    /// A fault among these that only a device that is asked can have.
    pub fn of_asked(&self) -> Option<&'static str> {
        match () {
            () if self.echo => Some("echo"),
            () if self.late > 0.0 => Some("late"),
            () => None,
        }
    }

    /// Throws the dice: at most one fault a frame.
    pub(crate) fn throw(&self, dice: &mut fastrand::Rng) -> Option<Fault> {
        let mut throw = dice.f64();
        self.chances().into_iter().find_map(|(fault, chance)| {
            throw -= chance;
            (throw < 0.0).then_some(fault)
        })
    }
}

impl FromStr for Faults {
    type Err = String;

    /// Reads `flip=0.01,drop=0.02,seed=7`, any of them.
    fn from_str(text: &str) -> Result<Faults, String> {
        let mut faults = Faults::default();
        for part in text.split(',') {
            let (name, value) = part.split_once('=').unwrap_or((part, ""));
            let slot = match name {
                "flip" => &mut faults.flip,
                "drop" => &mut faults.drop,
                "duplicate" => &mut faults.duplicate,
                "noise" => &mut faults.noise,
                "cut" => &mut faults.cut,
                "crc" => &mut faults.crc,
                "stall" => &mut faults.stall,
                "reset" => &mut faults.reset,
                "late" => &mut faults.late,
                "echo" => {
                    faults.echo = value.parse().map_err(|_| format!("'{part}': write echo=true or echo=false"))?;
                    continue;
                }
                "drift_ppm" => {
                    let drift = value.parse().ok().filter(|drift: &f64| drift.abs() <= 1e5);
                    faults.drift_ppm =
                        drift.ok_or_else(|| format!("the drift '{value}' is not a number of ppm within 1e5"))?;
                    continue;
                }
                "seed" => {
                    faults.seed = value.parse().map_err(|_| format!("the seed '{value}' is not a whole number"))?;
                    continue;
                }
                _ => {
                    let known = "flip, drop, duplicate, noise, cut, crc, stall, reset, late, echo, drift_ppm and seed";
                    return Err(format!("unknown fault '{name}'; known are {known}"));
                }
            };
            *slot = value
                .parse()
                .ok()
                .filter(|p| (0.0..=1.0).contains(p))
                .ok_or_else(|| format!("'{part}' needs a probability per frame from 0 to 1, as in {name}=0.01"))?;
        }
        Ok(faults)
    }
}

/// What a simulated device did. Frames are lines or answers where it sends those.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Sent {
    /// Frames made, whatever became of them.
    pub frames: u64,
    /// Frames with a flipped bit.
    pub flipped: u64,
    /// Frames not sent.
    pub dropped: u64,
    /// Frames sent twice.
    pub duplicated: u64,
    /// Frames with noise before them; those frames are lost in it.
    pub noisy: u64,
    /// Frames cut off.
    pub cut: u64,
    /// Frames with a wrong check sum.
    pub wrong_crc: u64,
    /// Pieces between frame ends that the harmed ones became: a flip can make an end, which splits a frame.
    pub bad_pieces: u64,
    /// Times when nothing was sent for a while.
    pub stalls: u64,
    /// Restarts.
    pub resets: u64,
    /// Frames not sent during restarts.
    pub reset_frames: u64,
    /// Answers held back.
    pub late: u64,
}

impl Sent {
    /// Frames that cannot have arrived whole, but for those of restarts.
    pub fn harmed(&self) -> u64 {
        self.flipped + self.dropped + self.noisy + self.cut + self.wrong_crc
    }
}

/// Bytes of noise, without a frame's or a line's end.
pub(crate) fn noise(dice: &mut fastrand::Rng) -> Vec<u8> {
    (0..dice.usize(1..40)).map(|_| dice.u8(b'\n' + 1..)).collect()
}

/// A byte before the last one, the frame's end.
pub(crate) fn place(bytes: &[u8], dice: &mut fastrand::Rng) -> usize {
    dice.usize(..bytes.len().saturating_sub(1).max(1))
}
