
// Diffuse light at points of the surface instead of pixels; for the reference that integrates over the surface.
// Concatenated after shade.wgsl.

struct SurfaceSample {
    // Millimetres from the origin of the grid; w = triangle (bits).
    place: vec4f,
    // xy = barycentric coordinates of the second and third corner.
    barycentric: vec4f,
}

@group(2) @binding(3) var<storage, read> surface_samples: array<SurfaceSample>;
// rgb = diffuse radiance of a white surface, a = scattering strength.
@group(2) @binding(4) var<storage, read_write> sample_light: array<vec4f>;

@compute @workgroup_size(64)
fn light_samples(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= arrayLength(&surface_samples) {
        return;
    }
    let s = surface_samples[id.x];
    let at = s.barycentric.xy;
    let corners = triangles[bitcast<u32>(s.place.w)];
    let surface = surface_of(corners, vec3f(1.0 - at.x - at.y, at), vec2f(0.0), vec2f(0.0), 1.0);
    var diffuse = ambient_diffuse(surface);
    var specular = vec3f(0.0);
    let turn = 2.0 * PI * gradient_noise(vec2f(f32(id.x % 4096u), f32(id.x / 4096u)));
    for (var i = 0u; i < view.light_count; i++) {
        add_light(params.lights[i], surface, surface.smooth_normal, turn, &diffuse, &specular);
    }
    sample_light[id.x] = vec4f(diffuse, surface.scattering);
}
