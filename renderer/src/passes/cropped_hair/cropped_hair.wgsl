// One thin triangle a hair, from a root on the skin to a tip. Concatenated after view.wgsl, surface.wgsl and
// the light of fibres.

struct Params {
    // rgb = albedo of hair.
    color: vec4f,
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
@group(0) @binding(7) var<storage, read> previous_positions: array<vec4f>;

// Metres. A triangle as wide as this at its root covers what a fibre of half the width does, 0.07 mm.
const LONGEST = 0.006;
const WIDTH = 0.00014;
// Optical depth, across the skin, of the longest hairs where they are dense: 200 a square centimetre of 6 mm by 0.07 mm.
const DENSE = 0.8;
// Share of it above a tip: hairs are of unlike length and lie over each other.
const TIP_DEPTH = 0.3;
// Share of a hair's direction that stands off the skin; cropped hair lies over at about half a right angle.
const RISE = 0.52;
// Thinnest line that is drawn, pixels; thinner hairs fade instead.
const THINNEST = 1.1;

struct Corner {
    @builtin(position) clip: vec4f,
    @location(0) radiance: vec3f,
    @location(1) @interpolate(flat, either) opacity: f32,
    // Pixels that its root moved, x right, y down: a short stiff hair goes with it.
    @location(2) @interpolate(flat, either) motion: vec2f,
}

struct Fragment {
    // Premultiplied radiance and coverage.
    @location(0) color: vec4f,
    // Premultiplied motion and coverage, as of the overlay. Only frames that keep a history have a target for it.
    @location(1) motion: vec4f,
}

fn scatter(seed: f32) -> vec3f {
    return fract(sin(vec3f(seed * 127.1, seed * 311.7 + 1.3, seed * 74.7 + 2.1)) * 43758.547) - 0.5;
}

@vertex
fn cropped_hair_vertex(@builtin(vertex_index) index: u32) -> Corner {
    let root = roots[index / 3u];
    let corner = index % 3u;
    let triangle = triangles[root.triangle];
    let points = vec3u(vertices[triangle.x].point, vertices[triangle.y].point, vertices[triangle.z].point);
    let a = positions[points.x].xyz;
    let b = positions[points.y].xyz;
    let c = positions[points.z].xyz;
    let two = unpack2x16unorm(root.weights);
    let weights = vec3f(two, 1.0 - two.x - two.y);
    let frame = array<SurfaceFrame, 3>(frames[triangle.x], frames[triangle.y], frames[triangle.z]);
    let normal = normalize(weights.x * frame[0].normal + weights.y * frame[1].normal + weights.z * frame[2].normal);
    let on_skin = weights.x * a + weights.y * b + weights.z * c;
    let place = on_skin + 5e-5 * normal;
    let to_viewer = normalize(view.origin.xyz - place);
    // What lies far round the head cannot show.
    if dot(normal, to_viewer) < -0.35 {
        return Corner(vec4f(0.0, 0.0, -1.0, 1.0), vec3f(0.0), 0.0, vec2f(0.0));
    }
    let look = unpack2x16unorm(root.look);
    let wild = scatter(look.y * 61.7);

    let flow = unpack2x16float(root.flow);
    let lying = flow.x * (b - a) + flow.y * (c - a);
    let along = normalize(lying + RISE * (1.0 + 0.7 * wild.x) * normal + 0.42 * wild);
    let tip = place + look.x * LONGEST * along;

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

    let occlusion = dot(weights, vec3f(frame[0].occlusion, frame[1].occlusion, frame[2].occlusion));
    // Fewer and shorter hairs stand near the hairline.
    let depth = DENSE * look.x * look.x * select(1.0, TIP_DEPTH, corner == 2u);
    let color = min(params.color.rgb * mix(0.55, 1.5, look.y), vec3f(1.0));
    let radiance = hair_radiance(Hair(place, normal, along, color, clamp(occlusion, 0.0, 1.0), depth), to_viewer);

    let now = view.clip_from_world * vec4f(on_skin, 1.0);
    let skin_before = weights.x * previous_positions[points.x].xyz + weights.y * previous_positions[points.y].xyz
        + weights.z * previous_positions[points.z].xyz;
    let before = view.previous_clip_from_world * vec4f(skin_before, 1.0);
    let motion = (now.xy / now.w - before.xy / before.w) * vec2f(0.5, -0.5) * size;
    return Corner(clip, radiance, true_pixels / drawn, motion);
}

@fragment
fn cropped_hair_fragment(corner: Corner) -> Fragment {
    let alpha = corner.opacity;
    return Fragment(vec4f(corner.radiance * alpha, alpha), vec4f(corner.motion * alpha, 0.0, alpha));
}
