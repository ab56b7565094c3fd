// One thin triangle a hair, from a root on the skin to a tip. Concatenated after view.wgsl and surface.wgsl.

struct Params {
    // rgb = albedo of hair.
    color: vec4f,
    // rgb = irradiance / pi where the picture has none to offer.
    ambient: vec4f,
}

// A hair on a triangle of the skin.
struct Root {
    // Index into `triangles`.
    triangle: u32,
    // Barycentric weights of the first two corners, unorm16.
    weights: u32,
    // Unit flow of the hair at rest as factors of the edges 0 -> 1 and 0 -> 2, 1 / metre, half floats.
    flow: u32,
    // Length as a share of LONGEST and a random number, unorm16.
    look: u32,
}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<uniform> params: Params;
@group(0) @binding(2) var<storage, read> positions: array<vec4f>;
@group(0) @binding(3) var<storage, read> vertices: array<Vertex>;
@group(0) @binding(4) var<storage, read> triangles: array<vec4u>;
@group(0) @binding(5) var<storage, read> frames: array<SurfaceFrame>;
@group(0) @binding(6) var<storage, read> roots: array<Root>;
// Diffuse radiance of a white surface; a = relative depth, FAR_MM where there is no skin.
@group(0) @binding(7) var irradiance: texture_2d<f32>;

// Metres.
const LONGEST = 0.006;
const WIDTH = 0.00010;
// Share of a hair's direction that stands off the skin; cropped hair lies over at about half a right angle.
const RISE = 0.62;
// Thinnest line that is drawn, pixels; thinner hairs fade instead.
const THINNEST = 1.1;

struct Corner {
    @builtin(position) clip: vec4f,
    @location(0) radiance: vec3f,
    @location(1) @interpolate(flat, either) opacity: f32,
}

fn scatter(seed: f32) -> vec3f {
    return fract(sin(vec3f(seed * 127.1, seed * 311.7 + 1.3, seed * 74.7 + 2.1)) * 43758.547) - 0.5;
}

@vertex
fn cropped_hair_vertex(@builtin(vertex_index) index: u32) -> Corner {
    let root = roots[index / 3u];
    let corner = index % 3u;
    let triangle = triangles[root.triangle];
    let a = positions[vertices[triangle.x].point].xyz;
    let b = positions[vertices[triangle.y].point].xyz;
    let c = positions[vertices[triangle.z].point].xyz;
    let two = unpack2x16unorm(root.weights);
    let weights = vec3f(two, 1.0 - two.x - two.y);
    let normal = normalize(
        weights.x * frames[triangle.x].normal
            + weights.y * frames[triangle.y].normal
            + weights.z * frames[triangle.z].normal,
    );
    let place = weights.x * a + weights.y * b + weights.z * c + 5e-5 * normal;
    let to_viewer = normalize(view.origin.xyz - place);
    let look = unpack2x16unorm(root.look);
    let wild = scatter(look.y * 61.7);

    let flow = unpack2x16float(root.flow);
    let lying = flow.x * (b - a) + flow.y * (c - a);
    let along = normalize(lying + RISE * (1.0 + 0.7 * wild.x) * normal + 0.55 * wild);
    let tip = place + look.x * LONGEST * along;

    // What lies far round the head cannot show.
    if dot(normal, to_viewer) < -0.35 {
        return Corner(vec4f(0.0, 0.0, -1.0, 1.0), vec3f(0.0), 0.0);
    }
    let root_clip = view.clip_from_world * vec4f(place, 1.0);
    let tip_clip = view.clip_from_world * vec4f(tip, 1.0);
    let size = vec2f(view.size);
    let step = (tip_clip.xy / tip_clip.w - root_clip.xy / root_clip.w) * size;
    let across = select(vec2f(1.0, 0.0), normalize(vec2f(-step.y, step.x)), dot(step, step) > 1e-12);
    let true_pixels = WIDTH * view.origin.w / root_clip.w;
    let drawn = max(true_pixels, THINNEST);
    var clip = select(root_clip, tip_clip, corner == 2u);
    let side = select(select(-0.5, 0.5, corner == 1u), 0.0, corner == 2u);
    clip += vec4f(across * side * drawn * 2.0 / size * clip.w, 0.0, 0.0);
    clip += vec4f(vec2f(2.0, -2.0) * view.jitter / size * clip.w, 0.0, 0.0);

    // A hair is in the light that falls on the skin under it, with its shadows.
    let pixel = (root_clip.xy / root_clip.w * vec2f(0.5, -0.5) + 0.5) * size;
    let at = vec2i(clamp(pixel, vec2f(0.0), size - 1.0));
    let seen = textureLoad(irradiance, at, 0);
    let light = select(0.8 * params.ambient.rgb, seen.rgb, seen.a < FAR_MM);
    let tone = mix(0.55, 1.5, look.y) * select(0.75, 1.35, corner == 2u);
    return Corner(clip, params.color.rgb * light * tone, true_pixels / drawn);
}

// Premultiplied radiance and coverage.
@fragment
fn cropped_hair_fragment(corner: Corner) -> @location(0) vec4f {
    return vec4f(corner.radiance * corner.opacity, corner.opacity);
}
