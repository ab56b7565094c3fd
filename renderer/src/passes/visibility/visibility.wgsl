// Which triangle is seen in each pixel.
// Concatenated after view.wgsl and surface.wgsl.

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> positions: array<vec4f>;
@group(0) @binding(2) var<uniform> head: vec4u;

fn clip_position(point: u32) -> vec4f {
    let clip = view.clip_from_world * vec4f(positions[point].xyz, 1.0);
    return clip + vec4f(vec2f(2.0, -2.0) * view.jitter / vec2f(view.size) * clip.w, 0.0, 0.0);
}

fn id(triangle: u32) -> u32 {
    return (head.x << HEAD_SHIFT) | (triangle + 1u);
}
