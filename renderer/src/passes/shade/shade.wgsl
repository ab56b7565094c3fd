// Light on the visible surface of one head.
// Concatenated after view.wgsl, math.wgsl, surface.wgsl and light.wgsl.

struct Params {
    // Material constants of this head.
    slope_scale: f32,
    wrinkle_strength: f32,
    hemoglobin_scale: f32,
    head: u32,
    environment_intensity: f32,
    environment_levels: f32,
    // 1 where the head has maps.
    has_maps: u32,
    wrinkle_map_count: u32,
    // rgb = albedo of hair drawn with the skin.
    hair_color: vec4f,
    // 1 where the pixel has a first sample whose light may do for this one.
    is_second_sample: u32,
    // 1 / thickness of the last entry of T(s), 1 / mm, or 0 for no transmittance.
    transmit_per_mm: f32,
    // 1 where differences of normals add instead of slopes.
    adds_differences: u32,
    // Diameter of the pupils, millimetres.
    pupil_mm: f32,
    // Factors of the map's roughness for both specular lobes of skin, and the share of the second.
    lobes: vec3f,
    // Millimetres of skin across the unit square of the texture.
    mm_per_texture: f32,
    // Radii of the taps and outer edges of the rings around the ray of a light, mm.
    ring_taps_mm: vec4f,
    ring_ends_mm: vec4f,
    // Plane between the halves of the head; positive on the character's left.
    middle: vec4f,
    // Real spherical harmonics of the environment's irradiance / pi, rgb.
    harmonics: array<vec4f, 9>,
    lights: array<Light, 8>,
}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<uniform> params: Params;
@group(0) @binding(2) var visible: texture_2d<u32>;
@group(0) @binding(3) var shadows: texture_depth_2d_array;
@group(0) @binding(4) var environment: texture_2d<f32>;
@group(0) @binding(5) var trilinear_repeat: sampler;
@group(0) @binding(6) var linear_clamp: sampler;
@group(0) @binding(7) var compare: sampler_comparison;
@group(0) @binding(8) var depth: texture_depth_2d;
@group(0) @binding(9) var first_visible: texture_2d<u32>;
@group(0) @binding(10) var first_depth: texture_depth_2d;
// T(s): rgb over thickness.
@group(0) @binding(11) var transmittance: texture_2d<f32>;
// Reflected share of an even sky: r times f0, plus g, of one lobe, and ba of the lobes of skin; the cosine of the viewer
// along a row and after it the mean over all viewers, roughness down.
@group(0) @binding(12) var directional_albedo: texture_2d<f32>;

@group(1) @binding(0) var<storage, read> positions: array<vec4f>;
@group(1) @binding(1) var<storage, read> vertices: array<Vertex>;
@group(1) @binding(2) var<storage, read> triangles: array<vec4u>;
@group(1) @binding(3) var<storage, read> frames: array<SurfaceFrame>;
// r = cube root of melanin / 0.5, g = cube root of hemoglobin / 0.32, b = scattering strength, a = hair cover.
@group(1) @binding(4) var skin_map: texture_2d<f32>;
// r = specular intensity, g = roughness.
@group(1) @binding(5) var gloss_map: texture_2d<f32>;
// rg = slopes, b = variance lost in minification.
@group(1) @binding(6) var slope_map: texture_2d<f32>;
// rg = slopes, ba = difference that they make to the unit normal of the relief.
@group(1) @binding(7) var wrinkle_maps: texture_2d_array<f32>;
@group(1) @binding(8) var blood: texture_2d<f32>;
@group(1) @binding(9) var wrinkle_weights: texture_2d_array<f32>;
@group(1) @binding(10) var skin_color: texture_2d<f32>;

// Diffuse radiance of a white surface; a = scattering strength, 0 where nothing scatters.
@group(2) @binding(0) var diffuse_out: texture_storage_2d<rgba16float, write>;
// Linear albedo of what scatters.
@group(2) @binding(1) var albedo_out: texture_storage_2d<rgba16float, write>;
// Radiance that is not scattered: specular, and everything of eyes and teeth.
@group(2) @binding(2) var direct_out: texture_storage_2d<rgba16float, write>;

// Share of a neighbour that scattering gives back for each millimetre off the tangent plane.
const FOLLOW_PER_MM = 0.25;
const MAX_MELANIN = 0.5;
const MAX_HEMOGLOBIN = 0.32;

// Numbers of rig's Material::ALL.
const SKIN = 0u;
const MUCOSA = 1u;
const EYE = 2u;
const TEETH = 3u;
const GUMS = 4u;

struct Surface {
    position: vec3f,
    // Position on the smooth surface that the normals describe, for shadow rays.
    lifted: vec3f,
    // Of the triangle, towards the viewer.
    facet: vec3f,
    normal: vec3f,
    // Normal without maps.
    smooth_normal: vec3f,
    albedo: vec3f,
    occlusion: f32,
    specular: f32,
    // Beckmann m, already widened by variance.
    roughness: f32,
    scattering: f32,
    f0: f32,
    // Normal that diffuse light uses (differs from `normal` in the iris).
    diffuse_normal: vec3f,
    // How far light spreads within what this pass does not scatter otherwise (eyes, teeth, gums), mm.
    spread_mm: f32,
}

@compute @workgroup_size(8, 8)
fn shade(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= view.size) {
        return;
    }
    let seen = textureLoad(visible, id.xy, 0).x;
    if params.is_second_sample != 0u && looks_the_same(id.xy, seen) {
        return;
    }
    if seen == 0u {
        if params.head == 0u {
            textureStore(diffuse_out, id.xy, vec4f(0.0, 0.0, 0.0, FAR_MM));
            textureStore(albedo_out, id.xy, vec4f(0.0));
            textureStore(direct_out, id.xy, vec4f(0.0));
        }
        return;
    }
    if (seen >> HEAD_SHIFT) != params.head {
        return;
    }
    let pixel = vec2f(id.xy) + 0.5;
    let corners = triangles[(seen & TRIANGLE_MASK) - 1u];
    let surface = surface_at(pixel, corners);
    let to_viewer = normalize(view.origin.xyz - surface.position);

    var diffuse = ambient_diffuse(surface);
    var specular = ambient_specular(surface, to_viewer);
    let entering = 1.0 / (1.0 - mean_reflected(surface));
    let turn = 2.0 * PI * gradient_noise(vec2f(id.xy));
    for (var i = 0u; i < view.light_count; i++) {
        add_light(params.lights[i], surface, to_viewer, entering, turn, &diffuse, &specular);
    }
    if params.transmit_per_mm > 0.0 && surface.scattering > 0.0 {
        diffuse += transmitted(surface, turn);
    }

    // The albedo is what leaves towards a viewer in front of the surface.
    let facing = clamp(dot(surface.normal, to_viewer), 0.0, 1.0);
    let leaving = surface.albedo * (1.0 - reflected_share(surface, facing)) / (1.0 - reflected_share(surface, 1.0));
    if surface.scattering > 0.0 {
        textureStore(diffuse_out, id.xy, vec4f(diffuse, relative_depth_mm(view, textureLoad(depth, id.xy, 0))));
        textureStore(albedo_out, id.xy, vec4f(leaving, surface.scattering));
        textureStore(direct_out, id.xy, vec4f(specular, 1.0));
    } else {
        textureStore(diffuse_out, id.xy, vec4f(0.0, 0.0, 0.0, FAR_MM));
        textureStore(albedo_out, id.xy, vec4f(0.0));
        textureStore(direct_out, id.xy, vec4f(diffuse * leaving + specular, 1.0));
    }
}

// Two samples of a pixel that lie on one smooth surface share their light, as in multisampling.
// 2 mm at 1 m: less than the gap at any silhouette, more than half a pixel of a slanted cheek.
const SAME_DEPTH = 0.002;

fn looks_the_same(at: vec2u, seen: u32) -> bool {
    let first = textureLoad(first_visible, at, 0).x;
    if seen == 0u || first == 0u {
        return seen == first;
    }
    if seen == first {
        return true;
    }
    let same_head = (seen >> HEAD_SHIFT) == (first >> HEAD_SHIFT);
    if !same_head || (seen >> HEAD_SHIFT) != params.head {
        // Another head's dispatch decides, or the heads differ.
        return false;
    }
    let a = triangles[(seen & TRIANGLE_MASK) - 1u].w;
    let b = triangles[(first & TRIANGLE_MASK) - 1u].w;
    // Reversed infinite depth is near / distance, so its ratio is that of the distances.
    let ratio = textureLoad(depth, at, 0) / textureLoad(first_depth, at, 0);
    return a == b && abs(ratio - 1.0) < SAME_DEPTH;
}

// ---- Surface ----

fn surface_at(pixel: vec2f, corners: vec4u) -> Surface {
    let vertex = array<Vertex, 3>(vertices[corners.x], vertices[corners.y], vertices[corners.z]);
    let a = positions[vertex[0].point].xyz - view.origin.xyz;
    let b = positions[vertex[1].point].xyz - view.origin.xyz;
    let c = positions[vertex[2].point].xyz - view.origin.xyz;
    let here = ray_barycentrics(a, b, c, pixel_ray(view, pixel, view.shading_jitter));
    // The same triangle one pixel to the right and one down: texture gradients without neighbours.
    let right = ray_barycentrics(a, b, c, pixel_ray(view, pixel + vec2f(1.0, 0.0), view.shading_jitter));
    let down = ray_barycentrics(a, b, c, pixel_ray(view, pixel + vec2f(0.0, 1.0), view.shading_jitter));
    let us = vec3f(vertex[0].u, vertex[1].u, vertex[2].u);
    let vs = vec3f(vertex[0].v, vertex[1].v, vertex[2].v);
    let uv = vec2f(dot(here, us), dot(here, vs));
    let duv_dx = vec2f(dot(right, us), dot(right, vs)) - uv;
    let duv_dy = vec2f(dot(down, us), dot(down, vs)) - uv;

    let position = here.x * a + here.y * b + here.z * c;
    let back = select(1.0, -1.0, dot(cross(b - a, c - a), position) > 0.0);
    return surface_of(corners, here, duv_dx, duv_dy, back);
}

// The surface at barycentric coordinates of a triangle, seen from its front (back = 1) or from behind (-1).
fn surface_of(corners: vec4u, here: vec3f, duv_dx: vec2f, duv_dy: vec2f, back: f32) -> Surface {
    let vertex = array<Vertex, 3>(vertices[corners.x], vertices[corners.y], vertices[corners.z]);
    let a = positions[vertex[0].point].xyz;
    let b = positions[vertex[1].point].xyz;
    let c = positions[vertex[2].point].xyz;
    let us = vec3f(vertex[0].u, vertex[1].u, vertex[2].u);
    let vs = vec3f(vertex[0].v, vertex[1].v, vertex[2].v);
    let uv = vec2f(dot(here, us), dot(here, vs));
    let f0 = frames[corners.x];
    let f1 = frames[corners.y];
    let f2 = frames[corners.z];
    var surface: Surface;
    surface.position = here.x * a + here.y * b + here.z * c;
    let to_viewer = normalize(view.origin.xyz - surface.position);
    let facet = cross(b - a, c - a);
    surface.facet = back * normalize(facet);
    surface.smooth_normal = back * normalize(here.x * f0.normal + here.y * f1.normal + here.z * f2.normal);
    surface.occlusion = clamp(here.x * f0.occlusion + here.y * f1.occlusion + here.z * f2.occlusion, 0.0, 1.0);
    // From the facet onto the tangent planes of its corners, or facets show in the shade of a terminator (Hanika 2021,
    // "Hacking the shadow terminator").
    surface.lifted = surface.position - here.x * min(dot(surface.position - a, back * f0.normal), 0.0) * back * f0.normal
        - here.y * min(dot(surface.position - b, back * f1.normal), 0.0) * back * f1.normal
        - here.z * min(dot(surface.position - c, back * f2.normal), 0.0) * back * f2.normal;
    let along = here.x * f0.tangent + here.y * f1.tangent + here.z * f2.tangent;
    let tangent = normalize(along - surface.smooth_normal * dot(along, surface.smooth_normal));
    let bitangent = f0.bitangent_sign * cross(surface.smooth_normal, tangent) * back;

    surface.normal = surface.smooth_normal;
    surface.f0 = 0.028;
    surface.scattering = 0.0;
    surface.spread_mm = 0.0;
    switch corners.w {
        case SKIN: { skin(&surface, uv, duv_dx, duv_dy, tangent, bitangent); }
        case EYE: {
            eye(&surface, uv, duv_dx, duv_dy, tangent, bitangent, to_viewer);
        }
        case TEETH: { teeth(&surface, uv, tangent, bitangent); }
        case GUMS, MUCOSA: { lining(&surface, uv, duv_dx, duv_dy, tangent, bitangent, corners.w == GUMS); }
        default: {
            surface.albedo = vec3f(0.2);
            surface.specular = 0.3;
            surface.roughness = 0.5;
        }
    }
    if corners.w != EYE {
        surface.diffuse_normal = surface.normal;
    }
    return surface;
}

// Pixels that relief is averaged over: a highlight answers slopes so steeply that one pixel's mean still glitters
// (Kaplanyan et al. 2016 take a Gaussian of half a pixel's deviation, about this wide).
const RELIEF_FOOTPRINT = 1.6;

// Weighted slopes of all wrinkle maps (papers/004 section 8.2).
fn wrinkle_slopes(uv: vec2f, duv_dx: vec2f, duv_dy: vec2f) -> vec2f {
    var sum = vec2f(0.0);
    var weights = vec4f(0.0);
    for (var i = 0u; i < params.wrinkle_map_count; i++) {
        if i % 4u == 0u {
            weights = textureSampleLevel(wrinkle_weights, linear_clamp, uv, i / 4u, 0.0);
        }
        if weights[i % 4u] > 0.0 {
            sum += params.wrinkle_strength * weights[i % 4u]
                * textureSampleGrad(wrinkle_maps, trilinear_repeat, uv, i, duv_dx, duv_dy).xy;
        }
    }
    return sum;
}

// Slopes of the relief with weighted differences of normals (papers/004 section 8.2.1). The z of a difference follows
// from unit length at weight 1, so two channels are stored.
fn with_differences(slopes: vec2f, uv: vec2f, duv_dx: vec2f, duv_dy: vec2f) -> vec2f {
    let base = normalize(vec3f(slopes, 1.0));
    var sum = base;
    var weights = vec4f(0.0);
    for (var i = 0u; i < params.wrinkle_map_count; i++) {
        if i % 4u == 0u {
            weights = textureSampleLevel(wrinkle_weights, linear_clamp, uv, i / 4u, 0.0);
        }
        if weights[i % 4u] > 0.0 {
            let change = textureSampleGrad(wrinkle_maps, trilinear_repeat, uv, i, duv_dx, duv_dy).zw;
            let end = base.xy + change;
            let z = sqrt(max(1.0 - dot(end, end), 0.0));
            sum += params.wrinkle_strength * weights[i % 4u] * vec3f(change, z - base.z);
        }
    }
    // Slopes up to 87 degrees, as normal maps give.
    return sum.xy / max(sum.z, 0.05);
}

// Wrinkles: papers/004 section 8.2. Hemoglobin: section 7.4.2, written as the neutral value plus
// changes so that neutral weights give the neutral map exactly. Colour: section 7.6.
fn skin(surface: ptr<function, Surface>, uv: vec2f, duv_dx: vec2f, duv_dy: vec2f, tangent: vec3f, bitangent: vec3f) {
    (*surface).scattering = 1.0;
    if params.has_maps == 0u {
        (*surface).albedo = textureSampleLevel(skin_color, linear_clamp, vec2f(0.38, 0.52), 0.0).rgb;
        (*surface).specular = 0.6;
        (*surface).roughness = 0.32;
        return;
    }
    let map = textureSampleGrad(skin_map, trilinear_repeat, uv, duv_dx, duv_dy);
    let fine = textureSampleGrad(slope_map, trilinear_repeat, uv, RELIEF_FOOTPRINT * duv_dx, RELIEF_FOOTPRINT * duv_dy);
    var slopes = params.slope_scale * fine.xy;
    let gloss = textureSampleGrad(gloss_map, trilinear_repeat, uv, duv_dx, duv_dy);
    // Lips have lines of their own and no net of furrows; they are what shines most.
    let micro = micro_relief(uv, duv_dx, duv_dy) * smoothstep(0.60, 0.53, gloss.r);
    if params.adds_differences == 0u {
        slopes += wrinkle_slopes(uv, duv_dx, duv_dy);
        slopes += params.slope_scale * micro.xy;
    } else {
        slopes = with_differences(slopes + params.slope_scale * micro.xy, uv, duv_dx, duv_dy);
    }
    (*surface).normal =
        normalize((*surface).smooth_normal + slopes.x * tangent + slopes.y * bitangent);

    let change = textureSampleLevel(blood, linear_clamp, uv, 0.0);
    let neutral = MAX_HEMOGLOBIN * map.g * map.g * map.g;
    var hemoglobin = neutral + change.x + change.y * (neutral - change.z);
    hemoglobin = clamp(params.hemoglobin_scale * hemoglobin, 0.0, MAX_HEMOGLOBIN);
    let axes = vec2f(map.r, pow(hemoglobin / MAX_HEMOGLOBIN, 1.0 / 3.0));
    let table = vec2f(textureDimensions(skin_color));
    (*surface).albedo =
        textureSampleLevel(skin_color, linear_clamp, (axes * (table - 1.0) + 0.5) / table, 0.0).rgb;

    // Hairs that are not drawn one by one hide the skin, keep light off what shows between them, and cover its shine.
    let hidden = 0.97 * smoothstep(0.0, 0.85, map.a);
    (*surface).albedo = mix((*surface).albedo, params.hair_color.rgb, hidden) * (1.0 - 0.3 * hidden);

    (*surface).specular = gloss.r * (1.0 - hidden);
    // Slope variance that the mip level hides is roughness (Toksvig 2005; for Beckmann m^2 = 2 sigma^2).
    let variance = square(params.slope_scale) * (fine.z + micro.z);
    (*surface).roughness = sqrt(min(square(gloss.g) + 2.0 * variance, 0.64));
    (*surface).scattering = map.b;
}

// ---- Light ----

// Beckmann distribution over half vectors, 1 / steradian.
fn beckmann(cos_half: f32, m: f32) -> f32 {
    let c2 = max(cos_half * cos_half, 1e-4);
    let m2 = m * m;
    return exp((c2 - 1.0) / (c2 * m2)) / (PI * m2 * c2 * c2);
}

// A large source widens the highlight; a mirror shows it as a disc.
fn highlight(cos_half: f32, roughness: f32, spread: f32) -> f32 {
    if roughness < 0.12 {
        // Half vectors of a disc of tangent `spread` fill a cone of half that angle, softened by the roughness.
        let radius = max(0.5 * spread, 0.045);
        let sine = sqrt(max(1.0 - cos_half * cos_half, 0.0));
        return smoothstep(radius + 0.5 * roughness, radius - 0.5 * roughness, sine) / (PI * radius * radius);
    }
    return beckmann(cos_half, sqrt(square(roughness) + 0.25 * square(spread)));
}

// Share of the light from (or towards) a direction that the specular lobe takes before the diffuse one (d'Eon and Luebke
// 2007, rho_dt).
fn reflected_share(surface: Surface, cosine: f32) -> f32 {
    return reflected_at(surface, clamp(cosine, 0.0, 1.0) * f32(TABLE_COSINES - 1u));
}

// Its mean over the hemisphere, by cosine.
fn mean_reflected(surface: Surface) -> f32 { return reflected_at(surface, f32(TABLE_COSINES)); }

// Cosines of the table; one more column holds the mean.
const TABLE_COSINES = 32u;

fn reflected_at(surface: Surface, column: f32) -> f32 {
    let size = vec2f(textureDimensions(directional_albedo));
    let entry = (vec2f(column, surface.roughness * (size.y - 1.0)) + 0.5) / size;
    let texel = textureSampleLevel(directional_albedo, linear_clamp, entry, 0.0);
    let pair = select(texel.rg, texel.ba, surface.scattering > 0.0);
    return surface.specular * min(surface.f0 * pair.x + pair.y, 1.0);
}

// Distribution of half vectors: one lobe, or two in skin.
fn distribution(surface: Surface, cos_half: f32, spread: f32) -> f32 {
    if surface.scattering == 0.0 {
        return highlight(cos_half, surface.roughness, spread);
    }
    let first = highlight(cos_half, params.lobes.x * surface.roughness, spread);
    if params.lobes.z == 0.0 {
        return first;
    }
    return mix(first, highlight(cos_half, params.lobes.y * surface.roughness, spread), params.lobes.z);
}

// Solid angle that two cones share, over 2 pi (Oat and Sander 2007; the smooth step is theirs).
fn shared_cone(first: f32, second: f32, between: f32) -> f32 {
    let least = min(first, second);
    return (1.0 - cos(least)) * (1.0 - smoothstep(abs(first - second), first + second, between));
}

// Share of the specular lobe about a direction that the head itself leaves open. Ambient visibility is that of a cone
// (its square sine, by Lambert's law); what hides much of the sky and yet shows itself to the viewer is open on the
// viewer's side, so the cone leans from the normal to the viewer as visibility falls. `docs/occlusion.md` has its error.
fn specular_visibility(surface: Surface, to_viewer: vec3f, direction: vec3f, roughness: f32) -> f32 {
    let visibility = surface.occlusion;
    if visibility > 0.98 {
        return 1.0;
    }
    let axis = normalize(mix(to_viewer, surface.smooth_normal, visibility));
    let open = acos(sqrt(1.0 - visibility));
    let lobe = min(2.0 * atan(1.2 * roughness), 0.5 * PI);
    let between = acos(clamp(dot(axis, direction), -1.0, 1.0));
    // Of what lies above the horizon.
    let above = acos(clamp(dot(surface.smooth_normal, direction), 0.0, 1.0));
    let whole = shared_cone(0.5 * PI, lobe, above);
    return clamp(shared_cone(open, lobe, between) / max(whole, 1e-3), 0.0, 1.0);
}

fn add_light(
    light: Light,
    surface: Surface,
    to_viewer: vec3f,
    // 1 / (1 - mean reflected share): an even sky enters the skin as if nothing were reflected, for albedos are measured so.
    entering: f32,
    turn: f32,
    diffuse: ptr<function, vec3f>,
    specular: ptr<function, vec3f>,
) {
    let lit = arriving(light, surface.position);
    let to_light = lit.to_light;
    let facing = dot(surface.smooth_normal, to_light);
    var irradiance = lit.irradiance;
    if all(irradiance <= vec3f(0.0)) || facing <= -0.2 {
        return;
    }
    if light.shape.y >= 0.0 {
        irradiance *= spread_shadow(light, surface, lit, turn);
    }
    // A bump cannot see a light that its surface does not face.
    let horizon = smoothstep(-0.05, 0.10, facing);
    let cos_diffuse = max(dot(surface.diffuse_normal, to_light), 0.0) * horizon;
    if cos_diffuse > 0.0 {
        *diffuse += irradiance * cos_diffuse * entering * (1.0 - reflected_share(surface, cos_diffuse)) / PI;
    }

    // Kelemen and Szirmay-Kalos 2001: the geometry term is 1 / |L + V|^2 (papers/002, papers/004).
    let cos_light = max(dot(surface.normal, to_light), 0.0) * horizon;
    if cos_light > 0.0 {
        let half_vector = to_light + to_viewer;
        let h = normalize(half_vector);
        if light.shape.y < 0.0 {
            // No shadow map keeps this lamp out of cavities.
            irradiance *= specular_visibility(surface, to_viewer, to_light, surface.roughness);
        }
        let brdf = distribution(surface, dot(surface.normal, h), lit.spread) * schlick(surface.f0, dot(h, to_viewer))
            / max(dot(half_vector, half_vector), 0.3);
        *specular += irradiance * surface.specular * brdf * cos_light;
    }
}

const BLOCKER_SAMPLES = 10u;
const FILTER_SAMPLES = 16u;
// Widest search for blockers, metres; the shadow map has this much room around what it lights.
const WIDEST_METRES = 0.012;
// Depth change for a millimetre across at which the plane of a surface is followed no further (79 degrees).
const STEEPEST = 5.0;

// Percentage-closer soft shadows (Fernando 2005): the mean depth of blockers sets the width of the filter. Every tap is
// compared with the plane of the receiver and not with its depth, so wide filters need no larger bias than narrow ones.
fn shadow(light: Light, surface: Surface, lit: Arriving, turn: f32) -> f32 {
    let resolution = f32(textureDimensions(shadows).x);
    var across = light.shadow.x;
    if light.position.w > 0.0 {
        across *= dot(light.position.xyz - surface.position, lit.to_light);
    }
    let texel = across / resolution;
    let facing = dot(surface.facet, lit.to_light);
    // Off the surface by what bilinear taps can see of it.
    let p = surface.lifted + texel * (surface.facet + lit.to_light);
    let clip = light.clip_from_world * vec4f(p, 1.0);
    let ndc = clip.xyz / clip.w;
    if any(abs(ndc.xy) > vec2f(1.0)) || ndc.z > 1.0 || clip.w <= 0.0 {
        return 1.0;
    }
    let m = light.clip_from_world;
    let axes = mat2x3f(normalize(vec3f(m[0].x, m[1].x, m[2].x)), normalize(vec3f(m[0].y, m[1].y, m[2].y)));
    var slope = surface.facet * axes / max(facing, 0.01);
    slope *= min(1.0, STEEPEST * inverseSqrt(max(dot(slope, slope), 1e-6)));
    let uv_per_metre = vec2f(1.0, -1.0) / across;
    let center = ndc.xy * vec2f(0.5, -0.5) + 0.5;
    let layer = i32(light.shape.y);
    let receiver = shadow_metres(light, ndc.z);

    // Search as far as the source could reach over a typical gap of 5 cm.
    let reach = clamp(0.05 * lit.spread, 2.0 * texel, WIDEST_METRES);
    var blocked = 0.0;
    var blocker = 0.0;
    for (var i = 0u; i < BLOCKER_SAMPLES; i++) {
        let offset = reach * vogel_disk(i, BLOCKER_SAMPLES, turn);
        let at = vec2i(clamp(center + offset * uv_per_metre, vec2f(0.0), vec2f(0.9999)) * resolution);
        let d = shadow_metres(light, textureLoad(shadows, at, layer, 0));
        if d < receiver + dot(slope, offset) - texel {
            blocked += 1.0;
            blocker += d;
        }
    }
    if blocked == 0.0 {
        return 1.0;
    }
    blocker /= blocked;
    var penumbra = (receiver - blocker) * lit.spread;
    if light.position.w > 0.0 {
        penumbra *= receiver / blocker;
    }
    let width = clamp(penumbra, 1.2 * texel, WIDEST_METRES);
    var light_seen = 0.0;
    for (var i = 0u; i < FILTER_SAMPLES; i++) {
        let offset = width * vogel_disk(i, FILTER_SAMPLES, turn);
        let reference = shadow_depth(light, max(receiver + dot(slope, offset), light.shape.z));
        light_seen += textureSampleCompareLevel(shadows, compare, center + offset * uv_per_metre, layer, reference);
    }
    return light_seen / f32(FILTER_SAMPLES);
}

// ---- Transmittance ----

// Rings of the plane across the light, each with a tap on two opposite sides.
const TRANSMIT_RINGS = 4u;
// Of the golden angle.
const GOLDEN_COSINE = -0.73736888;
const GOLDEN_SINE = 0.67549029;
// Cosine past the terminator over which light from hidden sides fades out where the light shines on the front.
const FADE = 0.3;
// Cosine from which a lamp counts as behind the surface, for the thickness.
const LEAST_THROUGH = 0.3;

fn transmittance_at(thickness_mm: f32) -> vec3f {
    let entries = f32(textureDimensions(transmittance).x);
    let x = clamp(thickness_mm * params.transmit_per_mm, 0.0, 1.0) * (entries - 1.0) + 0.5;
    return textureSampleLevel(transmittance, linear_clamp, vec2f(x / entries, 0.5), 0.0).rgb;
}

// Depth of what a light shines on at a place of its map, texels.
fn depth_of_light(light: Light, at: vec2f, resolution: f32) -> f32 {
    return textureLoad(shadows, vec2i(clamp(at, vec2f(0.0), vec2f(resolution - 1.0))), i32(light.shape.y), 0);
}

// Share of the light of a lit point that the screen does not scatter to this one: all of it where another surface hides
// the point, else what its distance from the tangent plane keeps back.
fn unseen(surface: Surface, way_mm: vec3f) -> f32 {
    let off_plane = saturate(FOLLOW_PER_MM * abs(dot(way_mm, surface.smooth_normal)));
    let clip = view.clip_from_world * vec4f(surface.position + 1e-3 * way_mm, 1.0);
    let ndc = clip.xy / clip.w;
    if clip.w <= 0.0 || any(abs(ndc) >= vec2f(1.0)) {
        return 1.0;
    }
    let pixel = vec2i((ndc * vec2f(0.5, -0.5) + 0.5) * vec2f(view.size));
    // How deep the point is under what the pixel shows, across the surface: where in the pixel it lies does not matter.
    let ray = pixel_ray(view, vec2f(pixel) + 0.5, view.jitter);
    let shown = view.origin.xyz + view_depth(view, textureLoad(depth, pixel, 0)) * ray;
    let under_mm = 1e3 * dot(shown - surface.position, surface.facet) - dot(way_mm, surface.facet);
    return max(off_plane, smoothstep(0.2, 0.6, under_mm));
}

// Light that arrives from what a light shines on and the camera does not see (papers/004 eq. 5.8), as diffuse radiance
// of a white surface.
//
// A texel of the shadow map is a piece of the lit surface, and the light on it is that of its cross-section whatever its
// tilt: M = sum of R(distance) times irradiance across the light times cross-section. The plane across the light is cut
// into rings; the light of a ring at a depth is the difference of T at the distances of its edges, so a slab that
// faces the light gives T(s) exactly, and its sum over opposite taps knows slopes.
//
// The environment has no shadow map: a lamp behind the surface tells how much of its light comes through.
fn transmitted(surface: Surface, turn: f32) -> vec3f {
    var sum = vec3f(0.0);
    // T of the thickness.
    var from_behind = vec3f(0.0);
    let reach_mm = surface.scattering / params.transmit_per_mm;
    let resolution = f32(textureDimensions(shadows).x);
    let cosine = cos(turn);
    let sine = sin(turn);
    for (var i = 0u; i < view.light_count; i++) {
        let light = params.lights[i];
        let lit = arriving(light, surface.position);
        let through = -dot(surface.smooth_normal, lit.to_light);
        let is_dark = all(lit.irradiance <= vec3f(0.0));
        let tells_thickness = view.has_environment == 1u && through > LEAST_THROUGH;
        if light.shape.y < 0.0 || through <= -FADE || (is_dark && !tells_thickness) {
            continue;
        }
        let clip = light.clip_from_world * vec4f(surface.position, 1.0);
        let ndc = clip.xyz / clip.w;
        if any(abs(ndc.xy) > vec2f(1.0)) || clip.w <= 0.0 {
            continue;
        }
        let receiver = shadow_metres(light, ndc.z);
        var across = light.shadow.x;
        if light.position.w > 0.0 {
            across *= receiver;
        }
        let m = light.clip_from_world;
        let right = normalize(vec3f(m[0].x, m[1].x, m[2].x));
        let up = normalize(vec3f(m[0].y, m[1].y, m[2].y));
        let center = (ndc.xy * vec2f(0.5, -0.5) + 0.5) * resolution;
        let texels_per_mm = 1e-3 * resolution / across * vec2f(1.0, -1.0);
        // Depths of the map that are within reach: most taps are not, and cost no more than this comparison.
        let nearest = shadow_depth(light, max(receiver - 1e-3 * reach_mm, light.shape.z));
        let farthest = shadow_depth(light, receiver + 1e-3 * reach_mm);
        // Two opposite taps tell whether there is a thin part at all.
        let probe = surface.scattering * params.ring_taps_mm.y * vec2f(cosine, sine);
        let first = depth_of_light(light, center + texels_per_mm * probe, resolution);
        let second = depth_of_light(light, center - texels_per_mm * probe, resolution);
        if !(first > nearest && first < farthest) && !(second > nearest && second < farthest) {
            continue;
        }
        var passed = vec3f(0.0);
        var direction = vec2f(cosine, sine);
        var inner_mm = 0.0;
        for (var ring = 0u; ring < TRANSMIT_RINGS; ring++) {
            let outer_mm = params.ring_ends_mm[ring];
            for (var side = -1.0; side < 2.0; side += 2.0) {
                let offset_mm = side * surface.scattering * params.ring_taps_mm[ring] * direction;
                let raw = depth_of_light(light, center + texels_per_mm * offset_mm, resolution);
                if raw > nearest && raw < farthest {
                    let depth_mm = 1e3 * (receiver - shadow_metres(light, raw));
                    let way_mm = offset_mm.x * right + offset_mm.y * up + depth_mm * lit.to_light;
                    let share = unseen(surface, way_mm);
                    if share > 0.0 {
                        let d = depth_mm / surface.scattering;
                        passed += share * (transmittance_at(length(vec2f(inner_mm, d)))
                            - transmittance_at(length(vec2f(outer_mm, d))));
                    }
                }
            }
            inner_mm = outer_mm;
            direction = vec2f(
                GOLDEN_COSINE * direction.x - GOLDEN_SINE * direction.y,
                GOLDEN_SINE * direction.x + GOLDEN_COSINE * direction.y,
            );
        }
        sum += lit.irradiance * smoothstep(-FADE, 0.0, through) * passed * (0.5 / PI);
        if tells_thickness {
            from_behind = max(from_behind, passed * (0.5 / through));
        }
    }
    if view.has_environment == 1u {
        sum += params.environment_intensity * surface.occlusion * harmonic_irradiance(-surface.smooth_normal) * from_behind;
    }
    return sum;
}

fn harmonic_irradiance(n: vec3f) -> vec3f { return irradiance_of_harmonics(params.harmonics, n); }

fn ambient_diffuse(surface: Surface) -> vec3f {
    if view.has_environment == 0u {
        return vec3f(0.0);
    }
    // Light that bounces inside a cavity takes its colour (Jimenez et al. 2016, "Practical real-time strategies for
    // accurate indirect occlusion", fit of multiple bounces).
    let a = surface.albedo;
    let v = surface.occlusion;
    let bounced = max(
        vec3f(v),
        ((v * (2.0404 * a - 0.3324) + (-4.7951 * a + 0.6417)) * v + (2.7552 * a + 0.6903)) * v,
    );
    return params.environment_intensity * bounced * harmonic_irradiance(surface.diffuse_normal);
}

fn ambient_specular(surface: Surface, to_viewer: vec3f) -> vec3f {
    if view.has_environment == 0u {
        return vec3f(0.0);
    }
    let n = surface.normal;
    let cosine = clamp(dot(n, to_viewer), 0.0, 1.0);
    let r = reflect(-to_viewer, n);
    let uv = place_in_sky(r);
    let is_skin = surface.scattering > 0.0;
    var radiance = mirrored(uv, select(1.0, params.lobes.x, is_skin) * surface.roughness);
    if is_skin && params.lobes.z > 0.0 {
        radiance = mix(radiance, mirrored(uv, params.lobes.y * surface.roughness), params.lobes.z);
    }
    let open = specular_visibility(surface, to_viewer, r, surface.roughness);
    return params.environment_intensity * reflected_share(surface, cosine) * open * radiance;
}

// The environment as a lobe of a roughness sees it.
fn mirrored(uv: vec2f, roughness: f32) -> vec3f {
    // Level i of the map is filtered for roughness (i / (levels - 1))^2.
    let level = sqrt(roughness) * (params.environment_levels - 1.0);
    return textureSampleLevel(environment, trilinear_repeat, uv, level).rgb;
}
