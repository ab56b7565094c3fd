// screen-jitter: a sum over fixed taps. place.xy = mm, weight = rgb. Concatenated after gather.wgsl.

fn blur(at: vec2i, center: Center) -> vec3f {
    var result = center.color;
    for (var i = 0u; i < params.tap_count; i++) {
        let tap = taps[i];
        let offset = clamp(tap.place.xy * center.scale, vec2f(-MAX_REACH), vec2f(MAX_REACH));
        let low = floor(offset);
        let f = offset - low;
        for (var corner = 0u; corner < 4u; corner++) {
            let side = vec2f(f32(corner & 1u), f32(corner >> 1u));
            let share = mix(1.0 - f, f, side);
            let there = low + side;
            let t = texel(at + vec2i(there));
            let k = share.x * share.y * follow(gap_mm(center, there, t.depth_mm), params.follow_per_mm);
            result += tap.weight.rgb * k * (t.color - center.color);
        }
    }
    return result;
}
