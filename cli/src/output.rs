//! Writing files so that a stopped run leaves none half written.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use crate::failure::{Failure, Outcome};

/// Creates a folder and its parents.
pub(crate) fn folder(path: &Path) -> Outcome {
    std::fs::create_dir_all(path)
        .map_err(|e| Failure::input(format!("{}: cannot make this folder: {e}", path.display())))
}

/// Writes a file under a temporary name beside it and then renames it.
pub(crate) fn write(path: &Path, bytes: &[u8]) -> Outcome {
    commit(path, |partial| std::fs::write(partial, bytes))
}

/// Lets `make` create the file under a temporary name and then renames it; on failure nothing is left.
pub(crate) fn commit(path: &Path, make: impl FnOnce(&Path) -> std::io::Result<()>) -> Outcome {
    let partial = partial_name(path);
    let done = make(&partial).and_then(|()| std::fs::rename(&partial, path));
    done.map_err(|e| {
        // Nothing to do when the partial file cannot be removed either: the first error says why.
        let _ = std::fs::remove_file(&partial);
        Failure::input(format!("{}: cannot write this file: {e}", path.display()))
    })
}

/// Writes a picture without its alpha, which is 1 everywhere.
pub(crate) fn save_image(path: &Path, image: &rubor_renderer::Image) -> Outcome {
    let picture = image::RgbImage::from_fn(image.width, image.height, |x, y| {
        let i = 4 * (y as usize * image.width as usize + x as usize);
        image::Rgb([image.rgba[i], image.rgba[i + 1], image.rgba[i + 2]])
    });
    commit(path, |partial| picture.save(partial).map_err(std::io::Error::other))
}

/// `frame.png` becomes `.partial-frame.png`: the extension stays, for programs that choose a format by it.
fn partial_name(path: &Path) -> PathBuf {
    let mut name = OsString::from(".partial-");
    name.push(path.file_name().unwrap_or_default());
    path.with_file_name(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_write_leaves_nothing() {
        let dir = std::env::temp_dir().join(format!("rubor-output-{}", std::process::id()));
        folder(&dir).unwrap();
        let path = dir.join("a.png");
        let failed = commit(&path, |partial| {
            std::fs::write(partial, b"half")?;
            Err(std::io::Error::other("stopped"))
        });
        assert_eq!(failed.unwrap_err().code, 2);
        assert_eq!(std::fs::read_dir(&dir).unwrap().count(), 0);
        write(&path, b"whole").unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"whole");
        std::fs::remove_dir_all(&dir).unwrap();
    }
}
