//! Pictures of what a frame left, for people; a hash of the numbers behind them, for machines.

use glam::Vec3;
use rubor_tests::picture::Picture;

use crate::cases::{Case, Channel};
use crate::stage::Drawn;

/// Edges of the window in which points are shown from in front, metres: left and bottom, then its side.
const WINDOW: (f32, f32, f32) = (-0.13, -0.13, 0.26);
/// Pixels of motion that are half of the scale of the picture.
const MOTION_PX: f32 = 4.0;

/// The picture of a case, and of numbers a hash.
pub(crate) fn picture(drawn: &Drawn, case: &Case) -> Option<(Picture, Option<String>)> {
    let [width, height] = case.size;
    let texels = (width * height) as usize;
    match drawn {
        Drawn::Image(rgba) => {
            (rgba.len() == 4 * texels).then(|| (Picture::from_rgba(width, height, rgba), None))
        }
        Drawn::Values(values) => {
            let pixels = values.iter().map(|v| color(*v, case.channel)).collect();
            (values.len() == texels).then(|| (Picture { width, height, pixels }, Some(hash(values))))
        }
        Drawn::Points(points) => {
            let vectors: Vec<[f32; 4]> = points.iter().map(|(_, v)| *v).collect();
            (!points.is_empty()).then(|| (from_in_front(points, case), Some(hash(&vectors))))
        }
    }
}

/// Values as colours: light by a curve that ends at 1 and sRGB's exponent, vectors around a middle grey.
fn color([x, y, z, w]: [f32; 4], channel: Channel) -> [u8; 3] {
    let byte = |v: f32| (v * 255.0).round() as u8;
    let light = |v: f32| byte((v.max(0.0) / (1.0 + v.max(0.0))).powf(1.0 / 2.2));
    let signed = |v: f32| byte(0.5 + 0.5 * v);
    match channel {
        Channel::Image | Channel::Hdr | Channel::Diffuse => [x, y, z].map(light),
        Channel::Depth => [byte(x.max(0.0).sqrt()); 3],
        // Neighbouring numbers in different colours.
        Channel::Ids => {
            let mixed = x.to_bits().wrapping_mul(0x9e37_79b9).rotate_left(13).wrapping_mul(0x85eb_ca6b);
            if x.to_bits() == 0 { [0; 3] } else { [mixed >> 24, mixed >> 16, mixed >> 8].map(|b| b as u8) }
        }
        Channel::Albedo => [x, y, z].map(|v| byte(v.max(0.0).powf(1.0 / 2.2))),
        Channel::Velocity => [signed(x / MOTION_PX), signed(y / MOTION_PX), 128],
        Channel::Positions => [x / 0.13, y / 0.13, z / 0.13].map(signed),
        Channel::Occlusion => [byte(x); 3],
        Channel::Normals => [x, y, z].map(signed),
        // The sign of the bitangent makes one side darker.
        Channel::Tangents => [x, y, z].map(|v| byte((0.5 + 0.5 * v) * (0.8 + 0.2 * w))),
    }
}

/// Points from in front, the nearest one in each pixel.
fn from_in_front(points: &[(Vec3, [f32; 4])], case: &Case) -> Picture {
    let [width, height] = case.size;
    let (left, bottom, side) = WINDOW;
    let mut nearest = vec![f32::MIN; (width * height) as usize];
    let mut pixels = vec![[0; 3]; nearest.len()];
    for (p, vector) in points {
        let column = ((p.x - left) / side * width as f32).floor();
        let row = ((1.0 - (p.y - bottom) / side) * height as f32).floor();
        if !(0.0..width as f32).contains(&column) || !(0.0..height as f32).contains(&row) {
            continue;
        }
        let i = row as usize * width as usize + column as usize;
        if p.z > nearest[i] {
            nearest[i] = p.z;
            pixels[i] = color(*vector, case.channel);
        }
    }
    Picture { width, height, pixels }
}

/// FNV-1a of the bits of all values, 64 bits, in hexadecimal digits.
fn hash(values: &[[f32; 4]]) -> String {
    let bytes = values.as_flattened().iter().flat_map(|v| v.to_bits().to_le_bytes());
    let hash = bytes.fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
    });
    format!("{hash:016x}")
}
