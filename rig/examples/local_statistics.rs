//! Times the local statistics of a map against a convolution by Fourier transforms and a direct sum, in one run:
//! `local_statistics [SIDE [RADIUS]]`, default 4096 and 64.
//!
//! Prints seconds, the largest relative error of sigma against a sum in f64 about the mean, and bytes per pixel beyond
//! input and output (where /proc tells).

use std::time::Instant;

use rayon::prelude::*;
use rubor_rig::hemoglobin::local_statistics;
use rubor_rig::map::Map;
use rubor_rig::mask::Mask;
use rustfft::num_complex::Complex;
use rustfft::{Fft, FftNum, FftPlanner};

fn main() {
    let mut arguments = std::env::args().skip(1).map(|a| a.parse::<usize>().expect("a whole number"));
    let side = arguments.next().unwrap_or(4096);
    let radius = arguments.next().unwrap_or(64);
    // Blood of 5 % with a contrast of 10^-3 of itself: where single precision begins to fail.
    let noise = |i: usize| (i as u32).wrapping_mul(2_654_435_761) as f32 / u32::MAX as f32 - 0.5;
    let values = (0..side * side).map(|i| 0.05 * (1.0 + 3.5e-3 * noise(i)));
    let map = Map { width: side as u32, height: side as u32, channels: 1, values: values.collect() };
    let mask = Mask::full(map.width, map.height);
    println!("{side} x {side}, r = {radius}, {} threads", rayon::current_num_threads());

    let pixels = (side * side) as f64;
    let (before, processor) = (peak_bytes(), processor_seconds());
    let (mut best, mut found) = (f64::INFINITY, None);
    for _ in 0..3 {
        drop(found.take());
        let start = Instant::now();
        found = Some(local_statistics(&map, &mask, radius as u32).expect("a valid map"));
        best = best.min(start.elapsed().as_secs_f64());
    }
    let found = found.expect("three runs");
    let processor = processor_seconds().zip(processor).map(|(after, before)| (after - before) / 3.0);
    // The output: two maps of f32 and a mask of bytes.
    let beyond = peak_bytes().zip(before).map(|(after, before)| (after - before) / pixels - 9.0);
    // Away from the borders: beyond them the transforms read zeros.
    let inside = side - 2 * radius;
    let truth: Vec<_> = (0..64).map(|i| radius + (i * 61 + 7) * inside / 4000 % inside).collect();
    let expected: Vec<f64> = truth.iter().map(|x| direct(&map, radius, *x, side / 2).1).collect();
    let error = |sigma: &dyn Fn(usize) -> f64| {
        let relative = |(x, e): (&usize, &f64)| (sigma(side / 2 * side + x) / e - 1.0).abs();
        truth.iter().zip(&expected).map(relative).fold(0.0, f64::max)
    };
    let own = error(&|i| f64::from(found.deviation.values[i]));
    print!("exact disk, integers:      {best:8.3} s, error {own:.1e}");
    print!("{}", beyond.map_or(String::new(), |b| format!(", {b:.2} bytes per pixel")));
    println!("{}", processor.map_or(String::new(), |p| format!(", {p:.2} s of processor")));

    let start = Instant::now();
    let sigma = by_transforms::<f32>(&map, radius);
    let seconds = start.elapsed().as_secs_f64();
    println!("Fourier transforms, f32:   {seconds:8.3} s, error {:.1e}", error(&|i| f64::from(sigma[i])));
    drop(sigma);
    let start = Instant::now();
    let sigma = by_transforms::<f64>(&map, radius);
    let seconds = start.elapsed().as_secs_f64();
    println!("Fourier transforms, f64:   {seconds:8.3} s, error {:.1e}", error(&|i| sigma[i]));

    // The direct sum on a few rows, scaled up.
    let rows = 2 * rayon::current_num_threads();
    let start = Instant::now();
    let checksum: f64 =
        (0..rows * side).into_par_iter().map(|i| direct(&map, radius, i % side, side / 2 + i / side).1).sum();
    let seconds = start.elapsed().as_secs_f64() * side as f64 / rows as f64;
    println!("direct sum, from {rows} rows:  {seconds:8.1} s ({checksum:.3e})");
}

/// Mean and deviation of equation 7.1, with the mean subtracted first.
fn direct(map: &Map, radius: usize, x: usize, y: usize) -> (f64, f64) {
    let (r, side) = (radius as i64, i64::from(map.width));
    let (mut sum, mut square, mut n) = (0.0, 0.0, 0.0);
    let shift = f64::from(map.values[y * side as usize + x]);
    for dy in -r..=r {
        let w = ((r * r - dy * dy) as u64).isqrt() as i64;
        let py = y as i64 + dy;
        if !(0..side).contains(&py) {
            continue;
        }
        for px in (x as i64 - w).max(0)..=(x as i64 + w).min(side - 1) {
            let v = f64::from(map.values[(py * side + px) as usize]) - shift;
            (sum, square, n) = (sum + v, square + v * v, n + 1.0);
        }
    }
    let mean = sum / n;
    (mean + shift, (square / n - mean * mean).max(0.0).sqrt())
}

/// Deviation by one complex transform of values and squares, a product with that of the disk, and its inverse. Texels
/// beyond the border count as 0, so the result is only right `radius` texels or more from it.
fn by_transforms<T: FftNum + real::Real>(map: &Map, radius: usize) -> Vec<T> {
    let side = map.width as usize;
    let size = (side + 2 * radius).next_multiple_of(64);
    let mut planner = FftPlanner::<T>::new();
    let (forward, inverse) = (planner.plan_fft_forward(size), planner.plan_fft_inverse(size));
    let zero = Complex { re: T::zero(), im: T::zero() };
    let mut image = vec![zero; size * size];
    for (row, values) in image.chunks_mut(size).zip(map.values.chunks(side)) {
        for (c, v) in row.iter_mut().zip(values) {
            let v = T::of(f64::from(*v));
            *c = Complex { re: v, im: v * v };
        }
    }
    let mut disk = vec![zero; size * size];
    let r = radius as i64;
    let mut area = 0;
    for dy in -r..=r {
        for dx in -r..=r {
            if dx * dx + dy * dy <= r * r {
                let place = |d: i64| d.rem_euclid(size as i64) as usize;
                disk[place(dy) * size + place(dx)].re = T::one();
                area += 1;
            }
        }
    }
    transform(&mut image, size, &forward);
    transform(&mut disk, size, &forward);
    image.par_iter_mut().zip(&disk).for_each(|(a, b)| *a = *a * *b);
    drop(disk);
    transform(&mut image, size, &inverse);
    let norm = T::of(1.0 / (area as f64 * (size * size) as f64));
    let deviation = |i: usize| {
        // The second transform exchanged rows and columns again, so they are back in order.
        let c = image[i / side * size + i % side];
        let (mean, square) = (c.re * norm, c.im * norm);
        let variance = square - mean * mean;
        if variance > T::zero() { variance.root() } else { T::zero() }
    };
    (0..side * side).into_par_iter().map(deviation).collect()
}

/// Two-dimensional transform: rows, transposition, rows, transposition.
fn transform<T: FftNum>(image: &mut Vec<Complex<T>>, size: usize, fft: &std::sync::Arc<dyn Fft<T>>) {
    for _ in 0..2 {
        image.par_chunks_mut(size).for_each(|row| fft.process(row));
        let from = std::mem::take(image);
        *image = (0..size * size).into_par_iter().map(|i| from[i % size * size + i / size]).collect();
    }
}

/// What the two float types share here.
mod real {
    pub(crate) trait Real: Copy + PartialOrd {
        fn of(v: f64) -> Self;
        fn root(self) -> Self;
    }
    impl Real for f32 {
        fn of(v: f64) -> Self {
            v as f32
        }
        fn root(self) -> Self {
            self.sqrt()
        }
    }
    impl Real for f64 {
        fn of(v: f64) -> Self {
            v
        }
        fn root(self) -> Self {
            self.sqrt()
        }
    }
}

/// Processor time of all threads so far, seconds. A tick of the kernel's clock is 10 ms.
fn processor_seconds() -> Option<f64> {
    let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
    // After the name, which may hold blanks: state is field 3, user and system time are 14 and 15.
    let fields: Vec<&str> = stat.rsplit(')').next()?.split_whitespace().collect();
    Some((fields.get(11)?.parse::<f64>().ok()? + fields.get(12)?.parse::<f64>().ok()?) / 100.0)
}

/// Most memory that the process ever had, bytes.
fn peak_bytes() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|l| l.starts_with("VmHWM:"))?;
    Some(1024.0 * line.split_whitespace().nth(1)?.parse::<f64>().ok()?)
}
