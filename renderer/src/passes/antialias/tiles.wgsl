// The loop over the listed tiles, for kernels that define `marked`, which pixels of a row of a tile need work, and
// `work`. Workgroups share the tiles; in a tile the pixels are gathered first, so that no invocation idles beside
// others that search.

@group(0) @binding(4) var<storage, read_write> tiles: Tiles;

struct Tiles {
    count: atomic<u32>,
    // Workgroups that have read the count.
    readers: atomic<u32>,
    list: array<u32>,
}

var<workgroup> found: array<u32, 1024>;
var<workgroup> found_count: atomic<u32>;
var<workgroup> tile_count: u32;

@compute @workgroup_size(128)
fn EVERY_TILE(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) index: u32,
) {
    if index == 0u {
        tile_count = atomicLoad(&tiles.count);
        // The last of all workgroups to come here leaves the list empty for the next image.
        if EMPTIES_LIST && atomicAdd(&tiles.readers, 1u) + 1u == groups.x {
            atomicStore(&tiles.count, 0u);
            atomicStore(&tiles.readers, 0u);
        }
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
            var pixels = marked(tile.x, y);
            let columns_left = params.size.x - tile.x * 32u;
            if columns_left < 32u {
                pixels &= (1u << columns_left) - 1u;
            }
            var slot = atomicAdd(&found_count, countOneBits(pixels));
            while pixels != 0u {
                found[slot] = (index << 5u) | countTrailingZeros(pixels);
                pixels &= pixels - 1u;
                slot++;
            }
        }
        workgroupBarrier();
        let pixels = atomicLoad(&found_count);
        for (var j = index; j < pixels; j += 128u) {
            work(tile * 32u + vec2(found[j] & 31u, found[j] >> 5u));
        }
        workgroupBarrier();
    }
}
