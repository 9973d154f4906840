//! Live recording in a rig file: devices and the wiring of sensors to their channels.

use std::collections::HashMap;

use crate::rig::device::{
    Command, Device, Encoding, Framing, Parity, Port, Protocol, Register, Serial, TimeUnit, Wiring,
};
use crate::rig::table::{FINITE, NOT_ZERO, POSITIVE, Section, nearest};
use crate::rig::unique::Names;

pub(crate) const DEVICE_KEYS: &[&str] = &[
    "name",
    "port",
    "command",
    "baud",
    "data_bits",
    "parity",
    "stop_bits",
    "protocol",
    "unit_id",
    "poll_interval_s",
    "timeout_s",
    "time_unit",
];
/// Keys of `[[device]]` for serial ports only.
const SERIAL: [&str; 4] = ["baud", "data_bits", "parity", "stop_bits"];
/// Keys of `[[device]]` for `modbus-rtu` only.
const MODBUS_DEVICE: [&str; 3] = ["unit_id", "poll_interval_s", "timeout_s"];
/// Keys of `[[sensor]]` for `modbus-rtu` only.
const MODBUS_SENSOR: [&str; 3] = ["register_kind", "encoding", "word_order"];
/// The frame header counts channels in one byte.
const MAX_CHANNEL: u64 = 254;

#[derive(Clone, Copy, PartialEq)]
enum Speaks {
    Frames,
    Lines,
    Modbus,
}

/// The devices of a file by name (empty if the name is faulty); `None` for a faulty device, so that its sensors are not
/// reported as well.
pub(crate) fn read_devices(sections: &[Section<'_>]) -> Vec<(String, Option<Device>)> {
    let mut names = Names::new("device");
    let named = |section: &Section<'_>| {
        let device = read_device(section, &mut names);
        (section.peek_text("name").unwrap_or_default().to_owned(), device)
    };
    sections.iter().map(named).collect()
}

fn read_device(section: &Section<'_>, names: &mut Names) -> Option<Device> {
    let name = section.required_text("name", "the device's name");
    names.check(section, name.as_ref());
    let speaks = [("frames", Speaks::Frames), ("lines", Speaks::Lines), ("modbus-rtu", Speaks::Modbus)];
    let speaks = section.required_choice("protocol", &speaks).map(|s| s.value);
    let port = read_port(section, speaks);
    let unit_id = section.integer("unit_id", 1, 247).unwrap_or(1) as u8;
    let poll_interval_s = section.number("poll_interval_s", &POSITIVE).unwrap_or(0.1);
    let timeout_s = section.number("timeout_s", &POSITIVE).unwrap_or(0.2);
    if speaks.is_some_and(|s| s != Speaks::Modbus) {
        only_for_modbus(section, &MODBUS_DEVICE);
    }
    let units = TimeUnit::ALL.map(|unit| (unit.symbol(), unit));
    let time_unit = section.choice("time_unit", &units).map_or(TimeUnit::default(), |unit| unit.value);
    if let (Some(Speaks::Frames | Speaks::Modbus), Some(place)) = (speaks, section.place_of("time_unit")) {
        let message = "'time_unit' is for devices with protocol = \"lines\" only; leave it out";
        section.fault_at(&place, message);
    }
    let protocol = match speaks? {
        Speaks::Frames => Protocol::Frames,
        Speaks::Lines => Protocol::Lines { time_unit },
        Speaks::Modbus => Protocol::ModbusRtu { unit_id, poll_interval_s, timeout_s },
    };
    Some(Device { name: name?.value.to_owned(), port: port?, protocol })
}

/// A serial port, a socket or a command.
fn read_port(section: &Section<'_>, speaks: Option<Speaks>) -> Option<Port> {
    let Some(place) = section.place_of("command") else {
        let words = "the path of its serial port, e.g. \"/dev/ttyUSB0\", or \"tcp://HOST:PORT\"; a device that is a program has \
                     'command' instead";
        let port = section.required_text("port", words);
        let Some((port, tcp)) = port.as_ref().and_then(|port| Some((port, Port::tcp(port.value)?))) else {
            return read_serial(section, port.map(|port| port.value), speaks);
        };
        not_serial(section, speaks, "a socket");
        return tcp.map_err(|wrong| section.fault_at(&port.place, wrong)).ok();
    };
    if let Some(port) = section.place_of("port") {
        section.fault_at(&port, "give 'port' or 'command', not both");
    }
    not_serial(section, speaks, "a command");
    let words = section
        .words("command", "a list of texts of one line each, the program first, e.g. [\"python3\", \"daq.py\"]")?;
    if words.first().is_some_and(|program| program.trim().is_empty()) {
        section.fault_at(&place, "'command' names no program: its first text is empty");
        return None;
    }
    Some(Port::Command(Command { words, folder: None }))
}

fn read_serial(section: &Section<'_>, path: Option<&str>, speaks: Option<Speaks>) -> Option<Port> {
    let baud = section.required("baud", "the port's speed, e.g. 115200", section.integer("baud", 50, 20_000_000));
    let framing = read_framing(section, speaks);
    Some(Port::Serial(Serial { path: path?.to_owned(), baud: baud? as u32, framing }))
}

/// What only a serial line has is refused of another source.
fn not_serial(section: &Section<'_>, speaks: Option<Speaks>, what: &str) {
    for (key, place) in SERIAL.iter().filter_map(|key| Some((key, section.place_of(key)?))) {
        section.fault_at(&place, format!("'{key}' is for serial ports only, and {what} is none; leave it out"));
    }
    if let (Some(Speaks::Modbus), Some(place)) = (speaks, section.place_of("protocol")) {
        let message = format!(
            "modbus-rtu needs a serial port: it tells messages apart by pauses on the line, which {what} does not keep; \
             a program that polls the device can speak \"lines\""
        );
        section.fault_at(&place, message);
    }
}

/// Format of a character. Only text can be sent with seven bits.
fn read_framing(section: &Section<'_>, speaks: Option<Speaks>) -> Framing {
    let standard = Framing::default();
    let data_bits = section.integer("data_bits", 7, 8).map_or(standard.data_bits, |bits| bits as u8);
    if let (7, Some(Speaks::Frames | Speaks::Modbus), Some(place)) = (data_bits, speaks, section.place_of("data_bits"))
    {
        let message = "'data_bits' = 7 is for devices with protocol = \"lines\" only: the others send bytes of 8 bits; leave it out";
        section.fault_at(&place, message);
    }
    let parities = [("none", Parity::None), ("even", Parity::Even), ("odd", Parity::Odd)];
    let parity = section.choice("parity", &parities).map_or(standard.parity, |parity| parity.value);
    let stop_bits = section.integer("stop_bits", 1, 2).map_or(standard.stop_bits, |bits| bits as u8);
    Framing { data_bits, parity, stop_bits }
}

fn only_for_modbus(section: &Section<'_>, keys: &[&str]) {
    for key in keys {
        if let Some(place) = section.place_of(key) {
            section
                .fault_at(&place, format!("'{key}' is for devices with protocol = \"modbus-rtu\" only; leave it out"));
        }
    }
}

/// The channels in use: device, register space and address, with the sensor that uses them.
#[derive(Default)]
pub(crate) struct Channels(HashMap<(String, bool, u64), String>);

/// The wiring of one sensor, if it has any.
pub(crate) fn read_wiring(
    section: &Section<'_>,
    sensor: &str,
    devices: &[(String, Option<Device>)],
    channels: &mut Channels,
) -> Option<Wiring> {
    let name = section.text("device");
    let channel = section.integer("channel", 0, u64::from(u16::MAX));
    let scale = section.number("scale", &NOT_ZERO).unwrap_or(1.0);
    let offset = section.number("offset", &FINITE).unwrap_or(0.0);
    let input = section.choice("register_kind", &[("input", true), ("holding", false)]).is_none_or(|c| c.value);
    let encodings = [
        ("u16", Encoding::U16),
        ("i16", Encoding::I16),
        ("u32", Encoding::U32),
        ("i32", Encoding::I32),
        ("f32", Encoding::F32),
    ];
    let encoding = section.choice("encoding", &encodings).map_or(Encoding::U16, |c| c.value);
    let big_word_order = section.choice("word_order", &[("big", true), ("little", false)]).is_none_or(|c| c.value);

    if section.place_of("device").is_none() {
        for key in ["channel", "scale", "offset"].iter().chain(&MODBUS_SENSOR) {
            if let Some(place) = section.place_of(key) {
                section.fault_at(&place, format!("'{key}' without 'device': name the device that carries this sensor"));
            }
        }
        return None;
    }
    let channel = section.required("channel", "the column of the device from 0, or the register's address", channel);
    let name = name?;
    let Some((_, device)) = devices.iter().find(|(known, _)| known == name.value) else {
        if devices.iter().any(|(known, _)| known.trim().is_empty()) {
            return None; // it may well be the one whose name is at fault
        }
        let names = || devices.iter().map(|(known, _)| known.as_str());
        let hint = match nearest(name.value, names()) {
            Some(near) => format!("did you mean \"{near}\"?"),
            None if devices.is_empty() => "the file has no [[device]]".to_owned(),
            None => format!("the file has {}", names().collect::<Vec<_>>().join(", ")),
        };
        section.fault_at(&name.place, format!("unknown device \"{}\"; {hint}", name.value));
        return None;
    };
    let device = device.as_ref()?;
    let modbus = matches!(device.protocol, Protocol::ModbusRtu { .. });
    if !modbus {
        only_for_modbus(section, &MODBUS_SENSOR);
    }
    let channel = channel?;
    let place = section.place_of("channel")?;
    if !modbus && channel > MAX_CHANNEL {
        section.fault_at(&place, format!("channel {channel} is beyond the last possible one, {MAX_CHANNEL}"));
    }
    let words = if modbus && encoding.words() == 2 { 2 } else { 1 };
    if channel + words > u64::from(u16::MAX) + 1 {
        section.fault_at(&place, format!("a value of two registers cannot start at the last address, {channel}"));
    }
    for address in channel..channel + words {
        let slot = (device.name.clone(), modbus && !input, address);
        if let Some(other) = channels.0.insert(slot, sensor.to_owned()) {
            let what = if modbus { "register" } else { "channel" };
            section.fault_at(&place, format!("{what} {address} of '{}' already carries '{other}'", device.name));
            break;
        }
    }
    let register = modbus.then_some(Register { input, encoding, big_word_order });
    Some(Wiring { device: device.name.clone(), channel: channel as u16, scale, offset, register })
}
