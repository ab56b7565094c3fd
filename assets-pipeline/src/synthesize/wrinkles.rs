//! Expression wrinkles: grooves along lines that follow the anatomy, and the zones in which they appear together.
//!
//! Lines are drawn on the plan of the canonical face, wavy, broken and slightly different on the two sides. A groove
//! has the depth profile of folded skin: narrow at the bottom, with a soft roll on either side of unequal height.

use glam::{Vec2, Vec3};

use super::face_space::{plan, plan_gradient};
use super::lines::{Line, Lines};
use super::noise::{Stream, features, gradient_noise, hash, noise, smoothstep, unit};
use super::regions::{above_hairline, eye_distance, through};

/// Zones in the order of their masks. `left` is the character's.
pub(crate) const ZONES: [&str; 12] = [
    "forehead-outer-right",
    "forehead-outer-left",
    "forehead-inner-right",
    "forehead-inner-left",
    "nose-right",
    "nose-left",
    "glabella",
    "chin",
    "crow-feet-left",
    "crow-feet-right",
    "nasolabial-left",
    "nasolabial-right",
];

/// Step of the finite differences, mm: well under the width of the finest groove.
const STEP_MM: f32 = 0.12;

/// Most that one side of the forehead is made shallower and the other deeper.
const MAX_BALANCE: f32 = 0.4;

/// Course of the nasolabial fold on the left, plan mm: from the wing of the nose past the corner of the mouth.
const NASOLABIAL: [[f32; 2]; 6] =
    [[16.5, -36.5], [20.5, -43.5], [24.8, -51.5], [28.6, -60.5], [30.8, -70.0], [31.0, -80.0]];

/// Profile of one groove.
#[derive(Clone, Copy)]
struct Groove {
    depth_mm: f32,
    /// Half width at 1/e of the depth, mm.
    half_width_mm: f32,
    /// Height of the rolls beside it relative to its depth, on the left and on the right of its direction.
    roll: [f32; 2],
    phase: u32,
    /// Shares of its length over which it fades in and out.
    taper: [f32; 2],
}

/// All wrinkles of a person.
pub(crate) struct Wrinkles {
    grooves: Vec<Groove>,
    lines: Lines,
    seed: u32,
    /// Factor of the forehead's left side over the mean of both, less 1: its rows break at random places.
    forehead_balance: f32,
}

/// Collects grooves while they are drawn.
struct Pen {
    stream: Stream,
    grooves: Vec<Groove>,
    lines: Vec<Line>,
}

impl Pen {
    fn draw(&mut self, knots: &[Vec2], depth_mm: f32, half_width_mm: f32, roll: [f32; 2]) {
        let phase = (self.stream.range(0.0, 1.0) * 65536.0) as u32;
        let vary = self.stream.range(0.85, 1.15);
        let taper = [0.32; 2];
        self.grooves.push(Groove { depth_mm: depth_mm * vary, half_width_mm, roll, phase, taper });
        // The reach has room for the wander of `height_on_plan` and the steps of the gradient.
        self.lines.push(Line::through(knots, 1.5, 5.0 * half_width_mm + 2.5));
    }

    /// A value a few percent off.
    fn about(&mut self, value: f32, spread: f32) -> f32 {
        value + spread * self.stream.normal()
    }
}

impl Wrinkles {
    /// The wrinkles of a seed. `forehead_top_mm` is the plan height that forehead lines stay under.
    pub(crate) fn new(seed: u32) -> Self {
        let mut pen = Pen { stream: Stream::new(seed ^ 0x77_1c), grooves: Vec::new(), lines: Vec::new() };
        forehead(&mut pen);
        glabella(&mut pen);
        for side in [1.0, -1.0] {
            nose(&mut pen, side);
            crow_feet(&mut pen, side);
            nasolabial(&mut pen, side);
        }
        mentolabial(&mut pen);
        let lines = Lines::new(pen.lines, 3.0);
        let mut wrinkles = Self { grooves: pen.grooves, lines, seed, forehead_balance: 0.0 };
        // Two rounds: the sides blend into each other about the middle.
        for _ in 0..2 {
            let [left, right] = wrinkles.forehead_strength();
            let sum = left + right;
            if sum > 0.0 {
                wrinkles.forehead_balance =
                    (wrinkles.forehead_balance + (right - left) / sum).clamp(-MAX_BALANCE, MAX_BALANCE);
            }
        }
        wrinkles
    }

    /// Root mean square height of the forehead's left and right side, mm.
    fn forehead_strength(&self) -> [f32; 2] {
        [1.0, -1.0].map(|side| {
            let (mut sum, mut count) = (0.0f32, 0.0f32);
            for i in 0..44 {
                for j in 0..40 {
                    let p = Vec2::new(side * (3.0 + 1.05 * i as f32), 33.0 + 0.85 * j as f32);
                    sum += self.height_on_plan(p).powi(2);
                    count += 1.0;
                }
            }
            (sum / count).sqrt()
        })
    }

    /// Height of the wrinkled skin over the smooth one at full strength, mm.
    #[cfg(test)]
    pub(crate) fn height_mm(&self, place: Vec3) -> f32 {
        self.height_on_plan(plan(place))
    }

    fn height_on_plan(&self, p: Vec2) -> f32 {
        // Skin folds along its weak lines, never along a ruler.
        let at = p.extend(0.0);
        let wave = |wavelength: f32, seed| noise(at, wavelength, self.seed ^ seed);
        let wander =
            Vec2::new(wave(9.0, 1), wave(9.0, 2)) * 0.34 + Vec2::new(wave(3.1, 3), wave(3.1, 4)) * 0.06;
        let mut height = 0.0;
        self.lines.near(p + wander, |n| {
            let groove = &self.grooves[n.line];
            let length = self.lines.line(n.line).length_mm();
            height += groove.height_mm(n.distance_mm, n.along_mm, length, self.seed);
        });
        if p.y > 28.0 {
            let share = smoothstep(28.0, 33.0, p.y) * (2.0 * smoothstep(-18.0, 18.0, p.x) - 1.0);
            height *= 1.0 + self.forehead_balance * share;
        }
        height + self.chin_dimples_mm(p)
    }

    /// Gradient of the height (mm) of the wrinkled skin over the smooth one at full strength, in canonical space.
    pub(crate) fn gradient(&self, place: Vec3) -> Vec3 {
        let p = plan(place);
        if self.lines.is_empty_about(p) && chin_weight(p) <= 0.0 {
            return Vec3::ZERO;
        }
        let h = |d: Vec2| self.height_on_plan(p + d);
        let difference = Vec2::new(
            h(Vec2::new(STEP_MM, 0.0)) - h(Vec2::new(-STEP_MM, 0.0)),
            h(Vec2::new(0.0, STEP_MM)) - h(Vec2::new(0.0, -STEP_MM)),
        );
        plan_gradient(place, difference / (2.0 * STEP_MM))
    }

    /// True where there can be wrinkles at all: the front of the face.
    pub(crate) fn reach(place: Vec3) -> bool {
        place.z > 5.0 && place.y > -135.0 && place.y < 100.0
    }

    /// Pits of the tensed mentalis muscle: an orange-peel pattern on the chin.
    fn chin_dimples_mm(&self, p: Vec2) -> f32 {
        let area = chin_weight(p);
        if area <= 0.0 {
            return 0.0;
        }
        const SPACING_MM: f32 = 4.6;
        let q = p.extend(0.0) / SPACING_MM;
        let mut height = 0.0;
        features(Vec3::new(q.x, q.y, 0.5), self.seed ^ 0xc41, |h, d| {
            let r2 = d.x * d.x + d.y * d.y;
            let radius = 0.42 + 0.25 * unit(h);
            let t = (1.0 - r2 / (radius * radius * 2.2)).max(0.0);
            // One of the three layers of cells carries pits; the others would only double them.
            if d.z.abs() < 0.5 {
                height -= (0.25 + 0.35 * unit(hash(h as i32, 1, 1, 5))) * t * t;
            }
        });
        area * (0.6 * height + 0.12 * noise(p.extend(9.0), 7.0, self.seed ^ 0xc42))
    }
}

impl Groove {
    fn height_mm(&self, distance_mm: f32, along_mm: f32, length_mm: f32, seed: u32) -> f32 {
        let t = (along_mm / length_mm).clamp(0.0, 1.0);
        // Fades at its ends, and swells and thins along its course.
        let taper = smoothstep(0.0, self.taper[0], t) * smoothstep(1.0, 1.0 - self.taper[1], t);
        let swell = gradient_noise(Vec3::new(along_mm / 7.0, self.phase as f32 * 0.37, 0.5), seed ^ 0x5e11).0;
        let depth = self.depth_mm * taper * (1.0 + 0.22 * swell).clamp(0.25, 1.6);
        let w = self.half_width_mm * (0.75 + 0.25 * taper);
        let x = distance_mm / w;
        let groove = -(-x * x).exp();
        let roll = if distance_mm > 0.0 { self.roll[0] } else { self.roll[1] };
        // The rolls rise from nothing at the line, so the two sides join smoothly.
        let side = roll * 0.9 * x * x * (-0.36 * x * x).exp();
        depth * (groove + side)
    }
}

/// Horizontal lines of the frontalis muscle: gull-winged, in pieces that overlap, deeper over the brows.
fn forehead(pen: &mut Pen) {
    for (row, y) in [36.5f32, 43.5, 50.5, 57.0, 63.0].into_iter().enumerate() {
        let y = pen.about(y, 0.8);
        let reach = 50.0 - 4.0 * (row as f32 - 1.5).abs() + pen.stream.range(-4.0, 4.0);
        let depth = [0.42, 0.62, 0.66, 0.5, 0.32][row];
        // Where the row breaks; the pieces overlap a little and are offset in height.
        let mut breaks = vec![-reach];
        let middle = pen.about(0.0, 5.0);
        match row % 3 {
            0 => breaks.push(middle),
            1 => breaks.extend([middle - 24.0, middle + 20.0]),
            _ => breaks.push(middle + 16.0 * pen.stream.normal().signum()),
        }
        breaks.push(reach);
        for w in breaks.windows(2) {
            let (from, to) = (w[0] - pen.stream.range(1.0, 5.0), w[1] + pen.stream.range(1.0, 5.0));
            let offset = 0.9 * pen.stream.normal();
            let count = ((to - from) / 9.0).ceil().max(3.0) as usize;
            let knots: Vec<Vec2> = (0..=count)
                .map(|i| {
                    let s = from + (to - from) * i as f32 / count as f32;
                    let wing = 3.2 * (1.0 - ((s.abs() - 27.0) / 27.0).powi(2)).max(-1.2);
                    Vec2::new(s, y + offset + wing + 0.38 * pen.stream.normal())
                })
                .collect();
            let share = ((to - from) / 45.0).clamp(0.6, 1.0);
            pen.draw(&knots, 1.45 * depth * share, 1.25, [0.34, 0.24]);
            // A fine companion beside part of it.
            if pen.stream.range(0.0, 1.0) < 0.6 {
                let up =
                    pen.stream.range(2.2, 3.4) * if pen.stream.range(0.0, 1.0) < 0.5 { 1.0 } else { -1.0 };
                let part: Vec<Vec2> = knots[knots.len() / 4..(knots.len() * 3 / 4).max(knots.len() / 4 + 2)]
                    .iter()
                    .map(|k| *k + Vec2::new(pen.stream.range(-1.0, 1.0), up))
                    .collect();
                pen.draw(&part, 0.3 * depth, 0.6, [0.25, 0.2]);
            }
        }
    }
}

/// The corrugator's two upright furrows, a faint third, and the procerus' cross line at the root of the nose.
fn glabella(pen: &mut Pen) {
    for side in [1.0f32, -1.0] {
        let s = side * pen.about(6.6, 0.5);
        let lean = side * pen.about(2.6, 0.5);
        let top = pen.about(36.0, 1.8);
        let knots = [
            Vec2::new(s - 0.35 * lean, 9.0),
            Vec2::new(s - 0.2 * lean, 15.0),
            Vec2::new(s + 0.1 * lean, 22.0),
            Vec2::new(s + 0.55 * lean, 29.0),
            Vec2::new(s + 1.2 * lean, top),
        ];
        pen.draw(&knots, 1.05, 1.4, [0.34, 0.34]);
        // Oblique lines of the brow's head pulled in.
        let y = pen.about(25.0, 0.8);
        let oblique = [
            Vec2::new(side * 11.5, y - 3.0),
            Vec2::new(side * 12.4, y + 4.0),
            Vec2::new(side * 15.0, y + 10.0),
        ];
        pen.draw(&oblique, 0.38, 0.9, [0.3, 0.3]);
    }
    let s = pen.about(-1.0, 1.0);
    pen.draw(&[Vec2::new(s, 17.0), Vec2::new(s + 0.6, 23.0), Vec2::new(s + 0.2, 30.0)], 0.4, 0.8, [0.3, 0.3]);
    for (y, depth) in [(3.0, 0.75), (7.2, 0.4)] {
        let y = pen.about(y, 0.4);
        let knots = [
            Vec2::new(-9.5, y + 1.6),
            Vec2::new(-4.0, y),
            Vec2::new(1.0, y - 0.2),
            Vec2::new(5.0, y + 0.3),
            Vec2::new(9.5, y + 1.9),
        ];
        pen.draw(&knots, depth, 1.1, [0.35, 0.3]);
    }
}

/// Bunny lines of the nasalis muscle on the side of the nose.
fn nose(pen: &mut Pen, side: f32) {
    let at = |s: f32, y: f32| Vec2::new(side * s, y);
    let rows = [
        ([[2.0, -4.0], [6.5, -4.4], [11.0, -7.0], [15.0, -11.5]], 0.55),
        ([[1.6, -9.5], [6.0, -10.4], [10.5, -13.6], [14.0, -18.0]], 0.62),
        ([[2.6, -15.5], [6.4, -17.2], [10.0, -20.6], [12.6, -25.0]], 0.42),
    ];
    for (knots, depth) in rows {
        let shift = Vec2::new(0.0, 0.5 * pen.stream.normal());
        let knots = knots.map(|[s, y]| at(s, y) + shift + Vec2::new(0.0, 0.3 * pen.stream.normal()));
        pen.draw(&knots, 1.3 * depth, 0.8, [0.36, 0.3]);
    }
}

/// The fan of the orbicularis at the outer corner of the eye, and lines under the lower lid.
fn crow_feet(pen: &mut Pen, side: f32) {
    let corner = Vec2::new(53.0, -3.4);
    let rays = [
        (46.0f32, 13.0, 0.3),
        (25.0, 19.0, 0.55),
        (7.0, 21.0, 0.62),
        (-13.0, 20.0, 0.55),
        (-32.0, 17.0, 0.4),
    ];
    for (angle, length, depth) in rays {
        let angle = pen.about(angle, 2.5).to_radians();
        let length = pen.about(length, 1.5);
        let start = pen.stream.range(-0.5, 2.0);
        let direction = Vec2::new(angle.cos(), angle.sin());
        // Rays bend away from the horizontal as they leave the eye.
        let bend = direction.perp() * angle.signum() * length * 0.1;
        let knots: Vec<Vec2> = (0..=4)
            .map(|i| {
                let t = i as f32 / 4.0;
                let p = corner + direction * (start + length * t) + bend * t * t;
                Vec2::new(side * p.x, p.y + 0.25 * pen.stream.normal())
            })
            .collect();
        pen.draw(&knots, 0.72 * depth, 0.95, [0.26, 0.26]);
        if pen.stream.range(0.0, 1.0) < 0.55 {
            let fork: Vec<Vec2> =
                knots[2..].iter().map(|k| *k + Vec2::new(0.0, 1.7 * angle.signum())).collect();
            pen.draw(&fork, 0.26 * depth, 0.6, [0.25, 0.25]);
        }
    }
    for (drop, depth) in [(4.2, 0.4), (8.2, 0.34)] {
        let drop = pen.about(drop, 0.4);
        let knots = [
            Vec2::new(side * 24.0, -8.0 - drop),
            Vec2::new(side * 31.0, -9.5 - drop),
            Vec2::new(side * 39.0, -8.9 - drop),
            Vec2::new(side * 47.0, -6.2 - drop),
            Vec2::new(side * 54.0, -3.5 - 0.8 * drop),
        ];
        pen.draw(&knots, 0.62 * depth, 1.05, [0.3, 0.26]);
    }
}

/// The fold from the wing of the nose to beside the mouth.
fn nasolabial(pen: &mut Pen, side: f32) {
    let shift = 0.5 * pen.stream.normal();
    let knots: Vec<Vec2> = NASOLABIAL
        .iter()
        .map(|[s, y]| Vec2::new(side * (s + shift), y + 0.3 * pen.stream.normal()))
        .collect();
    // The cheek rolls over the fold; the lip side stays flat. Downwards along the line, the cheek of the left side
    // is on the left. The smile itself bends the surface; the groove only sharpens its bottom.
    let roll = if side > 0.0 { [0.20, 0.02] } else { [0.02, 0.20] };
    pen.draw(&knots, 0.95, 3.3, roll);
    // It is deepest under the wing of the nose and runs out before the corner of the mouth.
    if let Some(fold) = pen.grooves.last_mut() {
        fold.taper = [0.30, 0.62];
    }
    // A crease of the skin itself at the bottom of its upper half.
    pen.draw(&knots[..4], 0.20, 1.3, [0.0; 2]);
}

/// The groove between lower lip and chin.
fn mentolabial(pen: &mut Pen) {
    let y = pen.about(-90.5, 0.5);
    let knots = [
        Vec2::new(-15.0, y - 2.5),
        Vec2::new(-7.0, y + 0.6),
        Vec2::new(0.0, y + 1.1),
        Vec2::new(7.0, y + 0.5),
        Vec2::new(15.0, y - 2.8),
    ];
    pen.draw(&knots, 0.6, 2.0, [0.15, 0.3]);
}

fn chin_weight(p: Vec2) -> f32 {
    smoothstep(-92.0, -97.0, p.y) * smoothstep(-122.0, -112.0, p.y) * smoothstep(22.0, 13.0, p.x.abs())
}

/// Weights of [`ZONES`] at a canonical position.
pub(crate) fn zone_weights(place: Vec3) -> [f32; 12] {
    let p = plan(place);
    let s = p.x.abs();
    let front = smoothstep(8.0, 28.0, place.z);
    let left = smoothstep(-5.0, 5.0, p.x);
    // The glabella has a softer, narrower seat; the forehead yields to it.
    let ellipse = Vec2::new(p.x / 17.0, (p.y - 20.0) / 24.0).length();
    let glabella = smoothstep(1.05, 0.7, ellipse) * smoothstep(-4.0, 2.0, p.y);
    let brow_y = through(&[[0.0, 28.0], [12.0, 29.0], [30.0, 32.0], [45.0, 30.0], [62.0, 20.0]], s);
    let forehead = front
        * smoothstep(brow_y - 3.0, brow_y + 4.0, p.y)
        * smoothstep(4.0, -6.0, above_hairline(p))
        * smoothstep(72.0, 56.0, s)
        * (1.0 - glabella);
    // The outer zones are the temples and the ends of the brows: a smile, which moves them fully (Jimenez 2012 table
    // 8.1), must not fold the middle of the forehead.
    let outer = smoothstep(40.0, 54.0, s);
    let nose = smoothstep(19.5, 15.0, s)
        * smoothstep(-34.0, -26.0, p.y)
        * smoothstep(3.0, -3.0, p.y)
        * smoothstep(70.0, 80.0, place.z)
        * (1.0 - glabella);
    let (eye, _) = eye_distance(p);
    let lid = smoothstep(0.8, 2.6, eye);
    let crow = front
        * lid
        * (1.0 - nose)
        * smoothstep(20.0, 25.0, s + 0.4 * (p.y + 12.0).max(0.0))
        * smoothstep(86.0, 74.0, s)
        * (smoothstep(-29.0, -22.0, p.y)
            * smoothstep(20.0, 9.0, p.y)
            * smoothstep(46.0, 51.0, s + 2.2 * (-6.0 - p.y).max(0.0)));
    let fold_s = through(&NASOLABIAL_BY_HEIGHT, -p.y);
    let fold = front
        * smoothstep(13.0, 9.0, (s - fold_s - 3.5).abs())
        * smoothstep(-32.0, -38.0, p.y)
        * smoothstep(-89.0, -80.0, p.y)
        * (1.0 - nose);
    // The crease under the lip belongs to the chin.
    let chin = front
        * smoothstep(-84.5, -89.0, p.y)
        * smoothstep(-124.0, -113.0, p.y)
        * smoothstep(27.0, 19.0, s)
        * (1.0 - fold);
    [
        forehead * outer * (1.0 - left),
        forehead * outer * left,
        forehead * (1.0 - outer) * (1.0 - left),
        forehead * (1.0 - outer) * left,
        nose * (1.0 - left),
        nose * left,
        glabella,
        chin,
        crow * left,
        crow * (1.0 - left),
        fold * left,
        fold * (1.0 - left),
    ]
}

/// [`NASOLABIAL`] as s over depth below the root of the nose.
const NASOLABIAL_BY_HEIGHT: [[f32; 2]; 6] =
    [[37.5, 17.5], [43.0, 20.5], [51.0, 25.0], [60.5, 29.3], [70.0, 32.0], [80.0, 32.6]];

#[cfg(test)]
mod tests {
    use super::*;

    /// A place on the cylinder of the plan.
    fn on_plan(s: f32, y: f32) -> Vec3 {
        let angle = s / super::super::face_space::PLAN_RADIUS_MM;
        Vec3::new(85.0 * angle.sin(), y, 85.0 * angle.cos())
    }

    #[test]
    fn gradient_matches_the_height() {
        let wrinkles = Wrinkles::new(4);
        let mut compared = 0;
        for i in 0..400 {
            let c = on_plan(-60.0 + 0.3 * i as f32, 30.0 + 0.07 * i as f32);
            let g = wrinkles.gradient(c);
            for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
                let d = (wrinkles.height_mm(c + 0.1 * axis) - wrinkles.height_mm(c - 0.1 * axis)) / 0.2;
                assert!((d - g.dot(axis)).abs() < 0.04, "{d} is not {}", g.dot(axis));
                compared += usize::from(d.abs() > 0.1);
            }
        }
        assert!(compared > 50, "only {compared} places lie on a slope");
    }

    #[test]
    fn wrinkles_are_deep_where_anatomy_has_them_and_absent_elsewhere() {
        let wrinkles = Wrinkles::new(1);
        let deepest = |s: [f32; 2], y: [f32; 2]| {
            let mut low = 0.0f32;
            for i in 0..80 {
                for j in 0..80 {
                    let at = |r: [f32; 2], k: i32| r[0] + (r[1] - r[0]) * k as f32 / 79.0;
                    low = low.min(wrinkles.height_mm(on_plan(at(s, i), at(y, j))));
                }
            }
            -low
        };
        for (s, y) in [
            ([-40.0, 40.0], [32.0, 66.0]),
            ([-12.0, 12.0], [10.0, 34.0]),
            ([4.0, 14.0], [-20.0, -5.0]),
            ([54.0, 74.0], [-15.0, 12.0]),
            ([-36.0, -20.0], [-75.0, -45.0]),
            ([-12.0, 12.0], [-112.0, -90.0]),
        ] {
            let depth = deepest(s, y);
            assert!((0.3..2.0).contains(&depth), "{s:?} {y:?}: {depth} mm");
        }
        assert!(deepest([-20.0, 20.0], [-82.0, -60.0]) < 0.1, "the lips have no expression wrinkles");
    }

    #[test]
    fn zones_cover_the_wrinkles_and_hardly_overlap() {
        let wrinkles = Wrinkles::new(1);
        let mut seen = [false; 12];
        for i in -90..=90 {
            for j in -125..=75 {
                let c = on_plan(i as f32, j as f32);
                let w = zone_weights(c);
                let sum: f32 = w.iter().sum();
                assert!(sum <= 1.35, "{sum} at {c}: {w:?}");
                assert!(w.iter().all(|v| (0.0..=1.0).contains(v)));
                for (s, v) in seen.iter_mut().zip(w) {
                    *s |= v > 0.95;
                }
                if wrinkles.height_mm(c) < -0.45 {
                    assert!(sum > 0.25, "a groove at {c} lies in no zone");
                }
            }
        }
        assert_eq!(seen, [true; 12], "every zone has a core");
    }

    #[test]
    fn both_sides_of_the_forehead_are_as_deep_for_every_person() {
        for seed in 0..12 {
            let [left, right] = Wrinkles::new(seed).forehead_strength();
            assert!((left / right - 1.0).abs() < 0.06, "seed {seed}: {left} and {right} mm");
        }
    }

    #[test]
    fn the_two_sides_differ_a_little() {
        let wrinkles = Wrinkles::new(2);
        let (mut difference, mut size) = (0.0, 0.0);
        for i in 0..60 {
            for j in 0..100 {
                let (s, y) = (18.0 + 0.3 * i as f32, -40.0 - 0.4 * j as f32);
                let (l, r) = (wrinkles.height_mm(on_plan(s, y)), wrinkles.height_mm(on_plan(-s, y)));
                difference += (l - r).abs();
                size += l.abs() + r.abs();
            }
        }
        let ratio = difference / size;
        assert!((0.02..0.7).contains(&ratio), "asymmetry {ratio}");
    }
}
