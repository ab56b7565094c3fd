// One invocation a point: gathers offsets and changes of ambient visibility of the active shapes, and places the head in
// the world.

struct Params {
    world_from_head: mat4x4f,
    point_count: u32,
    padding_0: u32,
    padding_1: u32,
    padding_2: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
// w = ambient visibility.
@group(0) @binding(1) var<storage, read> rest: array<vec4f>;
@group(0) @binding(2) var<storage, read> delta_starts: array<u32>;
// xyz = offset in metres (bits of floats), w = 12 bits of shape and the change of ambient visibility at weights 0.5 and
// 1, 10 bits each, in steps of 1/511.
@group(0) @binding(3) var<storage, read> deltas: array<vec4u>;
@group(0) @binding(4) var<storage, read> weights: array<f32>;
@group(0) @binding(5) var<storage, read_write> positions: array<vec4f>;

@compute @workgroup_size(64)
fn morph(@builtin(global_invocation_id) id: vec3u) {
    let point = id.x;
    if point >= params.point_count {
        return;
    }
    var position = rest[point].xyz;
    var visibility = rest[point].w;
    let end = delta_starts[point + 1u];
    for (var i = delta_starts[point]; i < end; i++) {
        let delta = deltas[i];
        let weight = weights[delta.w & 0xfffu];
        position += weight * bitcast<vec3f>(delta.xyz);
        // The parabola through rest and both poses.
        let w = saturate(weight);
        let change = vec2f(f32(extractBits(bitcast<i32>(delta.w), 12u, 10u)), f32(extractBits(bitcast<i32>(delta.w), 22u, 10u))) / 511.0;
        visibility += 4.0 * w * (1.0 - w) * change.x + w * (2.0 * w - 1.0) * change.y;
    }
    positions[point] = vec4f((params.world_from_head * vec4f(position, 1.0)).xyz, saturate(visibility));
}
