//! Materials of OBJ files (`.mtl`), read by `tobj`, as materials of their author.
//!
//! ```text
//! Kd, map_Kd           base colour (numbers are sRGB, as three.js has it)
//! d, Tr, map_d         alpha, blended
//! Ns, Pr, map_Pr       roughness        Pm, map_Pm   metal
//! norm, map_Bump       normals; heights are left out
//! Ke, map_Ke           emission
//! ```
//!
//! Roughness of an exponent of Blinn and Phong is (2 / (Ns + 2))^(1/4): the width of GGX (B. Walter et al. 2007).
//! `Pr`, `Pm` and `norm` are the extension for physically based materials that exporters share.

use std::collections::{HashMap, HashSet};
use std::path::Path;

use glam::Vec2;
use rubor_rig::authored::{AlphaMode, AuthoredMaterial, AuthoredTexture, TextureTransform, Wrap};
use rubor_rig::color::srgb_decode;
use rubor_rig::head::{Head, Material};
use rubor_rig::limits;

use super::materials::recognise;
use super::picture::{Channel, Gallery};
use crate::notes::Notes;

/// Materials of all files that an OBJ file names.
#[derive(Default)]
pub(super) struct Library {
    materials: HashMap<String, AuthoredMaterial>,
    gallery: Gallery,
}

/// Words of statements that have a meaning here or none for a look; others are noted.
const SILENT: [&str; 5] = ["newmtl", "Ka", "Ks", "Ni", "sharpness"];

impl Library {
    /// Files that are missing or broken cost no head: what cannot be read is noted.
    pub(super) fn read(folder: &Path, names: &[String], notes: &mut Notes) -> Self {
        let mut library = Self::default();
        for name in names {
            // Several files may stand on one line.
            let files: Vec<&str> = match folder.join(name).is_file() {
                true => vec![name],
                false => name.split_ascii_whitespace().collect(),
            };
            for file in files {
                let local = file.replace('\\', "/");
                let local = local.rsplit('/').next().unwrap_or(file);
                let path = [folder.join(file), folder.join(local)].into_iter().find(|p| p.is_file());
                match path.map(|p| limits::read(&p)) {
                    Some(Ok(bytes)) => library.file(folder, file, &bytes, notes),
                    Some(Err(e)) => notes.add("files of materials cannot be read", format!("{file} ({e})")),
                    None => notes
                        .add("files of materials that are missing: parts have no look of their author", file),
                }
            }
        }
        library
    }

    /// The materials of one file.
    pub(super) fn from_bytes(folder: &Path, bytes: &[u8], notes: &mut Notes) -> Self {
        let mut library = Self::default();
        library.file(folder, "", bytes, notes);
        library
    }

    /// Names of the materials, sorted.
    pub(super) fn names(&self) -> Vec<String> {
        let mut names: Vec<String> = self.materials.keys().cloned().collect();
        names.sort();
        names
    }

    /// Whether there is any material.
    pub(super) fn has_looks(&self) -> bool {
        !self.materials.is_empty()
    }

    fn file(&mut self, folder: &Path, file: &str, bytes: &[u8], notes: &mut Notes) {
        let text = match std::str::from_utf8(bytes) {
            Ok(text) => text.trim_start_matches('\u{feff}').to_owned(),
            Err(_) => bytes.iter().map(|b| char::from(*b)).collect(),
        };
        let mut good = String::new();
        let mut has_begun = false;
        for (i, line) in text.lines().enumerate() {
            let line = line.trim();
            let keyword = line.split_ascii_whitespace().next().unwrap_or_default();
            if keyword.is_empty() || keyword.starts_with('#') {
                continue;
            }
            has_begun |= keyword == "newmtl";
            // `tobj` gives up at the first fault and does not say where.
            let alone = if keyword == "newmtl" { format!("{line}\n") } else { format!("newmtl a\n{line}\n") };
            let mut words = line.split_whitespace();
            // `tobj` panics on a colour of fewer numbers.
            let is_short = ["Ka", "Kd", "Ks", "Ke"].map(Some).contains(&words.next()) && words.count() < 3;
            if !has_begun || is_short || tobj::load_mtl_buf(&mut alone.as_bytes()).is_err() {
                notes.add(
                    "lines of materials that cannot be read are left out",
                    format!("{file}, line {}", i + 1),
                );
                continue;
            }
            good.push_str(line);
            good.push('\n');
        }
        let Ok((materials, _)) = tobj::load_mtl_buf(&mut good.as_bytes()) else {
            notes.add("files of materials cannot be read", file);
            return;
        };
        for material in materials {
            let read = self.material(folder, &material, notes);
            self.materials.entry(material.name).or_insert(read);
        }
    }

    fn material(&mut self, folder: &Path, from: &tobj::Material, notes: &mut Notes) -> AuthoredMaterial {
        let at = from.name.as_str();
        let mut unread: Vec<&str> = Vec::new();
        let mut extra: HashMap<String, &str> = HashMap::new();
        for (key, value) in &from.unknown_param {
            extra.insert(key.to_ascii_lowercase(), value.as_str());
            let lower = key.to_ascii_lowercase();
            let is_read =
                ["pr", "pm", "map_pr", "map_pm", "norm", "map_ke", "ke", "tr"].contains(&lower.as_str());
            if !is_read && !SILENT.contains(&key.as_str()) {
                unread.push(key);
            }
        }
        let number =
            |key: &str| extra.get(key).and_then(|v| v.split_ascii_whitespace().next()?.parse::<f32>().ok());
        let color =
            |value: [f32; 3]| value.map(|c| srgb_decode(if c.is_finite() { c.clamp(0.0, 1.0) } else { 0.0 }));
        let mut base = color(from.diffuse.unwrap_or([1.0; 3]));
        let mut texture = |what: &str, written: Option<&str>, notes: &mut Notes| {
            written.and_then(|written| self.texture(folder, written, &format!("{at}, {what}"), notes))
        };
        let base_texture = texture("map_Kd", from.diffuse_texture.as_deref(), notes);
        if base_texture.is_some() && base == [0.0; 3] {
            notes.add("a black factor of a texture is taken for white", at);
            base = [1.0; 3];
        }
        let dissolve = texture("map_d", from.dissolve_texture.as_deref(), notes);
        let roughness_map = texture("map_Pr", extra.get("map_pr").copied(), notes);
        let metal_map = texture("map_Pm", extra.get("map_pm").copied(), notes);
        let emission_map = texture("map_Ke", extra.get("map_ke").copied(), notes);
        let bump = extra.get("norm").copied().or(from.normal_texture.as_deref());
        let bump_scale = bump.and_then(|b| options(b).0.bump).unwrap_or(1.0);
        let mut normals = texture("norm", bump, notes);
        if let Some(found) = normals
            && !extra.contains_key("norm")
            && !self.gallery.is_normal_map(found.image)
        {
            notes.add("bump maps of heights are not read: `rubor maps normals` makes normals of them", at);
            normals = None;
        }
        let opacity = number("tr").map(|t| 1.0 - t).or(from.dissolve).unwrap_or(1.0);
        let opacity = if opacity.is_finite() { opacity.clamp(0.0, 1.0) } else { 1.0 };
        let base_color_texture = match (base_texture, dissolve) {
            (base, None) => base,
            (base, Some(alpha)) => Some(self.with_alpha(base, alpha)),
        };
        let alpha = if dissolve.is_some() || opacity < 1.0 { AlphaMode::Blend } else { AlphaMode::Opaque };
        if alpha == AlphaMode::Blend {
            notes.add("blended materials are drawn opaque where alpha is at least one half", at);
        }
        let of_exponent = from.shininess.map_or(1.0, |n| (2.0 / (n.max(0.0) + 2.0)).sqrt().sqrt());
        let mut roughness = number("pr").unwrap_or(of_exponent);
        let mut metallic = number("pm").unwrap_or(0.0);
        let metallic_roughness_texture = (roughness_map.or(metal_map)).map(|either| {
            let channel =
                |map: Option<AuthoredTexture>| map.map_or(Channel::Value(255), |m| Channel::Of(m.image, 0));
            let channels =
                [Channel::Value(255), channel(roughness_map), channel(metal_map), Channel::Value(255)];
            let image = self.gallery.combine(&format!("{at} roughness and metal"), channels);
            AuthoredTexture { image, ..either }
        });
        // A map stands for the number.
        roughness = if roughness_map.is_some() { 1.0 } else { roughness };
        metallic = if metal_map.is_some() { 1.0 } else { metallic };
        let share = |v: f32| if v.is_finite() { v.clamp(0.0, 1.0) } else { 1.0 };
        let emission = from.emissive.or_else(|| extra.get("ke").and_then(|v| three(v)));
        let emission = emission.map_or(if emission_map.is_some() { [1.0; 3] } else { [0.0; 3] }, color);
        for (what, name) in [
            ("map_Ka", &from.ambient_texture),
            ("map_Ks", &from.specular_texture),
            ("map_Ns", &from.shininess_texture),
        ] {
            if name.is_some() {
                unread.push(what);
            }
        }
        if from.illumination_model.is_some_and(|i| i > 2) {
            unread.push("illum");
        }
        unread.sort_unstable();
        for word in unread {
            notes.add(format!("{word} of materials is not read"), at);
        }
        AuthoredMaterial {
            name: from.name.clone(),
            base_color: [base[0], base[1], base[2], opacity],
            base_color_texture,
            metallic: share(metallic),
            roughness: share(roughness),
            metallic_roughness_texture,
            normal_texture: normals,
            normal_scale: bump_scale,
            emission_linear: emission,
            emission_texture: emission_map,
            alpha,
            ..AuthoredMaterial::default()
        }
    }

    /// The base colour with the alpha of another picture: its own, or its red where it has none.
    fn with_alpha(&mut self, base: Option<AuthoredTexture>, alpha: AuthoredTexture) -> AuthoredTexture {
        let has_alpha = self.gallery.images[alpha.image as usize].rgba.chunks_exact(4).any(|t| t[3] < 255);
        let alpha_channel = Channel::Of(alpha.image, if has_alpha { 3 } else { 0 });
        let color = |c: usize| base.map_or(Channel::Value(255), |b| Channel::Of(b.image, c));
        let image =
            self.gallery.combine("base colour and alpha", [color(0), color(1), color(2), alpha_channel]);
        AuthoredTexture { image, ..base.unwrap_or(alpha) }
    }

    fn texture(
        &mut self,
        folder: &Path,
        written: &str,
        at: &str,
        notes: &mut Notes,
    ) -> Option<AuthoredTexture> {
        let (options, file) = options(written);
        if options.has_unread {
            notes.add("options of textures other than -o, -s, -clamp and -bm are not read", at);
        }
        match self.gallery.file(folder, file) {
            Ok(image) => {
                let wrap = if options.is_clamped { Wrap::Clamp } else { Wrap::Repeat };
                Some(AuthoredTexture { image, uv_set: 0, transform: options.transform(), wrap: [wrap; 2] })
            }
            Err(why) => {
                notes.add("textures whose picture cannot be read are left out", format!("{at} ({why})"));
                None
            }
        }
    }

    /// Gives the parts of a head the materials of their name. Textured parts keep their author's look.
    pub(super) fn give(self, head: &mut Head, notes: &mut Notes) {
        let mut index: HashMap<&str, u32> = HashMap::new();
        let mut missing = HashSet::new();
        head.authored.images = self.gallery.images;
        for part in &mut head.mesh.parts {
            let Some(material) = self.materials.get(&part.name) else {
                // A part of a part, such as a layer of lashes, has the name of the whole before its own.
                let is_piece = self.materials.keys().any(|whole| {
                    part.name.strip_prefix(whole.as_str()).is_some_and(|rest| rest.starts_with(' '))
                });
                if !self.materials.is_empty() && !is_piece && missing.insert(part.name.clone()) {
                    notes.add("parts whose material is in no file of materials", part.name.as_str());
                }
                head.authored.of_parts.push(None);
                continue;
            };
            let next = head.authored.materials.len() as u32;
            let known = *index.entry(material.name.as_str()).or_insert_with(|| {
                head.authored.materials.push(material.clone());
                next
            });
            head.authored.of_parts.push(Some(known));
            keep_look(&mut part.material, &part.name, material, notes);
        }
        if head.authored.materials.is_empty() {
            head.authored = Default::default();
        }
    }
}

/// Textured parts that have a material of rubor keep the look of their author: its own materials take other texture
/// coordinates, or would lose what is painted. What names say is skin keeps its colour as skin (`convert::own_color`).
pub(super) fn keep_look(kind: &mut Material, name: &str, authored: &AuthoredMaterial, notes: &mut Notes) {
    let is_textured = authored.base_color_texture.is_some();
    let is_kept =
        matches!(kind, Material::Hidden | Material::Other) || recognise(name) == Some(Material::Skin);
    if is_textured && !is_kept {
        notes.add("textured eyes, teeth, hair and lashes keep the look of their author", name);
        *kind = Material::Other;
    }
}

fn three(text: &str) -> Option<[f32; 3]> {
    let mut numbers = text.split_ascii_whitespace().map(|w| w.parse::<f32>().ok());
    Some([numbers.next()??, numbers.next()??, numbers.next()??])
}

/// What stands before the name of a texture.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Options {
    offset: Vec2,
    scale: Vec2,
    bump: Option<f32>,
    is_clamped: bool,
    has_unread: bool,
}

impl Options {
    /// For a v that grows downwards.
    fn transform(&self) -> TextureTransform {
        let offset = Vec2::new(self.offset.x, 1.0 - self.scale.y - self.offset.y);
        let transform = TextureTransform { offset, rotation_radians: 0.0, scale: self.scale };
        if transform.matrix().is_finite() { transform } else { TextureTransform::default() }
    }
}

/// Options and the name, which may have spaces.
fn options(written: &str) -> (Options, &str) {
    let mut options =
        Options { offset: Vec2::ZERO, scale: Vec2::ONE, bump: None, is_clamped: false, has_unread: false };
    let mut rest = written.trim();
    while let Some(option) = rest.strip_prefix('-') {
        let (word, mut after) = option.split_once(char::is_whitespace).unwrap_or((option, ""));
        let (least, most) = match word {
            "o" | "s" | "t" => (1, 3),
            "mm" => (2, 2),
            "bm" | "boost" | "texres" | "clamp" | "blendu" | "blendv" | "cc" | "imfchan" | "type" => (1, 1),
            // The name itself begins with a dash.
            _ => break,
        };
        let mut words = Vec::new();
        while words.len() < most {
            let (value, next) =
                after.trim_start().split_once(char::is_whitespace).unwrap_or((after.trim_start(), ""));
            if words.len() >= least && value.parse::<f32>().is_err() || value.is_empty() {
                break;
            }
            words.push(value);
            after = next;
        }
        let number = |i: usize, default: f32| words.get(i).and_then(|w| w.parse().ok()).unwrap_or(default);
        match word {
            "o" => options.offset = Vec2::new(number(0, 0.0), number(1, 0.0)),
            "s" => options.scale = Vec2::new(number(0, 1.0), number(1, 1.0)),
            "bm" => options.bump = Some(number(0, 1.0)),
            "clamp" => options.is_clamped = words.first() == Some(&"on"),
            _ => options.has_unread = true,
        }
        rest = after.trim_start();
    }
    (options, rest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_stand_before_names_with_spaces() {
        let (found, name) = options("-s 2 3 1 -o 0.25 -bm 0.5 -clamp on my skin.png");
        assert_eq!(name, "my skin.png");
        assert_eq!(
            (found.scale, found.offset, found.bump),
            (Vec2::new(2.0, 3.0), Vec2::new(0.25, 0.0), Some(0.5))
        );
        assert!(found.is_clamped && !found.has_unread);
        // v = 1 - 0.25 from below is 0.25 from above; three times that is 0.75 from below, 0.25 from above.
        let at = found.transform().matrix().transform_point2(Vec2::new(0.5, 0.75));
        assert!((at - Vec2::new(1.25, 0.25)).length() < 1e-6, "{at}");
        assert_eq!(options("-imfchan r -mm 0 1 a.png").1, "a.png");
        assert_eq!(options("-odd-name.png").1, "-odd-name.png");
    }

    /// Found by fuzzing: `tobj` unwraps three numbers.
    #[test]
    fn colours_of_fewer_than_three_numbers_are_left_out_and_said() {
        for line in ["Kd", "Ka 1", "Ks 1 0", "Ke\u{a0}1 0", " Kd\u{3000}1"] {
            let text = format!("newmtl skin\n{line}\nKd 0.5 0.25 0.125\n");
            let mut notes = Notes::default();
            let library = Library::from_bytes(Path::new(""), text.as_bytes(), &mut notes);
            assert_eq!(library.names(), ["skin"], "{line:?}");
            assert!(notes.into_vec().iter().any(|n| n.message.contains("cannot be read")), "{line:?}");
        }
    }
}
