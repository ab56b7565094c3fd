//! Encodes frames to an MP4 with the program ffmpeg, if it is installed.

use std::path::Path;
use std::process::{Command, Stdio};

use crate::error::{Failure, Outcome};
use crate::output;

/// Outcome of encoding.
pub enum Video {
    /// The file was written.
    Written,
    /// There is no ffmpeg on this machine.
    NoEncoder,
}

/// Encodes `frame.0001.png` to the last of `count` frames of a folder into a file of the folder. H.264, yuv420p, Rec. 709
/// with sRGB transfer, playable while it loads.
///
/// # Errors
/// The program fails, or the file cannot be written.
pub fn encode(folder: &Path, count: usize, fps: f64, name: &str) -> Outcome<Video> {
    let available =
        Command::new("ffmpeg").arg("-version").stdout(Stdio::null()).stderr(Stdio::null()).status();
    if !available.is_ok_and(|s| s.success()) {
        return Ok(Video::NoEncoder);
    }
    let path = &folder.join(name);
    let mut said = String::new();
    let written = output::commit(path, |partial| {
        let partial = partial.file_name().ok_or_else(|| std::io::Error::other("no name"))?;
        // Names relative to the folder: ffmpeg takes `%` and `:` of a path for patterns and protocols.
        let output = Command::new("ffmpeg")
            .current_dir(folder)
            .stdin(Stdio::null())
            .args(["-y", "-loglevel", "error", "-start_number", "1"])
            .args(["-framerate", &fps.to_string(), "-i", "frame.%04d.png"])
            // Later frames are none of this job.
            .args(["-frames:v", &count.to_string()])
            // yuv420p needs even sides.
            .args(["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2,scale=out_color_matrix=bt709:out_range=tv"])
            .args(["-c:v", "libx264", "-crf", "16", "-pix_fmt", "yuv420p"])
            .args(["-colorspace", "bt709", "-color_primaries", "bt709", "-color_trc", "iec61966-2-1"])
            .args(["-movflags", "+faststart"])
            .arg(partial)
            .output()?;
        if output.status.success() {
            return Ok(());
        }
        said = String::from_utf8_lossy(&output.stderr).trim().to_owned();
        Err(std::io::Error::other("ffmpeg failed"))
    });
    match written {
        Ok(()) => Ok(Video::Written),
        Err(_) if !said.is_empty() => Err(Failure::job(format!("{}: ffmpeg said: {said}", path.display()))),
        Err(failure) => Err(failure),
    }
}
