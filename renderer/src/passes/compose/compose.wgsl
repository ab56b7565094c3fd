// Diffuse radiance times albedo, plus what was not scattered, over the background.

struct Params {
    // rgb = linear radiance.
    background: vec4f,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var scattered: texture_2d<f32>;
@group(0) @binding(2) var albedo: texture_2d<f32>;
@group(0) @binding(3) var direct: texture_2d<f32>;
@group(0) @binding(4) var depth: texture_depth_2d;
@group(0) @binding(5) var hdr: texture_storage_2d<rgba16float, write>;

@compute @workgroup_size(8, 8)
fn compose(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= textureDimensions(hdr)) {
        return;
    }
    var color = vec4f(params.background.rgb, 0.0);
    if textureLoad(depth, id.xy, 0) > 0.0 {
        let diffuse = textureLoad(scattered, id.xy, 0).rgb * textureLoad(albedo, id.xy, 0).rgb;
        color = vec4f(diffuse + textureLoad(direct, id.xy, 0).rgb, 1.0);
    }
    textureStore(hdr, id.xy, color);
}
