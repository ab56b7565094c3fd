// The view of a frame. Directions and positions are in world space, metres.
struct View {
    clip_from_world: mat4x4f,
    previous_clip_from_world: mat4x4f,
    // Camera position; w = pixels per radian at the centre of the image, size.y / (2 tan(fov / 2)).
    origin: vec4f,
    // A pixel's ray is forward + ndc.x * right + ndc.y * up (not normalised; its view depth is 1).
    right: vec4f,
    up: vec4f,
    forward: vec4f,
    size: vec2u,
    // Number of heads, and environment map present (1) or not (0).
    head_count: u32,
    has_environment: u32,
    // Subpixel jitter in pixels.
    jitter: vec2f,
    near: f32,
    light_count: u32,
    // Where in the pixel light is computed: the mean of the samples that share it, as a jitter.
    shading_jitter: vec2f,
    // View depth that depths in the irradiance image are relative to, millimetres.
    depth_origin_mm: f32,
    padding: f32,
}

// Ray through a point of the image in pixels (pixel centres are at .5).
fn pixel_ray(view: View, pixel: vec2f, jitter: vec2f) -> vec3f {
    let ndc = vec2f(2.0, -2.0) * ((pixel - jitter) / vec2f(view.size)) + vec2f(-1.0, 1.0);
    return view.forward.xyz + ndc.x * view.right.xyz + ndc.y * view.up.xyz;
}

// Distance along the view direction, metres, from reversed infinite depth; 0 where nothing was drawn.
fn view_depth(view: View, depth: f32) -> f32 {
    return select(0.0, view.near / depth, depth > 0.0);
}

// What the alpha of the irradiance image holds where nothing scatters, mm: no kernel reaches it, nor anything that is
// interpolated with it.
const FAR_MM = 8192.0;

// View depth in millimetres from the origin of depths on, up to FAR_MM either way. A half keeps 0.06 mm at 100 mm.
fn relative_depth_mm(view: View, depth: f32) -> f32 {
    return clamp(1000.0 * view_depth(view, depth) - view.depth_origin_mm, -FAR_MM, FAR_MM);
}
