//! Names and files: names that a file gives, as names of files; files that appear only when they are complete.

use std::collections::HashSet;
use std::fs::File;
use std::io::Write;
use std::path::Path;

/// Longest name that file systems allow, bytes.
const LONGEST_NAME: usize = 255;
/// Longest name that [`plain_names`] gives, bytes: a number and a suffix such as `_scale.exr` fit behind it.
const LONGEST_STEM: usize = 200;

/// Tells whether a name that comes from a file is a plain file name on every system, so that a path made with it stays
/// in its folder: no separator, drive or stream of any system, no control character, at most 255 bytes.
pub fn is_plain_name(name: &str) -> bool {
    !matches!(name, "" | "." | "..") && name.len() <= LONGEST_NAME && !name.contains(is_foreign)
}

/// Plain file names for names that come from a file (see [`is_plain_name`]), in their order.
///
/// Plain names stay. In others `_` stands for each character that no file name may have, and long ones are cut. Names
/// that become equal, also but for the case of letters, get a number: no file replaces another.
///
/// ```
/// use rubor_assets::files::plain_names;
/// assert_eq!(plain_names(["joy", "../evil", "..\\evil", ".."]), ["joy", ".._evil", ".._evil_1", "_"]);
/// ```
pub fn plain_names<'a>(names: impl IntoIterator<Item = &'a str>) -> Vec<String> {
    let mut taken = HashSet::new();
    let mut number = 0u64;
    let plain = |name: &str| {
        let mut plain: String = name.chars().map(|c| if is_foreign(c) { '_' } else { c }).collect();
        plain.truncate(plain.floor_char_boundary(LONGEST_STEM));
        if is_plain_name(&plain) { plain } else { "_".into() }
    };
    let unique = |name: &'a str| {
        let first = plain(name);
        if taken.insert(first.to_lowercase()) {
            return first;
        }
        let base = first;
        loop {
            // One count for all names, so that many equal ones take no time that grows with their square.
            number += 1;
            let next = format!("{base}_{number}");
            if taken.insert(next.to_lowercase()) {
                return next;
            }
        }
    };
    names.into_iter().map(unique).collect()
}

/// Separators of any system, the colon of drives and streams, control characters.
fn is_foreign(c: char) -> bool {
    matches!(c, '/' | '\\' | ':') || c.is_control()
}

/// How the names of unfinished files begin. Nobody can guess the rest, so that no link waits under it.
const UNFINISHED: &str = ".rubor-";
/// Where locks do not tell, an unfinished file of this age is nobody's.
const ABANDONED: std::time::Duration = std::time::Duration::from_secs(24 * 3600);
/// An empty file of this age may be one that somebody has just made and not locked yet.
const FRESH: std::time::Duration = std::time::Duration::from_secs(2);
/// What the name of an unfinished file has before its extension.
const PART: &str = ".part";

/// Writes a file: all of it, or nothing (see [`replace_with`]). What killed runs left in the folder is removed first.
///
/// # Errors
/// The system refuses.
pub fn replace(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    remove_unfinished(folder_of(path));
    replace_with(path, |file, _| file.write_all(bytes))
}

/// Lets `make` fill a new file beside the place of `path`, by its handle or its name, and then renames it; a failure
/// leaves nothing behind and an older file as it was. The unfinished file has the same extension, for programs that
/// choose a format by it, and is locked while it is made.
///
/// # Errors
/// The system refuses, or `make` fails.
pub fn replace_with(
    path: &Path,
    make: impl FnOnce(&mut File, &Path) -> std::io::Result<()>,
) -> std::io::Result<()> {
    let mut suffix = std::ffi::OsString::from(PART);
    if let Some(extension) = path.extension() {
        suffix.push(".");
        suffix.push(extension);
    }
    let mut builder = tempfile::Builder::new();
    builder.prefix(UNFINISHED).suffix(&suffix);
    // Temporary files are private by default; this one becomes a file like any other, less the user's mask.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut part = builder.tempfile_in(folder_of(path))?;
    // Some file systems have no locks; there, what is being made counts as left over. Locks of Windows would also stop
    // `make` from writing by the name.
    #[cfg(unix)]
    // Whoever looks whether it is locked holds the lock for a moment.
    let _ = part.as_file().lock();
    let name = part.path().to_owned();
    make(part.as_file_mut(), &name)?;
    part.as_file().sync_all()?;
    part.persist(path).map_err(|e| e.error)?;
    Ok(())
}

/// Removes unfinished files that killed runs left in a folder; those of running ones are locked. Returns how many.
pub fn remove_unfinished(folder: &Path) -> usize {
    let entries = std::fs::read_dir(folder).into_iter().flatten().filter_map(Result::ok);
    let is_left = |path: &Path| {
        // A link, a pipe or a folder of such a name is not ours.
        let Some(metadata) = path.symlink_metadata().ok().filter(std::fs::Metadata::is_file) else {
            return false;
        };
        let age = metadata.modified().ok().and_then(|at| at.elapsed().ok()).unwrap_or_default();
        if cfg!(unix) {
            (metadata.len() > 0 || age > FRESH) && File::open(path).is_ok_and(|file| file.try_lock().is_ok())
        } else {
            age > ABANDONED
        }
    };
    let is_unfinished = |name: &str| name.starts_with(UNFINISHED) && name.contains(PART);
    let unfinished = entries.filter(|e| e.file_name().to_str().is_some_and(is_unfinished));
    unfinished.map(|e| e.path()).filter(|p| is_left(p) && std::fs::remove_file(p).is_ok()).count()
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_name_of_a_file_leaves_its_folder_or_replaces_another() {
        let hostile = [
            "../victim/evil",
            "/etc/evil",
            "C:\\evil",
            "C:evil",
            "a:stream",
            "..",
            ".",
            "",
            "a\0b",
            "a\nb",
            "sub/evil",
        ];
        for name in hostile {
            assert!(!is_plain_name(name), "{name:?}");
        }
        for name in ["joy", "Zähne", "a.b", "...", ".hidden", "with space", "-o"] {
            assert!(is_plain_name(name), "{name:?}");
            assert_eq!(plain_names([name]), [name]);
        }
        let long = "ä".repeat(500);
        let again =
            [hostile.as_slice(), &hostile, &["joy", "Joy", "joy_1", long.as_str(), long.as_str()]].concat();
        let plain = plain_names(again.iter().copied());
        let different: HashSet<String> = plain.iter().map(|n| n.to_lowercase()).collect();
        assert_eq!(different.len(), again.len(), "{plain:?}");
        for name in &plain {
            assert!(is_plain_name(name), "{name:?}");
            let mut parts = Path::new(name).components();
            assert!(matches!(parts.next(), Some(std::path::Component::Normal(_))) && parts.next().is_none());
        }
        // A hundred thousand equal names take no time that grows with its square.
        assert_eq!(plain_names(std::iter::repeat_n("joy", 100_000)).len(), 100_000);
    }

    #[test]
    fn a_file_is_replaced_whole_and_a_failure_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.txt");
        replace(&file, b"one").unwrap();
        replace(&file, b"two").unwrap();
        assert_eq!(std::fs::read(&file).unwrap(), b"two");
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            let plain = folder.path().join("plain.txt");
            std::fs::write(&plain, b"").unwrap();
            let mode = |p: &Path| p.metadata().unwrap().permissions().mode();
            assert_eq!(mode(&file), mode(&plain), "the mask of the user holds");
        }
        // A folder stands where the file should.
        std::fs::create_dir(folder.path().join("taken")).unwrap();
        std::fs::write(folder.path().join("taken/inside"), b"").unwrap();
        assert!(replace(&folder.path().join("taken"), b"three").is_err());
        let names = std::fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name());
        assert!(names.into_iter().all(|n| !n.to_string_lossy().contains(PART)));
        assert!(replace(&folder.path().join("none/a.txt"), b"four").is_err());
    }

    #[test]
    fn many_threads_write_into_one_folder() {
        let folder = tempfile::tempdir().unwrap();
        let write = |thread: usize| {
            for i in 0..60 {
                let path = folder.path().join(format!("{thread}.{i}.txt"));
                replace(&path, path.to_string_lossy().as_bytes()).unwrap();
                assert_eq!(std::fs::read_to_string(&path).unwrap(), path.to_string_lossy());
            }
        };
        std::thread::scope(|scope| (0..8).for_each(|thread| drop(scope.spawn(move || write(thread)))));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 8 * 60);
    }

    #[test]
    fn leftovers_of_killed_runs_go_and_those_of_running_ones_stay() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.png");
        let left = folder.path().join(".rubor-killed.part.png");
        std::fs::write(&left, b"half").unwrap();
        std::fs::write(folder.path().join(".rubor-lock"), b"").unwrap();
        replace_with(&file, |part, name| {
            assert_eq!(name.extension(), file.extension());
            assert_eq!(remove_unfinished(folder.path()), 1);
            assert!(!left.exists() && name.exists(), "the lock of the running one holds");
            part.write_all(b"whole")
        })
        .unwrap();
        assert_eq!(std::fs::read(&file).unwrap(), b"whole");
        #[cfg(unix)]
        {
            let victim = folder.path().join("victim");
            std::fs::write(&victim, b"kept").unwrap();
            std::os::unix::fs::symlink(&victim, &left).unwrap();
            assert_eq!(remove_unfinished(folder.path()), 0, "a link is not ours");
            assert_eq!(std::fs::read(&victim).unwrap(), b"kept");
        }
    }
}
