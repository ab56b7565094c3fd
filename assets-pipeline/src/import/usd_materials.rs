//! UsdPreviewSurface materials with their pictures.

use std::collections::HashMap;
use std::path::Path;

use glam::Vec2;
use rubor_rig::authored::{
    AlphaMode, AuthoredImage, AuthoredMaterial, AuthoredTexture, TextureTransform, Wrap,
};

use super::picture::{Channel, Gallery};
use super::usda::{Layer, Prim, Value, above};
use crate::notes::Notes;
use crate::usdz;

/// Materials of a layer, each read once.
pub(super) struct Looks<'a> {
    by_path: HashMap<&'a str, &'a Prim>,
    /// The first UsdPreviewSurface below each prim.
    first_surface: HashMap<&'a str, &'a Prim>,
    folder: &'a Path,
    package: Option<&'a [usdz::File<'a>]>,
    gallery: Gallery,
    /// Pictures of a package by name.
    packed: HashMap<String, Option<u32>>,
    pub(super) materials: Vec<AuthoredMaterial>,
    known: HashMap<String, Option<u32>>,
}

/// What an input is connected to.
struct Connected {
    texture: AuthoredTexture,
    /// Channel of the picture, 0 to 3; 0 for all colours.
    channel: usize,
}

impl<'a> Looks<'a> {
    pub(super) fn new(layer: &'a Layer, folder: &'a Path, package: Option<&'a [usdz::File<'a>]>) -> Self {
        let mut first_surface = HashMap::new();
        for surface in layer.prims.iter().filter(|p| text(p, "info:id") == Some("UsdPreviewSurface")) {
            for path in above(&surface.path) {
                first_surface.entry(path).or_insert(surface);
            }
        }
        Self {
            by_path: layer.prims.iter().map(|p| (p.path.as_str(), p)).collect(),
            first_surface,
            folder,
            package,
            gallery: Gallery::default(),
            packed: HashMap::new(),
            materials: Vec::new(),
            known: HashMap::new(),
        }
    }

    pub(super) fn take_images(&mut self) -> Vec<AuthoredImage> {
        std::mem::take(&mut self.gallery.images)
    }

    /// Index of the material of a path; `None`, with a note, where it cannot be read.
    pub(super) fn material(&mut self, path: &str, notes: &mut Notes) -> Option<u32> {
        if let Some(known) = self.known.get(path) {
            return *known;
        }
        let surface = self.surface(path);
        let read = match surface {
            Some(surface) => {
                let material = self.read(path, surface, notes);
                self.materials.push(material);
                Some(self.materials.len() as u32 - 1)
            }
            None => {
                notes.add("materials without a UsdPreviewSurface are left out", path);
                None
            }
        };
        self.known.insert(path.to_owned(), read);
        read
    }

    fn surface(&self, path: &str) -> Option<&'a Prim> {
        let material = self.by_path.get(path)?;
        let connected = ["outputs:surface.connect", "outputs:universal:surface.connect"]
            .into_iter()
            .find_map(|name| connection(material, name));
        let shader = connected.and_then(|target| self.by_path.get(prim_of(target)).copied());
        let is_surface = |p: &Prim| text(p, "info:id") == Some("UsdPreviewSurface");
        shader.filter(|p| is_surface(p)).or_else(|| self.first_surface.get(path).copied())
    }

    fn read(&mut self, path: &str, surface: &'a Prim, notes: &mut Notes) -> AuthoredMaterial {
        let mut input =
            |name: &str, notes: &mut Notes| self.connected(surface, &format!("inputs:{name}"), notes);
        let color = input("diffuseColor", notes);
        let metallic_map = input("metallic", notes);
        let roughness_map = input("roughness", notes);
        let normal = input("normal", notes);
        let opacity_map = input("opacity", notes);
        let emission_map = input("emissiveColor", notes);
        let occlusion_map = input("occlusion", notes);
        let number = |name: &str, default: f32| {
            let value = surface.properties.get(&format!("inputs:{name}"));
            let value = if let Some(Value::Number(n)) = value { *n as f32 } else { default };
            if value.is_finite() { value.clamp(0.0, 1.0) } else { default }
        };
        let triple = |name: &str, default: f32| {
            let value = surface.properties.get(&format!("inputs:{name}")).map_or(&[][..], Value::list);
            [0, 1, 2].map(|i| match value.get(i) {
                Some(Value::Number(n)) if n.is_finite() => (*n as f32).max(0.0),
                _ => default,
            })
        };
        for name in ["clearcoat", "displacement", "specularColor"] {
            let is_set = |v: &Value| !matches!(v, Value::Number(n) if *n == 0.0);
            let plain = surface.properties.get(&format!("inputs:{name}")).is_some_and(is_set);
            if plain || surface.properties.contains_key(&format!("inputs:{name}.connect")) {
                notes.add(format!("{name} is not drawn: the part looks as without it"), path);
            }
        }
        let is_in_color = |o: &Connected| {
            color.as_ref().is_some_and(|c| c.texture.image == o.texture.image) && o.channel == 3
        };
        let base_color_texture = match (&color, &opacity_map) {
            (Some(color), Some(opacity)) if !is_in_color(opacity) => {
                let of = |c: usize| Channel::Of(color.texture.image, c);
                let alpha = Channel::Of(opacity.texture.image, opacity.channel);
                let image = self.gallery.combine("base colour and alpha", [of(0), of(1), of(2), alpha]);
                Some(AuthoredTexture { image, ..color.texture })
            }
            (Some(color), _) => Some(color.texture),
            (None, Some(opacity)) => {
                let alpha = Channel::Of(opacity.texture.image, opacity.channel);
                let white = Channel::Value(255);
                let image = self.gallery.combine("alpha", [white, white, white, alpha]);
                Some(AuthoredTexture { image, ..opacity.texture })
            }
            (None, None) => None,
        };
        let metallic_roughness_texture = roughness_map.as_ref().or(metallic_map.as_ref()).map(|either| {
            let channel = |map: &Option<Connected>| {
                map.as_ref().map_or(Channel::Value(255), |m| Channel::Of(m.texture.image, m.channel))
            };
            let white = Channel::Value(255);
            let channels = [white, channel(&roughness_map), channel(&metallic_map), white];
            let image = self.gallery.combine("roughness and metal", channels);
            AuthoredTexture { image, ..either.texture }
        });
        let occlusion_texture = occlusion_map.map(|map| match map.channel {
            0 => map.texture,
            channel => {
                let of = Channel::Of(map.texture.image, channel);
                let image = self.gallery.combine("occlusion", [of, of, of, Channel::Value(255)]);
                AuthoredTexture { image, ..map.texture }
            }
        });
        let opacity = if opacity_map.is_some() { 1.0 } else { number("opacity", 1.0) };
        let cutoff = number("opacityThreshold", 0.0);
        let alpha = match (cutoff > 0.0, opacity_map.is_some() || opacity < 1.0) {
            (true, _) => AlphaMode::Mask { cutoff },
            (false, true) => AlphaMode::Blend,
            (false, false) => AlphaMode::Opaque,
        };
        if alpha == AlphaMode::Blend {
            notes.add("blended materials are drawn opaque where alpha is at least one half", path);
        }
        let base = if color.is_some() { [1.0; 3] } else { triple("diffuseColor", 0.18).map(|c| c.min(1.0)) };
        AuthoredMaterial {
            name: path.rsplit('/').next().unwrap_or(path).to_owned(),
            base_color: [base[0], base[1], base[2], opacity],
            base_color_texture,
            metallic: if metallic_map.is_some() { 1.0 } else { number("metallic", 0.0) },
            roughness: if roughness_map.is_some() { 1.0 } else { number("roughness", 0.5) },
            metallic_roughness_texture,
            normal_texture: normal.map(|n| n.texture),
            emission_linear: if emission_map.is_some() { [1.0; 3] } else { triple("emissiveColor", 0.0) },
            emission_texture: emission_map.map(|e| e.texture),
            occlusion_texture,
            alpha,
            ..AuthoredMaterial::default()
        }
    }

    fn connected(&mut self, surface: &Prim, name: &str, notes: &mut Notes) -> Option<Connected> {
        let target = connection(surface, &format!("{name}.connect"))?;
        let at = format!("{}, {name}", surface.path);
        let shader = self.by_path.get(prim_of(target)).copied();
        let Some(shader) = shader.filter(|s| text(s, "info:id") == Some("UsdUVTexture")) else {
            notes.add("inputs that are connected to other shaders than UsdUVTexture are left out", at);
            return None;
        };
        let channel = match target.rsplit("outputs:").next() {
            Some("g") => 1,
            Some("b") => 2,
            Some("a") => 3,
            _ => 0,
        };
        let file = shader.properties.get("inputs:file").and_then(Value::text).unwrap_or_default();
        let image = match self.image(file) {
            Ok(image) => image,
            Err(why) => {
                notes.add("textures whose picture cannot be read are left out", format!("{at} ({why})"));
                return None;
            }
        };
        let wrap = ["inputs:wrapS", "inputs:wrapT"].map(|axis| match text(shader, axis) {
            Some("clamp" | "black") => Wrap::Clamp,
            Some("mirror") => Wrap::Mirror,
            _ => Wrap::Repeat,
        });
        let mover =
            connection(shader, "inputs:st.connect").and_then(|t| self.by_path.get(prim_of(t)).copied());
        let mover = mover.filter(|m| text(m, "info:id") == Some("UsdTransform2d"));
        let transform = mover.map_or_else(TextureTransform::default, transform);
        let texture = AuthoredTexture { image, uv_set: 0, transform, wrap };
        Some(Connected { texture, channel })
    }

    /// A picture of the package, or a file beside the layer.
    fn image(&mut self, file: &str) -> Result<u32, String> {
        let Some(package) = self.package else { return self.gallery.file(self.folder, file) };
        let name = file.trim_start_matches("./").to_owned();
        if let Some(known) = self.packed.get(&name) {
            return known.ok_or_else(|| format!("{file:?}: as before"));
        }
        let found = package.iter().find(|f| f.name == name);
        let read = match found {
            Some(found) => self.gallery.add(&found.bytes, &name).map_err(|why| format!("{file:?}: {why}")),
            None => Err(format!("{file:?}: not in the package")),
        };
        self.packed.insert(name, read.clone().ok());
        read
    }
}

/// `UsdTransform2d` turns and moves with v upwards.
fn transform(prim: &Prim) -> TextureTransform {
    let pair = |name: &str, default: f32| {
        let list = prim.properties.get(name).map_or(&[][..], Value::list);
        let at = |i: usize| match list.get(i) {
            Some(Value::Number(n)) => *n as f32,
            _ => default,
        };
        Vec2::new(at(0), at(1))
    };
    let (scale, moved) = (pair("inputs:scale", 1.0), pair("inputs:translation", 0.0));
    let degrees = match prim.properties.get("inputs:rotation") {
        Some(Value::Number(n)) => *n as f32,
        _ => 0.0,
    };
    // up' = T + R S up, with down = F up where F (u, v) = (u, 1 - v): down' = F T' + R^-1 S F' down.
    let turned = TextureTransform { offset: Vec2::ZERO, rotation_radians: degrees.to_radians(), scale };
    let origin = glam::Mat2::from_angle(degrees.to_radians()) * (scale * Vec2::Y) + moved;
    let transform = TextureTransform { offset: Vec2::new(origin.x, 1.0 - origin.y), ..turned };
    if transform.matrix().is_finite() { transform } else { TextureTransform::default() }
}

fn connection<'p>(prim: &'p Prim, name: &str) -> Option<&'p str> {
    match prim.properties.get(name)? {
        Value::Path(path) => Some(path),
        Value::List(list) => list.first().and_then(Value::text),
        _ => None,
    }
}

/// The prim of a property's path.
fn prim_of(path: &str) -> &str {
    path.split_once('.').map_or(path, |(prim, _)| prim)
}

fn text<'p>(prim: &'p Prim, name: &str) -> Option<&'p str> {
    prim.properties.get(name).and_then(Value::text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn transforms_with_v_upwards_become_those_with_v_downwards() {
        let mut prim = Prim::default();
        let pair = |a: f64, b: f64| Value::List(vec![Value::Number(a), Value::Number(b)]);
        prim.properties.insert("inputs:scale".into(), pair(2.0, 3.0));
        prim.properties.insert("inputs:translation".into(), pair(0.25, 0.5));
        prim.properties.insert("inputs:rotation".into(), Value::Number(90.0));
        let matrix = transform(&prim).matrix();
        for (u, v) in [(0.0_f32, 0.0_f32), (1.0, 0.0), (0.0, 1.0), (0.3, 0.7)] {
            // Upwards: scale, a quarter turn counter-clockwise, move.
            let up = Vec2::new(-3.0 * v + 0.25, 2.0 * u + 0.5);
            let down = matrix.transform_point2(Vec2::new(u, 1.0 - v));
            assert!((down - Vec2::new(up.x, 1.0 - up.y)).length() < 1e-5, "{u} {v}: {down} {up}");
        }
    }
}
