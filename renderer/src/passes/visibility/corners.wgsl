// The device does not number triangles: each has three corners of its own, which carry its number.
// Concatenated after visibility.wgsl.

@group(0) @binding(3) var<storage, read> points: array<u32>;

struct Corner {
    @builtin(position) clip: vec4f,
    @location(0) @interpolate(flat, either) id: u32,
}

@vertex
fn visibility_vertex(@builtin(vertex_index) corner: u32) -> Corner {
    return Corner(clip_position(points[corner]), id(corner / 3u));
}

@fragment
fn visibility_fragment(corner: Corner) -> @location(0) u32 {
    return corner.id;
}
