//! `surgescope open`: the workbench in the browser.

use std::collections::BTreeMap;
use std::io::IsTerminal;
use std::net::{IpAddr, Ipv4Addr};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::atomic::Ordering;
use std::time::Duration;

use serde_json::json;

use crate::cli::console::document::say_line;
use crate::cli::console::last_words::LastWords;
use crate::cli::console::outcome::{CommandResult, Outcome};
use crate::cli::console::print::{say, tell, tell_warning};
use crate::cli::console::stop::{STOP, stop_on_signals};
use crate::report::advice::quoted;
use crate::shown::Shown as _;
use crate::web::server::Server;
use crate::web::session::Session;
use crate::web::session::place::Place;

/// How long the first fit may take before the address is printed; it goes on meanwhile.
const FIRST_FIT: Duration = Duration::from_millis(500);
/// Folders that are opened where none is named: recordings of the project, or what `demo` left.
const USUAL: [&str; 2] = ["recordings", "surgescope-demo"];

/// Work on recordings in the browser: look, diagnose, add effects, move sliders.
///
/// The models are kept in NAME.model.toml beside the recording, the file that `add`, `undo` and `refit` work on. The
/// address carries a token; without it nobody comes in. Ctrl-C ends the workbench.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Recordings of one rig, a folder of recordings, a model file, a rig file, or a table of a logger, for which a rig
    /// is made [default: recordings, or surgescope-demo].
    #[arg(value_name = "PATH")]
    paths: Vec<PathBuf>,
    /// Do not open a browser.
    #[arg(long)]
    no_browser: bool,
    /// Port to listen on; 0 takes a free one.
    #[arg(long, value_name = "PORT", default_value_t = 0)]
    port: u16,
    /// Address to listen on. Any other than the default can be reached from the network: who reads along can use the
    /// workbench, because the connection is not encrypted.
    #[arg(long, value_name = "ADDRESS", default_value_t = IpAddr::V4(Ipv4Addr::LOCALHOST))]
    listen: IpAddr,
}

impl Args {
    /// To open one path with every option at its default.
    pub fn of(path: &Path) -> Args {
        let (no_browser, port, listen) = (false, 0, IpAddr::V4(Ipv4Addr::LOCALHOST));
        Args { paths: vec![path.to_owned()], no_browser, port, listen }
    }
}

/// Runs it.
///
/// # Errors
/// Files that cannot be opened together, an address or port that cannot be used.
pub fn run(args: Args, json: bool) -> CommandResult {
    let paths = if args.paths.is_empty() { vec![usual()?] } else { args.paths };
    let place = Place::of(&paths)?;
    stop_on_signals()?;
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let bound = runtime.block_on(Server::bind(args.listen, args.port));
    let server = bound.map_err(|e| format!("cannot listen on {} port {}: {e}", args.listen, args.port))?;
    let session = Session::new(place, commands);
    session.wait(FIRST_FIT);
    let url = server.url();
    if !args.listen.is_loopback() {
        tell_warning!("the network can reach this address, and the connection is not encrypted");
    }
    if json {
        say_line(json!({ "url": url, "token": server.token() }))?;
    } else {
        say!("The workbench is at {url}");
        tell!("Ctrl-C ends it");
    }
    if let Some(reason) = session.jobs.failed() {
        tell!("error: {reason}");
    }
    if args.listen.is_unspecified() {
        tell!("from another machine, put this machine's address in place of the one above");
    }
    if std::env::var_os("SSH_CONNECTION").is_some() {
        let port = server.address().port();
        tell!("over SSH, forward the port on your own machine: ssh -L {port}:127.0.0.1:{port} HOST");
    } else if !args.no_browser && !json {
        show_in_browser(&url);
    }
    let ended = session.clone();
    runtime.block_on(server.serve(session, async {
        while !STOP.load(Ordering::Relaxed) {
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    }));
    tell!("stopped");
    ended.recorder.finish();
    let _words = LastWords::before(Outcome::Done.code(), &STOP);
    // a job that is still at work loses nothing: the model file is written whole or not at all
    runtime.shutdown_background();
    Ok(Outcome::Done)
}

/// What a person would type for the actions of the page; `EFFECT` stands for the effect.
fn commands(recordings: &[PathBuf], model: &Path) -> BTreeMap<&'static str, String> {
    let model = quoted(&model.shown());
    let recordings: Vec<String> = recordings.iter().map(|path| quoted(&path.shown())).collect();
    BTreeMap::from([
        ("fit", format!("surgescope refit {model}")),
        ("calibrate", format!("surgescope calibrate {} --effects EFFECTS --save {model}", recordings.join(" "))),
        ("diagnose", format!("surgescope diagnose {} --apply {model}", recordings.join(" "))),
        ("add", format!("surgescope add EFFECT {model}")),
        ("undo", format!("surgescope undo {model}")),
    ])
}

fn usual() -> Result<PathBuf, String> {
    let found = USUAL.iter().map(Path::new).find(|folder| folder.is_dir());
    found.map(Path::to_owned).ok_or_else(|| {
        "name what to open: a recording, a folder of recordings, a model file, or a table of a logger; `surgescope demo` makes a recording to try".to_owned()
    })
}

/// Opens the address in the desktop's browser, where there is a desktop.
fn show_in_browser(url: &str) {
    if !std::io::stdout().is_terminal() {
        return;
    }
    let (program, before): (&str, &[&str]) = match std::env::consts::OS {
        "macos" => ("open", &[]),
        "windows" => ("rundll32", &["url.dll,FileProtocolHandler"]),
        _ => ("xdg-open", &[]),
    };
    let mut command = Command::new(program);
    command.args(before).arg(url).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    if command.spawn().is_err() {
        tell!("no browser could be started: open the address yourself");
    }
}
