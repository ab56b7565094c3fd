//! Bakes the skin colour look-up, prints its accuracy and writes it as a PPM picture: `skin_color [FILE.ppm]`.
use rubor_rig::color::*;
use rubor_rig::skin::chromophores::*;

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
    if let Some(file) = std::env::args().nth(1) {
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
