//! Encodes pictures to an MP4 with the program ffmpeg, if it is installed.

use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

use image::RgbImage;

use crate::error::{Failure, Outcome};
use crate::output;

/// Outcome of encoding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Video {
    /// The file was written.
    Written,
    /// There is no ffmpeg on this machine.
    NoEncoder,
}

/// What is said where there is no ffmpeg.
pub const NO_ENCODER: &str = "no video: the program ffmpeg is not on this machine (Debian, Ubuntu: ffmpeg)";

/// Encodes pictures of one size. H.264, yuv420p, Rec. 709 in video range with sRGB transfer, and tagged as that; playable
/// while it loads.
///
/// # Errors
/// The program fails; a picture fails or has another size; the file cannot be written.
pub fn encode(
    path: &Path,
    size: [u32; 2],
    fps: f64,
    pictures: impl IntoIterator<Item = Outcome<RgbImage>>,
) -> Outcome<Video> {
    let available =
        Command::new("ffmpeg").arg("-version").stdout(Stdio::null()).stderr(Stdio::null()).status();
    if !available.is_ok_and(|s| s.success()) {
        return Ok(Video::NoEncoder);
    }
    let mut failed: Option<Failure> = None;
    let written = output::commit(path, |partial| {
        let name = partial.file_name().ok_or_else(|| std::io::Error::other("no name"))?;
        let folder = partial.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        // A name relative to the folder: ffmpeg takes `%` and `:` of a path for patterns and protocols.
        let mut program = Command::new("ffmpeg")
            .current_dir(folder)
            .args(["-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24"])
            .args(["-video_size", &format!("{}x{}", size[0], size[1])])
            .args(["-framerate", &fps.to_string(), "-i", "pipe:0"])
            // yuv420p needs even sides.
            .args(["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2,scale=out_color_matrix=bt709:out_range=tv"])
            .args(["-c:v", "libx264", "-crf", "16", "-pix_fmt", "yuv420p", "-color_range", "tv"])
            .args(["-colorspace", "bt709", "-color_primaries", "bt709", "-color_trc", "iec61966-2-1"])
            .args(["-movflags", "+faststart"])
            .arg(name)
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()?;
        let mut into = program.stdin.take();
        for picture in pictures {
            let picture = picture.and_then(|picture| match picture.dimensions() == (size[0], size[1]) {
                true => Ok(picture),
                false => {
                    let (width, height) = picture.dimensions();
                    Err(Failure::input(format!(
                        "{}: found a picture of {width}x{height} pixels, expected {}x{}",
                        path.display(),
                        size[0],
                        size[1]
                    )))
                }
            });
            match picture {
                Ok(picture) => {
                    let written = into.as_mut().map(|pipe| pipe.write_all(picture.as_raw()));
                    // A program that ended early says why; its pipe is closed then.
                    if !matches!(written, Some(Ok(()))) {
                        break;
                    }
                }
                Err(failure) => {
                    failed = Some(failure);
                    break;
                }
            }
        }
        drop(into);
        let output = program.wait_with_output()?;
        if failed.is_none() && !output.status.success() {
            let said = String::from_utf8_lossy(&output.stderr).trim().to_owned();
            failed = Some(Failure::job(format!("{}: ffmpeg said: {said}", path.display())));
        }
        match failed {
            None => Ok(()),
            Some(_) => Err(std::io::Error::other("no video")),
        }
    });
    match (failed, written) {
        (Some(failure), _) | (None, Err(failure)) => Err(failure),
        (None, Ok(())) => Ok(Video::Written),
    }
}
