//! Work beside the device: threads that encode and write what was drawn, with a queue that does not grow.
//!
//! The threads are the run's own and not those of `rayon`: the feeder waits when the queue is full, and a caller
//! in rayon's pool would deadlock.

use std::sync::mpsc::{channel, sync_channel};
use std::sync::{Mutex, PoisonError};

use crate::error::{Failure, Outcome};

/// Largest number of threads: a frame is drawn in a few milliseconds at best and encoded in a hundred.
const MOST_THREADS: usize = 16;

/// Runs `feed`, which pushes items, while threads do `work` on them. The queue holds as many items as there are
/// threads; a push into a full queue waits. `done` gets results as they come, on the thread that called.
///
/// # Errors
/// The first failure of `feed` or of `work`; queued items are still finished.
pub(crate) fn beside<T: Send, R: Send>(
    work: &(impl Fn(T) -> Outcome<R> + Sync),
    done: &mut impl FnMut(R),
    feed: impl FnOnce(&mut dyn FnMut(T) -> Outcome) -> Outcome,
) -> Outcome {
    let threads = std::thread::available_parallelism().map_or(1, usize::from).min(MOST_THREADS);
    let (items, queue) = sync_channel::<T>(threads);
    let queue = &Mutex::new(queue);
    std::thread::scope(|scope| {
        let (report, results) = channel();
        for _ in 0..threads {
            let report = report.clone();
            scope.spawn(move || {
                loop {
                    let next = queue.lock().unwrap_or_else(PoisonError::into_inner).recv();
                    let Ok(item) = next else { return };
                    if report.send(work(item)).is_err() {
                        return;
                    }
                }
            });
        }
        drop(report);
        let mut push = |item: T| -> Outcome {
            items.send(item).map_err(|_| Failure::job("the threads that write have stopped"))?;
            while let Ok(result) = results.try_recv() {
                done(result?);
            }
            Ok(())
        };
        let fed = feed(&mut push);
        drop(items);
        let mut outcome = fed;
        for result in results {
            match result {
                Ok(result) => done(result),
                Err(failure) => outcome = outcome.and(Err(failure)),
            }
        }
        outcome
    })
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::*;

    #[test]
    fn everything_is_done_once_and_the_queue_is_bounded() {
        let (waiting, most) = (AtomicUsize::new(0), AtomicUsize::new(0));
        let work = |n: usize| {
            std::thread::sleep(std::time::Duration::from_micros(200));
            waiting.fetch_sub(1, Ordering::SeqCst);
            Ok(n)
        };
        let mut all = Vec::new();
        beside(&work, &mut |n| all.push(n), |push| {
            (0..200).try_for_each(|n| {
                most.fetch_max(waiting.fetch_add(1, Ordering::SeqCst), Ordering::SeqCst);
                push(n)
            })
        })
        .unwrap();
        all.sort_unstable();
        assert_eq!(all, (0..200).collect::<Vec<_>>());
        let threads = std::thread::available_parallelism().map_or(1, usize::from).min(MOST_THREADS);
        assert!(most.into_inner() <= 2 * threads + 1);
    }

    #[test]
    fn a_failure_ends_it() {
        let work = |n: usize| if n == 3 { Err(Failure::job("three")) } else { Ok(()) };
        let pushed = AtomicUsize::new(0);
        let failed = beside(&work, &mut |()| {}, |push| {
            (0..10_000).try_for_each(|n| {
                pushed.fetch_add(1, Ordering::SeqCst);
                push(n)
            })
        });
        assert_eq!(failed.unwrap_err().to_string(), "three");
        assert!(pushed.into_inner() < 10_000);
        let failed = beside(&|()| Ok(()), &mut |()| {}, |_| Err(Failure::job("fed")));
        assert_eq!(failed.unwrap_err().to_string(), "fed");
    }
}
