//! `surgescope ports`: the serial ports of this machine, and whether a rig's devices are there.

use std::path::{Path, PathBuf};

use serde_json::json;

use crate::cli::console::document::say_document;
use crate::cli::console::outcome::{CommandResult, Outcome};
use crate::cli::console::print::{say, say_text};
use crate::record::devices::port::{PortInfo, list};
use crate::record::devices::reader::check;
use crate::record::session::live_test::live_devices;
use crate::rig::{Device, Rig};

/// List the serial ports, or try the devices of a rig.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Try to open the ports of this rig's devices; exit code 1 if one cannot be opened. Commands are looked up, not
    /// started.
    #[arg(long, value_name = "RIG")]
    rig: Option<PathBuf>,
}

/// Runs the command.
///
/// # Errors
/// A rig file that cannot be used.
pub fn run(args: Args, json: bool) -> CommandResult {
    let ports = list();
    let devices = args.rig.as_deref().map(tried).transpose()?.unwrap_or_default();
    let all_open = devices.iter().all(|(_, problem)| problem.is_none());
    if json {
        let entry = |(device, problem): &Tried| json!({"name": device.name, "port": shown(device), "problem": problem});
        let devices: Vec<_> = devices.iter().map(entry).collect();
        say_document(json!({"ports": ports, "devices": devices}))?;
    } else {
        say_text!(table(&ports));
        for (device, problem) in &devices {
            let found = match (problem, device.port.command()) {
                (Some(problem), _) => problem,
                (None, Some(_)) => "can be started (it was not)",
                (None, None) => "can be opened",
            };
            let place = if device.port.command().is_some() { "by" } else { "on" };
            say!("device '{}' {place} {}: {found}", device.name, device.port);
        }
    }
    Ok(if all_open { Outcome::Done } else { Outcome::No })
}

/// A port as the rig file has it; the words of a command as a shell would take them.
fn shown(device: &Device) -> String {
    device.port.command().map_or_else(|| device.port.to_string(), ToString::to_string)
}

/// A device, and what keeps its port from being opened.
type Tried = (Device, Option<String>);

/// The devices of a rig.
fn tried(rig: &Path) -> Result<Vec<Tried>, Box<dyn std::error::Error + Send + Sync>> {
    let devices = live_devices(&Rig::load(rig)?, &[])?;
    let with_problem = |device: Device| {
        let problem = check(&device).err().map(|error| error.to_string());
        (device, problem)
    };
    Ok(devices.into_iter().map(with_problem).collect())
}

fn table(ports: &[PortInfo]) -> String {
    if ports.is_empty() {
        return "no serial port found: plug the device in and check that its driver is loaded\n".to_owned();
    }
    let width = ports.iter().map(|port| port.path.len()).max().unwrap_or(0);
    let line = |port: &PortInfo| {
        let product = port.product.as_deref().unwrap_or("");
        let serial = port.serial_number.as_ref().map(|number| format!(", serial number {number}")).unwrap_or_default();
        let stable = port.stable_path.as_ref().map(|path| format!("\n{:width$}  = {path}", "")).unwrap_or_default();
        format!("{:width$}  {:9}  {product}{serial}{stable}\n", port.path, port.kind)
    };
    ports.iter().map(line).collect()
}
