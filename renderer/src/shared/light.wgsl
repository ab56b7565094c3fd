// Lamps, their shadow maps and the light of the environment. Needs math.wgsl.

struct Light {
    clip_from_world: mat4x4f,
    // rgb = irradiance at 1 m (or anywhere, for a directional light), w = source radius.
    color: vec4f,
    // xyz = place or unit direction from the scene to the light, w = 1 for a place, 0 for a direction.
    position: vec4f,
    // xyz = unit direction of a spot, w = cosine of its outer angle (-2 for no cone).
    spot: vec4f,
    // x = cosine of the inner angle, y = shadow layer or -1, z = near and w = far of the shadow map, metres.
    shape: vec4f,
    // x = metres across the shadow map at 1 m (or anywhere, for a directional light).
    shadow: vec4f,
}

fn schlick(f0: f32, cosine: f32) -> f32 { return f0 + (1.0 - f0) * pow5(1.0 - clamp(cosine, 0.0, 1.0)); }

// Irradiance of a surface that faces a light, as far as its place and cone go, and where the light is.
struct Arriving {
    irradiance: vec3f,
    to_light: vec3f,
    // Tangent of half the angle that the source fills.
    spread: f32,
}

fn arriving(light: Light, position: vec3f) -> Arriving {
    var result = Arriving(light.color.rgb, light.position.xyz, light.color.w);
    if light.position.w > 0.0 {
        let way = light.position.xyz - position;
        let distance_squared = max(dot(way, way), 1e-4);
        result.to_light = normalize(way);
        result.irradiance /= distance_squared;
        result.spread *= inverseSqrt(distance_squared);
        if light.spot.w > -1.5 {
            result.irradiance *= smoothstep(light.spot.w, light.shape.x, -dot(result.to_light, light.spot.xyz));
        }
    }
    return result;
}

// Distance from the light along its axis, metres, of a depth of the shadow map.
fn shadow_metres(light: Light, depth: f32) -> f32 {
    let near = light.shape.z;
    let far = light.shape.w;
    if light.position.w > 0.0 {
        return near * far / (far - depth * (far - near));
    }
    return near + depth * (far - near);
}

fn shadow_depth(light: Light, metres: f32) -> f32 {
    let near = light.shape.z;
    let far = light.shape.w;
    if light.position.w > 0.0 {
        return (far - near * far / metres) / (far - near);
    }
    return (metres - near) / (far - near);
}

// Irradiance / pi from spherical harmonics (Ramamoorthi and Hanrahan 2001); the convolution is in the coefficients.
fn irradiance_of_harmonics(h: array<vec4f, 9>, n: vec3f) -> vec3f {
    let sum = h[0].rgb
        + h[1].rgb * n.y + h[2].rgb * n.z + h[3].rgb * n.x
        + h[4].rgb * (n.x * n.y) + h[5].rgb * (n.y * n.z) + h[6].rgb * (3.0 * n.z * n.z - 1.0)
        + h[7].rgb * (n.x * n.z) + h[8].rgb * (n.x * n.x - n.y * n.y);
    return max(sum, vec3f(0.0));
}

// Place of a direction in an equirectangular map.
fn place_in_sky(direction: vec3f) -> vec2f {
    return vec2f(atan2(direction.x, -direction.z) / (2.0 * PI) + 0.5, acos(clamp(direction.y, -1.0, 1.0)) / PI);
}
