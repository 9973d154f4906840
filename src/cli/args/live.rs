//! `record --live`: the recording goes out over a WebSocket while it is made.

use std::net::{IpAddr, Ipv4Addr, SocketAddr};

use crate::cli::console::last_words::tell_first;
use crate::cli::console::outcome::AnyError;
use crate::cli::console::print::tell_warning;
use crate::live::Server;
use crate::record::session::feed::Feed;
use crate::record::session::live_test::Options;
use crate::recording::CsvFormat;
use crate::rig::Rig;

/// The port that Foxglove proposes.
const PORT: u16 = 8765;

/// Options of a recording that can be watched.
#[derive(Debug, clap::Args)]
pub struct Live {
    /// Show in Foxglove or Lichtblick what is recorded, while it is: open a connection of the kind Foxglove WebSocket
    /// there, such as to ws://127.0.0.1:8765. ADDR is an address, a port or both [default: 127.0.0.1:8765]. The network
    /// can reach any address that does not begin with 127, and everyone there can watch.
    #[arg(long, value_name = "ADDR", num_args = 0..=1, default_missing_value = "127.0.0.1:8765", value_parser = address)]
    live: Option<SocketAddr>,
    /// Let pages of this origin watch, too, such as https://lichtblick.example; may be repeated. Known are Foxglove's
    /// page, the desktop applications and pages of this computer.
    #[arg(long, value_name = "ORIGIN", requires = "live", value_parser = origin)]
    live_origin: Vec<String>,
}

/// `ADDRESS`, `PORT` or `ADDRESS:PORT`.
fn address(text: &str) -> Result<SocketAddr, String> {
    let here = IpAddr::V4(Ipv4Addr::LOCALHOST);
    let named = text.strip_prefix("localhost").map(|rest| format!("{here}{rest}"));
    let text = named.as_deref().unwrap_or(text);
    let port = || text.strip_prefix(':').unwrap_or(text).parse().ok();
    let ip = || text.parse::<IpAddr>().ok();
    (text.parse().ok())
        .or_else(|| Some(SocketAddr::new(here, port()?)))
        .or_else(|| Some(SocketAddr::new(ip()?, PORT)))
        .ok_or_else(|| format!("write it as an address, a port or both, such as 127.0.0.1:{PORT}"))
}

/// As browsers write it: a scheme and a host, nothing behind.
fn origin(text: &str) -> Result<String, String> {
    let text = text.trim_end_matches('/');
    match text.split_once("://") {
        Some((scheme, host)) if !scheme.is_empty() && !host.is_empty() && !host.contains('/') => Ok(text.to_owned()),
        _ => Err("write it as https://HOST or http://HOST:PORT".to_owned()),
    }
}

impl Live {
    /// Starts the server that was asked for; the options feed it.
    ///
    /// # Errors
    /// An address that cannot be used.
    pub(crate) fn start(
        &self,
        options: &Options,
        rig: &Rig,
        csv: Option<&CsvFormat>,
    ) -> Result<(Options, Option<Server>), AnyError> {
        let Some(asked) = self.live else { return Ok((options.clone(), None)) };
        let feed = Feed::new();
        let refused = |said: &str| match origin(said) {
            Ok(named) => {
                tell_warning!("live: a page of {named} was refused; if it is yours, add --live-origin {named}")
            }
            Err(_) => tell_warning!("live: a page that does not say its origin ('{said}') was refused"),
        };
        let server = Server::start(asked, (rig, csv), feed.place(), self.live_origin.clone(), refused);
        let server = server.map_err(|error| {
            let (ip, port) = (asked.ip(), asked.port());
            format!(
                "cannot listen on {ip} port {port}: {error}; choose another one, such as --live {}, which takes a free port",
                SocketAddr::new(ip, 0)
            )
        })?;
        let address = server.address();
        if !address.ip().is_loopback() {
            tell_warning!("live: everyone on the network can watch this recording; the connection is not encrypted");
        }
        let mut lines = vec![format!(
            "live at ws://{address}: in Foxglove or Lichtblick, open a connection of the kind Foxglove WebSocket to it"
        )];
        if address.ip().is_unspecified() {
            lines.push(format!("from another computer, put this one's address in place of {}", address.ip()));
        }
        tell_first(lines);
        Ok((Options { feed: Some(feed), ..options.clone() }, Some(server)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_read_and_slips_are_explained() {
        let read = |text| address(text).unwrap().to_string();
        assert_eq!(
            (read("9000"), read(":9000"), read("localhost:9000")),
            ("127.0.0.1:9000".into(), "127.0.0.1:9000".into(), "127.0.0.1:9000".into())
        );
        assert_eq!((read("localhost"), read("0.0.0.0")), ("127.0.0.1:8765".into(), "0.0.0.0:8765".into()));
        assert_eq!((read("[::1]:9"), read("::1")), ("[::1]:9".into(), "[::1]:8765".into()));
        for bad in ["", "rig.local", "70000", "1.2.3:4", "localhosts"] {
            assert!(address(bad).unwrap_err().contains("such as 127.0.0.1:8765"), "{bad}");
        }
    }

    #[test]
    fn an_origin_has_a_scheme_and_no_path() {
        assert_eq!(origin("https://lab.example/"), Ok("https://lab.example".to_owned()));
        assert!(
            origin("lab.example").is_err()
                && origin("https://lab.example/page").is_err()
                && origin("https://").is_err()
        );
    }
}
