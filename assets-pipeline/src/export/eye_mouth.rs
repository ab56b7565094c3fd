//! Pictures of eyes and teeth: what the renderer computes for them, at rest, for programs that only show pictures.
//!
//! Colours and proportions are those of the renderer's materials (`passes/shade/eye.wesl`, `mouth.wesl`) without what
//! depends on the view: refraction, shadows of the lids, tears.

use std::f32::consts::TAU;

use glam::{Vec2, Vec3};
use image::ExtendedColorType;
use rayon::prelude::*;
use rubor_rig::color::srgb_encode;
use rubor_rig::head::{EYE_RADIUS_MM, Head, LIMBUS_UV, Material};
use rubor_rig::life::CALM_PUPIL_MM;

use super::pictures::Picture;

/// Side of the eye picture.
const EYE_SIZE: u32 = 1024;
/// Size of the picture of both rows of teeth.
const TEETH_SIZE: (u32, u32) = (2048, 512);

/// Offset and scale of texture coordinates for the eye picture, which shows the front half of the ball.
pub(super) const EYE_TRANSFORM: ([f32; 2], [f32; 2]) = ([-0.5, -0.5], [2.0, 2.0]);
/// Of the teeth picture: 57 mm to both sides of the middle line, 12 mm up and down from the biting edge.
pub(super) const TEETH_TRANSFORM: ([f32; 2], [f32; 2]) =
    ([0.5, 0.5 - 0.5 * TEETH_SCALE[1]], [TEETH_SCALE[0], TEETH_SCALE[1]]);
const TEETH_SCALE: [f32; 2] = [1.0 / 1.14, 1.0 / 0.24];

/// From the middle line to the far side of each tooth, mm (mean crown widths; R. C. Wheeler's dental anatomy).
const UPPER_TEETH: [f32; 8] = [0.0, 8.5, 15.0, 22.6, 29.7, 36.5, 46.5, 56.0];
const LOWER_TEETH: [f32; 8] = [0.0, 5.2, 10.9, 17.7, 24.7, 31.8, 42.8, 53.5];

fn smoothstep(from: f32, to: f32, x: f32) -> f32 {
    let t = ((x - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

fn fract(x: f32) -> f32 {
    x - x.floor()
}

fn hash(p: Vec2) -> f32 {
    fract(p.dot(Vec2::new(127.1, 311.7)).sin() * 43_758.547)
}

/// Value noise, 0 to 1.
fn noise(x: f32, y: f32) -> f32 {
    let (p, i) = (Vec2::new(x, y), Vec2::new(x.floor(), y.floor()));
    let f = p - i;
    let s = f * f * (Vec2::splat(3.0) - 2.0 * f);
    let at = |dx, dy| hash(i + Vec2::new(dx, dy));
    let (top, bottom) = (at(0.0, 0.0), at(0.0, 1.0));
    let (top, bottom) = (top + (at(1.0, 0.0) - top) * s.x, bottom + (at(1.0, 1.0) - bottom) * s.x);
    top + (bottom - top) * s.y
}

fn picture((width, height): (u32, u32), color: impl Fn(f32, f32) -> Vec3 + Sync) -> Picture {
    let row = |y: u32| {
        let color = &color;
        (0..width).flat_map(move |x| {
            let linear = color((x as f32 + 0.5) / width as f32, (y as f32 + 0.5) / height as f32);
            linear.to_array().map(|c| (srgb_encode(c.clamp(0.0, 1.0)) * 255.0).round() as u8)
        })
    };
    let texels = (0..height).into_par_iter().flat_map_iter(row).collect();
    Picture { texels, size: (width, height), color: ExtendedColorType::Rgb8 }
}

/// Colours of an iris at its inner and its outer edge: pigment of hair and iris comes from the same cells.
fn iris_colors(hair_linear: [f32; 3]) -> [Vec3; 2] {
    let hair = Vec3::from_array(hair_linear).dot(Vec3::new(0.2126, 0.7152, 0.0722));
    let brown = [Vec3::new(0.085, 0.036, 0.014), Vec3::new(0.038, 0.017, 0.008)];
    let hazel = [Vec3::new(0.108, 0.061, 0.030), Vec3::new(0.054, 0.051, 0.037)];
    let blue = [Vec3::new(0.125, 0.120, 0.095), Vec3::new(0.078, 0.105, 0.122)];
    let (first, second) = (smoothstep(0.0100, 0.0122, hair), smoothstep(0.05, 0.16, hair));
    [0, 1]
        .map(|i| brown[i] * (1.0 - first) + hazel[i] * (first * (1.0 - second)) + blue[i] * (first * second))
}

/// Iris with fibres, collarette, crypts and limbal ring, pupil, sclera with vessels; of the head's hair colour.
pub(super) fn eye(hair_linear: [f32; 3]) -> Picture {
    let [inner, outer] = iris_colors(hair_linear);
    let limbus = TAU * LIMBUS_UV;
    let pupil = 0.5 * CALM_PUPIL_MM / EYE_RADIUS_MM;
    let pixel = TAU * 0.5 / EYE_SIZE as f32;
    picture((EYE_SIZE, EYE_SIZE), |x, y| {
        let from_axis = 0.5 * (Vec2::new(x, y) - 0.5);
        let theta = TAU * from_axis.length();
        let around = from_axis.y.atan2(from_axis.x);
        let (circle, turn) = (Vec2::from_angle(around), around / TAU);
        let r = ((theta - pupil) / (limbus - pupil)).clamp(0.0, 1.0);
        let wave = noise(circle.x * 3.0 + 7.0, circle.y * 3.0 + 7.0) - 0.5;
        let fibres = 0.55 * noise((turn + 0.5) * 90.0, r * 2.6 + wave)
            + 0.45 * noise((turn + 0.5) * 170.0 + 3.0, r * 4.0);
        let spread = circle * (2.2 + 2.0 * r);
        let crypts = smoothstep(0.62, 0.85, noise(spread.x + 3.0, spread.y + r * 5.0));
        let collarette = smoothstep(0.42, 0.22, r + 0.16 * wave);
        let mut iris = outer.lerp(inner, 0.85 * collarette);
        iris *= 0.45 + 1.25 * fibres - 0.25 * crypts;
        iris *= 1.0 - 0.86 * smoothstep(0.70, 0.97, r);
        iris *= 0.6 + 0.4 * smoothstep(0.0, 0.12, r);
        iris *= 0.04 + 0.96 * smoothstep(pupil - pixel, pupil + pixel, theta);

        let at = |scale: f32| noise(from_axis.x * scale, from_axis.y * scale);
        let wander = 1.7 * at(55.0) + 0.6 * at(160.0);
        let large = (noise(turn * 30.0 + wander, theta * 3.0) - 0.5).abs();
        let small = (noise(turn * 74.0 + 2.0 * wander, theta * 6.0 + 9.0) - 0.5).abs();
        let vein = (smoothstep(0.07, 0.0, large) * smoothstep(0.58, 0.95, theta))
            .max(0.6 * smoothstep(0.09, 0.0, small) * smoothstep(0.68, 1.05, theta));
        let blush = smoothstep(0.60, 1.35, theta);
        let mut sclera = Vec3::new(0.60, 0.515, 0.415).lerp(Vec3::new(0.52, 0.355, 0.28), blush);
        sclera *= Vec3::ONE.lerp(Vec3::new(0.92, 0.52, 0.44), 0.75 * vein);
        sclera *= 1.0 - 0.30 * smoothstep(0.62, 1.2, theta);
        iris.lerp(sclera, smoothstep(limbus - 0.025 - pixel, limbus + 0.055 + pixel, theta))
    })
}

/// True where the teeth have the coordinates of rubor's own: units of 100 mm along the arch from the middle
/// line, and from the biting edge about 0.5.
pub(super) fn has_teeth_coordinates(head: &Head) -> bool {
    let mesh = &head.mesh;
    let mut parts = mesh.parts.iter().filter(|p| p.material == Material::Teeth).peekable();
    let inside = |uv: Vec2| uv.x.abs() <= 0.75 && (uv.y - 0.5).abs() <= 0.25;
    let mut has_left = false;
    let fits = |triangles: &[[u32; 3]], has_left: &mut bool| {
        triangles.as_flattened().iter().map(|v| mesh.vertices[*v as usize].uv).all(|uv| {
            *has_left |= uv.x < -0.05;
            inside(uv)
        })
    };
    let all = parts.peek().is_some()
        && parts.all(|p| {
            fits(&mesh.triangles[p.triangles.start as usize..p.triangles.end as usize], &mut has_left)
        });
    all && has_left
}

/// Enamel of each tooth with its gum, over the coordinates that [`TEETH_TRANSFORM`] maps to the unit square.
pub(super) fn teeth() -> Picture {
    picture(TEETH_SIZE, |x, y| {
        let along_mm = 100.0 * (x - 0.5) / TEETH_SCALE[0];
        let offset = (y - 0.5) / TEETH_SCALE[1];
        let (is_upper, height_mm, s) = (offset > 0.0, 100.0 * offset.abs(), along_mm.abs());
        let edges = if is_upper { UPPER_TEETH } else { LOWER_TEETH };
        let number = (1..8).find(|i| s < edges[*i]).unwrap_or(7) - 1;
        let (left, right) = (edges[number], edges[number + 1]);
        let width = right - left;
        let across = (2.0 * (s - left) / width - 1.0).clamp(-1.0, 1.0);
        let shorter = if number == 1 { 1.4 } else { 0.0 } + if number > 2 { 2.0 } else { 0.0 };
        let crown_mm = if is_upper { 12.0 } else { 9.5 } - shorter;
        let gum_line = crown_mm - 2.2 * across.abs().powf(2.6);
        let gum = smoothstep(gum_line - 0.25, gum_line + 0.25, height_mm);
        let gap_mm = 0.5 * width * (1.0 - across.abs());
        let seam = smoothstep(0.45 - 0.05 * height_mm, 0.02, gap_mm) * (1.0 - gum);
        let root = smoothstep(0.55, 1.0, height_mm / crown_mm);
        let edge = smoothstep(1.6, 0.2, height_mm);
        let side = if along_mm > 0.0 { 0.0 } else { 3.7 } + if is_upper { 1.3 } else { 0.0 };
        let own = fract((number as f32 * 12.9 + side).sin() * 437.5);
        let mut enamel = Vec3::new(0.74, 0.655, 0.52).lerp(Vec3::new(0.58, 0.465, 0.325), 0.55 * root);
        enamel *= 0.88 + 0.16 * own - if number == 2 { 0.10 } else { 0.0 };
        enamel = enamel.lerp(Vec3::new(0.47, 0.45, 0.415), 0.4 * edge);
        enamel *= Vec3::ONE.lerp(Vec3::new(0.42, 0.30, 0.24), seam);
        let flesh = Vec3::new(0.36, 0.125, 0.115) * (0.8 + 0.4 * smoothstep(0.0, 1.0, across.abs()));
        // The cheeks close in on the side teeth, which reflect their red.
        let color =
            enamel.lerp(flesh, gum).lerp(Vec3::new(0.20, 0.075, 0.065), 0.9 * smoothstep(13.0, 26.0, s));
        color * (1.0 - 0.85 * smoothstep(7.0, 32.0, s))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mean(picture: &Picture, inside: impl Fn(f32, f32) -> bool) -> [f32; 3] {
        let (width, height) = picture.size;
        let (mut sum, mut count) = ([0.0; 3], 0.0);
        for (i, t) in picture.texels.as_chunks::<3>().0.iter().enumerate() {
            let (x, y) = (i as u32 % width, i as u32 / width);
            if inside((x as f32 + 0.5) / width as f32, (y as f32 + 0.5) / height as f32) {
                (0..3).for_each(|c| sum[c] += f32::from(t[c]));
                count += 1.0;
            }
        }
        sum.map(|s| s / count)
    }

    #[test]
    fn eyes_take_the_colour_of_the_hair() {
        // The ring of the iris, between a pupil of any size and its dark edge.
        let ring = |x: f32, y: f32| (0.45..0.65).contains(&((x - 0.5).hypot(y - 0.5) * 0.5 / LIMBUS_UV));
        let [dark, pale] = [[0.005; 3], [0.35, 0.25, 0.15]].map(|hair| mean(&eye(hair), ring));
        assert!(dark[0] > 1.3 * dark[2], "brown: {dark:?}");
        assert!(pale[2] > 0.9 * pale[0] && pale[2] > 2.0 * dark[2], "blue: {pale:?}");
        let pupil = mean(&eye([0.005; 3]), |x, y| (x - 0.5).hypot(y - 0.5) < 0.04);
        let sclera = mean(&eye([0.005; 3]), |x, y| (0.26..0.32).contains(&(x - 0.5).hypot(y - 0.5)));
        assert!(pupil.iter().all(|c| *c < 30.0) && sclera.iter().all(|c| *c > 130.0), "{pupil:?} {sclera:?}");
    }

    #[test]
    fn teeth_are_teeth_and_gums_are_gums() {
        let picture = teeth();
        let ([ox, oy], [sx, sy]) = TEETH_TRANSFORM;
        // The middle of the first upper tooth 5 mm above its edge, and the gum between it and the next.
        let at = |along_mm: f32, mm: f32| {
            let (u, v) = (ox + sx * along_mm / 100.0, oy + sy * (0.5 + mm / 100.0));
            mean(&picture, |x, y| (x - u).abs() < 0.004 && (y - v).abs() < 0.02)
        };
        let (tooth, gum) = (at(4.0, 5.0), at(8.3, 11.4));
        assert!(tooth.iter().all(|c| *c > 170.0), "{tooth:?}");
        assert!(gum[0] > 1.4 * gum[1] && gum[1] < 130.0, "{gum:?}");
        assert_eq!(TEETH_TRANSFORM.0[1] + 0.5 * TEETH_TRANSFORM.1[1], 0.5);
    }
}
