// Exposure, filmic tone map, sRGB transfer, and the average of samples x samples pixels of the frame.

struct Params {
    exposure: f32,
    // Frame pixels on a side of an image pixel.
    samples: u32,
    padding_0: u32,
    padding_1: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var hdr: texture_2d<f32>;
@group(0) @binding(2) var image: texture_storage_2d<rgba8unorm, write>;

// Hable 2010, "Uncharted 2: HDR lighting": shoulder, toe and linear part as one rational function.
fn filmic_curve(x: vec3f) -> vec3f {
    let a = 0.15; let b = 0.50; let c = 0.10; let d = 0.20; let e = 0.02; let f = 0.30;
    return (x * (a * x + c * b) + d * e) / (x * (a * x + b) + d * f) - e / f;
}

// Linear value that becomes white. Hable used 11.2 for outdoor scenes; a studio portrait has no sun in view, and a
// lower white keeps the contrast of skin.
const WHITE = 4.0;

// IEC 61966-2-1.
fn srgb_from_linear(c: vec3f) -> vec3f {
    let x = clamp(c, vec3f(0.0), vec3f(1.0));
    return select(1.055 * pow(x, vec3f(1.0 / 2.4)) - 0.055, 12.92 * x, x <= vec3f(0.0031308));
}

@compute @workgroup_size(8, 8)
fn display(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) local: vec3u) {
    for (var i = 0u; i < BLOCKS; i++) {
        let at = block_pixel(group, local, i);
        if all(at < textureDimensions(image)) {
            display_pixel(at);
        }
    }
}

fn display_pixel(at: vec2u) {
    // The tone map comes before the average: a bright highlight must not swallow the edge that it stands on.
    var sum = vec3f(0.0);
    for (var y = 0u; y < params.samples; y++) {
        for (var x = 0u; x < params.samples; x++) {
            let c = textureLoad(hdr, at * params.samples + vec2u(x, y), 0).rgb;
            sum += filmic_curve(params.exposure * c) / filmic_curve(vec3f(WHITE));
        }
    }
    sum /= f32(params.samples * params.samples);
    textureStore(image, at, vec4f(srgb_from_linear(sum), 1.0));
}
