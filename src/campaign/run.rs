//! A runner: does the tasks of one shard that nobody has finished, so many at a time, each on one core.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use crate::campaign::child::{Ended, Hand, Kind};
use crate::campaign::error::{CampaignError, Result};
use crate::campaign::folder::Folder;
use crate::campaign::marks::{Claim, Mark, Marks};
use crate::campaign::shard::Shard;
use crate::campaign::store::Store;
use crate::campaign::task::Task;

/// How a shard is run.
pub struct Run<'a> {
    /// Which tasks.
    pub shard: Shard,
    /// So many at a time.
    pub threads: usize,
    /// The processes that do them.
    pub children: Kind<'a>,
    /// Set to end when the tasks at work are done.
    pub stop: &'a AtomicBool,
    /// Hears how far it has come.
    pub on_progress: &'a (dyn Fn(Progress) + Sync),
}

/// How far a runner has come.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Progress {
    /// Tasks of the shard.
    pub tasks: usize,
    /// Those that were finished before.
    pub before: usize,
    /// Those that it has done.
    pub done: usize,
    /// Those that have failed.
    pub failed: usize,
    /// Those that another runner works on.
    pub others: usize,
    /// Those that it has left because it was told to end.
    pub left: usize,
}

/// Time between two looks at what is to be marked.
const TICK: Duration = Duration::from_millis(100);

/// What the threads of a runner share.
struct Shared<'a> {
    run: &'a Run<'a>,
    marks: &'a Marks,
    store: Store<'a>,
    queue: Mutex<VecDeque<(usize, Task)>>,
    /// Tasks that another runner had claimed when their turn came.
    others: Mutex<Vec<(usize, Task)>>,
    done: AtomicUsize,
    failed: AtomicUsize,
    before: AtomicUsize,
    at_work: AtomicUsize,
    /// The first error that ends the runner.
    broken: Mutex<Option<CampaignError>>,
}

/// Runs a shard to its end, or until someone stops it.
///
/// # Errors
/// A folder that is no campaign's, a full disk, a program that cannot start itself. What was finished is kept.
pub fn run(folder: &Folder, run: &Run) -> Result<Progress> {
    let marks = folder.marks()?;
    let place = folder.place("marks");
    let known = marks.all().map_err(CampaignError::io("read", &place))?;
    let own = (0..known.len()).filter(|task| run.shard.has(*task));
    let tasks = own.clone().count();
    let mut missing = folder.tasks(|task| run.shard.has(task) && known.get(task) == Some(&Mark::Missing))?;
    let before = tasks - missing.len();
    // one recording after the other: each is read once
    let inputs = |task: &Task| task.inputs().map(|input| input.sha256.clone()).collect::<Vec<_>>();
    missing.sort_by_cached_key(|(_, task)| inputs(task));
    let shared = Shared {
        run,
        marks: &marks,
        store: Store::new(folder, &marks, &run.shard.stem()),
        queue: Mutex::new(missing.into()),
        others: Mutex::default(),
        done: AtomicUsize::new(0),
        failed: AtomicUsize::new(0),
        before: AtomicUsize::new(before),
        at_work: AtomicUsize::new(0),
        broken: Mutex::default(),
    };
    shared.round(tasks);
    // what another runner had may have been left by it meanwhile
    let again = std::mem::take(&mut *lock(&shared.others));
    *lock(&shared.queue) = again.into();
    shared.round(tasks);
    let kept = shared.store.commit();
    if let Some(error) = lock(&shared.broken).take() {
        return Err(error);
    }
    kept?;
    Ok(shared.progress(tasks))
}

fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Shared<'_> {
    fn progress(&self, tasks: usize) -> Progress {
        let of = |count: &AtomicUsize| count.load(Ordering::Relaxed);
        let (before, done, failed) = (of(&self.before), of(&self.done), of(&self.failed));
        let others = lock(&self.others).len();
        Progress { tasks, before, done, failed, others, left: tasks - before - done - failed - others }
    }

    fn ends(&self) -> bool {
        self.run.stop.load(Ordering::Relaxed) || lock(&self.broken).is_some()
    }

    /// Does all that is in the queue.
    fn round(&self, tasks: usize) {
        let hands = self.run.threads.min(lock(&self.queue).len());
        self.at_work.store(hands, Ordering::Relaxed);
        std::thread::scope(|scope| {
            for _ in 0..hands {
                scope.spawn(|| {
                    if let Err(error) = self.hand() {
                        lock(&self.broken).get_or_insert(error);
                    }
                    self.at_work.fetch_sub(1, Ordering::Relaxed);
                });
            }
            while self.at_work.load(Ordering::Relaxed) > 0 {
                (self.run.on_progress)(self.progress(tasks));
                std::thread::sleep(TICK);
                if let Err(error) = self.store.commit_if_due() {
                    lock(&self.broken).get_or_insert(error);
                }
            }
        });
    }

    /// One thread: a task after the other.
    fn hand(&self) -> Result<()> {
        let mut hand = Hand::new(&self.run.children);
        while !self.ends() {
            let Some((number, task)) = lock(&self.queue).pop_front() else { break };
            let claim = self.marks.claim(number, Mark::Missing).map_err(|source| CampaignError::Claim { source })?;
            match claim {
                Claim::Others => lock(&self.others).push((number, task)),
                Claim::Finished => drop(self.before.fetch_add(1, Ordering::Relaxed)),
                Claim::Ours => {
                    let line = serde_json::to_string(&task).map_err(|e| CampaignError::Claim { source: e.into() })?;
                    match hand.perform(&line)? {
                        Ok((seconds, answer)) => {
                            self.store.keep(number, &task, seconds, &answer)?;
                            let count = if answer.is_found() { &self.done } else { &self.failed };
                            count.fetch_add(1, Ordering::Relaxed);
                        }
                        Err(Ended::AtOnce) => return Ok(()),
                        Err(Ended::Asked) => {
                            self.run.stop.store(true, Ordering::Relaxed);
                            return Ok(());
                        }
                    }
                }
            }
        }
        Ok(())
    }
}
