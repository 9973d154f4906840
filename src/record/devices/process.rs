//! A device that is a process: its standard output is what the device sends, its standard error are messages for
//! people.
//!
//! It leads a process group of its own: a Ctrl-C is not meant for it, and what it starts ends with it. It is asked to
//! end (SIGTERM), and killed a while later. Beside it a shell waits for the end of a pipe whose other end only this
//! program has: where this program is killed, that pipe closes, and the shell ends the group.

use std::io::{self, BufRead as _, BufReader, ErrorKind, Read, Write as _};
use std::os::fd::AsFd as _;
use std::os::unix::process::{CommandExt as _, ExitStatusExt as _};
use std::path::{Path, PathBuf, absolute};
use std::process::{Child, ChildStderr, ChildStdout, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::thread;
use std::time::{Duration, Instant};

use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::sys::signal::{Signal, killpg};
use nix::unistd::Pid;

use crate::record::devices::port::READ_TIMEOUT;
use crate::record::devices::queue::{Input, Queue};
use crate::record::error::RecordError;
use crate::rig::Command;
use crate::shown::Shown as _;

/// How long a process has to end by itself.
const GRACE: Duration = Duration::from_secs(3);
/// How often it is looked whether it has.
const LOOK_EVERY: Duration = Duration::from_millis(10);
/// How long its last words may take after its end.
const LAST_WORDS: Duration = Duration::from_millis(300);
/// A longer message is cut, bytes.
const LONGEST_MESSAGE: u64 = 1000;
/// No more messages are passed on in a second: a flood of them must not take the queue from the samples.
const MOST_A_SECOND: u32 = 100;

/// Waits for a line, or for the end of the pipe: at that it ends the process group $1. `3` is [`GRACE`].
const GUARD: &str = "read -r _ || { kill -s TERM -- -$1; sleep 3; kill -s KILL -- -$1; }";

/// A process that runs.
#[derive(Debug)]
pub struct Process {
    child: Child,
    output: ChildStdout,
    guard: Option<Child>,
    /// Its sender is dropped when the last message has been passed on.
    messages_over: Receiver<()>,
}

impl Process {
    /// Starts the command in the rig file's folder; its messages go to the queue.
    ///
    /// # Errors
    /// A rig without a folder; a program that is not there, that is not executable, or that the system refuses to
    /// start.
    pub fn start(device: &str, command: &Command, queue: &Queue) -> Result<Process, RecordError> {
        let (program, folder) = located(device, command)?;
        let mut process = std::process::Command::new(&program);
        process.args(&command.words[1..]).current_dir(&folder).process_group(0);
        // Python writes what it prints when 8 KiB are there: samples would come seconds late, and be lost when it dies.
        process.env("PYTHONUNBUFFERED", "1");
        process.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let refused = |source: io::Error| refusal(device, command, &folder, &source);
        let mut child = process.spawn().map_err(refused)?;
        let (Some(output), Some(messages)) = (child.stdout.take(), child.stderr.take()) else {
            return Err(refused(ErrorKind::BrokenPipe.into()));
        };
        let (over, messages_over) = channel();
        let queue = queue.clone();
        let listen = move || {
            let _over = over;
            pass_on(messages, &queue);
        };
        let listening = thread::Builder::new().name(format!("messages {device}")).spawn(listen);
        let mut process = Process { child, output, guard: None, messages_over };
        // Dropped on the way, the process is ended.
        listening.map_err(refused)?;
        process.guard = Some(process.guarded().map_err(refused)?);
        Ok(process)
    }

    /// The shell that ends the group where this program cannot.
    fn guarded(&self) -> io::Result<Child> {
        let mut guard = std::process::Command::new("/bin/sh");
        guard.args(["-c", GUARD, "sh", &self.child.id().to_string()]).process_group(0);
        guard.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::null()).spawn()
    }

    /// Waits for its end, at most for some time.
    fn wait(&mut self, most: Duration) -> Option<ExitStatus> {
        let until = Instant::now() + most;
        loop {
            match self.child.try_wait() {
                Ok(Some(status)) => return Some(status),
                Ok(None) if Instant::now() < until => thread::sleep(LOOK_EVERY),
                _ => return None,
            }
        }
    }

    fn signal(&self, signal: Signal) {
        // That nobody is left to take it is no error.
        let _ = killpg(Pid::from_raw(self.child.id() as i32), signal);
    }

    /// Its output has ended: 0 where it is done, else why it ended.
    fn ended(&mut self) -> io::Result<usize> {
        let status = self.wait(GRACE);
        let _ = self.messages_over.recv_timeout(LAST_WORDS);
        let why = match status {
            Some(status) if status.success() => return Ok(0),
            Some(status) => match (status.code(), status.signal()) {
                (Some(code), _) => format!("the command exited with code {code}"),
                (None, signal) => format!("the command was killed by signal {}", signal.unwrap_or(0)),
            },
            None => "the command closed its standard output, and went on".to_owned(),
        };
        Err(io::Error::other(why))
    }
}

impl Read for Process {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let mut ready = [PollFd::new(self.output.as_fd(), PollFlags::POLLIN)];
        let timeout = PollTimeout::try_from(READ_TIMEOUT).unwrap_or(PollTimeout::MAX);
        if poll(&mut ready, timeout)? == 0 {
            // A process that it left behind may hold its output open.
            return match self.child.try_wait()? {
                Some(_) => self.ended(),
                None => Err(ErrorKind::TimedOut.into()),
            };
        }
        match self.output.read(buffer)? {
            0 => self.ended(),
            length => Ok(length),
        }
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        self.signal(Signal::SIGTERM);
        self.wait(GRACE);
        // also what it started, and left behind
        self.signal(Signal::SIGKILL);
        let _ = self.child.wait();
        if let Some(mut guard) = self.guard.take() {
            let _ = guard.stdin.take().map(|mut pipe| pipe.write_all(b"\n"));
            let _ = guard.wait();
        }
    }
}

/// Checks that a command can be started, without starting it.
///
/// # Errors
/// As [`Process::start`], as far as the file tells.
pub fn check(device: &str, command: &Command) -> Result<(), RecordError> {
    use nix::unistd::{AccessFlags, access};
    let (program, folder) = located(device, command)?;
    let found = |path: &Path| path.is_file() && access(path, AccessFlags::X_OK).is_ok();
    let on_path =
        || std::env::var_os("PATH").is_some_and(|all| std::env::split_paths(&all).any(|p| found(&p.join(&program))));
    let kind = match program.is_absolute() {
        true if found(&program) => return Ok(()),
        true if program.exists() => ErrorKind::PermissionDenied,
        false if on_path() => return Ok(()),
        _ => ErrorKind::NotFound,
    };
    Err(refusal(device, command, &folder, &kind.into()))
}

/// The program and the folder to start it in. A program with a slash in its name is found from that folder, any other
/// on the PATH.
fn located(device: &str, command: &Command) -> Result<(PathBuf, PathBuf), RecordError> {
    let Some(folder) = &command.folder else {
        return Err(RecordError::Homeless { device: device.to_owned(), command: command.to_string() });
    };
    let folder = absolute(folder).unwrap_or_else(|_| folder.clone());
    let program = Path::new(command.words.first().map_or("", String::as_str));
    let is_path = program.components().count() > 1 || program.is_absolute();
    Ok((if is_path { folder.join(program) } else { program.to_owned() }, folder))
}

fn refusal(device: &str, command: &Command, folder: &Path, error: &io::Error) -> RecordError {
    let (device, program) = (device.to_owned(), command.words.first().cloned().unwrap_or_default());
    let folder_shown = folder.shown().into_owned();
    match error.kind() {
        _ if !folder.is_dir() => RecordError::CommandUnusable {
            device,
            program,
            reason: format!("its folder {folder_shown} does not exist"),
        },
        ErrorKind::NotFound if folder.join(&program).exists() && !program.contains('/') => {
            RecordError::CommandElsewhere { device, program, folder: folder_shown }
        }
        // The interpreter that the first line of a script names is missing, too, as far as the system says.
        ErrorKind::NotFound if folder.join(&program).exists() => RecordError::CommandUnusable {
            device,
            program,
            reason: "the interpreter that its first line names is not there".into(),
        },
        ErrorKind::NotFound => RecordError::CommandMissing { device, program, folder: folder_shown },
        ErrorKind::PermissionDenied => RecordError::CommandForbidden { device, program },
        _ => {
            let hint =
                "; a script needs a first line such as #!/usr/bin/env python3, or its interpreter as the first word";
            let hint = if error.raw_os_error() == Some(nix::errno::Errno::ENOEXEC as i32) { hint } else { "" };
            RecordError::CommandUnusable { device, program, reason: format!("{error}{hint}") }
        }
    }
}

/// Passes on what a process says, line by line, until it says no more or nobody listens. It is always read, for else
/// the process would wait.
fn pass_on(messages: ChildStderr, queue: &Queue) {
    let mut messages = BufReader::new(messages);
    let mut line = Vec::new();
    let (mut second, mut passed, mut left_out) = (Instant::now(), 0, 0_u64);
    let say = |text: String| queue.send(Input::Said { at_ns: queue.host.now_ns(), text });
    loop {
        line.clear();
        let length = messages.by_ref().take(LONGEST_MESSAGE).read_until(b'\n', &mut line).unwrap_or(0);
        if length == 0 || second.elapsed() >= Duration::from_secs(1) {
            if left_out > 0 && !say(format!("({left_out} lines left out)")) {
                return;
            }
            (second, passed, left_out) = (Instant::now(), 0, 0);
        }
        if length == 0 {
            return;
        }
        let text = String::from_utf8_lossy(&line);
        let text: String = text.trim_end().chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
        if text.trim().is_empty() {
            continue;
        }
        if passed == MOST_A_SECOND {
            left_out += 1;
            continue;
        }
        passed += 1;
        if !say(text) {
            return;
        }
    }
}
