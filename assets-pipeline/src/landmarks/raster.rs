//! Depth pictures of triangles, seen along -z by an orthographic camera.

use glam::{Vec2, Vec3};

/// Pixels that are tried for all triangles together: a face is covered a few times, a picture of a thousand times a
/// thousand pixels a thousand times. What is beyond is not drawn, so that time is bounded.
const MOST_TRIES: usize = 1 << 30;
/// No triangle covers the pixel.
const NONE: u32 = u32::MAX;

/// Where a picture looks: x and y of its lower left corner, the side of a pixel, and its extent.
#[derive(Clone, Copy, Debug)]
pub(super) struct Window {
    pub low: Vec2,
    pub pixel: f32,
    pub width: usize,
    pub height: usize,
}

impl Window {
    /// A window of whole pixels that covers a box.
    pub(super) fn covering(low: Vec2, high: Vec2, pixel: f32) -> Self {
        let extent = ((high - low) / pixel).ceil().max(Vec2::ONE);
        Self { low, pixel, width: extent.x as usize, height: extent.y as usize }
    }

    /// Pixel coordinates of a place: whole numbers are centres of pixels; rows grow upwards.
    pub(super) fn at(&self, p: Vec2) -> Vec2 {
        (p - self.low) / self.pixel - 0.5
    }

    /// Place of the centre of a pixel.
    pub(super) fn center(&self, x: usize, y: usize) -> Vec2 {
        self.low + (Vec2::new(x as f32, y as f32) + 0.5) * self.pixel
    }

    /// Index of the pixel that holds a place.
    pub(super) fn index(&self, p: Vec2) -> Option<usize> {
        let at = ((p - self.low) / self.pixel).floor();
        let inside = at.x >= 0.0 && at.y >= 0.0 && at.x < self.width as f32 && at.y < self.height as f32;
        inside.then(|| at.y as usize * self.width + at.x as usize)
    }
}

/// The nearest triangle (greatest z) of each pixel.
pub(super) struct Depth {
    pub window: Window,
    /// z of the surface at the centre of each pixel; `f32::MIN` where there is none. Rows from the bottom.
    pub z: Vec<f32>,
    triangles: Vec<u32>,
}

impl Depth {
    /// Draws triangles given by their corners. Triangles seen from behind hide what is behind them too.
    pub(super) fn draw(window: Window, triangles: impl IntoIterator<Item = [Vec3; 3]>) -> Self {
        let count = window.width * window.height;
        let mut depth = Self { window, z: vec![f32::MIN; count], triangles: vec![NONE; count] };
        let mut tries = 0;
        for (index, corners) in triangles.into_iter().enumerate() {
            if tries >= MOST_TRIES {
                break;
            }
            tries += depth.triangle(index as u32, corners);
        }
        depth
    }

    /// Draws a triangle; returns how many pixels were tried.
    fn triangle(&mut self, index: u32, corners: [Vec3; 3]) -> usize {
        let [a, b, c] = corners.map(|p| self.window.at(p.truncate()).extend(p.z));
        let area = (b - a).truncate().perp_dot((c - a).truncate());
        if area.abs() < 1e-9 || !area.is_finite() {
            return 0;
        }
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        let (width, height) = (self.window.width as f32, self.window.height as f32);
        if high.x < 0.0 || high.y < 0.0 || low.x > width - 1.0 || low.y > height - 1.0 {
            return 0;
        }
        let (x0, x1) = (low.x.ceil().max(0.0) as usize, high.x.floor().min(width - 1.0) as usize);
        let (y0, y1) = (low.y.ceil().max(0.0) as usize, high.y.floor().min(height - 1.0) as usize);
        let inverse = 1.0 / area;
        for y in y0..=y1 {
            for x in x0..=x1 {
                let p = Vec2::new(x as f32, y as f32);
                let wb = (p - a.truncate()).perp_dot((c - a).truncate()) * inverse;
                let wc = (b - a).truncate().perp_dot(p - a.truncate()) * inverse;
                if wb < -1e-5 || wc < -1e-5 || wb + wc > 1.00001 {
                    continue;
                }
                let z = a.z + wb * (b.z - a.z) + wc * (c.z - a.z);
                let at = y * self.window.width + x;
                if z > self.z[at] {
                    self.z[at] = z;
                    self.triangles[at] = index;
                }
            }
        }
        (x1 + 1).saturating_sub(x0) * (y1 + 1).saturating_sub(y0)
    }

    /// The triangle that a pixel shows.
    pub(super) fn triangle_at(&self, index: usize) -> Option<u32> {
        Some(self.triangles[index]).filter(|t| *t != NONE)
    }

    /// Whether a pixel shows anything.
    pub(super) fn covers(&self, index: usize) -> bool {
        self.triangles[index] != NONE
    }

    /// The place that a pixel shows.
    pub(super) fn place(&self, index: usize) -> Vec3 {
        self.window.center(index % self.window.width, index / self.window.width).extend(self.z[index])
    }

    /// What [`Depth::relief`] is computed from, for any radius.
    pub(super) fn sums(&self) -> DepthSums {
        let (width, height) = (self.window.width, self.window.height);
        let sums = |value: &dyn Fn(usize) -> f64| {
            Sums::new(width, height, |i| if self.covers(i) { value(i) } else { 0.0 })
        };
        DepthSums {
            depth: sums(&|i| f64::from(self.z[i])),
            counts: sums(&|_| 1.0),
            along_x: sums(&|i| (i % width) as f64),
            along_y: sums(&|i| (i / width) as f64),
        }
    }

    /// Depth over its mean in a square of `2 radius + 1` pixels: 0 on planes, positive on ridges.
    pub(super) fn relief(&self, sums: &DepthSums, radius: usize) -> Vec<f32> {
        let (width, height) = (self.window.width, self.window.height);
        let covered: Vec<bool> = self.triangles.iter().map(|t| *t != NONE).collect();
        // Of a plane at an angle that the square sees only in part, the mean is off: its middle goes with it.
        let DepthSums { depth: sums, counts, along_x, along_y } = sums;
        let mut relief = vec![0.0; width * height];
        for i in (0..relief.len()).filter(|i| covered[*i]) {
            let (x, y) = (i % width, i / width);
            let count = counts.around(x, y, radius).max(1.0);
            let mean = |sums: &Sums| sums.around(x, y, radius) / count;
            let off = Vec2::new(mean(along_x) as f32 - x as f32, mean(along_y) as f32 - y as f32);
            let slope = |step: usize, at: usize, last: usize| {
                let before = if at > 0 && covered[i - step] { i - step } else { i };
                let after = if at < last && covered[i + step] { i + step } else { i };
                let steps = ((after - before) / step).max(1);
                (self.z[after] - self.z[before]) / steps as f32
            };
            let tilt = if off.length() > 1e-3 {
                slope(1, x, width - 1) * off.x + slope(width, y, height - 1) * off.y
            } else {
                0.0
            };
            relief[i] = self.z[i] + tilt - mean(sums) as f32;
        }
        relief
    }
}

/// Sums over rectangles of a picture of depth.
pub(super) struct DepthSums {
    depth: Sums,
    counts: Sums,
    along_x: Sums,
    along_y: Sums,
}

/// Sums over rectangles (F. Crow 1984).
struct Sums {
    width: usize,
    height: usize,
    table: Vec<f64>,
}

impl Sums {
    fn new(width: usize, height: usize, value: impl Fn(usize) -> f64) -> Self {
        let mut table = vec![0.0; (width + 1) * (height + 1)];
        for y in 0..height {
            let mut row = 0.0;
            for x in 0..width {
                row += value(y * width + x);
                table[(y + 1) * (width + 1) + x + 1] = table[y * (width + 1) + x + 1] + row;
            }
        }
        Self { width, height, table }
    }

    fn around(&self, x: usize, y: usize, radius: usize) -> f64 {
        let (x0, y0) = (x.saturating_sub(radius), y.saturating_sub(radius));
        let (x1, y1) = ((x + radius + 1).min(self.width), (y + radius + 1).min(self.height));
        let at = |x: usize, y: usize| self.table[y * (self.width + 1) + x];
        at(x1, y1) - at(x0, y1) - at(x1, y0) + at(x0, y0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square from -1 to 1 on z = f(x, y).
    fn sheet(f: impl Fn(f32, f32) -> f32) -> Depth {
        let p = |x: f32, y: f32| Vec3::new(x, y, f(x, y));
        let at = |i: i32| i as f32 / 20.0 - 1.0;
        let triangles = (0..40).flat_map(|i| (0..40).map(move |j| (i, j))).flat_map(|(i, j)| {
            let (a, b) = (p(at(i), at(j)), p(at(i + 1), at(j)));
            let (c, d) = (p(at(i), at(j + 1)), p(at(i + 1), at(j + 1)));
            [[a, b, d], [a, d, c]]
        });
        Depth::draw(Window::covering(Vec2::splat(-1.5), Vec2::splat(1.5), 0.05), triangles)
    }

    #[test]
    fn pixels_show_the_nearest_surface_at_their_centres() {
        let depth = sheet(|x, y| 0.3 * x - 0.1 * y);
        let inside = depth.window.index(Vec2::new(0.31, -0.4)).unwrap();
        let place = depth.place(inside);
        assert!((place.z - (0.3 * place.x - 0.1 * place.y)).abs() < 1e-5, "{place}");
        assert!(depth.triangle_at(depth.window.index(Vec2::new(1.2, 0.0)).unwrap()).is_none());
        assert!(depth.window.index(Vec2::new(1.6, 0.0)).is_none());
        let far = [Vec3::new(-1.0, -1.0, 0.0), Vec3::new(1.0, -1.0, 0.0), Vec3::new(0.0, 1.0, 0.0)];
        let both = Depth::draw(depth.window, [far, far.map(|p| p + Vec3::Z)]);
        assert_eq!(both.triangle_at(both.window.index(Vec2::ZERO).unwrap()), Some(1));
    }

    #[test]
    fn relief_is_what_stands_out_of_a_slope() {
        let slope = sheet(|x, y| 0.5 * x + 0.2 * y);
        assert!(
            slope.relief(&slope.sums(), 6).iter().all(|r| r.abs() < 1e-3),
            "a tilted plane is flat up to its border"
        );
        let ridge = sheet(|x, _| 0.3 * (-x * x / 0.01).exp());
        let relief = ridge.relief(&ridge.sums(), 6);
        let at = |x: f32| relief[ridge.window.index(Vec2::new(x, 0.0)).unwrap()];
        assert!(at(0.0) > 0.1 && at(0.25) < -0.02 && at(0.8).abs() < 1e-3);
    }
}
