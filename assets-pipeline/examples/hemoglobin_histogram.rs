//! How hemoglobin is spread about its local mean, as an SVG: `hemoglobin_histogram [HEAD.glb] > histogram.svg`.
//!
//! J. Jimenez 2012, section 7.4 rests on local histograms of measured hemoglobin that are near Gaussian (figure 7.7);
//! the statistics of the synthesised maps should be such as well. Shown are standardised values, (H - mu) / sigma in
//! discs, of places on the face.

use std::path::Path;

use rubor_assets::import::gltf;
use rubor_rig::head::{Head, Material};
use rubor_rig::hemoglobin::local_statistics;
use rubor_rig::map::Map;
use rubor_rig::mask::Mask;

/// Landmarks that windows are centred on, with a side of this many texels of a map of 2048.
const PLACES: [(&str, &str); 4] =
    [("cheek-left", "cheek"), ("glabella", "forehead"), ("menton", "chin"), ("gonion-left", "jaw")];
const WINDOW: u32 = 96;
/// Radius of the discs, texels of a map of 2048: about 8 mm on the face.
const RADIUS: u32 = 40;
const BINS: usize = 33;
/// Histograms span this many deviations to each side.
const REACH: f64 = 4.0;

/// Texture coordinate of the skin vertex nearest to a landmark.
fn place(head: &Head, landmark: &str) -> Option<[f32; 2]> {
    let at = *head.landmarks.get(landmark)?;
    let mesh = &head.mesh;
    let part = mesh.parts.iter().find(|p| p.material == Material::Skin)?;
    let vertices =
        mesh.triangles[part.triangles.start as usize..part.triangles.end as usize].iter().flatten();
    let distance = |v: &u32| mesh.points[mesh.vertices[*v as usize].point as usize].distance_squared(at);
    let nearest = vertices.min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
    Some(mesh.vertices[*nearest as usize].uv.to_array())
}

/// Standardised values of a window.
fn standardised(map: &Map, [u, v]: [f32; 2]) -> Vec<f64> {
    let scale = |n: u32| (n * map.width).div_ceil(2048).max(4);
    let (side, radius) = (scale(WINDOW), scale(RADIUS));
    let first = |x: f32, size: u32| ((x * size as f32) as u32).saturating_sub(side / 2 + radius);
    let (x0, y0) = (first(u, map.width), first(v, map.height));
    let whole = (side + 2 * radius).min(map.width - x0).min(map.height - y0);
    let mut window = Map::filled(whole, whole, &[0.0]);
    for y in 0..whole {
        for x in 0..whole {
            window.values[(y * whole + x) as usize] = map.texel(x0 + x, y0 + y)[0];
        }
    }
    let statistics =
        local_statistics(&window, &Mask::full(whole, whole), radius).expect("a window of finite values");
    let inner = radius..whole - radius;
    let texels = inner.clone().flat_map(|y| inner.clone().map(move |x| (y * whole + x) as usize));
    texels
        .filter(|i| statistics.deviation.values[*i] > 0.0)
        .map(|i| f64::from((window.values[i] - statistics.mean.values[i]) / statistics.deviation.values[i]))
        .collect()
}

fn main() {
    let path = std::env::args().nth(1).unwrap_or_else(|| "assets/head.glb".into());
    let head = gltf::read(Path::new(&path)).unwrap_or_else(|e| panic!("{e}")).head;
    let map = head.maps.hemoglobin.as_ref().expect("a head with a map of hemoglobin");
    let (width, height) = (200.0, 130.0);
    let total = width * PLACES.len() as f64;
    println!(
        r#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {total} {:.0}" font-family="sans-serif" font-size="9">"#,
        height + 34.0
    );
    println!(r##"<rect width="100%" height="100%" fill="#fff"/>"##);
    for (i, (landmark, name)) in PLACES.iter().enumerate() {
        let Some(uv) = place(&head, landmark) else { continue };
        let values = standardised(map, uv);
        let count = values.len() as f64;
        let mut bins = [0.0f64; BINS];
        for v in &values {
            let bin = (v + REACH) / (2.0 * REACH) * BINS as f64;
            if (0.0..BINS as f64).contains(&bin) {
                bins[bin as usize] += 1.0;
            }
        }
        let moment = |k: i32| values.iter().map(|v| v.powi(k)).sum::<f64>() / count;
        let (mean, second) = (moment(1), moment(2) - moment(1).powi(2));
        let central = |k: i32| values.iter().map(|v| (v - mean).powi(k)).sum::<f64>() / count;
        let (skewness, excess) = (central(3) / second.powf(1.5), central(4) / second.powi(2) - 3.0);
        let step = 2.0 * REACH / BINS as f64;
        let left = width * i as f64 + 14.0;
        let across = (width - 28.0) / (2.0 * REACH);
        let tall = (height - 20.0) / 0.5;
        for (k, n) in bins.iter().enumerate() {
            let density = n / count / step;
            let x = left + across * step * k as f64;
            println!(
                r##"<rect x="{x:.1}" y="{:.1}" width="{:.1}" height="{:.1}" fill="#d98880"/>"##,
                height - tall * density,
                across * step - 0.5,
                tall * density
            );
        }
        let curve: Vec<String> = (0..=80)
            .map(|k| {
                let x = -REACH + 2.0 * REACH * f64::from(k) / 80.0;
                let normal = (-0.5 * x * x).exp() / std::f64::consts::TAU.sqrt();
                format!("{:.1},{:.1}", left + across * (x + REACH), height - tall * normal)
            })
            .collect();
        println!(r##"<polyline points="{}" fill="none" stroke="#222" stroke-width="1"/>"##, curve.join(" "));
        println!(
            r##"<line x1="{left}" x2="{:.1}" y1="{height}" y2="{height}" stroke="#222"/>"##,
            left + width - 28.0
        );
        for sigma in [-2.0, 0.0, 2.0] {
            let x = left + across * (sigma + REACH);
            println!(r##"<text x="{x:.1}" y="{:.1}" text-anchor="middle">{sigma} σ</text>"##, height + 11.0);
        }
        let middle = left + 0.5 * (width - 28.0);
        println!(
            r##"<text x="{middle:.1}" y="{:.1}" text-anchor="middle">{name}: skewness {skewness:.2}, excess kurtosis {excess:.2}</text>"##,
            height + 25.0
        );
    }
    println!("</svg>");
}
