
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

// Side of what a pixel that faces the camera sees of a triangle, in texture space: maps are filtered for samples as they
// are for pixels, or relief that no pixel resolves would make the two differ.
fn texture_footprint(corners: vec4u) -> f32 {
    let vertex = array<Vertex, 3>(vertices[corners.x], vertices[corners.y], vertices[corners.z]);
    let a = positions[vertex[0].point].xyz;
    let ab = positions[vertex[1].point].xyz - a;
    let ac = positions[vertex[2].point].xyz - a;
    let uv_ab = vec2f(vertex[1].u - vertex[0].u, vertex[1].v - vertex[0].v);
    let uv_ac = vec2f(vertex[2].u - vertex[0].u, vertex[2].v - vertex[0].v);
    let pixel = distance(view.origin.xyz, a) / view.origin.w;
    let area = abs(uv_ab.x * uv_ac.y - uv_ab.y * uv_ac.x);
    return pixel * sqrt(area / max(length(cross(ab, ac)), 1e-12));
}

@compute @workgroup_size(64)
fn light_samples(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= arrayLength(&surface_samples) {
        return;
    }
    let s = surface_samples[id.x];
    let at = s.barycentric.xy;
    let corners = triangles[bitcast<u32>(s.place.w)];
    let footprint = texture_footprint(corners);
    let surface =
        surface_of(corners, vec3f(1.0 - at.x - at.y, at), vec2f(footprint, 0.0), vec2f(0.0, footprint), 1.0);
    var diffuse = ambient_diffuse(surface);
    var specular = vec3f(0.0);
    let entering = 1.0 / (1.0 - mean_reflected(surface));
    let turn = 2.0 * PI * gradient_noise(vec2f(f32(id.x % 4096u), f32(id.x / 4096u)));
    for (var i = 0u; i < view.light_count; i++) {
        add_light(params.lights[i], surface, surface.smooth_normal, entering, turn, &diffuse, &specular);
    }
    sample_light[id.x] = vec4f(diffuse, surface.scattering);
}
