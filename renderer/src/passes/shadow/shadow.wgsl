// Depth of the head from a light.
// Concatenated after surface.wgsl.

@group(0) @binding(0) var<uniform> clip_from_world: mat4x4f;
@group(0) @binding(1) var<storage, read> positions: array<vec4f>;
@group(0) @binding(2) var<storage, read> vertices: array<Vertex>;
@group(0) @binding(3) var<storage, read> triangles: array<vec4u>;

@vertex
fn shadow_vertex(@builtin(vertex_index) corner: u32) -> @builtin(position) vec4f {
    let vertex = triangles[corner / 3u][corner % 3u];
    return clip_from_world * vec4f(positions[vertices[vertex].point].xyz, 1.0);
}
