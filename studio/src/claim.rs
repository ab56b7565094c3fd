//! The folder of a run: one run at a time, and no frame of another job.
//!
//! ```text
//! look   lock if the folder is there; resumed: its job.json must draw the same pixels
//! take   with the first frame, so that a job that cannot be drawn leaves nothing and spoils nothing:
//!        lock --> leftovers of killed runs go --> new run: results of the one before go --> job.json
//!        (those of the same job stay where only some frames are drawn)
//! drop   the lock goes
//! ```
//!
//! Frames of the run before go before `job.json` is replaced. So whenever a run is killed, every frame in the folder is
//! one of the job in its `job.json`.

use std::borrow::Cow;
use std::fs::{File, OpenOptions, TryLockError};
use std::path::{Path, PathBuf};

use rubor_assets::files;
use rubor_renderer::channels::CHANNELS;

use crate::error::{Failure, Outcome};
use crate::job::{FrameList, Job};
use crate::manifest::MANIFEST_FILE;
use crate::notes::Note;
use crate::output;
use crate::review::page::PAGE_FILE;
use crate::review::timeline::TIMELINE_FILE;
use crate::run::{HEAD_FILE, JOB_FILE, SHEET_FILE, STATS_FILE, VIDEO_FILE};

/// Name of the lock; the file is there while a run works in the folder.
const LOCK_FILE: &str = ".rubor-lock";
/// Lock files that vanish between opening and locking, because their run ended, are tried again this often.
const TRIES: u32 = 100;

/// A folder that a run wants.
pub(crate) struct Claim<'a> {
    folder: &'a Path,
    /// All frames are drawn: none of those in the folder is kept.
    pub(crate) is_new: bool,
    /// The other frames in the folder are of the same job.
    keeps_others: bool,
    /// The frames that the folder has after the run; none is all of the sequence.
    frames: Option<FrameList>,
    /// The job that the folder has to hold before the first frame.
    to_write: Option<Cow<'a, Job>>,
    /// What killed runs left is gone.
    is_clean: bool,
    lock: Option<Lock>,
}

impl<'a> Claim<'a> {
    /// Looks at the folder and changes nothing in it.
    ///
    /// # Errors
    /// Another run works in the folder; it holds the frames of another job and the run is to be resumed.
    pub(crate) fn look(job: &'a Job, folder: &'a Path, resume: bool) -> Outcome<Self> {
        let lock = if folder.is_dir() { Some(Lock::take(folder)?) } else { None };
        let path = folder.join(JOB_FILE);
        let whole = |lock| Self {
            folder,
            is_new: true,
            keeps_others: false,
            frames: job.frames.clone(),
            to_write: Some(Cow::Borrowed(job)),
            is_clean: false,
            lock,
        };
        if !path.is_file() || (!resume && job.frames.is_none()) {
            return Ok(whole(lock));
        }
        let before = match Job::read(&path, None) {
            Ok(before) => before,
            Err(_) if !resume => return Ok(whole(lock)),
            Err(failure) => return Err(failure),
        };
        if !before.draws_like(job)? {
            if !resume {
                return Ok(whole(lock));
            }
            return Err(Failure::input(format!(
                "{}: found the frames of another job, expected those of this one",
                folder.display()
            ))
            .hint("leave out --resume to draw all frames again, or choose another folder"));
        }
        let both =
            before.frames.as_ref().zip(job.frames.as_ref()).map(|(a, b): (&FrameList, &FrameList)| a.and(b));
        let frames = both.clone();
        let to_write = (both != before.frames).then(|| Cow::Owned(Job { frames: both, ..job.clone() }));
        Ok(Self { folder, is_new: !resume, keeps_others: true, frames, to_write, is_clean: false, lock })
    }

    /// The frames of the job that the folder may have after the run; none is all of the sequence.
    pub(crate) fn frames(&self) -> Option<&FrameList> {
        self.frames.as_ref()
    }

    /// Makes the folder that of the job; later calls do nothing. Returns what there is to say.
    ///
    /// # Errors
    /// Another run works in the folder by now; the system reports an error.
    pub(crate) fn take(&mut self) -> Outcome<Option<Note>> {
        if self.lock.is_none() {
            output::folder(self.folder)?;
            self.lock = Some(Lock::take(self.folder)?);
        }
        if !std::mem::replace(&mut self.is_clean, true) {
            files::remove_unfinished(self.folder);
        }
        let Some(job) = self.to_write.take() else { return Ok(None) };
        let mut note = None;
        if self.is_new && !self.keeps_others {
            let removed = remove_results(self.folder)?;
            if removed > 0 {
                let message = format!("the results of an earlier run were removed ({removed} files)");
                note = Some(Note::new(self.folder.display().to_string(), message));
            }
        }
        job.write(&self.folder.join(JOB_FILE))?;
        Ok(note)
    }
}

/// Removes frames and what is made of them. The job stays until the next one replaces it.
fn remove_results(folder: &Path) -> Outcome<usize> {
    let entries = std::fs::read_dir(folder).map_err(|e| Failure::read(folder, e))?;
    let mut removed = 0;
    for entry in entries {
        let path = entry.map_err(|e| Failure::read(folder, e))?.path();
        if path.file_name().is_some_and(|n| n.to_str().is_some_and(is_result)) {
            std::fs::remove_file(&path).map_err(|e| Failure::write(&path, e))?;
            removed += 1;
        }
    }
    Ok(removed)
}

/// Names that a run gives: `frame.0001.png`, `frame.0001.exr`, `frame.0001.CHANNEL.exr`, and those of the whole.
pub(crate) fn is_result(name: &str) -> bool {
    let whole = [STATS_FILE, SHEET_FILE, VIDEO_FILE, HEAD_FILE, PAGE_FILE, TIMELINE_FILE, MANIFEST_FILE];
    if whole.contains(&name) {
        return true;
    }
    let Some((number, rest)) = name.strip_prefix("frame.").and_then(|n| n.split_once('.')) else {
        return false;
    };
    let is_number = number.len() >= 4 && number.bytes().all(|b| b.is_ascii_digit());
    let is_channel = |c: &str| CHANNELS.iter().any(|row| row.channel.name() == c);
    is_number && (["png", "exr"].contains(&rest) || rest.strip_suffix(".exr").is_some_and(is_channel))
}

/// The lock of a folder. The system gives it up when the process ends, however that happens.
struct Lock {
    path: PathBuf,
    _file: File,
}

impl Lock {
    fn take(folder: &Path) -> Outcome<Self> {
        let path = folder.join(LOCK_FILE);
        for _ in 0..TRIES {
            let file = open(&path).map_err(|e| Failure::write(&path, e))?;
            match file.try_lock() {
                Ok(()) => {}
                Err(TryLockError::WouldBlock) => {
                    return Err(Failure::job(format!(
                        "{}: another run works in this folder",
                        folder.display()
                    ))
                    .hint("wait for it, or choose another folder"));
                }
                // A file system without locks.
                Err(TryLockError::Error(e)) if e.kind() == std::io::ErrorKind::Unsupported => {}
                Err(TryLockError::Error(e)) => return Err(Failure::write(&path, e)),
            }
            // The run before may have removed the file after it was opened here: then this lock holds nothing.
            if is_at(&file, &path) {
                return Ok(Self { path, _file: file });
            }
        }
        Err(Failure::write(&path, "it vanishes again and again"))
    }
}

impl Drop for Lock {
    fn drop(&mut self) {
        // Nobody can lock it meanwhile. What stays is an empty file without effect.
        let _ = std::fs::remove_file(&self.path);
    }
}

/// Opens the file of the lock, made if missing. A link in its place is refused.
fn open(path: &Path) -> std::io::Result<File> {
    match OpenOptions::new().write(true).create_new(true).open(path) {
        Err(e) if e.kind() == std::io::ErrorKind::AlreadyExists => {}
        made => return made,
    }
    match path.symlink_metadata() {
        Ok(m) if !m.is_file() => return Err(std::io::Error::other("no regular file stands there")),
        Ok(_) => {}
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => {
            return OpenOptions::new().write(true).create_new(true).open(path);
        }
        Err(e) => return Err(e),
    }
    OpenOptions::new().write(true).open(path)
}

#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let same = |a: std::fs::Metadata, b: std::fs::Metadata| (a.dev(), a.ino()) == (b.dev(), b.ino());
    file.metadata().ok().zip(path.symlink_metadata().ok()).is_some_and(|(a, b)| same(a, b))
}

#[cfg(not(unix))]
fn is_at(_: &File, path: &Path) -> bool {
    path.exists()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_run_at_a_time_works_in_a_folder() {
        let folder = tempfile::tempdir().unwrap();
        let first = Lock::take(folder.path()).unwrap();
        let message = Lock::take(folder.path()).err().unwrap().to_string();
        assert!(message.contains("another run") && message.contains("hint"), "{message}");
        drop(first);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "the lock leaves nothing");
        // A killed run leaves the file, which locks nobody out.
        std::fs::write(folder.path().join(LOCK_FILE), b"").unwrap();
        drop(Lock::take(folder.path()).unwrap());
        #[cfg(unix)]
        {
            let victim = folder.path().join("victim");
            std::os::unix::fs::symlink(&victim, folder.path().join(LOCK_FILE)).unwrap();
            assert!(Lock::take(folder.path()).is_err());
            assert!(!victim.exists(), "a link is not followed");
        }
    }

    #[test]
    fn only_results_of_runs_are_removed() {
        for name in [
            "frame.0001.png",
            "frame.12345.png",
            "frame.0001.exr",
            "frame.0001.depth.exr",
            "stats.json",
            "video.mp4",
            "review.html",
            "sequence.otio",
            "manifest.json",
        ] {
            assert!(is_result(name), "{name}");
        }
        for name in
            ["frame.1.png", "frame.000a.png", "frame.0001.mine.exr", "frame.0001.jpg", "job.json", "a.png"]
        {
            assert!(!is_result(name), "{name}");
        }
    }
}
