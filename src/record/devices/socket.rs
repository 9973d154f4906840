//! A device behind a socket: connecting to it, and noticing that it is gone.

use std::io::{self, ErrorKind, Read};
use std::net::{SocketAddr, TcpStream, ToSocketAddrs as _};
use std::sync::mpsc::channel;
use std::thread;
use std::time::Duration;

use socket2::{SockRef, TcpKeepalive};

use crate::record::devices::port::READ_TIMEOUT;
use crate::record::error::RecordError;

/// How long a name may take to be found, and a device to answer.
const CONNECT_WITHIN: Duration = Duration::from_secs(3);
/// A device that loses its power, or its cable, says no farewell. One that sends nothing for so long is asked by the
/// system whether it is there, and given up after so many questions without an answer: in 4 s.
const ASKED_AFTER: Duration = Duration::from_secs(1);
const ASKED_EVERY: Duration = Duration::from_secs(1);
#[cfg(unix)]
const QUESTIONS: u32 = 3;

/// A connection to a device.
#[derive(Debug)]
pub struct Socket(TcpStream);

impl Socket {
    /// Connects to `HOST:PORT`.
    ///
    /// # Errors
    /// A name that nobody knows, a device that does not answer or refuses.
    pub fn connect(device: &str, address: &str) -> Result<Socket, RecordError> {
        let unresolved = |reason: String| {
            let host = address.rsplit_once(':').map_or(address, |(host, _)| host).to_owned();
            RecordError::Unresolved { device: device.to_owned(), host, reason }
        };
        let mut refusal = None;
        for address in resolved(address.to_owned()).map_err(unresolved)? {
            match TcpStream::connect_timeout(&address, CONNECT_WITHIN).and_then(prepared) {
                Ok(stream) => return Ok(Socket(stream)),
                Err(error) => refusal = Some(error),
            }
        }
        let reason = match refusal {
            Some(error) if error.kind() == ErrorKind::ConnectionRefused => {
                "it is there, but nothing listens on that port: is its program started, and is the port's number right?"
                    .into()
            }
            Some(error) if matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::WouldBlock) => {
                format!("no answer within {} s: is it switched on and in this network?", CONNECT_WITHIN.as_secs())
            }
            Some(error) => format!("{error}: is it switched on and in this network?"),
            None => "its name has no address".into(),
        };
        Err(RecordError::Unreachable { device: device.to_owned(), address: address.to_owned(), reason })
    }
}

impl Read for Socket {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match self.0.read(buffer) {
            Ok(0) => Err(io::Error::other("the device closed the connection")),
            // A read that waited in vain is another error on Unix.
            Err(error) if cfg!(unix) && error.kind() == ErrorKind::TimedOut => {
                Err(io::Error::other("the device no longer answers"))
            }
            read => read,
        }
    }
}

fn prepared(stream: TcpStream) -> io::Result<TcpStream> {
    stream.set_read_timeout(Some(READ_TIMEOUT))?;
    let alive = TcpKeepalive::new().with_time(ASKED_AFTER).with_interval(ASKED_EVERY);
    #[cfg(unix)]
    let alive = alive.with_retries(QUESTIONS);
    SockRef::from(&stream).set_tcp_keepalive(&alive)?;
    Ok(stream)
}

/// The addresses of a name. The system may take as long as it likes for that: then a thread is left behind with it.
fn resolved(address: String) -> Result<Vec<SocketAddr>, String> {
    let (sender, found) = channel();
    let look = move || {
        let _ = sender.send(address.to_socket_addrs().map(Iterator::collect));
    };
    thread::Builder::new().name("name of a device".into()).spawn(look).map_err(|error| error.to_string())?;
    match found.recv_timeout(CONNECT_WITHIN) {
        Ok(addresses) => addresses.map_err(|error: io::Error| error.to_string()),
        Err(_) => Err(format!("no answer within {} s", CONNECT_WITHIN.as_secs())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write as _;
    use std::net::TcpListener;

    fn refusal(address: &str) -> String {
        Socket::connect("daq", address).map(drop).unwrap_err().to_string()
    }

    #[test]
    fn what_is_sent_is_read_and_a_farewell_is_an_error_that_says_so() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let mut socket = Socket::connect("daq", &listener.local_addr().unwrap().to_string()).unwrap();
        let (mut device, _) = listener.accept().unwrap();
        let mut buffer = [0; 8];
        let waited = socket.read(&mut buffer).unwrap_err().kind();
        assert!(matches!(waited, ErrorKind::WouldBlock | ErrorKind::TimedOut), "{waited:?}");
        device.write_all(b"12,3\n").unwrap();
        assert_eq!((socket.read(&mut buffer).unwrap(), &buffer[..5]), (5, &b"12,3\n"[..]));
        drop(device);
        assert_eq!(socket.read(&mut buffer).unwrap_err().to_string(), "the device closed the connection");
    }

    #[test]
    fn a_device_that_cannot_be_reached_says_why() {
        let free = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
        let text = refusal(&free.to_string());
        assert!(text.contains(&format!("tcp://{free}")) && text.contains("nothing listens"), "{text}");
        let text = refusal("no-such-host.invalid:5025");
        assert!(text.contains("'no-such-host.invalid'") && text.contains("spelling"), "{text}");
    }
}
