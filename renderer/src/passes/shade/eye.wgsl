// The eye: cornea over a sunken iris, a sclera that is never white, the shadow and the tears at the lids.
// Concatenated after shade.wgsl.

// The azimuthal coordinates of Material::Eye. Angles in radians.
const IRIS_ANGLE = 0.5146;
const EYE_RADIUS_MM = 12.0;
const IRIS_DEPTH_MM = 2.2;

fn eye_hash(p: vec2f) -> f32 { return fract(sin(dot(p, vec2f(127.1, 311.7))) * 43758.5453); }

// Value noise, 0 to 1.
fn eye_noise(p: vec2f) -> f32 {
    let i = floor(p);
    let f = fract(p);
    let s = f * f * (3.0 - 2.0 * f);
    return mix(
        mix(eye_hash(i), eye_hash(i + vec2f(1.0, 0.0)), s.x),
        mix(eye_hash(i + vec2f(0.0, 1.0)), eye_hash(i + vec2f(1.0, 1.0)), s.x),
        s.y,
    );
}

// Distance in mm, along the picture, from a pixel of the eye to what covers it in a direction; `reach` if nothing does.
fn to_lid(pixel: vec2f, direction: vec2f, pixels_per_mm: f32, reach: f32) -> f32 {
    const STEPS = 7;
    var inside = 0.0;
    for (var i = 1; i <= STEPS; i++) {
        let d = reach * f32(i) / f32(STEPS);
        if !is_eye(pixel + direction * d * pixels_per_mm) {
            // The border lies within this step.
            var outside = d;
            for (var k = 0; k < 3; k++) {
                let middle = 0.5 * (inside + outside);
                if is_eye(pixel + direction * middle * pixels_per_mm) { inside = middle; } else { outside = middle; }
            }
            return 0.5 * (inside + outside);
        }
        inside = d;
    }
    return reach;
}

fn is_eye(pixel: vec2f) -> bool {
    let size = vec2i(textureDimensions(visible));
    let seen = textureLoad(visible, clamp(vec2i(pixel), vec2i(0), size - 1), 0).x;
    if seen == 0u || (seen >> HEAD_SHIFT) != params.head {
        return false;
    }
    return triangles[(seen & TRIANGLE_MASK) - 1u].w == EYE;
}

// Colours of an iris at its inner and its outer edge. Pigment of hair and iris comes from the same cells' activity, so
// dark hair goes with brown eyes and pale hair with blue ones; a head has no colour of its own for its eyes.
fn iris_colors() -> mat2x3f {
    let hair = dot(params.hair_color.rgb, vec3f(0.2126, 0.7152, 0.0722));
    let brown = mat2x3f(vec3f(0.085, 0.036, 0.014), vec3f(0.038, 0.017, 0.008));
    let hazel = mat2x3f(vec3f(0.108, 0.061, 0.030), vec3f(0.054, 0.051, 0.037));
    let blue = mat2x3f(vec3f(0.125, 0.120, 0.095), vec3f(0.078, 0.105, 0.122));
    let first = smoothstep(0.0100, 0.0122, hair);
    let second = smoothstep(0.05, 0.16, hair);
    return brown * (1.0 - first) + hazel * (first * (1.0 - second)) + blue * (first * second);
}

fn eye(
    surface: ptr<function, Surface>,
    pixel_at: vec2f,
    uv: vec2f,
    duv_dx: vec2f,
    duv_dy: vec2f,
    tangent: vec3f,
    bitangent: vec3f,
    to_viewer: vec3f,
) {
    let from_axis = uv - 0.5;
    let theta = 2.0 * PI * length(from_axis);
    let pupil_angle = clamp(0.5 * params.pupil_mm / EYE_RADIUS_MM, 0.02, 0.9 * IRIS_ANGLE);
    (*surface).specular = 1.0;
    (*surface).f0 = 0.025;
    (*surface).roughness = mix(0.05, 0.13, smoothstep(IRIS_ANGLE, IRIS_ANGLE + 0.15, theta));

    // Looking through the cornea: the refracted ray meets the iris plane off to the side.
    let normal = (*surface).smooth_normal;
    let refracted = refract(-to_viewer, normal, 1.0 / 1.336);
    let sideways = vec2f(dot(refracted, tangent), -dot(refracted, bitangent)) / max(-dot(refracted, normal), 0.2);
    let inside = smoothstep(IRIS_ANGLE + 0.04, IRIS_ANGLE - 0.1, theta);
    let shifted = from_axis + inside * sideways * IRIS_DEPTH_MM / (2.0 * PI * EYE_RADIUS_MM);
    let radius = 2.0 * PI * length(shifted);
    let around = atan2(shifted.y, shifted.x);
    // Width of a pixel in the same angle, for soft borders.
    let pixel = clamp(2.0 * PI * max(length(duv_dx), length(duv_dy)), 0.005, 0.2);

    // Iris: fibres that run out from a wavy collarette, crypts between them, a dark limbal ring.
    let r = clamp((radius - pupil_angle) / (IRIS_ANGLE - pupil_angle), 0.0, 1.0);
    let turn = around / (2.0 * PI);
    let fibre_fade = clamp(0.05 / pixel, 0.0, 1.0);
    // Noise on the circle: wraps after whole numbers of cells.
    let circle = vec2f(cos(around), sin(around));
    let wave = eye_noise(circle * 3.0 + 7.0) - 0.5;
    let fibres = 0.55 * eye_noise(vec2f((turn + 0.5) * 90.0, r * 2.6 + wave))
        + 0.45 * eye_noise(vec2f((turn + 0.5) * 170.0 + 3.0, r * 4.0));
    let crypts = smoothstep(0.62, 0.85, eye_noise(circle * (2.2 + 2.0 * r) + vec2f(3.0, r * 5.0)));
    let texture = mix(0.5, fibres, fibre_fade);
    let colors = iris_colors();
    let collarette = smoothstep(0.42, 0.22, r + 0.16 * wave);
    var iris = mix(colors[1], colors[0], 0.85 * collarette);
    iris *= 0.45 + 1.25 * texture - 0.25 * crypts;
    iris *= 1.0 - 0.86 * smoothstep(0.70, 0.97, r);
    iris *= mix(0.6, 1.0, smoothstep(0.0, 0.12, r));
    let pupil = smoothstep(pupil_angle - pixel, pupil_angle + pixel, radius);
    iris *= mix(0.04, 1.0, pupil);

    // Sclera: grey-yellow, veined and red towards the corners, where the caruncle is flesh.
    let blush = smoothstep(0.62, 1.25, theta);
    let vein_at = vec2f(turn * 34.0 + 1.6 * eye_noise(from_axis * 60.0), theta * 3.2);
    let vein = smoothstep(0.10, 0.0, abs(eye_noise(vein_at) - 0.5)) * smoothstep(0.6, 1.1, theta);
    var sclera = mix(vec3f(0.44, 0.405, 0.37), vec3f(0.38, 0.235, 0.20), blush);
    sclera *= mix(vec3f(1.0), vec3f(0.93, 0.66, 0.60), 0.6 * vein * clamp(0.04 / pixel, 0.2, 1.0));
    // The ball turns away into the corners, where lids, lashes and caruncle keep the light off.
    sclera *= 1.0 - 0.38 * smoothstep(0.62, 1.15, theta);
    let limbus = smoothstep(IRIS_ANGLE - 0.07 - pixel, IRIS_ANGLE + 0.075 + pixel, radius);
    (*surface).albedo = mix(iris, sclera, limbus);

    // The iris is a shallow bowl: it is lit as if it faced the middle.
    let outward_uv = select(vec2f(0.0), from_axis / length(from_axis), length(from_axis) > 1e-5);
    let outward = outward_uv.x * tangent - outward_uv.y * bitangent;
    let axis = normalize(normal * cos(theta) - outward * sin(theta));
    let bowl = normalize(axis - 0.35 * r * outward);
    (*surface).diffuse_normal = normalize(mix(bowl, normal, limbus));

    // Lids and lashes shade what lies under them, in any pose: the picture itself says how near their edges are.
    let pixels_per_mm = 0.001 * view.origin.w / max(dot((*surface).position - view.origin.xyz, view.forward.xyz), 0.01);
    let up = vec2f(0.0, -1.0);
    let above = to_lid(pixel_at, up, pixels_per_mm, 4.2);
    let below = to_lid(pixel_at, -up, pixels_per_mm, 2.1);
    let shade = (1.0 - 0.72 * exp(-above / 1.3) * smoothstep(4.2, 2.6, above)) * (1.0 - 0.45 * exp(-below / 0.5));
    (*surface).occlusion *= shade;
    // Blood in the lid reddens what light it lets through.
    (*surface).albedo *= mix(vec3f(0.78, 0.60, 0.54), vec3f(1.0), smoothstep(0.0, 1.1, min(above, 1.4 * below)));
    (*surface).albedo *= 0.35 + 0.65 * shade;
    // The tear line: a concave film against the lower lid that mirrors what is above.
    let film = smoothstep(0.5, 0.12, below);
    if film > 0.0 {
        let rim = normalize(view.up.xyz);
        (*surface).normal = normalize((*surface).normal + 0.9 * film * rim);
        (*surface).roughness = mix((*surface).roughness, 0.10, film);
    }
}
