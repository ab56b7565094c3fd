//! Materials that the authors of heads gave to parts: metallic-roughness with textures, as in glTF 2.0.
//!
//! A part of [`Material::Other`] that has one is drawn with it. Skin that has one with an alpha cutoff has its holes and
//! nothing else of it. Parts that are skin, eyes and so on may have one too: it is kept until the head is written, so that a
//! part can be given back its own look.

use glam::{Affine2, Mat2, Vec2, Vec3};

use crate::head::{Head, Material};

/// Authored materials of a head, their images, and what only they read of vertices.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Authored {
    /// Pictures that textures show.
    pub images: Vec<AuthoredImage>,
    /// Materials.
    pub materials: Vec<AuthoredMaterial>,
    /// Index into `materials` of each part of the mesh. Parts beyond its end have none.
    pub of_parts: Vec<Option<u32>>,
    /// Second texture coordinate of each vertex. Vertices beyond its end have (0, 0).
    pub second_uvs: Vec<Vec2>,
    /// Linear Rec. 709 and alpha of each vertex, factors of the base colour. Vertices beyond its end have 1.
    pub colors_linear: Vec<[f32; 4]>,
    /// Unit normal of each vertex at rest as its author made it, in the space of the head. Those of length 0, and vertices
    /// beyond its end, have the normal of the geometry ([`crate::deform::normal_bends`]).
    pub normals: Vec<Vec3>,
}

/// A picture in memory.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct AuthoredImage {
    /// For messages; not unique.
    pub name: String,
    /// Texels per row, at least 1.
    pub width: u32,
    /// Rows, at least 1.
    pub height: u32,
    /// Four bytes per texel, row by row from the top. Colours are sRGB where the texture that shows them is a colour.
    pub rgba: Vec<u8>,
}

/// How a part looks: the metallic-roughness model of glTF 2.0 (section 3.9 and appendix B).
#[derive(Clone, Debug, PartialEq)]
pub struct AuthoredMaterial {
    /// Name in the source file.
    pub name: String,
    /// Linear Rec. 709 and alpha, 0 to 1.
    pub base_color: [f32; 4],
    /// Factor of `base_color`: sRGB and alpha.
    pub base_color_texture: Option<AuthoredTexture>,
    /// 0 dielectric to 1 metal.
    pub metallic: f32,
    /// Perceptual roughness 0 to 1; its square is the alpha of GGX.
    pub roughness: f32,
    /// Factors: green of `roughness`, blue of `metallic`.
    pub metallic_roughness_texture: Option<AuthoredTexture>,
    /// Tangent-space normals, y towards -v.
    pub normal_texture: Option<AuthoredTexture>,
    /// Factor of x and y of the normals.
    pub normal_scale: f32,
    /// Red is the ambient visibility.
    pub occlusion_texture: Option<AuthoredTexture>,
    /// How much of it counts, 0 to 1.
    pub occlusion_strength: f32,
    /// Radiance that it sends out by itself, linear Rec. 709, 0 or more.
    pub emission_linear: [f32; 3],
    /// Factor of `emission_linear`: sRGB.
    pub emission_texture: Option<AuthoredTexture>,
    /// What alpha means.
    pub alpha: AlphaMode,
    /// Whether its back is drawn too.
    pub is_double_sided: bool,
    /// Shows its base colour without light (`KHR_materials_unlit`).
    pub is_unlit: bool,
    /// Index of refraction, 1 or more, or 0 for a reflectance of 1 (`KHR_materials_ior`).
    pub ior: f32,
    /// Strength of the reflection of what is no metal, 0 to 1 (`KHR_materials_specular`).
    pub specular: f32,
    /// Alpha is a factor of `specular`.
    pub specular_texture: Option<AuthoredTexture>,
    /// Factor of that reflection seen head on, linear Rec. 709, 0 or more.
    pub specular_color: [f32; 3],
    /// Factor of `specular_color`: sRGB.
    pub specular_color_texture: Option<AuthoredTexture>,
    /// Share of a clear coat on top, 0 to 1 (`KHR_materials_clearcoat`).
    pub clearcoat: f32,
    /// Red is a factor of `clearcoat`.
    pub clearcoat_texture: Option<AuthoredTexture>,
    /// Perceptual roughness of the coat, 0 to 1.
    pub clearcoat_roughness: f32,
    /// Green is a factor of `clearcoat_roughness`.
    pub clearcoat_roughness_texture: Option<AuthoredTexture>,
    /// Share of the light that is not reflected which passes through a thin wall, 0 to 1 (`KHR_materials_transmission`).
    pub transmission: f32,
    /// Red is a factor of `transmission`.
    pub transmission_texture: Option<AuthoredTexture>,
}

/// A picture on a part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AuthoredTexture {
    /// Index into [`Authored::images`].
    pub image: u32,
    /// Texture coordinates that it takes: 0 is [`crate::head::Vertex::uv`], 1 is [`Authored::second_uvs`].
    pub uv_set: u32,
    /// What is done to them (`KHR_texture_transform`).
    pub transform: TextureTransform,
    /// Outside of 0 to 1, along u and v.
    pub wrap: [Wrap; 2],
}

/// `uv' = offset + rotation * (scale * uv)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureTransform {
    /// In widths and heights of the image.
    pub offset: Vec2,
    /// Counter-clockwise as the extension has it, where v grows downwards.
    pub rotation_radians: f32,
    /// Along u and v.
    pub scale: Vec2,
}

/// Where a texture goes outside of 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// From the start again.
    #[default]
    Repeat,
    /// The texel of the edge.
    Clamp,
    /// There and back.
    Mirror,
}

/// What the alpha of the base colour means.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum AlphaMode {
    /// Nothing.
    #[default]
    Opaque,
    /// Less than the cutoff is not there.
    Mask {
        /// 0 or more.
        cutoff: f32,
    },
    /// How much covers what is behind.
    Blend,
}

impl Default for TextureTransform {
    fn default() -> Self {
        Self { offset: Vec2::ZERO, rotation_radians: 0.0, scale: Vec2::ONE }
    }
}

impl TextureTransform {
    /// The transform of a texture coordinate.
    pub fn matrix(&self) -> Affine2 {
        // The extension's rotation has +sin in its upper right: v grows downwards.
        let rotation = Mat2::from_angle(-self.rotation_radians);
        Affine2::from_mat2_translation(rotation * Mat2::from_diagonal(self.scale), self.offset)
    }
}

impl Default for AuthoredMaterial {
    /// What glTF 2.0 gives to a primitive without a material.
    fn default() -> Self {
        Self {
            name: String::new(),
            base_color: [1.0; 4],
            base_color_texture: None,
            metallic: 1.0,
            roughness: 1.0,
            metallic_roughness_texture: None,
            normal_texture: None,
            normal_scale: 1.0,
            occlusion_texture: None,
            occlusion_strength: 1.0,
            emission_linear: [0.0; 3],
            emission_texture: None,
            alpha: AlphaMode::Opaque,
            is_double_sided: false,
            is_unlit: false,
            ior: 1.5,
            specular: 1.0,
            specular_texture: None,
            specular_color: [1.0; 3],
            specular_color_texture: None,
            clearcoat: 0.0,
            clearcoat_texture: None,
            clearcoat_roughness: 0.0,
            clearcoat_roughness_texture: None,
            transmission: 0.0,
            transmission_texture: None,
        }
    }
}

/// Textures that a material can have.
pub const TEXTURES: usize = 10;

impl AuthoredMaterial {
    /// All its textures with their names: base colour, metallic-roughness, normal, occlusion, emission, specular, specular
    /// colour, clear coat, its roughness, transmission.
    pub fn textures(&self) -> [(&'static str, Option<&AuthoredTexture>); TEXTURES] {
        [
            ("base colour", self.base_color_texture.as_ref()),
            ("metallic-roughness", self.metallic_roughness_texture.as_ref()),
            ("normal", self.normal_texture.as_ref()),
            ("occlusion", self.occlusion_texture.as_ref()),
            ("emission", self.emission_texture.as_ref()),
            ("specular", self.specular_texture.as_ref()),
            ("specular colour", self.specular_color_texture.as_ref()),
            ("clear coat", self.clearcoat_texture.as_ref()),
            ("clear coat roughness", self.clearcoat_roughness_texture.as_ref()),
            ("transmission", self.transmission_texture.as_ref()),
        ]
    }

    /// The same as places, in the same order.
    pub fn textures_mut(&mut self) -> [&mut Option<AuthoredTexture>; TEXTURES] {
        [
            &mut self.base_color_texture,
            &mut self.metallic_roughness_texture,
            &mut self.normal_texture,
            &mut self.occlusion_texture,
            &mut self.emission_texture,
            &mut self.specular_texture,
            &mut self.specular_color_texture,
            &mut self.clearcoat_texture,
            &mut self.clearcoat_roughness_texture,
            &mut self.transmission_texture,
        ]
    }

    /// Whether what is behind it can show through: it is blended, or lets light pass.
    pub fn is_see_through(&self) -> bool {
        self.alpha == AlphaMode::Blend || self.transmission > 0.0
    }

    /// Whether more of what is behind it shows than of itself, wherever a texture does not say otherwise: a cornea, a lens.
    pub fn is_clear(&self) -> bool {
        self.transmission > 0.5 || (self.alpha == AlphaMode::Blend && self.base_color[3] < 0.5)
    }

    /// Reflectance head on of what is no metal, without specular factors.
    pub fn dielectric_f0(&self) -> f32 {
        ((self.ior - 1.0) / (self.ior + 1.0)).powi(2)
    }

    /// Alpha below which a part is not there for lamps, and skin not at all; `None` where alpha means nothing. Blended
    /// parts are cut at one half.
    pub fn cutoff(&self) -> Option<f32> {
        match self.alpha {
            AlphaMode::Opaque => None,
            AlphaMode::Mask { cutoff } => Some(cutoff),
            AlphaMode::Blend => Some(0.5),
        }
    }
}

impl Head {
    /// The material that the author of a part gave it, where the part is drawn with it: index into
    /// [`Authored::materials`].
    pub fn authored_material(&self, part: usize) -> Option<u32> {
        let is_other = self.mesh.parts.get(part).is_some_and(|p| p.material == Material::Other);
        self.authored.of_parts.get(part).copied().flatten().filter(|_| is_other)
    }

    /// The authored material that says where skin has holes: index into [`Authored::materials`].
    pub fn hole_material(&self, part: usize) -> Option<u32> {
        let is_skin = self.mesh.parts.get(part).is_some_and(|p| p.material == Material::Skin);
        let material = self.authored.of_parts.get(part).copied().flatten().filter(|_| is_skin)?;
        self.authored.materials[material as usize].cutoff().map(|_| material)
    }

    /// The authored material that a part needs to be drawn, whole or for its holes.
    pub fn needed_material(&self, part: usize) -> Option<u32> {
        self.authored_material(part).or_else(|| self.hole_material(part))
    }
}

impl Authored {
    /// Empties lists of vertices that say no more than no list.
    pub fn drop_defaults(&mut self) {
        if self.second_uvs.iter().all(|uv| *uv == Vec2::ZERO) {
            self.second_uvs.clear();
        }
        if self.colors_linear.iter().all(|c| *c == [1.0; 4]) {
            self.colors_linear.clear();
        }
    }

    /// Normal of a vertex; zero where the geometry says it.
    pub fn normal(&self, vertex: u32) -> Vec3 {
        self.normals.get(vertex as usize).copied().unwrap_or(Vec3::ZERO)
    }

    /// Second texture coordinate of a vertex.
    pub fn second_uv(&self, vertex: u32) -> Vec2 {
        self.second_uvs.get(vertex as usize).copied().unwrap_or(Vec2::ZERO)
    }

    /// Colour of a vertex.
    pub fn color_linear(&self, vertex: u32) -> [f32; 4] {
        self.colors_linear.get(vertex as usize).copied().unwrap_or([1.0; 4])
    }

    /// Where, what is there, what should be.
    pub(crate) fn validate(
        &self,
        parts: usize,
        vertices: usize,
    ) -> Result<(), (String, String, &'static str)> {
        for (i, image) in self.images.iter().enumerate() {
            let texels = u64::from(image.width) * u64::from(image.height);
            if texels == 0 || image.rgba.len() as u64 != 4 * texels {
                let found =
                    format!("{} bytes for {} x {} texels", image.rgba.len(), image.width, image.height);
                return Err((format!("authored image {i}"), found, "four bytes per texel"));
            }
        }
        for material in &self.materials {
            let fail = |what: &str, found: String, expected| {
                Err((format!("authored material {:?}, {what}", material.name), found, expected))
            };
            let share = |v: &f32| (0.0..=1.0).contains(v);
            let shares = [
                material.metallic,
                material.roughness,
                material.occlusion_strength,
                material.base_color[3],
                material.specular,
                material.clearcoat,
                material.clearcoat_roughness,
                material.transmission,
            ];
            if let Some(v) = shares.iter().chain(&material.base_color).find(|v| !share(v)) {
                return fail("factors", v.to_string(), "0 to 1");
            }
            if let Some(v) = material.emission_linear.iter().find(|v| !v.is_finite() || **v < 0.0) {
                return fail("emission", v.to_string(), "finite numbers from 0 on");
            }
            if let Some(v) = material.specular_color.iter().find(|v| !v.is_finite() || **v < 0.0) {
                return fail("specular colour", v.to_string(), "finite numbers from 0 on");
            }
            if !(material.ior.is_finite() && (material.ior >= 1.0 || material.ior == 0.0)) {
                return fail("index of refraction", material.ior.to_string(), "1 or more, or 0");
            }
            if !material.normal_scale.is_finite() {
                return fail("normal scale", material.normal_scale.to_string(), "a finite number");
            }
            if let AlphaMode::Mask { cutoff } = material.alpha
                && !(cutoff.is_finite() && cutoff >= 0.0)
            {
                return fail("cutoff", cutoff.to_string(), "a finite number from 0 on");
            }
            for (what, texture) in material.textures() {
                let Some(texture) = texture else { continue };
                if texture.image as usize >= self.images.len() {
                    return fail(what, format!("image {}", texture.image), "an existing image");
                }
                if texture.uv_set > 1 {
                    return fail(what, format!("texture coordinates {}", texture.uv_set), "set 0 or 1");
                }
                if !texture.transform.matrix().is_finite() {
                    return fail(what, format!("{:?}", texture.transform), "a finite transform");
                }
            }
        }
        if self.of_parts.len() > parts {
            let found = format!("{} parts", self.of_parts.len());
            return Err(("authored materials of parts".into(), found, "at most one per part"));
        }
        if let Some(m) = self.of_parts.iter().flatten().find(|m| **m as usize >= self.materials.len()) {
            return Err((
                "authored materials of parts".into(),
                format!("material {m}"),
                "an existing material",
            ));
        }
        for (what, count) in [
            ("second texture coordinates", self.second_uvs.len()),
            ("vertex colours", self.colors_linear.len()),
            ("normals", self.normals.len()),
        ] {
            if count > vertices {
                return Err((what.into(), count.to_string(), "at most one per vertex"));
            }
        }
        if self.second_uvs.iter().any(|uv| !uv.is_finite()) {
            return Err(("second texture coordinates".into(), "NaN or infinity".into(), "finite numbers"));
        }
        let is_unit = |n: &&Vec3| **n == Vec3::ZERO || (n.length() - 1.0).abs() < 0.01;
        if let Some(n) = self.normals.iter().find(|n| !is_unit(n)) {
            return Err(("normals".into(), n.to_string(), "length 1, or 0 for none"));
        }
        if let Some(c) = self.colors_linear.iter().flatten().find(|c| !c.is_finite() || **c < 0.0) {
            return Err(("vertex colours".into(), c.to_string(), "finite numbers from 0 on"));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::head::{Mesh, Part};

    fn head() -> Head {
        let mut head = Head { mesh: Mesh::default(), ..Head::default() };
        for material in [Material::Other, Material::Skin] {
            head.mesh.parts.push(Part { name: "part".into(), material, triangles: 0..0 });
        }
        let image = AuthoredImage { name: "red".into(), width: 1, height: 1, rgba: vec![255, 0, 0, 255] };
        let texture = AuthoredTexture {
            image: 0,
            uv_set: 1,
            transform: TextureTransform::default(),
            wrap: [Wrap::Repeat; 2],
        };
        head.authored.images.push(image);
        head.authored
            .materials
            .push(AuthoredMaterial { base_color_texture: Some(texture), ..AuthoredMaterial::default() });
        head.authored.of_parts = vec![Some(0), Some(0)];
        head
    }

    #[test]
    fn only_parts_of_no_other_kind_are_drawn_with_it() {
        let head = head();
        head.validate().unwrap();
        assert_eq!([0, 1, 2].map(|p| head.authored_material(p)), [Some(0), None, None]);
        assert_eq!([0, 1, 2].map(|p| head.needed_material(p)), [Some(0), None, None]);
        // Skin takes no more of it than its holes.
        let mut cut = head;
        cut.authored.materials[0].alpha = AlphaMode::Mask { cutoff: 0.5 };
        assert_eq!([0, 1, 2].map(|p| cut.hole_material(p)), [None, Some(0), None]);
        assert_eq!(cut.authored_material(1), None);
    }

    #[test]
    fn glass_is_see_through_and_reflects_as_its_index_says() {
        let glass = AuthoredMaterial { transmission: 1.0, ior: 1.5, ..AuthoredMaterial::default() };
        assert!(glass.is_clear() && glass.is_see_through() && !AuthoredMaterial::default().is_see_through());
        assert!((glass.dielectric_f0() - 0.04).abs() < 1e-7);
        assert_eq!(AuthoredMaterial { ior: 0.0, ..glass }.dielectric_f0(), 1.0);
        let film = |alpha| AuthoredMaterial {
            base_color: [1.0, 1.0, 1.0, 0.1],
            alpha,
            ..AuthoredMaterial::default()
        };
        assert!(film(AlphaMode::Blend).is_clear() && !film(AlphaMode::Opaque).is_clear());
    }

    #[test]
    fn textures_are_the_same_to_read_and_to_change() {
        let mut material = AuthoredMaterial::default();
        let count = material.textures().len();
        assert_eq!(material.textures_mut().len(), count);
        for i in 0..count {
            let texture = AuthoredTexture {
                image: 0,
                uv_set: 0,
                transform: TextureTransform::default(),
                wrap: [Wrap::Repeat; 2],
            };
            *material.textures_mut()[i] = Some(texture);
            assert!(material.textures()[i].1.is_some());
            *material.textures_mut()[i] = None;
        }
    }

    #[test]
    fn what_is_wrong_is_found() {
        type Break = (&'static str, fn(&mut Authored));
        let breaks: [Break; 14] = [
            ("four bytes per texel", |a| a.images[0].width = 2),
            ("four bytes per texel", |a| a.images[0] = AuthoredImage::default()),
            ("0 to 1", |a| a.materials[0].roughness = f32::NAN),
            ("finite numbers from 0 on", |a| a.materials[0].emission_linear[1] = -1.0),
            ("a finite number from 0 on", |a| a.materials[0].alpha = AlphaMode::Mask { cutoff: -1.0 }),
            ("an existing image", |a| a.images.clear()),
            ("0 to 1", |a| a.materials[0].transmission = 1.5),
            ("1 or more, or 0", |a| a.materials[0].ior = 0.5),
            ("finite numbers from 0 on", |a| a.materials[0].specular_color[2] = f32::INFINITY),
            ("set 0 or 1", |a| a.materials[0].base_color_texture.as_mut().unwrap().uv_set = 2),
            ("an existing material", |a| a.of_parts[0] = Some(1)),
            ("at most one per part", |a| a.of_parts.push(None)),
            ("at most one per vertex", |a| a.second_uvs.push(Vec2::ZERO)),
            ("at most one per vertex", |a| a.normals.push(Vec3::Z)),
        ];
        for (expected, damage) in breaks {
            let mut head = head();
            damage(&mut head.authored);
            assert_eq!(head.validate().unwrap_err().expected, expected);
        }
    }

    #[test]
    fn transforms_follow_the_extension() {
        // The example of KHR_texture_transform: the lower left quarter, a quarter turn.
        let turned = TextureTransform {
            offset: Vec2::new(0.0, 1.0),
            rotation_radians: std::f32::consts::FRAC_PI_2,
            scale: Vec2::splat(0.5),
        };
        let at = |u, v| turned.matrix().transform_point2(Vec2::new(u, v));
        assert!((at(0.0, 0.0) - Vec2::new(0.0, 1.0)).length() < 1e-6);
        assert!((at(1.0, 0.0) - Vec2::new(0.0, 0.5)).length() < 1e-6, "{}", at(1.0, 0.0));
        assert!((at(0.0, 1.0) - Vec2::new(0.5, 1.0)).length() < 1e-6, "{}", at(0.0, 1.0));
    }
}
