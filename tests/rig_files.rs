//! What users rely on in rig files: every key of the interface works, and every fault is named with its line.

use surgescope::rig::{Constraint, Coupling, Encoding, Protocol, Rig, SensorKind, Upstream};

/// Every key of the interface, once.
const FULL: &str = r#"
name = "full"

[fluid]
name = "water"
temperature_degC = 20.0

[[pipe]]
name = "main"
length_m = 200.0
inner_diameter_mm = 50.6
wall_thickness_mm = 6.2
material = "HDPE"
wave_speed_m_s = 395.0
friction_factor = 0.02
poisson_ratio = 0.45
constraint = "anchored-upstream"
elevation_start_m = 1.0
elevation_end_m = 3.0

[[pipe]]
name = "tail"
length_m = 71
inner_diameter_mm = 22.1
wall_thickness_mm = 1.6
material = "copper"
roughness_mm = 0.0015
constraint = 0.9

[upstream]
kind = "measured"

[downstream]
kind = "valve"
closing_time_s = 0.10
discharge_head_m = 0.5

[[sensor]]
name = "P0"
kind = "pressure"
position_m = 0.0
unit = "kPa"
range = [-100.0, 1200.0]
accuracy_percent_fs = 0.25
time_constant_s = 0.001
elevation_m = 0.8
coupling = "dc"
device = "daq"
channel = 0
scale = 0.030518
offset = -100.0

[[sensor]]
name = "P1"
kind = "pressure"
position_m = 271.0
unit = "m(H2O)"
coupling = "ac"
time_constant_s = 2.0
device = "daq"
channel = 1

[[sensor]]
name = "Q1"
kind = "flow"
unit = "L/s"
device = "meter"
channel = 0x10
register_kind = "holding"
encoding = "f32"
word_order = "little"

[[sensor]]
name = "T1"
kind = "temperature"
unit = "K"
device = "logger"
channel = 2

[[sensor]]
name = "V1"
kind = "valve-position"
unit = "%"

[[sensor]]
name = "G1"
kind = "trigger"
unit = "1"

[[device]]
name = "daq"
port = "/dev/ttyUSB0"
baud = 921600
protocol = "frames"

[[device]]
name = "meter"
port = "/dev/ttyUSB1"
baud = 19200
protocol = "modbus-rtu"
unit_id = 7
poll_interval_s = 0.5
timeout_s = 0.3

[[device]]
name = "logger"
port = "/dev/ttyUSB2"
baud = 115200
protocol = "lines"
"#;

#[test]
fn every_key_arrives_in_si() {
    let rig = Rig::from_toml(FULL, "full.toml").unwrap();
    assert_eq!(rig.name, "full");
    assert_eq!(rig.source, FULL);
    assert_eq!((rig.fluid.name.as_str(), rig.fluid.temperature_degc), ("water", 20.0));

    let [main, tail] = &rig.pipes[..] else { panic!("two pipes") };
    assert_eq!((main.name.as_str(), main.length_m, main.material.as_str()), ("main", 200.0, "HDPE"));
    assert!((main.inner_diameter_m - 0.0506).abs() < 1e-15 && (main.wall_thickness_m - 0.0062).abs() < 1e-15);
    assert_eq!((main.wave_speed_m_s, main.friction_factor, main.roughness_m), (Some(395.0), Some(0.02), None));
    assert_eq!((main.poisson_ratio, main.constraint), (Some(0.45), Constraint::AnchoredUpstream));
    assert_eq!((main.elevation_start_m, main.elevation_end_m), (1.0, 3.0));
    assert_eq!((tail.constraint, tail.wave_speed_m_s), (Constraint::Coefficient(0.9), None));
    assert!((tail.roughness_m.unwrap() - 1.5e-6).abs() < 1e-18);
    assert_eq!(
        (tail.elevation_start_m, tail.elevation_end_m),
        (3.0, 3.0),
        "a pipe starts where the one before it ends"
    );

    assert_eq!(rig.upstream, Upstream::Measured);
    assert_eq!((rig.valve.closing_time_s, rig.valve.discharge_head_m), (0.1, 0.5));

    let [p0, p1, q1, t1, v1, g1] = &rig.sensors[..] else { panic!("six sensors") };
    assert_eq!((p0.kind, p0.position_m, p0.unit.symbol), (SensorKind::Pressure, 0.0, "kPa"));
    assert_eq!((p0.range, p0.accuracy_percent_fs), (Some([-100.0, 1200.0]), Some(0.25)));
    assert_eq!((p0.time_constant_s, p0.elevation_m, p0.coupling), (Some(0.001), Some(0.8), Coupling::Dc));
    let wiring = p0.wiring.as_ref().unwrap();
    assert_eq!((wiring.device.as_str(), wiring.channel), ("daq", 0));
    assert_eq!((wiring.scale, wiring.offset, wiring.register), (0.030518, -100.0, None));
    assert_eq!((p1.coupling, p1.time_constant_s), (Coupling::Ac, Some(2.0)));
    let wiring = p1.wiring.as_ref().unwrap();
    assert_eq!((wiring.scale, wiring.offset), (1.0, 0.0));
    let register = q1.wiring.as_ref().unwrap().register.unwrap();
    assert_eq!(q1.wiring.as_ref().unwrap().channel, 16);
    assert_eq!((register.input, register.encoding, register.big_word_order), (false, Encoding::F32, false));
    assert_eq!((q1.kind, q1.position_m), (SensorKind::Flow, 0.0));
    assert_eq!((t1.kind, t1.position_m, t1.unit.symbol), (SensorKind::Temperature, 0.0, "K"));
    assert_eq!((v1.kind, v1.position_m), (SensorKind::ValvePosition, 271.0));
    assert_eq!((g1.kind, g1.position_m), (SensorKind::Trigger, 271.0));

    assert_eq!((rig.devices[0].port.as_str(), rig.devices[0].baud), ("/dev/ttyUSB0", 921_600));
    assert_eq!(rig.devices[0].protocol, Protocol::Frames);
    assert_eq!(rig.devices[1].protocol, Protocol::ModbusRtu { unit_id: 7, poll_interval_s: 0.5, timeout_s: 0.3 });
    assert_eq!(rig.devices[2].protocol, Protocol::Lines);
}
