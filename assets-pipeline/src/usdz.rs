//! USD packages (`.usdz`): zip archives whose files are stored as they are, each from a multiple of 64 bytes on.
//!
//! The first file is the layer that a program opens. Source: the usdz specification 1.3 (Pixar) and APPNOTE 6.3.10 (PKWARE).
//! A zip crate would bring compression that packages must not have, and does not align.

use flate2::Crc;

/// Files start at multiples of this.
const ALIGNMENT: usize = 64;
/// 1 January 1980: packages of equal content are equal.
const DATE: u16 = 0x21;
/// Kind of the extra field that fills up to the alignment, as USD writes it.
const PADDING: u16 = 0x1986;
const LOCAL: &[u8; 4] = b"PK\x03\x04";
const CENTRAL: &[u8; 4] = b"PK\x01\x02";
const END: &[u8; 4] = b"PK\x05\x06";

/// A file of a package.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct File<'a> {
    /// Path with `/`.
    pub name: String,
    /// Content.
    pub bytes: std::borrow::Cow<'a, [u8]>,
}

/// The package of files, in this order. `None` where one of them is too large for 32-bit sizes, or a name too long.
pub fn write(files: &[(&str, &[u8])]) -> Option<Vec<u8>> {
    let mut out = Vec::new();
    let mut directory = Vec::new();
    for (name, bytes) in files {
        let mut crc = Crc::new();
        crc.update(bytes);
        let size = u32::try_from(bytes.len()).ok()?;
        let length = u16::try_from(name.len()).ok()?;
        let start = u32::try_from(out.len()).ok()?;
        // Header of 30 bytes, name, and at least the four bytes of an extra field.
        let before = out.len() + 30 + name.len() + 4;
        let padding = before.next_multiple_of(ALIGNMENT) - before;
        let extra = 4 + padding as u16;
        let mut fields = Vec::new();
        // Version 1.0, names in UTF-8, stored.
        [10_u16, 1 << 11, 0, 0, DATE].iter().for_each(|v| fields.extend(v.to_le_bytes()));
        [crc.sum(), size, size].iter().for_each(|v| fields.extend(v.to_le_bytes()));
        fields.extend(length.to_le_bytes());
        out.extend(LOCAL);
        out.extend(&fields);
        out.extend(extra.to_le_bytes());
        out.extend(name.as_bytes());
        out.extend(PADDING.to_le_bytes());
        out.extend((padding as u16).to_le_bytes());
        out.resize(out.len() + padding, 0);
        out.extend(*bytes);
        directory.extend(CENTRAL);
        directory.extend(10_u16.to_le_bytes());
        directory.extend(&fields);
        // No extra field, comment, disk and attributes.
        directory.extend([0; 12]);
        directory.extend(start.to_le_bytes());
        directory.extend(name.as_bytes());
    }
    let count = u16::try_from(files.len()).ok()?;
    let start = u32::try_from(out.len()).ok()?;
    let size = u32::try_from(directory.len()).ok()?;
    out.extend(directory);
    out.extend(END);
    out.extend([0; 4]);
    out.extend(count.to_le_bytes());
    out.extend(count.to_le_bytes());
    out.extend(size.to_le_bytes());
    out.extend(start.to_le_bytes());
    out.extend([0; 2]);
    Some(out)
}

/// The files of a package; the error says what is wrong with it.
///
/// # Errors
/// No zip archive, one that is cut off, compressed or encrypted files.
pub fn read(bytes: &[u8]) -> Result<Vec<File<'_>>, String> {
    let word = |at: usize| Some(u16::from_le_bytes(bytes.get(at..at + 2)?.try_into().ok()?) as usize);
    let long = |at: usize| Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?) as usize);
    let broken = || "a zip archive that is broken or cut off".to_owned();
    // The end record has a comment of at most 64 KiB behind it.
    let least = bytes.len().saturating_sub(22 + 65_535);
    let last = bytes.len().checked_sub(22).ok_or_else(broken)?;
    let end = (least..=last).rev().find(|i| bytes[*i..].starts_with(END)).ok_or_else(broken)?;
    let count = word(end + 10).ok_or_else(broken)?;
    let mut at = long(end + 16).ok_or_else(broken)?;
    let mut files = Vec::new();
    for _ in 0..count {
        if bytes.get(at..at + 4) != Some(CENTRAL) {
            return Err(broken());
        }
        let field = |offset: usize| word(at + offset).ok_or_else(broken);
        let (flags, method) = (field(8)?, field(10)?);
        let size = long(at + 20).ok_or_else(broken)?;
        let (name, extra, comment) = (field(28)?, field(30)?, field(32)?);
        let local = long(at + 42).ok_or_else(broken)?;
        let text = bytes.get(at + 46..at + 46 + name).ok_or_else(broken)?;
        let text = String::from_utf8_lossy(text).into_owned();
        if flags & 1 != 0 || method != 0 {
            return Err(format!(
                "the file {text:?}, compressed or encrypted: packages store files as they are"
            ));
        }
        let in_local = |offset: usize| word(local.checked_add(offset)?);
        let skipped = in_local(26).and_then(|n| Some(n + in_local(28)?)).ok_or_else(broken)?;
        let start = local + 30 + skipped;
        let content = start.checked_add(size).and_then(|end| bytes.get(start..end)).ok_or_else(broken)?;
        files.push(File { name: text, bytes: content.into() });
        at += 46 + name + extra + comment;
    }
    Ok(files)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_come_back_and_are_aligned() {
        let long = vec![7_u8; 1000];
        let files: [(&str, &[u8]); 3] =
            [("head.usda", b"#usda 1.0\n"), ("a/\u{e9}.png", &long), ("empty", b"")];
        let package = write(&files).expect("a package");
        let read = read(&package).expect("what was written");
        assert_eq!(read.len(), 3);
        for (file, (name, bytes)) in read.iter().zip(files) {
            assert_eq!((file.name.as_str(), &*file.bytes), (name, bytes));
            if !bytes.is_empty() {
                let start = package.windows(bytes.len()).position(|w| w == bytes).expect("its bytes");
                assert_eq!(start % ALIGNMENT, 0, "{name}");
            }
        }
    }

    #[test]
    fn broken_packages_are_refused() {
        let package = write(&[("head.usda", b"#usda 1.0\n")]).expect("a package");
        for length in 0..package.len() {
            read(&package[..length]).expect_err("cut off");
        }
        for i in 0..package.len() {
            let mut damaged = package.clone();
            damaged[i] ^= 0xff;
            // Whatever it says, it neither panics nor reads outside.
            let _ = read(&damaged);
        }
        let mut compressed = package.clone();
        let central = package.windows(4).position(|w| w == CENTRAL).expect("a directory");
        compressed[central + 10] = 8;
        assert!(read(&compressed).expect_err("compressed").contains("head.usda"));
    }
}
