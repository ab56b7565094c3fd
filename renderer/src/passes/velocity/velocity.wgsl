// Motion of what each pixel sees since the previous frame.
// Concatenated after view.wgsl and surface.wgsl.

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<uniform> head: vec4u;
@group(0) @binding(2) var visible: texture_2d<u32>;
@group(0) @binding(3) var<storage, read> positions: array<vec4f>;
@group(0) @binding(4) var<storage, read> previous_positions: array<vec4f>;
@group(0) @binding(5) var<storage, read> vertices: array<Vertex>;
@group(0) @binding(6) var<storage, read> triangles: array<vec4u>;
@group(0) @binding(7) var velocity: texture_storage_2d<rgba16float, write>;

// Place in the image of a point of the world, pixels, without jitter.
fn image_place(clip_from_world: mat4x4f, position: vec3f) -> vec2f {
    let clip = clip_from_world * vec4f(position, 1.0);
    return (clip.xy / clip.w * vec2f(0.5, -0.5) + 0.5) * vec2f(view.size);
}

@compute @workgroup_size(8, 8)
fn velocity_main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) local: vec3u) {
    for (var i = 0u; i < BLOCKS; i++) {
        let at = block_pixel(group, local, i);
        if all(at < view.size) {
            velocity_pixel(at);
        }
    }
}

fn velocity_pixel(at: vec2u) {
    let seen = textureLoad(visible, at, 0).x;
    if seen == 0u {
        // The background is infinitely far and does not move with the camera.
        if head.x == 0u {
            textureStore(velocity, at, vec4f(0.0));
        }
        return;
    }
    if (seen >> HEAD_SHIFT) != head.x {
        return;
    }
    let corners = triangles[(seen & TRIANGLE_MASK) - 1u];
    let points = vec3u(vertices[corners.x].point, vertices[corners.y].point, vertices[corners.z].point);
    let origin = view.origin.xyz;
    let b = ray_barycentrics(
        positions[points.x].xyz - origin,
        positions[points.y].xyz - origin,
        positions[points.z].xyz - origin,
        pixel_ray(view, vec2f(at) + 0.5, view.jitter),
    );
    let now = b.x * positions[points.x].xyz + b.y * positions[points.y].xyz + b.z * positions[points.z].xyz;
    let before = b.x * previous_positions[points.x].xyz
        + b.y * previous_positions[points.y].xyz
        + b.z * previous_positions[points.z].xyz;
    let motion = image_place(view.clip_from_world, now) - image_place(view.previous_clip_from_world, before);
    textureStore(velocity, at, vec4f(motion, 0.0, 0.0));
}
