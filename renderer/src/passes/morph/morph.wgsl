// One invocation a point: gathers the offsets of the active shapes and places the head in the world.

struct Params {
    world_from_head: mat4x4f,
    point_count: u32,
    padding_0: u32,
    padding_1: u32,
    padding_2: u32,
}

// xyz = offset in metres, w = shape index (bits).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> rest: array<vec4f>;
@group(0) @binding(2) var<storage, read> delta_starts: array<u32>;
@group(0) @binding(3) var<storage, read> deltas: array<vec4f>;
@group(0) @binding(4) var<storage, read> weights: array<f32>;
@group(0) @binding(5) var<storage, read_write> positions: array<vec4f>;

@compute @workgroup_size(64)
fn morph(@builtin(global_invocation_id) id: vec3u) {
    let point = id.x;
    if point >= params.point_count {
        return;
    }
    var position = rest[point].xyz;
    let end = delta_starts[point + 1u];
    for (var i = delta_starts[point]; i < end; i++) {
        let delta = deltas[i];
        position += weights[bitcast<u32>(delta.w)] * delta.xyz;
    }
    positions[point] = vec4f((params.world_from_head * vec4f(position, 1.0)).xyz, rest[point].w);
}
