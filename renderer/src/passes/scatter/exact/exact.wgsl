// reference-screen: the 2D kernel, pixel by pixel. taps = R (rgb, mm^-2) at radii (i / (n - 1))^2 half_width_mm.
// Concatenated after gather.wgsl.

// Parts of a pixel on a side, where the profile is steep.
const PARTS = 8;
// Pixels around the centre that are cut into parts.
const NEAR = 3;
// Pixels from the centre to the edge of the kernel; wider ones skip pixels.
const MOST = 256.0;

fn profile_at(r_mm: f32) -> vec3f {
    let x = sqrt(r_mm / params.half_width_mm) * f32(params.tap_count - 1u);
    let i = u32(x);
    if i + 1u >= params.tap_count {
        return vec3f(0.0);
    }
    return mix(taps[i].weight.rgb, taps[i + 1u].weight.rgb, x - f32(i));
}

fn blur(at: vec2i, center: Center) -> vec3f {
    let mm = 1.0 / center.scale;
    let reach = params.half_width_mm * center.scale;
    let stride = ceil(max(reach.x, reach.y) / MOST);
    let window = vec2i(ceil(reach / stride));
    let cell_mm2 = mm.x * mm.y * stride * stride;
    var sum = vec3f(0.0);
    var arrived = vec3f(0.0);
    for (var y = -window.y; y <= window.y; y++) {
        for (var x = -window.x; x <= window.x; x++) {
            if x == 0 && y == 0 {
                continue;
            }
            let offset = vec2f(vec2i(x, y)) * stride;
            var weight = vec3f(0.0);
            if max(abs(x), abs(y)) <= NEAR {
                for (var j = 0; j < PARTS; j++) {
                    for (var i = 0; i < PARTS; i++) {
                        let part = (vec2f(vec2i(i, j)) + 0.5) / f32(PARTS) - 0.5;
                        weight += profile_at(length((offset + part * stride) * mm));
                    }
                }
                weight /= f32(PARTS * PARTS);
            } else {
                weight = profile_at(length(offset * mm));
            }
            weight *= cell_mm2;
            let t = texel(at + vec2i(offset));
            let k = weight * follow(gap_mm(center, offset, t.depth_mm), params.follow_per_mm);
            sum += k * t.color;
            arrived += k;
        }
    }
    return sum + center.color * (1.0 - arrived);
}
