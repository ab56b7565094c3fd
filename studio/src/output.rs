//! Writing files so that a stopped run leaves none half written.

use std::path::Path;

use rubor_assets::files;
use rubor_assets::image_io::{ImageError, SampleKind};
use rubor_renderer::channels::ChannelData;
use rubor_rig::map::Map;
use serde::Serialize;

use crate::error::{Failure, Outcome, with_causes};

/// Creates a folder and its parents.
///
/// # Errors
/// The system reports an error.
pub fn folder(path: &Path) -> Outcome {
    std::fs::create_dir_all(path).map_err(|e| Failure::write(path, e))
}

/// Writes a file: all of it, or nothing. What killed runs left in its folder goes.
///
/// # Errors
/// The system reports an error.
pub fn write(path: &Path, bytes: &[u8]) -> Outcome {
    files::replace(path, bytes).map_err(|e| Failure::write(path, e))
}

/// Writes a value as JSON that people can read.
///
/// # Errors
/// The system reports an error.
pub fn write_json(path: &Path, value: &impl Serialize) -> Outcome {
    let mut text = serde_json::to_vec_pretty(value).map_err(Failure::job)?;
    text.push(b'\n');
    write(path, &text)
}

/// Lets `make` fill a file of a temporary name in the same folder and then renames it (see [`files::replace_with`]).
///
/// # Errors
/// The system reports an error, or `make` fails; no file remains.
pub fn commit(path: &Path, make: impl FnOnce(&Path) -> std::io::Result<()>) -> Outcome {
    files::replace_with(path, |_, partial| make(partial)).map_err(|e| Failure::write(path, e))
}

/// Writes a picture; its name decides the format.
///
/// # Errors
/// The system reports an error, or the extension is not a picture format.
pub fn save_picture(path: &Path, picture: &image::RgbImage) -> Outcome {
    commit(path, |partial| picture.save(partial).map_err(std::io::Error::other))
}

/// Writes a map; its name decides the format.
///
/// # Errors
/// The system reports an error; a map or a kind of samples that the format does not have.
pub fn save_map(path: &Path, map: &Map, kind: SampleKind) -> Outcome {
    rubor_assets::image_io::save_image(path, map, kind).map_err(|e| match e {
        ImageError::Io { source, .. } => Failure::write(path, source),
        ImageError::Decode { .. } => Failure::job(with_causes(&e)),
        _ => Failure::input(with_causes(&e)),
    })
}

/// A picture as the bytes of a PNG file.
///
/// # Errors
/// The encoder fails.
pub fn encode_png(picture: &image::RgbImage) -> Outcome<Vec<u8>> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    picture.write_to(&mut bytes, image::ImageFormat::Png).map_err(Failure::job)?;
    Ok(bytes.into_inner())
}

/// Writes a channel as OpenEXR: see [`encode_channel`].
///
/// # Errors
/// The system reports an error.
pub fn save_channel(path: &Path, data: &ChannelData) -> Outcome {
    write(path, &encode_channel(data)?)
}

/// A channel as the bytes of an OpenEXR file under the names of its components; ids are whole numbers, all else are floats.
///
/// # Errors
/// The encoder fails.
pub fn encode_channel(data: &ChannelData) -> Outcome<Vec<u8>> {
    use exr::prelude::{
        AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, LayerAttributes, LineOrder,
        WritableImage,
    };
    let names = data.channel.row().components;
    let samples = |c: usize| {
        let values = data.values.iter().skip(c).step_by(names.len());
        match data.channel.is_whole() {
            true => FlatSamples::U32(values.map(|v| v.to_bits()).collect()),
            false => FlatSamples::F32(values.copied().collect()),
        }
    };
    let channels = (0..names.len()).map(|c| AnyChannel::new(names[c], samples(c))).collect();
    let layer = Layer::new(
        (data.size[0] as usize, data.size[1] as usize),
        LayerAttributes::named(data.channel.name().as_str()),
        // Blocks in a fixed order: equal values give equal bytes, however many threads compress them.
        Encoding { line_order: LineOrder::Increasing, ..Encoding::FAST_LOSSLESS },
        AnyChannels::sort(channels),
    );
    let mut bytes = std::io::Cursor::new(Vec::new());
    Image::from_layer(layer).write().to_buffered(&mut bytes).map_err(Failure::job)?;
    Ok(bytes.into_inner())
}

#[cfg(test)]
mod tests {
    use rubor_renderer::channels::Channel;

    use super::*;

    #[test]
    fn a_failed_write_leaves_nothing_and_is_no_fault_of_the_input() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let failed = commit(&path, |partial| {
            assert_eq!(partial.extension(), path.extension());
            std::fs::write(partial, b"half")?;
            Err(std::io::Error::other("stopped"))
        });
        assert_eq!(failed.unwrap_err().exit_code(), 1);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
        write(&path, b"whole").unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"whole");
        assert_eq!(write(&path.join("inside"), b"").unwrap_err().exit_code(), 1);
    }

    #[cfg(unix)]
    #[test]
    fn results_may_be_read_by_whom_the_user_lets() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let [ours, plain] = ["ours", "plain"].map(|name| folder.path().join(name));
        write(&ours, b"x").unwrap();
        std::fs::write(&plain, b"x").unwrap();
        let mode = |path: &Path| std::fs::metadata(path).unwrap().permissions().mode();
        assert_eq!(mode(&ours), mode(&plain));
    }

    #[test]
    fn channels_keep_their_names_and_the_bits_of_ids() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("ids.exr");
        let bits = [7u32, 0xf000_0001];
        let values = bits.iter().map(|b| f32::from_bits(*b)).collect();
        save_channel(&path, &ChannelData { channel: Channel::Ids, size: [2, 1], values }).unwrap();
        let read = exr::prelude::read_all_flat_layers_from_file(&path).unwrap();
        let channel = &read.layer_data[0].channel_data.list[0];
        assert_eq!(channel.name.to_string(), "id");
        assert_eq!(channel.sample_data, exr::prelude::FlatSamples::U32(bits.to_vec()));
        let path = folder.path().join("velocity.exr");
        let values = vec![1.0, 2.0, 3.0, 4.0];
        save_channel(&path, &ChannelData { channel: Channel::Velocity, size: [2, 1], values }).unwrap();
        let read = exr::prelude::read_all_flat_layers_from_file(&path).unwrap();
        let channels = &read.layer_data[0].channel_data.list;
        let of =
            |name: &str| channels.iter().find(|c| c.name.to_string() == name).unwrap().sample_data.clone();
        assert_eq!(of("Y"), exr::prelude::FlatSamples::F32(vec![2.0, 4.0]));
    }
}
