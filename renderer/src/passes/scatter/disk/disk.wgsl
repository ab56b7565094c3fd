// burley-disk: importance-sampled disk. place = (x, y, radius, 0) in mm, weight = rgb of R(r) over the density of taps
// and over the falloff at r.
// Concatenated after math.wgsl and gather.wgsl. params.method.rgb = d of each channel, mm.

fn blur(at: vec2i, center: Center) -> vec3f {
    let angle = 2.0 * PI * gradient_noise(vec2f(at));
    let turn = vec2f(cos(angle), sin(angle));
    let inverse_d = -1.0 / (3.0 * params.method.rgb);
    var sum = vec3f(0.0);
    var total = vec3f(0.0);
    for (var i = 0u; i < params.tap_count; i++) {
        let tap = taps[i];
        let place = vec2f(dot(tap.place.xy, vec2f(turn.x, -turn.y)), dot(tap.place.xy, turn.yx));
        let offset = round(clamp(place * center.scale, vec2f(-MAX_REACH), vec2f(MAX_REACH)));
        let t = texel(at + vec2i(offset));
        let gap = gap_mm(center, offset, t.depth_mm);
        let near = follow(gap, params.follow_per_mm);
        if near > 0.0 {
            // What is off the tangent plane is farther: R(sqrt(r^2 + gap^2)), R ~ (e + e^3) / r, e = e^(-r / 3d).
            let far = sqrt(tap.place.z * tap.place.z + gap * gap);
            let e = exp(far * inverse_d);
            let weight = tap.weight.rgb * (e + e * e * e) * (near / far);
            sum += weight * (t.color - center.color);
            total += weight;
        }
    }
    return center.color + select(vec3f(0.0), sum / max(total, vec3f(1e-20)), total > vec3f(1e-20));
}
