// reference-screen: the 2D kernel, pixel by pixel. Concatenated after gather.wgsl.
// taps = the profile's light in the rectangle from 0 to (x, y), rgb, for x, y = (i / (SIDE - 1))^3 half_width_mm.

const SIDE = 192u;
// Pixels from the centre to the edge of the kernel; wider ones skip pixels.
const MOST = 256.0;

// Signed light of the rectangle from the origin to a corner, mm.
fn quadrant(corner: vec2f) -> vec3f {
    let x = pow(min(abs(corner) / params.half_width_mm, vec2f(1.0)), vec2f(1.0 / 3.0)) * f32(SIDE - 1u);
    let i = min(vec2u(x), vec2u(SIDE - 2u));
    let f = x - vec2f(i);
    let at = i.y * SIDE + i.x;
    let low = mix(taps[at].weight.rgb, taps[at + 1u].weight.rgb, f.x);
    let high = mix(taps[at + SIDE].weight.rgb, taps[at + SIDE + 1u].weight.rgb, f.x);
    return sign(corner.x) * sign(corner.y) * mix(low, high, f.y);
}

fn blur(at: vec2i, center: Center) -> vec3f {
    let mm = 1.0 / center.scale;
    let reach = params.half_width_mm * center.scale;
    let stride = ceil(max(reach.x, reach.y) / MOST);
    let window = vec2i(ceil(reach / stride));
    var result = center.color;
    for (var y = -window.y; y <= window.y; y++) {
        let top = (f32(y) - 0.5) * stride * mm.y;
        let bottom = (f32(y) + 0.5) * stride * mm.y;
        let left = (-f32(window.x) - 0.5) * stride * mm.x;
        var before = quadrant(vec2f(left, bottom)) - quadrant(vec2f(left, top));
        for (var x = -window.x; x <= window.x; x++) {
            let right = (f32(x) + 0.5) * stride * mm.x;
            let after = quadrant(vec2f(right, bottom)) - quadrant(vec2f(right, top));
            let offset = vec2f(vec2i(x, y)) * stride;
            let t = texel(at + vec2i(offset));
            let k = follow(gap_mm(center, offset, t.depth_mm), params.follow_per_mm);
            result += (after - before) * k * (t.color - center.color);
            before = after;
        }
    }
    return max(result, vec3f(0.0));
}
