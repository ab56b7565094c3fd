// Lashes, hair cards and the wet film of the eye, blended over the picture.
// Concatenated after view.wgsl, surface.wgsl and the light of fibres.

struct Params {
    // rgb = irradiance / pi that cards and films see on average.
    ambient: vec4f,
    // First overlay triangle.
    first: u32,
    padding_0: u32,
    padding_1: u32,
    padding_2: u32,
    // rgb = albedo of hair.
    hair: vec4f,
}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<uniform> params: Params;
@group(0) @binding(2) var<storage, read> positions: array<vec4f>;
@group(0) @binding(3) var<storage, read> vertices: array<Vertex>;
@group(0) @binding(4) var<storage, read> triangles: array<vec4u>;
@group(0) @binding(5) var<storage, read> frames: array<SurfaceFrame>;
@group(0) @binding(6) var<storage, read> previous_positions: array<vec4f>;

// Numbers of rig's Material::ALL.
const LASH = 5u;
const HAIR = 6u;

struct Corner {
    @builtin(position) clip: vec4f,
    @location(0) uv: vec2f,
    @location(1) position: vec3f,
    @location(2) normal: vec3f,
    @location(3) @interpolate(flat, either) material: u32,
    // Share of the drawn width that the hair fills, and where across it, -1 to 1.
    @location(4) opacity: f32,
    @location(5) across: f32,
    // x, y, w of the place in the image, without jitter, in this frame and the previous one.
    @location(6) now: vec3f,
    @location(7) before: vec3f,
    // Of a strand.
    @location(8) radiance: vec3f,
}

struct Fragment {
    // Premultiplied radiance and coverage.
    @location(0) color: vec4f,
    // Premultiplied motion in pixels, x right, y down, and coverage: it is mixed with that of what lies behind as the
    // colours are. Only frames that keep a history have a target for it.
    @location(1) motion: vec4f,
}

// Width of a hair that is geometry, at its root, metres (u >= 2: rubor-assets' strands).
const STRAND_WIDTH = 0.00013;

// Lashes are the stoutest hairs of the face, and each stands for two or three that cling together.
const LASH_STOUTNESS = 1.7;
// Optical depth of what lies over the mean hair of a brow; lashes stand alone. Chosen by eye.
const BROW_DEPTH = 0.4;
const LASH_COLOR = vec3f(0.016, 0.011, 0.008);

@vertex
fn overlay_vertex(@builtin(vertex_index) corner: u32) -> Corner {
    let triangle = triangles[params.first + corner / 3u];
    let index = triangle[corner % 3u];
    let vertex = vertices[index];
    var position = positions[vertex.point].xyz;
    let frame = frames[index];
    var opacity = 1.0;
    var across = 0.0;
    var radiance = vec3f(0.0);
    var clip = view.clip_from_world * vec4f(position, 1.0);
    if (triangle.w == LASH || triangle.w == HAIR) && vertex.u >= 2.0 {
        // A hair faces the viewer and is drawn no thinner than a pixel; it fades instead.
        let side = vertex.u - 2.0 * floor(0.5 * vertex.u) - 0.5;
        let width = STRAND_WIDTH * select(1.0, LASH_STOUTNESS, triangle.w == LASH) * (1.0 - vertex.v * vertex.v);
        let center = position - side * width * frame.tangent;
        let along = cross(frame.normal, frame.tangent);
        clip = view.clip_from_world * vec4f(center, 1.0);
        let ahead = view.clip_from_world * vec4f(center + 1e-4 * along, 1.0);
        let step = (ahead.xy / ahead.w - clip.xy / clip.w) * vec2f(view.size);
        let normal = select(vec2f(1.0, 0.0), normalize(vec2f(-step.y, step.x)), dot(step, step) > 1e-12);
        let true_pixels = width * view.origin.w / clip.w;
        let drawn = max(true_pixels, 1.15);
        opacity = true_pixels / drawn;
        across = 2.0 * side;
        let to_viewer = normalize(view.origin.xyz - center);
        let outwards = normalize(frame.normal * sign(dot(frame.normal, to_viewer)) + to_viewer);
        // Each hair is a little lighter or darker than the next.
        let random = fract(sin(floor(0.5 * vertex.u) * 127.1) * 43758.5453);
        let color = select(params.hair.rgb * mix(0.6, 1.6, random), LASH_COLOR, triangle.w == LASH);
        // Texture coordinates grow towards the tip, bitangents against them.
        let to_tip = -frame.bitangent_sign * along;
        let depth = select(BROW_DEPTH, 0.0, triangle.w == LASH);
        radiance = hair_radiance(
            Hair(center, outwards, to_tip, min(color, vec3f(1.0)), clamp(frame.occlusion, 0.0, 1.0), depth),
            to_viewer,
        );
        clip += vec4f(normal * side * drawn * 2.0 / vec2f(view.size) * clip.w, 0.0, 0.0);
    }
    clip += vec4f(vec2f(2.0, -2.0) * view.jitter / vec2f(view.size) * clip.w, 0.0, 0.0);
    let now = view.clip_from_world * vec4f(position, 1.0);
    let before = view.previous_clip_from_world * vec4f(previous_positions[vertex.point].xyz, 1.0);
    let uv = vec2f(vertex.u, vertex.v);
    return Corner(clip, uv, position, frame.normal, triangle.w, opacity, across, now.xyw, before.xyw, radiance);
}

// Strands across a card of unit width.
const LASH_STRANDS = 46.0;

@fragment
fn overlay_fragment(corner: Corner) -> Fragment {
    let color = overlay_color(corner);
    let motion = (corner.now.xy / corner.now.z - corner.before.xy / corner.before.z) * vec2f(0.5, -0.5) * vec2f(view.size);
    return Fragment(color, vec4f(motion * color.a, 0.0, color.a));
}

fn overlay_color(corner: Corner) -> vec4f {
    if (corner.material == LASH || corner.material == HAIR) && corner.uv.x >= 1.5 {
        // Brighter along its middle, as a cylinder is.
        let round = 0.75 + 0.5 * sqrt(max(1.0 - corner.across * corner.across, 0.0));
        let alpha = clamp(0.96 * corner.opacity, 0.0, 1.0);
        return vec4f(corner.radiance * round * alpha, alpha);
    }
    if corner.material == LASH || corner.material == HAIR {
        // Lashes lean and cluster: each strand starts a little off and gets thinner towards its tip.
        let strand = corner.uv.x * LASH_STRANDS;
        let cell = floor(strand);
        let random = fract(sin(cell * 127.1) * 43758.5453);
        let lean = (random - 0.5) * 0.9 * corner.uv.y;
        let across = abs(fract(strand) - 0.5 - 0.5 * lean);
        let length = 0.65 + 0.35 * fract(random * 7.31);
        let along = corner.uv.y / length;
        let width = 0.34 * (1.0 - along);
        let pixel = max(fwidth(strand), 1e-4);
        // Coverage of a strand narrower than a pixel is its share of the pixel.
        let sharp = clamp((width - across) / pixel + 0.5, 0.0, 1.0);
        let coverage = select(mix(sharp, 2.0 * width, smoothstep(0.5, 1.5, pixel)), 0.0, along >= 1.0);
        let color = vec3f(0.020, 0.013, 0.009) * params.ambient.rgb;
        let alpha = clamp(0.92 * coverage, 0.0, 1.0);
        return vec4f(color * alpha, alpha);
    }
    // A clear film: only its reflection at grazing angles adds light.
    let to_viewer = normalize(view.origin.xyz - corner.position);
    let fresnel = 0.02 + 0.98 * pow5(1.0 - abs(dot(normalize(corner.normal), to_viewer)));
    return vec4f(params.ambient.rgb * 0.25 * fresnel, 0.0);
}
