//! Whoever has no business in the workbench is refused, and nothing changes.

use std::io::{ErrorKind, Read as _};
use std::net::TcpStream;
use std::time::Duration;

use serde_json::{Value, json};

use crate::common::{CREEP, here};
use crate::workbench::client::Workbench;

const GETS: [&str; 17] = [
    "/",
    "/assets/index.html",
    "/api/state",
    "/api/effects",
    "/api/events",
    "/api/curves",
    "/api/curves.csv",
    "/api/curves.parquet",
    "/api/compare",
    "/api/disk",
    "/api/glance",
    "/api/history",
    "/api/known",
    "/api/models",
    "/api/simulation",
    "/api/report",
    "/api/fit.toml",
];
const POSTS: [&str; 15] = [
    "/api/simulate",
    "/api/diagnose",
    "/api/fit",
    "/api/profile",
    "/api/add",
    "/api/remove",
    "/api/undo",
    "/api/redo",
    "/api/force",
    "/api/open",
    "/api/cancel",
    "/api/import",
    "/api/recover",
    "/api/record",
    "/api/record/stop",
];
const JSON: (&str, &str) = ("Content-Type", "application/json");

#[test]
fn strangers_are_refused_at_every_route_and_change_nothing() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::copy(here(CREEP), folder.path().join("run.mcap")).unwrap();
    let bench = Workbench::open(folder.path(), &["run.mcap"]);
    bench.fitted();
    let before = bench.state();
    let bearer = format!("Bearer {}", bench.token);
    let wrong = format!("Bearer {}", "0".repeat(bench.token.len()));
    let own = format!("http://{}", bench.host);
    let cookie = format!("surgescope_{}={}", bench.host.rsplit(':').next().unwrap(), bench.token);
    let port = bench.host.rsplit(':').next().unwrap();
    let rebound = format!("evil.example:{port}");
    let routes = GETS.map(|path| ("GET", path)).into_iter().chain(POSTS.map(|path| ("POST", path)));
    let body = json!({ "effect": "viscoelastic-wall" }).to_string();
    for (method, path) in routes {
        let body = if method == "POST" { body.as_bytes() } else { b"" };
        let refused = |expected: u16, headers: &[(&str, &str)]| {
            let (status, head, answer) = bench.request(method, path, &[headers, &[JSON]].concat(), body);
            let why: Value = serde_json::from_slice(&answer).unwrap_or_default();
            assert_eq!(status, expected, "{method} {path} {headers:?}: {head}");
            assert!(why["error"].is_string(), "{method} {path} {headers:?}: {why}");
            assert!(head.contains("nosniff") && head.contains("default-src 'self'"), "{head}");
        };
        refused(401, &[]);
        refused(401, &[("Authorization", &wrong)]);
        refused(401, &[("Cookie", "surgescope_1=x; other=y")]);
        refused(403, &[("Authorization", &bearer), ("Host", &rebound)]);
        refused(403, &[("Authorization", &bearer), ("Host", "localhost:1")]);
        refused(403, &[("Authorization", &bearer), ("Origin", "http://evil.example")]);
        refused(403, &[("Authorization", &bearer), ("Origin", "null")]);
        if method == "POST" {
            refused(403, &[("Cookie", &cookie)]);
            let plain = [("Authorization", &bearer[..]), ("Content-Type", "text/plain")];
            assert_eq!(bench.request(method, path, &plain, body).0, 415, "{path}");
            let no_kind = [("Authorization", &bearer[..])];
            assert_eq!(bench.request(method, path, &no_kind, body).0, 415, "{path}");
        }
        let other = if method == "GET" { "POST" } else { "GET" };
        let known = [("Authorization", &bearer[..]), JSON];
        assert_eq!(bench.request(other, path, &known, b"").0, 405, "{other} {path}");
        assert_eq!(bench.request("DELETE", path, &known, b"").0, 405, "DELETE {path}");
    }
    // a hundred megabytes are refused by their announced length
    let long = format!(
        "POST /api/import HTTP/1.1\r\nHost: {}\r\nAuthorization: {bearer}\r\nContent-Type: application/json\r\n\
         Content-Length: 104857600\r\nConnection: close\r\n\r\n",
        bench.host
    );
    assert_eq!(bench.raw(long.as_bytes()).0, 413);
    for path in
        ["/assets/../Cargo.toml", "/assets/..%2f..%2fCargo.toml", "/../run.mcap", "/run.mcap", "/api/../run.mcap"]
    {
        let known = [("Authorization", &bearer[..])];
        assert_eq!(bench.request("GET", path, &known, b"").0, 404, "{path}");
    }
    // headers are read as other programs write them
    let lower = bearer.replacen("Bearer", "bearer", 1);
    let odd = [("Authorization", &lower[..]), ("Content-Type", "Application/JSON ; charset=utf-8")];
    assert_eq!(bench.request("POST", "/api/simulate", &odd, b"{}").0, 200);
    let basic = [("Cookie", &cookie[..]), ("Authorization", "Basic YTpi"), JSON];
    assert_eq!(bench.request("POST", "/api/simulate", &basic, b"{}").0, 403, "a page's request without its Origin");
    // the page itself comes in by the cookie and says its Origin
    let by_page = [("Cookie", &cookie[..]), ("Origin", &own[..]), JSON];
    assert_eq!(bench.request("POST", "/api/simulate", &by_page, b"{}").0, 200);
    let after = bench.state();
    assert_eq!(before, after);
    assert!(!folder.path().join("run.model.toml").exists());
}

#[test]
fn connections_without_the_token_shut_nobody_out() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::copy(here(CREEP), folder.path().join("run.mcap")).unwrap();
    let bench = Workbench::open(folder.path(), &["run.mcap"]);
    let mut idle: Vec<TcpStream> = (0..320).map(|_| TcpStream::connect(&bench.host).unwrap()).collect();
    bench.state();
    let mut is_closed = |number: usize| {
        let connection: &mut TcpStream = &mut idle[number];
        connection.set_read_timeout(Some(Duration::from_millis(200))).unwrap();
        !connection.read(&mut [0]).is_err_and(|e| matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut))
    };
    assert!(is_closed(0), "the oldest makes room");
    // the server closes every idle connection after a while, which would have been too late for a page
    assert!(!is_closed(319), "the newest was waited for");
}

#[test]
fn the_token_in_the_address_becomes_a_cookie() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::copy(here(CREEP), folder.path().join("run.mcap")).unwrap();
    let bench = Workbench::open(folder.path(), &["run.mcap"]);
    let entrance = format!("/?token={}", bench.token);
    let (status, head, _) = bench.request("GET", &entrance, &[], b"");
    assert_eq!(status, 303, "{head}");
    let of = |name: &str| {
        let line = head.lines().find_map(|line| line.strip_prefix(name)).unwrap_or_else(|| panic!("{name}: {head}"));
        line.trim().to_owned()
    };
    assert_eq!(of("location:"), "/");
    let cookie = of("set-cookie:");
    assert!(cookie.contains("HttpOnly") && cookie.contains("SameSite=Strict"), "{cookie}");
    let value = cookie.split(';').next().unwrap();
    assert_eq!(bench.request("GET", "/", &[("Cookie", value)], b"").0, 200);
    let elsewhere = [("Host", "evil.example")];
    assert_eq!(bench.request("GET", &entrance, &elsewhere, b"").0, 403, "not under another name");
    assert_eq!(bench.request("GET", "/?token=1234", &[], b"").0, 401);
    assert_eq!(bench.request("GET", &format!("/api/state?token={}", bench.token), &[], b"").0, 401);
}
