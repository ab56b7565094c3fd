// What the kernels of this pass share. The constants in capitals are written in front by Rust.

struct Params {
    // Pixels.
    size: vec2<u32>,
    // 32-bit words in a row and in a column of edge bits.
    words: vec2<u32>,
    // Contrast that makes an edge, in STEPS: without and with a jump of depth.
    thresholds: vec2<i32>,
    // Longest distances searched, backwards and forwards, in pixels.
    search_limits: vec2<u32>,
    // Blocks of coverage for left edges, top edges, rising and falling diagonals.
    blocks: vec4<u32>,
    // Index of the first column in the edge bits; rows come before.
    first_column: u32,
    // Distances a side of the orthogonal coverage.
    stride: u32,
    // Index of the first diagonal coverage.
    diagonal_base: u32,
    // Longest distance searched along diagonals, in pixels.
    diagonal_steps: u32,
    // Difference of depths that is a jump.
    depth_threshold: f32,
    // Percent.
    corner_rounding: u32,
    // 1 where the previous frame may be used.
    history_valid: u32,
    // Block of coverage for falling diagonals seen from columns.
    falling_in_columns: u32,
}

fn srgb_from_linear(linear: vec3<f32>) -> vec3<f32> {
    let curve = 1.055 * pow(max(linear, vec3(0.0031308)), vec3(1.0 / 2.4)) - 0.055;
    return select(curve, 12.92 * max(linear, vec3(0.0)), linear <= vec3(0.0031308));
}

fn linear_from_srgb(stored: vec3<f32>) -> vec3<f32> {
    let curve = pow((max(stored, vec3(0.04045)) + 0.055) / 1.055, vec3(2.4));
    return select(curve, max(stored, vec3(0.0)) / 12.92, stored <= vec3(0.04045));
}
