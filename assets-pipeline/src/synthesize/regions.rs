//! How much a point of the skin belongs to each region of the face.
//!
//! Smooth weights from 0 to 1 in canonical space; they overlap, and none is a partition.

use glam::{Vec2, Vec3};

use super::face_space::plan;
use super::noise::smoothstep;
use super::surface::Site;

/// Weights of the regions at one point.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Regions {
    /// Red of the lips, and the band where it meets the skin.
    pub lips: f32,
    pub lip_border: f32,
    /// Lining behind the lips and behind the lids, and the caruncle.
    pub inner: f32,
    /// Skin of both lids; their edges; the hollow below the eye; its inner corner.
    pub lids: f32,
    pub lid_edge: f32,
    pub under_eye: f32,
    pub eye_corner: f32,
    pub nose: f32,
    pub nose_tip: f32,
    pub nose_wing: f32,
    /// Apple of the cheek, the cheek bone lateral of it, and the flat of the cheek below.
    pub cheek: f32,
    pub cheek_bone: f32,
    pub lower_cheek: f32,
    pub forehead: f32,
    pub temple: f32,
    pub glabella: f32,
    pub chin: f32,
    pub upper_lip: f32,
    /// Where a beard grows.
    pub beard: f32,
    pub jaw: f32,
    pub neck: f32,
    pub ear: f32,
    pub ear_rim: f32,
    /// Opening of the nostril and what lies behind it; opening of the ear canal.
    pub nostril: f32,
    pub ear_canal: f32,
    /// Inside the hairline.
    pub scalp: f32,
}

/// Gaussian-like weight about a place: (1 - q/8)^4 falls like exp(-q/2) and ends at q = 8.
fn blob(c: Vec3, centre: [f32; 3], radii: [f32; 3]) -> f32 {
    let q = ((c - Vec3::from_array(centre)) / Vec3::from_array(radii)).length_squared();
    let t = (1.0 - q / 8.0).max(0.0);
    (t * t) * (t * t)
}

/// Piecewise linear through (x, y) knots of growing x, constant outside.
pub(crate) fn through(knots: &[[f32; 2]], x: f32) -> f32 {
    let i = knots.partition_point(|k| k[0] < x);
    if i == 0 {
        return knots[0][1];
    }
    if i == knots.len() {
        return knots[i - 1][1];
    }
    let ([x0, y0], [x1, y1]) = (knots[i - 1], knots[i]);
    y0 + (y1 - y0) * (x - x0) / (x1 - x0)
}

/// Upper border of the red of the lips: plan (|s|, y), mm, with the cupid's bow.
const LIP_TOP: [[f32; 2]; 8] = [
    [0.0, -61.9],
    [2.0, -61.6],
    [5.0, -60.9],
    [7.5, -61.0],
    [12.0, -63.0],
    [16.0, -65.3],
    [20.0, -68.4],
    [24.0, -72.0],
];
/// Lower border.
const LIP_BOTTOM: [[f32; 2]; 6] =
    [[0.0, -80.6], [5.0, -80.4], [10.0, -79.6], [15.0, -77.9], [20.0, -75.2], [24.0, -72.2]];
/// Outline of the scalp hair on the plan (|s|, y), mm: up the forehead to the recess, forwards to the peak of the temple,
/// back to the sideburn, down before the ear to its middle, close over the ear, down behind it and round the nape. The
/// last corners close it beyond the middle and above the head.
const HAIRLINE: [[f32; 2]; 28] = [
    [-40.0, 65.0],
    [0.0, 66.0],
    [26.0, 69.0],
    [44.0, 71.0],
    [56.0, 66.0],
    [64.0, 54.0],
    [70.0, 41.0],
    [77.0, 29.0],
    [88.0, 17.0],
    [98.0, 7.0],
    [103.5, -3.0],
    [105.5, -14.0],
    [106.5, -24.0],
    [114.0, -26.0],
    [121.5, -25.0],
    [124.0, -12.0],
    [127.0, -4.5],
    [132.5, -1.0],
    [139.0, 1.6],
    [147.0, 2.2],
    [154.0, -2.0],
    [159.5, -12.0],
    [165.0, -25.0],
    [170.0, -42.0],
    [196.0, -64.0],
    [292.0, -72.0],
    [292.0, 140.0],
    [-40.0, 140.0],
];
/// Outline of the ear seen from its side: (z, y), mm, from the root of the helix over the top.
const EAR: [[f32; 2]; 18] = [
    [-4.0, -8.0],
    [-8.0, -2.2],
    [-13.0, 1.8],
    [-20.0, 3.0],
    [-28.0, -2.0],
    [-34.5, -11.0],
    [-38.0, -20.5],
    [-37.0, -28.5],
    [-30.5, -37.0],
    [-23.0, -45.0],
    [-18.0, -50.5],
    [-11.0, -52.0],
    [-4.0, -49.0],
    [-1.0, -42.0],
    [-4.0, -34.0],
    [-4.5, -26.0],
    [-2.0, -18.0],
    [-2.5, -12.0],
];

/// Signed distance to a closed outline, negative inside.
fn outline_distance(outline: &[[f32; 2]], p: Vec2) -> f32 {
    let mut nearest = f32::MAX;
    let mut inside = false;
    let mut a = Vec2::from_array(outline[outline.len() - 1]);
    for b in outline {
        let b = Vec2::from_array(*b);
        let edge = b - a;
        let t = ((p - a).dot(edge) / edge.length_squared()).clamp(0.0, 1.0);
        nearest = nearest.min((p - a - t * edge).length_squared());
        // A ray to the right crosses the outline an odd number of times from inside.
        if (a.y > p.y) != (b.y > p.y) && p.x < a.x + (p.y - a.y) / edge.y * edge.x {
            inside = !inside;
        }
        a = b;
    }
    if inside { -nearest.sqrt() } else { nearest.sqrt() }
}

/// Approximate signed distance to the opening between the lids, mm, positive on the skin; and true above it.
pub(crate) fn eye_distance(p: Vec2) -> (f32, bool) {
    // Corners (20, -4.5) and (47.5, -2.7) in plan, lids 4.8 mm above and 3.6 mm below the line between them.
    let t = (p.x.abs() - 20.0) / 27.5;
    let line = -4.5 + 1.8 * t.clamp(0.0, 1.0);
    let above = p.y > line;
    let inside = t.clamp(0.0, 1.0);
    let arch = 4.0 * inside * (1.0 - inside);
    let lid = if above { 5.6 * arch.powf(0.75) } else { 3.4 * arch.powf(0.8) };
    let vertical = (p.y - line).abs() - lid;
    let beyond = ((t - 1.0).max(-t) * 27.5).max(0.0);
    let distance =
        if vertical > 0.0 { (vertical * vertical + beyond * beyond).sqrt() } else { vertical.max(beyond) };
    (if beyond > 0.0 && vertical <= 0.0 { beyond } else { distance }, above)
}

/// Distance (mm) over the line along which the upper lid folds, and how deep the fold is there, 0 to 1.
pub(crate) fn lid_fold(p: Vec2) -> (f32, f32) {
    let t = (p.x.abs() - 20.0) / 27.5;
    let (eye, above) = eye_distance(p);
    let arch = (4.0 * t * (1.0 - t)).max(0.0);
    let depth = smoothstep(0.02, 0.3, t) * smoothstep(1.12, 0.8, t) * f32::from(above);
    (eye - 2.6 - 3.4 * arch, depth)
}

/// Signed distance to the hairline, mm, negative on the face; far from the line only the sign counts.
pub(crate) fn above_hairline(p: Vec2) -> f32 {
    const FAR_MM: f32 = 25.0;
    let p = Vec2::new(p.x.abs(), p.y);
    if p.y > 71.0 + FAR_MM {
        FAR_MM
    } else if p.y < -72.0 - FAR_MM || (p.x < 78.0 && p.y < 29.0 - FAR_MM) {
        -FAR_MM
    } else {
        -outline_distance(&HAIRLINE, p).clamp(-FAR_MM, FAR_MM)
    }
}

/// How much a place (x >= 0) belongs to the ear. The part of the skull that the ear hides from the side counts too.
fn ear_weight(c: Vec3) -> f32 {
    if !(60.0..110.0).contains(&c.x) || !(-42.0..4.0).contains(&c.z) || !(-58.0..6.0).contains(&c.y) {
        return 0.0;
    }
    smoothstep(2.4, -1.4, outline_distance(&EAR, Vec2::new(c.z, c.y))) * smoothstep(62.0, 69.0, c.x)
}

impl Regions {
    /// Weights at a point of the skin. What lies at the depth of the lips' lining belongs to it only where it turns away
    /// from the front or is enclosed: the skin beside a flat chin lies as deep.
    pub(crate) fn of(site: &Site) -> Self {
        let turned = smoothstep(0.45, 0.1, site.normal.z);
        let enclosed = smoothstep(0.62, 0.42, site.open);
        Self::with(site.place, turned.max(enclosed))
    }

    /// Weights at a canonical position.
    pub(crate) fn at(place: Vec3) -> Self {
        Self::with(place, 1.0)
    }

    /// Weights at a canonical position; `lining` is how much it may belong to the lining of the lips.
    fn with(place: Vec3, lining: f32) -> Self {
        let p = plan(place);
        let c = Vec3::new(place.x.abs(), place.y, place.z);
        let s = p.x.abs();
        let front = smoothstep(10.0, 45.0, c.z);

        let (eye, above_eye) = eye_distance(p);
        let near_eye = front * smoothstep(40.0, 60.0, c.z);
        let lid_width = if above_eye { 9.0 } else { 6.0 };
        let lids = near_eye * (1.0 - smoothstep(0.35 * lid_width, 1.25 * lid_width, eye));
        let lid_edge = near_eye * (1.0 - smoothstep(0.4, 1.6, eye));

        let top = through(&LIP_TOP, s);
        let bottom = through(&LIP_BOTTOM, s);
        let lip_depth = (top - p.y).min(p.y - bottom).min((24.6 - s) * 0.8);
        let mouth_height = smoothstep(-100.0, -92.0, p.y) * smoothstep(-50.0, -57.0, p.y);
        let behind_lips = lining
            * mouth_height
            * smoothstep(30.0, 27.0, s)
            * smoothstep(81.0, 76.0, c.z + 0.011 * (c.x - 8.0).max(0.0).powi(2));
        let lips = (front * smoothstep(-0.7, 0.6, lip_depth)).max(behind_lips);
        let lip_border = front * (1.0 - smoothstep(0.0, 1.6, lip_depth.abs())) * (1.0 - behind_lips);
        let nostril = smoothstep(0.3, 0.75, blob(c, [9.0, -41.6, 93.0], [5.0, 4.2, 6.6]));
        // Behind the tragus.
        let canal = Vec2::new((c.z + 12.0) / 4.4, (c.y + 29.0) / 4.6).length();
        let ear_canal = smoothstep(1.25, 0.5, canal)
            * smoothstep(-7.4, -9.4, c.z)
            * smoothstep(66.0, 69.0, c.x)
            * smoothstep(84.0, 80.0, c.x);
        let caruncle = smoothstep(0.2, 0.8, blob(c, [18.6, -5.0, 71.0], [1.3, 1.2, 3.0]));
        let behind_lids = near_eye * smoothstep(-0.2, -1.2, eye);

        let ear = ear_weight(c);
        let scalp = smoothstep(-1.5, 5.0, above_hairline(p)) * (1.0 - ear);
        let forehead = front * smoothstep(24.0, 36.0, c.y) * smoothstep(74.0, 58.0, s) * (1.0 - 0.5 * scalp);
        let jaw_line = -86.0 + 0.35 * (s - 30.0).max(0.0);
        let neck = smoothstep(0.0, -22.0, c.y - jaw_line) * smoothstep(82.0, 62.0, c.z - 0.2 * (c.y + 110.0));
        Self {
            lips,
            lip_border,
            inner: behind_lips.max(behind_lids).max(0.85 * caruncle),
            lids,
            lid_edge,
            under_eye: near_eye * blob(c, [29.0, -13.0, 74.0], [10.0, 5.0, 14.0]),
            eye_corner: blob(c, [17.5, -5.0, 72.0], [3.5, 4.0, 8.0]),
            nose: blob(c, [0.0, -25.0, 98.0], [11.0, 19.0, 16.0]),
            nose_tip: blob(c, [0.0, -34.0, 109.0], [9.0, 7.5, 9.0]),
            nose_wing: blob(c, [15.0, -42.0, 92.0], [5.5, 6.5, 9.0]),
            cheek: blob(c, [41.0, -34.0, 74.0], [15.0, 14.0, 20.0]),
            cheek_bone: blob(c, [55.0, -20.0, 58.0], [13.0, 10.0, 20.0]),
            lower_cheek: blob(c, [50.0, -62.0, 54.0], [15.0, 17.0, 25.0]),
            forehead,
            temple: blob(c, [67.0, 22.0, 38.0], [12.0, 18.0, 20.0]),
            glabella: blob(c, [0.0, 19.0, 87.0], [10.0, 11.0, 12.0]),
            chin: blob(c, [0.0, -103.0, 86.0], [14.0, 12.0, 16.0]),
            upper_lip: blob(c, [0.0, -56.0, 95.0], [15.0, 5.5, 14.0]) * (1.0 - lips),
            beard: front.max(smoothstep(-10.0, 20.0, c.z))
                * smoothstep(-40.0, -56.0, c.y + 0.55 * (40.0 - s).clamp(-50.0, 26.0))
                * (1.0 - lips)
                * smoothstep(-150.0, -128.0, c.y)
                * (1.0 - ear),
            jaw: blob(c, [48.0, -88.0, 45.0], [24.0, 14.0, 35.0]),
            neck,
            ear,
            ear_rim: ear * smoothstep(84.0, 89.0, c.x),
            nostril,
            ear_canal,
            scalp,
        }
    }

    /// How much a point lies in an opening that light does not leave again: `open` is its ambient visibility, which tells
    /// the inside of a nostril from the wing beside it.
    pub(crate) fn hollow(&self, open: f32) -> f32 {
        self.ear_canal.max(self.nostril * smoothstep(0.66, 0.40, open))
    }
}

#[cfg(test)]
mod tests {
    use super::super::face_space::canonical;
    use super::*;

    #[test]
    fn landmarks_lie_in_their_regions() {
        let at = |name: &str| Regions::at(canonical(name));
        assert!(at("cheek").cheek > 0.7);
        assert!(at("pronasale").nose_tip > 0.8);
        assert!(at("glabella").glabella > 0.8);
        assert!(at("alare").nose_wing > 0.6);
        assert!(at("ear").ear > 0.8);
        assert!(at("vertex").scalp > 0.95);
        assert!(Regions::at(Vec3::new(0.0, -66.0, 97.0)).lips > 0.95);
        assert!(Regions::at(Vec3::new(0.0, 50.0, 86.0)).forehead > 0.9);
        assert!(Regions::at(Vec3::new(0.0, -150.0, 40.0)).neck > 0.9);
        for name in ["cheek", "glabella", "pronasale"] {
            let r = at(name);
            assert!(r.lips + r.scalp + r.inner + r.neck + r.lids < 0.05, "{name}: {r:?}");
        }
    }

    #[test]
    fn outlines_have_signed_distances() {
        let square = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]];
        let at = |x, y| outline_distance(&square, Vec2::new(x, y));
        assert!((at(2.0, 1.0) + 1.0).abs() < 1e-6 && (at(2.0, 5.5) - 1.5).abs() < 1e-6);
        assert!((at(7.0, 8.0) - 5.0).abs() < 1e-6);
        // The shortcuts far from the hairline agree with it, and nothing jumps where they begin.
        for i in 0..200 {
            for j in 0..60 {
                let p = Vec2::new(i as f32 * 1.25, 110.0 - 4.0 * j as f32);
                let exact = -outline_distance(&HAIRLINE, p).clamp(-25.0, 25.0);
                let found = above_hairline(p);
                assert_eq!(exact > 0.0, found > 0.0, "{p}");
                assert!(found == exact || found.abs() >= 25.0 && exact.abs() > 16.0, "{p}: {found}, {exact}");
            }
        }
    }

    #[test]
    fn hollows_are_where_light_does_not_return() {
        let at = |x, y, z, open| Regions::at(Vec3::new(x, y, z)).hollow(open);
        assert!(at(73.0, -29.0, -12.0, 0.4) > 0.9, "ear canal");
        assert!(at(76.0, -29.0, -5.0, 0.9) < 0.01, "outer side of the tragus");
        assert!(at(88.0, -20.0, -30.0, 0.7) < 0.01, "helix");
        assert!(at(9.0, -42.0, 93.0, 0.25) > 0.9 && at(-9.0, -42.0, 93.0, 0.25) > 0.9, "nostrils");
        assert!(at(9.0, -42.0, 93.0, 1.0) < 0.01, "what is seen from everywhere is no hole");
        for name in ["pronasale", "alare", "subnasale", "cheek", "ear"] {
            assert!(Regions::at(canonical(name)).hollow(0.5) < 0.35, "{name}");
        }
    }

    #[test]
    fn skin_beside_a_flat_chin_is_no_lining() {
        // Below and beside the corner of the mouth, as deep as the lining behind the lips.
        let place = Vec3::new(23.0, -88.0, 74.0);
        let facing = |normal: Vec3, open| Regions::of(&Site::at(place, normal.normalize(), open));
        let out = facing(Vec3::new(0.5, -0.1, 0.8), 0.95);
        assert!(out.lips < 0.05 && out.inner < 0.05, "{out:?}");
        assert!(facing(Vec3::new(0.2, 0.1, -0.9), 0.95).inner > 0.5, "it turns to the teeth");
        assert!(facing(Vec3::new(0.5, -0.1, 0.8), 0.2).inner > 0.5, "it is enclosed");
    }

    #[test]
    fn weights_are_weights_everywhere() {
        for i in 0..4000 {
            let f = |k: i32, low: f32, high: f32| low + (high - low) * ((i * k) % 997) as f32 / 997.0;
            let r = Regions::at(Vec3::new(f(31, -100.0, 100.0), f(17, -200.0, 120.0), f(7, -100.0, 120.0)));
            for w in [r.lips, r.lip_border, r.inner, r.lids, r.lid_edge, r.beard, r.neck, r.scalp, r.forehead]
            {
                assert!((0.0..=1.0).contains(&w), "{r:?}");
            }
        }
    }
}
