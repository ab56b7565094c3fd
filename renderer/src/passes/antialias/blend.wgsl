// Blending in the listed tiles; the edge pass has copied all other pixels. One workgroup a tile, which first gathers
// the pixels beside edges.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> bits: array<vec2<u32>>;
@group(0) @binding(2) var<storage, read> tiles: Tiles;
@group(0) @binding(3) var color: texture_2d<f32>;
@group(0) @binding(4) var weights: texture_2d<f32>;
@group(0) @binding(5) var output: texture_storage_2d<OUTPUT_FORMAT, write>;

struct Tiles {
    count: u32,
    workgroups_x: u32,
    workgroups_y: u32,
    workgroups_z: u32,
    list: array<u32>,
}

var<workgroup> found: array<u32, 1024>;
var<workgroup> found_count: atomic<u32>;
var<workgroup> tile_count: u32;

fn row_word(x: u32, y: u32) -> vec2<u32> {
    if x >= params.words.x || y >= params.size.y {
        return vec2(0u);
    }
    return bits[y * params.words.x + x];
}

@compute @workgroup_size(64)
fn blend(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) index: u32,
) {
    if index == 0u {
        tile_count = tiles.count;
    }
    let count = workgroupUniformLoad(&tile_count);
    for (var i = group.x; i < count; i += groups.x) {
        let tile = vec2(tiles.list[i] & 0xffffu, tiles.list[i] >> 16u);
        if index == 0u {
            atomicStore(&found_count, 0u);
        }
        workgroupBarrier();
        let y = tile.y * 32u + index;
        if index < 32u && y < params.size.y {
            let own = row_word(tile.x, y);
            let right = (own.y >> 1u) | (row_word(tile.x + 1u, y).y << 31u);
            var marked = own.x | own.y | right | row_word(tile.x, y + 1u).x;
            let columns_left = params.size.x - tile.x * 32u;
            if columns_left < 32u {
                marked &= (1u << columns_left) - 1u;
            }
            var slot = atomicAdd(&found_count, countOneBits(marked));
            while marked != 0u {
                found[slot] = (index << 5u) | countTrailingZeros(marked);
                marked &= marked - 1u;
                slot++;
            }
        }
        workgroupBarrier();
        let pixels = atomicLoad(&found_count);
        for (var j = index; j < pixels; j += 64u) {
            let p = tile * 32u + vec2(found[j] & 31u, found[j] >> 5u);
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
        workgroupBarrier();
    }
}
