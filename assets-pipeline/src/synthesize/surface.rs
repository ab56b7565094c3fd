//! The skin of a head seen from its texture: which point of the surface a texel shows.
//!
//! Triangles are rasterised into texture space with a gutter of [`GUTTER_TEXELS`] around the islands, in which the
//! triangle is continued beyond its edge, so that a bilinear fetch at a border reads what the other side of the
//! border has.

use glam::{Vec2, Vec3, Vec4};
use rayon::prelude::*;
use rubor_rig::deform::{point_normals, vertex_tangents};
use rubor_rig::head::{Head, MM_PER_METRE, Material};
use rubor_rig::map::Map;
use rubor_rig::mask::{Mask, fill_unmapped};

use super::face_space::FaceSpace;

/// Width of the continuation around islands, texels.
pub(crate) const GUTTER_TEXELS: f32 = 2.0;
/// Rows that one task rasterises.
const BAND_ROWS: usize = 32;
/// No triangle covers the texel.
const EMPTY: u32 = u32::MAX;

/// Data of a corner that the fields need.
#[derive(Clone, Copy)]
struct Corner {
    uv: Vec2,
    /// Canonical position, mm.
    place: Vec3,
    /// Canonical displacement per mm along the tangent and the bitangent of the texture frame.
    along_tangent: Vec3,
    along_bitangent: Vec3,
    /// Ambient visibility at rest, 0 to 1.
    open: f32,
    /// Edge of a texel about here as part of the face's typical one.
    coarseness: f32,
}

/// Skin triangles of a head in canonical space.
pub(crate) struct SkinSurface {
    triangles: Vec<[Corner; 3]>,
    /// Typical edge of a texel of a map of 1 x 1 texels on the front of the face, mm: divide by the resolution.
    face_extent_mm: f32,
}

/// A point of the skin.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Site {
    /// Canonical position, mm.
    pub place: Vec3,
    /// Canonical unit normal.
    pub normal: Vec3,
    /// Texture coordinate.
    pub uv: Vec2,
    /// Ambient visibility at rest, 0 to 1; 1 where the head does not say.
    pub open: f32,
    /// Edge of a texel about here as part of the typical one of the face: over 1 where the texture is coarser.
    pub coarseness: f32,
    along_tangent: Vec3,
    along_bitangent: Vec3,
}

impl Site {
    /// A place without a texture frame.
    #[cfg(test)]
    pub(crate) fn at(place: Vec3, normal: Vec3, open: f32) -> Self {
        let (along_tangent, along_bitangent) = (Vec3::X, Vec3::Y);
        Self { place, normal, uv: Vec2::ZERO, open, coarseness: 1.0, along_tangent, along_bitangent }
    }

    /// Slopes (n_x/n_z, n_y/n_z) of the surface displaced by a height field (mm) with this gradient in canonical
    /// space. The displaced normal is n - grad h on the surface (Mikkelsen 2010), so the slopes are the negated
    /// derivatives along the texture frame.
    pub(crate) fn slopes(&self, gradient: Vec3) -> [f32; 2] {
        [-gradient.dot(self.along_tangent), -gradient.dot(self.along_bitangent)]
    }
}

impl SkinSurface {
    /// Gathers the skin of a head. Triangles whose texture coordinates leave the unit square or have no area are
    /// left out: no texel can show them.
    pub(crate) fn new(head: &Head, space: &FaceSpace) -> Self {
        let mesh = &head.mesh;
        let normals = point_normals(mesh, &mesh.points);
        let tangents = vertex_tangents(mesh, &mesh.points, &normals);
        let corner = |v: u32| {
            let vertex = mesh.vertices[v as usize];
            let (p, n) = (mesh.points[vertex.point as usize], normals[vertex.point as usize]);
            let t: Vec4 = tangents[v as usize];
            let tangent = t.truncate();
            let bitangent = t.w * n.cross(tangent);
            let step = 0.5 / MM_PER_METRE;
            let derivative = |d: Vec3| space.warp(p + step * d) - space.warp(p - step * d);
            Corner {
                uv: vertex.uv,
                place: space.warp(p),
                along_tangent: derivative(tangent),
                along_bitangent: derivative(bitangent),
                open: mesh.occlusion.get(vertex.point as usize).copied().unwrap_or(1.0),
                coarseness: 1.0,
            }
        };
        let mut used = vec![None; mesh.vertices.len()];
        let (mut triangles, mut points) = (Vec::new(), Vec::new());
        for part in mesh.parts.iter().filter(|p| p.material == Material::Skin) {
            for t in &mesh.triangles[part.triangles.start as usize..part.triangles.end as usize] {
                let corners = t.map(|v| *used[v as usize].get_or_insert_with(|| corner(v)));
                let inside =
                    |c: &Corner| (-1e-3..=1.001).contains(&c.uv.x) && (-1e-3..=1.001).contains(&c.uv.y);
                if corners.iter().all(inside) && uv_area(&corners).abs() > 1e-12 {
                    triangles.push(corners);
                    points.push(t.map(|v| mesh.vertices[v as usize].point));
                }
            }
        }
        let mut extents: Vec<f32> = triangles
            .iter()
            .filter(|t| t[0].place.z > 40.0)
            .map(|t| (area(t) / uv_area(t).abs()).sqrt())
            .collect();
        extents.sort_by(f32::total_cmp);
        let face_extent_mm = extents.get(extents.len() / 2).copied().unwrap_or(350.0);
        let coarseness = coarseness(&triangles, &points, mesh.points.len(), face_extent_mm);
        for (t, points) in triangles.iter_mut().zip(&points) {
            t.iter_mut().zip(points).for_each(|(c, p)| c.coarseness = coarseness[*p as usize]);
        }
        Self { triangles, face_extent_mm }
    }

    /// True when no texel can be filled.
    pub(crate) fn is_empty(&self) -> bool {
        self.triangles.is_empty()
    }

    /// Typical size of a texel on the front of the face, mm. One number for the whole head: were it local, the
    /// detail that a map leaves out would change at UV borders.
    pub(crate) fn texel_mm(&self, resolution: u32) -> f32 {
        self.face_extent_mm / resolution as f32
    }

    /// The triangle that each texel of a square map shows.
    pub(crate) fn rasterise(&self, resolution: u32) -> Coverage<'_> {
        let size = resolution as usize;
        let bands = size.div_ceil(BAND_ROWS);
        let scale = resolution as f32;
        let mut members = vec![Vec::new(); bands];
        for (i, t) in self.triangles.iter().enumerate() {
            let low = t.iter().map(|c| c.uv.y).fold(f32::MAX, f32::min) * scale - GUTTER_TEXELS - 0.5;
            let high = t.iter().map(|c| c.uv.y).fold(f32::MIN, f32::max) * scale + GUTTER_TEXELS + 0.5;
            let first = (low.max(0.0) as usize / BAND_ROWS).min(bands - 1);
            let last = (high.max(0.0) as usize / BAND_ROWS).min(bands - 1);
            for band in &mut members[first..=last] {
                band.push(i as u32);
            }
        }
        let mut shown = vec![EMPTY; size * size];
        shown.par_chunks_mut(size * BAND_ROWS).enumerate().for_each(|(band, rows)| {
            let mut distance = vec![f32::MIN; rows.len()];
            for i in &members[band] {
                let corners = self.triangles[*i as usize].map(|c| c.uv * scale);
                fill(*i, corners, band * BAND_ROWS, size, rows, &mut distance);
            }
        });
        Coverage { surface: self, resolution, shown }
    }
}

/// Edge of a texel at each point as part of the typical one: the coarsest about it, blended over a few edges, so that
/// what a coarse part of the texture leaves out fades towards the border of a fine one.
fn coarseness(triangles: &[[Corner; 3]], points: &[[u32; 3]], count: usize, typical_mm: f32) -> Vec<f32> {
    const BLENDED_EDGES: usize = 6;
    let mut values = vec![0.0f32; count];
    for (t, points) in triangles.iter().zip(points) {
        // Of islands that are squeezed one way, that way counts.
        let longest = (0..3)
            .map(|k| {
                let (a, b) = (t[k], t[(k + 1) % 3]);
                a.place.distance(b.place) / a.uv.distance(b.uv).max(1e-9)
            })
            .fold(0.0, f32::max);
        let value = longest.min(1.5 * (area(t) / uv_area(t).abs()).sqrt()) / typical_mm;
        points.iter().for_each(|p| values[*p as usize] = values[*p as usize].max(value));
    }
    for _ in 0..BLENDED_EDGES {
        let mut sums = vec![(0.0f32, 0.0f32); count];
        for [a, b, c] in points {
            for (p, q) in [(*a, *b), (*b, *c), (*c, *a)] {
                let (u, v) = (values[p as usize], values[q as usize]);
                sums[p as usize] = (sums[p as usize].0 + v, sums[p as usize].1 + 1.0);
                sums[q as usize] = (sums[q as usize].0 + u, sums[q as usize].1 + 1.0);
            }
        }
        for (value, (sum, n)) in values.iter_mut().zip(sums) {
            if n > 0.0 {
                *value = value.max(0.5 * *value + 0.5 * sum / n);
            }
        }
    }
    values
}

/// Writes a triangle (corners in texels) into the rows of a band, where it is inside or nearer than the stored one.
fn fill(
    index: u32,
    corners: [Vec2; 3],
    first_row: usize,
    size: usize,
    shown: &mut [u32],
    distance: &mut [f32],
) {
    let [a, b, c] = corners;
    let turn = if (b - a).perp_dot(c - a) < 0.0 { -1.0 } else { 1.0 };
    let edges = [(a, b), (b, c), (c, a)].map(|(p, q)| {
        let d = (q - p).normalize_or_zero() * turn;
        (p, Vec2::new(-d.y, d.x))
    });
    let low = a.min(b).min(c) - GUTTER_TEXELS;
    let high = a.max(b).max(c) + GUTTER_TEXELS;
    let rows = shown.len() / size;
    let first = (low.y - 0.5).ceil().max(first_row as f32) as usize;
    let last = (high.y - 0.5).floor().min((first_row + rows) as f32 - 1.0);
    let left = (low.x - 0.5).ceil().max(0.0) as usize;
    let right = (high.x - 0.5).floor().min(size as f32 - 1.0);
    if last < 0.0 || right < 0.0 {
        return;
    }
    for y in first..=last as usize {
        for x in left..=right as usize {
            let p = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
            // Signed distance to the nearest edge line, positive inside; all inside texels count alike, so the
            // first triangle keeps them.
            let d = edges.iter().map(|(q, n)| (p - *q).dot(*n)).fold(0.0, f32::min);
            let at = (y - first_row) * size + x;
            if d >= -GUTTER_TEXELS && d > distance[at] {
                distance[at] = d;
                shown[at] = index;
            }
        }
    }
}

/// Twice the area in texture space, signed.
fn uv_area(t: &[Corner; 3]) -> f32 {
    (t[1].uv - t[0].uv).perp_dot(t[2].uv - t[0].uv)
}

/// Twice the area in canonical space, mm^2.
fn area(t: &[Corner; 3]) -> f32 {
    (t[1].place - t[0].place).cross(t[2].place - t[0].place).length()
}

/// The surface at the texels of a square map.
pub(crate) struct Coverage<'a> {
    surface: &'a SkinSurface,
    resolution: u32,
    shown: Vec<u32>,
}

impl Coverage<'_> {
    /// Side of the map, texels.
    pub(crate) fn resolution(&self) -> u32 {
        self.resolution
    }

    /// The point of the skin at the centre of a texel.
    pub(crate) fn site(&self, x: u32, y: u32) -> Option<Site> {
        let index = self.shown[(y * self.resolution + x) as usize];
        if index == EMPTY {
            return None;
        }
        let t = &self.surface.triangles[index as usize];
        let p = Vec2::new(x as f32 + 0.5, y as f32 + 0.5) / self.resolution as f32;
        Some(site_at(t, p))
    }

    /// The point of the skin at a texture coordinate, on the triangle that its texel shows.
    #[cfg(test)]
    pub(crate) fn site_near(&self, uv: Vec2) -> Option<Site> {
        let texel = (uv * self.resolution as f32).floor();
        let index = self.shown[(texel.y as u32 * self.resolution + texel.x as u32) as usize];
        (index != EMPTY).then(|| site_at(&self.surface.triangles[index as usize], uv))
    }

    /// Evaluates fields at every texel that shows skin and fills the rest of the maps from the nearest skin.
    /// `evaluate` returns the texels of maps with the given numbers of channels, one after another.
    pub(crate) fn bake<const N: usize>(
        &self,
        channels: &[u32],
        evaluate: impl Fn(&Site) -> [f32; N] + Sync,
    ) -> Vec<Map> {
        self.bake_with(channels, &|| (), evaluate)
    }

    /// As [`Coverage::bake`]; calls `row_done` after each row, from several threads.
    pub(crate) fn bake_with<const N: usize>(
        &self,
        channels: &[u32],
        row_done: &(dyn Fn() + Sync),
        evaluate: impl Fn(&Site) -> [f32; N] + Sync,
    ) -> Vec<Map> {
        debug_assert_eq!(channels.iter().sum::<u32>() as usize, N);
        let size = self.resolution as usize;
        let mut texels = vec![[0.0f32; N]; size * size];
        texels.par_chunks_mut(size).enumerate().for_each(|(y, row)| {
            for (x, texel) in row.iter_mut().enumerate() {
                if let Some(site) = self.site(x as u32, y as u32) {
                    *texel = evaluate(&site);
                }
            }
            row_done();
        });
        let mut first = 0;
        let mut maps = Vec::new();
        for count in channels {
            let range = first..first + *count as usize;
            let mut values = vec![0.0; size * size * range.len()];
            values.par_chunks_mut(size * range.len()).zip(texels.par_chunks(size)).for_each(|(to, from)| {
                for (t, f) in to.chunks_mut(range.len()).zip(from) {
                    t.copy_from_slice(&f[range.clone()]);
                }
            });
            let mut map = Map { width: self.resolution, height: self.resolution, channels: *count, values };
            self.fill_empty(&mut map);
            maps.push(map);
            first = range.end;
        }
        maps
    }

    /// Fills texels without skin with means of the skin about them, coarser with distance (pull-push), so that
    /// smaller versions of a map do not bleed.
    fn fill_empty(&self, map: &mut Map) {
        let mapped: Vec<bool> = self.shown.iter().map(|s| *s != EMPTY).collect();
        fill_unmapped(map, &Mask { width: self.resolution, height: self.resolution, mapped });
    }
}

/// The point of a triangle, or of its plane, at a texture coordinate.
fn site_at(t: &[Corner; 3], p: Vec2) -> Site {
    let inverse = 1.0 / uv_area(t);
    let w1 = (p - t[0].uv).perp_dot(t[2].uv - t[0].uv) * inverse;
    let w2 = (t[1].uv - t[0].uv).perp_dot(p - t[0].uv) * inverse;
    let blend = |f: fn(&Corner) -> Vec3| f(&t[0]) * (1.0 - w1 - w2) + f(&t[1]) * w1 + f(&t[2]) * w2;
    let along_tangent = blend(|c| c.along_tangent);
    let along_bitangent = blend(|c| c.along_bitangent);
    // The face of the triangle turns with the sign of its texture; canonical space is not mirrored.
    let face = (t[1].place - t[0].place).cross(t[2].place - t[0].place);
    let normal = along_tangent.cross(along_bitangent);
    let normal = if normal.dot(face) < 0.0 { -normal } else { normal };
    Site {
        place: blend(|c| c.place),
        normal: normal.normalize_or_zero(),
        uv: p,
        open: t[0].open * (1.0 - w1 - w2) + t[1].open * w1 + t[2].open * w2,
        coarseness: t[0].coarseness * (1.0 - w1 - w2) + t[1].coarseness * w1 + t[2].coarseness * w2,
        along_tangent,
        along_bitangent,
    }
}
