//! What a simulated device plays, as its converter sees it.

use crate::record::error::RecordError;
use crate::record::wire::registers::{Place, value, words};
use crate::rig::{Device, Protocol, Rig, TimeUnit, Wiring};

/// Data to play on a device.
#[derive(Debug, Clone, PartialEq)]
pub struct Playback {
    /// Time between samples, ns.
    pub sample_period_ns: u32,
    /// Samples of each sensor wired to the device, in its unit, by the sensor's index in the rig; all of the same
    /// length.
    pub sensors: Vec<(usize, Vec<f64>)>,
}

/// A playback in the numbers of the device.
#[derive(Debug, Clone, PartialEq)]
pub struct Script {
    pub(crate) period_ns: u32,
    pub(crate) rows: usize,
    pub(crate) form: Form,
    /// Samples outside the converter's range, which it holds at its limits.
    pub clipped: u64,
}

/// The numbers by protocol.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Form {
    /// Counts, interleaved by channel.
    Frames { channels: u8, interleaved: Vec<i16> },
    /// Columns of numbers to print.
    Lines { columns: Vec<Vec<f64>>, time_unit: TimeUnit },
    /// Numbers in registers.
    Registers { unit: u8, timeout_s: f64, values: Vec<(Place, Vec<f64>)> },
}

impl Script {
    /// Turns samples into the device's numbers, by the inverse of each sensor's scale and offset; a channel without a
    /// sensor is 0.
    pub fn new(playback: &Playback, rig: &Rig, device: &Device) -> Result<Script, RecordError> {
        let refuse = |reason: &str| Err(RecordError::Playback(reason.to_owned()));
        let rows = playback.sensors.first().map_or(0, |(_, samples)| samples.len());
        if rows == 0 || playback.sample_period_ns == 0 {
            return refuse("it has no samples, or no time between them");
        }
        let mut raw: Vec<(&Wiring, Vec<f64>)> = Vec::new();
        for (sensor, samples) in &playback.sensors {
            let wiring = rig.sensors.get(*sensor).and_then(|sensor| sensor.wiring.as_ref());
            let Some(wiring) = wiring.filter(|wiring| wiring.device == device.name) else {
                return refuse("it has samples of a sensor that is not wired to the device");
            };
            if samples.len() != rows {
                return refuse("its channels differ in length");
            }
            let numbers: Vec<f64> = samples.iter().map(|value| (value - wiring.offset) / wiring.scale).collect();
            if numbers.iter().any(|number| !number.is_finite()) {
                return refuse("it has a value that is not a finite number of counts");
            }
            raw.push((wiring, numbers));
        }
        let columns = raw.iter().map(|(wiring, _)| usize::from(wiring.channel) + 1).max().unwrap_or(0);
        let mut clipped = 0;
        let form = match device.protocol {
            Protocol::Frames => {
                let Ok(channels) = u8::try_from(columns) else { return refuse("it has more than 255 channels") };
                let mut interleaved = vec![0; rows * columns];
                for (wiring, numbers) in &raw {
                    let slots = interleaved.iter_mut().skip(wiring.channel.into()).step_by(columns);
                    for (number, slot) in numbers.iter().zip(slots) {
                        *slot = number.round() as i16;
                        clipped += u64::from(f64::from(*slot) != number.round());
                    }
                }
                Form::Frames { channels, interleaved }
            }
            Protocol::Lines { time_unit } => {
                let mut printed = vec![vec![0.0; rows]; columns];
                raw.into_iter().for_each(|(wiring, numbers)| printed[usize::from(wiring.channel)] = numbers);
                Form::Lines { columns: printed, time_unit }
            }
            Protocol::ModbusRtu { unit_id, timeout_s, .. } => {
                let mut values = Vec::new();
                for (wiring, numbers) in raw {
                    let Some(register) = wiring.register else { return refuse("a sensor has no register") };
                    let place = Place { address: wiring.channel, register };
                    let held = |number: &f64| value(&place, place.address, &words(&register, *number));
                    clipped += numbers
                        .iter()
                        .filter(|n| held(n).is_none_or(|held| (held - *n).abs() > 1.0 + n.abs() * 1e-6))
                        .count() as u64;
                    values.push((place, numbers));
                }
                Form::Registers { unit: unit_id, timeout_s, values }
            }
        };
        Ok(Script { period_ns: playback.sample_period_ns, rows, form, clipped })
    }
}
