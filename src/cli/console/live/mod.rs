//! The live view of a recording: a block of lines on a terminal, a line a second elsewhere.
//!
//! It is drawn by a thread of its own, which is handed what to draw only when it is ready for it: a terminal that has
//! stopped, or a reader that does not read, never holds up the recording.

pub(crate) mod changes;
pub(crate) mod numbers;
pub(crate) mod sparkline;
pub(crate) mod table;
pub(crate) mod tone;
pub(crate) mod view;

use std::cell::Cell;
use std::io::{IsTerminal, stderr};
use std::path::Path;
use std::sync::mpsc::{Receiver, SyncSender, channel, sync_channel};
use std::thread;
use std::time::{Duration, Instant};

use console::{Style, Term};

use crate::cli::console::live::changes::{changes, progress};
use crate::cli::console::live::tone::Tone;
use crate::cli::console::live::view::{Line, Size, view, wrapped};
use crate::cli::console::print::tell;
use crate::record::health::disk::DiskWatch;
use crate::record::health::snapshot::Snapshot;

/// How often a line is written where there is no terminal.
const LINE_EVERY: Duration = Duration::from_secs(1);
/// How often the block is drawn on a terminal.
const BLOCK_EVERY: Duration = Duration::from_millis(200);
/// How long the end waits for what is being drawn.
const LAST_DRAWING: Duration = Duration::from_millis(500);

/// Where the recording is shown.
pub struct Reporter {
    snapshots: Option<SyncSender<Snapshot>>,
    shown: Cell<Option<Instant>>,
    over: Receiver<()>,
}

impl Reporter {
    /// On the terminal, or line by line.
    pub fn open() -> Reporter {
        let (snapshots, taken) = sync_channel(1);
        let (alive, over) = channel();
        // without a thread nothing is shown, and everything is recorded
        let _ = thread::Builder::new().name("live view".into()).spawn(move || {
            show_all(&taken);
            drop(alive);
        });
        Reporter { snapshots: Some(snapshots), shown: Cell::new(None), over }
    }

    /// Shows where the recording stands, if what was to be shown before has been.
    pub fn show(&self, snapshot: Snapshot) {
        let due = self.shown.get().is_none_or(|at| at.elapsed() >= BLOCK_EVERY);
        if let Some(snapshots) = self.snapshots.as_ref().filter(|_| due) {
            self.shown.set(Some(Instant::now()));
            let _ = snapshots.try_send(snapshot);
        }
    }

    /// Takes the block away.
    pub fn close(mut self) {
        self.snapshots = None;
        let _ = self.over.recv_timeout(LAST_DRAWING);
    }
}

fn show_all(snapshots: &Receiver<Snapshot>) {
    let mut screen = Screen::open();
    let mut disk = DiskWatch::default();
    let mut before: Option<Snapshot> = None;
    let mut line_at: Option<Instant> = None;
    for mut snapshot in snapshots {
        let place: &Path = &snapshot.place;
        snapshot.disk = disk.look(place);
        if !stderr_takes_more() {
            continue;
        }
        let news = changes(before.as_ref(), &snapshot, screen.is_none());
        match &mut screen {
            Some(screen) => screen.draw(&news, &snapshot),
            None => {
                news.iter().for_each(|(_, text)| tell!("{text}"));
                if snapshot.recorded_s.is_some() && line_at.is_none_or(|at| at.elapsed() >= LINE_EVERY) {
                    tell!("{}", progress(&snapshot));
                    line_at = Some(Instant::now());
                }
            }
        }
        before = Some(snapshot);
    }
    if let Some(screen) = &mut screen {
        screen.clear();
    }
}

/// A block of lines at the end of what the terminal shows.
struct Screen {
    term: Term,
    /// Widths of the lines that stand there.
    drawn: Vec<usize>,
}

impl Screen {
    /// Standard error, if it is a terminal that can move its cursor.
    fn open() -> Option<Screen> {
        let dumb = std::env::var_os("TERM").is_some_and(|term| term == "dumb");
        (stderr().is_terminal() && !dumb).then(|| Screen { term: Term::buffered_stderr(), drawn: Vec::new() })
    }

    fn size(&self) -> Size {
        let size = self.term.size_checked().filter(|(rows, columns)| *rows > 0 && *columns > 0);
        let (rows, columns) = size.unwrap_or((24, 80));
        Size { rows: rows.into(), columns: columns.into() }
    }

    /// Draws the block anew, the news above it to stay. All in one piece; where the terminal is gone the recording goes
    /// on.
    fn draw(&mut self, news: &[(Tone, String)], snapshot: &Snapshot) {
        let size = self.size();
        let _ = self.rewind(size.columns);
        for (tone, text) in news {
            for line in wrapped(text, size.columns, 2) {
                let _ = self.term.write_line(&self.painted(&Line { tone: *tone, text: line }));
            }
        }
        for line in view(snapshot, size) {
            self.drawn.push(console::measure_text_width(&line.text));
            let _ = self.term.write_line(&self.painted(&line));
        }
        let _ = self.term.flush();
    }

    /// Goes back to where the block begins, and takes it away. A terminal that has become narrower has wrapped its
    /// lines.
    fn rewind(&mut self, columns: usize) -> std::io::Result<()> {
        let rows: usize = self.drawn.drain(..).map(|width| width.div_ceil(columns).max(1)).sum();
        self.term.write_str("\r")?;
        if rows > 0 {
            self.term.move_cursor_up(rows)?;
        }
        self.term.clear_to_end_of_screen()
    }

    fn clear(&mut self) {
        let columns = self.size().columns;
        let _ = self.rewind(columns).and_then(|()| self.term.flush());
    }

    /// In colour, unless NO_COLOR or the terminal says otherwise.
    fn painted(&self, line: &Line) -> String {
        let style = match line.tone {
            Tone::Plain => return line.text.clone(),
            Tone::Heading => Style::new().dim(),
            Tone::Good => Style::new().green(),
            Tone::Alarm => Style::new().yellow(),
        };
        style.force_styling(self.term.features().colors_supported()).apply_to(&line.text).to_string()
    }
}

/// Standard error would not wait for its reader.
#[cfg(unix)]
fn stderr_takes_more() -> bool {
    use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
    use std::os::fd::AsFd;
    let stderr = stderr();
    let mut ready = [PollFd::new(stderr.as_fd(), PollFlags::POLLOUT)];
    poll(&mut ready, PollTimeout::ZERO) == Ok(1)
}

/// Elsewhere it is written to and may wait.
#[cfg(not(unix))]
fn stderr_takes_more() -> bool {
    true
}
