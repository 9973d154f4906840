//! `record --live`: a client gets what the file gets, nobody can do more than watch, and a client that does not read
//! changes nothing.

use std::collections::BTreeMap;
use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Stdio};
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use surgescope::live::Server;
use surgescope::record::session::feed::Feed;
use surgescope::record::session::live_test::Options;
use surgescope::record::session::replay::replay;
use surgescope::recording::{Recording, Series};
use surgescope::storage as log;

use crate::common::{CREEP, document, here, refused, surgescope, text};

/// A client that speaks the protocol by hand.
struct Client {
    line: TcpStream,
    came: Vec<u8>,
}

/// By topic: log time and data of each.
type Messages = BTreeMap<String, Vec<(u64, Vec<u8>)>>;

const TEXT: u8 = 1;
const BINARY: u8 = 2;
const CLOSE: u8 = 8;

/// Asks to come in: the answer's code and text, and the client.
fn ask(port: u16, headers: &[(&str, &str)]) -> (u16, String, Client) {
    let own = format!("127.0.0.1:{port}");
    let mut head = BTreeMap::from([
        ("Host", own.as_str()),
        ("Upgrade", "websocket"),
        ("Connection", "Upgrade"),
        ("Sec-WebSocket-Version", "13"),
        ("Sec-WebSocket-Key", "dGhlIHNhbXBsZSBub25jZQ=="),
        ("Sec-WebSocket-Protocol", "foxglove.sdk.v1"),
    ]);
    head.extend(headers.iter().copied());
    let lines: String = head.iter().map(|(name, value)| format!("{name}: {value}\r\n")).collect();
    let mut line = TcpStream::connect(("127.0.0.1", port)).unwrap();
    line.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
    line.write_all(format!("GET / HTTP/1.1\r\n{lines}\r\n").as_bytes()).unwrap();
    let mut answer = Vec::new();
    let mut byte = [0];
    while !answer.ends_with(b"\r\n\r\n") && line.read(&mut byte).unwrap() > 0 {
        answer.push(byte[0]);
    }
    let mut answer = String::from_utf8(answer).unwrap();
    let code = answer[9..12].parse().unwrap();
    if code != 101 {
        line.read_to_string(&mut answer).unwrap();
    }
    (code, answer, Client { line, came: Vec::new() })
}

fn enter(port: u16) -> Client {
    let (code, answer, client) = ask(port, &[]);
    assert_eq!(code, 101, "{answer}");
    assert!(answer.to_lowercase().contains("sec-websocket-protocol: foxglove.sdk.v1\r\n"), "{answer}");
    client
}

impl Client {
    fn send(&mut self, opcode: u8, payload: &[u8]) {
        let length = u8::try_from(payload.len()).ok().filter(|length| *length < 126).unwrap();
        // a mask of zeros leaves the payload as it is
        self.line.write_all(&[&[0x80 | opcode, 0x80 | length, 0, 0, 0, 0], payload].concat()).unwrap();
    }

    fn ask(&mut self, request: &Value) {
        self.send(TEXT, request.to_string().as_bytes());
    }

    /// The next message, and its kind.
    fn next(&mut self) -> (u8, Vec<u8>) {
        loop {
            if let Some(found) = self.take() {
                return found;
            }
            let mut more = [0; 64 << 10];
            let count = self.line.read(&mut more).unwrap();
            assert!(count > 0, "the connection ended without a farewell");
            self.came.extend(&more[..count]);
        }
    }

    fn take(&mut self) -> Option<(u8, Vec<u8>)> {
        let (opcode, length) = (self.came.first()? & 0x0F, *self.came.get(1)?);
        let (length, start) = match length {
            126 => (usize::from(u16::from_be_bytes(self.came.get(2..4)?.try_into().unwrap())), 4),
            127 => (u64::from_be_bytes(self.came.get(2..10)?.try_into().unwrap()) as usize, 10),
            length => (length.into(), 2),
        };
        let payload = self.came.get(start..start + length)?.to_vec();
        self.came.drain(..start + length);
        Some((opcode, payload))
    }

    fn next_text(&mut self) -> Value {
        let (opcode, payload) = self.next();
        assert_eq!(opcode, TEXT);
        serde_json::from_slice(&payload).unwrap()
    }

    /// Subscribes to every channel that comes; all messages up to the farewell by topic, log time and data, and the
    /// channels.
    fn take_all(mut self) -> (Messages, Vec<Value>) {
        let (mut messages, mut channels) = (Messages::new(), Vec::<Value>::new());
        loop {
            let (opcode, payload) = self.next();
            match opcode {
                TEXT => {
                    let said: Value = serde_json::from_slice(&payload).unwrap();
                    for channel in said["channels"].as_array().into_iter().flatten() {
                        let wanted = json!({ "id": channels.len(), "channelId": channel["id"] });
                        self.ask(&json!({ "op": "subscribe", "subscriptions": [wanted] }));
                        channels.push(channel.clone());
                    }
                }
                BINARY => {
                    assert_eq!(payload[0], 1);
                    let id = u32::from_le_bytes(payload[1..5].try_into().unwrap());
                    let log_time = u64::from_le_bytes(payload[5..13].try_into().unwrap());
                    let topic = channels[id as usize]["topic"].as_str().unwrap().to_owned();
                    messages.entry(topic).or_default().push((log_time, payload[13..].to_vec()));
                }
                CLOSE => {
                    assert_eq!(payload[..2], 1001_u16.to_be_bytes(), "going away");
                    self.send(CLOSE, &1000_u16.to_be_bytes());
                    return (messages, channels);
                }
                other => panic!("a frame of kind {other}"),
            }
        }
    }
}

/// A recorder that plays a recording, and the port where it can be watched.
fn recorder(file: &Path, more: &[&str]) -> (Child, u16) {
    let arguments = ["record", "--replay", CREEP, "--live", "127.0.0.1:0", "--json", "-o", text(file)];
    let mut command = surgescope(arguments.iter().chain(more));
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut told = BufReader::new(child.stderr.take().unwrap());
    let mut line = String::new();
    while !line.contains("live at ws://") {
        line.clear();
        assert!(told.read_line(&mut line).unwrap() > 0, "it never said where");
    }
    // what comes later must find a reader
    std::thread::spawn(move || std::io::copy(&mut told, &mut std::io::sink()));
    let port = line.split("127.0.0.1:").nth(1).unwrap().chars().take_while(char::is_ascii_digit).collect::<String>();
    (child, port.parse().unwrap())
}

#[test]
fn a_client_gets_the_messages_of_the_file_byte_by_byte() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.mcap");
    let (child, port) = recorder(&file, &["--speed", "6"]);
    let mut client = enter(port);
    let info = client.next_text();
    assert_eq!((&info["op"], &info["capabilities"]), (&json!("serverInfo"), &json!([])), "nothing but to watch");
    let (live, channels) = client.take_all();
    let summary = document(child.wait_with_output().unwrap());
    assert_eq!(summary["live"], json!({ "clients": 1, "dropped": 0 }));

    let bytes = std::fs::read(&file).unwrap();
    let mut filed = Messages::new();
    let mut known = BTreeMap::new();
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        filed.entry(message.channel.topic.clone()).or_default().push((message.log_time, message.data.to_vec()));
        known.insert(message.channel.topic.clone(), message.channel.clone());
    }
    assert!(filed.len() >= 3 && filed.keys().eq(live.keys()), "{:?}, {:?}", filed.keys(), live.keys());
    for (topic, expected) in &filed {
        let got = &live[topic];
        assert!(got.len() > expected.len() / 2, "{topic}: {} of {}", got.len(), expected.len());
        assert!(expected.ends_with(got), "{topic}");
    }
    let decode = |text: &Value| {
        use base64::Engine as _;
        base64::engine::general_purpose::STANDARD.decode(text.as_str().unwrap()).unwrap()
    };
    for channel in &channels {
        let of_file = &known[channel["topic"].as_str().unwrap()];
        let schema = of_file.schema.as_ref().unwrap();
        assert_eq!(channel["schemaName"], json!(schema.name));
        assert_eq!(decode(&channel["schema"]), schema.data.to_vec());
        assert_eq!(channel["metadata"], json!(of_file.metadata));
    }
}

#[test]
fn strangers_are_turned_away_and_nobody_can_do_more_than_watch() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.mcap");
    let (child, port) = recorder(&file, &["--speed", "5"]);
    let evil = format!("evil.example:{port}");
    for (headers, expected) in [
        ([("Origin", "https://evil.example")], 403),
        ([("Origin", "null")], 403),
        ([("Origin", "https://app.foxglove.dev.evil.example")], 403),
        ([("Host", evil.as_str())], 403),
        ([("Sec-WebSocket-Protocol", "chat")], 400),
        ([("Upgrade", "h2c")], 426),
        ([("Origin", "https://app.foxglove.dev")], 101),
        ([("Origin", "http://localhost:8080")], 101),
        ([("Sec-WebSocket-Protocol", "foxglove.websocket.v1, foxglove.sdk.v1")], 101),
        ([("Sec-WebSocket-Protocol", "foxglove.websocket.v1")], 101),
    ] {
        let (code, answer, _) = ask(port, &headers);
        assert_eq!(code, expected, "{headers:?}: {answer}");
        assert!(code != 426 || answer.contains(&format!("Foxglove WebSocket to ws://127.0.0.1:{port}")), "{answer}");
    }
    let mut client = enter(port);
    client.next_text();
    let channel = client.next_text()["channels"][0].clone();
    client.ask(&json!({ "op": "advertise", "channels": [{ "id": 1, "topic": channel["topic"], "encoding": "json" }] }));
    client.send(BINARY, b"\x01\x01\x00\x00\x00not mine");
    client.ask(&json!({ "op": "setParameters", "parameters": [] }));
    client.send(TEXT, b"{");
    client.ask(&json!({ "op": "subscribe", "subscriptions": [{ "id": 1, "channelId": 4_000_000_000_u64 }] }));
    let mut told = Vec::new();
    while told.len() < 5 {
        let (opcode, payload) = client.next();
        let said: Value = if opcode == TEXT { serde_json::from_slice(&payload).unwrap() } else { Value::Null };
        if said["op"] == "status" {
            told.push(said["message"].as_str().unwrap().to_owned());
        }
    }
    assert!(told[..3].iter().all(|text| text.contains("only shows what it records")), "{told:?}");
    assert!(told[3].contains("no request") && told[4].contains("no such channel"), "{told:?}");
    drop(client);
    let summary = document(child.wait_with_output().unwrap());
    assert_eq!(summary["live"], json!({ "clients": 5, "dropped": 0 }), "who leaves has lost nothing");
    let warnings = summary["warnings"].to_string();
    assert!(warnings.contains("add --live-origin https://evil.example"), "{warnings}");
    let (before, after) = (log::read(&here(CREEP)).unwrap(), log::read(&file).unwrap());
    assert_eq!(before.series, after.series, "the recording is as if nobody had been there");
}

#[test]
fn a_client_that_never_reads_holds_nobody_up_and_its_loss_is_counted() {
    let like = log::read(&here(CREEP)).unwrap();
    let samples = 1_500_000;
    let mut series = vec![Series::default(); like.series.len()];
    series[0].time_s = (0..samples).map(|i| i as f64 / 1e4).collect();
    series[0].value = (0..samples).map(|i| (i % 1000) as f64).collect();
    let recording = Recording { series, ..like };
    let folder = tempfile::tempdir().unwrap();
    let record = |name: &str, feed: Option<Feed>| {
        let options = Options { feed, ..Options::new(folder.path().join(name)) };
        let started = Instant::now();
        let summary = replay(&recording, "long", 0.0, &options, &AtomicBool::new(false), &mut |_| {}).unwrap();
        assert_eq!((summary.sensors[0].samples, summary.data_lost), (samples, false));
        (started.elapsed(), std::fs::read(folder.path().join(name)).unwrap())
    };
    let feed = Feed::new();
    let address = "127.0.0.1:0".parse().unwrap();
    let server = Server::start(address, (&recording.rig, None), feed.place(), Vec::new(), |_| {}).unwrap();
    let port = server.address().port();
    let mut sleeper = enter(port);
    sleeper.next_text();
    let watcher = std::thread::spawn(move || {
        let channel = sleeper.next_text()["channels"][0]["id"].clone();
        sleeper.ask(&json!({ "op": "subscribe", "subscriptions": [{ "id": 1, "channelId": channel }] }));
        sleeper
    });
    let (with, bytes_with) = record("with.mcap", Some(feed));
    let sleeper = watcher.join().unwrap();
    let ending = Instant::now();
    let watched = server.finish();
    assert!(ending.elapsed() < Duration::from_secs(5), "{:?}", ending.elapsed());
    let (without, bytes_without) = record("without.mcap", None);
    assert!(bytes_with == bytes_without, "the file does not know of it");
    assert!(with < without * 3 + Duration::from_secs(1), "{with:?} with it, {without:?} without");
    assert_eq!(watched.clients, 1);
    assert!(watched.dropped > samples / 10 && watched.dropped <= samples, "{watched:?}");
    drop(sleeper);
}

#[test]
fn an_address_that_cannot_be_used_is_refused_before_anything_is_recorded_and_an_open_one_is_warned_of() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.mcap");
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    let arguments = |address| ["record", "--replay", CREEP, "--speed", "0", "-o", text(&file), "--live", address];
    refused(
        &arguments(&address),
        &[&format!("cannot listen on 127.0.0.1 port {}", taken.local_addr().unwrap().port()), "--live 127.0.0.1:0"],
    );
    refused(&arguments("rig.local"), &["an address, a port or both"]);
    refused(&[&arguments("9")[..], &["--live-origin", "lab"]].concat(), &["https://HOST"]);
    assert!(!file.exists());
    let open = document(surgescope(arguments("0.0.0.0:0").iter().chain(&["--json"])).output().unwrap());
    assert!(open["warnings"].to_string().contains("everyone on the network can watch"), "{}", open["warnings"]);
    assert_eq!(open["live"], json!({ "clients": 0, "dropped": 0 }));
}
