//! Results that take seconds and follow from their inputs alone, kept in files from run to run.
//!
//! ```text
//! inputs, kind, this program --SHA-256--> KIND-HASH.bin: magic, SHA-256 of the rest, the result
//! ```
//!
//! A file is named by all that its result depends on, so it never is another's. The program counts by its version and by size
//! and time of its file: one that was built anew shares nothing with the one before. What does not read back whole is made
//! again. Files appear whole or not at all, so runs may share the folder.

use std::path::{Path, PathBuf};
use std::time::SystemTime;

use glam::Vec3;
use rubor_rig::head::Head;
use rubor_rig::level::Level;
use sha2::{Digest, Sha256};

use crate::output;

/// Variable that says where the files are, or `off`.
pub const VARIABLE: &str = "RUBOR_CACHE";
/// Bytes that all files may have together; those that were not used for longest go.
pub const MOST_BYTES: u64 = 256 << 20;
/// First bytes of a file.
const MAGIC: &[u8; 8] = b"rubor k1";
const EXTENSION: &str = "bin";

/// Where results are kept; nowhere by default.
#[derive(Clone, Debug, Default)]
pub struct Cache {
    folder: Option<PathBuf>,
    /// What tells this program from others.
    program: String,
    most_bytes: u64,
}

/// What a result depends on, as a hash.
#[derive(Clone)]
pub struct Key(Sha256);

impl Key {
    /// A key of inputs that are added next.
    pub fn new() -> Self {
        Self(Sha256::new())
    }

    /// Adds numbers; how many there are counts too.
    pub fn add(&mut self, numbers: impl IntoIterator<Item = u32>) {
        let bytes: Vec<u8> = numbers.into_iter().flat_map(u32::to_le_bytes).collect();
        self.0.update((bytes.len() as u64).to_le_bytes());
        self.0.update(bytes);
    }

    fn add_places(&mut self, places: impl IntoIterator<Item = Vec3>) {
        self.add(places.into_iter().flat_map(|p| p.to_array().map(f32::to_bits)));
    }
}

impl Default for Key {
    fn default() -> Self {
        Self::new()
    }
}

impl Cache {
    /// The folder of [`VARIABLE`], else that of this user and this system; nowhere if the variable says `off`.
    pub fn of_user() -> Self {
        folder().map_or_else(Self::default, Self::in_folder)
    }

    /// A folder; made when something is kept.
    pub fn in_folder(folder: impl Into<PathBuf>) -> Self {
        match program() {
            Some(program) => Self { folder: Some(folder.into()), program, most_bytes: MOST_BYTES },
            // Unknown programs keep nothing.
            None => Self::default(),
        }
    }

    /// The result of a kind and a key: the kept one, else what `make` returns, which is kept. A result that cannot be kept
    /// is made again next time.
    pub fn get(&self, kind: &str, key: Key, make: impl FnOnce() -> Vec<u8>) -> Vec<u8> {
        let Some(folder) = &self.folder else { return make() };
        let mut key = key.0;
        key.update(kind.as_bytes());
        key.update(self.program.as_bytes());
        let name: String = key.finalize().iter().map(|byte| format!("{byte:02x}")).collect();
        let file = folder.join(format!("{kind}-{name}.{EXTENSION}"));
        if let Some(kept) = read(&file) {
            // Used now: others go before it.
            let _ = std::fs::File::options()
                .append(true)
                .open(&file)
                .and_then(|f| f.set_modified(SystemTime::now()));
            return kept;
        }
        let made = make();
        if output::folder(folder).is_ok() && write(&file, &made).is_ok() {
            self.shrink(folder);
        }
        made
    }

    /// Removes the files that were not used for longest until the rest fits.
    fn shrink(&self, folder: &Path) {
        let entries = std::fs::read_dir(folder).into_iter().flatten().filter_map(Result::ok);
        let mut files: Vec<(SystemTime, u64, PathBuf)> = entries
            .filter(|e| e.path().extension().is_some_and(|x| x == EXTENSION))
            .filter_map(|e| {
                let data = e.metadata().ok().filter(std::fs::Metadata::is_file)?;
                Some((data.modified().ok()?, data.len(), e.path()))
            })
            .collect();
        files.sort();
        let mut sum: u64 = files.iter().map(|(_, bytes, _)| bytes).sum();
        for (_, bytes, path) in files {
            if sum <= self.most_bytes {
                return;
            }
            // Another run may have removed it.
            let _ = std::fs::remove_file(path);
            sum -= bytes;
        }
    }
}

/// The folder of [`VARIABLE`], else that of this user; `None` if the variable says `off` or the system does not name one.
pub(crate) fn folder() -> Option<PathBuf> {
    match std::env::var_os(VARIABLE).filter(|v| !v.is_empty()) {
        Some(off) if off == "off" => None,
        Some(folder) => Some(folder.into()),
        None => directories::ProjectDirs::from("", "", "rubor").map(|dirs| dirs.cache_dir().to_owned()),
    }
}

/// Version of this program, and size and time of its file.
fn program() -> Option<String> {
    let data = std::fs::metadata(std::env::current_exe().ok()?).ok()?;
    let time = data.modified().ok()?.duration_since(SystemTime::UNIX_EPOCH).ok()?;
    Some(format!("{} {} {}", env!("CARGO_PKG_VERSION"), data.len(), time.as_nanos()))
}

fn read(file: &Path) -> Option<Vec<u8>> {
    let bytes = rubor_rig::limits::read(file).ok()?;
    let rest = bytes.strip_prefix(MAGIC)?;
    let (sum, result) = rest.split_at_checked(Sha256::output_size())?;
    (Sha256::digest(result).as_slice() == sum).then(|| result.to_vec())
}

fn write(file: &Path, result: &[u8]) -> crate::Outcome {
    let sum = Sha256::digest(result);
    output::write(file, &[MAGIC.as_slice(), sum.as_slice(), result].concat())
}

/// The levels of a head ([`rubor_assets::convert::levels`]), kept by its geometry.
pub(crate) fn levels(cache: &Cache, head: &Head) -> Vec<Level> {
    let make = || rubor_assets::convert::levels::levels(head);
    let bytes = cache.get("levels", key_of_levels(head), || to_bytes(&make()));
    from_bytes(&bytes).unwrap_or_else(make)
}

/// All that the levels of a head depend on.
fn key_of_levels(head: &Head) -> Key {
    let mut key = Key::new();
    let mesh = &head.mesh;
    key.add_places(mesh.points.iter().copied());
    key.add(mesh.vertices.iter().flat_map(|v| [v.point, v.uv.x.to_bits(), v.uv.y.to_bits()]));
    key.add(mesh.triangles.iter().flatten().copied());
    key.add(mesh.parts.iter().flat_map(|p| [p.material.number(), p.triangles.start, p.triangles.end]));
    for shape in &head.shapes {
        key.add(shape.points.iter().copied());
        key.add_places(shape.offsets.iter().copied());
    }
    key.add_places(head.landmarks.values().copied());
    key.add_places(head.authored.normals.iter().copied());
    key
}

/// Numbers of little end: how many levels; of each its error, triangles, parts and hosts with how many there are.
fn to_bytes(levels: &[Level]) -> Vec<u8> {
    let mut words: Vec<u32> = vec![levels.len() as u32];
    for level in levels {
        words.push(level.error_metres.to_bits());
        let parts: Vec<u32> = level.parts.iter().flat_map(|p| [p.start, p.end]).collect();
        for list in [level.triangles.as_flattened(), &parts, &level.hosts] {
            words.push(list.len() as u32);
            words.extend_from_slice(list);
        }
    }
    words.iter().flat_map(|word| word.to_le_bytes()).collect()
}

fn from_bytes(bytes: &[u8]) -> Option<Vec<Level>> {
    let mut words = bytes.as_chunks::<4>().0.iter().map(|word| u32::from_le_bytes(*word));
    let count = words.next()?;
    let list = |words: &mut dyn Iterator<Item = u32>| -> Option<Vec<u32>> {
        let count = words.next()? as usize;
        let list: Vec<u32> = words.take(count).collect();
        (list.len() == count).then_some(list)
    };
    let mut levels = Vec::new();
    for _ in 0..count {
        let error_metres = f32::from_bits(words.next()?);
        let [triangles, parts, hosts] = [list(&mut words)?, list(&mut words)?, list(&mut words)?];
        levels.push(Level {
            error_metres,
            triangles: triangles.as_chunks::<3>().0.to_vec(),
            parts: parts.as_chunks::<2>().0.iter().map(|[start, end]| *start..*end).collect(),
            hosts,
        });
    }
    words.next().is_none().then_some(levels)
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicU32, Ordering};

    use super::*;

    fn key(numbers: &[u32]) -> Key {
        let mut key = Key::new();
        key.add(numbers.iter().copied());
        key
    }

    /// What a cache returns for a key, and whether it had to be made.
    fn got(cache: &Cache, kind: &str, key: Key, result: &[u8]) -> (Vec<u8>, bool) {
        let mut made = false;
        let bytes = cache.get(kind, key, || {
            made = true;
            result.to_vec()
        });
        (bytes, made)
    }

    fn files(folder: &Path) -> Vec<PathBuf> {
        let mut files: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
        files.sort();
        files
    }

    #[test]
    fn what_was_made_comes_back_for_the_same_inputs_kind_and_program_alone() {
        let folder = tempfile::tempdir().unwrap();
        let cache = Cache::in_folder(folder.path().join("made"));
        assert_eq!(got(&cache, "a", key(&[1, 2]), b"one"), (b"one".to_vec(), true));
        assert_eq!(got(&cache, "a", key(&[1, 2]), b"two"), (b"one".to_vec(), false));
        assert_eq!(got(&cache, "b", key(&[1, 2]), b"two"), (b"two".to_vec(), true));
        assert_eq!(got(&cache, "a", key(&[1, 3]), b"two"), (b"two".to_vec(), true));
        let mut apart = key(&[1]);
        apart.add([2]);
        assert_eq!(got(&cache, "a", apart, b"two"), (b"two".to_vec(), true));
        let newer = Cache { program: cache.program.clone() + "1", ..cache.clone() };
        assert_eq!(got(&newer, "a", key(&[1, 2]), b"two"), (b"two".to_vec(), true));
        assert_eq!(got(&Cache::default(), "a", key(&[1, 2]), b"two"), (b"two".to_vec(), true));
        assert_eq!(got(&cache, "a", key(&[1, 2]), b"two"), (b"one".to_vec(), false));
    }

    #[test]
    fn broken_files_are_made_again() {
        let folder = tempfile::tempdir().unwrap();
        let cache = Cache::in_folder(folder.path());
        got(&cache, "a", key(&[7]), b"a result");
        let [file] = &files(folder.path())[..] else { panic!("one file") };
        let whole = std::fs::read(file).unwrap();
        let mut flipped = whole.clone();
        *flipped.last_mut().unwrap() ^= 1;
        let longer = [whole.as_slice(), b"!"].concat();
        for broken in [&whole[..whole.len() - 1], &whole[..20], b"", &flipped, &longer] {
            std::fs::write(file, broken).unwrap();
            assert_eq!(got(&cache, "a", key(&[7]), b"again"), (b"again".to_vec(), true));
            assert_eq!(got(&cache, "a", key(&[7]), b"never"), (b"again".to_vec(), false));
        }
        assert_eq!(files(folder.path()).len(), 1);
    }

    #[test]
    fn a_place_that_cannot_be_written_is_no_failure() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        std::fs::write(&file, b"").unwrap();
        let cache = Cache::in_folder(&file);
        assert_eq!(got(&cache, "a", key(&[7]), b"x"), (b"x".to_vec(), true));
        assert_eq!(got(&cache, "a", key(&[7]), b"y"), (b"y".to_vec(), true));
    }

    #[test]
    fn runs_at_once_share_a_folder() {
        let folder = tempfile::tempdir().unwrap();
        let made = AtomicU32::new(0);
        std::thread::scope(|scope| {
            for _ in 0..8 {
                scope.spawn(|| {
                    let cache = Cache::in_folder(folder.path());
                    for n in 0..40_u32 {
                        let result = n.to_le_bytes().repeat(1000);
                        let found = cache.get("a", key(&[n]), || {
                            made.fetch_add(1, Ordering::Relaxed);
                            result.clone()
                        });
                        assert!(found == result, "{n}");
                    }
                });
            }
        });
        assert!((40..=320).contains(&made.into_inner()));
        assert_eq!(files(folder.path()).len(), 40, "nothing unfinished is left");
    }

    #[test]
    fn the_folder_keeps_its_size_and_what_was_used_last() {
        let folder = tempfile::tempdir().unwrap();
        let cache = Cache { most_bytes: 3 * 1100, ..Cache::in_folder(folder.path()) };
        let result = [5; 1000];
        for n in 0..3 {
            got(&cache, "a", key(&[n]), &result);
            std::thread::sleep(std::time::Duration::from_millis(15));
        }
        assert!(!got(&cache, "a", key(&[0]), &result).1);
        std::fs::write(folder.path().join("other.json"), [0; 9000]).unwrap();
        std::thread::sleep(std::time::Duration::from_millis(15));
        got(&cache, "a", key(&[3]), &result);
        assert_eq!(files(folder.path()).len(), 4);
        assert!(!got(&cache, "a", key(&[0]), &result).1, "it was used");
        assert!(got(&cache, "a", key(&[1]), &result).1, "it was the oldest");
    }

    #[test]
    fn levels_come_back_and_any_change_of_the_head_makes_others() {
        let head = crate::inputs::head(None).unwrap().head;
        let small = Level {
            error_metres: 0.25,
            triangles: vec![[0, 1, 2]],
            parts: vec![0..1, 1..1],
            hosts: vec![0, 0],
        };
        let list = vec![small.clone(), Level { error_metres: 0.5, ..small }];
        let bytes = to_bytes(&list);
        assert_eq!(from_bytes(&bytes), Some(list));
        assert_eq!(from_bytes(&bytes[..bytes.len() - 4]), None);
        assert_eq!(from_bytes(&[bytes.as_slice(), &[0; 4]].concat()), None);
        let name = |head: &Head| key_of_levels(head).0.finalize().to_vec();
        let changes: [fn(&mut Head); 8] = [
            |h| h.mesh.points[9].x += 1e-6,
            |h| h.mesh.vertices[9].uv.y += 1e-6,
            |h| h.mesh.vertices[9].point += 1,
            |h| h.mesh.triangles.swap(3, 4),
            |h| h.mesh.parts[0].material = rubor_rig::head::Material::Hidden,
            |h| h.shapes[1].offsets[2].z += 1e-6,
            |h| h.authored.normals.push(glam::Vec3::Z),
            |h| h.landmarks.values_mut().next().unwrap().x += 1e-6,
        ];
        let right = name(&head);
        assert_eq!(name(&head.clone()), right);
        for (i, change) in changes.iter().enumerate() {
            let mut other = head.clone();
            change(&mut other);
            assert_ne!(name(&other), right, "change {i}");
        }
    }
}
