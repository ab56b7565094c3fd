// Which triangle is seen in each pixel.
// Concatenated after view.wgsl and surface.wgsl.

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> positions: array<vec4f>;
@group(0) @binding(2) var<storage, read> vertices: array<Vertex>;
@group(0) @binding(3) var<storage, read> triangles: array<vec4u>;
@group(0) @binding(4) var<uniform> head: vec4u;

struct Corner {
    @builtin(position) clip: vec4f,
    @location(0) @interpolate(flat, either) id: u32,
}

@vertex
fn visibility_vertex(@builtin(vertex_index) corner: u32) -> Corner {
    let triangle = corner / 3u;
    let vertex = triangles[triangle][corner % 3u];
    var clip = view.clip_from_world * vec4f(positions[vertices[vertex].point].xyz, 1.0);
    clip += vec4f(vec2f(2.0, -2.0) * view.jitter / vec2f(view.size) * clip.w, 0.0, 0.0);
    return Corner(clip, (head.x << HEAD_SHIFT) | (triangle + 1u));
}

@fragment
fn visibility_fragment(corner: Corner) -> @location(0) u32 {
    return corner.id;
}
