// Relief finer than the maps: a net of furrows that only close views resolve. Concatenated after shade.wgsl.

fn micro_hash(p: vec2f) -> vec2f {
    let q = vec2f(dot(p, vec2f(127.1, 311.7)), dot(p, vec2f(269.5, 183.3)));
    return fract(sin(q) * 43758.5453);
}

// Slopes of cells with furrows between them (F2 - F1 of S. Worley 1996), `uv` in cells.
fn cell_slopes(uv: vec2f) -> vec2f {
    let cell = floor(uv);
    var first = 9.0;
    var second = 9.0;
    var to_first = vec2f(0.0);
    var to_second = vec2f(0.0);
    for (var y = -1; y <= 1; y++) {
        for (var x = -1; x <= 1; x++) {
            let at = cell + vec2f(f32(x), f32(y));
            let d = uv - at - micro_hash(at);
            let length2 = dot(d, d);
            if length2 < first {
                second = first;
                to_second = to_first;
                first = length2;
                to_first = d;
            } else if length2 < second {
                second = length2;
                to_second = d;
            }
        }
    }
    let f1 = sqrt(max(first, 1e-6));
    let f2 = sqrt(max(second, 1e-6));
    let gap = (f2 - f1) / 0.3;
    // Height -exp(-gap^2); the slope points out of the furrow.
    return -(to_second / f2 - to_first / f1) * (2.0 * gap / 0.3) * exp(-gap * gap);
}

// Slopes to add, and in z the roughness variance of what the pixel cannot resolve.
fn micro_relief(uv: vec2f, duv_dx: vec2f, duv_dy: vec2f) -> vec3f {
    let pixel_mm = params.mm_per_texture * max(length(duv_dx), length(duv_dy));
    var result = vec3f(0.0);
    // (mesh, mm; slope): the finer net is 20 micrometres deep.
    for (var i = 0; i < 2; i++) {
        let mesh_mm = select(0.65, 0.30, i == 1);
        let depth = select(0.060, 0.045, i == 1);
        // Cells of under three pixels would glitter: they become roughness.
        let seen = smoothstep(0.42 * mesh_mm, 0.17 * mesh_mm, pixel_mm);
        if seen > 0.0 {
            result += vec3f(depth * seen * cell_slopes(uv * params.mm_per_texture / mesh_mm + 17.0 * f32(i)), 0.0);
        }
        result.z += 0.35 * depth * depth * (1.0 - seen);
    }
    return result;
}
