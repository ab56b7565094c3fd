//! A head on the device: geometry for the kernels, maps as textures. Never changes after upload.

use std::sync::{Arc, OnceLock};

use glam::{Vec2, Vec3};
use rayon::prelude::*;
use rubor_rig::head::{
    BASE_COLOR_F0, BlendShape, Head, Material, OcclusionChange, Provenance, ProvenanceKind, SKIN_F0, Vertex,
};
use rubor_rig::level::Level;
use rubor_rig::map::Map;
use rubor_rig::mask::{Mask, resize_area};
use wgpu::util::DeviceExt;

use super::authored::AuthoredOnGpu;
use super::clusters::{Cluster, clusters};
use super::footprint::{APPEARANCE_SIZE, largest_of, mask_size, slope_size};
use super::hair_roots::{Root, drawn_hairs, moved_roots, roots};
use super::level::ERROR_PIXELS;
use super::posed_head::instance_bytes;
use super::strands;
use crate::device::kernel::Resource;
use crate::device::texture::{self, Texel};
use crate::device::{Bind, Gpu};
use crate::error::RenderError;
use crate::passes::bounce::Ways;

/// Largest melanin fraction of the skin colour table (Jimenez 2012 table 7.1).
pub const MAX_MELANIN: f32 = 0.5;
/// Largest hemoglobin fraction of the skin colour table (Jimenez 2012 table 7.1).
pub const MAX_HEMOGLOBIN: f32 = 0.32;
/// Wrinkle maps that one head can have: one weight per channel of four layers.
pub const MAX_WRINKLE_MAPS: usize = 16;
/// Blend shapes that one head can have.
pub(crate) const MAX_SHAPES: usize = 1 << 12;
/// Hemoglobin distributions that one head can have.
pub const MAX_DISTRIBUTIONS: usize = 64;
/// Wrinkle zones that one head can have.
pub const MAX_ZONES: usize = 64;
/// Bits of rubor's own material in the number of a triangle's material; above them stands that of the author.
pub(crate) const AUTHORED_SHIFT: u32 = 8;

/// Skin colour as a function of chromophores: columns are the cube root of melanin / 0.5, rows the cube root of
/// hemoglobin / 0.32 (Jimenez 2012 eq. 7.7); the first and last texel stand at 0 and 1.
pub struct ColorTable<'a> {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Linear Rec. 709 albedo, row by row.
    pub texels: &'a [[f32; 3]],
}

/// A vertex as surface.wesl reads it.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct GpuVertex {
    pub(crate) point: u32,
    pub(crate) u: f32,
    pub(crate) v: f32,
    pub(crate) bend: u32,
}

/// A head that any number of frames can show.
pub struct HeadOnGpu {
    pub(crate) point_count: u32,
    pub(crate) vertex_count: u32,
    /// Points at the corners of the opaque triangles: an index buffer.
    pub(crate) opaque_points: wgpu::Buffer,
    pub(crate) opaque_triangles: u32,
    /// How many of these, the last ones, have holes where alpha says so.
    pub(crate) cut_triangles: u32,
    /// How many of these, the last ones, are seen through where they are not quite opaque.
    pub(crate) see_through_triangles: u32,
    /// Triangles that are blended over the picture: how many there are before the first strand, and after each.
    pub(crate) strand_ends: Vec<u32>,
    pub(crate) shape_count: usize,
    pub(crate) rest: wgpu::Buffer,
    pub(crate) delta_starts: wgpu::Buffer,
    pub(crate) deltas: wgpu::Buffer,
    pub(crate) vertices: wgpu::Buffer,
    pub(crate) triangles: wgpu::Buffer,
    pub(crate) ring_starts: wgpu::Buffer,
    pub(crate) ring: wgpu::Buffer,
    pub(crate) hair_roots: wgpu::Buffer,
    /// Hairs of the scalp on the device: the first of those that grow, in random order.
    pub(crate) hair_root_count: u32,
    /// Hairs that grow, for which these stand.
    pub(crate) grown_hairs: u32,
    pub(crate) maps: Option<MapsOnGpu>,
    pub(crate) authored: Option<AuthoredOnGpu>,
    pub(crate) skin_color: wgpu::TextureView,
    pub(crate) bounds: (Vec3, Vec3),
    /// Millimetres of skin across the unit square of the texture: the median over its triangles.
    pub(crate) mm_per_texture: f32,
    /// Bounds of its opaque parts.
    pub(crate) clusters: Vec<Cluster>,
    /// Its opaque surface at rest, for methods that lay it out.
    pub(crate) surface: Arc<Surface>,
    /// What its points see of each other; made when a frame first asks for it.
    ways: OnceLock<Ways>,
    /// Shared by its levels alone.
    pub(crate) family: Arc<()>,
    ladder: Option<Ladder>,
    /// Bytes of buffers and textures on the device; of a level, those of all levels.
    pub memory_bytes: u64,
}

/// The opaque surface of a head at rest, on the host.
pub(crate) struct Surface {
    /// Metres.
    pub(crate) points: Vec<Vec3>,
    /// Ambient visibility of each point; empty where it is not known.
    pub(crate) visibility: Vec<f32>,
    pub(crate) vertices: Vec<Vertex>,
    /// Three vertices and the number of the material, in the order of the device's list.
    pub(crate) triangles: Vec<[u32; 4]>,
    /// With a wide open mouth, where the head can open it.
    pub(crate) opened: Option<Opened>,
}

/// The points of a surface while one shape has all its weight.
pub(crate) struct Opened {
    /// Number of the shape.
    pub(crate) shape: usize,
    pub(crate) points: Vec<Vec3>,
    /// As [`Surface::visibility`].
    pub(crate) visibility: Vec<f32>,
}

/// The shape that opens the mouth.
const OPENS_MOUTH: &str = "jawOpen";

fn opened(head: &Head) -> Option<Opened> {
    let shape = head.shapes.iter().position(|s| s.name == OPENS_MOUTH)?;
    let mut weights = vec![0.0; head.shapes.len()];
    weights[shape] = 1.0;
    let points = rubor_rig::deform::deform_points(&head.mesh, &head.shapes, &weights);
    let visibility = match head.mesh.occlusion.is_empty() {
        true => Vec::new(),
        false => rubor_rig::deform::blend_occlusion(&head.mesh, &head.shapes, &weights),
    };
    Some(Opened { shape, points, visibility })
}

type MakeLevels = Box<dyn Fn(&Head) -> Vec<Level> + Send + Sync>;

/// How coarser levels of a head are made.
pub struct Ladder {
    head: Arc<Head>,
    make: MakeLevels,
    least_error_metres: f32,
    /// Coarser geometry with the maps of the head and how far it is off, metres, finest first.
    levels: OnceLock<Vec<(f32, HeadOnGpu)>>,
}

impl Ladder {
    /// `make` returns levels of `head`, finest first, none of which is off by less than `least_error_metres`. Of the maps of
    /// `head` only that of hair is read.
    pub fn new(
        head: Arc<Head>,
        make: impl Fn(&Head) -> Vec<Level> + Send + Sync + 'static,
        least_error_metres: f32,
    ) -> Self {
        Self { head, make: Box::new(make), least_error_metres, levels: OnceLock::new() }
    }
}

/// Hairs of the scalp that a head has at most.
fn most_hairs(head: &Head) -> usize {
    head.maps.hair_count.map_or(usize::MAX, |most| most as usize)
}

/// What the levels of a head share.
struct Looks {
    maps: Option<MapsOnGpu>,
    authored: Option<AuthoredOnGpu>,
    skin_color: wgpu::TextureView,
    mm_per_texture: f32,
    grown_hairs: u32,
}

#[derive(Clone)]
pub(crate) struct MapsOnGpu {
    pub(crate) skin: wgpu::TextureView,
    /// Specular intensity and roughness; with a colour of its own that colour, and in alpha the intensity over the reflectance
    /// of glTF's materials.
    pub(crate) gloss: wgpu::TextureView,
    /// The skin has a colour by itself; its roughness is in alpha of the slopes.
    pub(crate) has_own_color: bool,
    /// The slopes are as their author made or measured them.
    pub(crate) has_given_relief: bool,
    pub(crate) hair_color_linear: [f32; 3],
    pub(crate) slopes: wgpu::TextureView,
    pub(crate) wrinkles: wgpu::TextureView,
    pub(crate) wrinkle_maps: u32,
    pub(crate) distributions: wgpu::TextureView,
    pub(crate) distribution_count: u32,
    pub(crate) neutral_mean: wgpu::TextureView,
    pub(crate) masks: wgpu::TextureView,
    pub(crate) zone_maps: Vec<u32>,
}

impl HeadOnGpu {
    /// Uploads a head.
    ///
    /// # Errors
    /// The head is invalid, empty, or has more maps or triangles than a frame can address.
    pub fn new(gpu: &Gpu, head: &Head, color: &ColorTable<'_>) -> Result<Self, RenderError> {
        head.validate()?;
        let limit = |what, found: usize, most: usize| {
            if found > most {
                let expected = format!("at most {most}");
                return Err(RenderError::Limit { what, found: found.to_string(), expected });
            }
            Ok(())
        };
        let mesh = &head.mesh;
        let Some(bounds) = head.bounds() else {
            let (found, expected) = ("0".to_owned(), "at least 1".to_owned());
            return Err(RenderError::Limit { what: "number of points", found, expected });
        };
        limit("number of triangles", mesh.triangles.len(), (1 << 27) - 2)?;
        limit("number of authored materials", head.authored.materials.len(), (1 << 24) - 2)?;
        limit("number of blend shapes", head.shapes.len(), MAX_SHAPES)?;
        limit("number of wrinkle maps", head.maps.wrinkle_slopes.len(), MAX_WRINKLE_MAPS)?;
        limit("number of hemoglobin distributions", head.maps.distributions.len(), MAX_DISTRIBUTIONS)?;
        limit("number of wrinkle zones", head.maps.zones.len(), MAX_ZONES)?;

        let (triangles, _) = ordered_triangles(head);
        let mut hair_roots = roots(head, &triangles);
        let grown_hairs = hair_roots.len() as u32;
        hair_roots.truncate(most_hairs(head));
        let texels = color.texels.iter().map(|c| [c[0], c[1], c[2], 1.0]).collect();
        let skin_color =
            texture::upload_half(gpu, "skin colour", [color.width, color.height], &[vec![texels]]);
        let looks = Looks {
            maps: upload_maps(gpu, head),
            authored: AuthoredOnGpu::new(gpu, head)?,
            skin_color,
            mm_per_texture: mm_per_texture(head),
            grown_hairs,
        };
        let mut result = Self::of(gpu, head, bounds, looks, &hair_roots);
        result.memory_bytes = result.count_bytes();
        Ok(result)
    }

    /// Lets frames in which it is small draw coarser levels. They are made when a frame first needs one.
    pub fn with_ladder(mut self, ladder: Ladder) -> Self {
        self.ladder = Some(ladder);
        self
    }

    /// Its coarsest geometry that is off by no more than a distance, metres.
    pub(crate) fn at(&self, gpu: &Gpu, error_metres: f32) -> &Self {
        let Some(ladder) = self.ladder.as_ref().filter(|l| error_metres >= l.least_error_metres) else {
            return self;
        };
        let levels =
            ladder.levels.get_or_init(|| self.levels(gpu, &ladder.head, &(ladder.make)(&ladder.head)));
        levels.iter().rfind(|(error, _)| *error <= error_metres).map_or(self, |(_, level)| level)
    }

    fn levels(&self, gpu: &Gpu, head: &Head, levels: &[Level]) -> Vec<(f32, Self)> {
        let order = triangle_order(head).0;
        let (triangles, _) = ordered_triangles(head);
        let mut all = roots(head, &triangles);
        all.truncate(most_hairs(head));
        let of = |level: &Level| {
            let reduced = head.at_level(level);
            let level_order = triangle_order(&reduced).0;
            let host = |triangle: u32| level.hosts[order[triangle as usize] as usize];
            // Frames draw no more than these.
            let drawn = drawn_hairs(self.grown_hairs, level.error_metres / ERROR_PIXELS) as usize;
            let roots =
                moved_roots(&all[..drawn.min(all.len())], (head, &order), (&reduced, &level_order), host);
            let looks = Looks {
                maps: self.maps.clone(),
                authored: self.authored.as_ref().map(|a| a.of_level(gpu, &reduced)),
                skin_color: self.skin_color.clone(),
                mm_per_texture: self.mm_per_texture,
                grown_hairs: self.grown_hairs,
            };
            let mut geometry = Self::of(gpu, &reduced, self.bounds, looks, &roots);
            geometry.family = self.family.clone();
            geometry.memory_bytes = geometry.count_bytes() - geometry.map_bytes();
            (level.error_metres, geometry)
        };
        let mut levels: Vec<_> = levels.iter().map(of).collect();
        let total = self.memory_bytes + levels.iter().map(|(_, l)| l.memory_bytes).sum::<u64>();
        levels.iter_mut().for_each(|(_, l)| l.memory_bytes = total);
        levels
    }

    /// Bytes on the device of it and of the levels that were made.
    pub(crate) fn total_bytes(&self) -> u64 {
        let made = self.ladder.as_ref().and_then(|l| l.levels.get()?.first());
        let ways = self.ways.get().map_or(0, Ways::bytes);
        ways + made.map_or(self.memory_bytes, |(_, level)| level.memory_bytes)
    }

    fn of(gpu: &Gpu, head: &Head, bounds: (Vec3, Vec3), looks: Looks, hair_roots: &[Root]) -> Self {
        let mesh = &head.mesh;
        let occlusion = |p: usize| mesh.occlusion.get(p).copied().unwrap_or(1.0);
        let rest: Vec<[f32; 4]> =
            mesh.points.iter().enumerate().map(|(i, p)| p.extend(occlusion(i)).to_array()).collect();
        let (delta_starts, deltas) = gather_deltas(head);
        let bends = rubor_rig::deform::normal_bends(head);
        let bend = |vertex: usize| {
            let bits = |v: f32| u32::from(half::f16::from_f32(v).to_bits());
            bends.get(vertex).map_or(0, |[x, y]| bits(*x) | bits(*y) << 16)
        };
        let vertices: Vec<GpuVertex> = mesh
            .vertices
            .iter()
            .enumerate()
            .map(|(i, v)| GpuVertex { point: v.point, u: v.uv.x, v: v.uv.y, bend: bend(i) })
            .collect();
        let (triangles, Counts { opaque, cut, see_through, strand_ends }) = ordered_triangles(head);
        let corners = triangles[..opaque as usize].iter().flat_map(|t| &t[..3]);
        let opaque_points: Vec<u32> = corners.map(|v| mesh.vertices[*v as usize].point).collect();
        let (ring_starts, ring) = rings(head, &triangles);
        Self {
            point_count: mesh.points.len() as u32,
            vertex_count: mesh.vertices.len() as u32,
            opaque_points: index_buffer(gpu, &opaque_points),
            opaque_triangles: opaque,
            cut_triangles: cut,
            see_through_triangles: see_through,
            strand_ends,
            shape_count: head.shapes.len(),
            rest: gpu.storage("rest points", &rest),
            delta_starts: gpu.storage("delta starts", &delta_starts),
            deltas: gpu.storage("deltas", &deltas),
            vertices: gpu.storage("vertices", &vertices),
            triangles: gpu.storage("triangles", &triangles),
            ring_starts: gpu.storage("ring starts", &ring_starts),
            ring: gpu.storage("rings", &ring),
            hair_roots: gpu.storage("hair roots", hair_roots),
            hair_root_count: hair_roots.len() as u32,
            grown_hairs: looks.grown_hairs,
            maps: looks.maps,
            authored: looks.authored,
            skin_color: looks.skin_color,
            bounds,
            mm_per_texture: looks.mm_per_texture,
            clusters: clusters(head),
            surface: Arc::new(Surface {
                points: mesh.points.clone(),
                visibility: mesh.occlusion.clone(),
                vertices: mesh.vertices.clone(),
                triangles: triangles[..opaque as usize].to_vec(),
                opened: opened(head),
            }),
            ways: OnceLock::new(),
            family: Arc::default(),
            ladder: None,
            memory_bytes: 0,
        }
    }

    /// Triangles that go through the visibility buffer, and those that are blended over the picture.
    pub fn triangle_counts(&self) -> (u32, u32) {
        (self.opaque_triangles, self.strand_ends.last().copied().unwrap_or(0))
    }

    /// Bytes on the device for this head in a scene: [`HeadOnGpu::memory_bytes`] and what frames write of it.
    pub fn bytes_in_scene(&self) -> u64 {
        self.memory_bytes + instance_bytes(self)
    }

    /// Single hairs of the scalp: those on the device, and those that grow.
    pub fn hair_counts(&self) -> [u32; 2] {
        [self.hair_root_count, self.grown_hairs]
    }

    /// What its points see of each other.
    pub(crate) fn ways(&self, gpu: &Gpu) -> &Ways {
        self.ways.get_or_init(|| Ways::new(gpu, &self.surface))
    }

    /// The undeformed points: a buffer of this head alone.
    pub(crate) fn rest_points(&self) -> &wgpu::Buffer {
        &self.rest
    }

    /// What tells where triangles have holes; `None` where none has.
    pub(crate) fn cut_resources(&self) -> Option<Vec<Resource<'_>>> {
        let authored = self.authored.as_ref().filter(|_| self.cut_triangles > 0)?;
        let mut resources =
            vec![("cut_vertices", self.vertices.bound()), ("cut_triangles", self.triangles.bound())];
        resources.extend(authored.resources());
        Some(resources)
    }

    fn count_bytes(&self) -> u64 {
        let buffers = [
            &self.rest,
            &self.delta_starts,
            &self.deltas,
            &self.vertices,
            &self.triangles,
            &self.ring_starts,
            &self.ring,
            &self.hair_roots,
            &self.opaque_points,
        ];
        let authored = self.authored.iter().flat_map(|a| [&a.materials, &a.vertices]);
        buffers.into_iter().chain(authored).map(|b| b.size()).sum::<u64>() + self.map_bytes()
    }

    /// Bytes of the textures of its maps.
    pub(crate) fn map_bytes(&self) -> u64 {
        let textures = self.maps.iter().flat_map(|m| {
            [&m.skin, &m.gloss, &m.slopes, &m.wrinkles, &m.distributions, &m.neutral_mean, &m.masks]
                .map(texture_bytes)
        });
        let authored = self.authored.iter().flat_map(|a| [&a.colors, &a.data].map(texture_bytes));
        textures.chain(authored).sum()
    }
}

/// Scale of the skin's texture at rest. The face has the densest triangles, so its scale dominates the median.
fn mm_per_texture(head: &Head) -> f32 {
    let mesh = &head.mesh;
    let skin = mesh.parts.iter().filter(|p| p.material == Material::Skin).flat_map(|p| p.triangles.clone());
    let mut scales: Vec<f32> = skin
        .filter_map(|t| {
            let corners = mesh.triangles[t as usize].map(|v| mesh.vertices[v as usize]);
            let [a, b, c] = corners.map(|v| mesh.points[v.point as usize]);
            let [s, t, u] = corners.map(|v| v.uv);
            let area_mm2 = 1e6 * (b - a).cross(c - a).length();
            let area_texture = (t - s).perp_dot(u - s).abs();
            (area_texture > 0.0 && area_mm2 > 0.0).then(|| (area_mm2 / area_texture).sqrt())
        })
        .collect();
    let middle = scales.len() / 2;
    if scales.is_empty() { 1.0 } else { *scales.select_nth_unstable_by(middle, f32::total_cmp).1 }
}

fn texture_bytes(view: &wgpu::TextureView) -> u64 {
    let t = view.texture();
    let texel = u64::from(t.format().block_copy_size(None).unwrap_or(4));
    let level = |l: u32| u64::from((t.width() >> l).max(1)) * u64::from((t.height() >> l).max(1));
    (0..t.mip_level_count()).map(level).sum::<u64>() * texel * u64::from(t.depth_or_array_layers())
}

/// Offsets sorted by point, shapes ascending within a point: starts (one more than points) and (offset, shape).
///
/// A word holds the shape in its lower 12 bits and, in 10 each above, the change of ambient visibility at weights 0.5 and
/// 1 in steps of 1/511.
fn gather_deltas(head: &Head) -> (Vec<u32>, Vec<[u32; 4]>) {
    let mut starts = vec![0u32; head.mesh.points.len() + 1];
    let merged: Vec<Vec<(u32, Vec3, u32)>> = head.shapes.iter().map(merged_changes).collect();
    for (p, ..) in merged.iter().flatten() {
        starts[*p as usize + 1] += 1;
    }
    for i in 1..starts.len() {
        starts[i] += starts[i - 1];
    }
    let mut next = starts.clone();
    let mut deltas = vec![[0; 4]; starts[starts.len() - 1] as usize];
    for (index, changes) in merged.into_iter().enumerate() {
        for (p, offset, occlusion) in changes {
            let slot = &mut next[p as usize];
            let [x, y, z] = offset.to_array().map(f32::to_bits);
            deltas[*slot as usize] = [x, y, z, index as u32 | occlusion];
            *slot += 1;
        }
    }
    (starts, deltas)
}

/// Points that a shape moves or hides: point, offset, and change of visibility in the upper bits.
fn merged_changes(shape: &BlendShape) -> Vec<(u32, Vec3, u32)> {
    let step = |v: f32| (v.clamp(-1.0, 1.0) * 511.0).round() as i32 as u32 & 0x3ff;
    let packed = |c: &OcclusionChange| step(c.at_half) << 12 | step(c.at_full) << 22;
    let mut moved = shape.points.iter().copied().zip(shape.offsets.iter().copied()).peekable();
    let mut hidden = shape.occlusion.iter().map(|c| (c.point, packed(c))).peekable();
    let mut merged = Vec::with_capacity(shape.points.len());
    loop {
        let point = match (moved.peek(), hidden.peek()) {
            (Some((a, _)), Some((b, _))) => *a.min(b),
            (Some((p, _)), None) | (None, Some((p, _))) => *p,
            (None, None) => return merged,
        };
        let offset = moved.next_if(|m| m.0 == point).map_or(Vec3::ZERO, |m| m.1);
        merged.push((point, offset, hidden.next_if(|h| h.0 == point).map_or(0, |h| h.1)));
    }
}

/// How many triangles of the device's list are of a kind.
struct Counts {
    opaque: u32,
    /// Of these, the last ones: with holes, and of those again the last ones, seen through.
    cut: u32,
    see_through: u32,
    /// As [`strands::ordered`] gives them.
    strand_ends: Vec<u32>,
}

/// Triangles of the device's list with the numbers of their material (see `authored.wesl`), and counts as [`triangle_order`].
fn ordered_triangles(head: &Head) -> (Vec<[u32; 4]>, Counts) {
    let (order, counts) = triangle_order(head);
    let mut numbers = vec![0; head.mesh.triangles.len()];
    for (index, part) in head.mesh.parts.iter().enumerate() {
        let authored = head.needed_material(index).map_or(0, |m| m + 1);
        let number = part.material.number() | authored << AUTHORED_SHIFT;
        numbers[part.triangles.start as usize..part.triangles.end as usize].fill(number);
    }
    let triangle = |i: &u32| {
        let [a, b, c] = head.mesh.triangles[*i as usize];
        [a, b, c, numbers[*i as usize]]
    };
    (order.iter().map(triangle).collect(), counts)
}

/// The triangle of `head.mesh` that each number of [`crate::channels::Channel::Ids`] stands for, in frames that draw the whole
/// head (`--detail full`); the numbers in ids are one larger.
pub fn triangles_of_ids(head: &Head) -> Vec<u32> {
    let (mut order, counts) = triangle_order(head);
    order.truncate(counts.opaque as usize);
    order
}

/// Triangles of a head in the order of the device's list: opaque ones first, the last of them those with holes,
/// of these the last ones those that are seen through; then overlays in the order of [`strands`]; hidden ones are left out.
fn triangle_order(head: &Head) -> (Vec<u32>, Counts) {
    // Backs of parts with one side are holes too; skin has two.
    let has_holes = |part: usize| {
        let material = head.needed_material(part).map(|m| &head.authored.materials[m as usize]);
        let is_skin = head.authored_material(part).is_none();
        material
            .is_some_and(|m| m.cutoff().is_some() || m.is_see_through() || !(m.is_double_sided || is_skin))
    };
    let is_see_through = |part: usize| {
        let material = head.authored_material(part).map(|m| &head.authored.materials[m as usize]);
        material.is_some_and(|m| m.is_see_through())
    };
    let of = |wanted: &dyn Fn(usize, Material) -> bool| -> Vec<u32> {
        (head.mesh.parts.iter().enumerate())
            .filter(|(index, part)| wanted(*index, part.material))
            .flat_map(|(_, part)| part.triangles.clone())
            .collect()
    };
    let mut triangles = of(&|i, m| m.is_opaque() && !has_holes(i));
    let whole = triangles.len() as u32;
    triangles.extend(of(&|i, m| m.is_opaque() && has_holes(i) && !is_see_through(i)));
    let solid = triangles.len() as u32;
    triangles.extend(of(&|i, m| m.is_opaque() && is_see_through(i)));
    let opaque = triangles.len() as u32;
    let (overlays, strand_ends) = strands::ordered(head);
    triangles.extend(overlays);
    (triangles, Counts { opaque, cut: opaque - whole, see_through: opaque - solid, strand_ends })
}

fn index_buffer(gpu: &Gpu, indices: &[u32]) -> wgpu::Buffer {
    let usage = wgpu::BufferUsages::INDEX | wgpu::BufferUsages::STORAGE;
    // An empty buffer cannot be bound.
    let contents: &[u32] = if indices.is_empty() { &[0] } else { indices };
    let contents = bytemuck::cast_slice(contents);
    gpu.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
        label: Some("opaque points"),
        contents,
        usage,
    })
}

/// Triangles around each point: starts (one more than points) and indices into `triangles`.
fn rings(head: &Head, triangles: &[[u32; 4]]) -> (Vec<u32>, Vec<u32>) {
    let point = |v: u32| head.mesh.vertices[v as usize].point as usize;
    let mut starts = vec![0u32; head.mesh.points.len() + 1];
    for t in triangles {
        for v in &t[..3] {
            starts[point(*v) + 1] += 1;
        }
    }
    for i in 1..starts.len() {
        starts[i] += starts[i - 1];
    }
    let mut next = starts.clone();
    let mut ring = vec![0; starts[starts.len() - 1] as usize];
    for (i, t) in triangles.iter().enumerate() {
        for v in &t[..3] {
            let slot = &mut next[point(*v)];
            ring[*slot as usize] = i as u32;
            *slot += 1;
        }
    }
    (starts, ring)
}

fn upload_maps(gpu: &Gpu, head: &Head) -> Option<MapsOnGpu> {
    let maps = &head.maps;
    let (melanin, hemoglobin) = (maps.melanin.as_ref()?, maps.hemoglobin.as_ref()?);
    let default_specular = Map::filled(1, 1, &[0.6, 0.32]);
    let specular = maps.specular.as_ref().unwrap_or(&default_specular);
    let flat = Map::filled(1, 1, &[0.0, 0.0]);
    let zero = Map::filled(1, 1, &[0.0]);
    let full = Map::filled(1, 1, &[1.0]);
    let scattering = maps.scattering.as_ref().unwrap_or(&full);
    let hair = maps.hair.as_ref().unwrap_or(&zero);
    let size = largest_of([melanin, hemoglobin, scattering, hair]);
    let skin = texels(size, |u, v| {
        let axis = |value: f32, most: f32| (value.max(0.0) / most).cbrt();
        [
            axis(melanin.sample(u, v, 0), MAX_MELANIN),
            axis(hemoglobin.sample(u, v, 0), MAX_HEMOGLOBIN),
            scattering.sample(u, v, 0),
            hair.sample(u, v, 0),
        ]
    });
    // Kernels of WebGPU read 16 textures and no more: a colour of its own shares one with the gloss.
    let gloss = match &maps.albedo {
        Some(albedo) => {
            let size = largest_of([albedo, specular]);
            let texel = |u, v| {
                let [r, g, b] = [0, 1, 2].map(|c| albedo.sample(u, v, c));
                [r, g, b, SKIN_F0 / BASE_COLOR_F0 * specular.sample(u, v, 0)]
            };
            texture::upload_srgb(gpu, "albedo", size, &[texture::mip_chain(size, texels(size, texel))])
        }
        None => {
            let size = largest_of([specular]);
            let texel = |u, v| [specular.sample(u, v, 0), specular.sample(u, v, 1), 0.0, 0.0];
            texture::upload_bytes::<2>(gpu, "gloss", size, &[texture::mip_chain(size, texels(size, texel))])
        }
    };
    let slopes = maps.slopes.as_ref().unwrap_or(&flat);
    let slope_size = slope_size(maps);
    let roughness = maps.albedo.as_ref().map(|_| specular);
    // Channel 2 averages the squared slope, so that each level contains the variance that it lost.
    let slope_texels = texels(slope_size, |u, v| {
        let (x, y) = (slopes.sample(u, v, 0), slopes.sample(u, v, 1));
        [x, y, 0.5 * (x * x + y * y), roughness.map_or(0.0, |r| r.sample(u, v, 1))]
    });
    let mut slope_chain = texture::mip_chain(slope_size, slope_texels);
    for level in &mut slope_chain {
        for t in level {
            t[2] = (t[2] - 0.5 * (t[0] * t[0] + t[1] * t[1])).max(0.0);
        }
    }
    let wrinkle_size = largest_of(&maps.wrinkle_slopes);
    // The relief at the resolution of the wrinkles, from which the difference of normals is taken.
    let mask = Mask::full(slopes.width, slopes.height);
    let coarse = if maps.wrinkle_slopes.is_empty() || slopes.width <= wrinkle_size[0] {
        slopes.clone()
    } else {
        resize_area(slopes, &mask, wrinkle_size[0], wrinkle_size[1]).0
    };
    let mut wrinkle_layers: Vec<_> = maps
        .wrinkle_slopes
        .iter()
        .map(|m| {
            let level = texels(wrinkle_size, |u, v| {
                let (x, y) = (m.sample(u, v, 0), m.sample(u, v, 1));
                let base = Vec2::new(coarse.sample(u, v, 0), coarse.sample(u, v, 1));
                let normal = |slopes: Vec2| slopes.extend(1.0).normalize().truncate();
                let difference = normal(base + Vec2::new(x, y)) - normal(base);
                [x, y, difference.x, difference.y]
            });
            texture::mip_chain(wrinkle_size, level)
        })
        .collect();
    if wrinkle_layers.is_empty() {
        wrinkle_layers.push(texture::mip_chain([1, 1], vec![[0.0; 4]]));
    }

    let mean = maps.hemoglobin_mean.as_ref().unwrap_or(&zero);
    let side = [APPEARANCE_SIZE; 2];
    let mut distributions: Vec<_> = maps
        .distributions
        .iter()
        .map(|d| {
            let change = |u, v| {
                [d.bias.sample(u, v, 0) - mean.sample(u, v, 0), d.scale.sample(u, v, 0) - 1.0, 0.0, 0.0]
            };
            vec![texels(side, change)]
        })
        .collect();
    if distributions.is_empty() {
        distributions.push(vec![vec![[0.0; 4]; (APPEARANCE_SIZE * APPEARANCE_SIZE) as usize]]);
    }
    let means = vec![texels(side, |u, v| [mean.sample(u, v, 0), 0.0, 0.0, 0.0])];
    let mask_size = mask_size(maps);
    let mut masks: Vec<_> = maps
        .zones
        .chunks(4)
        .map(|zones| {
            let weights =
                |u, v| std::array::from_fn(|i| zones.get(i).map_or(0.0, |z| z.mask.sample(u, v, 0)));
            vec![texels(mask_size, weights)]
        })
        .collect();
    if masks.is_empty() {
        masks.push(vec![vec![[0.0; 4]]]);
    }

    Some(MapsOnGpu {
        skin: texture::upload_bytes::<4>(gpu, "skin", size, &[texture::mip_chain(size, skin)]),
        gloss,
        has_own_color: maps.albedo.is_some(),
        has_given_relief: head.provenance.iter().any(is_given_relief),
        hair_color_linear: maps.hair_color_linear,
        slopes: texture::upload_half(gpu, "slopes", slope_size, &[slope_chain]),
        wrinkles: texture::array_view(&texture::upload_half(gpu, "wrinkles", wrinkle_size, &wrinkle_layers)),
        wrinkle_maps: maps.wrinkle_slopes.len() as u32,
        distributions: texture::array_view(&texture::upload_half_channels::<2>(
            gpu,
            "distributions",
            side,
            &distributions,
        )),
        distribution_count: maps.distributions.len() as u32,
        neutral_mean: texture::upload_half_channels::<1>(gpu, "neutral mean", side, &[means]),
        masks: texture::array_view(&texture::upload_bytes::<4>(gpu, "zone masks", mask_size, &masks)),
        zone_maps: maps.zones.iter().map(|z| z.wrinkle_map).collect(),
    })
}

/// Whether slopes were measured or painted. Those of heads that say nothing count as made by rubor.
fn is_given_relief(provenance: &Provenance) -> bool {
    provenance.of == "maps.slopes"
        && matches!(provenance.kind, ProvenanceKind::Measured | ProvenanceKind::Painted)
}

/// Evaluates a function of texture space at the texels of an image of this size.
fn texels(size: [u32; 2], f: impl Fn(f32, f32) -> Texel + Sync) -> Vec<Texel> {
    (0..size[1])
        .into_par_iter()
        .flat_map_iter(|y| {
            let f = &f;
            (0..size[0]).map(move |x| f((x as f32 + 0.5) / size[0] as f32, (y as f32 + 0.5) / size[1] as f32))
        })
        .collect()
}
