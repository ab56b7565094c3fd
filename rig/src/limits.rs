//! How much the files of one command may claim: every reader takes its limits from here.
//!
//! One number says it all: the memory that reading may take, 2 GiB unless `RUBOR_LIMIT_MEMORY` or `--limit-memory`
//! says otherwise. The others are parts of it, chosen so that the largest file that each admits stays below it
//! (`docs/hardening.md` has the measurement). A header may claim any size, so limits hold before memory is taken.
//!
//! ```
//! use rubor_rig::limits::Limits;
//! let small = Limits::of_memory(64 << 20);
//! assert_eq!((small.file_bytes(), small.vertices()), (32 << 20, 131_072));
//! assert_eq!("1.5G".parse::<Limits>().unwrap().memory_bytes(), 1536 << 20);
//! ```

use std::fs::{File, Metadata};
use std::io::{Error, ErrorKind, Read, Result};
use std::path::Path;
use std::str::FromStr;
use std::sync::OnceLock;

/// Environment variable with the memory that reading may take, as in [`Limits::from_str`].
pub const VARIABLE: &str = "RUBOR_LIMIT_MEMORY";
/// Memory that reading may take by default, bytes.
const DEFAULT_MEMORY_BYTES: u64 = 2 << 30;
/// Below this no head could be read.
const LEAST_MEMORY_BYTES: u64 = 16 << 20;

/// The limits of this process: the one value that is not passed along, as every reader of every crate needs it.
static OF_PROCESS: OnceLock<Limits> = OnceLock::new();

/// Limits on what files may claim.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    memory_bytes: u64,
}

impl Default for Limits {
    fn default() -> Self {
        Self { memory_bytes: DEFAULT_MEMORY_BYTES }
    }
}

impl Limits {
    /// Limits for this much memory, at least 16 MiB.
    pub fn of_memory(bytes: u64) -> Self {
        Self { memory_bytes: bytes.max(LEAST_MEMORY_BYTES) }
    }

    /// The limits of this process: those that [`Limits::set`] was given first, else the variable's, else the default.
    pub fn of_process() -> Self {
        *OF_PROCESS.get_or_init(|| Self::of_variable().ok().flatten().unwrap_or_default())
    }

    /// The limits that `RUBOR_LIMIT_MEMORY` asks for.
    ///
    /// # Errors
    /// It is set and no size.
    pub fn of_variable() -> std::result::Result<Option<Self>, String> {
        match std::env::var(VARIABLE) {
            Ok(text) => text.parse().map(Some).map_err(|e| format!("{VARIABLE}: {e}")),
            Err(_) => Ok(None),
        }
    }

    /// Makes these the limits of the process. Only the first call, before anything is read, has an effect; returns
    /// whether this was it.
    pub fn set(self) -> bool {
        OF_PROCESS.set(self).is_ok()
    }

    /// Memory that reading may take, bytes.
    pub fn memory_bytes(self) -> u64 {
        self.memory_bytes
    }

    /// Largest file, and largest sum of the files that a document names, bytes: half of the memory.
    pub fn file_bytes(self) -> u64 {
        self.memory_bytes / 2
    }

    /// Largest text of lines (OBJ, USD, Maya, tables), bytes: an eighth of the memory, as values in memory take more
    /// than their text.
    pub fn text_bytes(self) -> u64 {
        self.memory_bytes / 8
    }

    /// Most vertices of a head: 512 bytes of memory each.
    pub fn vertices(self) -> u64 {
        self.memory_bytes / 512
    }

    /// Most numbers of geometry and shapes of a head (three for an offset): 32 bytes of memory each.
    pub fn numbers(self) -> u64 {
        self.memory_bytes / 32
    }

    /// Most keys of the animation of a head: 128 bytes of memory each.
    pub fn keys(self) -> u64 {
        self.memory_bytes / 128
    }

    /// Most texels of all pictures of materials of a head, four bytes each: three eighths of the memory.
    pub fn picture_texels(self) -> u64 {
        self.memory_bytes / 32 * 3
    }

    /// Most values of all maps of a head, four bytes each: half of the memory.
    pub fn map_values(self) -> u64 {
        self.memory_bytes / 8
    }
}

impl FromStr for Limits {
    type Err = String;

    /// `2G`, `1.5GiB`, `512M`, `300000000`: bytes, or units of 1024.
    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let wrong =
            || format!("found {text:?}, expected a size of at least 16M such as 4G, 512M or 3000000000");
        let lower = text.trim().to_ascii_lowercase();
        let digits = lower.trim_end_matches("ib").trim_end_matches('b');
        let (digits, unit) = match digits.char_indices().last() {
            Some((i, 'k')) => (&digits[..i], 1_u64 << 10),
            Some((i, 'm')) => (&digits[..i], 1 << 20),
            Some((i, 'g')) => (&digits[..i], 1 << 30),
            Some((i, 't')) => (&digits[..i], 1 << 40),
            _ => (digits, 1),
        };
        let number: f64 = digits.trim().parse().map_err(|_| wrong())?;
        let bytes = number * unit as f64;
        if !(bytes >= LEAST_MEMORY_BYTES as f64 && bytes < 2_f64.powi(60)) {
            return Err(wrong());
        }
        Ok(Self { memory_bytes: bytes as u64 })
    }
}

/// All bytes of a regular file within [`Limits::file_bytes`].
///
/// # Errors
/// As [`read_at_most`].
pub fn read(path: &Path) -> Result<Vec<u8>> {
    read_at_most(path, Limits::of_process().file_bytes())
}

/// All bytes of a regular file of at most this length. Devices and pipes, also behind links, may never end and are
/// refused.
///
/// # Errors
/// The system refuses; no regular file; a longer one.
pub fn read_at_most(path: &Path, most: u64) -> Result<Vec<u8>> {
    let metadata = std::fs::metadata(path)?;
    require_regular(&metadata)?;
    let too_long = |length: u64| {
        let message = format!(
            "{length} bytes, more than the limit of {most}; `--limit-memory` or {VARIABLE} raises it"
        );
        Err(Error::new(ErrorKind::FileTooLarge, message))
    };
    if metadata.len() > most {
        return too_long(metadata.len());
    }
    let file = File::open(path)?;
    let mut bytes = Vec::new();
    bytes.try_reserve_exact(metadata.len() as usize)?;
    // A file may grow while it is read, and those of the system state no length.
    file.take(most.saturating_add(1)).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > most { too_long(bytes.len() as u64) } else { Ok(bytes) }
}

/// The text of a regular file within [`Limits::text_bytes`].
///
/// # Errors
/// As [`read_at_most`]; bytes that are not UTF-8.
pub fn read_to_string(path: &Path) -> Result<String> {
    let bytes = read_at_most(path, Limits::of_process().text_bytes())?;
    String::from_utf8(bytes).map_err(|e| {
        let at = e.utf8_error().valid_up_to();
        Error::new(ErrorKind::InvalidData, format!("byte {at} is not UTF-8, expected text in UTF-8"))
    })
}

fn require_regular(metadata: &Metadata) -> Result<()> {
    if metadata.is_file() {
        return Ok(());
    }
    let found = if metadata.is_dir() { "a folder" } else { "a device or a pipe" };
    Err(Error::new(ErrorKind::InvalidInput, format!("found {found}, expected a regular file")))
}

/// What was found and what is allowed, for the error of a reader.
pub type Excess = (String, String);

/// Refuses a text of lines that is longer than [`Limits::text_bytes`].
///
/// # Errors
/// What was found and what is allowed.
pub fn check_text(text: &[u8]) -> std::result::Result<(), Excess> {
    within("bytes of text", text.len() as u64, Limits::of_process().text_bytes())
}

/// Refuses a text with a line of more than a sixteenth of [`Limits::text_bytes`]: tables are held by rows.
///
/// # Errors
/// What was found and what is allowed.
pub fn check_lines(text: &[u8]) -> std::result::Result<(), Excess> {
    let longest = text.split(|b| *b == b'\n').map(<[u8]>::len).max().unwrap_or(0);
    within("bytes in a line", longest as u64, Limits::of_process().text_bytes() / 16)
}

/// Refuses a text with brackets (JSON, USD) whose values, `copies` times in memory, would take more than may be taken.
///
/// An estimate from above: 640 bytes for an object, the smallest node of a tree map; 72 for a value, twice its size as
/// lists double when they grow; the text twice. Brackets and commas in strings count too.
///
/// # Errors
/// What was found and what is allowed.
pub fn check_values(text: &[u8], copies: u64) -> std::result::Result<(), Excess> {
    let (mut objects, mut values) = (0_u64, 0_u64);
    for byte in text {
        objects += u64::from(*byte == b'{');
        values += u64::from(matches!(byte, b',' | b'[' | b'('));
    }
    let bytes = (640 * objects + 72 * values + 2 * text.len() as u64).saturating_mul(copies);
    let found = format!("bytes of memory for {objects} objects and {values} values");
    within(&found, bytes, Limits::of_process().memory_bytes())
}

/// Refuses a number above a limit.
///
/// # Errors
/// What was found and what is allowed.
pub fn within(what: &str, number: u64, most: u64) -> std::result::Result<(), Excess> {
    if number <= most {
        return Ok(());
    }
    let expected = format!("at most {most}; `--limit-memory` or {VARIABLE} raises the limit");
    Err((format!("{number} {what}"), expected))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_read() {
        let bytes = |text: &str| text.parse::<Limits>().map(Limits::memory_bytes);
        for (text, expected) in [
            ("2G", 2 << 30),
            ("1.5 GiB", 1536 << 20),
            ("512mb", 512 << 20),
            ("16384K", 16 << 20),
            ("300000000", 300_000_000),
        ] {
            assert_eq!(bytes(text), Ok(expected), "{text}");
        }
        for wrong in ["", "G", "-2G", "15M", "nan", "inf", "1e30", "2X"] {
            assert!(bytes(wrong).unwrap_err().contains("expected a size"), "{wrong}");
        }
    }

    #[test]
    fn only_regular_files_within_the_limit_are_read() {
        let folder = std::env::temp_dir().join(format!("rubor-limits-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let file = folder.join("a");
        std::fs::write(&file, b"12345").unwrap();
        assert_eq!(read_at_most(&file, 5).unwrap(), b"12345");
        assert!(read_at_most(&file, 4).unwrap_err().to_string().contains("5 bytes"));
        assert!(read(&folder).unwrap_err().to_string().contains("a folder"));
        #[cfg(unix)]
        {
            let link = folder.join("zero");
            std::os::unix::fs::symlink("/dev/zero", &link).unwrap();
            assert!(read(&link).unwrap_err().to_string().contains("a device"));
        }
        std::fs::write(&file, [b'a', 0xff]).unwrap();
        assert!(read_to_string(&file).unwrap_err().to_string().contains("byte 1"));
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
