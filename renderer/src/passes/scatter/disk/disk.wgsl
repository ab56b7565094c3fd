// burley-disk: importance-sampled disk. place.x = radius in mm, weight = rgb of R(r) over the density of taps.
// Concatenated after math.wgsl and gather.wgsl. params.method.rgb = d of each channel, mm.

fn blur(at: vec2i, center: Center) -> vec3f {
    let turn = 2.0 * PI * gradient_noise(vec2f(at));
    let inverse_d = -1.0 / (3.0 * params.method.rgb);
    var sum = vec3f(0.0);
    var total = vec3f(0.0);
    for (var i = 0u; i < params.tap_count; i++) {
        let tap = taps[i];
        let r = tap.place.x;
        let angle = f32(i) * 2.39996323 + turn;
        let offset = round(clamp(r * vec2f(cos(angle), sin(angle)) * center.scale, vec2f(-MAX_REACH), vec2f(MAX_REACH)));
        let t = texel(at + vec2i(offset));
        let gap = gap_mm(center, offset, t.depth_mm);
        let near = follow(gap, params.follow_per_mm);
        if near > 0.0 {
            // What is off the tangent plane is farther: R(sqrt(r^2 + gap^2)) / R(r), R ~ (e + e^3) / r, e = e^(-r / 3d).
            let far = sqrt(r * r + gap * gap);
            let e_far = exp(far * inverse_d);
            let e_near = exp(r * inverse_d);
            let ratio = (e_far + e_far * e_far * e_far) / (e_near + e_near * e_near * e_near) * (r / far);
            let weight = tap.weight.rgb * ratio * near;
            sum += weight * (t.color - center.color);
            total += weight;
        }
    }
    return center.color + select(vec3f(0.0), sum / max(total, vec3f(1e-20)), total > vec3f(1e-20));
}
