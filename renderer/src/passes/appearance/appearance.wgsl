// One invocation a texel of the appearance maps: sums hemoglobin distributions and wrinkle zones by their weights.

const MAX_DISTRIBUTIONS = 64u;
const MAX_ZONES = 64u;

struct Params {
    distribution_count: u32,
    zone_count: u32,
    // Layers of four wrinkle maps.
    wrinkle_layers: u32,
    padding_0: u32,
    // Weights four to a vector.
    distribution_weights: array<vec4f, 16>,
    zone_weights: array<vec4f, 16>,
    // Wrinkle map of each zone.
    zone_maps: array<vec4u, 16>,
}

@group(0) @binding(0) var<uniform> params: Params;
// Layer i: bias_i - mu_n and scale_i - 1.
@group(0) @binding(1) var distributions: texture_2d_array<f32>;
// Layer 0: mu_n.
@group(0) @binding(2) var neutral_mean: texture_2d<f32>;
// Four zones a layer.
@group(0) @binding(3) var masks: texture_2d_array<f32>;
@group(0) @binding(4) var linear_clamp: sampler;
// (sum w (bias - mu_n), sum w (scale - 1), mu_n, 0)
@group(0) @binding(5) var blood: texture_storage_2d<rgba16float, write>;
// Layer i: weight of each of four wrinkle maps, 0 to 1.
@group(0) @binding(6) var wrinkles: texture_storage_2d_array<rgba8unorm, write>;

// A little below the largest half float: sums stay finite, so that no weight can turn blood into NaN.
const LARGEST = 60000.0;

@compute @workgroup_size(8, 8)
fn appearance(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(blood);
    if any(id.xy >= size) {
        return;
    }
    let uv = (vec2f(id.xy) + 0.5) / vec2f(size);
    var change = vec2f(0.0);
    for (var i = 0u; i < params.distribution_count; i++) {
        let weight = params.distribution_weights[i / 4u][i % 4u];
        if weight != 0.0 {
            change += weight * textureSampleLevel(distributions, linear_clamp, uv, i, 0.0).xy;
        }
    }
    let mean = textureSampleLevel(neutral_mean, linear_clamp, uv, 0.0).x;
    textureStore(blood, id.xy, vec4f(clamp(change, vec2f(-LARGEST), vec2f(LARGEST)), mean, 0.0));

    for (var layer = 0u; layer < params.wrinkle_layers; layer++) {
        var weights = vec4f(0.0);
        for (var i = 0u; i < params.zone_count; i++) {
            let weight = params.zone_weights[i / 4u][i % 4u];
            let map = params.zone_maps[i / 4u][i % 4u];
            if weight != 0.0 && map / 4u == layer {
                let mask = textureSampleLevel(masks, linear_clamp, uv, i / 4u, 0.0)[i % 4u];
                weights[map % 4u] += weight * mask;
            }
        }
        textureStore(wrinkles, id.xy, layer, clamp(weights, vec4f(0.0), vec4f(1.0)));
    }
}
