//! Notices files that were saved, vanished or came back, by looking at them twenty times a second on a thread of its own.
//!
//! Looking works on every file system, network drives included, and sees editors that write a new file and rename it. A
//! file counts as changed once it looks the same twice, so that half of a save is not read.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, Weak};
use std::time::{Duration, SystemTime};

/// Between two looks. A change is told after two at most, well within a fifth of a second.
const EVERY: Duration = Duration::from_millis(50);
/// Files in the folder of a head that are looked at.
const MOST_FILES: usize = 2000;
/// Endings of files that other files of heads name.
const BESIDE_HEADS: [&str; 14] =
    ["png", "jpg", "jpeg", "tif", "tiff", "exr", "hdr", "webp", "ktx2", "bin", "mtl", "tga", "bmp", "usda"];

/// What a file is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Role {
    /// The rig.
    Rig,
    /// The sequence, or the recording that it names.
    Sequence,
    /// The head, or a texture beside it.
    Head,
    /// The image of the surroundings.
    Environment,
}

/// A file that changed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Change {
    /// What it is for.
    pub role: Role,
    /// The file.
    pub path: PathBuf,
    /// Whether it is gone.
    pub is_gone: bool,
}

/// Time, size and number of a file.
type Stamp = Option<(SystemTime, u64, u64)>;

struct Watched {
    role: Role,
    path: PathBuf,
    /// As it was told last.
    known: Stamp,
    /// As it was at the last look.
    seen: Stamp,
}

#[derive(Default)]
struct Shared {
    files: Vec<Watched>,
    changes: Vec<Change>,
}

/// Looks at files until it is dropped.
pub struct Watcher {
    shared: Arc<Mutex<Shared>>,
}

impl Watcher {
    /// Starts to look; `wake` is called after a change.
    pub fn new(wake: impl Fn() + Send + 'static) -> Self {
        let shared = Arc::new(Mutex::new(Shared::default()));
        let weak: Weak<Mutex<Shared>> = Arc::downgrade(&shared);
        std::thread::spawn(move || {
            while let Some(shared) = weak.upgrade() {
                if shared.lock().is_ok_and(|mut shared| shared.look()) {
                    wake();
                }
                drop(shared);
                std::thread::sleep(EVERY);
            }
        });
        Self { shared }
    }

    /// The files to look at, in place of those before. A file that was looked at before keeps what is known of it.
    pub fn set(&self, files: Vec<(Role, PathBuf)>) {
        let Ok(mut shared) = self.shared.lock() else { return };
        let mut before = std::mem::take(&mut shared.files);
        shared.files = files
            .into_iter()
            .map(|(role, path)| match before.iter().position(|w| w.role == role && w.path == path) {
                Some(i) => before.swap_remove(i),
                None => {
                    let stamp = stamp(&path);
                    Watched { role, path, known: stamp, seen: stamp }
                }
            })
            .collect();
    }

    /// A file was written by this program: its present state is known.
    pub fn know(&self, path: &Path) {
        let Ok(mut shared) = self.shared.lock() else { return };
        let now = stamp(path);
        shared.files.iter_mut().filter(|w| w.path == path).for_each(|w| (w.known, w.seen) = (now, now));
    }

    /// What changed since the last call.
    pub fn changes(&self) -> Vec<Change> {
        self.shared.lock().map(|mut shared| std::mem::take(&mut shared.changes)).unwrap_or_default()
    }
}

impl Shared {
    /// Whether something changed.
    fn look(&mut self) -> bool {
        let before = self.changes.len();
        for watched in &mut self.files {
            let now = stamp(&watched.path);
            let is_settled = now == watched.seen;
            watched.seen = now;
            if is_settled && now != watched.known {
                watched.known = now;
                let change =
                    Change { role: watched.role, path: watched.path.clone(), is_gone: now.is_none() };
                self.changes.push(change);
            }
        }
        self.changes.len() > before
    }
}

fn stamp(path: &Path) -> Stamp {
    let data = std::fs::metadata(path).ok().filter(std::fs::Metadata::is_file)?;
    #[cfg(unix)]
    let number = std::os::unix::fs::MetadataExt::ino(&data);
    #[cfg(not(unix))]
    let number = 0;
    Some((data.modified().ok()?, data.len(), number))
}

/// A head's file and those that it may name: textures, buffers and materials in its folder and the folders in it. A head in
/// one file (`.glb`, `.vrm`, `.usdz`) names none.
pub fn files_of_head(path: &Path) -> Vec<PathBuf> {
    let ending =
        |path: &Path| path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    let mut files = vec![path.to_owned()];
    if !["gltf", "obj", "usda"].contains(&ending(path).as_str()) {
        return files;
    }
    let entries = |folder: &Path| -> Vec<PathBuf> {
        let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
        let mut paths: Vec<PathBuf> = entries.map(|e| e.path()).collect();
        paths.sort();
        paths
    };
    let top = entries(path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new(".")));
    let inner = top.iter().filter(|p| p.is_dir()).flat_map(|p| entries(p));
    let all = top.iter().cloned().chain(inner);
    let named = |p: &PathBuf| p != path && BESIDE_HEADS.contains(&ending(p).as_str());
    files.extend(all.filter(named).take(MOST_FILES));
    files
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc;
    use std::time::Instant;

    use super::*;

    #[test]
    fn saves_are_told_within_a_fifth_of_a_second_and_once() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("rig.json");
        std::fs::write(&path, "{}").unwrap();
        let (sender, woken) = mpsc::channel();
        let watcher = Watcher::new(move || sender.send(()).unwrap_or_default());
        watcher.set(vec![(Role::Rig, path.clone())]);
        let told = |is_gone| vec![Change { role: Role::Rig, path: path.clone(), is_gone }];
        let mut slowest = Duration::ZERO;
        for i in 0..5 {
            let start = Instant::now();
            std::fs::write(&path, format!("{{ \"description\": \"{i}\" }}")).unwrap();
            woken.recv_timeout(Duration::from_secs(5)).unwrap();
            slowest = slowest.max(start.elapsed());
            assert_eq!(watcher.changes(), told(false));
        }
        // A fifth of a second where the machine has time for it; here others may have it.
        assert!(slowest < Duration::from_secs(2), "{slowest:?}");
        std::fs::remove_file(&path).unwrap();
        woken.recv_timeout(Duration::from_secs(5)).unwrap();
        assert_eq!(watcher.changes(), told(true));
        std::fs::write(&path, "{ }").unwrap();
        watcher.know(&path);
        assert!(woken.recv_timeout(Duration::from_millis(300)).is_err(), "its own save is no news");
    }

    #[test]
    fn heads_of_several_files_have_their_textures() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str| {
            let path = folder.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(&path, "x").unwrap();
            path
        };
        let (head, map, skin) = (write("a.obj"), write("maps/skin.PNG"), write("a.mtl"));
        write("notes.txt");
        assert_eq!(files_of_head(&head), [head.clone(), skin, map]);
        let glb = write("a.glb");
        assert_eq!(files_of_head(&glb), std::slice::from_ref(&glb));
    }
}
