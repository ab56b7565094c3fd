// One direction of the separable subsurface scattering kernel.
// Concatenated after view.wgsl.

const MAX_SAMPLES = 65u;

struct Params {
    // (1, 0) or (0, 1).
    direction: vec2f,
    sample_count: u32,
    // Depth difference that counts as one kernel offset unit, per millimetre (see mod.rs).
    follow_per_mm: f32,
    // rgb = weight, w = offset in mm; the first is the centre.
    samples: array<vec4f, 65>,
}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<uniform> params: Params;
@group(0) @binding(2) var irradiance: texture_2d<f32>;
@group(0) @binding(3) var depth: texture_depth_2d;
@group(0) @binding(4) var scattered: texture_storage_2d<rgba16float, write>;

const MM_PER_METRE = 1000.0;

@compute @workgroup_size(8, 8)
fn scatter(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= view.size) {
        return;
    }
    let center = textureLoad(irradiance, id.xy, 0);
    let strength = center.a;
    if strength <= 0.0 {
        textureStore(scattered, id.xy, center);
        return;
    }
    let depth_mm = MM_PER_METRE * view_depth(view, textureLoad(depth, id.xy, 0));
    // Pixels per millimetre of a surface that faces the camera at this depth.
    let pixels_per_mm = view.origin.w / depth_mm;
    let last = vec2f(view.size) - 1.0;

    var sum = params.samples[0].rgb * center.rgb;
    for (var i = 1u; i < params.sample_count; i++) {
        let tap = params.samples[i];
        let offset_mm = tap.w * strength;
        let at = vec2f(id.xy) + params.direction * (offset_mm * pixels_per_mm);
        // Two texels on the line, weighted by distance: bilinear without leaving skin.
        let low = clamp(floor(at), vec2f(0.0), last);
        let high = min(low + params.direction, last);
        let fraction = clamp(dot(at - low, params.direction), 0.0, 1.0);
        let color = side(vec2u(low), center.rgb, depth_mm) * (1.0 - fraction)
            + side(vec2u(high), center.rgb, depth_mm) * fraction;
        sum += tap.rgb * color;
    }
    textureStore(scattered, id.xy, vec4f(sum, strength));
}

// Irradiance of a neighbour, fading to that of the centre where the surface there is nearer or farther
// (a depth step is not skin that light can cross) or is not skin.
fn side(at: vec2u, center: vec3f, center_depth_mm: f32) -> vec3f {
    let neighbour = textureLoad(irradiance, at, 0);
    let gap_mm = abs(MM_PER_METRE * view_depth(view, textureLoad(depth, at, 0)) - center_depth_mm);
    let away = select(clamp(params.follow_per_mm * gap_mm, 0.0, 1.0), 1.0, neighbour.a <= 0.0);
    return mix(neighbour.rgb, center, away);
}
