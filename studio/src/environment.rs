//! Surroundings by name or file.

use std::path::Path;

use glam::Vec3;
use rubor_assets::image_io::{SampleKind, load_image};
use rubor_renderer::EnvironmentMap;

use crate::error::{Failure, Outcome};

/// A built-in environment, or the equirectangular radiance of a file (`.exr`, `.hdr`).
///
/// # Errors
/// No environment and no file of that name; an image that does not hold finite radiance of 0 or more.
pub fn load(name: &str) -> Outcome<EnvironmentMap> {
    match EnvironmentMap::named(name) {
        Some(map) => Ok(map),
        None => read(Path::new(name)),
    }
}

/// Whether a name is that of a built-in environment.
pub fn is_built_in(name: &str) -> bool {
    EnvironmentMap::NAMES.contains(&name)
}

fn read(path: &Path) -> Outcome<EnvironmentMap> {
    let wrong = |what: &dyn std::fmt::Display| {
        let names = EnvironmentMap::NAMES.map(|n| format!("{n:?}")).join(", ");
        Failure::input(format!("environment {:?}: {what}", path.display().to_string())).hint(format!(
            "built in are {names}; anything else is the path of an equirectangular .hdr or .exr image"
        ))
    };
    if !path.is_file() {
        return Err(wrong(&"no such file, and no built-in environment of that name"));
    }
    let image = load_image(path)?;
    if image.kind != SampleKind::F32 {
        return Err(wrong(&"found an image of whole numbers, expected radiance as floats"));
    }
    let map = image.require_rgb()?;
    let texels: Vec<Vec3> = map.values.chunks_exact(3).map(Vec3::from_slice).collect();
    if let Some(i) = texels.iter().position(|t| !t.is_finite() || t.min_element() < 0.0) {
        let (x, y) = (i % map.width as usize, i / map.width as usize);
        return Err(wrong(&format!(
            "found a radiance of {} at column {x}, row {y}, expected finite ones of 0 or more",
            texels[i]
        )));
    }
    Ok(EnvironmentMap { width: map.width, height: map.height, texels })
}

#[cfg(test)]
mod tests {
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
        let read = load(&save("a.exr", &map, SampleKind::F32)).unwrap();
        assert_eq!((read.width, read.height, read.texels[5]), (4, 2, Vec3::new(15.0, 16.0, 17.0)));
        let message = |name: &str| load(name).unwrap_err().to_string();
        assert!(message(&save("a.png", &map, SampleKind::U8)).contains("whole numbers"));
        map.values[13] = -1.0;
        assert!(message(&save("b.exr", &map, SampleKind::F32)).contains("column 0, row 1"));
        assert!(message("stdio").contains("\"studio\""));
        assert_eq!(load("sky").unwrap(), EnvironmentMap::sky());
    }

    #[test]
    fn radiance_hdr_loads() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.hdr");
        let picture = image::Rgb32FImage::from_pixel(8, 4, image::Rgb([4.0, 2.0, 0.5]));
        picture.save(&path).unwrap();
        let read = load(&path.to_string_lossy()).unwrap();
        assert!(read.texels.iter().all(|t| *t == Vec3::new(4.0, 2.0, 0.5)));
    }
}
