// How a pixel takes its share of its neighbours.

// Light of a stored colour, where blending is done in light.
fn decoded(stored: vec4<f32>) -> vec4<f32> {
    if DECODE {
        return vec4(linear_from_srgb(stored.rgb), stored.a);
    }
    return stored;
}

fn encoded(light: vec4<f32>) -> vec4<f32> {
    if DECODE {
        return vec4(srgb_from_linear(light.rgb), light.a);
    }
    return light;
}

// Weights of the neighbours above, below, left and right. `edges` says which of them exist: the pixel's own top edge,
// that of the pixel below, its own left edge, that of the pixel to the right. Elsewhere the texture holds old values.
fn neighbor_weights(weights: texture_2d<f32>, p: vec2<i32>, edges: vec4<bool>) -> vec4<f32> {
    var found = vec4(0.0);
    if edges.x || edges.z {
        let own = textureLoad(weights, p, 0);
        found = select(vec4(0.0), vec4(own.x, 0.0, own.z, 0.0), vec4(edges.x, false, edges.z, false));
    }
    if edges.y {
        found.y = textureLoad(weights, p + vec2(0, 1), 0).y;
    }
    if edges.w {
        found.w = textureLoad(weights, p + vec2(1, 0), 0).w;
    }
    return found;
}

// Shares of the four neighbours in the mixed colour; the pixel keeps the rest.
fn neighbor_shares(weights: vec4<f32>) -> vec4<f32> {
    var taken = weights;
    if !AVERAGE_LINES {
        // The stronger direction alone; both where they are equal, or the vertical one as published.
        let across = max(weights.z, weights.w);
        let along = max(weights.x, weights.y);
        let vertical = along > across || (PUBLISHED && along == across);
        taken = select(vec4(0.0), weights, vec4(vec2(vertical || along == across), vec2(!vertical)));
    }
    // Equation 9.1 for each line, averaged with the weights themselves.
    return taken * taken / (taken.x + taken.y + taken.z + taken.w);
}

// Light of the pixel and its neighbours, mixed. Straight alpha weighs colours.
fn mixed(color: texture_2d<f32>, p: vec2<i32>, shares: vec4<f32>) -> vec4<f32> {
    let own_share = 1.0 - shares.x - shares.y - shares.z - shares.w;
    let last = vec2<i32>(params.size) - 1;
    var sum = vec3(0.0);
    var plain = vec3(0.0);
    var alpha = 0.0;
    for (var i = 0; i < 5; i++) {
        var share = own_share;
        var q = p;
        if i > 0 {
            share = shares[i - 1];
            if share == 0.0 {
                continue;
            }
            let sign = select(-1, 1, (i & 1) == 0);
            q = clamp(p + select(vec2(sign, 0), vec2(0, sign), i <= 2), vec2(0), last);
        }
        let light = decoded(textureLoad(color, q, 0));
        sum += share * light.a * light.rgb;
        plain += share * light.rgb;
        alpha += share * light.a;
    }
    return vec4(select(plain, sum / alpha, STRAIGHT_ALPHA && alpha > 0.0), alpha);
}
