// Edge detection. One workgroup a tile of 32 x 32 pixels; each pixel is copied to the output on the way, so that
// later kernels touch only tiles with edges.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var color: texture_2d<f32>;
@group(0) @binding(2) var depth: texture_2d<f32>;
// Bits of 32 neighbouring pixels: edges along the line, edges across it. Rows first, then columns.
@group(0) @binding(3) var<storage, read_write> bits: array<vec2<u32>>;
// Tiles with edges: x in the low and y in the high half.
@group(0) @binding(4) var<storage, read_write> tiles: Tiles;
// The image where COPY, or a single texel.
@group(0) @binding(5) var copy: texture_storage_2d<OUTPUT_FORMAT, write>;

struct Tiles {
    count: atomic<u32>,
    // Workgroups that have read the count.
    readers: u32,
    list: array<u32>,
}

var<workgroup> top_rows: array<atomic<u32>, 32>;
var<workgroup> left_rows: array<atomic<u32>, 32>;
var<workgroup> top_columns: array<atomic<u32>, 32>;
var<workgroup> left_columns: array<atomic<u32>, 32>;
var<workgroup> active_tile: atomic<u32>;

fn inside(p: vec2<i32>) -> vec2<i32> {
    return clamp(p, vec2(0), vec2<i32>(params.size) - 1);
}

// What of a colour makes an edge, in steps.
fn steps_of(stored: vec4<f32>) -> vec4<i32> {
    var seen = stored;
    if LINEAR_INPUT {
        seen = vec4(srgb_from_linear(stored.rgb), stored.a);
    }
    let cover = select(1.0, seen.a, STRAIGHT_ALPHA);
    if EDGE_SOURCE == SOURCE_COLOR {
        seen = vec4(seen.rgb * cover, seen.a);
    } else {
        let luma = 0.2126 * seen.r + 0.7152 * seen.g + 0.0722 * seen.b;
        seen = vec4(luma * cover, 0.0, 0.0, seen.a);
    }
    return vec4<i32>(round(clamp(seen, vec4(0.0), vec4(BRIGHTEST)) * STEPS));
}

fn steps_at(p: vec2<i32>) -> vec4<i32> {
    return steps_of(textureLoad(color, inside(p), 0));
}

fn contrast(a: vec4<i32>, b: vec4<i32>) -> i32 {
    let difference = abs(a - b);
    return max(max(difference.x, difference.y), max(difference.z, difference.w));
}

fn depth_at(p: vec2<i32>) -> f32 {
    return textureLoad(depth, inside(p), 0).x;
}

struct Found {
    left: bool,
    top: bool,
    // An edge of this pixel, or perhaps one on its far borders, which the next tile owns.
    near_edge: bool,
}

fn detect_color(p: vec2<i32>, last: vec2<bool>, stored: vec4<f32>) -> Found {
    var found: Found;
    let here = steps_of(stored);
    let left = steps_at(p - vec2(1, 0));
    let top = steps_at(p - vec2(0, 1));
    let at_left = contrast(here, left);
    let at_top = contrast(here, top);
    var threshold = vec2(params.thresholds.x);
    var lowest = params.thresholds.x;
    if PREDICATION {
        let z = depth_at(p);
        let jumps = abs(z - vec2(depth_at(p - vec2(1, 0)), depth_at(p - vec2(0, 1)))) >= vec2(params.depth_threshold);
        threshold = select(threshold, vec2(params.thresholds.y), jumps);
        lowest = params.thresholds.y;
    }
    found.left = at_left >= threshold.x;
    found.top = at_top >= threshold.y;
    found.near_edge = found.left || found.top;
    if last.x && contrast(here, steps_at(p + vec2(1, 0))) >= lowest {
        found.near_edge = true;
    }
    if last.y && contrast(here, steps_at(p + vec2(0, 1))) >= lowest {
        found.near_edge = true;
    }
    if LOCAL_CONTRAST && (found.left || found.top) {
        // Equation 10.1: twice the contrast has to reach the strongest one around.
        var strongest = max(at_left, at_top);
        strongest = max(strongest, contrast(here, steps_at(p + vec2(1, 0))));
        strongest = max(strongest, contrast(here, steps_at(p + vec2(0, 1))));
        strongest = max(strongest, contrast(left, steps_at(p - vec2(2, 0))));
        strongest = max(strongest, contrast(top, steps_at(p - vec2(0, 2))));
        found.left = found.left && strongest <= 2 * at_left;
        found.top = found.top && strongest <= 2 * at_top;
    }
    return found;
}

fn detect_depth(p: vec2<i32>, last: vec2<bool>) -> Found {
    var found: Found;
    let z = depth_at(p);
    found.left = abs(z - depth_at(p - vec2(1, 0))) >= params.depth_threshold;
    found.top = abs(z - depth_at(p - vec2(0, 1))) >= params.depth_threshold;
    found.near_edge = found.left || found.top
        || (last.x && abs(z - depth_at(p + vec2(1, 0))) >= params.depth_threshold)
        || (last.y && abs(z - depth_at(p + vec2(0, 1))) >= params.depth_threshold);
    return found;
}

@compute @workgroup_size(32, 8)
fn edges(
    @builtin(workgroup_id) tile: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(local_invocation_index) index: u32,
) {
    if index < 32u {
        atomicStore(&top_rows[index], 0u);
        atomicStore(&left_rows[index], 0u);
        atomicStore(&top_columns[index], 0u);
        atomicStore(&left_columns[index], 0u);
        if index == 0u {
            atomicStore(&active_tile, 0u);
        }
    }
    workgroupBarrier();

    for (var part = 0u; part < 4u; part++) {
        let in_tile = vec2(local.x, local.y + 8u * part);
        let p = tile.xy * 32u + in_tile;
        if all(p < params.size) {
            let stored = textureLoad(color, p, 0);
            if COPY {
                textureStore(copy, p, stored);
            }
            let last = in_tile == vec2(31u);
            var found: Found;
            if EDGE_SOURCE == SOURCE_DEPTH {
                found = detect_depth(vec2<i32>(p), last);
            } else {
                found = detect_color(vec2<i32>(p), last, stored);
            }
            if found.near_edge {
                atomicStore(&active_tile, 1u);
                let column_bit = 1u << in_tile.x;
                let row_bit = 1u << in_tile.y;
                if found.top {
                    atomicOr(&top_rows[in_tile.y], column_bit);
                    atomicOr(&top_columns[in_tile.x], row_bit);
                }
                if found.left {
                    atomicOr(&left_rows[in_tile.y], column_bit);
                    atomicOr(&left_columns[in_tile.x], row_bit);
                }
            }
        }
    }
    workgroupBarrier();

    // Lines run on past the last pixel: the rest of the last word repeats the last bit.
    let rest = params.size - tile.xy * 32u;
    if index < 32u {
        let y = tile.y * 32u + index;
        if y < params.size.y {
            var line = atomicLoad(&top_rows[index]);
            if rest.x < 32u && ((line >> (rest.x - 1u)) & 1u) == 1u {
                line |= 0xffffffffu << rest.x;
            }
            bits[y * params.words.x + tile.x] = vec2(line, atomicLoad(&left_rows[index]));
        }
    } else if index < 64u {
        let x = tile.x * 32u + index - 32u;
        if x < params.size.x {
            var line = atomicLoad(&left_columns[index - 32u]);
            if rest.y < 32u && ((line >> (rest.y - 1u)) & 1u) == 1u {
                line |= 0xffffffffu << rest.y;
            }
            bits[params.first_column + x * params.words.y + tile.y] = vec2(line, atomicLoad(&top_columns[index - 32u]));
        }
    } else if LIST_TILES && index == 64u && atomicLoad(&active_tile) == 1u {
        let slot = atomicAdd(&tiles.count, 1u);
        tiles.list[slot] = tile.x | (tile.y << 16u);
    }
}
