//! Heads in the light of lamps and an even sky, for path tracers of other programs: `tests/interchange/patches.sh`.
//!
//! `interchange_patches SCENES.json FOLDER [SIZE]` writes of each scene `FOLDER/NAME/scene.json` (camera, lamps, sky, names of
//! patches), `mesh.bin` (see [`mesh`]), `rubor.f32` (linear radiance, R, G, B, rows from the top) and `patches.u8` (number of the
//! patch of each pixel, 255 for none). Off: hair, relief, wrinkles, highlights of skin, blood that moves. The skin has the albedo
//! of its maps at each vertex, other parts one colour.

use std::path::Path;

use glam::Vec3;
use rubor::inputs;
use rubor::studio::Studio;
use rubor_renderer::channels::Channel;
use rubor_renderer::settings::{AntialiasMethod, ColorMethod, DetailMethod, Settings, WrinkleMethod};
use rubor_rig::deform::{deform_points, point_normals};
use rubor_rig::evaluate::{Evaluator, LightState, Shot};
use rubor_rig::head::{Head, Material};
use rubor_rig::map::Map;
use rubor_rig::skin::chromophores::{ChromophoreModel, SkinModel};
use rubor_rig::timeline::{LightKind, Sequence};
use serde::Deserialize;
use serde_json::{Value, json};

type Outcome<T = ()> = Result<T, Box<dyn std::error::Error>>;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Scene {
    name: String,
    /// Path of a head; the built-in one without.
    head: Option<String>,
    /// Factor of the melanin of the head's map.
    #[serde(default = "one")]
    melanin: f32,
    /// Radiance of an even sky.
    #[serde(default)]
    sky: f32,
    sequence: Value,
    patches: Vec<Patch>,
    /// Settings of rubor that differ.
    #[serde(default)]
    settings: Value,
}

/// Pixels that show certain parts within a radius of a place of the picture.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Patch {
    name: String,
    /// Share of the width and height of the picture.
    at: [f32; 2],
    /// Radius in the same share of the height.
    radius: f32,
    /// Names of parts; the skin without.
    #[serde(default)]
    parts: Vec<String>,
}

fn one() -> f32 {
    1.0
}

fn main() -> Outcome {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [scenes, folder, rest @ ..] = &arguments[..] else {
        return Err("expected SCENES.json FOLDER [SIZE]".into());
    };
    let size: u32 = rest.first().map_or(Ok(192), |s| s.parse())?;
    let scenes: Vec<Scene> = serde_json::from_str(&std::fs::read_to_string(scenes)?)?;
    let mut studio = Studio::open(None)?;
    for scene in scenes {
        let folder = Path::new(folder).join(&scene.name);
        std::fs::create_dir_all(&folder)?;
        draw(&mut studio, &scene, &folder, size)?;
        println!("{}", scene.name);
    }
    Ok(())
}

/// A head without what other programs do not draw.
fn plain(mut head: Head, melanin: f32) -> Head {
    let maps = &mut head.maps;
    maps.slopes = None;
    maps.hair = None;
    maps.wrinkle_slopes.clear();
    maps.zones.clear();
    maps.distributions.clear();
    maps.specular = Some(Map::filled(1, 1, &[0.0, 0.3]));
    maps.scattering = None;
    if let Some(map) = &mut maps.melanin {
        map.values.iter_mut().for_each(|v| *v = (*v * melanin).clamp(0.0, 0.5));
    }
    for part in head.mesh.parts.iter_mut().filter(|p| matches!(p.material, Material::Lash | Material::Hair)) {
        part.material = Material::Hidden;
    }
    head
}

/// An even sky as a picture that rubor reads.
fn sky_file(folder: &Path, radiance: f32) -> Outcome<String> {
    // Radiance's RGBE: one exponent for three mantissas.
    let exponent = radiance.log2().floor() as i32 + 1;
    let mantissa = (radiance * 256.0 / 2_f32.powi(exponent)).round().min(255.0) as u8;
    let texel = [mantissa, mantissa, mantissa, (exponent + 128) as u8];
    let mut bytes = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4 +X 8\n".to_vec();
    (0..32).for_each(|_| bytes.extend(texel));
    let path = folder.join("sky.hdr");
    std::fs::write(&path, bytes)?;
    Ok(path.display().to_string())
}

fn draw(studio: &mut Studio, scene: &Scene, folder: &Path, size: u32) -> Outcome {
    let loaded = inputs::head(scene.head.as_deref().map(Path::new))?;
    let rig = inputs::rig(None, loaded.rig)?;
    let head = plain(loaded.head, scene.melanin);
    let mut sequence = scene.sequence.clone();
    if scene.sky > 0.0 {
        sequence["environment"] = json!({ "name": sky_file(folder, scene.sky)? });
    }
    let sequence = Sequence::from_json("sequence", &sequence.to_string())?;
    let (evaluator, _) = Evaluator::new(&head, &rig, &sequence)?;
    let shot = evaluator.at(0.0);
    studio.set_heads([&head])?;
    let mut settings = Settings::default();
    settings.output.size = [size; 2];
    settings.output.channels = vec![Channel::Radiance, Channel::Ids];
    settings.quality.antialias = AntialiasMethod::None;
    settings.quality.detail = DetailMethod::Full;
    settings.quality.color = ColorMethod::Static;
    settings.quality.wrinkles = WrinkleMethod::None;
    if !scene.settings.is_null() {
        settings.overlay(&scene.settings)?;
    }
    studio.cut(0);
    let frame = studio.render(std::slice::from_ref(&shot), 0.0, &settings)?;
    frame.picture().save(folder.join("rubor.png"))?;
    let [radiance, ids] = frame.channels.as_slice() else { return Err("two channels".into()) };
    let light: Vec<f32> = radiance.texels::<4>().flat_map(|t| [t[0], t[1], t[2]]).collect();
    std::fs::write(folder.join("rubor.f32"), floats(&light))?;
    let triangles: Vec<u32> = ids.texels::<1>().map(|[id]| id.to_bits() & 0x07ff_ffff).collect();
    std::fs::write(folder.join("patches.u8"), patches(scene, &head, &triangles, size)?)?;
    std::fs::write(folder.join("mesh.bin"), mesh(&head, &shot))?;
    let camera = shot.camera;
    let described = json!({
        "name": scene.name, "size": [size, size], "sky": scene.sky,
        "camera": {
            "positionMm": (1e3 * camera.position).to_array(), "targetMm": (1e3 * camera.target).to_array(),
            "up": camera.up.to_array(), "fovYDegrees": camera.fov_y.to_degrees(),
        },
        "lamps": shot.lights.iter().map(lamp).collect::<Vec<Value>>(),
        "patches": scene.patches.iter().map(|p| &p.name).collect::<Vec<_>>(),
    });
    std::fs::write(folder.join("scene.json"), serde_json::to_vec_pretty(&described)?)?;
    Ok(())
}

/// Irradiance of parallel light, or radiant intensity; cones are left out.
fn lamp(light: &LightState) -> Value {
    let power = light.power_linear.to_array();
    match light.kind {
        LightKind::Directional => json!({
            "kind": "directional", "power": power, "direction": light.direction.to_array(),
            "angleDegrees": 2.0 * light.radius.atan().to_degrees(),
        }),
        _ => json!({
            "kind": "point", "power": power, "positionMm": (1e3 * light.position).to_array(),
            "radiusMm": 1e3 * light.radius,
        }),
    }
}

/// The part of each triangle as frames number them: opaque parts in their order.
fn parts_of(head: &Head) -> Vec<usize> {
    let opaque = head.mesh.parts.iter().enumerate().filter(|(_, p)| p.material.is_opaque());
    opaque.flat_map(|(i, p)| p.triangles.clone().map(move |_| i)).collect()
}

fn patches(scene: &Scene, head: &Head, triangles: &[u32], size: u32) -> Outcome<Vec<u8>> {
    let parts = parts_of(head);
    let mut numbers = vec![255; triangles.len()];
    for (i, patch) in scene.patches.iter().enumerate() {
        let is_wanted = |part: usize| {
            let part = &head.mesh.parts[part];
            if patch.parts.is_empty() {
                part.material == Material::Skin
            } else {
                patch.parts.contains(&part.name)
            }
        };
        for (k, number) in numbers.iter_mut().enumerate() {
            let at = [k as u32 % size, k as u32 / size].map(|v| (v as f32 + 0.5) / size as f32);
            let inside = (at[0] - patch.at[0]).hypot(at[1] - patch.at[1]) <= patch.radius;
            let part = triangles[k].checked_sub(1).and_then(|t| parts.get(t as usize));
            if inside && *number == 255 && part.is_some_and(|p| is_wanted(*p)) {
                *number = i as u8;
            }
        }
        if !numbers.contains(&(i as u8)) {
            return Err(format!("{}: no pixel shows {}", scene.name, patch.name).into());
        }
    }
    Ok(numbers)
}

/// Little-endian: counts of vertices and triangles (u32), then of each vertex place (mm), normal and albedo (f32 x 9), then of
/// each triangle three vertices and the kind of its material (u32 x 4): 0 scatters as skin, 1 eye, 2 teeth, 3 lining.
fn mesh(head: &Head, shot: &Shot) -> Vec<u8> {
    let mesh = &head.mesh;
    let lookup = SkinModel::new(&ChromophoreModel::default()).bake(64, 64);
    let points = deform_points(mesh, &head.shapes, &shot.face.shapes);
    let normals = point_normals(mesh, &points);
    let place = |p: Vec3| 1e3 * (shot.face.head_rotation * p + shot.face.head_translation);
    let skin_color = |uv: glam::Vec2| {
        let sample = |map: &Option<Map>, c: u32| map.as_ref().map_or(0.03, |m| m.sample(uv.x, uv.y, c));
        match &head.maps.albedo {
            Some(map) => Vec3::from([0, 1, 2].map(|c| map.sample(uv.x, uv.y, c))),
            None => {
                Vec3::from(lookup.sample(sample(&head.maps.melanin, 0), sample(&head.maps.hemoglobin, 0)))
            }
        }
    };
    let mut vertices = Vec::new();
    let mut triangles = Vec::<u32>::new();
    for part in mesh.parts.iter().filter(|p| p.material.is_opaque()) {
        let (kind, color) = match part.material {
            Material::Skin => (0, None),
            Material::Eye => (1, Some(Vec3::new(0.5, 0.42, 0.34))),
            // The mean of the enamel that rubor draws, by the light of both in one shader.
            Material::Teeth => (2, Some(Vec3::new(0.69, 0.61, 0.485))),
            Material::Gums => (3, Some(Vec3::new(0.374, 0.135, 0.125))),
            _ => (3, Some(Vec3::new(0.36, 0.105, 0.095))),
        };
        for t in &mesh.triangles[part.triangles.start as usize..part.triangles.end as usize] {
            for v in t {
                let vertex = mesh.vertices[*v as usize];
                let p = vertex.point as usize;
                let normal = shot.face.head_rotation * normals[p];
                let albedo = color.unwrap_or_else(|| skin_color(vertex.uv));
                triangles.push((vertices.len() / 9) as u32);
                vertices.extend([place(points[p]), normal, albedo].iter().flat_map(|v| v.to_array()));
            }
            triangles.push(kind);
        }
    }
    let mut bytes =
        [(vertices.len() / 9) as u32, (triangles.len() / 4) as u32].map(u32::to_le_bytes).concat();
    bytes.extend(floats(&vertices));
    triangles.iter().for_each(|v| bytes.extend(v.to_le_bytes()));
    bytes
}

fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}
