// reference-surface: sums of the profile over samples of the surface. Concatenated after view.wgsl.

struct Params {
    // Origin of the grid in world space, metres.
    origin: vec3f,
    head: u32,
    cells: vec3u,
    cell_mm: f32,
    half_width_mm: f32,
    // Radius inside of which the surface counts as flat.
    near_mm: f32,
    // Area that a sample stands for.
    sample_mm2: f32,
    // Batches so far.
    batches: f32,
    // rgb = light of the profile inside of near_mm.
    near_light: vec4f,
}

struct SurfaceSample {
    place: vec4f,
    barycentric: vec4f,
}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<uniform> params: Params;
@group(0) @binding(2) var visible: texture_2d<u32>;
@group(0) @binding(3) var irradiance: texture_2d<f32>;
// a = strength of scattering.
@group(0) @binding(11) var albedo: texture_2d<f32>;
@group(0) @binding(4) var depth: texture_depth_2d;
// R (rgb, mm^-2) at radii (i / (n - 1))^2 half_width_mm.
@group(0) @binding(5) var<storage, read> profile: array<vec4f>;
// First sample of each cell, and one more.
@group(0) @binding(6) var<storage, read> starts: array<u32>;
@group(0) @binding(7) var<storage, read> samples: array<SurfaceSample>;
@group(0) @binding(8) var<storage, read> light: array<vec4f>;
@group(0) @binding(9) var<storage, read_write> sums: array<vec4f>;
@group(0) @binding(10) var<storage, read_write> squares: array<vec4f>;
@group(0) @binding(12) var scattered: texture_storage_2d<rgba16float, write>;

// Strength under which light counts as unscattered.
const LEAST_STRENGTH = 0.02;

fn profile_at(r_mm: f32) -> vec3f {
    let last = arrayLength(&profile) - 1u;
    let x = sqrt(r_mm / params.half_width_mm) * f32(last);
    let i = min(u32(x), last - 1u);
    return mix(profile[i].rgb, profile[i + 1u].rgb, x - f32(i));
}

fn is_scattering(at: vec2u) -> bool {
    let seen = textureLoad(visible, at, 0).x;
    return seen != 0u && (seen >> 27u) == params.head && textureLoad(albedo, at, 0).a > LEAST_STRENGTH;
}

@compute @workgroup_size(8, 8)
fn gather(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= view.size) || !is_scattering(id.xy) {
        return;
    }
    let center = vec4f(textureLoad(irradiance, id.xy, 0).rgb, textureLoad(albedo, id.xy, 0).a);
    let ray = pixel_ray(view, vec2f(id.xy) + 0.5, view.jitter);
    let metres = view.origin.xyz - params.origin + ray * view_depth(view, textureLoad(depth, id.xy, 0));
    let p = 1e3 * metres;
    let reach = params.half_width_mm * center.a;
    let low = vec3u(clamp(vec3i(floor((p - reach) / params.cell_mm)), vec3i(0), vec3i(params.cells) - 1));
    let high = vec3u(clamp(vec3i(floor((p + reach) / params.cell_mm)), vec3i(0), vec3i(params.cells) - 1));
    var sum = vec3f(0.0);
    for (var z = low.z; z <= high.z; z++) {
        for (var y = low.y; y <= high.y; y++) {
            // Cells of a row lie side by side.
            let row = (z * params.cells.y + y) * params.cells.x;
            let end = starts[row + high.x + 1u];
            for (var i = starts[row + low.x]; i < end; i++) {
                let r = distance(samples[i].place.xyz, p) / center.a;
                if r < params.half_width_mm && light[i].a > 0.0 {
                    let e = light[i].rgb - select(vec3f(0.0), center.rgb, r < params.near_mm);
                    sum += profile_at(r) * e;
                }
            }
        }
    }
    sum = sum * (params.sample_mm2 / (center.a * center.a)) + params.near_light.rgb * center.rgb;
    let slot = id.y * view.size.x + id.x;
    sums[slot] += vec4f(sum, 1.0);
    squares[slot] += vec4f(sum * sum, center.a);
}

@compute @workgroup_size(8, 8)
fn finish(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= view.size) {
        return;
    }
    var color = textureLoad(irradiance, id.xy, 0);
    let sum = sums[id.y * view.size.x + id.x];
    if sum.a > 0.0 {
        color = vec4f(max(sum.rgb / sum.a, vec3f(0.0)), color.a);
    }
    textureStore(scattered, id.xy, color);
}
