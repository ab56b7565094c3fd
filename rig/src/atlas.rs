//! Islands of texture coordinates, laid out again so that light can be blurred in them.
//!
//! ```text
//! triangles, texture coordinates --islands--> pieces without folds --pack--> rectangles with margins
//!        --rasterise--> texel -> triangle + barycentrics --walk over edges--> the same for texels of the margins
//! ```
//!
//! A blur over texture coordinates stops at the border of an island, and an author's layout leaves little room around
//! islands, uses one texel for several places (mirrored halves) and several tiles. So islands get a layout of their
//! own: each is scaled until a texel is as wide on the skin as in every other island, and has a margin as wide as the
//! blur reaches. A texel of the margin stands for the place across the seam: the straight walk over the surface at rest
//! from the nearest place of the border, unfolded from triangle to triangle. At an open border the walk is reflected,
//! so no light is lost there.
//!
//! Islands are connected triangles of one winding in texture space, so mirrored halves and heads of several tiles are
//! islands like others. What cannot be laid out: an island that covers itself without a fold (a spiral), see
//! [`Atlas::overlap`].

use std::collections::HashMap;

use glam::{DVec2, DVec3, Vec2, Vec3};

use crate::head::{MM_PER_METRE, Vertex};

/// Texels that rectangles of islands are aligned to: smaller maps of an atlas then mix no two islands.
const ALIGNMENT: u32 = 8;
/// Texels around an island at least: interpolation, and interpolation on an image of half the size.
const LEAST_MARGIN: u32 = 3;
/// Margins take at most this part of the atlas's side; what is farther does not cross seams.
const MOST_MARGIN: u32 = 16;
/// Most stretched island that is scaled to even texels: millimetres of one axis over those of the other.
const MOST_ASPECT: f64 = 8.0;
/// Share of skin without texture coordinates from which on there is no layout.
const MOST_BARE: f64 = 0.05;
/// Share of an atlas's texels that an island may cover twice before light in it is wrong in a place that shows.
pub const MOST_OVERLAP: f64 = 0.01;
/// Triangles that a walk crosses at most.
const MOST_CROSSINGS: usize = 256;
/// Area of a triangle in texture space that counts as none.
const NO_AREA: f64 = 1e-14;

/// Why there is no layout.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum AtlasError {
    /// No triangle.
    #[error("it has no skin")]
    NoSkin,
    /// Texture coordinates that span no area.
    #[error(
        "{percent:.0} % of its skin have no texture coordinates (their triangles have no area in the texture)"
    )]
    NoCoordinates {
        /// Share of the skin's area, percent.
        percent: f64,
    },
    /// A position or coordinate that is not finite.
    #[error("triangle {triangle} of its skin has a position or texture coordinate that is not finite")]
    NotFinite {
        /// Index of the triangle.
        triangle: usize,
    },
    /// So many islands that not even the smallest scale fits.
    #[error("its texture has {islands} islands, too many for {side} x {side} texels")]
    TooMany {
        /// Islands.
        islands: usize,
        /// Texels on a side.
        side: u32,
    },
}

/// The triangles that are laid out.
#[derive(Clone, Copy, Debug)]
pub struct Skin<'a> {
    /// Positions at rest, metres.
    pub points: &'a [Vec3],
    /// Corners of triangles.
    pub vertices: &'a [Vertex],
    /// Indices into `vertices`.
    pub triangles: &'a [[u32; 3]],
}

/// A place of the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Index of the triangle.
    pub triangle: u32,
    /// Barycentric coordinates, 0 to 1, with a sum of 1.
    pub barycentric: [f32; 3],
}

/// Islands of texture coordinates.
#[derive(Clone, Debug, PartialEq)]
pub struct Islands {
    /// Island of each triangle.
    pub of_triangle: Vec<u32>,
    /// Number of islands.
    pub count: usize,
    /// Across each edge (from corner k to k + 1): the triangle and its edge; `None` at a border of the skin.
    across: Vec<[Option<(u32, u8)>; 3]>,
    /// Whether the triangle across an edge is its neighbour in the texture too.
    is_joined: Vec<[bool; 3]>,
    /// Twice the area in texture space with the sign of the winding.
    winding: Vec<f64>,
}

/// A layout: texels and the places that they stand for.
#[derive(Clone, Debug, PartialEq)]
pub struct Atlas {
    /// Texels on a side.
    pub side: u32,
    /// Millimetres of skin at rest per texel.
    pub mm_per_texel: f32,
    /// Texels of a margin.
    pub margin: u32,
    /// Number of islands.
    pub islands: usize,
    /// For each triangle xy and zw with which texture coordinates become texels: `uv * xy + zw`.
    pub texel_from_uv: Vec<[f32; 4]>,
    /// The place of each texel, row by row.
    pub places: Vec<Option<Place>>,
    /// Texels inside of islands; the other places are margins.
    pub inside: usize,
    /// Share of these that two triangles of one island cover.
    pub overlap: f64,
}

impl<'a> Skin<'a> {
    fn point(&self, triangle: usize, corner: usize) -> DVec3 {
        let v = self.triangles[triangle][corner % 3];
        self.points[self.vertices[v as usize].point as usize].as_dvec3() * f64::from(MM_PER_METRE)
    }

    fn uv(&self, triangle: usize, corner: usize) -> DVec2 {
        self.vertices[self.triangles[triangle][corner % 3] as usize].uv.as_dvec2()
    }

    fn point_index(&self, triangle: usize, corner: usize) -> u32 {
        self.vertices[self.triangles[triangle][corner % 3] as usize].point
    }

    fn area_mm2(&self, t: usize) -> f64 {
        let a = self.point(t, 0);
        0.5 * (self.point(t, 1) - a).cross(self.point(t, 2) - a).length()
    }

    /// Millimetres per unit of u and of v, as vectors on a triangle; `None` where it has no area in the texture.
    fn axes_mm(&self, t: usize) -> Option<[DVec3; 2]> {
        let (a, b, c) = (self.uv(t, 0), self.uv(t, 1), self.uv(t, 2));
        let det = (b - a).perp_dot(c - a);
        if det.abs() < NO_AREA {
            return None;
        }
        let (ab, ac) = (self.point(t, 1) - self.point(t, 0), self.point(t, 2) - self.point(t, 0));
        Some([(ab * (c.y - a.y) - ac * (b.y - a.y)) / det, (ac * (b.x - a.x) - ab * (c.x - a.x)) / det])
    }
}

impl Islands {
    /// Finds the islands.
    ///
    /// # Errors
    /// There is no skin, or too much of it has no texture coordinates.
    pub fn new(skin: &Skin<'_>) -> Result<Self, AtlasError> {
        let count = skin.triangles.len();
        if count == 0 {
            return Err(AtlasError::NoSkin);
        }
        let mut winding = Vec::with_capacity(count);
        let (mut bare, mut whole) = (0.0, 0.0);
        for t in 0..count {
            let (a, b, c) = (skin.uv(t, 0), skin.uv(t, 1), skin.uv(t, 2));
            let area = skin.area_mm2(t);
            if !(area.is_finite() && a.is_finite() && b.is_finite() && c.is_finite()) {
                return Err(AtlasError::NotFinite { triangle: t });
            }
            let w = (b - a).perp_dot(c - a);
            winding.push(if w.abs() < NO_AREA { 0.0 } else { w });
            whole += area;
            if w.abs() < NO_AREA {
                bare += area;
            }
        }
        if whole <= 0.0 || bare > MOST_BARE * whole {
            let percent = if whole > 0.0 { 100.0 * bare / whole } else { 100.0 };
            return Err(AtlasError::NoCoordinates { percent });
        }

        let across = across_edges(skin);
        let mut is_joined = vec![[false; 3]; count];
        let mut sets = Sets::new(count);
        for t in 0..count {
            for k in 0..3 {
                let Some((other, edge)) = across[t][k] else { continue };
                let (other, edge) = (other as usize, edge as usize);
                let meets = |mine: usize, theirs: usize| {
                    skin.point_index(t, mine) == skin.point_index(other, theirs)
                        && skin.uv(t, mine).distance(skin.uv(other, theirs)) < 1e-6
                };
                let same_place =
                    (meets(k, edge + 1) && meets(k + 1, edge)) || (meets(k, edge) && meets(k + 1, edge + 1));
                if same_place && winding[t] * winding[other] > 0.0 {
                    is_joined[t][k] = true;
                    sets.join(t, other);
                }
            }
        }
        // What has no area in the texture belongs to a neighbour.
        for _ in 0..2 {
            for t in (0..count).filter(|t| winding[*t] == 0.0) {
                let near = across[t].iter().flatten().map(|(o, _)| *o as usize).find(|o| winding[*o] != 0.0);
                if let Some(near) = near {
                    sets.join_into(t, near);
                }
            }
        }
        let (of_triangle, islands) = sets.numbered();
        Ok(Self { of_triangle, count: islands, across, is_joined, winding })
    }

    /// Islands that are wound the other way than most of the skin: mirrored in the texture.
    pub fn mirrored(&self) -> usize {
        let sum: f64 = self.winding.iter().map(|w| w.signum() * f64::from(u8::from(*w != 0.0))).sum();
        let mut seen = vec![false; self.count];
        for (t, w) in self.winding.iter().enumerate() {
            seen[self.of_triangle[t] as usize] |= if sum < 0.0 { *w > 0.0 } else { *w < 0.0 };
        }
        seen.into_iter().filter(|s| *s).count()
    }
}

/// Share of the texels that skin uses in its author's layout which several places of the skin use: mirrored halves, and
/// parts on top of each other. Texels of `side` x `side` in each tile; texture that repeats over more than 64 tiles is
/// not looked at.
pub fn shared_texels(skin: &Skin<'_>, side: u32) -> f64 {
    const FARTHEST_TILE: f64 = 64.0;
    // Texels inside of a triangle, and not on its edges.
    const INSIDE: f64 = 1e-3;
    // Texels that are tried, and tiles that are kept: layouts that need more cover the square a thousand times, and the
    // triangles before tell it.
    const MOST_TRIES: usize = 1 << 28;
    const MOST_TILES: usize = 1024;
    let mut tries = 0;
    let mut tiles: HashMap<(i32, i32), Vec<u8>> = HashMap::new();
    for t in 0..skin.triangles.len() {
        let [a, b, c] = [0, 1, 2].map(|k| skin.uv(t, k) * f64::from(side));
        let det = (b - a).perp_dot(c - a);
        let (low, high) = ((a.min(b).min(c) - 0.5).floor(), (a.max(b).max(c) - 0.5).ceil());
        let farthest = low.abs().max(high.abs()).max_element();
        // Also false for what is not a number.
        if farthest.is_nan()
            || farthest >= FARTHEST_TILE * f64::from(side)
            || det == 0.0
            || (high - low).max_element() > 2.0 * f64::from(side)
        {
            continue;
        }
        let size = high - low + 1.0;
        tries += (size.x * size.y) as usize;
        if tries > MOST_TRIES || tiles.len() > MOST_TILES {
            break;
        }
        for y in low.y as i32..=high.y as i32 {
            for x in low.x as i32..=high.x as i32 {
                let p = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
                let (second, third) = ((p - a).perp_dot(c - a) / det, (b - a).perp_dot(p - a) / det);
                if second.min(third).min(1.0 - second - third) > INSIDE {
                    let n = side as i32;
                    let tile = tiles.entry((x.div_euclid(n), y.div_euclid(n)));
                    let texels = tile.or_insert_with(|| vec![0; (side * side) as usize]);
                    let count = &mut texels[(y.rem_euclid(n) * n + x.rem_euclid(n)) as usize];
                    *count = count.saturating_add(1);
                }
            }
        }
    }
    let counted = |least: u8| tiles.values().flatten().filter(|n| **n >= least).count() as f64;
    counted(2) / counted(1).max(1.0)
}

/// The other triangle at each edge, where exactly two meet.
fn across_edges(skin: &Skin<'_>) -> Vec<[Option<(u32, u8)>; 3]> {
    let mut edges: HashMap<(u32, u32), Vec<(u32, u8)>> = HashMap::with_capacity(skin.triangles.len() * 2);
    for t in 0..skin.triangles.len() {
        for k in 0..3 {
            let (a, b) = (skin.point_index(t, k), skin.point_index(t, k + 1));
            edges.entry((a.min(b), a.max(b))).or_default().push((t as u32, k as u8));
        }
    }
    let mut across = vec![[None; 3]; skin.triangles.len()];
    for pair in edges.values() {
        if let [a, b] = pair[..]
            && a.0 != b.0
        {
            across[a.0 as usize][a.1 as usize] = Some(b);
            across[b.0 as usize][b.1 as usize] = Some(a);
        }
    }
    across
}

/// Disjoint sets.
struct Sets(Vec<u32>);

impl Sets {
    fn new(count: usize) -> Self {
        Self((0..count as u32).collect())
    }

    fn root(&mut self, i: usize) -> usize {
        let mut i = i;
        while self.0[i] as usize != i {
            self.0[i] = self.0[self.0[i] as usize];
            i = self.0[i] as usize;
        }
        i
    }

    fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.root(a), self.root(b));
        self.0[a.max(b)] = a.min(b) as u32;
    }

    /// Moves a single element to another set.
    fn join_into(&mut self, single: usize, other: usize) {
        if self.root(single) == single {
            let other = self.root(other);
            self.0[single] = other as u32;
        }
    }

    fn numbered(mut self) -> (Vec<u32>, usize) {
        let mut number = HashMap::new();
        let of = (0..self.0.len())
            .map(|i| {
                let root = self.root(i);
                let next = number.len() as u32;
                *number.entry(root).or_insert(next)
            })
            .collect();
        (of, number.len())
    }
}

/// An island in millimetres: a box of texture coordinates and how many millimetres their units have.
#[derive(Clone, Copy, Debug)]
struct Piece {
    low: DVec2,
    size_mm: DVec2,
    mm_per_unit: DVec2,
}

fn pieces(skin: &Skin<'_>, islands: &Islands) -> Vec<Piece> {
    let empty = (DVec2::INFINITY, DVec2::NEG_INFINITY, DVec2::ZERO, 0.0);
    let mut sums = vec![empty; islands.count];
    for t in 0..skin.triangles.len() {
        let (low, high, squares, area) = &mut sums[islands.of_triangle[t] as usize];
        for k in 0..3 {
            (*low, *high) = (low.min(skin.uv(t, k)), high.max(skin.uv(t, k)));
        }
        if let Some([u, v]) = skin.axes_mm(t) {
            // Weighted by area, but each triangle counts a little.
            let weight = skin.area_mm2(t).max(1e-9);
            // Triangles that are nearly lines in the texture would outweigh all others.
            *squares += weight * DVec2::new(u.length(), v.length());
            *area += weight;
        }
    }
    let piece = |(low, high, lengths, area): (DVec2, DVec2, DVec2, f64)| {
        let mut mm = if area > 0.0 { lengths / area } else { DVec2::ZERO };
        mm = mm.max(DVec2::splat(mm.max_element() / MOST_ASPECT)).max(DVec2::splat(1e-6));
        Piece { low, size_mm: (high - low) * mm, mm_per_unit: mm }
    };
    sums.into_iter().map(piece).collect()
}

/// A rectangle of texels: column and row of its corner, its size.
type Rectangle = [u32; 4];

/// Rectangles of the pieces in rows, tallest first; `None` if they do not fit.
fn pack(pieces: &[Piece], side: u32, mm_per_texel: f64, margin: u32) -> Option<Vec<Rectangle>> {
    let texels = |mm: f64| ((mm / mm_per_texel).ceil() as u32 + 1 + 2 * margin).next_multiple_of(ALIGNMENT);
    let mut order: Vec<usize> = (0..pieces.len()).collect();
    order.sort_by(|a, b| pieces[*b].size_mm.y.total_cmp(&pieces[*a].size_mm.y).then(a.cmp(b)));
    let mut rectangles = vec![[0; 4]; pieces.len()];
    let (mut x, mut y, mut row) = (0, 0, 0);
    for i in order {
        let piece = pieces[i];
        if piece.size_mm.max_element() / mm_per_texel > f64::from(side) {
            return None;
        }
        let [w, h] = [texels(piece.size_mm.x), texels(piece.size_mm.y)];
        if x + w > side {
            (x, y, row) = (0, y + row, 0);
        }
        if x + w > side || y + h > side {
            return None;
        }
        rectangles[i] = [x, y, w, h];
        x += w;
        row = row.max(h);
    }
    Some(rectangles)
}

impl Atlas {
    /// Lays out skin in `side` x `side` texels with margins as wide as a blur reaches, millimetres.
    ///
    /// # Errors
    /// There is no skin, it has no texture coordinates, or too many islands.
    pub fn new(skin: &Skin<'_>, side: u32, reach_mm: f64) -> Result<Self, AtlasError> {
        let islands = Islands::new(skin)?;
        let pieces = pieces(skin, &islands);
        let margin_of = |mm: f64| {
            ((reach_mm / mm).ceil() as u32).clamp(LEAST_MARGIN, (side / MOST_MARGIN).max(LEAST_MARGIN))
        };
        let fit = |mm: f64| pack(&pieces, side, mm, margin_of(mm));
        // Bisection for the finest texels that fit, on a logarithmic scale.
        let widest = pieces.iter().map(|p| p.size_mm.max_element()).fold(1e-6, f64::max);
        let (mut low, mut high) = ((widest / f64::from(side)).ln(), (widest / f64::from(side)).ln());
        while fit(high.exp()).is_none() {
            high += 0.5;
            if high > low + 12.0 {
                return Err(AtlasError::TooMany { islands: islands.count, side });
            }
        }
        for _ in 0..20 {
            let middle = 0.5 * (low + high);
            if fit(middle.exp()).is_some() { high = middle } else { low = middle }
        }
        let mm_per_texel = high.exp();
        let margin = margin_of(mm_per_texel);
        let Some(rectangles) = fit(mm_per_texel) else {
            return Err(AtlasError::TooMany { islands: islands.count, side });
        };
        let texel_from_uv: Vec<[f32; 4]> = (islands.of_triangle.iter())
            .map(|i| {
                let (piece, r) = (&pieces[*i as usize], rectangles[*i as usize]);
                let scale = piece.mm_per_unit / mm_per_texel;
                let place = DVec2::new(f64::from(r[0]), f64::from(r[1])) + f64::from(margin) + 0.5;
                let shift = place - piece.low * scale;
                [scale.x as f32, scale.y as f32, shift.x as f32, shift.y as f32]
            })
            .collect();
        let mut atlas = Self {
            mm_per_texel: mm_per_texel as f32,
            margin,
            islands: islands.count,
            texel_from_uv,
            ..Self::empty(side)
        };
        atlas.rasterise(skin, &islands);
        atlas.fill_margins(skin, &islands, &rectangles);
        Ok(atlas)
    }

    /// A layout without skin.
    pub fn empty(side: u32) -> Self {
        Self {
            side,
            mm_per_texel: 1.0,
            margin: LEAST_MARGIN,
            islands: 0,
            texel_from_uv: Vec::new(),
            places: vec![None; (side as usize).pow(2)],
            inside: 0,
            overlap: 0.0,
        }
    }

    /// Texel coordinates of a corner; texel (0, 0) has its middle at (0.5, 0.5).
    fn texel(&self, skin: &Skin<'_>, t: usize, corner: usize) -> DVec2 {
        let [sx, sy, x, y] = self.texel_from_uv[t].map(f64::from);
        skin.uv(t, corner) * DVec2::new(sx, sy) + DVec2::new(x, y)
    }

    /// Where a place of the texture lies in the layout, texels.
    pub fn texel_of(&self, triangle: u32, uv: Vec2) -> Vec2 {
        let [sx, sy, x, y] = self.texel_from_uv[triangle as usize];
        uv * Vec2::new(sx, sy) + Vec2::new(x, y)
    }

    fn rasterise(&mut self, skin: &Skin<'_>, islands: &Islands) {
        // A texel inside of two triangles of an island, and not on their edges, is covered twice.
        const INSIDE: f64 = 1e-3;
        let mut is_strict = vec![false; self.places.len()];
        let mut twice = 0usize;
        for t in (0..skin.triangles.len()).filter(|t| islands.winding[*t] != 0.0) {
            let corners = [0, 1, 2].map(|k| self.texel(skin, t, k));
            let [a, b, c] = corners;
            let det = (b - a).perp_dot(c - a);
            if det == 0.0 {
                continue;
            }
            let low = (a.min(b).min(c) - 0.5).floor().max(DVec2::ZERO);
            let high = (a.max(b).max(c) - 0.5).ceil().min(DVec2::splat(f64::from(self.side) - 1.0));
            for y in low.y as u32..=high.y as u32 {
                for x in low.x as u32..=high.x as u32 {
                    let p = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
                    let second = (p - a).perp_dot(c - a) / det;
                    let third = (b - a).perp_dot(p - a) / det;
                    let least = second.min(third).min(1.0 - second - third);
                    if least < -1e-9 {
                        continue;
                    }
                    let slot = (y * self.side + x) as usize;
                    let strict = least > INSIDE;
                    if self.places[slot].is_some() {
                        twice += usize::from(strict && is_strict[slot]);
                        if !strict || is_strict[slot] {
                            continue;
                        }
                    } else {
                        self.inside += 1;
                    }
                    is_strict[slot] = strict;
                    self.places[slot] = Some(place(t, [1.0 - second - third, second, third]));
                }
            }
        }
        self.overlap = twice as f64 / self.inside.max(1) as f64;
    }

    fn fill_margins(&mut self, skin: &Skin<'_>, islands: &Islands, rectangles: &[Rectangle]) {
        // The nearest edge of a border to each texel outside: square distance, triangle, edge.
        let mut nearest = vec![(f32::INFINITY, 0u32, 0u8); self.places.len()];
        let reach = f64::from(self.margin) + 1.0;
        for t in (0..skin.triangles.len()).filter(|t| islands.winding[*t] != 0.0) {
            let r = rectangles[islands.of_triangle[t] as usize];
            for k in (0..3).filter(|k| !islands.is_joined[t][*k]) {
                let (a, b) = (self.texel(skin, t, k), self.texel(skin, t, k + 1));
                let low = (a.min(b) - reach).max(DVec2::new(f64::from(r[0]), f64::from(r[1])));
                let high =
                    (a.max(b) + reach).min(DVec2::new(f64::from(r[0] + r[2]), f64::from(r[1] + r[3])) - 1.0);
                for y in low.y.ceil() as u32..=high.y.max(0.0) as u32 {
                    for x in low.x.ceil() as u32..=high.x.max(0.0) as u32 {
                        let slot = (y * self.side + x) as usize;
                        if self.places[slot].is_some() {
                            continue;
                        }
                        let p = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
                        let d = (p - along(a, b, p).1).length_squared() as f32;
                        if d < nearest[slot].0 && f64::from(d) <= reach * reach {
                            nearest[slot] = (d, t as u32, k as u8);
                        }
                    }
                }
            }
        }
        for (slot, (distance, t, k)) in nearest.into_iter().enumerate() {
            if distance == f32::INFINITY {
                continue;
            }
            let (t, k) = (t as usize, k as usize);
            let (x, y) = (slot as u32 % self.side, slot as u32 / self.side);
            let p = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
            let (share, from) = along(self.texel(skin, t, k), self.texel(skin, t, k + 1), p);
            let scale = DVec2::new(f64::from(self.texel_from_uv[t][0]), f64::from(self.texel_from_uv[t][1]));
            let uv = (p - from) / scale;
            let Some([u, v]) = skin.axes_mm(t) else { continue };
            // A triangle that is nearly a line in the texture says little about lengths beside it.
            let way = (uv.x * u + uv.y * v)
                .clamp_length_max(3.0 * f64::from(distance).sqrt() * f64::from(self.mm_per_texel));
            self.places[slot] = Some(walk(skin, islands, t, k, share, way));
        }
    }
}

fn place(triangle: usize, barycentric: [f64; 3]) -> Place {
    let b = barycentric.map(|b| b.clamp(0.0, 1.0));
    let sum: f64 = b.iter().sum();
    Place { triangle: triangle as u32, barycentric: b.map(|b| (b / sum) as f32) }
}

/// The nearest place to p on a segment: its share of the way from a to b, and itself.
fn along(a: DVec2, b: DVec2, p: DVec2) -> (f64, DVec2) {
    let way = b - a;
    let square = way.length_squared();
    let share = if square > 0.0 { ((p - a).dot(way) / square).clamp(0.0, 1.0) } else { 0.0 };
    (share, a + share * way)
}

/// The end of a straight walk over the surface: from a place of edge `k` of a triangle, out of it, by a vector in its
/// plane, millimetres.
fn walk(skin: &Skin<'_>, islands: &Islands, t: usize, k: usize, share: f64, way: DVec3) -> Place {
    let (mut t, mut k, mut share, mut way) = (t, k, share, way);
    let at = |k: usize, share: f64| {
        let mut b = [0.0; 3];
        b[k % 3] = 1.0 - share;
        b[(k + 1) % 3] = share;
        b
    };
    for _ in 0..MOST_CROSSINGS {
        let (a, b, apex) = (skin.point(t, k), skin.point(t, k + 1), skin.point(t, k + 2));
        let Some(edge) = (b - a).try_normalize() else { return place(t, at(k, share)) };
        let outwards = |apex: DVec3| -((apex - a) - edge * (apex - a).dot(edge)).normalize_or_zero();
        let (length, across) = (way.dot(edge), way.dot(outwards(apex)));
        let (next, entered, inwards) = match islands.across[t][k] {
            Some((other, e)) => {
                let (other, e) = (other as usize, e as usize);
                // Its corners are the same points in the other order, unless the winding changes.
                if skin.point_index(other, e) == skin.point_index(t, k + 1) {
                    share = 1.0 - share;
                }
                (other, e, -outwards(skin.point(other, e + 2)))
            }
            None => (t, k, -outwards(apex)),
        };
        way = length * edge + across.max(0.0) * inwards;
        (t, k) = (next, entered);

        // Change of barycentric coordinates along the way.
        let start = at(k, share);
        let origin = skin.point(t, 0);
        let (ab, ac) = (skin.point(t, 1) - origin, skin.point(t, 2) - origin);
        let (g11, g12, g22) = (ab.dot(ab), ab.dot(ac), ac.dot(ac));
        let det = g11 * g22 - g12 * g12;
        if det <= 1e-12 * g11 * g22 {
            return place(t, start);
        }
        let (w1, w2) = (way.dot(ab), way.dot(ac));
        let (second, third) = ((w1 * g22 - w2 * g12) / det, (w2 * g11 - w1 * g12) / det);
        let change = [-second - third, second, third];
        // The first other edge that the way meets.
        let exit = (0..3)
            .filter(|corner| *corner != (k + 2) % 3 && change[*corner] < -1e-15)
            .map(|corner| ((start[corner] / -change[corner]).max(0.0), corner))
            .min_by(|a, b| a.0.total_cmp(&b.0));
        let end = |s: f64| [0, 1, 2].map(|i| start[i] + s * change[i]);
        match exit {
            Some((s, corner)) if s < 1.0 => {
                let b = end(s);
                k = (corner + 1) % 3;
                let (from, to) = (b[k].max(0.0), b[(k + 1) % 3].max(0.0));
                share = if from + to > 0.0 { to / (from + to) } else { 0.0 };
                way *= 1.0 - s;
            }
            _ => return place(t, end(1.0)),
        }
    }
    place(t, at(k, share))
}

#[cfg(test)]
mod tests;
