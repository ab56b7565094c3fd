// One direction of a separable kernel. Concatenated after view.wgsl, common.wgsl and the constants VERTICAL (which
// direction) and LEVELS (whether the image may be smaller than the view). Lines that begin with //ACCUMULATE are of a
// pass that also blends its result into a sum, those with //COARSER of one that adds the sum of the next level to it.

struct Params {
    pair_count: u32,
    follow_per_mm: f32,
    // A pixel on which this is shorter than half a pixel keeps its light.
    visible_mm: f32,
    // A pixel of the image is 2^level pixels of the view.
    level: u32,
    // rgb = share of the result in the sum (papers/004 eq. 4.8).
    share: vec4f,
    // rgb = share of the next level's sum, w = its visible_mm.
    share_coarser: vec4f,
    // rgb = weight of a tap on either side, w = its offset in mm, ascending. The centre has what is left to one.
    pairs: array<vec4f, 32>,
}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<uniform> params: Params;
// rgb, a = depth in mm from view.depth_origin_mm on.
@group(0) @binding(2) var source: texture_2d<f32>;
// a = strength of scattering.
@group(0) @binding(3) var albedo: texture_2d<f32>;
@group(0) @binding(4) var depth: texture_depth_2d;
@group(0) @binding(5) var linear: sampler;
@group(0) @binding(6) var target_image: texture_storage_2d<rgba16float, write>;
//ACCUMULATE @group(0) @binding(7) var sum_before: texture_2d<f32>;
//ACCUMULATE @group(0) @binding(8) var sum_after: texture_storage_2d<rgba16float, write>;
//COARSER @group(0) @binding(9) var coarser: texture_2d<f32>;

// A sample as near to the tangent plane as this, or as a surface with a radius of 25 mm would be, is of one surface.
const PLANE_MM = 0.1;
const CURVATURE_PER_MM = 0.02;
// One that is farther than this has nothing of skin.
const ALL_FAR_MM = 0.99 * FAR_MM;

const THREADS = 128u;
// A workgroup does 4 x 1 blocks of 8 x 8 pixels.
const BLOCKS_IN_GROUP = 4u;
const BLOCK_PIXELS = 64u;

// Pixels of a block in Z-order: neighbouring invocations are neighbours both ways, whichever way the kernel runs.
fn z_order(i: u32) -> vec2u {
    return vec2u(
        (i & 1u) | ((i >> 1u) & 2u) | ((i >> 2u) & 4u),
        ((i >> 1u) & 1u) | ((i >> 2u) & 2u) | ((i >> 3u) & 4u),
    );
}

@compute @workgroup_size(THREADS)
fn scatter(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) thread: u32) {
    for (var i = thread; i < BLOCKS_IN_GROUP * BLOCK_PIXELS; i += THREADS) {
        let block = vec2u(BLOCKS_IN_GROUP * group.x + i / BLOCK_PIXELS, group.y);
        let at = 8u * block + z_order(i % BLOCK_PIXELS);
        if all(at < image_size()) {
            put(vec2i(at), blur(vec2i(at)));
        }
    }
}

fn image_size() -> vec2u {
    if LEVELS {
        return textureDimensions(source);
    }
    return view.size;
}

fn put(at: vec2i, color: vec4f) {
    textureStore(target_image, at, color);
    //ACCUMULATE let before = textureLoad(sum_before, at, 0).rgb;
    //ACCUMULATE var sum = before + params.share.rgb * (color.rgb - before);
    //COARSER sum += params.share_coarser.rgb * coarser_change(at, vec4f(sum, color.a));
    //ACCUMULATE textureStore(sum_after, at, vec4f(sum, color.a));
}

//COARSER // What the next level's sum changes at a pixel. A texel of it is 2 x 2 pixels; between texels it is bilinear
//COARSER // where they are on one surface, else each goes by its own depth.
//COARSER fn coarser_change(at: vec2i, center: vec4f) -> vec3f {
//COARSER     if center.a >= NO_SKIN_MM {
//COARSER         return vec3f(0.0);
//COARSER     }
//COARSER     if params.level == 0u {
//COARSER         let per_mm = pixels_per_mm(view, center.a + view.depth_origin_mm);
//COARSER         if textureLoad(albedo, at, 0).a * per_mm * params.share_coarser.w < 0.5 {
//COARSER             return vec3f(0.0);
//COARSER         }
//COARSER     }
//COARSER     let size = vec2f(textureDimensions(coarser));
//COARSER     let place = 0.5 * vec2f(at) + 0.25;
//COARSER     let light = textureSampleLevel(coarser, linear, place / size, 0.0);
//COARSER     if abs(light.a - center.a) <= PLANE_MM || light.a > ALL_FAR_MM {
//COARSER         return change(light, center, center.a);
//COARSER     }
//COARSER     let low = vec2i(floor(place - 0.5));
//COARSER     let t = place - 0.5 - vec2f(low);
//COARSER     let upper = mix(coarser_texel(low, center), coarser_texel(low + vec2i(1, 0), center), t.x);
//COARSER     let lower = mix(coarser_texel(low + vec2i(0, 1), center), coarser_texel(low + 1, center), t.x);
//COARSER     return mix(upper, lower, t.y);
//COARSER }
//COARSER
//COARSER fn coarser_texel(at: vec2i, center: vec4f) -> vec3f {
//COARSER     let inside = clamp(at, vec2i(0), vec2i(textureDimensions(coarser)) - 1);
//COARSER     return change(textureLoad(coarser, inside, 0), center, center.a);
//COARSER }

fn depth_at(at: vec2i) -> f32 {
    return depth_mm(view, textureLoad(depth, clamp(at, vec2i(0), vec2i(view.size) - 1), 0));
}

// What light changes at the centre, faded by its distance from the tangent plane. Differences keep even light even to
// the last bit.
fn change(light: vec4f, center: vec4f, expected_mm: f32) -> vec3f {
    return follow(light.a - expected_mm, params.follow_per_mm) * (min(light.rgb, vec3f(HALF_MAX)) - center.rgb);
}

fn texel(at: vec2i) -> vec4f {
    return textureLoad(source, clamp(at, vec2i(0), vec2i(image_size()) - 1), 0);
}

// A tap x pixels along the line. On the tangent plane one bilinear sample of light and depth is enough; off it, the two
// texels may be of two surfaces, and each goes by its own depth.
fn tap(at: vec2i, x: f32, center: vec4f, slope: f32, plane_mm: f32) -> vec3f {
    let axis = select(vec2i(1, 0), vec2i(0, 1), VERTICAL);
    // Texels of a level are few and wide: there each always goes by its own depth.
    if !LEVELS {
        let place = (vec2f(at) + 0.5 + x * vec2f(axis)) / vec2f(image_size());
        let light = textureSampleLevel(source, linear, place, 0.0);
        let expected_mm = center.a + slope * x;
        if abs(light.a - expected_mm) <= plane_mm || light.a > ALL_FAR_MM {
            return change(light, center, expected_mm);
        }
    }
    let low = floor(x);
    let before = change(texel(at + i32(low) * axis), center, center.a + slope * low);
    let after = change(texel(at + (i32(low) + 1) * axis), center, center.a + slope * (low + 1.0));
    return mix(before, after, x - low);
}

fn blur(at: vec2i) -> vec4f {
    let raw = textureLoad(source, at, 0);
    if raw.a >= NO_SKIN_MM {
        return raw;
    }
    let center = vec4f(min(raw.rgb, vec3f(HALF_MAX)), raw.a);
    let axis = select(vec2i(1, 0), vec2i(0, 1), VERTICAL);
    var strength: f32;
    // The middle of the pixel in pixels of the view.
    var middle = at;
    // Pixels of the view across this one.
    var across = 1.0;
    if LEVELS {
        middle = (at << vec2u(params.level)) + (1 << (params.level - 1u));
        across = f32(1u << params.level);
        let around = textureGather(3, albedo, linear, vec2f(middle) / vec2f(view.size));
        strength = max(max(around.x, around.y), max(around.z, around.w));
    } else {
        strength = textureLoad(albedo, at, 0).a;
    }
    var here = depth_at(middle);
    var slope = surface_slope(depth_at(middle - axis), here, depth_at(middle + axis), pixels_per_mm(view, here));
    if LEVELS {
        // The middle may be of another surface than the light.
        let mean = center.a + view.depth_origin_mm;
        if abs(here - mean) >= ONE_SURFACE_MM {
            here = mean;
            slope = 0.0;
        }
    }
    let per_mm = pixels_per_mm(view, here);
    let kernel_per_mm = strength * per_mm / across;
    if kernel_per_mm * params.visible_mm < 0.5 {
        return center;
    }
    let scale = kernel_per_mm * foreshortening(slope, per_mm);
    slope *= across;
    var result = center.rgb;
    for (var i = 0u; i < params.pair_count; i++) {
        let pair = params.pairs[i];
        let x = min(pair.w * scale, MAX_REACH);
        let plane_mm = max(PLANE_MM, CURVATURE_PER_MM * pair.w * pair.w);
        result += pair.rgb * (tap(at, x, center, slope, plane_mm) + tap(at, -x, center, slope, plane_mm));
    }
    return vec4f(result, center.a);
}
