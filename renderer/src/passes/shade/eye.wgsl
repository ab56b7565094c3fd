// The eye: cornea over a sunken iris, a sclera that is never white, the shadow and the tears at the lids, the caruncle.
// Concatenated after shade.wgsl.

// The azimuthal coordinates of Material::Eye. Angles in radians.
const IRIS_ANGLE = 0.5146;
const EYE_RADIUS_MM = 12.0;
const IRIS_DEPTH_MM = 2.2;
// Reduced scattering of 2 to 5 / mm in visible light (Bashkatov et al. 2010) spreads light over about this far.
const SCLERA_SPREAD_MM = 0.7;
// The strip of tears along the lower lid, and the tangent by which its normal turns.
const TEAR_HEIGHT_MM = 0.4;
const TEAR_TURN = 1.2;

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

// Pixel of the picture that shows a place.
fn pixel_of(position: vec3f) -> vec2f {
    let clip = view.clip_from_world * vec4f(position, 1.0);
    return (clip.xy / clip.w * vec2f(0.5, -0.5) + 0.5) * vec2f(view.size) + view.jitter;
}

fn pixels_per_mm_at(position: vec3f) -> f32 {
    return 0.001 * view.origin.w / max(dot(position - view.origin.xyz, view.forward.xyz), 0.01);
}

// Distance in mm, along the picture, from a pixel to where the picture shows none of `materials` (a bit each) in a
// direction; `reach` if that is farther.
fn to_border(pixel: vec2f, direction: vec2f, pixels_per_mm: f32, reach: f32, materials: u32) -> f32 {
    const STEPS = 7;
    var inside = 0.0;
    for (var i = 1; i <= STEPS; i++) {
        let d = reach * f32(i) / f32(STEPS);
        if !shows(pixel + direction * d * pixels_per_mm, materials) {
            // The border lies within this step.
            var outside = d;
            for (var k = 0; k < 3; k++) {
                let middle = 0.5 * (inside + outside);
                if shows(pixel + direction * middle * pixels_per_mm, materials) { inside = middle; } else { outside = middle; }
            }
            return 0.5 * (inside + outside);
        }
        inside = d;
    }
    return reach;
}

fn shows(pixel: vec2f, materials: u32) -> bool {
    let size = vec2i(textureDimensions(visible));
    let seen = textureLoad(visible, clamp(vec2i(pixel), vec2i(0), size - 1), 0).x;
    if seen == 0u || (seen >> HEAD_SHIFT) != params.head {
        return false;
    }
    return (materials & (1u << triangles[(seen & TRIANGLE_MASK) - 1u].w)) != 0u;
}

// Shadow on what light spreads in: its mean over a disc of that radius on the surface, whose taps are turned
// evenly so that their noise cancels.
fn spread_shadow(light: Light, surface: Surface, lit: Arriving, turn: f32) -> f32 {
    var moved = surface;
    let side = normalize(cross(surface.facet, select(vec3f(0.0, 1.0, 0.0), vec3f(1.0, 0.0, 0.0), abs(surface.facet.y) > 0.9)));
    let other = cross(surface.facet, side);
    // One loop for both: processors that run branches of a group in step would else pay twice.
    let taps = select(1u, SPREAD_TAPS, surface.spread_mm > 0.0);
    var sum = 0.0;
    for (var i = 0u; i < taps; i++) {
        let offset = 0.001 * surface.spread_mm * vogel_disk(i, taps, turn);
        let way = offset.x * side + offset.y * other;
        moved.position = surface.position + way;
        moved.lifted = surface.lifted + way;
        sum += shadow(light, moved, lit, turn + 2.0 * PI * f32(i) / f32(taps));
    }
    return sum / f32(taps);
}

const SPREAD_TAPS = 6u;

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

    // The cover of lids, in any pose: the picture itself says how near their edges are.
    let pixels_per_mm = pixels_per_mm_at((*surface).position);
    let pixel_at = pixel_of((*surface).position);
    let up = vec2f(0.0, -1.0);
    let above = to_border(pixel_at, up, pixels_per_mm, 4.2, 1u << EYE);
    let below = to_border(pixel_at, -up, pixels_per_mm, 2.8, 1u << EYE);
    // Towards the nose; the corners are where the lids come together.
    let nasal = smoothstep(0.1, -0.1, from_axis.x * sign(dot(params.middle, vec4f((*surface).position, 1.0))));
    let corner = smoothstep(6.2, 3.8, above + below) * smoothstep(0.57, 0.70, theta);

    // Sclera: warm off-white (collagen scatters all colours, the vessels over it take blue), yellower and redder away from
    // the iris. Vessels wind inwards from the corners in two sizes.
    let blush = smoothstep(0.60, 1.35, theta);
    let wander = 1.7 * eye_noise(from_axis * 55.0) + 0.6 * eye_noise(from_axis * 160.0);
    let large = abs(eye_noise(vec2f(turn * 30.0 + wander, theta * 3.0)) - 0.5);
    let small = abs(eye_noise(vec2f(turn * 74.0 + 2.0 * wander, theta * 6.0 + 9.0)) - 0.5);
    let vein_fade = clamp(0.04 / pixel, 0.2, 1.0);
    let vein = vein_fade * max(
        smoothstep(0.07, 0.0, large) * smoothstep(0.58, 0.95, theta),
        0.6 * smoothstep(0.09, 0.0, small) * smoothstep(0.68, 1.05, theta),
    );
    var sclera = mix(vec3f(0.60, 0.515, 0.415), vec3f(0.52, 0.355, 0.28), blush);
    sclera *= mix(vec3f(1.0), vec3f(0.92, 0.52, 0.44), 0.75 * vein);
    // The ball turns away into the corners, where lids, lashes and caruncle keep the light off.
    sclera *= 1.0 - 0.30 * smoothstep(0.62, 1.2, theta);
    // The caruncle and the fold before it fill the corner at the nose: wet, lumpy flesh.
    let flesh = corner * nasal;
    sclera = mix(sclera, vec3f(0.52, 0.20, 0.17), max(flesh, 0.25 * corner));
    let limbus = smoothstep(IRIS_ANGLE - 0.025 - pixel, IRIS_ANGLE + 0.055 + pixel, radius);
    (*surface).albedo = mix(iris, sclera, limbus);
    (*surface).spread_mm = SCLERA_SPREAD_MM * limbus;

    // The iris is a shallow bowl: it is lit as if it faced the middle.
    let outward_uv = select(vec2f(0.0), from_axis / length(from_axis), length(from_axis) > 1e-5);
    let outward = outward_uv.x * tangent - outward_uv.y * bitangent;
    let axis = normalize(normal * cos(theta) - outward * sin(theta));
    let bowl = normalize(axis - 0.5 * r * outward);
    (*surface).diffuse_normal = normalize(mix(bowl, normal, limbus));

    // Lids and lashes shade what lies under them.
    let shade = (1.0 - 0.68 * exp(-above / 1.4) * smoothstep(4.2, 2.4, above)) * (1.0 - 0.40 * exp(-below / 0.5));
    (*surface).occlusion *= shade;
    // Blood in the lid reddens what light it lets through.
    (*surface).albedo *= mix(vec3f(0.80, 0.60, 0.53), vec3f(1.0), smoothstep(0.0, 1.1, min(above, 1.4 * below)));
    (*surface).albedo *= 0.45 + 0.55 * shade;

    if flesh > 0.0 {
        let lumps = vec2f(
            eye_noise(from_axis * 190.0) - eye_noise(from_axis * 190.0 + vec2f(0.6, 0.0)),
            eye_noise(from_axis * 190.0 + 5.0) - eye_noise(from_axis * 190.0 + vec2f(5.0, 5.6)),
        );
        (*surface).normal = normalize((*surface).normal + 0.8 * flesh * (lumps.x * tangent + lumps.y * bitangent));
        (*surface).roughness = mix((*surface).roughness, 0.20, flesh);
    }
    // Tears stand against the lower lid in a concave strip, whose normal turns from that of the ball to that of the lid's
    // edge: somewhere in it a thin line mirrors each lamp (Golding et al. 1997: 0.2 to 0.3 mm high). What a pixel cannot
    // tell apart widens the lobe.
    let film = smoothstep(TEAR_HEIGHT_MM, 0.0, below) * (1.0 - flesh);
    if film > 0.0 {
        let rim = normalize(view.up.xyz + 0.3 * to_viewer);
        (*surface).normal = normalize((*surface).normal + TEAR_TURN * film * rim);
        let unresolved = min(TEAR_TURN / (TEAR_HEIGHT_MM * pixels_per_mm), 1.0);
        (*surface).roughness = mix((*surface).roughness, clamp(0.12 + 0.2 * unresolved, 0.12, 0.3), film);
    }
}
