// The device numbers triangles: corners are shared, and each point is transformed about once.
// Concatenated after visibility.wgsl.

@vertex
fn visibility_vertex(@builtin(vertex_index) point: u32) -> @builtin(position) vec4f {
    return clip_position(point);
}

@fragment
fn visibility_fragment(@builtin(primitive_index) triangle: u32) -> @location(0) u32 {
    return id(triangle);
}
