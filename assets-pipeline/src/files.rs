//! Files that appear under their name only when they are complete.

use std::io::Write;
use std::path::Path;

/// Writes a file in the same folder under an unpredictable name, then renames it; a failure leaves nothing behind
/// and an older file as it was.
pub(crate) fn replace(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut builder = tempfile::Builder::new();
    builder.prefix(".").suffix(".part");
    // Temporary files are private by default; this one becomes a file like any other, less the user's mask.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut part = builder.tempfile_in(folder)?;
    part.write_all(bytes)?;
    part.as_file().sync_all()?;
    part.persist(path).map_err(|e| e.error)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

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
        assert!(names.into_iter().all(|n| !n.to_string_lossy().ends_with(".part")));
        assert!(replace(&folder.path().join("none/a.txt"), b"four").is_err());
    }
}
