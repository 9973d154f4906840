//! Signals: Ctrl-C and the requests to terminate, and files that reach their limit.

use std::sync::atomic::{AtomicBool, Ordering};

/// Set by Ctrl-C and SIGTERM.
pub(crate) static STOP: AtomicBool = AtomicBool::new(false);

/// Set by the second of them: what is at work need not be finished.
pub(crate) static STOP_AT_ONCE: AtomicBool = AtomicBool::new(false);

/// A write beyond the shell's limit of a file's size (`ulimit -f`) fails as on a full disk, with the same error;
/// otherwise the system would end the program without a word. The handler stays for as long as the program runs, and no
/// device's program inherits it.
///
/// # Errors
/// No handler can be set.
#[cfg(unix)]
pub(crate) fn outlive_file_limits() -> std::io::Result<()> {
    use tokio::signal::unix::{SignalKind, signal};

    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let _inside = runtime.enter();
    signal(SignalKind::from_raw(nix::libc::SIGXFSZ)).map(drop)
}

/// Elsewhere no signal comes.
#[cfg(not(unix))]
pub(crate) fn outlive_file_limits() -> std::io::Result<()> {
    Ok(())
}

/// Lets Ctrl-C and the requests to terminate or hang up end the recording, not the program: its file is made whole
/// first.
#[cfg(unix)]
pub(crate) fn stop_on_signals() -> std::io::Result<()> {
    use std::task::Poll;
    use tokio::signal::unix::{SignalKind, signal};

    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let mut requests = {
        // Registered before anything is recorded.
        let _inside = runtime.enter();
        let mut requests = vec![signal(SignalKind::interrupt())?, signal(SignalKind::terminate())?];
        if !ignores_hangup() {
            requests.push(signal(SignalKind::hangup())?);
        }
        requests
    };
    let wait = async move {
        for stop in [&STOP, &STOP_AT_ONCE] {
            std::future::poll_fn(|context| {
                let any = requests.iter_mut().any(|request| request.poll_recv(context).is_ready());
                if any { Poll::Ready(()) } else { Poll::Pending }
            })
            .await;
            stop.store(true, Ordering::Relaxed);
        }
    };
    std::thread::Builder::new().name("signals".into()).spawn(move || runtime.block_on(wait))?;
    Ok(())
}

/// Whether the program was started to go on when its terminal closes, as `nohup` does. Known on Linux; elsewhere a
/// closed terminal ends it.
#[cfg(unix)]
fn ignores_hangup() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    // bit 0 is signal 1, SIGHUP
    ignored.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).is_some_and(|mask| mask & 1 == 1)
}

/// Lets Ctrl-C end the recording, not the program: its file is made whole first.
#[cfg(not(unix))]
pub(crate) fn stop_on_signals() -> std::io::Result<()> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let wait = async {
        for stop in [&STOP, &STOP_AT_ONCE] {
            if tokio::signal::ctrl_c().await.is_ok() {
                stop.store(true, Ordering::Relaxed);
            }
        }
    };
    std::thread::Builder::new().name("signals".into()).spawn(move || runtime.block_on(wait))?;
    Ok(())
}
