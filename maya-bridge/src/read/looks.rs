//! Shaders of a scene as materials of their author: lambert, phong, blinn, standardSurface and aiStandardSurface with
//! their file textures.
//!
//! ```text
//! shadingEngine.ss <- shader.color <- file.fileTextureName     base colour (numbers of shaders are linear)
//!                     shader.normalCamera <- bump2d, aiNormalMap <- file    tangent-space normals; heights are left out
//!                     roughness, metalness, opacity, emission
//! ```
//!
//! Roughness of phong's exponent is (2 / (n + 2))^(1/4), as for OBJ; lambert is fully rough.

use std::collections::HashMap;
use std::path::Path;

use rubor_assets::import::picture::{Channel, Gallery};
use rubor_rig::authored::{
    AlphaMode, AuthoredImage, AuthoredMaterial, AuthoredTexture, TextureTransform, Wrap,
};

use crate::ascii::scene::{Data, NodeId, Plug, Scene, Setting};
use crate::notes::Notes;

/// Shaders that are read.
const SHADERS: [&str; 7] =
    ["lambert", "phong", "phongE", "blinn", "standardSurface", "aiStandardSurface", "openPBRSurface"];

/// Materials of a scene, each read once.
pub(super) struct Looks<'s> {
    scene: &'s Scene,
    folder: &'s Path,
    gallery: Gallery,
    materials: Vec<AuthoredMaterial>,
    known: HashMap<NodeId, Option<u32>>,
}

/// A picture that drives an attribute.
#[derive(Clone, Copy)]
struct Driven {
    texture: AuthoredTexture,
    /// Channel for a single number.
    channel: usize,
}

impl<'s> Looks<'s> {
    pub(super) fn new(scene: &'s Scene, folder: &'s Path) -> Self {
        let (gallery, materials, known) = (Gallery::default(), Vec::new(), HashMap::new());
        Self { scene, folder, gallery, materials, known }
    }

    pub(super) fn finish(self) -> (Vec<AuthoredMaterial>, Vec<AuthoredImage>) {
        (self.materials, self.gallery.images)
    }

    pub(super) fn is_textured(&self, material: u32) -> bool {
        self.materials[material as usize].base_color_texture.is_some()
    }

    /// The material of a shading group; `None` where its shader is not read, with a note.
    pub(super) fn material(&mut self, group: NodeId, notes: &mut Notes) -> Option<u32> {
        let surface = self
            .scene
            .inputs(group)
            .find(|(_, to)| ["ss", "surfaceShader", "aiSurfaceShader"].contains(&to.attribute.as_str()));
        // Arnold's own shader is asked first only by Arnold: the viewport's is what every program sees.
        let shader = surface?.0.node;
        if let Some(known) = self.known.get(&shader) {
            return *known;
        }
        let node = &self.scene.nodes[shader];
        let read = if SHADERS.contains(&node.kind.as_str()) {
            let material = self.read(shader, notes);
            self.materials.push(material);
            Some(self.materials.len() as u32 - 1)
        } else {
            notes.about(format!("shaders of type {} are not read", node.kind), node.name.as_str());
            None
        };
        self.known.insert(shader, read);
        read
    }

    fn read(&mut self, shader: NodeId, notes: &mut Notes) -> AuthoredMaterial {
        let node = &self.scene.nodes[shader];
        let is_lambert = matches!(node.kind.as_str(), "lambert" | "phong" | "phongE" | "blinn");
        let names: [&[&str]; 6] = match is_lambert {
            true => [
                &["c", "color"],
                &[],
                &[],
                &["it", "transparency"],
                &["ic", "incandescence"],
                &["n", "normalcamera"],
            ],
            false => [
                &["bc", "basecolor"],
                &["sr", "specularroughness"],
                &["m", "metalness", "basemetalness"],
                &["o", "opacity", "geometryopacity"],
                &["ec", "emissioncolor"],
                &["n", "normalcamera", "normal", "geometrynormal"],
            ],
        };
        let [color_at, roughness_at, metal_at, opacity_at, emission_at, normal_at] = names;
        let color = self.driven(shader, color_at, notes);
        let roughness_map = self.driven(shader, roughness_at, notes);
        let metal_map = self.driven(shader, metal_at, notes);
        let opacity_map = self.driven(shader, opacity_at, notes);
        let emission_map = self.driven(shader, emission_at, notes);
        let normal_texture = self.normals(shader, normal_at, notes);
        let scene = self.scene;
        let numbers = |names: &[&str]| numbers_of(scene, shader, names);
        let first =
            |names: &[&str], default: f32| numbers(names).and_then(|v| v.first().copied()).unwrap_or(default);
        let triple = |names: &[&str], default: f32| match numbers(names).as_deref() {
            Some([r, g, b, ..]) => [*r, *g, *b],
            Some([v, ..]) => [*v; 3],
            _ => [default; 3],
        };
        let share = |v: f32| if v.is_finite() { v.clamp(0.0, 1.0) } else { 0.0 };
        // Defaults of Maya's nodes.
        let weight = match is_lambert {
            true => first(&["dc", "diffuse"], if node.kind == "lambert" { 1.0 } else { 0.8 }),
            false => first(&["b", "base", "baseweight"], 1.0),
        };
        let base =
            if color.is_some() { [1.0; 3] } else { triple(color_at, if is_lambert { 0.5 } else { 0.8 }) };
        let base = if color.is_some() && is_lambert { base } else { base.map(|c| c * weight) };
        let opacity = match (is_lambert, opacity_map.is_some()) {
            (_, true) => 1.0,
            (true, _) => 1.0 - triple(opacity_at, 0.0).iter().sum::<f32>() / 3.0,
            (false, _) => triple(opacity_at, 1.0).iter().sum::<f32>() / 3.0,
        };
        let roughness = match node.kind.as_str() {
            "lambert" => 1.0,
            "phong" => (2.0 / (first(&["cp", "cosinepower"], 20.0).max(0.0) + 2.0)).sqrt().sqrt(),
            "phongE" => first(&["rn", "roughness"], 0.5),
            "blinn" => first(&["ec", "eccentricity"], 0.3),
            _ => first(roughness_at, 0.2),
        };
        let emission = match is_lambert {
            true => triple(emission_at, 0.0),
            false => {
                let weight = first(&["e", "emission"], 0.0);
                triple(emission_at, 1.0).map(|c| c * weight)
            }
        };
        let has_emission = emission_map.is_some() && (is_lambert || first(&["e", "emission"], 0.0) > 0.0);
        let of = |d: &Driven, c: usize| Channel::Of(d.texture.image, c);
        let is_own = |o: &Driven| color.is_some_and(|c| c.texture.image == o.texture.image);
        // Maya multiplies by what lets light through: the picture's alpha is what does not.
        let opacity_channel = |o: &Driven| {
            let has_alpha =
                self.gallery.images[o.texture.image as usize].rgba.chunks_exact(4).any(|t| t[3] < 255);
            if has_alpha { 3 } else { o.channel }
        };
        let mut base_color_texture = color.map(|c| c.texture);
        if let Some(alpha) = &opacity_map {
            let channel = opacity_channel(alpha);
            if !(is_own(alpha) && channel == 3) {
                let rgb = |c: usize| color.as_ref().map_or(Channel::Value(255), |d| of(d, c));
                let channels = [rgb(0), rgb(1), rgb(2), of(alpha, channel)];
                let image = self.gallery.combine("base colour and alpha", channels);
                let like = color.unwrap_or(*alpha).texture;
                base_color_texture = Some(AuthoredTexture { image, ..like });
            }
        }
        let metallic_roughness_texture = roughness_map.or(metal_map).map(|either| {
            let white = Channel::Value(255);
            let channel =
                |map: Option<Driven>| map.map_or(white, |d| Channel::Of(d.texture.image, d.channel));
            let channels = [white, channel(roughness_map), channel(metal_map), white];
            let image = self.gallery.combine("roughness and metal", channels);
            AuthoredTexture { image, ..either.texture }
        });
        let alpha = match opacity_map.is_some() || opacity < 1.0 {
            true => AlphaMode::Blend,
            false => AlphaMode::Opaque,
        };
        AuthoredMaterial {
            name: node.name.clone(),
            base_color: [share(base[0]), share(base[1]), share(base[2]), share(opacity)],
            base_color_texture,
            metallic: if metal_map.is_some() {
                1.0
            } else {
                share(if is_lambert { 0.0 } else { first(metal_at, 0.0) })
            },
            roughness: if roughness_map.is_some() { 1.0 } else { share(roughness) },
            metallic_roughness_texture,
            normal_texture,
            emission_linear: match has_emission {
                true => [1.0; 3],
                false => emission.map(|c| if c.is_finite() { c.max(0.0) } else { 0.0 }),
            },
            emission_texture: emission_map.filter(|_| has_emission).map(|d| d.texture),
            alpha,
            ..AuthoredMaterial::default()
        }
    }

    fn text(&self, node: NodeId, names: &[&str]) -> Option<&'s str> {
        let Data::Shading(settings) = &self.scene.nodes[node].data else { return None };
        match settings.iter().find(|(name, _)| names.contains(&bare(name).as_str())) {
            Some((_, Setting::Text(text))) => Some(text),
            _ => None,
        }
    }

    /// What is connected into an attribute, whole or by its parts.
    fn source(&self, node: NodeId, names: &[&str]) -> Option<&'s Plug> {
        let inputs = self.scene.inputs(node);
        inputs
            .into_iter()
            .find(|(_, to)| names.contains(&bare(first_step(&to.attribute)).as_str()))
            .map(|(from, _)| from)
    }

    fn driven(&mut self, shader: NodeId, names: &[&str], notes: &mut Notes) -> Option<Driven> {
        let plug = self.source(shader, names)?;
        self.picture(plug, &self.scene.nodes[shader].name.clone(), notes)
    }

    /// The picture of a file node.
    fn picture(&mut self, plug: &Plug, of: &str, notes: &mut Notes) -> Option<Driven> {
        let node = &self.scene.nodes[plug.node];
        if node.kind != "file" && node.kind != "aiImage" {
            notes.about(
                format!("{} nodes are not evaluated: shaders look as without them", node.kind),
                format!("{} of {of}", node.name),
            );
            return None;
        }
        let Some(written) = self.text(plug.node, &["ftn", "filetexturename", "filename"]) else {
            notes.about("file textures without a file are left out", node.name.as_str());
            return None;
        };
        let image = match self.gallery.file(self.folder, written) {
            Ok(image) => image,
            Err(why) => {
                notes.about(
                    "file textures that cannot be read are left out",
                    format!("{} ({why})", node.name),
                );
                return None;
            }
        };
        let placed = self.source(plug.node, &["uv", "c", "uvcoord"]).map(|p| p.node);
        let transform = placed.map_or_else(TextureTransform::default, |p| self.placement(p));
        let last = plug.attribute.rsplit('.').next().unwrap_or_default();
        let channel = match bare(last).as_str() {
            "ocg" | "outcolorg" => 1,
            "ocb" | "outcolorb" => 2,
            // The alpha of a picture without one is its brightness.
            "oa" | "outalpha"
                if self.gallery.images[image as usize].rgba.chunks_exact(4).any(|t| t[3] < 255) =>
            {
                3
            }
            _ => 0,
        };
        Some(Driven {
            texture: AuthoredTexture { image, uv_set: 0, transform, wrap: [Wrap::Repeat; 2] },
            channel,
        })
    }

    /// `repeatUV` and `offset` of a place2dTexture, for a v that grows downwards.
    fn placement(&self, node: NodeId) -> TextureTransform {
        let pair = |names: &[&str], default: f32| match numbers_of(self.scene, node, names).as_deref() {
            Some([u, v, ..]) => glam::Vec2::new(*u, *v),
            _ => glam::Vec2::splat(default),
        };
        let (scale, offset) = (pair(&["re", "repeatuv"], 1.0), pair(&["of", "offset"], 0.0));
        let offset = glam::Vec2::new(offset.x, 1.0 - scale.y - offset.y);
        let transform = TextureTransform { offset, rotation_radians: 0.0, scale };
        if transform.matrix().is_finite() { transform } else { TextureTransform::default() }
    }

    fn normals(&mut self, shader: NodeId, names: &[&str], notes: &mut Notes) -> Option<AuthoredTexture> {
        let plug = self.source(shader, names)?;
        let node = &self.scene.nodes[plug.node];
        let input: &[&str] = match node.kind.as_str() {
            "bump2d" => &["bv", "bumpvalue", "bumpmap"],
            "aiNormalMap" | "aiBump2d" => &["input", "bumpmap"],
            _ => {
                notes.about(
                    format!("{} nodes are not evaluated: shaders look as without them", node.kind),
                    node.name.as_str(),
                );
                return None;
            }
        };
        let name = node.name.clone();
        let file = self.source(plug.node, input)?;
        let found = self.picture(file, &name, notes)?;
        if !self.gallery.is_normal_map(found.texture.image) {
            notes
                .about("bump maps of heights are not read: `rubor maps normals` makes normals of them", name);
            return None;
        }
        Some(found.texture)
    }
}

/// Values of an attribute under any of its names.
fn numbers_of(scene: &Scene, node: NodeId, names: &[&str]) -> Option<Vec<f32>> {
    let Data::Shading(settings) = &scene.nodes[node].data else { return None };
    match settings.iter().find(|(name, _)| names.contains(&bare(name).as_str())) {
        Some((_, Setting::Numbers(numbers))) => Some(numbers.iter().map(|n| *n as f32).collect()),
        _ => None,
    }
}

fn first_step(attribute: &str) -> &str {
    attribute.split(['.', '[']).next().unwrap_or(attribute)
}

/// `base_color`, `baseColor` and `baseColorR` are one attribute.
fn bare(name: &str) -> String {
    let lower = name.replace('_', "").to_lowercase();
    match name.strip_suffix(['R', 'G', 'B', 'X', 'Y', 'Z']) {
        Some(whole) if whole.ends_with(|c: char| c.is_lowercase()) && whole.len() > 3 => {
            whole.replace('_', "").to_lowercase()
        }
        _ => lower,
    }
}
