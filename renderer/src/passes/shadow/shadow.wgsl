// Depth of the head from a light.
// Concatenated after surface.wgsl.

@group(0) @binding(0) var<uniform> clip_from_world: mat4x4f;
@group(0) @binding(1) var<storage, read> positions: array<vec4f>;

@vertex
fn shadow_vertex(@builtin(vertex_index) point: u32) -> @builtin(position) vec4f {
    return clip_from_world * vec4f(positions[point].xyz, 1.0);
}
