// One workgroup a listed tile. It first gathers the pixels with edges, so that no invocation idles beside others that
// search.

@group(0) @binding(4) var<storage, read> tiles: Tiles;

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

@compute @workgroup_size(64)
fn weights(
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
            let word = bits[y * params.words.x + tile.x];
            let columns_left = params.size.x - tile.x * 32u;
            var marked = word.x | word.y;
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
            weigh(vec2<i32>(tile * 32u + vec2(found[j] & 31u, found[j] >> 5u)));
        }
        workgroupBarrier();
    }
}
