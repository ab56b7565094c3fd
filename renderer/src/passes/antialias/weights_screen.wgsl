// One invocation a pixel of the whole image.

@compute @workgroup_size(8, 8)
fn weights(@builtin(global_invocation_id) p: vec3<u32>) {
    if all(p.xy < params.size) && any(pixel_bits(vec2<i32>(p.xy)) != vec2(0u)) {
        weigh(vec2<i32>(p.xy));
    }
}
