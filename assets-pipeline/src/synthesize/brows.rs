//! Hair baked into the maps: brows stroke by stroke, and the tint of shaven or cropped hair.

use glam::{Vec2, Vec3};

use super::Options;
use super::face_space::plan;
use super::lines::{Line, Lines};
use super::noise::{Stream, features, noise, smoothstep, unit};
use super::regions::{Regions, above_hairline, through};

/// Upper and lower border of the brow on the plan: (s, low, high), mm. The head of the brow is upright and soft, the
/// arch is highest at two thirds, the tail is thin.
const BROW: [[f32; 3]; 8] = [
    [9.5, 15.6, 24.2],
    [13.0, 16.4, 26.0],
    [20.0, 18.2, 27.4],
    [30.0, 20.2, 28.8],
    [40.0, 21.2, 28.6],
    [48.0, 20.2, 26.6],
    [56.0, 17.0, 21.8],
    [63.0, 13.4, 16.0],
];

/// One hair's look.
#[derive(Clone, Copy)]
struct Hair {
    half_width_mm: f32,
    opacity: f32,
}

/// The hair of a person.
pub(crate) struct Hairs {
    hairs: Vec<Hair>,
    lines: Lines,
    seed: u32,
    finest_mm: f32,
    stubble: f32,
    scalp: f32,
}

impl Hairs {
    pub(crate) fn new(options: &Options, texel_mm: f32) -> Self {
        let (mut hairs, mut lines) = (Vec::new(), Vec::new());
        for (hair, knots) in strokes(options, 430.0) {
            lines.push(Line::through(&knots, 1.0, 0.45_f32.max(1.2 * texel_mm)));
            hairs.push(hair);
        }
        Self {
            hairs,
            lines: Lines::new(lines, 1.5),
            seed: options.seed_bits() ^ 0xb202,
            finest_mm: texel_mm,
            stubble: options.stubble,
            scalp: options.scalp_hair,
        }
    }

    /// How much of the skin is hidden by hair, 0 to 1.
    pub(crate) fn cover(&self, place: Vec3, r: &Regions) -> f32 {
        let mut clear = 1.0;
        if place.z > 20.0 && (0.0..48.0).contains(&place.y) {
            self.lines.near(plan(place), |n| {
                let hair = self.hairs[n.line];
                let t = n.along_mm / self.lines.line(n.line).length_mm();
                // Hairs taper to their tips; one thinner than a texel covers part of it.
                let width = hair.half_width_mm * (1.0 - 0.75 * t * t);
                let drawn = width.max(0.6 * self.finest_mm);
                let profile = smoothstep(1.6 * drawn, 0.2 * drawn, n.distance_mm.abs());
                clear *= 1.0 - 0.8 * hair.opacity * (width / drawn).min(1.0) * profile;
            });
            clear *= 1.0 - 0.22 * brow_shadow(plan(place)) * f32::from(!self.hairs.is_empty());
        }
        let beard = self.stubble * r.beard;
        if beard > 0.01 {
            clear *= 1.0 - self.cropped(place, 0.95, 0.15, beard);
        }
        let scalp = self.scalp_density(place, r);
        if scalp > 0.01 {
            clear *= 1.0 - self.cropped_strokes(place, scalp);
        }
        1.0 - clear
    }

    /// Density of the scalp's hair, 0 to 1.
    fn scalp_density(&self, place: Vec3, r: &Regions) -> f32 {
        let line = above_hairline(plan(place));
        if line < -14.0 || self.scalp <= 0.0 {
            return 0.0;
        }
        // At forehead and temples the edge wanders and thins out over a centimetre, at the nape a little less;
        // before and behind the ear it is close.
        let soft = smoothstep(2.0, 34.0, place.y).max(0.7 * smoothstep(-40.0, -58.0, place.y));
        let wander = 1.7 * noise(place, 19.0, self.seed ^ 9)
            + 0.5 * noise(place, 5.0, self.seed ^ 16)
            + 0.3 * noise(place, 2.2, self.seed ^ 10);
        let height = line + (0.35 + 0.65 * soft) * wander;
        let edge = smoothstep(-2.5 - 4.0 * soft, 4.5 + 6.5 * soft, height);
        // Cut shorter towards the edge, as clippers leave it.
        let cut = 0.86 + 0.14 * smoothstep(3.0, 26.0, height);
        self.scalp * edge * cut * (1.0 - r.ear)
    }

    /// Short strokes that lie along the growth of the scalp's hair, dense where `density` is high.
    fn cropped_strokes(&self, place: Vec3, density: f32) -> f32 {
        // Hair grows from the crown forwards and down: the direction of steepest descent, wandering a little.
        let away = (place - Vec3::new(6.0, 104.0, -48.0)).normalize_or(Vec3::Z);
        let along = (away
            + 0.25 * Vec3::new(noise(place, 9.0, self.seed ^ 11), 0.0, noise(place, 9.0, self.seed ^ 12)))
        .normalize_or(Vec3::Z);
        // Space squeezed along the growth makes round features long: a stroke of 3 mm to a width of 0.25.
        let squeezed = |stretch: f32| place - along * along.dot(place) * (1.0 - 1.0 / stretch);
        let width_mm = 0.34f32.max(1.5 * self.finest_mm);
        let fine = noise(squeezed(7.0), width_mm, self.seed ^ 13);
        let coarse = noise(squeezed(5.0), 0.9, self.seed ^ 14);
        let tufts = noise(place, 6.0, self.seed ^ 15);
        let strokes = smoothstep(-1.0, 0.9, fine + 0.5 * coarse + 0.1 * tufts + 3.4 * (density - 0.55));
        // Skin shows unevenly through cropped hair: the visible share varies, not the hidden one, or dense hair would
        // have pale patches. Single hairs are drawn over it.
        let there = smoothstep(0.0, 0.5, density);
        let uneven = 1.0 + there * (0.16 * noise(place, 14.0, self.seed ^ 17) + 0.12 * tufts);
        let bare = (1.0 - density * density) * (1.0 - 0.45 * strokes * there) * uneven;
        1.0 - bare.clamp(0.04, 1.0)
    }

    /// Cut hairs as dots over a tint.
    fn cropped(&self, place: Vec3, spacing_mm: f32, radius_mm: f32, density: f32) -> f32 {
        let radius = radius_mm.max(0.55 * self.finest_mm) / spacing_mm;
        // A dot that is drawn larger than its hair covers as much as the hair.
        let faded = (radius_mm / spacing_mm / radius).powi(2);
        let mut dots = 0.0f32;
        features(place / spacing_mm, self.seed ^ 5, |h, d| {
            // Thinning hair is fewer hairs, not fainter ones.
            if unit(h) < 1.1 * density {
                dots = dots.max(smoothstep(1.5 * radius, 0.4 * radius, d.length()));
            }
        });
        // The tint of roots below the surface, and of hair behind hair where it is dense.
        let tint = 0.22 * density + 0.42 * density * density;
        (tint + (0.9 - tint) * dots * faded).min(0.97)
    }
}

/// 1 inside the brow, soft at its border.
fn brow_shadow(p: Vec2) -> f32 {
    let s = p.x.abs();
    let (low, high) = brow_borders(s);
    smoothstep(low - 1.5, low + 1.5, p.y)
        * smoothstep(high + 1.5, high - 1.5, p.y)
        * smoothstep(8.0, 13.0, s)
        * smoothstep(65.0, 58.0, s)
}

fn brow_borders(s: f32) -> (f32, f32) {
    let border = |k: usize| {
        let knots = BROW.map(|b| [b[0], b[k]]);
        through(&knots, s)
    };
    (border(1), border(2))
}

/// Courses on the plan of the hairs of both brows, `count` a brow of usual fullness.
pub(crate) fn brow_strokes(options: &Options, count: f32) -> Vec<[Vec2; 4]> {
    strokes(options, count).into_iter().map(|(_, knots)| knots).collect()
}

fn strokes(options: &Options, count: f32) -> Vec<(Hair, [Vec2; 4])> {
    let mut stream = Stream::new(options.seed_bits() ^ 0xb201);
    let mut all = Vec::new();
    for side in [1.0, -1.0] {
        // The two brows are alike, not equal.
        let lift = Vec2::new(0.5 * stream.normal(), 0.5 * stream.normal());
        for _ in 0..(count * options.brows) as usize {
            let (hair, knots) = brow_hair(&mut stream);
            all.push((hair, knots.map(|k| Vec2::new(side * (k.x + lift.x), k.y + lift.y))));
        }
    }
    all
}

/// A hair of the left brow: root, bend and tip on the plan.
fn brow_hair(stream: &mut Stream) -> (Hair, [Vec2; 4]) {
    // Denser in the body than in head and tail.
    let u = loop {
        let u = stream.range(0.0, 1.0);
        let (low, high) = brow_borders(BROW[0][0] + (BROW[7][0] - BROW[0][0]) * u);
        let density = smoothstep(-0.08, 0.22, u) * smoothstep(1.1, 0.8, u) * ((high - low) / 8.5).min(1.0);
        if stream.range(0.0, 1.0) < density {
            break u;
        }
    };
    let s = BROW[0][0] + (BROW[7][0] - BROW[0][0]) * u;
    let (low, high) = brow_borders(s);
    // Roots crowd about the middle of the band.
    let v = (0.5 + 0.24 * stream.normal()).clamp(-0.12, 1.12);
    let root = Vec2::new(s, low + (high - low) * v);
    // Hairs of the head stand up; further out the lower ones rise, the upper ones fall, and they meet in a crest.
    let (next_low, next_high) = brow_borders(s + 1.0);
    let along = (0.5 * (next_low + next_high - low - high)).atan2(1.0).to_degrees();
    let upright = smoothstep(0.26, 0.0, u);
    let converge = 30.0 * (0.6 - v) * smoothstep(0.9, 0.5, u);
    let angle =
        along + converge + upright * (62.0 - along) + 8.0 * smoothstep(0.5, 0.2, u) + 9.0 * stream.normal();
    let length = (7.4 - 2.6 * upright - 3.0 * smoothstep(0.6, 1.0, u)) * (1.0 + 0.16 * stream.normal());
    // Hairs lie over as they leave the root.
    let curl = -9.0 - 10.0 * upright * stream.range(0.3, 1.0) + 5.0 * stream.normal();
    let mut knots = [root; 4];
    let mut heading = angle;
    for i in 1..4 {
        let (sin, cos) = heading.to_radians().sin_cos();
        knots[i] = knots[i - 1] + Vec2::new(cos, sin) * (length / 3.0);
        heading += curl;
    }
    let edge = (2.0 * (v - 0.5).abs()).min(1.2);
    let hair = Hair {
        half_width_mm: 0.085 * stream.range(0.7, 1.25) * (1.0 - 0.25 * edge),
        opacity: stream.range(0.55, 0.95) * (1.0 - 0.35 * upright) * (1.0 - 0.25 * edge),
    };
    (hair, knots)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scalp(x: f32, y: f32, z: f32) -> f32 {
        let hairs = Hairs::new(&Options { scalp_hair: 0.95, ..Options::default() }, 0.2);
        let place = Vec3::new(x, y, z);
        let [left, right] = [1.0, -1.0].map(|side| {
            let place = place * Vec3::new(side, 1.0, 1.0);
            hairs.scalp_density(place, &Regions::at(place))
        });
        assert!((left - right).abs() < 0.6, "{place}: {left} and {right}");
        left.min(right)
    }

    #[test]
    fn the_ear_is_bald_and_hair_is_close_about_it() {
        // Helix, anthelix, concha, lobe, tragus and where the helix leaves the head.
        for (x, y, z) in [
            (88.0, -1.5, -20.0),
            (90.0, -12.0, -32.0),
            (91.0, -24.0, -35.0),
            (86.0, -15.0, -24.0),
            (75.0, -28.0, -16.0),
            (83.0, -47.0, -13.0),
            (76.0, -28.0, -6.0),
            (79.0, -6.0, -8.0),
            (81.0, -10.0, -9.0),
        ] {
            assert!(scalp(x, y, z) < 0.02, "hair on the ear at {x} {y} {z}");
        }
        // Above it, behind it, and before it: the sideburn.
        for (x, y, z) in [(79.0, 9.0, -20.0), (76.0, -8.0, -46.0), (74.0, -25.0, -52.0), (75.0, -12.0, 11.0)]
        {
            assert!(scalp(x, y, z) > 0.55, "no hair about the ear at {x} {y} {z}: {}", scalp(x, y, z));
        }
    }

    #[test]
    fn the_sideburn_ends_at_the_middle_of_the_ear() {
        assert!(scalp(75.0, -19.0, 11.0) > 0.5);
        for (x, y, z, place) in [
            (75.0, -34.0, 11.0, "below"),
            (73.0, -12.0, 27.0, "on the cheek before"),
            (76.0, -20.0, -1.0, "between it and the tragus"),
        ] {
            assert!(scalp(x, y, z) < 0.05, "{place}: {}", scalp(x, y, z));
        }
    }
}
