// A pass that gathers neighbours in two dimensions. Concatenated after view.wgsl and common.wgsl; the method that
// follows has fn blur(at: vec2i, center: Center) -> vec3f.

struct Params {
    tap_count: u32,
    follow_per_mm: f32,
    half_width_mm: f32,
    // A pixel on which this is shorter than half a pixel keeps its light.
    visible_mm: f32,
    // Numbers of the method.
    method: vec4f,
}

struct Tap {
    // Place in mm, or what the method says.
    place: vec4f,
    // rgb.
    weight: vec4f,
}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<uniform> params: Params;
@group(0) @binding(2) var<storage, read> taps: array<Tap>;
// rgb, a = depth in mm from view.depth_origin_mm on.
@group(0) @binding(3) var irradiance: texture_2d<f32>;
// a = strength of scattering.
@group(0) @binding(4) var albedo: texture_2d<f32>;
@group(0) @binding(5) var depth: texture_depth_2d;
@group(0) @binding(6) var scattered: texture_storage_2d<rgba16float, write>;

struct Center {
    color: vec3f,
    // From view.depth_origin_mm on.
    depth_mm: f32,
    // Depth change to the next pixel, mm.
    slope: vec2f,
    // Pixels for a millimetre of the kernel along x and along y.
    scale: vec2f,
}

struct Texel {
    color: vec3f,
    depth_mm: f32,
}

fn texel(at: vec2i) -> Texel {
    let c = textureLoad(irradiance, clamp(at, vec2i(0), vec2i(view.size) - 1), 0);
    return Texel(min(c.rgb, vec3f(HALF_MAX)), c.a);
}

fn depth_at(at: vec2i) -> f32 {
    return depth_mm(view, textureLoad(depth, clamp(at, vec2i(0), vec2i(view.size) - 1), 0));
}

@compute @workgroup_size(8, 8)
fn scatter(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= view.size) {
        return;
    }
    let at = vec2i(id.xy);
    let raw = textureLoad(irradiance, at, 0);
    if raw.a >= NO_SKIN_MM {
        textureStore(scattered, at, raw);
        return;
    }
    let strength = textureLoad(albedo, at, 0).a;
    let here = depth_at(at);
    let per_mm = pixels_per_mm(view, here);
    if strength <= 0.0 || strength * per_mm * params.visible_mm < 0.5 {
        textureStore(scattered, at, raw);
        return;
    }
    let slope = vec2f(
        surface_slope(depth_at(at - vec2i(1, 0)), here, depth_at(at + vec2i(1, 0)), per_mm),
        surface_slope(depth_at(at - vec2i(0, 1)), here, depth_at(at + vec2i(0, 1)), per_mm),
    );
    let stretch = vec2f(foreshortening(slope.x, per_mm), foreshortening(slope.y, per_mm));
    let center = Center(min(raw.rgb, vec3f(HALF_MAX)), raw.a, slope, strength * per_mm * stretch);
    textureStore(scattered, at, vec4f(blur(at, center), raw.a));
}

// Distance of a texel from the tangent plane of the centre, mm.
fn gap_mm(center: Center, offset: vec2f, depth_mm: f32) -> f32 {
    return depth_mm - center.depth_mm - dot(center.slope, offset);
}
