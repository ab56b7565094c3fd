// One direction of a separable kernel, tile by tile. Concatenated after view.wgsl, common.wgsl and the constants
// VERTICAL (which direction) and ACCUMULATE (whether the result is also blended into a sum).

struct Params {
    pair_count: u32,
    follow_per_mm: f32,
    // Offset of the last tap.
    half_width_mm: f32,
    // A pixel on which this is shorter than half a pixel keeps its light.
    visible_mm: f32,
    // rgb = share of the result in the sum (papers/004 eq. 4.8).
    share: vec4f,
    // rgb = weight of a tap on either side, w = its offset in mm, ascending. The centre has what is left to one.
    pairs: array<vec4f, 32>,
}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<uniform> params: Params;
@group(0) @binding(2) var source: texture_2d<f32>;
@group(0) @binding(3) var depth: texture_depth_2d;
@group(0) @binding(4) var target_image: texture_storage_2d<rgba16float, write>;
//ACCUMULATE @group(0) @binding(5) var sum_before: texture_2d<f32>;
//ACCUMULATE @group(0) @binding(6) var sum_after: texture_storage_2d<rgba16float, write>;

const THREADS = 128u;
// A tile is LENGTH pixels along the blur and LINES across.
const LENGTH = 64u;
const LINES = 8u;
const PIXELS_PER_THREAD = 4u;
// Pixels before and after a tile that fit into workgroup memory; wider kernels read the images.
const APRON = 48u;
const SLOTS = 1280u;

var<workgroup> widest: atomic<u32>;
var<workgroup> tile_reach: u32;
// rgb and strength as four halves: exact, as the image holds halves.
var<workgroup> colors: array<vec2u, SLOTS>;
var<workgroup> depths_mm: array<f32, SLOTS>;

// Pixel number `index` of a span of lines: x = along, y = across. Neighbours in x are neighbouring threads.
fn place(index: u32, span: u32) -> vec2u {
    if VERTICAL {
        return vec2u(index / LINES, index % LINES);
    }
    return vec2u(index % span, index / span);
}

fn slot(at: vec2u, span: u32) -> u32 {
    return select(at.y * span + at.x, at.x * LINES + at.y, VERTICAL);
}

fn image_position(tile: vec2u, along: i32, line: u32) -> vec2i {
    if VERTICAL {
        return vec2i(i32(tile.x * LINES + line), i32(tile.y * LENGTH) + along);
    }
    return vec2i(i32(tile.x * LENGTH) + along, i32(tile.y * LINES + line));
}

fn color_at(at: vec2i) -> vec4f {
    return min(textureLoad(source, at, 0), vec4f(HALF_MAX));
}

fn depth_at(at: vec2i, strength: f32) -> f32 {
    return skin_depth_mm(view, textureLoad(depth, at, 0), strength);
}

fn put(at: vec2i, color: vec4f) {
    textureStore(target_image, at, color);
    //ACCUMULATE let before = textureLoad(sum_before, at, 0);
    //ACCUMULATE textureStore(sum_after, at, vec4f(before.rgb + params.share.rgb * (color.rgb - before.rgb), color.a));
}

@compute @workgroup_size(THREADS)
fn scatter(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) thread: u32) {
    let tile = group.xy;
    let size = vec2i(view.size);
    if thread == 0u {
        atomicStore(&widest, 0u);
    }
    workgroupBarrier();
    for (var i = 0u; i < PIXELS_PER_THREAD; i++) {
        let local = place(thread + i * THREADS, LENGTH);
        let at = image_position(tile, i32(local.x), local.y);
        if all(at < size) {
            let strength = textureLoad(source, at, 0).a;
            if strength > 0.0 {
                let scale = strength * pixels_per_mm(view, depth_at(at, strength));
                if params.visible_mm * scale >= 0.5 {
                    atomicMax(&widest, u32(ceil(min(params.half_width_mm * scale, MAX_REACH))) + 1u);
                }
            }
        }
    }
    workgroupBarrier();
    if thread == 0u {
        tile_reach = atomicLoad(&widest);
    }
    let reach = workgroupUniformLoad(&tile_reach);
    let fits = reach <= APRON;
    let span = LENGTH + 2u * reach;
    if reach > 0u && fits {
        for (var i = thread; i < span * LINES; i += THREADS) {
            let local = place(i, span);
            let at = clamp(image_position(tile, i32(local.x) - i32(reach), local.y), vec2i(0), size - 1);
            let color = color_at(at);
            let s = slot(local, span);
            colors[s] = vec2u(pack2x16float(color.rg), pack2x16float(color.ba));
            depths_mm[s] = depth_at(at, color.a);
        }
    }
    workgroupBarrier();
    for (var i = 0u; i < PIXELS_PER_THREAD; i++) {
        let local = place(thread + i * THREADS, LENGTH);
        let at = image_position(tile, i32(local.x), local.y);
        if any(at >= size) {
            continue;
        }
        if reach == 0u {
            put(at, textureLoad(source, at, 0));
        } else if fits {
            put(at, blur_tile(local + vec2u(reach, 0u), span));
        } else {
            put(at, blur_image(at));
        }
    }
}

// The same without workgroup memory: faster where a barrier is expensive (software adapters).
@compute @workgroup_size(8, 8)
fn scatter_untiled(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= view.size) {
        return;
    }
    let at = vec2i(id.xy);
    let raw = textureLoad(source, at, 0);
    if raw.a <= 0.0 {
        put(at, raw);
        return;
    }
    put(at, blur_image(at));
}

// What a texel changes at the centre, faded by its distance from the tangent plane. Differences keep even light even to
// the last bit.
fn tile_change(s: u32, center: vec3f, expected_mm: f32, share: f32) -> vec3f {
    let k = share * follow(depths_mm[s] - expected_mm, params.follow_per_mm);
    let c = colors[s];
    return k * (vec3f(unpack2x16float(c.x), unpack2x16float(c.y).x) - center);
}

fn blur_tile(local: vec2u, span: u32) -> vec4f {
    let stride = select(1u, LINES, VERTICAL);
    let s = slot(local, span);
    let c = vec4f(unpack2x16float(colors[s].x), unpack2x16float(colors[s].y));
    let here = depths_mm[s];
    let per_mm = pixels_per_mm(view, here);
    if c.a * per_mm * params.visible_mm < 0.5 {
        return c;
    }
    let slope = surface_slope(depths_mm[s - stride], here, depths_mm[s + stride], per_mm);
    let scale = c.a * per_mm * foreshortening(slope, per_mm);
    var result = c.rgb;
    for (var i = 0u; i < params.pair_count; i++) {
        let pair = params.pairs[i];
        let x = pair.w * scale;
        let whole = floor(x);
        let fraction = x - whole;
        let step = u32(whole) * stride;
        let rise = slope * whole;
        // Two texels on the line on either side, weighted by distance.
        let change = tile_change(s + step, c.rgb, here + rise, 1.0 - fraction)
            + tile_change(s + step + stride, c.rgb, here + rise + slope, fraction)
            + tile_change(s - step, c.rgb, here - rise, 1.0 - fraction)
            + tile_change(s - step - stride, c.rgb, here - rise - slope, fraction);
        result += pair.rgb * change;
    }
    return vec4f(result, c.a);
}

fn image_change(at: vec2i, center: vec3f, expected_mm: f32, share: f32) -> vec3f {
    let p = clamp(at, vec2i(0), vec2i(view.size) - 1);
    let c = color_at(p);
    return share * follow(depth_at(p, c.a) - expected_mm, params.follow_per_mm) * (c.rgb - center);
}

fn image_depth(at: vec2i) -> f32 {
    let p = clamp(at, vec2i(0), vec2i(view.size) - 1);
    return depth_at(p, textureLoad(source, p, 0).a);
}

fn blur_image(at: vec2i) -> vec4f {
    let stride = select(vec2i(1, 0), vec2i(0, 1), VERTICAL);
    let c = color_at(at);
    let here = depth_at(at, c.a);
    let per_mm = pixels_per_mm(view, here);
    if c.a * per_mm * params.visible_mm < 0.5 {
        return c;
    }
    let slope = surface_slope(image_depth(at - stride), here, image_depth(at + stride), per_mm);
    let scale = c.a * per_mm * foreshortening(slope, per_mm);
    var result = c.rgb;
    for (var i = 0u; i < params.pair_count; i++) {
        let pair = params.pairs[i];
        let x = min(pair.w * scale, MAX_REACH);
        let whole = floor(x);
        let fraction = x - whole;
        let step = i32(whole) * stride;
        let rise = slope * whole;
        let change = image_change(at + step, c.rgb, here + rise, 1.0 - fraction)
            + image_change(at + step + stride, c.rgb, here + rise + slope, fraction)
            + image_change(at - step, c.rgb, here - rise, 1.0 - fraction)
            + image_change(at - step - stride, c.rgb, here - rise - slope, fraction);
        result += pair.rgb * change;
    }
    return vec4f(result, c.a);
}
