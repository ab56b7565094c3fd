//! The methods on the CPU, in f64 and from their equations; the reference of the parity tests.

use std::rc::Rc;

use half::f16;

use super::gather::Tap;
use super::gauss::{self, Level};

/// Where relative depths begin, mm.
pub(crate) const DEPTH_ORIGIN_MM: f64 = 400.0;
/// A sample this near to the tangent plane is on the same surface.
const PLANE_MM: f64 = 0.1;
/// A sample as near as a surface with a radius of 25 mm also is.
const CURVATURE_PER_MM: f64 = 0.02;
/// Relative depth of pixels that are not skin.
const FAR_MM: f64 = 8192.0;
/// Largest depth difference of pixels that one texel of a halved image averages, mm.
const ONE_SURFACE_MM: f64 = 4.0;

/// Share of a neighbour's light lost per millimetre off the tangent plane.
const FOLLOW_PER_MM: f64 = super::FOLLOW_PER_MM as f64;

/// Inputs of the methods. Depth is infinite where there is no skin.
#[derive(Clone)]
pub(crate) struct Frame {
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// Pixels per radian.
    pub(crate) focal_px: f64,
    pub(crate) color: Vec<[f64; 3]>,
    pub(crate) strength: Vec<f64>,
    pub(crate) depth_mm: Vec<f64>,
    /// For a halved image: the view, and the number of halvings.
    pub(crate) view: Option<(Rc<Frame>, u32)>,
}

/// The tangent plane of a pixel and the scale of its kernel.
struct Center {
    color: [f64; 3],
    relative_mm: f64,
    slope: [f64; 2],
    scale: [f64; 2],
}

impl Frame {
    fn index(&self, x: i64, y: i64) -> usize {
        let x = x.clamp(0, self.width as i64 - 1) as usize;
        let y = y.clamp(0, self.height as i64 - 1) as usize;
        y * self.width + x
    }

    /// Depth as rounded in the image of light.
    pub(crate) fn relative_mm(&self, i: usize) -> f64 {
        f16::from_f64((self.depth_mm[i] - DEPTH_ORIGIN_MM).clamp(-FAR_MM, FAR_MM)).to_f64()
    }

    fn per_mm(&self, i: usize) -> f64 {
        self.focal_px / self.depth_in_view(i).unwrap_or(self.depth_mm[i])
    }

    /// The view, and the position of the middle of a pixel in it.
    fn in_view(&self, x: i64, y: i64) -> (&Self, i64, i64) {
        match &self.view {
            None => (self, x, y),
            Some((view, level)) => {
                let middle = |at: i64| (at << level) + (1 << (level - 1));
                (view, middle(x), middle(y))
            }
        }
    }

    /// Depth for slopes, where the view shows the same surface as a halved image.
    fn depth_in_view(&self, i: usize) -> Option<f64> {
        let (view, x, y) = self.in_view((i % self.width) as i64, (i / self.width) as i64);
        let there = view.depth_mm[view.index(x, y)];
        (self.view.is_none() || (there - self.depth_mm[i]).abs() < ONE_SURFACE_MM).then_some(there)
    }

    fn is_sharp(&self, i: usize, visible_mm: f64) -> bool {
        self.strength[i] <= 0.0
            || self.relative_mm(i) >= 4000.0
            || self.strength[i] * self.per_mm(i) * visible_mm < 0.5
    }

    /// Depth change to the next pixel along an axis: the smaller of both sides, 0 where the surface breaks.
    fn slope(&self, x: i64, y: i64, axis: usize) -> f64 {
        let Some(here) = self.depth_in_view(self.index(x, y)) else { return 0.0 };
        let (view, x, y) = self.in_view(x, y);
        let (dx, dy) = if axis == 0 { (1, 0) } else { (0, 1) };
        let before = here - view.depth_mm[view.index(x - dx, y - dy)];
        let after = view.depth_mm[view.index(x + dx, y + dy)] - here;
        let slope = if before.abs() < after.abs() { before } else { after };
        if slope.abs() * view.focal_px / here > 4.0 {
            return 0.0;
        }
        // To the next pixel of this image.
        slope * view.focal_px / self.focal_px
    }

    fn center(&self, x: i64, y: i64) -> Center {
        let i = self.index(x, y);
        let slope = [self.slope(x, y, 0), self.slope(x, y, 1)];
        let per_mm = self.per_mm(i);
        let scale = slope.map(|s| self.strength[i] * per_mm / (1.0 + (s * per_mm).powi(2)).sqrt());
        Center { color: self.color[i], relative_mm: self.relative_mm(i), slope, scale }
    }

    /// Share of light at a relative depth that reaches the centre from an offset in pixels.
    fn arrives(center: &Center, relative_mm: f64, offset: [f64; 2]) -> f64 {
        let plane = center.relative_mm + center.slope[0] * offset[0] + center.slope[1] * offset[1];
        (1.0 - FOLLOW_PER_MM * (relative_mm - plane).abs()).clamp(0.0, 1.0)
    }

    fn map(&self, f: impl Fn(i64, i64) -> [f64; 3]) -> Self {
        let color = (0..self.width * self.height)
            .map(|i| f((i % self.width) as i64, (i / self.width) as i64))
            .collect();
        Self { color, ..self.clone() }
    }

    /// One direction of a kernel: taps on one side and their mirror images; light and depth are linear between pixels.
    /// Taps are `shift_px` farther out than they should be.
    pub(crate) fn line(&self, side: &[([f64; 3], f64)], visible_mm: f64, axis: usize, shift_px: f64) -> Self {
        self.map(|x, y| {
            let i = self.index(x, y);
            if self.is_sharp(i, visible_mm) {
                return self.color[i];
            }
            let center = self.center(x, y);
            let mut result = center.color;
            for (weight, offset_mm) in side {
                for sign in [-1.0, 1.0] {
                    let along = sign * (offset_mm * center.scale[axis] + shift_px);
                    let low = along.floor();
                    let [a, b] = [low, low + 1.0].map(|pixel| {
                        let step = pixel as i64;
                        if axis == 0 { self.index(x + step, y) } else { self.index(x, y + step) }
                    });
                    let between = |p: f64, q: f64| p + (along - low) * (q - p);
                    let depth = between(self.relative_mm(a), self.relative_mm(b));
                    let plane = center.relative_mm + center.slope[axis] * along;
                    let is_on_plane = self.view.is_none()
                        && (depth - plane).abs() <= PLANE_MM.max(CURVATURE_PER_MM * offset_mm * offset_mm);
                    let place = |pixel: f64| if axis == 0 { [pixel, 0.0] } else { [0.0, pixel] };
                    let texel = |i: usize, pixel: f64, c: usize| {
                        Self::arrives(&center, self.relative_mm(i), place(pixel))
                            * (self.color[i][c] - center.color[c])
                    };
                    for (c, r) in result.iter_mut().enumerate() {
                        *r += weight[c]
                            * if is_on_plane {
                                let light = between(self.color[a][c], self.color[b][c]);
                                Self::arrives(&center, depth, place(along)) * (light - center.color[c])
                            } else {
                                between(texel(a, low, c), texel(b, low + 1.0, c))
                            };
                    }
                }
            }
            result
        })
    }

    /// A weighted mean with another image, channel by channel.
    pub(crate) fn mix(&self, other: &Self, share: [f64; 3]) -> Self {
        self.map(|x, y| {
            let i = self.index(x, y);
            std::array::from_fn(|c| self.color[i][c] + share[c] * (other.color[i][c] - self.color[i][c]))
        })
    }

    /// An image of half the size: means over the nearest surface of 2 x 2 pixels, rounded to half floats.
    pub(crate) fn halved(self: &Rc<Self>) -> Self {
        let (view, level) = self.view.clone().map_or_else(|| (self.clone(), 1), |(v, l)| (v, l + 1));
        let round = |v: f64| f16::from_f64(v).to_f64();
        let (width, height) = (self.width.div_ceil(2), self.height.div_ceil(2));
        let mut half = Self {
            width,
            height,
            focal_px: 0.5 * self.focal_px,
            color: Vec::new(),
            strength: Vec::new(),
            depth_mm: Vec::new(),
            view: None,
        };
        for (x, y) in (0..width * height).map(|i| (i % width, i / width)) {
            let four: Vec<usize> = [(0, 0), (1, 0), (0, 1), (1, 1)]
                .map(|(dx, dy)| (2 * x + dx, 2 * y + dy))
                .into_iter()
                .filter(|(x, y)| *x < self.width && *y < self.height)
                .map(|(x, y)| y * self.width + x)
                .collect();
            let nearest = four.iter().map(|i| self.relative_mm(*i)).fold(f64::INFINITY, f64::min);
            let one: Vec<usize> =
                four.into_iter().filter(|i| self.relative_mm(*i) - nearest < ONE_SURFACE_MM).collect();
            let mean =
                |of: &dyn Fn(usize) -> f64| round(one.iter().map(|i| of(*i)).sum::<f64>() / one.len() as f64);
            half.color.push(std::array::from_fn(|c| mean(&|i| self.color[i][c])));
            let depth_mm = DEPTH_ORIGIN_MM + mean(&|i| self.relative_mm(i));
            half.depth_mm.push(if depth_mm < DEPTH_ORIGIN_MM + 4000.0 { depth_mm } else { f64::INFINITY });
            // The strongest of the four pixels of the view around the middle.
            let middle = |at: usize| ((at << level) + (1 << (level - 1))) as i64;
            let strongest = [(-1, -1), (0, -1), (-1, 0), (0, 0)]
                .map(|(dx, dy)| view.strength[view.index(middle(x) + dx, middle(y) + dy)])
                .into_iter()
                .fold(0.0, f64::max);
            half.strength.push(strongest);
        }
        half.view = Some((view, level));
        half
    }

    /// Blends the image of half the size into this one: bilinear, each of its texels by its own depth off one surface.
    pub(crate) fn with_coarser(
        &self,
        coarser: &Self,
        share: [f64; 3],
        visible_mm: f64,
        plane_mm: f64,
    ) -> Self {
        self.map(|x, y| {
            let i = self.index(x, y);
            let mut result = self.color[i];
            let here = self.relative_mm(i);
            let is_sharp = self.view.is_none() && self.strength[i] * self.per_mm(i) * visible_mm < 0.5;
            if here >= 4000.0 || is_sharp {
                return result;
            }
            let place = [x, y].map(|v| 0.5 * v as f64 - 0.25);
            let low = place.map(f64::floor);
            let texels: Vec<(usize, f64)> = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)]
                .into_iter()
                .map(|(dx, dy)| {
                    let at = [low[0] + dx, low[1] + dy];
                    let share = (1.0 - (place[0] - at[0]).abs()) * (1.0 - (place[1] - at[1]).abs());
                    (coarser.index(at[0] as i64, at[1] as i64), share)
                })
                .collect();
            let mean = |of: &dyn Fn(usize) -> f64| texels.iter().map(|(j, w)| w * of(*j)).sum::<f64>();
            let arrives = |depth: f64| (1.0 - FOLLOW_PER_MM * (depth - here).abs()).clamp(0.0, 1.0);
            let depth = mean(&|j| coarser.relative_mm(j));
            for (c, r) in result.iter_mut().enumerate() {
                let change = if (depth - here).abs() <= plane_mm {
                    arrives(depth) * (mean(&|j| coarser.color[j][c]) - self.color[i][c])
                } else {
                    mean(&|j| arrives(coarser.relative_mm(j)) * (coarser.color[j][c] - self.color[i][c]))
                };
                *r += share[c] * change;
            }
            result
        })
    }

    /// Every Gaussian of a plan, from the coarsest level up; taps are `shift_px` farther out and the plane between
    /// levels `unsure_mm` thicker than they should be.
    pub(crate) fn gaussians(&self, plan: &[Level], shift_px: f64, unsure_mm: f64) -> Self {
        let mut light = vec![Rc::new(self.clone())];
        for level in 1..plan.len() {
            light.push(Rc::new(light[level - 1].halved()));
        }
        let mut coarser: Option<Self> = None;
        for (level, light) in plan.iter().zip(&light).rev() {
            let (mut blurred, mut sum) = (Self::clone(light), Self::clone(light));
            for step in &level.steps {
                let (taps, width) = (gauss::taps(step.deviation_mm), step.reached_mm);
                blurred = blurred.line(&taps, width, 0, shift_px).line(&taps, width, 1, shift_px);
                sum = sum.mix(&blurred, step.share);
            }
            if let (Some(coarser), Some((share, visible_mm))) = (&coarser, level.coarser) {
                sum = sum.with_coarser(coarser, share, visible_mm, PLANE_MM + unsure_mm);
            }
            coarser = Some(sum);
        }
        coarser.unwrap_or_else(|| self.clone())
    }

    /// Fixed taps in millimetres, bilinear between pixels.
    pub(crate) fn jitter(&self, taps: &[Tap], visible_mm: f64) -> Self {
        self.map(|x, y| {
            let i = self.index(x, y);
            if self.is_sharp(i, visible_mm) {
                return self.color[i];
            }
            let center = self.center(x, y);
            let mut result = center.color;
            for tap in taps {
                let offset: [f64; 2] = std::array::from_fn(|a| f64::from(tap.place[a]) * center.scale[a]);
                for (cx, cy) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
                    let there = [offset[0].floor() + cx, offset[1].floor() + cy];
                    let share = (1.0 - (offset[0] - there[0]).abs()) * (1.0 - (offset[1] - there[1]).abs());
                    let j = self.index(x + there[0] as i64, y + there[1] as i64);
                    let k = share * Self::arrives(&center, self.relative_mm(j), there);
                    for (c, r) in result.iter_mut().enumerate() {
                        *r += f64::from(tap.weight[c]) * k * (self.color[j][c] - center.color[c]);
                    }
                }
            }
            result
        })
    }

    /// The 2D kernel: `light(x0, y0, x1, y1)` is the profile's light in a rectangle in mm.
    pub(crate) fn exact(&self, half_width_mm: f64, light: &dyn Fn(f64, f64, f64, f64) -> [f64; 3]) -> Self {
        self.map(|x, y| {
            let i = self.index(x, y);
            if self.is_sharp(i, half_width_mm) {
                return self.color[i];
            }
            let center = self.center(x, y);
            let reach = center.scale.map(|s| (half_width_mm * s).ceil() as i64);
            let mut result = center.color;
            for dy in -reach[1]..=reach[1] {
                for dx in -reach[0]..=reach[0] {
                    let offset = [dx as f64, dy as f64];
                    let edge = |a: usize, half: f64| (offset[a] + half) / center.scale[a];
                    let weight = light(edge(0, -0.5), edge(1, -0.5), edge(0, 0.5), edge(1, 0.5));
                    let j = self.index(x + dx, y + dy);
                    let k = Self::arrives(&center, self.relative_mm(j), offset);
                    for (c, r) in result.iter_mut().enumerate() {
                        *r += weight[c] * k * (self.color[j][c] - center.color[c]);
                    }
                }
            }
            result
        })
    }
}
