//! A bounding volume hierarchy: whether a ray meets a triangle, which it meets first, and which triangle is nearest.
//!
//! Binary splits by the surface area heuristic (binned: I. Wald 2007), four children in a node (H. Dammertz, J. Hanika and A.
//! Keller 2008), so that four boxes or four triangles are tested at once. `assets-pipeline/examples/bvh_time.rs` has times.
//!
//! One tree serves all poses of a mesh: [`Bvh::posed`] keeps the splits and moves the boxes. A [`Subset`] of the triangles is
//! found in the same tree, for rays of which all else is known.

use glam::{BVec4A, Vec3, Vec4};

/// Triangles in a leaf, at most.
const LEAF: usize = 4;
/// Bins of centroids along each axis.
const BINS: usize = 16;
/// Bound of the inverse of a direction's component.
const MOST_INVERSE: f32 = 1e30;
/// Levels of nodes, at most: a tree that is deeper is made again with splits at medians, which has 15 for 2^32 triangles.
const MOST_LEVELS: usize = 21;
/// Nodes that wait to be looked at: three for each level and one.
const STACK: usize = 3 * MOST_LEVELS + 1;
/// Number of a triangle that is not there.
const NONE: u32 = u32::MAX;
/// Mark of a child that is a leaf; the other bits are its number.
const LEAF_BIT: u32 = 1 << 31;

/// A tree over triangles. Lengths are in any one unit.
#[derive(Clone)]
pub struct Bvh {
    nodes: Vec<Node>,
    leaves: Vec<Leaf>,
    /// Smallest and largest corner.
    bounds: (Vec3, Vec3),
}

/// Up to four children.
#[derive(Clone)]
struct Node {
    /// Smallest x, y, z and largest x, y, z of each child; those of a child that is not there are never entered.
    bounds: [Vec4; 6],
    /// Nodes, or leaves with [`LEAF_BIT`].
    children: [u32; 4],
}

/// Up to four triangles: a corner, the edges to the other two, and places in the list that the tree was made from.
#[derive(Clone)]
struct Leaf {
    corner: [Vec4; 3],
    edges: [[Vec4; 3]; 2],
    numbers: [u32; LEAF],
}

/// Triangles of a tree, as the nodes and leaves that hold some.
pub struct Subset {
    /// Bits of the children of each node.
    nodes: Vec<u8>,
    /// Bits of the triangles of each leaf.
    leaves: Vec<u8>,
}

/// Where a ray meets a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Meeting {
    /// Place of the triangle in the list that the tree was made from.
    pub triangle: u32,
    /// Lengths of the direction from the origin.
    pub distance: f32,
    /// Barycentric coordinates of the second and third corner.
    pub uv: [f32; 2],
}

/// A ray with what its tests share.
struct Ray {
    origin: [Vec4; 3],
    direction: [Vec4; 3],
    inverse: [Vec4; 3],
    /// Places in the bounds of a node of what the ray reaches first and last along each axis.
    sides: [[usize; 2]; 3],
    near: Vec4,
}

/// `a - b` of vectors whose components are apart.
fn minus(a: [Vec4; 3], b: [Vec4; 3]) -> [Vec4; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn dot(a: [Vec4; 3], b: [Vec4; 3]) -> Vec4 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [Vec4; 3], b: [Vec4; 3]) -> [Vec4; 3] {
    [a[1] * b[2] - b[1] * a[2], a[2] * b[0] - b[2] * a[0], a[0] * b[1] - b[0] * a[1]]
}

/// Bits of the lanes that are true.
fn bits(lanes: BVec4A) -> u32 {
    lanes.bitmask()
}

impl Ray {
    fn new(origin: Vec3, direction: Vec3, near: f32) -> Self {
        // A large number in place of an infinite one: times 0, of a ray in the plane of a face, it is no NaN.
        let inverse = direction.recip().clamp(Vec3::splat(-MOST_INVERSE), Vec3::splat(MOST_INVERSE));
        let lanes = |v: Vec3| v.to_array().map(Vec4::splat);
        let side = |axis: usize| if inverse[axis] < 0.0 { [axis + 3, axis] } else { [axis, axis + 3] };
        Self {
            origin: lanes(origin),
            direction: lanes(direction),
            inverse: lanes(inverse),
            sides: [side(0), side(1), side(2)],
            near: Vec4::splat(near),
        }
    }

    /// Distances at which it enters the children of a node, and bits of those that it enters before `far`.
    fn enters(&self, node: &Node, far: Vec4) -> (Vec4, u32) {
        let at = |axis: usize, end: usize| {
            (node.bounds[self.sides[axis][end]] - self.origin[axis]) * self.inverse[axis]
        };
        let enter = at(0, 0).max(at(1, 0)).max(at(2, 0).max(self.near));
        let leave = at(0, 1).min(at(1, 1)).min(at(2, 1).min(far));
        (enter, bits(enter.cmple(leave)))
    }

    /// Intersection with the triangles of a leaf from both sides before and at `far` (T. Möller and B. Trumbore 1997):
    /// distances, barycentric coordinates of second and third corners, and bits of the triangles that are met.
    fn meets(&self, leaf: &Leaf, far: Vec4) -> (Vec4, [Vec4; 2], u32) {
        let [e1, e2] = leaf.edges;
        let p = cross(self.direction, e2);
        let det = dot(e1, p);
        let s = minus(self.origin, leaf.corner).map(|s| s / det);
        let u = dot(s, p);
        let q = cross(s, e1);
        let v = dot(self.direction, q);
        let t = dot(e2, q);
        let zero = Vec4::ZERO;
        let inside = u.cmpge(zero) & v.cmpge(zero) & (u + v).cmple(Vec4::ONE);
        let met = inside & t.cmpgt(self.near) & t.cmple(far) & det.cmpne(zero);
        (t, [u, v], bits(met))
    }
}

/// A part of the tree before nodes have four children.
struct Binary {
    low: Vec3,
    high: Vec3,
    count: usize,
    /// Two children, or a range of the order of triangles.
    what: What,
}

enum What {
    Children([usize; 2]),
    Range([usize; 2]),
}

fn half_area(low: Vec3, high: Vec3) -> f32 {
    let d = high - low;
    d.x * d.y + d.y * d.z + d.z * d.x
}

/// How nodes are split.
#[derive(Clone, Copy, PartialEq)]
enum Split {
    ByArea,
    AtMedian,
}

/// Splits triangles into a binary tree.
struct Builder<'a> {
    triangles: &'a [[Vec3; 3]],
    centroids: Vec<Vec3>,
    order: Vec<u32>,
    nodes: Vec<Binary>,
    split: Split,
}

impl Builder<'_> {
    /// Makes the node of a range of the order; returns its number.
    fn node(&mut self, start: usize, end: usize) -> usize {
        let of = |i: &u32| &self.triangles[*i as usize];
        let (low, high) = self.order[start..end]
            .iter()
            .flat_map(of)
            .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), p| (low.min(*p), high.max(*p)));
        let number = self.nodes.len();
        self.nodes.push(Binary { low, high, count: end - start, what: What::Range([start, end]) });
        if end - start > LEAF {
            let middle = self.divide(start, end);
            let children = [self.node(start, middle), self.node(middle, end)];
            self.nodes[number].what = What::Children(children);
        }
        number
    }

    /// Orders a range so that its two parts are before and after the returned place.
    fn divide(&mut self, start: usize, end: usize) -> usize {
        let centroid = |i: &u32| self.centroids[*i as usize];
        let (low, high) = self.order[start..end]
            .iter()
            .map(centroid)
            .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), c| (low.min(c), high.max(c)));
        let found = if self.split == Split::ByArea { self.plane(start, end, low, high) } else { None };
        if let Some((axis, bin)) = found {
            let scale = bin_scale(low[axis], high[axis]);
            let is_before = |i: &u32| bin_of(self.centroids[*i as usize][axis], low[axis], scale) < bin;
            // Stable, so that the same list gives the same tree.
            let (before, after): (Vec<u32>, Vec<u32>) =
                self.order[start..end].iter().partition(|i| is_before(i));
            let middle = start + before.len();
            self.order[start..middle].copy_from_slice(&before);
            self.order[middle..end].copy_from_slice(&after);
            return middle;
        }
        let axis = (high - low).max_position();
        let middle = start.midpoint(end);
        let centroids = &self.centroids;
        let key = |i: &u32| centroids[*i as usize][axis];
        self.order[start..end]
            .select_nth_unstable_by(middle - start, |a, b| key(a).total_cmp(&key(b)).then(a.cmp(b)));
        middle
    }

    /// The axis and the bin before which to split, by the least expected number of triangle tests; `None` where all
    /// centroids share a bin.
    fn plane(&self, start: usize, end: usize, low: Vec3, high: Vec3) -> Option<(usize, usize)> {
        let mut best: Option<(f32, usize, usize)> = None;
        for axis in 0..3 {
            let scale = bin_scale(low[axis], high[axis]);
            if scale <= 0.0 {
                continue;
            }
            let mut bins = [(0_u32, Vec3::INFINITY, Vec3::NEG_INFINITY); BINS];
            for i in &self.order[start..end] {
                let (count, low_of, high_of) =
                    &mut bins[bin_of(self.centroids[*i as usize][axis], low[axis], scale)];
                *count += 1;
                for p in &self.triangles[*i as usize] {
                    (*low_of, *high_of) = (low_of.min(*p), high_of.max(*p));
                }
            }
            let join = |a: (u32, Vec3, Vec3), b: (u32, Vec3, Vec3)| (a.0 + b.0, a.1.min(b.1), a.2.max(b.2));
            // Of the bins before each plane, and then of those after it.
            let mut before = bins;
            (1..BINS).for_each(|k| before[k] = join(before[k - 1], bins[k]));
            let mut after = (0, Vec3::INFINITY, Vec3::NEG_INFINITY);
            for plane in (1..BINS).rev() {
                after = join(after, bins[plane]);
                let own = before[plane - 1];
                if own.0 == 0 || after.0 == 0 {
                    continue;
                }
                let cost =
                    own.0 as f32 * half_area(own.1, own.2) + after.0 as f32 * half_area(after.1, after.2);
                if best.is_none_or(|(least, ..)| cost < least) {
                    best = Some((cost, axis, plane));
                }
            }
        }
        best.map(|(_, axis, plane)| (axis, plane))
    }
}

/// Bins per unit of length; 0 where there is no extent.
fn bin_scale(low: f32, high: f32) -> f32 {
    let scale = BINS as f32 / (high - low);
    if scale.is_finite() { scale } else { 0.0 }
}

fn bin_of(centroid: f32, low: f32, scale: f32) -> usize {
    (((centroid - low) * scale) as usize).min(BINS - 1)
}

impl Bvh {
    /// The tree of triangles by their corners.
    pub fn new(triangles: Vec<[Vec3; 3]>) -> Self {
        let tree = Self::with_splits(&triangles, Split::ByArea);
        tree.or_else(|| Self::with_splits(&triangles, Split::AtMedian)).unwrap_or_else(Self::empty)
    }

    fn empty() -> Self {
        Self { nodes: Vec::new(), leaves: Vec::new(), bounds: (Vec3::INFINITY, Vec3::NEG_INFINITY) }
    }

    /// `None` if the tree gets too deep.
    fn with_splits(triangles: &[[Vec3; 3]], split: Split) -> Option<Self> {
        let mut tree = Self::empty();
        if triangles.is_empty() {
            return Some(tree);
        }
        let mut builder = Builder {
            triangles,
            centroids: triangles.iter().map(|[a, b, c]| *a + *b + *c).collect(),
            order: (0..triangles.len() as u32).collect(),
            nodes: Vec::new(),
            split,
        };
        builder.node(0, triangles.len());
        tree.bounds = (builder.nodes[0].low, builder.nodes[0].high);
        tree.widen(&builder, 0, 1)?;
        tree.set_corners(triangles);
        Some(tree)
    }

    /// Makes the node of a part of the binary tree; returns its number, `None` if it is too deep.
    fn widen(&mut self, from: &Builder<'_>, binary: usize, level: usize) -> Option<u32> {
        if level > MOST_LEVELS {
            return None;
        }
        // The child with the largest box is replaced by its children until there are four; of balanced trees that with
        // the most triangles.
        let mut parts = vec![binary];
        while parts.len() < 4 {
            let can_open = |k: &usize| matches!(from.nodes[parts[*k]].what, What::Children(_));
            let size = |k: usize| {
                let part = &from.nodes[parts[k]];
                if from.split == Split::ByArea { half_area(part.low, part.high) } else { part.count as f32 }
            };
            let widest =
                (0..parts.len()).filter(can_open).max_by(|a, b| size(*a).total_cmp(&size(*b)).then(b.cmp(a)));
            let Some(widest) = widest else { break };
            if let What::Children([a, b]) = from.nodes[parts[widest]].what {
                parts[widest] = a;
                parts.insert(widest + 1, b);
            }
        }
        let number = self.nodes.len();
        let never = |i: usize| if i < 3 { Vec4::INFINITY } else { Vec4::NEG_INFINITY };
        self.nodes.push(Node { bounds: std::array::from_fn(never), children: [NONE; 4] });
        for (k, part) in parts.into_iter().enumerate() {
            let child = match from.nodes[part].what {
                What::Children(_) => self.widen(from, part, level + 1)?,
                What::Range([start, end]) => {
                    let mut numbers = [NONE; LEAF];
                    numbers[..end - start].copy_from_slice(&from.order[start..end]);
                    self.leaves.push(Leaf { corner: [Vec4::ZERO; 3], edges: [[Vec4::ZERO; 3]; 2], numbers });
                    (self.leaves.len() - 1) as u32 | LEAF_BIT
                }
            };
            self.nodes[number].children[k] = child;
        }
        Some(number as u32)
    }

    /// The same tree with its triangles in other places: as right as a new one, and as fast while they moved little.
    pub fn posed(&self, triangles: &[[Vec3; 3]]) -> Self {
        let mut posed = self.clone();
        posed.set_corners(triangles);
        posed
    }

    /// Takes the corners of triangles, and makes the boxes fit them.
    fn set_corners(&mut self, triangles: &[[Vec3; 3]]) {
        let mut boxes = vec![(Vec3::INFINITY, Vec3::NEG_INFINITY); self.leaves.len()];
        for (leaf, bounds) in self.leaves.iter_mut().zip(&mut boxes) {
            for (lane, number) in leaf.numbers.iter().enumerate().filter(|(_, n)| **n != NONE) {
                let [a, b, c] = triangles[*number as usize];
                *bounds = [a, b, c].iter().fold(*bounds, |(low, high), p| (low.min(*p), high.max(*p)));
                for axis in 0..3 {
                    leaf.corner[axis][lane] = a[axis];
                    leaf.edges[0][axis][lane] = (b - a)[axis];
                    leaf.edges[1][axis][lane] = (c - a)[axis];
                }
            }
        }
        // Children follow their parents.
        let mut of_nodes = vec![(Vec3::INFINITY, Vec3::NEG_INFINITY); self.nodes.len()];
        for (number, node) in self.nodes.iter_mut().enumerate().rev() {
            for (lane, child) in node.children.iter().enumerate().filter(|(_, c)| **c != NONE) {
                let (low, high) = match child & LEAF_BIT {
                    0 => of_nodes[*child as usize],
                    _ => boxes[(child & !LEAF_BIT) as usize],
                };
                for axis in 0..3 {
                    node.bounds[axis][lane] = low[axis];
                    node.bounds[axis + 3][lane] = high[axis];
                }
                let (own_low, own_high) = of_nodes[number];
                of_nodes[number] = (own_low.min(low), own_high.max(high));
            }
        }
        self.bounds = of_nodes.first().copied().unwrap_or(self.bounds);
    }

    /// Smallest and largest corner; infinite the wrong way round without triangles.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        self.bounds
    }

    /// The triangles, by their places in the list that the tree was made from, for which `is_in` holds.
    pub fn subset(&self, is_in: impl Fn(u32) -> bool) -> Subset {
        let of_leaf = |leaf: &Leaf| -> u8 {
            let lanes = leaf.numbers.iter().enumerate();
            lanes.filter(|(_, n)| **n != NONE && is_in(**n)).map(|(lane, _)| 1 << lane).sum()
        };
        let leaves: Vec<u8> = self.leaves.iter().map(of_leaf).collect();
        let mut nodes = vec![0_u8; self.nodes.len()];
        for (number, node) in self.nodes.iter().enumerate().rev() {
            let holds = |child: u32| match child & LEAF_BIT {
                _ if child == NONE => false,
                0 => nodes[child as usize] != 0,
                _ => leaves[(child & !LEAF_BIT) as usize] != 0,
            };
            nodes[number] = (0..4).filter(|lane| holds(node.children[*lane])).map(|lane| 1 << lane).sum();
        }
        Subset { nodes, leaves }
    }

    /// True if the ray meets a triangle between the distances `near` and `far`.
    pub fn hit(&self, origin: Vec3, direction: Vec3, near: f32, far: f32) -> bool {
        self.any(origin, direction, near, far).is_some()
    }

    /// A triangle that the ray meets between the distances `near` and `far`, whichever is found first.
    pub fn any(&self, origin: Vec3, direction: Vec3, near: f32, far: f32) -> Option<u32> {
        self.search(origin, direction, near, far, |_| 0xF, |_| 0xF)
    }

    /// As [`Bvh::any`], among the triangles of a subset.
    pub fn any_of(&self, subset: &Subset, origin: Vec3, direction: Vec3, near: f32, far: f32) -> Option<u32> {
        let (nodes, leaves) = (&subset.nodes, &subset.leaves);
        self.search(origin, direction, near, far, |n| u32::from(nodes[n]), |l| u32::from(leaves[l]))
    }

    /// Looks at the children of nodes and the triangles of leaves whose bits are set.
    fn search(
        &self,
        origin: Vec3,
        direction: Vec3,
        near: f32,
        far: f32,
        children: impl Fn(usize) -> u32,
        triangles: impl Fn(usize) -> u32,
    ) -> Option<u32> {
        if self.nodes.is_empty() {
            return None;
        }
        let ray = Ray::new(origin, direction, near);
        let far = Vec4::splat(far);
        let mut stack = [0_u32; STACK];
        let mut depth = 1;
        while depth > 0 {
            depth -= 1;
            let index = stack[depth] as usize;
            let node = &self.nodes[index];
            let mut entered = ray.enters(node, far).1 & children(index);
            while entered != 0 {
                let child = node.children[entered.trailing_zeros() as usize];
                entered &= entered - 1;
                if child & LEAF_BIT == 0 {
                    stack[depth] = child;
                    depth += 1;
                    continue;
                }
                let leaf = (child & !LEAF_BIT) as usize;
                let (t, _, met) = ray.meets(&self.leaves[leaf], far);
                let met = met & triangles(leaf) & bits(t.cmplt(far));
                if met != 0 {
                    return Some(self.leaves[leaf].numbers[met.trailing_zeros() as usize]);
                }
            }
        }
        None
    }

    /// The first triangle that the ray meets between the distances `near` and `far`, from either side, but for `except`: the
    /// triangle that a ray starts on cannot be met again, which no distance says as well. Of several at the same distance it
    /// is the one that was listed first.
    pub fn first(
        &self,
        origin: Vec3,
        direction: Vec3,
        near: f32,
        far: f32,
        except: Option<u32>,
    ) -> Option<Meeting> {
        if self.nodes.is_empty() {
            return None;
        }
        let ray = Ray::new(origin, direction, near);
        let except = except.unwrap_or(NONE);
        let mut stack = [(0_u32, near); STACK];
        let (mut depth, mut far, mut found) = (1, far, None::<Meeting>);
        while depth > 0 {
            depth -= 1;
            let (child, enters) = stack[depth];
            if enters > far {
                continue;
            }
            if child & LEAF_BIT != 0 {
                let leaf = &self.leaves[(child & !LEAF_BIT) as usize];
                let (t, [u, v], mut met) = ray.meets(leaf, Vec4::splat(far));
                while met != 0 {
                    let lane = met.trailing_zeros() as usize;
                    met &= met - 1;
                    let (distance, triangle) = (t[lane], leaf.numbers[lane]);
                    let is_before =
                        distance < far || (distance == far && found.is_some_and(|f| triangle < f.triangle));
                    if is_before && triangle != except {
                        far = distance;
                        found = Some(Meeting { triangle, distance, uv: [u[lane], v[lane]] });
                    }
                }
                continue;
            }
            let node = &self.nodes[child as usize];
            let (enters, mut entered) = ray.enters(node, Vec4::splat(far));
            // The nearest child is taken first, so it is put down last.
            let bottom = depth;
            while entered != 0 {
                let lane = entered.trailing_zeros() as usize;
                entered &= entered - 1;
                let mut at = depth;
                while at > bottom && stack[at - 1].1 < enters[lane] {
                    stack[at] = stack[at - 1];
                    at -= 1;
                }
                stack[at] = (node.children[lane], enters[lane]);
                depth += 1;
            }
        }
        found
    }
}

/// Share by which a box counts as nearer than its distance: that of a triangle in it is rounded too.
const NEARER: f32 = 1.0 - 1e-5;

impl Bvh {
    /// Calls `distance` with triangles about a place, by their places in the list that the tree was made from, until no
    /// other can be nearer than the least distance that it returned.
    pub fn nearest(&self, place: Vec3, mut distance: impl FnMut(u32) -> f32) {
        if self.nodes.is_empty() {
            return;
        }
        let place = place.to_array().map(Vec4::splat);
        let mut stack = [(0_u32, 0.0_f32); STACK];
        let (mut depth, mut least) = (1, f32::INFINITY);
        while depth > 0 {
            depth -= 1;
            let (child, away) = stack[depth];
            if away > least {
                continue;
            }
            if child & LEAF_BIT != 0 {
                let leaf = &self.leaves[(child & !LEAF_BIT) as usize];
                for triangle in leaf.numbers.iter().filter(|n| **n != NONE) {
                    least = least.min(distance(*triangle));
                }
                continue;
            }
            let node = &self.nodes[child as usize];
            let off = |axis: usize| {
                let (low, high) = (node.bounds[axis] - place[axis], place[axis] - node.bounds[axis + 3]);
                let off = low.max(high).max(Vec4::ZERO);
                off * off
            };
            let sum = off(0) + off(1) + off(2);
            let away = sum.to_array().map(|square| NEARER * square.sqrt());
            // The nearest child is taken first, so it is put down last.
            let bottom = depth;
            for lane in (0..4).filter(|lane| node.children[*lane] != NONE && away[*lane] <= least) {
                let mut at = depth;
                while at > bottom && stack[at - 1].1 < away[lane] {
                    stack[at] = stack[at - 1];
                    at -= 1;
                }
                stack[at] = (node.children[lane], away[lane]);
                depth += 1;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::SplitMix64;

    /// Intersection of a ray with one triangle, from the equations of Möller and Trumbore.
    fn meets(origin: Vec3, direction: Vec3, near: f32, [a, b, c]: &[Vec3; 3]) -> Option<(f32, [f32; 2])> {
        let (e1, e2) = (*b - *a, *c - *a);
        let p = direction.cross(e2);
        let det = e1.dot(p);
        if det == 0.0 {
            return None;
        }
        let s = (origin - *a) / det;
        let q = s.cross(e1);
        let (u, v, t) = (s.dot(p), direction.dot(q), e2.dot(q));
        (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > near && t < 10.0).then_some((t, [u, v]))
    }

    #[test]
    fn agrees_with_testing_every_triangle() {
        let mut random = SplitMix64(1);
        let mut vector = |scale: f32| Vec3::from_array([0; 3].map(|_| random.uniform() as f32 - 0.5)) * scale;
        let triangles: Vec<[Vec3; 3]> = (0..400)
            .map(|_| {
                let center = vector(2.0);
                [0; 3].map(|_| center + vector(0.4))
            })
            .collect();
        let bvh = Bvh::new(triangles.clone());
        let mut found = 0;
        for _ in 0..500 {
            let (origin, direction) = (vector(3.0), vector(1.0).normalize_or(Vec3::X));
            let all = triangles.iter().zip(0..).filter_map(|(t, triangle)| {
                meets(origin, direction, 1e-4, t).map(|(distance, uv)| Meeting { triangle, distance, uv })
            });
            let expected = all.min_by(|a, b| a.distance.total_cmp(&b.distance));
            assert_eq!(bvh.hit(origin, direction, 1e-4, 10.0), expected.is_some());
            assert_eq!(bvh.first(origin, direction, 1e-4, 10.0, None), expected);
            if let Some(met) = expected {
                let next = bvh.first(origin, direction, 1e-4, 10.0, Some(met.triangle));
                assert!(next.is_none_or(|n| n.triangle != met.triangle && n.distance >= met.distance));
            }
            found += u32::from(expected.is_some());
        }
        assert!((50..450).contains(&found), "{found} hits make a poor test");
    }

    #[test]
    fn a_posed_tree_and_its_subsets_see_what_a_list_sees() {
        let mut random = SplitMix64(2);
        let mut vector = |scale: f32| Vec3::from_array([0; 3].map(|_| random.uniform() as f32 - 0.5)) * scale;
        let rest: Vec<[Vec3; 3]> = (0..300)
            .map(|_| {
                let center = vector(2.0);
                [0; 3].map(|_| center + vector(0.4))
            })
            .collect();
        let moved: Vec<[Vec3; 3]> = rest.iter().map(|t| t.map(|p| p + vector(0.5))).collect();
        let bvh = Bvh::new(rest).posed(&moved);
        let is_in = |i: u32| i.is_multiple_of(7);
        let subset = bvh.subset(is_in);
        let mut found = [0; 2];
        for _ in 0..500 {
            let (origin, direction) = (vector(3.0), vector(1.0).normalize_or(Vec3::X));
            let met = |i: u32| meets(origin, direction, 1e-4, &moved[i as usize]).is_some();
            let all = bvh.any(origin, direction, 1e-4, 10.0);
            assert_eq!(all.is_some(), (0..300).any(met));
            assert!(all.is_none_or(met));
            let some = bvh.any_of(&subset, origin, direction, 1e-4, 10.0);
            assert_eq!(some.is_some(), (0..300).filter(|i| is_in(*i)).any(met));
            assert!(some.is_none_or(|i| met(i) && is_in(i)));
            found[0] += u32::from(all.is_some());
            found[1] += u32::from(some.is_some());
        }
        assert!(found[0] > found[1] && found[1] > 20 && found[0] < 450, "{found:?} hits make a poor test");
        assert!(bvh.any_of(&bvh.subset(|_| false), Vec3::ZERO, Vec3::X, 0.0, 10.0).is_none());
    }

    #[test]
    fn of_triangles_at_one_place_the_first_in_the_list_is_met() {
        let one = [Vec3::ZERO, Vec3::X, Vec3::Y];
        for count in [1, 2, 9, 50] {
            let bvh = Bvh::new(vec![one; count]);
            let (origin, ray) = (Vec3::new(0.2, 0.2, 1.0), Vec3::NEG_Z);
            assert_eq!(bvh.first(origin, ray, 0.0, 2.0, None).map(|m| m.triangle), Some(0));
            let next = bvh.first(origin, ray, 0.0, 2.0, Some(0)).map(|m| m.triangle);
            assert_eq!(next, (count > 1).then_some(1));
            assert!(!bvh.hit(origin, ray, 0.0, 1.0), "the end is not part of the ray");
        }
    }

    #[test]
    fn a_tree_that_would_be_too_deep_is_balanced() {
        // Each triangle is a tenth of the one before, so every split takes one off.
        let triangles: Vec<[Vec3; 3]> = (0..34)
            .map(|i| {
                let size = 10.0_f32.powi(-i);
                [Vec3::splat(size), Vec3::new(size, 2.0 * size, size), Vec3::new(2.0 * size, size, size)]
            })
            .collect();
        for count in [34, 34 * 40] {
            let many: Vec<[Vec3; 3]> = triangles.iter().cycle().take(count).copied().collect();
            let bvh = Bvh::new(many);
            for t in &triangles[..20] {
                let middle = (t[0] + t[1] + t[2]) / 3.0;
                let far = (t[1] - t[0]).length();
                assert!(bvh.hit(middle + Vec3::Z * far, Vec3::NEG_Z, 0.0, 2.0 * far), "{middle}");
            }
        }
    }

    #[test]
    fn rays_in_the_plane_of_a_box_meet_what_is_in_it() {
        // Eight triangles around the axis of the ray: each of their boxes has the ray in a face.
        let fan = |i: u32| {
            let corner = |i: u32| {
                let (sin, cos) = (f32::from(i as u16) * std::f32::consts::FRAC_PI_4).sin_cos();
                Vec3::new((2.0 * cos).round() / 2.0, (2.0 * sin).round() / 2.0, 0.0)
            };
            [Vec3::new(0.0, 0.0, 0.5), corner(i), corner(i + 1)]
        };
        let bvh = Bvh::new((0..8).map(fan).collect());
        for direction in [Vec3::Z, Vec3::NEG_Z, Vec3::new(-0.0, 0.0, 1.0), Vec3::new(0.0, -0.0, -1.0)] {
            let origin = Vec3::new(0.0, 0.0, 0.5) - 2.0 * direction;
            assert!(bvh.hit(origin, direction, 0.0, 10.0), "{direction}");
            let met = bvh.first(origin, direction, 0.0, 10.0, None).expect("the tip of the fan");
            assert!((met.distance - 2.0).abs() < 1e-6);
        }
    }

    #[test]
    fn no_triangles_meet_nothing() {
        let none = Bvh::new(Vec::new());
        assert!(!none.hit(Vec3::ZERO, Vec3::X, 0.0, 1.0));
        assert_eq!(none.first(Vec3::ZERO, Vec3::X, 0.0, 1.0, None), None);
    }
}
