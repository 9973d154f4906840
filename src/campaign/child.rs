//! A process of its own for the tasks of one thread of a runner: a task that takes too long can be ended, and one that
//! ends its process takes no other with it.
//!
//! The runner writes a task a line, as in `tasks.jsonl`, to the child's standard input. The child answers with a line
//! on its standard output: `found SECONDS DOCUMENT` or `failed SECONDS "REASON"`.

use std::io::{BufRead, BufReader, Write};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use crate::campaign::error::{CampaignError, Result};
use crate::campaign::perform::Performer;
use crate::campaign::task::Task;

/// What came out of a task.
#[derive(Debug, Clone, PartialEq)]
pub enum Answer {
    /// A JSON document in one line.
    Found(String),
    /// Why it failed.
    Failed(String),
}

impl Answer {
    /// Whether it is a result.
    pub fn is_found(&self) -> bool {
        matches!(self, Answer::Found(_))
    }
}

/// Why there is no answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ended {
    /// The runner was told to end at once.
    AtOnce,
    /// Somebody asked the child to end, as a system that shuts down does.
    Asked,
}

/// What the last panic said.
static PANIC: Mutex<String> = Mutex::new(String::new());

/// Keeps what a panic says for the reason of the task, instead of printing it.
pub fn keep_panics() {
    std::panic::set_hook(Box::new(|about| {
        *PANIC.lock().unwrap_or_else(PoisonError::into_inner) = about.to_string().replace('\n', " ");
    }));
}

/// Does the tasks that `input` names, until it ends.
///
/// # Errors
/// An output that nobody reads.
pub fn serve(folder: &Path, input: impl BufRead, mut output: impl Write) -> std::io::Result<()> {
    let mut performer = Performer::default();
    for line in input.lines() {
        let line = line?;
        let began = Instant::now();
        let outcome = caught(&PANIC, || {
            let task: Task = serde_json::from_str(&line).map_err(|e| format!("the task is damaged: {e}"))?;
            performer.perform(folder, &task)
        });
        let seconds = began.elapsed().as_secs_f64();
        match outcome {
            Ok(document) => writeln!(output, "found {seconds} {document}")?,
            Err(reason) => writeln!(output, "failed {seconds} {}", serde_json::Value::from(reason))?,
        }
        output.flush()?;
    }
    Ok(())
}

/// What `work` gives; a panic is a reason, in the words that the hook has kept.
fn caught<T>(
    said: &Mutex<String>,
    work: impl FnOnce() -> std::result::Result<T, String>,
) -> std::result::Result<T, String> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|_| {
        let words = std::mem::take(&mut *said.lock().unwrap_or_else(PoisonError::into_inner));
        Err(format!("it failed by a fault of the program, please report it: {words}"))
    })
}

/// How children are started and for how long they may work.
pub struct Kind<'a> {
    /// The program.
    pub program: &'a Path,
    /// The words that make it call [`serve`].
    pub arguments: &'a [String],
    /// Most time of a task.
    pub time_limit: Option<Duration>,
    /// Set to end children at once.
    pub at_once: &'a AtomicBool,
}

/// A child at work, or none yet.
pub struct Hand<'a> {
    kind: &'a Kind<'a>,
    process: Option<Process>,
}

struct Process {
    child: Child,
    tasks: ChildStdin,
    answers: Receiver<String>,
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Time between two looks at whether it is to end at once.
const LOOK: Duration = Duration::from_millis(100);

impl<'a> Hand<'a> {
    /// A hand that starts its process with its first task.
    pub fn new(kind: &'a Kind<'a>) -> Hand<'a> {
        Hand { kind, process: None }
    }

    /// Lets the child do a task: the seconds that it took, and what came out of it.
    ///
    /// # Errors
    /// A program that cannot be started.
    pub fn perform(&mut self, task: &str) -> Result<std::result::Result<(f64, Answer), Ended>> {
        let began = Instant::now();
        let mut process = match self.process.take() {
            Some(process) => process,
            None => Process::start(self.kind)?,
        };
        // where it cannot be written, the child has ended, and the wait below says how
        let _ = writeln!(process.tasks, "{task}").and_then(|()| process.tasks.flush());
        loop {
            match process.answers.recv_timeout(LOOK) {
                Ok(line) => match understood(&line) {
                    Some(answer) => {
                        self.process = Some(process);
                        return Ok(Ok(answer));
                    }
                    None => return Ok(Ok(failed(began, "its process answered what nobody understands"))),
                },
                Err(RecvTimeoutError::Timeout) if self.kind.at_once.load(Ordering::Relaxed) => {
                    return Ok(Err(Ended::AtOnce));
                }
                Err(RecvTimeoutError::Timeout) => {
                    if let Some(limit) = self.kind.time_limit.filter(|limit| began.elapsed() >= *limit) {
                        let reason = format!("it took longer than the time limit of {} s", limit.as_secs_f64());
                        return Ok(Ok(failed(began, &reason)));
                    }
                }
                Err(RecvTimeoutError::Disconnected) => {
                    let status = process.child.wait();
                    return Ok(match status {
                        Ok(status) if was_asked(status) => Err(Ended::Asked),
                        Ok(status) => Ok(failed(began, &how_it_ended(status))),
                        Err(e) => Ok(failed(began, &format!("its process ended: {e}"))),
                    });
                }
            }
        }
    }
}

fn failed(began: Instant, reason: &str) -> (f64, Answer) {
    (began.elapsed().as_secs_f64(), Answer::Failed(reason.to_owned()))
}

/// The parts of an answer's line.
fn understood(line: &str) -> Option<(f64, Answer)> {
    let mut parts = line.splitn(3, ' ');
    let (word, seconds, rest) = (parts.next()?, parts.next()?.parse().ok()?, parts.next()?);
    match word {
        "found" if rest.starts_with('{') => Some((seconds, Answer::Found(rest.to_owned()))),
        "failed" => Some((seconds, Answer::Failed(serde_json::from_str(rest).ok()?))),
        _ => None,
    }
}

fn how_it_ended(status: std::process::ExitStatus) -> String {
    #[cfg(unix)]
    if std::os::unix::process::ExitStatusExt::signal(&status) == Some(nix::libc::SIGKILL) {
        return "its process was killed (SIGKILL), as a system does that is short of memory: run fewer tasks at a time"
            .into();
    }
    format!("its process ended: {status}")
}

/// Whether a child ended because somebody asked it to: that is no fault of its task.
fn was_asked(status: std::process::ExitStatus) -> bool {
    #[cfg(unix)]
    {
        use nix::libc::{SIGHUP, SIGINT, SIGTERM};
        use std::os::unix::process::ExitStatusExt as _;
        status.signal().is_some_and(|signal| [SIGHUP, SIGINT, SIGTERM].contains(&signal))
    }
    #[cfg(not(unix))]
    {
        let _ = status;
        false
    }
}

impl Process {
    fn start(kind: &Kind) -> Result<Process> {
        let unstarted = |source| CampaignError::NoChild { program: PathBuf::from(kind.program), source };
        let mut command = Command::new(kind.program);
        // a fit for a core: threads within one fit would only wait for each other
        command.args(kind.arguments).env("RAYON_NUM_THREADS", "1");
        command.stdin(Stdio::piped()).stdout(Stdio::piped());
        #[cfg(unix)]
        // Ctrl-C at the terminal is for the runner, which lets its children finish
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let mut child = command.spawn().map_err(unstarted)?;
        let (Some(tasks), Some(answers)) = (child.stdin.take(), child.stdout.take()) else {
            return Err(unstarted(std::io::Error::other("it has no pipes")));
        };
        let (sender, receiver) = channel();
        std::thread::spawn(move || {
            for line in BufReader::new(answers).lines() {
                let Ok(line) = line else { return };
                if sender.send(line).is_err() {
                    return;
                }
            }
        });
        Ok(Process { child, tasks, answers: receiver })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn answers_are_understood_as_they_are_written() {
        let found = understood("found 0.25 {\"a\":\"b c\"}").unwrap();
        assert_eq!(found, (0.25, Answer::Found("{\"a\":\"b c\"}".into())));
        assert_eq!(understood("failed 1 \"two\\nlines\"").unwrap().1, Answer::Failed("two\nlines".into()));
        assert!(
            ["", "found", "found x {}", "found 1 text", "thread main panicked at"].map(understood)
                == [const { None }; 5]
        );
    }

    #[test]
    fn a_panic_is_a_reason() {
        let said = Mutex::new("index out of bounds".to_owned());
        let reason = caught::<()>(&said, || panic!("gone")).unwrap_err();
        assert!(reason.contains("index out of bounds") && reason.contains("report"), "{reason}");
        assert_eq!(caught(&said, || Ok(1)), Ok(1));
    }

    #[test]
    fn a_damaged_task_fails_and_the_next_is_done() {
        let mut out = Vec::new();
        serve(Path::new("."), &b"{}\nnonsense\n"[..], &mut out).unwrap();
        let out = String::from_utf8(out).unwrap();
        assert_eq!(
            out.lines().filter(|line| line.starts_with("failed ") && line.contains("is damaged")).count(),
            2,
            "{out}"
        );
    }
}
