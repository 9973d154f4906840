//! A device whose every sample tells its number, and the check of what was recorded of it.

use std::path::Path;

use surgescope::record::devices::simulated::Playback;
use surgescope::record::wire::frames::Frame;
use surgescope::recording::Recording;
use surgescope::rig::Rig;

/// Channels, each with a ramp of another slope over the 16 bits of a count.
pub const CHANNELS: usize = 3;
const SLOPES: [i64; CHANNELS] = [1, 3, -7];

/// Count of a channel at a sample number.
pub fn count(channel: usize, index: i64) -> i16 {
    (SLOPES[channel] * index) as i16
}

/// A rig with the three channels.
pub fn rig_text() -> String {
    let sensor = |channel: usize| {
        format!(
            "[[sensor]]\nname = \"P{channel}\"\nkind = \"pressure\"\nposition_m = 10.0\nunit = \"kPa\"\ndevice = \"daq\"\nchannel = {channel}\n"
        )
    };
    let sensors: String = (0..CHANNELS).map(sensor).collect();
    format!(
        "name = \"ramp\"\n[fluid]\nname = \"water\"\ntemperature_degC = 20.0\n[[pipe]]\nname = \"main\"\nlength_m = 40.0\n\
         inner_diameter_mm = 50.6\nwall_thickness_mm = 6.2\nmaterial = \"HDPE\"\n[upstream]\nkind = \"reservoir\"\n\
         [downstream]\nkind = \"valve\"\nclosing_time_s = 0.1\n{sensors}\
         [[device]]\nname = \"daq\"\nport = \"/dev/none\"\nbaud = 921600\nprotocol = \"frames\"\n"
    )
}

/// The rig.
pub fn rig() -> Result<Rig, surgescope::rig::RigError> {
    Rig::from_toml(&rig_text(), "ramp.toml")
}

/// What a simulated device plays for some seconds.
pub fn playback(rate_hz: f64, seconds: f64) -> Playback {
    let samples = (rate_hz * seconds) as i64;
    let ramp = |channel: usize| (channel, (0..samples).map(|index| f64::from(count(channel, index))).collect());
    Playback { sample_period_ns: period_ns(rate_hz), sensors: (0..CHANNELS).map(ramp).collect() }
}

/// Time from sample to sample, ns.
pub fn period_ns(rate_hz: f64) -> u32 {
    (1e9 / rate_hz) as u32
}

/// Samples of a frame: those of a hundredth of a second.
pub fn samples_a_frame(rate_hz: f64) -> i64 {
    (rate_hz / 100.0).max(1.0) as i64
}

/// The `index`-th frame, of a hundredth of a second or `at_least` samples.
pub fn frame(index: i64, samples: i64, period_ns: u32) -> Option<Frame> {
    let first = index * samples;
    let counts = (first..first + samples).flat_map(|i| (0..CHANNELS).map(move |channel| count(channel, i))).collect();
    let first_us = (i128::from(first) * i128::from(period_ns) / 1000) as u64;
    Frame::new(index as u16, first_us, period_ns, CHANNELS as u8, counts)
}

/// Checks that each channel holds the samples from number 0 on, every one at its time; returns how many there are of
/// each, at least. After a kill channels may differ by `torn` samples: those of the last frame.
pub fn check(recording: &Recording, period_ns: u32, torn: usize) -> Result<usize, String> {
    let mut lengths = Vec::new();
    for (channel, series) in recording.series.iter().enumerate() {
        if let Some(gap) = series.gaps.first() {
            return Err(format!("{} gaps, the first from {} s to {} s", series.gaps.len(), gap.from_s, gap.to_s));
        }
        for (index, (time_s, value)) in series.time_s.iter().zip(&series.value).enumerate() {
            let time_ns = index as f64 * f64::from(period_ns);
            // Device times are whole microseconds.
            if (time_s * 1e9 - time_ns).abs() > 1000.0 || *value != f64::from(count(channel, index as i64)) {
                return Err(format!("channel {channel}, sample {index}: {value} at {time_s} s"));
            }
        }
        lengths.push(series.value.len());
    }
    let (least, most) = (lengths.iter().min().copied().unwrap_or(0), lengths.iter().max().copied().unwrap_or(0));
    if most - least <= torn { Ok(least) } else { Err(format!("channels of different lengths: {lengths:?}")) }
}

/// Reads a finished file and checks it; returns how many samples there are of each channel.
pub fn check_file(path: &Path, period_ns: u32) -> Result<usize, Box<dyn std::error::Error + Send + Sync>> {
    Ok(check(&surgescope::storage::read(path)?, period_ns, 0)?)
}
