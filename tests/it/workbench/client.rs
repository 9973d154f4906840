//! A workbench at work, and a client of a few lines: what it sends is exactly what a test says.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::common::{document, surgescope};

/// Longer than anything here takes on a loaded machine.
pub const LONG: Duration = Duration::from_secs(120);

/// Runs a command in a folder, which must succeed: its document.
pub fn done_in(folder: &Path, arguments: &[&str]) -> Value {
    document(surgescope(arguments).arg("--json").current_dir(folder).output().unwrap())
}

/// Bytes as base64.
pub fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::new();
    for three in bytes.chunks(3) {
        let number = three.iter().enumerate().fold(0u32, |sum, (i, b)| sum | u32::from(*b) << (16 - 8 * i));
        for i in 0..4 {
            let digit = char::from(DIGITS[(number >> (18 - 6 * i) & 63) as usize]);
            text.push(if i <= three.len() { digit } else { '=' });
        }
    }
    text
}

/// A running `surgescope open`.
pub struct Workbench {
    pub process: Child,
    pub host: String,
    pub token: String,
}

impl Workbench {
    pub fn open(folder: &Path, arguments: &[&str]) -> Workbench {
        let mut process = surgescope(["open", "--no-browser", "--json"])
            .args(arguments)
            .current_dir(folder)
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut line = String::new();
        BufReader::new(process.stdout.take().unwrap()).read_line(&mut line).unwrap();
        let first: Value = serde_json::from_str(&line).unwrap();
        let url = first["url"].as_str().unwrap();
        let (host, token) = url.strip_prefix("http://").unwrap().split_once("/?token=").unwrap();
        assert_eq!(first["token"], token);
        Workbench { process, host: host.to_owned(), token: token.to_owned() }
    }

    /// Sends a request as it is and reads the whole answer: status, head and body.
    pub fn raw(&self, request: &[u8]) -> (u16, String, Vec<u8>) {
        let mut stream = TcpStream::connect(&self.host).unwrap();
        stream.set_read_timeout(Some(LONG)).unwrap();
        // the server may refuse before it has read everything
        let _ = stream.write_all(request);
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer);
        let end = answer.windows(4).position(|w| w == b"\r\n\r\n").unwrap_or(answer.len());
        let head = String::from_utf8_lossy(&answer[..end]).into_owned();
        let status = head.split(' ').nth(1).and_then(|s| s.parse().ok()).unwrap_or(0);
        (status, head, answer.get(end + 4..).unwrap_or_default().to_vec())
    }

    pub fn request(&self, method: &str, path: &str, headers: &[(&str, &str)], body: &[u8]) -> (u16, String, Vec<u8>) {
        let mut text = format!("{method} {path} HTTP/1.1\r\nConnection: close\r\nContent-Length: {}\r\n", body.len());
        if !headers.iter().any(|(name, _)| *name == "Host") {
            text += &format!("Host: {}\r\n", self.host);
        }
        headers.iter().for_each(|(name, value)| text += &format!("{name}: {value}\r\n"));
        self.raw(&[text.as_bytes(), b"\r\n", body].concat())
    }

    fn bearer(&self) -> String {
        format!("Bearer {}", self.token)
    }

    pub fn get(&self, path: &str) -> Vec<u8> {
        let (status, head, body) = self.request("GET", path, &[("Authorization", &self.bearer())], b"");
        assert_eq!(status, 200, "{path}: {head} {}", String::from_utf8_lossy(&body));
        body
    }

    /// Why a request is refused.
    pub fn refused(&self, path: &str) -> String {
        let (status, head, body) = self.request("GET", path, &[("Authorization", &self.bearer())], b"");
        assert_eq!(status, 400, "{path}: {head}");
        let answer: Value = serde_json::from_slice(&body).unwrap();
        answer["error"].as_str().unwrap().to_owned()
    }

    pub fn state(&self) -> Value {
        serde_json::from_slice(&self.get("/api/state")).unwrap()
    }

    /// Posts and expects a status.
    pub fn post(&self, path: &str, body: &Value, expected: u16) -> Value {
        let headers = [("Authorization", &self.bearer()[..]), ("Content-Type", "application/json")];
        let (status, head, answer) = self.request("POST", path, &headers, body.to_string().as_bytes());
        assert_eq!(status, expected, "{path} {body}: {head} {}", String::from_utf8_lossy(&answer));
        serde_json::from_slice(&answer).unwrap_or(Value::Null)
    }

    /// Starts a job and returns its events up to its end.
    pub fn job(&self, path: &str, body: &Value) -> Vec<(String, Value)> {
        let mut events = self.events();
        let job = self.post(path, body, 202)["job"].clone();
        let mut heard = Vec::new();
        loop {
            let (name, data) = events.next().expect("the stream of events ended");
            let ends = ["done", "failed"].contains(&&name[..]) && data["job"] == job;
            heard.push((name, data));
            if ends {
                return heard;
            }
        }
    }

    pub fn events(&self) -> Events {
        let mut stream = TcpStream::connect(&self.host).unwrap();
        stream.set_read_timeout(Some(LONG)).unwrap();
        let request =
            format!("GET /api/events HTTP/1.1\r\nHost: {}\r\nAuthorization: {}\r\n\r\n", self.host, self.bearer());
        stream.write_all(request.as_bytes()).unwrap();
        let mut lines = BufReader::new(stream);
        let mut line = String::new();
        while line != "\r\n" {
            line.clear();
            assert!(lines.read_line(&mut line).unwrap() > 0, "no answer to the request for events");
        }
        Events { lines }
    }

    /// Waits until the state is as wished.
    pub fn until(&self, what: &str, wished: impl Fn(&Value) -> bool) -> Value {
        let began = Instant::now();
        loop {
            let state = self.state();
            if wished(&state) {
                return state;
            }
            assert!(began.elapsed() < LONG, "{what} did not come about: {state}");
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    /// Waits until the first fit is there.
    pub fn fitted(&self) -> Value {
        self.until("a model", |state| !state["model"].is_null() && state["job"].is_null())
    }
}

impl Drop for Workbench {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// Events as they come.
pub struct Events {
    lines: BufReader<TcpStream>,
}

impl Iterator for Events {
    type Item = (String, Value);

    fn next(&mut self) -> Option<(String, Value)> {
        let mut name = String::new();
        loop {
            let mut line = String::new();
            // chunks of the transfer are lines of hexadecimal digits between those of the events
            if self.lines.read_line(&mut line).ok()? == 0 {
                return None;
            }
            if let Some(event) = line.trim_end().strip_prefix("event: ") {
                event.clone_into(&mut name);
            } else if let Some(data) = line.trim_end().strip_prefix("data: ") {
                return Some((name, serde_json::from_str(data).unwrap_or(json!(data))));
            }
        }
    }
}
