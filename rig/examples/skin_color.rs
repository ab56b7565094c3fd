//! Bakes the skin colour look-up, prints how fast and how accurate it is, and writes it as a picture.
//!
//! `cargo run --release -p rubor-rig --example skin_color [PHOTONS [FILE.ppm]]`; with PHOTONS (per wavelength) it also
//! compares with photon walks.

use rubor_rig::color::{
    ciede2000, individual_typology_angle_degrees, lab_from_rec709, rec709_from_lab, srgb_encode,
};
use rubor_rig::skin::chromophores::invert::SkinInverse;
use rubor_rig::skin::chromophores::monte_carlo::{self, Walk};
use rubor_rig::skin::chromophores::published::{PUBLISHED, Source};
use rubor_rig::skin::chromophores::{ChromophoreModel, SkinModel, fractions_at, skin_color_direct};

fn main() {
    let model = ChromophoreModel::default();
    let start = std::time::Instant::now();
    let skin = SkinModel::new(&model);
    let solved = start.elapsed();
    let table = skin.bake(64, 64);
    println!("solve {solved:?}, bake 64 x 64 {:?}", start.elapsed() - solved);
    let (mut worst, mut sum, mut n): (f64, f64, f64) = (0.0, 0.0, 0.0);
    for i in 0..23 {
        for j in 0..23 {
            let (u, v) = ((i as f64 + 0.5) / 23.0, (j as f64 + 0.5) / 23.0);
            let [m, h] = fractions_at(u, v);
            let direct = lab_from_rec709(skin_color_direct(&model, m, h));
            let d = ciede2000(lab_from_rec709(skin.color_at(u, v)), direct);
            worst = worst.max(d);
            sum += d;
            n += 1.0;
        }
    }
    println!("interpolation against direct solution, CIEDE2000: mean {:.4} max {worst:.4}", sum / n);
    for m in [0.0, 0.001, 0.01, 0.02, 0.03, 0.05, 0.1, 0.2, 0.5] {
        for h in [0.0, 0.001, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.32] {
            let lab = lab_from_rec709(skin.color(m, h));
            print!(
                "{:3.0},{:3.0},{:3.0}({:3.0}) ",
                lab[0],
                lab[1],
                lab[2],
                individual_typology_angle_degrees(lab)
            );
        }
        println!("  m={m}");
    }
    published();
    let photons = std::env::args().nth(1).and_then(|n| n.parse().ok()).unwrap_or(0);
    if photons > 0 {
        for mean_cosine in [0.0, 0.8] {
            let walk = Walk { photons, seed: 7, mean_cosine };
            let (mut sum, mut worst): (f64, f64) = (0.0, 0.0);
            for j in 0..6 {
                for i in 0..6 {
                    let (u, v) = (f64::from(i) / 5.0, f64::from(j) / 5.0);
                    let [m, h] = fractions_at(u, v);
                    let truth = lab_from_rec709(monte_carlo::skin_color(&model, m, h, walk).0);
                    let d = ciede2000(lab_from_rec709(skin.color_at(u, v)), truth);
                    print!("{d:.2} ");
                    sum += d;
                    worst = worst.max(d);
                }
                println!();
            }
            println!(
                "table against photons with g = {mean_cosine}, CIEDE2000: mean {:.3} max {worst:.3}",
                sum / 36.0
            );
        }
    }
    if let Some(file) = std::env::args().nth(2) {
        let scale = 8;
        let (w, h) = (table.width * scale, table.height * scale);
        let mut bytes = format!("P6 {w} {h} 255\n").into_bytes();
        for y in 0..h {
            for x in 0..w {
                let texel = table.texels[((y / scale) * table.width + x / scale) as usize];
                bytes.extend(texel.map(|c| (srgb_encode(c.clamp(0.0, 1.0)) * 255.0 + 0.5) as u8));
            }
        }
        std::fs::write(file, bytes).expect("the picture cannot be written");
    }
}

/// Distance of published colours to the model, and by the two constants that move it most.
fn published() {
    let fits = |model: &ChromophoreModel| {
        let lookup = SkinModel::new(model).bake(64, 64);
        let inverse = SkinInverse::new(&lookup);
        PUBLISHED.map(|p| inverse.fit(rec709_from_lab(p.lab).map(|c| c as f32)))
    };
    for (color, fit) in PUBLISHED.iter().zip(fits(&ChromophoreModel::default())) {
        println!(
            "{:26} {:?} {:?}: melanin {:.3}, hemoglobin {:.4}, CIEDE2000 {:.2}",
            color.name, color.source, color.lab, fit.melanin, fit.hemoglobin, fit.residual
        );
    }
    println!("mean CIEDE2000: Xiao, de Rigal, ColorChecker, Monk; tone 8 alone");
    for eumelanin_share in [0.61, 0.74, 0.87] {
        for [epidermis_thickness_mm, stratum_corneum_thickness_mm] in [
            [0.05, 0.004],
            [0.05, 0.008],
            [0.06, 0.0],
            [0.06, 0.004],
            [0.06, 0.006],
            [0.06, 0.008],
            [0.06, 0.012],
            [0.08, 0.006],
        ] {
            let model = ChromophoreModel {
                eumelanin_share,
                epidermis_thickness_mm,
                stratum_corneum_thickness_mm,
                ..Default::default()
            };
            let fits = fits(&model);
            print!(
                "eumelanin {eumelanin_share}, epidermis {epidermis_thickness_mm} mm, \
                 horny layer {stratum_corneum_thickness_mm} mm:"
            );
            for source in [Source::Xiao2017, Source::DeRigal2010, Source::ColorChecker, Source::Monk2019] {
                let of: Vec<f32> = (PUBLISHED.iter().zip(&fits))
                    .filter(|(p, _)| p.source == source)
                    .map(|(_, f)| f.residual)
                    .collect();
                print!(" {:.2}", of.iter().sum::<f32>() / of.len() as f32);
            }
            println!(", {:.2}", fits[19].residual);
        }
    }
}
