// Blending weights of a pixel's edges. Integers only: every adapter finds the same weights.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> bits: array<vec2<u32>>;
@group(0) @binding(2) var<storage, read> areas: array<u32>;
@group(0) @binding(3) var weights_out: texture_storage_2d<rgba8unorm, write>;

// Edges seen along a line: rows as they are, or columns, where left edges run along and top edges across.
struct Lines {
    first: u32,
    words: u32,
    // Pixels in a line, lines.
    length: i32,
    count: i32,
}

fn rows() -> Lines {
    return Lines(0u, params.words.x, i32(params.size.x), i32(params.size.y));
}

fn columns() -> Lines {
    return Lines(params.first_column, params.words.y, i32(params.size.y), i32(params.size.x));
}

// Word `index` of a line. Outside of the image lines run on and nothing crosses them.
fn word_of(lines: Lines, line: i32, index: i32) -> vec2<u32> {
    let last = i32(lines.words) - 1;
    let word = bits[lines.first + u32(line) * lines.words + u32(clamp(index, 0, last))];
    if index < 0 {
        return vec2(0u - (word.x & 1u), 0u);
    }
    if index > last {
        return vec2(0u - (word.x >> 31u), 0u);
    }
    return word;
}

// 32 pixels of a line from `at` on: bit 0 is `at`.
fn ahead(lines: Lines, line: i32, at: i32) -> vec2<u32> {
    let shift = u32(at & 31);
    let near = word_of(lines, line, at >> 5u);
    if shift == 0u {
        return near;
    }
    return (near >> vec2(shift)) | (word_of(lines, line, (at >> 5u) + 1) << vec2(32u - shift));
}

// 32 pixels of a line up to `at`: bit 31 is `at`.
fn behind(lines: Lines, line: i32, at: i32) -> vec2<u32> {
    let shift = u32(31 - (at & 31));
    let near = word_of(lines, line, at >> 5u);
    if shift == 0u {
        return near;
    }
    return (near << vec2(shift)) | (word_of(lines, line, (at >> 5u) - 1) >> vec2(32u - shift));
}

// Pixels from `at` back to the first pixel of its line of edges.
fn search_back(lines: Lines, line: i32, at: i32, limit: u32) -> u32 {
    for (var done = 0u; done < limit; done += 32u) {
        let start = at - i32(done);
        var stops = ~behind(lines, line, start - 1).x;
        if STOP_AT_CROSSINGS {
            let below = behind(lines, line, start).y;
            let above = behind(lines, line - 1, start).y;
            stops |= below | above;
            if RUN_ON && (below & above) != 0u {
                let arms = behind(lines, min(line + 1, lines.count - 1), start).y | behind(lines, max(line - 2, 0), start).y;
                stops = (stops & ~(below & above & arms)) | ~behind(lines, line, start - 1).x;
            }
        }
        if stops != 0u {
            return min(done + countLeadingZeros(stops), limit);
        }
    }
    return limit;
}

// Pixels from `at` on to the last pixel of its line of edges.
fn search_ahead(lines: Lines, line: i32, at: i32, limit: u32) -> u32 {
    for (var done = 0u; done < limit; done += 32u) {
        let next = ahead(lines, line, at + i32(done) + 1);
        var stops = ~next.x;
        if STOP_AT_CROSSINGS {
            let above = ahead(lines, line - 1, at + i32(done) + 1).y;
            stops |= next.y | above;
            if RUN_ON && (next.y & above) != 0u {
                let start = at + i32(done) + 1;
                let arms = ahead(lines, min(line + 1, lines.count - 1), start).y | ahead(lines, max(line - 2, 0), start).y;
                stops = (stops & ~(next.y & above & arms)) | ~next.x;
            }
        }
        if stops != 0u {
            return min(done + countTrailingZeros(stops), limit);
        }
    }
    return limit;
}

fn crossing(lines: Lines, line: i32, at: i32) -> u32 {
    if at <= 0 || at >= lines.length {
        return 0u;
    }
    let row = u32(clamp(line, 0, lines.count - 1));
    let word = bits[lines.first + row * lines.words + u32(at >> 5u)].y;
    return (word >> u32(at & 31)) & 1u;
}

// Two weights in 1/65535: the pixel's own and that of the opposite pixel.
fn line_weights(lines: Lines, line: i32, at: i32, block: u32) -> vec2<u32> {
    let back = search_back(lines, line, at, params.search_limits.x);
    let on = search_ahead(lines, line, at, params.search_limits.y);
    let start = at - i32(back);
    let after = at + i32(on) + 1;
    let near = crossing(lines, line - 1, start) | (crossing(lines, line, start) << 1u);
    let far = crossing(lines, line - 1, after) | (crossing(lines, line, after) << 1u);
    let packed = areas[((block * 16u + near + 4u * far) * params.stride + back) * params.stride + on];
    var area = vec2(packed & 0xffffu, packed >> 16u);
    if ROUND_CORNERS {
        // Equations 10.2 and 10.3, in 1/200.
        let near_counts = u32(back <= on);
        let far_counts = u32(on <= back);
        let reduction = (100u - params.corner_rounding) * 2u / (near_counts + far_counts);
        let below = near_counts * crossing(lines, line + 1, start) + far_counts * crossing(lines, line + 1, after);
        let above = near_counts * crossing(lines, line - 2, start) + far_counts * crossing(lines, line - 2, after);
        area = area * (200u - min(vec2(below, above) * reduction, vec2(200u)));
        area = (area + 100u) / 200u;
    }
    return area;
}

// Bits of a pixel: its top edge, its left edge.
fn pixel_bits(p: vec2<i32>) -> vec2<u32> {
    let q = clamp(p, vec2(0), vec2<i32>(params.size) - 1);
    let word = bits[u32(q.y) * params.words.x + u32(q.x >> 5u)];
    let found = (word >> vec2(u32(q.x & 31))) & vec2(1u);
    return vec2(select(0u, found.x, p.y < i32(params.size.y)), select(0u, found.y, p.x > 0 && p.x < i32(params.size.x)));
}

struct End {
    distance: u32,
    // Mask of the crossing edges, which count only where the end was found.
    found: u32,
    // Top edge of the last pixel looked at.
    tread: u32,
}

// Follows a stair. Its risers are left edges, or right ones (the left edges of the next pixel).
fn walk(p: vec2<i32>, step: vec2<i32>, right: bool) -> End {
    for (var i = 1u; i <= params.diagonal_steps; i++) {
        let q = p + step * i32(i);
        let here = pixel_bits(q);
        var riser = here.y;
        if right {
            riser = pixel_bits(q + vec2(1, 0)).y;
        }
        if (here.x & riser) == 0u {
            return End(i - 1u, 3u, here.x);
        }
    }
    return End(params.diagonal_steps - 1u, 0u, 1u);
}

fn diagonal_area(block: u32, near: u32, far: u32, distances: vec2<u32>) -> vec2<u32> {
    let pattern = block * 16u + near + 4u * far;
    let packed = areas[params.diagonal_base + (pattern * DIAGONAL_SLOT + distances.x) * DIAGONAL_SLOT + distances.y];
    return vec2(packed & 0xffffu, packed >> 16u);
}

// The diagonal that rises to the right through the top edge of a pixel (figure 10.7), or zeros.
fn rising_weights(p: vec2<i32>, left: u32) -> vec2<u32> {
    var near = End(0u, 3u, 0u);
    if left == 1u {
        near = walk(p, vec2(-1, 1), false);
        near.distance += near.tread;
    }
    let far = walk(p, vec2(1, -1), false);
    if near.distance + far.distance <= 2u {
        return vec2(0u);
    }
    let start = p + vec2(-1, 1) * i32(near.distance);
    let end = p + vec2(1, -1) * i32(far.distance);
    let near_code = (pixel_bits(start).y | (pixel_bits(start + vec2(-1, 0)).x << 1u)) & near.found;
    let far_code = (pixel_bits(end + vec2(1, -1)).y | (pixel_bits(end + vec2(1, 0)).x << 1u)) & far.found;
    return diagonal_area(params.blocks.z, near_code, far_code, vec2(near.distance, far.distance));
}

// The same for the one that falls to the right.
fn falling_weights(p: vec2<i32>) -> vec2<u32> {
    let near = walk(p, vec2(-1, -1), true);
    var far = End(0u, 3u, 0u);
    if pixel_bits(p + vec2(1, 0)).y == 1u {
        far = walk(p, vec2(1, 1), true);
        far.distance += far.tread;
    }
    if near.distance + far.distance <= 2u {
        return vec2(0u);
    }
    let start = p - vec2(i32(near.distance));
    let end = p + vec2(i32(far.distance));
    let near_code = (pixel_bits(start + vec2(0, -1)).y | (pixel_bits(start + vec2(-1, 0)).x << 1u)) & near.found;
    let beyond = pixel_bits(end + vec2(1, 0));
    let far_code = (beyond.y | (beyond.x << 1u)) & far.found;
    return diagonal_area(params.blocks.w, near_code, far_code, vec2(near.distance, far.distance)).yx;
}

// An edge along the line above a pixel, and one across it to its left.
fn edges_of(lines: Lines, line: i32, at: i32) -> vec2<u32> {
    if line < 0 || line >= lines.count || at < 0 || at >= lines.length {
        return vec2(0u);
    }
    return (bits[lines.first + u32(line) * lines.words + u32(at >> 5u)] >> vec2(u32(at & 31))) & vec2(1u);
}

// Weights of a stair that a straight line left, or zeros. Treads and risers take turns: riser k comes before tread k,
// which is k pixels further along; tread 0 is the edge in question.
fn stair_weights(lines: Lines, line: i32, at: i32, rises: bool, block: u32) -> vec2<u32> {
    let up = select(1, -1, rises);
    let riser_line = line - select(1, 0, rises);
    let limit = 2u * params.diagonal_steps;
    // Forwards. Reading a riser's pixel gives the tread of a rising stair too, but not that of a falling one.
    var after = 0u;
    var straight = 0u;
    for (var k = 1; after < limit; k++) {
        if edges_of(lines, riser_line + up * k, at + k).y == 0u {
            straight = edges_of(lines, line + up * (k - 1), at + k).x;
            break;
        }
        after++;
        if edges_of(lines, line + up * k, at + k).x == 0u {
            straight = edges_of(lines, riser_line + up * (k + 1), at + k).y;
            break;
        }
        after++;
    }
    if straight == 0u {
        return vec2(0u);
    }
    var before = 0u;
    straight = 0u;
    for (var k = 0; before < limit; k--) {
        if edges_of(lines, riser_line + up * k, at + k).y == 0u {
            straight = edges_of(lines, line + up * k, at + k - 1).x;
            break;
        }
        before++;
        if edges_of(lines, line + up * (k - 1), at + k - 1).x == 0u {
            straight = edges_of(lines, riser_line + up * (k - 1), at + k).y;
            break;
        }
        before++;
    }
    if straight == 0u || ((before ^ after) & 1u) == 1u || before + after < 4u {
        return vec2(0u);
    }
    let packed = areas[params.diagonal_base + (block * (limit + 1u) + before) * (limit + 1u) + after];
    let area = vec2(packed & 0xffffu, packed >> 16u);
    return select(area.yx, area, rises);
}

fn revised_weights(lines: Lines, line: i32, at: i32, line_block: u32, falling_block: u32) -> vec2<u32> {
    if DIAGONALS {
        // Most edges have no riser at either end.
        let below = ahead(lines, line, at).y;
        let above = ahead(lines, line - 1, at).y;
        var found = vec2(0u);
        if (((above >> 1u) | below) & 1u) == 1u {
            found = stair_weights(lines, line, at, true, params.blocks.z);
        }
        if (((below >> 1u) | above) & 1u) == 1u {
            found += stair_weights(lines, line, at, false, falling_block);
        }
        if any(found != vec2(0u)) {
            return found;
        }
    }
    return line_weights(lines, line, at, line_block);
}

fn stored_weight(weight: vec2<u32>) -> vec2<f32> {
    // Whole steps of 1/255, so that storing rounds nothing.
    return vec2<f32>((min(weight, vec2(65535u)) + 128u) / 257u) / 255.0;
}

fn weigh(p: vec2<i32>) {
    let own = pixel_bits(p);
    var vertical = vec2(0u);
    var horizontal = vec2(0u);
    if PUBLISHED {
        // Whether a diagonal stands for the left edge too.
        var treated = false;
        if own.x == 1u {
            if DIAGONALS {
                vertical = rising_weights(p, own.y) + falling_weights(p);
                treated = any(vertical != vec2(0u));
            }
            if !treated {
                vertical = line_weights(rows(), p.y, p.x, params.blocks.y);
            }
        }
        if own.y == 1u && !treated {
            horizontal = line_weights(columns(), p.x, p.y, params.blocks.x);
        }
    } else {
        if own.x == 1u {
            vertical = revised_weights(rows(), p.y, p.x, params.blocks.y, params.blocks.w);
        }
        if own.y == 1u {
            horizontal = revised_weights(columns(), p.x, p.y, params.blocks.x, params.falling_in_columns);
        }
    }
    textureStore(weights_out, p, vec4(stored_weight(vertical), stored_weight(horizontal)));
}
