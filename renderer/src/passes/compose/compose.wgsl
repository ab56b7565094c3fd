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
fn compose(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) local: vec3u) {
    for (var i = 0u; i < BLOCKS; i++) {
        let at = block_pixel(group, local, i);
        if all(at < textureDimensions(hdr)) {
            compose_pixel(at);
        }
    }
}

fn compose_pixel(at: vec2u) {
    var color = vec4f(params.background.rgb, 0.0);
    if textureLoad(depth, at, 0) > 0.0 {
        let diffuse = textureLoad(scattered, at, 0).rgb * textureLoad(albedo, at, 0).rgb;
        color = vec4f(diffuse + textureLoad(direct, at, 0).rgb, 1.0);
    }
    textureStore(hdr, at, color);
}
