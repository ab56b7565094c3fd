//! Film grain and dither from their definitions, in f64.

/// pcg3d of Jarzynski and Olano 2020.
fn hashed(seed: [u32; 3]) -> [u32; 3] {
    let [mut x, mut y, mut z] = seed.map(|s| s.wrapping_mul(1_664_525).wrapping_add(1_013_904_223));
    for is_last in [false, true] {
        x = x.wrapping_add(y.wrapping_mul(z));
        y = y.wrapping_add(z.wrapping_mul(x));
        z = z.wrapping_add(x.wrapping_mul(y));
        if !is_last {
            [x, y, z] = [x, y, z].map(|v| v ^ (v >> 16));
        }
    }
    [x, y, z]
}

/// Two times three numbers between -1/2 and 1/2.
fn uniforms([x, y]: [i32; 2], frame: u32, stream: u32) -> [[f64; 3]; 2] {
    let h = hashed([x as u32, y as u32, frame.wrapping_mul(2).wrapping_add(stream)]);
    let centered = |v: u32| (f64::from(v) + 0.5) / 65536.0 - 0.5;
    [h.map(|h| centered(h & 0xffff)), h.map(|h| centered(h >> 16))]
}

fn triangular(at: [i32; 2], frame: u32) -> [f64; 3] {
    let [first, second] = uniforms(at, frame, 0);
    std::array::from_fn(|c| first[c] + second[c])
}

fn spline(x: f64) -> f64 {
    match x.abs() {
        d if d < 0.5 => 0.75 - d * d,
        d if d < 1.5 => 0.5 * (1.5 - d).powi(2),
        _ => 0.0,
    }
}

/// Noise of variance 1 at a pixel.
pub(super) fn noise(at: [u32; 2], frame: u32, spacing: f64) -> [f64; 3] {
    if spacing <= 1.0 {
        return triangular(at.map(|v| v as i32), frame).map(|n| n * 6f64.sqrt());
    }
    let place = at.map(|v| (f64::from(v) + 0.5) / spacing);
    let (mut sum, mut squares) = ([0.0; 3], 0.0);
    for dy in -1..=1 {
        for dx in -1..=1 {
            let cell = [place[0].floor() as i32 + dx, place[1].floor() as i32 + dy];
            let off = [0, 1].map(|i| place[i] - f64::from(cell[i]) - 0.5);
            let weight = spline(off[0]) * spline(off[1]);
            let own = triangular(cell, frame);
            sum = std::array::from_fn(|c| sum[c] + weight * own[c]);
            squares += weight * weight;
        }
    }
    sum.map(|s| s * 6f64.sqrt() / squares.sqrt())
}

/// A display value with grain and dither, not rounded.
pub(super) fn grained(
    value: [f64; 3],
    at: [u32; 2],
    frame: u32,
    (strength, spacing): (f64, f64),
    dithers: bool,
) -> [f64; 3] {
    let own = noise(at, frame, spacing);
    let common = own.iter().sum::<f64>() / 3f64.sqrt();
    let [first, second] = uniforms(at.map(|v| v as i32), frame, 1);
    std::array::from_fn(|c| {
        let noise = f64::from(super::COMMON) * common + f64::from(super::OWN) * own[c];
        let v = value[c] + value[c] * (1.0 - value[c]) * (strength * noise).clamp(-1.0, 1.0);
        let steps = 255.0 * v;
        let room = 1f64.min(2.0 * steps).min(2.0 * (255.0 - steps));
        if dithers { (steps + 0.9995 * first[c] + room * second[c]) / 255.0 } else { v }
    })
}
