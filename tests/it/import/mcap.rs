//! MCAP of other programs: JSON and protobuf numbers, mapped; and check sums that are checked.

use std::collections::BTreeMap;
use std::fs;

use mcap::records::MessageHeader;
use prost::Message;
use prost_types::field_descriptor_proto::{Label, Type};
use prost_types::{DescriptorProto, FieldDescriptorProto, FileDescriptorProto, FileDescriptorSet};

use super::{Bench, mended};

/// What another program's protobuf message looks like.
#[derive(Clone, PartialEq, Message)]
struct Reading {
    #[prost(double, tag = "1")]
    pressure: f64,
    #[prost(message, optional, tag = "2")]
    stamp: Option<Stamp>,
    #[prost(sint32, repeated, tag = "3")]
    raw: Vec<i32>,
}

#[derive(Clone, Copy, PartialEq, Message)]
struct Stamp {
    #[prost(int64, tag = "1")]
    seconds: i64,
    #[prost(int32, tag = "2")]
    nanos: i32,
}

fn descriptors() -> Vec<u8> {
    let field = |name: &str, number, kind: Type, label: Label, of: Option<&str>| FieldDescriptorProto {
        name: Some(name.into()),
        number: Some(number),
        label: Some(label as i32),
        r#type: Some(kind as i32),
        type_name: of.map(Into::into),
        ..Default::default()
    };
    let one = Label::Optional;
    let reading = vec![
        field("pressure", 1, Type::Double, one, None),
        field("stamp", 2, Type::Message, one, Some(".other.Stamp")),
        field("raw", 3, Type::Sint32, Label::Repeated, None),
    ];
    let stamp = vec![field("seconds", 1, Type::Int64, one, None), field("nanos", 2, Type::Int32, one, None)];
    let message = |name: &str, field| DescriptorProto { name: Some(name.into()), field, ..Default::default() };
    let file = FileDescriptorProto {
        name: Some("other.proto".into()),
        package: Some("other".into()),
        message_type: vec![message("Reading", reading), message("Stamp", stamp)],
        syntax: Some("proto3".into()),
        ..Default::default()
    };
    FileDescriptorSet { file: vec![file] }.encode_to_vec()
}

/// A second at 100 Hz: /lab in JSON, /daq in protobuf, logged 5 ms late; /tf of ROS.
fn put_foreign(bench: &Bench) {
    let mut writer = mcap::Writer::new(fs::File::create(bench.path("other.mcap")).unwrap()).unwrap();
    let schema = writer.add_schema("other.Reading", "protobuf", &descriptors()).unwrap();
    let none = BTreeMap::new();
    let json = writer.add_channel(0, "/lab", "json", &none).unwrap();
    let proto = writer.add_channel(schema, "/daq", "protobuf", &none).unwrap();
    let ros = writer.add_channel(0, "/tf", "cdr", &none).unwrap();
    for i in 0..100u32 {
        let time = 1_773_476_813_000_000_000 + u64::from(i) * 10_000_000;
        let mut put = |channel_id, data: &[u8]| {
            let header = MessageHeader { channel_id, sequence: i, log_time: time + 5_000_000, publish_time: time };
            writer.write_to_known_channel(&header, data).unwrap();
        };
        put(
            json,
            format!(r#"{{"t_ms": {}, "sensors": [{{"bar": {}}}, "text", true]}}"#, i * 10, f64::from(i) * 0.5)
                .as_bytes(),
        );
        let stamp = Some(Stamp { seconds: 1_773_476_813, nanos: i as i32 * 10_000_000 });
        put(proto, &Reading { pressure: f64::from(i % 2) * 100.0, stamp, raw: vec![7, -(i as i32)] }.encode_to_vec());
        put(ros, &[0, 1, 0, 0]);
    }
    writer.finish().unwrap();
}

/// A dropped reading is no pressure, whatever the file.
#[test]
fn readings_that_fell_out_are_gaps_in_messages_too() {
    let bench = Bench::new(&[("P1", "pressure", "bar", "")]);
    let mut writer = mcap::Writer::new(fs::File::create(bench.path("other.mcap")).unwrap()).unwrap();
    let channel_id = writer.add_channel(0, "/lab", "json", &BTreeMap::new()).unwrap();
    for i in 0..200u32 {
        let time = 1_773_476_813_000_000_000 + u64::from(i) * 10_000_000;
        let header = MessageHeader { channel_id, sequence: i, log_time: time, publish_time: time };
        let bar = if i == 70 || i == 130 { 0.0 } else { 5.0 + 0.1 * (0.2 * f64::from(i)).sin() };
        writer.write_to_known_channel(&header, format!("{{\"bar\": {bar}}}").as_bytes()).unwrap();
    }
    writer.finish().unwrap();
    let (document, _) = bench.import(3, &["other.mcap", "--map", "/lab.bar=P1"]);
    assert_eq!(mended(&document, "missing-values")["count"], 2);
    let series = &bench.recording().series[0];
    assert_eq!((series.value.len(), series.gaps.len()), (198, 2));
    assert!(series.value.iter().all(|v| (4.89..5.11).contains(v)));
}

#[test]
fn without_a_map_the_numbers_that_are_there_are_listed() {
    let bench = Bench::plain();
    put_foreign(&bench);
    let words = [
        "other.mcap",
        "--map '/lab.sensors[0].bar=P1'",
        "/lab.t_ms (100 values)",
        "/daq.pressure",
        "/daq.raw[1]",
        "/tf",
        "messages of ROS",
    ];
    bench.refuses(&["other.mcap"], &words);
    bench.refuses(&["other.mcap", "--map", "/lab.t_ms=P1", "--map", "/lab.nothing=P2"], &["no field '/lab.nothing'"]);
}

#[test]
fn json_and_protobuf_fields_become_sensors_at_the_time_asked_for() {
    let bench = Bench::plain();
    put_foreign(&bench);
    let map = ["other.mcap", "--map", "/daq.pressure=P1", "--map", "/lab.sensors[0].bar=P2"];
    let start = 1_773_476_813_000_000_000;
    for (more, start_ns) in [(&[][..], start + 5_000_000), (&["--message-time", "publish"], start)] {
        bench.import(0, &[&map, more].concat());
        let recording = bench.recording();
        assert_eq!(recording.run.start_unix_ns, start_ns);
        let [p1, p2] = &recording.series[..] else { panic!() };
        assert_eq!((p1.value[0], p1.value[1], p1.value.len()), (0.0, 100.0, 100), "a zero of proto3 is a value");
        assert_eq!((p2.value[3], p2.time_s[3]), (1.5, 0.03));
    }
    // a time inside the message, in the two shapes that there are
    let (document, _) = bench.import(3, &[&map[..3], &["--without", "P2", "--time-field", "stamp"]].concat());
    assert_eq!(mended(&document, "no-time")["count"], 100, "the messages of /lab have no stamp");
    assert_eq!((bench.recording().run.start_unix_ns, bench.recording().series[0].time_s[3]), (start, 0.03));
    let by_ms = [
        "other.mcap",
        "--map",
        "/lab.sensors[0].bar=P2",
        "--without",
        "P1",
        "--time-field",
        "t_ms",
        "--time-unit",
        "ms",
    ];
    bench.import(3, &by_ms);
    assert_eq!(bench.recording().series[1].time_s[3], 0.03);
    assert_eq!(bench.recording().run.start_unix_ns, 0, "a clock that counts from its own start tells no date");
}

#[test]
fn a_flipped_byte_is_found_wherever_it_stands() {
    let bench = Bench::plain();
    put_foreign(&bench);
    let whole = fs::read(bench.path("other.mcap")).unwrap();
    let place = whole.windows(4).position(|w| w == [0x28, 0xb5, 0x2f, 0xfd]).expect("a chunk in zstd") + 200;
    let mut damaged = whole.clone();
    damaged[place] ^= 1;
    bench.put("bad.mcap", &damaged);
    bench.refuses(&["bad.mcap", "--map", "/lab.t_ms=P1"], &["bad.mcap: it is damaged"]);
    bench.put("cut.mcap", &whole[..whole.len() - 50]);
    bench.refuses(&["cut.mcap", "--map", "/lab.t_ms=P1"], &["cut.mcap: it has no end"]);
}

/// Messages of /daq in JSON, one every 10 ms from `from_ns` on.
fn put_json(bench: &Bench, from_ns: u64, messages: impl Iterator<Item = String>) {
    let mut writer = mcap::Writer::new(fs::File::create(bench.path("other.mcap")).unwrap()).unwrap();
    let channel_id = writer.add_channel(0, "/daq", "json", &BTreeMap::new()).unwrap();
    for (i, message) in messages.enumerate() {
        let log_time = from_ns + i as u64 * 10_000_000;
        let header = MessageHeader { channel_id, sequence: i as u32, log_time, publish_time: i as u64 * 10_000_000 };
        writer.write_to_known_channel(&header, message.as_bytes()).unwrap();
    }
    writer.finish().unwrap();
}

const MAP: [&str; 5] = ["other.mcap", "--map", "/daq.p=P1", "--without", "P2"];

#[test]
fn text_or_a_null_in_the_place_of_a_number_is_a_gap_and_said() {
    let bench = Bench::plain();
    let p = |i: usize| match i {
        0 | 10 | 49 => "null".to_string(),
        11 => "\"300\"".to_string(),
        _ => i.to_string(),
    };
    // another field's text is nobody's loss
    let message = |i: usize| format!(r#"{{"p": {}, "state": "ok", "note": null}}"#, p(i));
    put_json(&bench, 1_773_476_813_000_000_000, (0..50).map(message));
    let (document, err) = bench.import(3, &MAP);
    assert_eq!(mended(&document, "no-number")["count"], 4);
    assert!(err.contains("4 messages have no number for /daq.p"), "{err}");
    let p1 = &bench.recording().series[0];
    assert_eq!((p1.value[0], p1.value.len()), (1.0, 46));
    let gaps: Vec<_> = p1.gaps.iter().map(|g| (g.from_s, g.to_s, g.samples)).collect();
    assert_eq!(gaps, [(0.0, 0.01, Some(1)), (0.09, 0.12, Some(2)), (0.48, 0.49, Some(1))]);

    put_json(&bench, 1_773_476_813_000_000_000, (0..50).map(|i| format!(r#"{{"p": {i}, "state": "ok"}}"#)));
    bench.import(0, &MAP);
    put_json(&bench, 0, (0..50).map(|_| r#"{"p": "300", "q": 1}"#.to_string()));
    bench.refuses(&MAP, &["its field '/daq.p' is never a number", "assign numbers to sensors", "/daq.q (50 values)"]);
}

#[test]
fn times_that_no_recording_holds_are_said_to_be_so() {
    let bench = Bench::plain();
    let numbers = || (0..50).map(|i| format!(r#"{{"p": {i}}}"#));
    put_json(&bench, 1 << 63, numbers());
    bench.refuses(&MAP, &["all its messages have times beyond what a recording holds", "--message-time publish"]);
    bench.import(0, &[&MAP[..], &["--message-time", "publish"]].concat());
    assert_eq!(bench.recording().series[0].value.len(), 50);
    // the clock of the last ten runs over
    put_json(&bench, (1 << 63) - 400_000_000, numbers());
    let (document, _) = bench.import(3, &MAP);
    assert_eq!(mended(&document, "beyond-time")["count"], 10);
}

/// Every byte of a finished recording is under some check sum, or says nothing of the samples: a flip of any of them is
/// either refused or changes nothing.
#[test]
fn no_flipped_byte_of_our_own_recording_changes_a_sample() {
    let bench = Bench::plain();
    let rows: String = (0..200).map(|i| format!("{:.3},{},{}\n", f64::from(i) * 0.001, 100 + i % 7, 1.5)).collect();
    bench.put("run.csv", format!("time_s,P1,P2\n{rows}"));
    bench.import(0, &["run.csv"]);
    let whole = fs::read(bench.path("run.mcap")).unwrap();
    let right = bench.recording();
    let path = bench.path("flipped.mcap");
    let (mut refused, mut harmless) = (0, 0);
    for place in 0..whole.len() {
        let mut bytes = whole.clone();
        bytes[place] ^= 1 << (place % 8);
        match surgescope::storage::decode(&bytes, &path) {
            Err(_) => refused += 1,
            Ok(recording) => {
                harmless += 1;
                assert_eq!(recording.series, right.series, "byte {place} changes samples unseen");
                assert_eq!(recording.rig.source, right.rig.source, "byte {place} changes the rig unseen");
            }
        }
    }
    assert!(refused > harmless, "{refused} refused, {harmless} harmless");
}

#[test]
fn true_and_false_are_numbers_where_nothing_else_is() {
    let bench = Bench::plain();
    let at = 1_773_476_813_000_000_000;
    put_json(&bench, at, (0..50).map(|i| format!(r#"{{"p": {}}}"#, i >= 20)));
    bench.import(0, &MAP);
    let p1 = &bench.recording().series[0];
    assert_eq!((p1.value[19], p1.value[20], p1.gaps.len()), (0.0, 1.0, 0));
    // among numbers it says that there is none
    let mixed = |i: usize| if i == 7 { "false".to_string() } else { format!("{i}") };
    put_json(&bench, at, (0..50).map(|i| format!(r#"{{"p": {}}}"#, mixed(i))));
    let (document, _) = bench.import(3, &MAP);
    assert_eq!(mended(&document, "no-number")["count"], 1);
    let p1 = &bench.recording().series[0];
    assert_eq!((p1.value[7], p1.gaps[0].from_s, p1.gaps[0].to_s), (8.0, 0.06, 0.08));
}

#[test]
fn what_was_logged_before_the_clock_was_set_is_left_out_and_said() {
    let bench = Bench::plain();
    let mut writer = mcap::Writer::new(fs::File::create(bench.path("other.mcap")).unwrap()).unwrap();
    let channel_id = writer.add_channel(0, "/daq", "json", &BTreeMap::new()).unwrap();
    for i in 0..50u64 {
        let log_time = if i < 2 { i } else { 1_773_476_813_000_000_000 + i * 10_000_000 };
        let header = MessageHeader { channel_id, sequence: i as u32, log_time, publish_time: log_time };
        writer.write_to_known_channel(&header, format!(r#"{{"p": {i}}}"#).as_bytes()).unwrap();
    }
    writer.finish().unwrap();
    let (document, err) = bench.import(3, &MAP);
    assert_eq!(mended(&document, "unset-time")["count"], 2);
    assert!(err.contains("the clock was not set"), "{err}");
    let recording = bench.recording();
    assert_eq!(recording.run.start_unix_ns, 1_773_476_813_020_000_000);
    let p1 = &recording.series[0];
    assert_eq!((p1.time_s[0], p1.value[0], p1.value.len()), (0.0, 2.0, 48));
}

#[test]
fn a_clock_that_is_set_while_it_logs_is_refused_in_words() {
    let bench = Bench::plain();
    let put = |log_time: &dyn Fn(u64) -> u64| {
        let mut writer = mcap::Writer::new(fs::File::create(bench.path("other.mcap")).unwrap()).unwrap();
        let channel_id = writer.add_channel(0, "/daq", "json", &BTreeMap::new()).unwrap();
        for i in 0..50u64 {
            let header =
                MessageHeader { channel_id, sequence: i as u32, log_time: log_time(i), publish_time: i * 10_000_000 };
            writer.write_to_known_channel(&header, format!(r#"{{"p": {i}}}"#).as_bytes()).unwrap();
        }
        writer.finish().unwrap();
    };
    let even = |i: u64| 1_773_476_813_000_000_000 + i * 10_000_000;
    // back by 45 ms
    put(&|i| even(i) - if i >= 20 { 45_000_000 } else { 0 });
    bench.refuses(
        &MAP,
        &["4 of 50 messages of /daq.p have times before those that came earlier", "--message-time publish"],
    );
    bench.import(0, &[&MAP[..], &["--message-time", "publish"]].concat());
    assert_eq!(bench.recording().series[0].value.len(), 50);
    // from the time since the start to that since 1970
    put(&|i| if i < 30 { i * 10_000_000 } else { even(i) });
    bench.refuses(&MAP, &["30 values are of the first year since 1970, 20 are later: the clock was set in between"]);
    // two that were logged by two threads
    put(&|i| {
        even(if i == 7 {
            8
        } else if i == 8 {
            7
        } else {
            i
        })
    });
    let (document, _) = bench.import(0, &MAP);
    assert_eq!(mended(&document, "order")["count"], 1);
    let twice = ["other.mcap", "--map", "/daq.p=P1", "--map", "/daq.p=P2"];
    bench.refuses(&twice, &["--map assigns '/daq.p' to two sensors"]);
}

/// Packed with lz4 by Python's library (tools/mcap_fixture.py).
#[test]
fn chunks_in_lz4_are_read() {
    let bench = Bench::new(&[("P1", "pressure", "bar", ""), ("P2", "pressure", "bar", "position_m = 60.0")]);
    bench.put("lz4.mcap", fs::read("tests/fixtures/mcap-lz4.mcap").unwrap());
    bench.import(0, &["lz4.mcap", "--map", "/daq.p1_bar=P1", "--map", "/daq.p2_bar=P2"]);
    let recording = bench.recording();
    assert_eq!(recording.run.start_unix_ns, 1_773_480_413_250_000_000);
    let [p1, p2] = &recording.series[..] else { panic!() };
    assert_eq!((p1.value.len(), p1.time_s[99], p2.value[99]), (100, 0.99, 1.5));
    assert!((p1.value[99] - 2.99).abs() < 1e-12);
}

/// Any tool may have packed a recording anew.
#[test]
fn our_own_recording_packed_anew_is_read() {
    let whole = fs::read("recordings/hdpe-creep.mcap").unwrap();
    let right = surgescope::storage::decode(&whole, "whole.mcap".as_ref()).unwrap();
    let packed = repacked(&whole);
    assert!(packed.windows(4).any(|w| w == [0x04, 0x22, 0x4d, 0x18]), "no frame of lz4 in it");
    let read = surgescope::storage::decode(&packed, "lz4.mcap".as_ref()).unwrap();
    assert_eq!((&read.series, &read.rig.source), (&right.series, &right.rig.source));
}

/// The same records in chunks of lz4.
fn repacked(whole: &[u8]) -> Vec<u8> {
    use mcap::records::Record;
    let options = mcap::WriteOptions::new().compression(Some(mcap::Compression::Lz4));
    let mut file = std::io::Cursor::new(Vec::new());
    let mut writer = mcap::Writer::with_options(&mut file, options).unwrap();
    let (mut schemas, mut channels) = (BTreeMap::from([(0, 0)]), BTreeMap::new());
    for record in mcap::read::ChunkFlattener::new(whole).unwrap() {
        match record.unwrap() {
            Record::Schema { header, data } => {
                let id = writer.add_schema(&header.name, &header.encoding, &data).unwrap();
                schemas.insert(header.id, id);
            }
            Record::Channel(c) => {
                let id = writer.add_channel(schemas[&c.schema_id], &c.topic, &c.message_encoding, &c.metadata).unwrap();
                channels.insert(c.id, id);
            }
            Record::Message { header, data } => {
                let header = MessageHeader { channel_id: channels[&header.channel_id], ..header };
                writer.write_to_known_channel(&header, &data).unwrap();
            }
            Record::Attachment { header, data, .. } => {
                let (log_time, create_time) = (header.log_time, header.create_time);
                let (name, media_type) = (header.name, header.media_type);
                writer.attach(&mcap::Attachment { log_time, create_time, name, media_type, data }).unwrap();
            }
            Record::Metadata(metadata) => writer.write_metadata(&metadata).unwrap(),
            _ => {}
        }
    }
    writer.finish().unwrap();
    drop(writer);
    file.into_inner()
}
