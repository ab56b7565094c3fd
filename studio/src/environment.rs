//! Environments by name or file.

use std::path::Path;

use rubor_assets::environment;
use rubor_assets::image_io::ReadOptions;
use rubor_renderer::EnvironmentMap;

use crate::error::{Failure, Outcome};
use crate::notes::Note;

/// A built-in environment, or the equirectangular radiance of a file (`.exr`, `.hdr` and others), and what was left out,
/// decoded or repaired.
///
/// # Errors
/// There is no environment or file of that name; an image that does not hold finite radiance of 0 or more.
pub fn load(name: &str) -> Outcome<(EnvironmentMap, Vec<Note>)> {
    match EnvironmentMap::named(name) {
        Some(map) => Ok((map, Vec::new())),
        None => read(Path::new(name)),
    }
}

/// Whether a name is that of a built-in environment.
pub fn is_built_in(name: &str) -> bool {
    EnvironmentMap::NAMES.contains(&name)
}

fn read(path: &Path) -> Outcome<(EnvironmentMap, Vec<Note>)> {
    let names = || EnvironmentMap::NAMES.map(|n| format!("{n:?}")).join(", ");
    let hint = || {
        format!(
            "built in are {}; anything else is the path of an equirectangular .exr or .hdr image",
            names()
        )
    };
    if !path.is_file() {
        let what = "no such file, and no built-in environment of that name";
        return Err(
            Failure::input(format!("environment {:?}: {what}", path.display().to_string())).hint(hint())
        );
    }
    let (image, notes) =
        environment::read(path, &ReadOptions::default()).map_err(|e| Failure::from(e).hint(hint()))?;
    let about = format!("environment {:?}", path.display().to_string());
    let notes = notes.into_iter().map(|message| Note::new(about.as_str(), message)).collect();
    Ok((EnvironmentMap { width: image.width, height: image.height, texels: image.texels }, notes))
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use rubor_assets::image_io::SampleKind;
    use rubor_rig::map::Map;

    use super::*;
    use crate::output::save_map;

    #[test]
    fn exr_loads_and_what_is_no_radiance_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let mut map = Map { width: 4, height: 2, channels: 3, values: (0..24).map(|i| i as f32).collect() };
        let save = |name: &str, map: &Map, kind| {
            let path = folder.path().join(name);
            save_map(&path, map, kind).unwrap();
            path.to_string_lossy().into_owned()
        };
        let (read, notes) = load(&save("a.exr", &map, SampleKind::F32)).unwrap();
        assert!(notes.is_empty());
        assert_eq!((read.width, read.height, read.texels[5]), (4, 2, Vec3::new(15.0, 16.0, 17.0)));
        let message = |name: &str| load(name).unwrap_err().to_string();
        let (_, notes) = load(&save("a.png", &map, SampleKind::U8)).unwrap();
        assert!(notes.iter().any(|n| n.message.contains("low dynamic range")), "{notes:?}");
        map.values[13] = -1.0;
        let message_of_b = message(&save("b.exr", &map, SampleKind::F32));
        assert!(message_of_b.contains("-1") && message_of_b.contains("\"studio\""), "{message_of_b}");
        assert!(message("stdio").contains("\"studio\""));
        assert_eq!(load("sky").unwrap(), (EnvironmentMap::sky(), Vec::new()));
    }

    #[test]
    fn radiance_hdr_loads() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.hdr");
        let picture = image::Rgb32FImage::from_pixel(8, 4, image::Rgb([4.0, 2.0, 0.5]));
        picture.save(&path).unwrap();
        let (read, _) = load(&path.to_string_lossy()).unwrap();
        assert!(read.texels.iter().all(|t| *t == Vec3::new(4.0, 2.0, 0.5)));
    }
}
