const PI = 3.14159265358979;

fn square(x: f32) -> f32 { return x * x; }

fn pow5(x: f32) -> f32 { let y = x * x; return y * y * x; }

// Interleaved gradient noise (Jimenez 2014, "Next generation post processing in Call of Duty"): 0 to 1, low
// discrepancy over any 3 x 3 pixels, the same in every frame.
fn gradient_noise(pixel: vec2f) -> f32 {
    return fract(52.9829189 * fract(dot(pixel, vec2f(0.06711056, 0.00583715))));
}

// Point i of n on a unit disk, equal areas, turned by an angle (Vogel 1979).
fn vogel_disk(i: u32, n: u32, turn: f32) -> vec2f {
    let r = sqrt((f32(i) + 0.5) / f32(n));
    let a = f32(i) * 2.39996323 + turn;
    return r * vec2f(cos(a), sin(a));
}
