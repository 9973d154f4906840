//! What users rely on in rig files: every key of the interface works, and every fault is named with its line.

use surgescope::rig::{
    Constraint, Coupling, Encoding, Framing, Parity, Port, Protocol, Rig, SensorKind, TimeUnit, Upstream,
};

use crate::common::{here, printed, refused, run, text};

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
data_bits = 7
parity = "even"
stop_bits = 2
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

    let serial = |index: usize| match &rig.devices[index].port {
        Port::Serial(serial) => serial,
        other => panic!("{other} is no serial port"),
    };
    assert_eq!((serial(0).path.as_str(), serial(0).baud), ("/dev/ttyUSB0", 921_600));
    assert_eq!(rig.devices[0].protocol, Protocol::Frames);
    assert_eq!(rig.devices[1].protocol, Protocol::ModbusRtu { unit_id: 7, poll_interval_s: 0.5, timeout_s: 0.3 });
    assert_eq!(rig.devices[2].protocol, Protocol::Lines { time_unit: TimeUnit::Microseconds });
    assert_eq!(serial(2).framing, Framing { data_bits: 7, parity: Parity::Even, stop_bits: 2 });
    assert_eq!(serial(2).speed(), "115200 baud 7E2");
    assert!([0, 1].iter().all(|&index| serial(index).framing.to_string() == "8N1"));
}

#[test]
fn a_device_is_a_serial_port_a_socket_or_a_command() {
    let with = |source: &str| {
        let text = FULL.replace("port = \"/dev/ttyUSB0\"\nbaud = 921600", source);
        Rig::from_toml(&text, "x.toml").unwrap().devices[0].port.clone()
    };
    for address in ["daq:5025", "10.0.0.5:1", "[fe80::1]:65535"] {
        let port = with(&format!("port = \"tcp://{address}\""));
        assert_eq!((&port, port.to_string()), (&Port::Tcp(address.into()), format!("tcp://{address}")));
    }
    let port = with("command = [\"python3\", \"-u\", \"my daq.py\", \"it's\", \"\"]");
    let command = port.command().unwrap();
    assert_eq!(command.words, ["python3", "-u", "my daq.py", "it's", ""]);
    assert_eq!(command.to_string(), r"python3 -u 'my daq.py' 'it'\''s' ''", "as a shell takes it");
    assert_eq!(command.folder, None, "a text has no folder");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("rig.toml");
    std::fs::write(&path, FULL.replace("port = \"/dev/ttyUSB0\"\nbaud = 921600", "command = [\"daq\"]")).unwrap();
    let rig = Rig::load(&path).unwrap();
    assert_eq!(rig.devices[0].port.command().unwrap().folder.as_deref(), Some(folder.path()));
}

/// What a user reads after one change to the full rig file, and the line of the change.
fn complaint(from: &str, to: &str) -> (String, usize) {
    let at = FULL.find(from).unwrap_or_else(|| panic!("'{from}' is not in the file"));
    let text = FULL.replacen(from, to, 1);
    let line = FULL[..at].matches('\n').count() + 1;
    let error = Rig::from_toml(&text, "rigs/x.toml").expect_err(&format!("{from} -> {to} must be refused"));
    (error.to_string(), line)
}

/// The fault of each change is named, at its own line, and nothing else is complained of.
#[test]
fn every_fault_is_named_with_its_line() {
    let faults: &[(&str, &str, &str)] = &[
        // keys
        ("length_m = 200.0", "lenght_m = 200.0", "unknown key 'lenght_m' in [[pipe]]; did you mean 'length_m'?"),
        (
            "temperature_degC = 20.0",
            "temperature_degC = 20.0\ntemp = 1",
            "unknown key 'temp' in [fluid]; did you mean 'temperature_degC'?",
        ),
        (
            "kind = \"measured\"",
            "kind = \"measured\"\nbaud = 9600",
            "unknown key 'baud' in [upstream]; it belongs in [[device]]",
        ),
        (
            "name = \"full\"",
            "name = \"full\"\nsensors = 3",
            "unknown key 'sensors' in the rig file; did you mean 'sensor'?",
        ),
        // types and choices
        (
            "length_m = 200.0",
            "length_m = \"200\"",
            "'length_m' in [[pipe]] must be a number above 0 and within 1e9, not \"200\"",
        ),
        (
            "kind = \"measured\"",
            "kind = \"resevoir\"",
            "must be \"reservoir\" or \"pump\" or \"measured\", not \"resevoir\"; did you mean \"reservoir\"?",
        ),
        ("kind = \"valve\"", "kind = \"gate\"", "'kind' in [downstream] must be \"valve\", not \"gate\""),
        ("name = \"water\"", "name = \"oil\"", "'name' in [fluid] must be \"water\", not \"oil\""),
        ("material = \"HDPE\"", "material = \"HPDE\"", "unknown material \"HPDE\"; did you mean \"HDPE\"?"),
        ("protocol = \"lines\"", "protocol = \"line\"", "did you mean \"lines\"?"),
        ("encoding = \"f32\"", "encoding = \"f64\"", "'encoding' in [[sensor]] must be \"u16\""),
        ("baud = 921600", "baud = 921600.5", "must be a whole number"),
        ("name = \"daq\"", "name = \"\"", "a text in quotes that is not empty"),
        // ranges
        ("temperature_degC = 20.0", "temperature_degC = 120", "a temperature from 0 to 100 degC, not 120"),
        ("temperature_degC = 20.0", "temperature_degC = -1", "a temperature from 0 to 100 degC, not -1"),
        ("length_m = 200.0", "length_m = 0", "must be a number above 0 and within 1e9, not 0"),
        ("length_m = 200.0", "length_m = nan", "must be a number above 0 and within 1e9, not nan"),
        ("inner_diameter_mm = 50.6", "inner_diameter_mm = inf", "must be a number above 0 and within 1e9, not inf"),
        (
            "wall_thickness_mm = 6.2",
            "wall_thickness_mm = 26",
            "the wall (26 mm) is thicker than the inner radius (25.3 mm)",
        ),
        ("poisson_ratio = 0.45", "poisson_ratio = 0.5", "a number between 0 and 0.5, not 0.5"),
        ("poisson_ratio = 0.45", "poisson_ratio = 0", "a number between 0 and 0.5, not 0"),
        (
            "friction_factor = 0.02",
            "friction_factor = 0.02\nroughness_mm = 0.1",
            "give 'friction_factor' or 'roughness_mm', not both",
        ),
        ("constraint = 0.9", "constraint = \"anchord\"", "did you mean \"anchored\"?"),
        ("constraint = 0.9", "constraint = -1", "or a number above 0"),
        ("closing_time_s = 0.10", "closing_time_s = 0", "'closing_time_s' in [downstream] must be a number above 0"),
        (
            "roughness_mm = 0.0015",
            "roughness_mm = 0.0015\nelevation_start_m = 2.0",
            "the pipe starts at 2 m, but the one before it ends at 3 m",
        ),
        ("range = [-100.0, 1200.0]", "range = [1200.0, -100.0]", "two finite numbers [lo, hi] with lo below hi"),
        ("accuracy_percent_fs = 0.25", "accuracy_percent_fs = 0", "a percentage above 0"),
        ("scale = 0.030518", "scale = 0", "a number other than 0"),
        ("unit_id = 7", "unit_id = 300", "a whole number from 1 to 247"),
        ("data_bits = 7", "data_bits = 5", "a whole number from 7 to 8"),
        ("unit_id = 7", "data_bits = 7", "'data_bits' = 7 is for devices with protocol = \"lines\" only"),
        ("parity = \"even\"", "parity = \"evn\"", "did you mean \"even\"?"),
        ("parity = \"even\"", "parity = 2", "parity"),
        ("stop_bits = 2", "stop_bits = 1.5", "a whole number from 1 to 2"),
        ("stop_bits = 2", "stopbits = 2", "did you mean 'stop_bits'?"),
        // sockets and commands
        ("port = \"/dev/ttyUSB0\"", "port = \"tcp://daq\"", "is no address of a socket: write tcp://HOST:PORT"),
        ("port = \"/dev/ttyUSB0\"", "port = \"tcp://daq:0\"", "is no address of a socket"),
        ("port = \"/dev/ttyUSB0\"", "port = \"tcp://::1:5025\"", "is no address of a socket"),
        ("port = \"/dev/ttyUSB0\"", "command = [\"daq\"]\nport = \"x\"", "give 'port' or 'command', not both"),
        (
            "port = \"/dev/ttyUSB0\"\nbaud = 921600",
            "command = \"daq\"",
            "must be a list of texts of one line each, the program first",
        ),
        (
            "port = \"/dev/ttyUSB0\"\nbaud = 921600",
            "command = []",
            "must be a list of texts of one line each, the program first",
        ),
        ("port = \"/dev/ttyUSB0\"\nbaud = 921600", "command = [\"daq\", 3]", "must be a list of texts"),
        ("port = \"/dev/ttyUSB0\"\nbaud = 921600", "command = [\"\", \"x\"]", "'command' names no program"),
        (
            "port = \"/dev/ttyUSB0\"\nbaud = 921600",
            "command = [\"daq\"]\nbaud = 921600",
            "'baud' is for serial ports only, and a command is none; leave it out",
        ),
        (
            "port = \"/dev/ttyUSB2\"\nbaud = 115200\ndata_bits = 7\nparity = \"even\"\nstop_bits = 2",
            "port = \"tcp://daq:5025\"\nparity = \"even\"",
            "'parity' is for serial ports only, and a socket is none; leave it out",
        ),
        (
            "port = \"/dev/ttyUSB1\"\nbaud = 19200\nprotocol = \"modbus-rtu\"",
            "port = \"tcp://daq:502\"\nprotocol = \"modbus-rtu\"",
            "modbus-rtu needs a serial port: it tells messages apart by pauses on the line, which a socket does not keep",
        ),
        // sensors
        (
            "position_m = 271.0",
            "position_m = 271.5",
            "position_m = 271.5 is not on the pipe, which goes from 0 at the supply to 271 m at the valve",
        ),
        ("position_m = 271.0", "position_m = -0.5", "is not on the pipe"),
        (
            "unit = \"m(H2O)\"",
            "unit = \"L/s\"",
            "unit \"L/s\" does not fit the sensor's kind; allowed here are Pa, kPa, MPa, bar, psi, m(H2O)",
        ),
        ("unit = \"m(H2O)\"", "unit = \"mH2O\"", "unit \"mH2O\" is not a known unit; allowed here are Pa"),
        ("unit = \"m(H2O)\"", "unit = \"mH2O\"", "inHg; did you mean \"m(H2O)\"?"),
        ("unit = \"m(H2O)\"", "unit = \"mWC\"", "did you mean \"m(H2O)\"?"),
        ("unit = \"kPa\"", "unit = \"kpa\"", "did you mean \"kPa\"?"),
        ("unit = \"L/s\"", "unit = \"l/s\"", "did you mean \"L/s\"?"),
        ("unit = \"L/s\"", "unit = \"m³/h\"", "did you mean \"m3/h\"?"),
        ("unit = \"K\"", "unit = \"°C\"", "did you mean \"degC\"?"),
        ("name = \"P1\"", "name = \"P0\"", "a second sensor named 'P0'"),
        ("name = \"P1\"", "name = \"time_s\"", "is the name of the time column"),
        ("name = \"P1\"", "name = \"P,1\"", "must not hold a comma"),
        ("name = \"P1\"", "name = \"P\\n1\"", "a text without control characters"),
        ("name = \"P1\"", "name = \"P1 \"", "must not begin or end with a space"),
        ("name = \"tail\"", "name = \"main\"", "a second pipe named 'main'"),
        ("coupling = \"dc\"", "coupling = \"dcc\"", "did you mean \"dc\"?"),
        ("unit = \"K\"", "unit = \"K\"\ncoupling = \"ac\"", "'coupling' is for sensors with kind = \"pressure\" only"),
        // wiring
        ("device = \"logger\"", "device = \"loger\"", "unknown device \"loger\"; did you mean \"logger\"?"),
        ("channel = 1", "channel = 0", "channel 0 of 'daq' already carries 'P0'"),
        ("channel = 1", "channel = 255", "channel 255 is beyond the last possible one, 254"),
        (
            "channel = 2",
            "channel = 2\nencoding = \"u16\"",
            "'encoding' is for devices with protocol = \"modbus-rtu\" only",
        ),
        (
            "protocol = \"lines\"",
            "protocol = \"lines\"\ntimeout_s = 1",
            "'timeout_s' is for devices with protocol = \"modbus-rtu\" only",
        ),
        ("unit = \"%\"", "unit = \"%\"\nchannel = 3", "'channel' without 'device'"),
    ];
    for (from, to, expected) in faults {
        let (text, at) = complaint(from, to);
        let line = at + to.matches('\n').count();
        let first = text.lines().next().unwrap_or_default();
        assert!(text.contains(expected), "{from} -> {to}\n{text}");
        assert!(first.starts_with(&format!("rigs/x.toml:{line}: ")), "{from} -> {to} stands in line {line}\n{text}");
        let source_line = to.lines().last().unwrap_or_default();
        assert!(text.contains(&format!("| {source_line}")), "shows the line itself\n{text}");
    }
}

#[test]
fn what_is_missing_is_named_at_its_table() {
    for (from, expected) in [
        ("length_m = 200.0", "missing key 'length_m' in [[pipe]]; it is a number above 0"),
        ("position_m = 271.0", "missing key 'position_m' in [[sensor]]"),
        ("channel = 1\n", "missing key 'channel' in [[sensor]]"),
        ("time_constant_s = 2.0", "coupling = \"ac\" needs 'time_constant_s'"),
        ("temperature_degC = 20.0", "missing key 'temperature_degC' in [fluid]"),
        ("closing_time_s = 0.10", "missing key 'closing_time_s' in [downstream]"),
        ("baud = 19200", "missing key 'baud' in [[device]]"),
        ("[fluid]\nname = \"water\"\ntemperature_degC = 20.0", "missing [fluid]"),
        ("[upstream]\nkind = \"measured\"", "missing [upstream]"),
    ] {
        let (text, _) = complaint(from, "");
        assert!(text.contains(expected), "without {from}:\n{text}");
    }
    let (text, at) = complaint("length_m = 200.0", "");
    assert!(text.starts_with(&format!("rigs/x.toml:{}: ", at - 2)), "at the heading, two lines above\n{text}");
}

#[test]
fn a_measured_supply_needs_a_steady_pressure_sensor_at_position_zero() {
    let (text, _) = complaint("position_m = 0.0", "position_m = 0.1");
    assert!(text.contains("needs a pressure sensor with position_m = 0"), "{text}");
    let (text, _) = complaint("coupling = \"dc\"", "coupling = \"ac\"");
    assert!(text.contains("needs a pressure sensor with position_m = 0"), "{text}");
}

#[test]
fn a_rig_without_a_pressure_sensor_is_refused() {
    let cut = FULL.find("[[sensor]]").unwrap();
    let head = FULL[..cut].replace("measured", "reservoir");
    let text = Rig::from_toml(&head, "x.toml").unwrap_err().to_string();
    assert!(text.contains("there must be at least one [[sensor]] of that kind"), "{text}");
    let flow_only = head + "[[sensor]]\nname = \"Q\"\nkind = \"flow\"\nunit = \"L/s\"\n";
    let text = Rig::from_toml(&flow_only, "x.toml").unwrap_err().to_string();
    assert!(text.contains("no sensor has kind = \"pressure\""), "{text}");
}

#[test]
fn two_wide_registers_must_not_overlap() {
    let sensor = "\n[[sensor]]\nname = \"Q2\"\nkind = \"flow\"\nunit = \"L/s\"\ndevice = \"meter\"\nchannel = 17\nregister_kind = \"holding\"\n";
    let text = Rig::from_toml(&format!("{FULL}{sensor}"), "x.toml").unwrap_err().to_string();
    assert!(text.contains("register 17 of 'meter' already carries 'Q1'"), "{text}");
    let apart = sensor.replace("holding", "input");
    assert!(Rig::from_toml(&format!("{FULL}{apart}"), "x.toml").is_ok(), "input and holding registers are two spaces");
}

#[test]
fn several_faults_are_reported_at_once_in_the_order_of_the_lines() {
    let text = FULL
        .replacen("inner_diameter_mm = 50.6", "diameter_mm = 50.6", 1)
        .replacen("unit = \"K\"", "unit = \"F\"", 1)
        .replacen("baud = 19200", "baud = true", 1);
    let error = Rig::from_toml(&text, "x.toml").unwrap_err().to_string();
    let places: Vec<usize> = ["unknown key 'diameter_mm'", "unit \"F\" is not a known unit", "'baud' in [[device]]"]
        .iter()
        .map(|part| error.find(part).unwrap_or_else(|| panic!("{part} is not in\n{error}")))
        .collect();
    assert!(places.is_sorted(), "{error}");
}

/// A suggestion that is not alike is worse than none.
#[test]
fn nothing_is_suggested_that_is_not_alike() {
    for (from, to, instead) in [
        ("length_m = 200.0", "length_m = 200.0\nxyz = 1", "unknown key 'xyz' in [[pipe]]; known are name, length_m"),
        ("material = \"HDPE\"", "material = \"wood\"", "unknown material \"wood\". Known are"),
        ("device = \"logger\"", "device = \"x\"", "unknown device \"x\"; the file has daq, meter, logger"),
        ("kind = \"measured\"", "kind = \"xyz\"", "not \"xyz\""),
        ("unit = \"K\"", "unit = \"furlong\"", "allowed here are degC, K"),
    ] {
        let (text, _) = complaint(from, to);
        assert!(text.contains(instead) && !text.contains("did you mean"), "{from} -> {to}\n{text}");
    }
}

#[test]
fn a_time_series_in_the_place_of_a_rig_is_told_in_one_line() {
    let rows: String = (0..60_000).map(|i| format!("{i},1.0,2.0\n")).collect();
    for (head, rows) in
        [("time_s,P1,P2\n", rows.as_str()), ("# lab 3\n\ntime_s;P1;P2\n", "0;1;2\n"), ("0.0,1.0,2.0\n", "")]
    {
        let text = Rig::from_toml(&format!("{head}{rows}"), "run.csv").unwrap_err().to_string();
        assert!(text.contains("run.csv:1: this looks like a time series, not a rig file"), "{text}");
        assert!(text.lines().count() <= 2, "{text}");
    }
    let text = Rig::from_toml(&"nonsense\n".repeat(5000), "notes.txt").unwrap_err().to_string();
    assert!(text.lines().count() <= 21, "{}", text.lines().count());
    assert!(text.lines().last().unwrap().starts_with("… and ") && text.ends_with(" more"), "{text}");
}

#[test]
fn broken_toml_and_tables_of_the_wrong_sort_are_told_with_their_line() {
    let (text, line) = complaint("length_m = 200.0", "length_m = ");
    assert!(text.starts_with(&format!("rigs/x.toml:{line}: not valid TOML")), "{text}");
    let error =
        Rig::from_toml("pipe = 3\nname = \"x\"\nfluid = \"water\"\nsensor = [1]\n", "x.toml").unwrap_err().to_string();
    assert!(error.contains("x.toml:1: 'pipe' must be a list of tables: write [[pipe]] before each"), "{error}");
    assert!(error.contains("x.toml:3: 'fluid' must be one table: write [fluid]"), "{error}");
    assert!(error.contains("x.toml:4: 'sensor' must be a list of tables"), "{error}");
    assert!(error.contains("missing [downstream]"), "{error}");
}

#[test]
fn a_file_that_is_not_there_is_told_by_its_path() {
    let error = Rig::load(std::path::Path::new("no/such/rig.toml")).unwrap_err().to_string();
    assert!(error.contains("cannot read the rig file no/such/rig.toml"), "{error}");
}

#[test]
fn a_pipe_without_a_constraint_has_coefficient_one_and_a_valve_discharges_at_zero() {
    let text = FULL.replacen("constraint = 0.9\n", "", 1).replacen("discharge_head_m = 0.5\n", "", 1);
    let rig = Rig::from_toml(&text, "x.toml").unwrap();
    assert_eq!((rig.pipes[1].constraint, rig.valve.discharge_head_m), (Constraint::Coefficient(1.0), 0.0));
}

proptest::proptest! {
    /// Whatever stands in a file: an answer, never a panic.
    #[test]
    fn no_text_makes_the_reader_panic(cut in 0usize..1000, junk in "\\PC{0,12}") {
        let at = (0..=cut.min(FULL.len())).rev().find(|i| FULL.is_char_boundary(*i)).unwrap_or(0);
        let _ = Rig::from_toml(&format!("{}{junk}{}", &FULL[..at], &FULL[at..]), "x.toml");
        let _ = Rig::from_toml(&FULL[..at], "x.toml");
    }
}

fn shipped(name: &str) -> std::path::PathBuf {
    here("rigs").join(name)
}

/// A made-up rig whose numbers the tests below are written for.
fn plausible() -> std::path::PathBuf {
    here("tests/rigs/hdpe-63.toml")
}

#[test]
fn every_rig_that_ships_loads() {
    let mut names = Vec::new();
    for entry in std::fs::read_dir(shipped("")).unwrap() {
        let path = entry.unwrap().path();
        let rig = Rig::load(&path).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(path.file_stem().unwrap().to_str(), Some(rig.name.as_str()), "named as its file");
        names.push(rig.name);
    }
    for name in ["adelaide-copper", "demo-hdpe", "imperial-pe", "paper-hdpe", "paper-ppr"] {
        assert!(names.iter().any(|n| n == name), "{name} is missing");
    }
}

#[test]
fn the_demo_rig_holds_a_surge_of_45_m_over_25_m() {
    let rig = Rig::load(&shipped("demo-hdpe.toml")).unwrap();
    let density = rig.fluid.properties(rig.fluid.temperature_degc).density_kg_m3;
    let weight = density * surgescope::units::GRAVITY_M_S2;
    assert_eq!(rig.pressure_sensors().count(), 3);
    for (_, sensor) in rig.pressure_sensors() {
        let wiring = sensor.wiring.as_ref().unwrap();
        for head in [-10.3, 70.0] {
            let shown = sensor.unit.from_si(head * weight, density);
            let count = (shown - wiring.offset) / wiring.scale;
            assert!(count > f64::from(i16::MIN) && count < f64::from(i16::MAX), "{head} m is count {count}");
            let [lo, hi] = sensor.range.unwrap();
            assert!(lo - 2.0 < shown && shown < hi, "{head} m is {shown}");
        }
    }
}

/// Runs `rig check --json` and gives back its exit code and its document.
fn check(arguments: &[&str]) -> (Option<i32>, serde_json::Value) {
    let output = run(&[&["--json", "rig", "check"], arguments].concat());
    let document = serde_json::from_slice(&output.stdout).unwrap_or(serde_json::Value::Null);
    (output.status.code(), document)
}

/// How a pipe is held decides what its creep is worth: the output names the coefficient in use with the others.
#[test]
fn the_constraint_in_use_is_said() {
    let (code, document) = check(&["rigs/demo-hdpe.toml"]);
    assert!(code.is_some_and(|c| c < 2), "{document}");
    let findings = document["findings"].as_array().unwrap();
    let found = findings.iter().find(|f| f["subject"] == "constraint of 'main'").unwrap();
    assert_eq!((found["level"].as_str(), found["numbers"]["c1"].as_f64()), (Some("fine"), Some(1.0)));
    assert!(found["message"].as_str().unwrap().contains("J scale with 1/c1"), "{found}");
    let rig = Rig::load(&shipped("demo-hdpe.toml")).unwrap();
    let ratio = rig.pipes[0].inner_diameter_m / rig.pipes[0].wall_thickness_m;
    let free = if ratio < 25.0 { 2.0 / ratio * 1.46 + ratio / (ratio + 1.0) } else { 1.0 };
    assert!((found["numbers"]["free"].as_f64().unwrap() - free).abs() < 1e-9, "{found}");
}

fn subjects(document: &serde_json::Value, level: &str) -> Vec<String> {
    let findings = document["findings"].as_array().unwrap();
    let of_level = findings.iter().filter(|f| f["level"] == level);
    of_level.map(|f| f["subject"].as_str().unwrap().to_owned()).collect()
}

#[test]
fn the_papers_rigs_contradict_themselves_and_the_check_says_where() {
    let (code, document) = check(&[shipped("paper-hdpe.toml").to_str().unwrap()]);
    assert_eq!((code, document["verdict"].as_str()), (Some(1), Some("contradiction")));
    let found = subjects(&document, "contradiction");
    for subject in ["Reynolds number, Case 4", "friction loss, Case 5", "range of 'Q1', Case 6"] {
        assert!(found.iter().any(|f| f == subject), "{subject} is not among {found:?}");
    }
    assert!(subjects(&document, "warning").iter().any(|f| f == "closing time"), "0.4 s is no quick closure here");

    let (code, document) = check(&[shipped("paper-ppr.toml").to_str().unwrap()]);
    assert_eq!(code, Some(1));
    let loss =
        document["findings"].as_array().unwrap().iter().find(|f| f["subject"] == "friction loss, Case 1").unwrap();
    let loss_m = loss["numbers"]["loss_m"].as_f64().unwrap();
    assert!((loss_m - 120.0).abs() < 1.0, "f L/D V²/2g by hand gives 120 m, not {loss_m}");
}

#[test]
fn rigs_that_agree_with_themselves_pass() {
    for name in ["adelaide-copper.toml", "demo-hdpe.toml", "imperial-pe.toml"] {
        let (code, document) = check(&[shipped(name).to_str().unwrap()]);
        assert_eq!(code, Some(0), "{document:#}");
        assert!(subjects(&document, "contradiction").is_empty());
    }
}

#[test]
fn a_flow_given_on_the_command_line_is_held_against_the_rig() {
    let demo = plausible();
    let demo = demo.to_str().unwrap();
    assert_eq!(check(&[demo, "--flow", "8"]).0, Some(0));
    let (code, document) = check(&[demo, "--flow", "13", "--supply-head", "5", "--reynolds", "20000"]);
    assert_eq!(code, Some(1));
    let found = subjects(&document, "contradiction");
    assert_eq!(found.len(), 3, "Reynolds number, friction loss and the meter's range: {found:?}");
}

#[test]
fn bad_input_exits_with_2_and_says_where_on_standard_error() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bad.toml");
    std::fs::write(&path, FULL.replacen("length_m", "lenght_m", 1)).unwrap();
    refused(&["rig", "check", text(&path)], &["bad.toml:10: unknown key 'lenght_m'"]);
}

#[test]
fn a_recording_is_held_against_its_rig() {
    let folder = tempfile::tempdir().unwrap();
    let csv = folder.path().join("run.csv");
    let mut series = "time_s,P1,P2,P3,Q1,T1,G1\n".to_owned();
    for i in 0..2000 {
        let t = f64::from(i) * 5e-4;
        let at = |delay: f64, steady: f64| steady + 200.0 * ((t - 0.3 - delay) / 0.08).clamp(0.0, 1.0);
        let (p1, p2, p3) = (at(0.0, 229.2), at(60.0 / 384.0, 237.1), at(100.0 / 384.0, 242.4));
        series += &format!("{t:.4},{p1:.3},{p2:.3},{p3:.3},6.0,18.0,0\n");
    }
    std::fs::write(&csv, &series).unwrap();
    let (demo, csv_path) = (plausible(), csv.to_str().unwrap());
    let (code, document) = check(&[demo.to_str().unwrap(), csv_path]);
    assert_eq!(code, Some(0), "{document:#}");
    assert!(subjects(&document, "fine").iter().any(|f| f == "wave from 'P1' to 'P2'"), "{document:#}");

    std::fs::write(&csv, series.replace(",6.0,18.0", ",14.0,18.0")).unwrap();
    let (code, document) = check(&[demo.to_str().unwrap(), csv_path]);
    assert_eq!(code, Some(1));
    let found = subjects(&document, "contradiction");
    assert!(found.iter().any(|f| f == "range of 'Q1'"), "{found:?}");

    let mcap = folder.path().join("run.mcap");
    printed(run(&["import", csv_path, "--rig", text(&demo), "-o", text(&mcap)]));
    let (code, document) = check(&[demo.to_str().unwrap(), mcap.to_str().unwrap()]);
    assert_eq!(code, Some(1), "{document:#}");
    assert_eq!(subjects(&document, "contradiction"), found, "the recording says what its CSV says");
}
