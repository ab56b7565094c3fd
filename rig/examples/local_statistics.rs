//! Times the local statistics of a map against a direct sum: `local_statistics [SIDE [RADIUS]]`, default 4096 and 64.

use std::time::Instant;

use rubor_rig::hemoglobin::local_statistics;
use rubor_rig::map::Map;
use rubor_rig::mask::Mask;

fn main() {
    let mut arguments = std::env::args().skip(1).map(|a| a.parse::<u32>().expect("a whole number"));
    let side = arguments.next().unwrap_or(4096);
    let radius = arguments.next().unwrap_or(64);
    let values =
        (0..side * side).map(|i| 0.05 + 0.02 * (i.wrapping_mul(2_654_435_761) as f32 / u32::MAX as f32));
    let map = Map { width: side, height: side, channels: 1, values: values.collect() };
    let mask = Mask::full(side, side);
    let mut best = f64::INFINITY;
    for _ in 0..3 {
        let start = Instant::now();
        let found = local_statistics(&map, &mask, radius).expect("a valid map");
        best = best.min(start.elapsed().as_secs_f64());
        assert!(found.covered.mapped[0]);
    }
    println!("{side} x {side}, r = {radius}: {best:.3} s");
    // The direct sum on a few rows, scaled up.
    let rows = 4;
    let start = Instant::now();
    let r = i64::from(radius);
    let mut checksum = 0.0;
    for y in 0..rows {
        for x in 0..i64::from(side) {
            let (mut sum, mut square, mut n) = (0.0f64, 0.0f64, 0.0f64);
            let y = i64::from(side) / 2 + y;
            for dy in -r..=r {
                let w = ((r * r - dy * dy) as u64).isqrt() as i64;
                let py = (y + dy).clamp(0, i64::from(side) - 1);
                for px in (x - w).max(0)..=(x + w).min(i64::from(side) - 1) {
                    let v = f64::from(map.values[(py * i64::from(side) + px) as usize]);
                    (sum, square, n) = (sum + v, square + v * v, n + 1.0);
                }
            }
            checksum += (square / n - (sum / n).powi(2)).sqrt();
        }
    }
    let direct = start.elapsed().as_secs_f64() * f64::from(side) / rows as f64;
    println!("direct sum, one core: {direct:.1} s ({checksum:.3})");
}
