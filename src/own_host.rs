//! Whether a request names this server.
//!
//! A page of another site can have its name point to this machine (rebinding), and then talk to a server here as if it
//! were its own. The Host header tells: it is that name, and not the server's.

use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};

use axum::http::uri::Authority;

/// Whether a Host header names the server at `own`: by the address that it listens on, or as this machine.
pub(crate) fn is_own_host(host: &str, own: SocketAddr) -> bool {
    let Ok(said) = host.parse::<Authority>() else { return false };
    // browsers leave the usual port out
    if host.contains('@') || said.port_u16().unwrap_or(80) != own.port() {
        return false;
    }
    match literal(&said) {
        // listening on all addresses, any address is the server's own, but no name is
        Some(ip) => {
            ip == own.ip() || ip == Ipv4Addr::LOCALHOST || ip == Ipv6Addr::LOCALHOST || own.ip().is_unspecified()
        }
        None => said.host().eq_ignore_ascii_case("localhost"),
    }
}

/// Whether a host, with or without a port, is this machine.
pub(crate) fn is_this_machine(host: &str) -> bool {
    let Ok(said) = host.parse::<Authority>() else { return false };
    !host.contains('@') && literal(&said).map_or(said.host().eq_ignore_ascii_case("localhost"), |ip| ip.is_loopback())
}

fn literal(said: &Authority) -> Option<IpAddr> {
    said.host().trim_start_matches('[').trim_end_matches(']').parse().ok()
}
