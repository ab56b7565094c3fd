// An image of light at half its size. Concatenated after view.wgsl and common.wgsl.

// rgb, a = depth in mm from view.depth_origin_mm on.
@group(0) @binding(0) var source: texture_2d<f32>;
@group(0) @binding(1) var halved: texture_storage_2d<rgba16float, write>;

// Texels as near to the nearest of four as this are of its surface.
const ONE_SURFACE_MM = 4.0;

@compute @workgroup_size(8, 8)
fn halve(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= textureDimensions(halved)) {
        return;
    }
    let size = textureDimensions(source);
    var four: array<vec4f, 4>;
    var nearest = FAR_MM;
    for (var i = 0u; i < 4u; i++) {
        let at = 2u * id.xy + vec2u(i & 1u, i >> 1u);
        four[i] = vec4f(0.0, 0.0, 0.0, FAR_MM);
        if all(at < size) {
            let light = textureLoad(source, at, 0);
            four[i] = vec4f(min(light.rgb, vec3f(HALF_MAX)), light.a);
        }
        nearest = min(nearest, four[i].a);
    }
    var sum = vec4f(0.0);
    var count = 0.0;
    for (var i = 0u; i < 4u; i++) {
        if four[i].a - nearest < ONE_SURFACE_MM {
            sum += four[i];
            count += 1.0;
        }
    }
    textureStore(halved, id.xy, sum / count);
}
