// Blending of the pixels beside edges in the listed tiles; the edge pass has copied all other pixels.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> bits: array<vec2<u32>>;
@group(0) @binding(2) var color: texture_2d<f32>;
@group(0) @binding(3) var weights: texture_2d<f32>;
@group(0) @binding(5) var output: texture_storage_2d<OUTPUT_FORMAT, write>;

fn row_word(x: u32, y: u32) -> vec2<u32> {
    if x >= params.words.x || y >= params.size.y {
        return vec2(0u);
    }
    return bits[y * params.words.x + x];
}

fn marked(tile_x: u32, y: u32) -> u32 {
    let own = row_word(tile_x, y);
    let right = (own.y >> 1u) | (row_word(tile_x + 1u, y).y << 31u);
    return own.x | own.y | right | row_word(tile_x, y + 1u).x;
}

fn work(p: vec2<u32>) {
    let shift = vec2(p.x & 31u);
    let own = (row_word(p.x >> 5u, p.y) >> shift) & vec2(1u);
    let below = (row_word(p.x >> 5u, p.y + 1u).x >> shift.x) & 1u;
    let right = (row_word((p.x + 1u) >> 5u, p.y).y >> ((p.x + 1u) & 31u)) & 1u;
    let edges = vec4(own.x, below, own.y, right) == vec4(1u);
    let found_weights = neighbor_weights(weights, vec2<i32>(p), edges);
    if any(found_weights > vec4(0.0)) {
        textureStore(output, p, encoded(mixed(color, vec2<i32>(p), neighbor_shares(found_weights))));
    }
}
