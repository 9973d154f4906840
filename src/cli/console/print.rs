//! Lines for standard output and standard error.

use std::io::Write as _;

/// A line on standard output. Where nobody reads it any more (`| head`) that is no error: `println!` would panic.
macro_rules! say {
    ($($arg:tt)*) => { $crate::cli::console::print::write_out(format_args!("{}\n", format_args!($($arg)*)))? };
}
/// Text on standard output as it stands, likewise.
macro_rules! say_text {
    ($text:expr) => {
        $crate::cli::console::print::write_out(format_args!("{}", $text))?
    };
}
/// A line on standard error: progress, notes, warnings. Where nobody reads it any more, or its disk is full, the work goes on
/// and the exit code stays: `eprintln!` would panic.
macro_rules! tell {
    ($($arg:tt)*) => { $crate::cli::console::print::write_err(format_args!($($arg)*)) };
}
pub(crate) use {say, say_text, tell};

/// Writes to standard output; a closed pipe is not an error, nor is a terminal that has hung up.
pub(crate) fn write_out(text: std::fmt::Arguments) -> std::io::Result<()> {
    let mut out = std::io::stdout().lock();
    match out.write_fmt(text).and_then(|()| out.flush()) {
        Err(error) if error.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
        #[cfg(unix)]
        Err(error) if error.raw_os_error() == Some(nix::errno::Errno::EIO as i32) => Ok(()),
        other => other,
    }
}

/// Writes a line to standard error, whatever has become of it.
pub(crate) fn write_err(line: std::fmt::Arguments) {
    // in one piece, so that lines of two threads do not mix
    let _ = std::io::stderr().lock().write_all(format!("{line}\n").as_bytes());
}
