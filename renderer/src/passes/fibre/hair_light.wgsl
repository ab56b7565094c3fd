// Light of a scene on a hair. Needs view.wgsl, math.wgsl, light.wgsl and fibre.wgsl.

struct HairLight {
    environment_intensity: f32,
    environment_levels: f32,
    padding_0: u32,
    padding_1: u32,
    // Real spherical harmonics of the environment's irradiance / pi, rgb.
    harmonics: array<vec4f, 9>,
    lights: array<Light, 8>,
}

@group(1) @binding(0) var<uniform> hair_light: HairLight;
@group(1) @binding(1) var hair_shadows: texture_depth_2d_array;
@group(1) @binding(2) var hair_compare: sampler_comparison;
@group(1) @binding(3) var hair_sky: texture_2d<f32>;
@group(1) @binding(4) var hair_sky_sampler: sampler;

// Off the place towards the light, metres: a hair lies on what would shadow it.
const HAIR_LIFT = 0.0012;
// Cosine from which a lamp lights hair in full, and below which the head is in its way: hairs stand off.
const HAIR_FACING = vec2f(-0.25, 0.25);
// Roughness of the map whose cone is about that of the first lobe, and the share of an even sky that it reflects.
const HAIR_SKY_ROUGHNESS = 0.4;
const HAIR_SKY_SHARE = 0.05;

// A hair where its light is wanted.
struct Hair {
    position: vec3f,
    // Of the skin under it.
    normal: vec3f,
    // From root to tip.
    tangent: vec3f,
    color: vec3f,
    // Ambient visibility of the place.
    occlusion: f32,
    // Optical depth of the hairs above, across the skin.
    depth: f32,
}

// One tap: neighbouring hairs tell soft edges.
fn hair_shadow(light: Light, position: vec3f) -> f32 {
    let clip = light.clip_from_world * vec4f(position, 1.0);
    let ndc = clip.xyz / clip.w;
    if light.shape.y < 0.0 || any(abs(ndc.xy) > vec2f(1.0)) || ndc.z > 1.0 || clip.w <= 0.0 {
        return 1.0;
    }
    let at = ndc.xy * vec2f(0.5, -0.5) + 0.5;
    return textureSampleCompareLevel(hair_shadows, hair_compare, at, i32(light.shape.y), ndc.z);
}

fn hair_radiance(hair: Hair, to_viewer: vec3f) -> vec3f {
    var sum = vec3f(0.0);
    for (var i = 0u; i < view.light_count; i++) {
        let light = hair_light.lights[i];
        let lit = arriving(light, hair.position);
        let facing = dot(hair.normal, lit.to_light);
        let horizon = smoothstep(HAIR_FACING.x, HAIR_FACING.y, facing);
        if horizon <= 0.0 || all(lit.irradiance <= vec3f(0.0)) {
            continue;
        }
        let visible = horizon * exp(-hair.depth / max(facing, 0.2))
            * hair_shadow(light, hair.position + HAIR_LIFT * (hair.normal + lit.to_light));
        sum += visible * lit.irradiance * fibre_radiance(hair.tangent, lit.to_light, to_viewer, hair.color, lit.spread);
    }
    if view.has_environment == 1u {
        // A slab lets exp(-1.5 depth) of an even sky through (thin slab: 2 E3).
        let seen = hair_light.environment_intensity * hair.occlusion * exp(-1.5 * hair.depth);
        let along = dot(hair.tangent, to_viewer);
        let facing = normalize(to_viewer - along * hair.tangent + 0.5 * hair.normal);
        let level = sqrt(HAIR_SKY_ROUGHNESS) * (hair_light.environment_levels - 1.0);
        let sky = textureSampleLevel(hair_sky, hair_sky_sampler, place_in_sky(reflect(-to_viewer, facing)), level).rgb;
        let even = irradiance_of_harmonics(hair_light.harmonics, normalize(hair.normal + facing));
        sum += seen * (HAIR_SKY_SHARE * sky + FIBRE_DIFFUSE * hair.color * even);
    }
    return sum;
}
