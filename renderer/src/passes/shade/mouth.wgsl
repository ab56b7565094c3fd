// Teeth and gums from the coordinates of rubor-assets' teeth: millimetres along the arch and from the biting edge.
// Concatenated after shade.wgsl.

// From the middle line to the far side of each tooth, mm (mean crown widths; R. C. Wheeler's dental anatomy).
const UPPER_TEETH = array<f32, 8>(0.0, 8.5, 15.0, 22.6, 29.7, 36.5, 46.5, 56.0);
const LOWER_TEETH = array<f32, 8>(0.0, 5.2, 10.9, 17.7, 24.7, 31.8, 42.8, 53.5);

// Light spreads in dentine over about 1 / mu_s' = 0.5 mm and farther in enamel (D. Fried et al. 1995: scattering of 28 / mm
// at g = 0.93 and 6 / mm at g = 0.96).
const TOOTH_SPREAD_MM = 1.3;
const LINING_SPREAD_MM = 1.5;
// Papillae of the tongue across the unit square of the texture, by eye on the default head.
const LINING_CELLS = 4500.0;

fn teeth(surface: ptr<function, Surface>, uv: vec2f, tangent: vec3f, bitangent: vec3f) {
    (*surface).specular = 0.6;
    (*surface).f0 = 0.056;
    (*surface).spread_mm = TOOTH_SPREAD_MM;
    let along_mm = 100.0 * uv.x;
    let upper = uv.y > 0.5;
    let height_mm = 100.0 * abs(uv.y - 0.5);
    let s = abs(along_mm);
    var left = 0.0;
    var right = 56.0;
    var number = 0u;
    for (var i = 0u; i < 7u; i++) {
        let a = select(LOWER_TEETH[i], UPPER_TEETH[i], upper);
        let b = select(LOWER_TEETH[i + 1u], UPPER_TEETH[i + 1u], upper);
        if s >= a && s < b {
            left = a;
            right = b;
            number = i;
        }
    }
    let width = right - left;
    // -1 to 1 across the tooth, towards the back.
    let x = 2.0 * (s - left) / width - 1.0;
    let crown_mm = select(9.5, 12.0, upper) - select(0.0, 1.4, number == 1u) - select(0.0, 2.0, number > 2u);
    let gum_line = crown_mm - 2.2 * pow(abs(x), 2.6);
    let gum = smoothstep(gum_line - 0.25, gum_line + 0.25, height_mm);
    // Teeth part wider towards the biting edge.
    let gap_mm = 0.5 * width * (1.0 - abs(x));
    let seam = smoothstep(0.45 - 0.05 * height_mm, 0.02, gap_mm) * (1.0 - gum);
    let root = smoothstep(0.55, 1.0, height_mm / crown_mm);
    let edge = smoothstep(1.6, 0.2, height_mm);
    let own = fract(sin(f32(number) * 12.9 + select(3.7, 0.0, along_mm > 0.0) + select(1.3, 0.0, upper)) * 437.5);
    var enamel = mix(vec3f(0.74, 0.655, 0.52), vec3f(0.58, 0.465, 0.325), 0.55 * root);
    enamel *= 0.88 + 0.16 * own - 0.10 * select(0.0, 1.0, number == 2u);
    // The edge has no dentine behind it: the dark of the mouth shows through, bluish.
    enamel = mix(enamel, vec3f(0.47, 0.45, 0.415), 0.4 * edge);
    enamel *= mix(vec3f(1.0), vec3f(0.42, 0.30, 0.24), seam);
    let flesh = vec3f(0.36, 0.125, 0.115) * (0.8 + 0.4 * smoothstep(0.0, 1.0, abs(x)));
    (*surface).albedo = mix(enamel, flesh, gum);
    (*surface).roughness = mix(0.16, 0.24, gum);
    // Crowns and the gum over each root bulge.
    let side = sign(along_mm);
    let slope = select(0.0, 1.0, abs(x) < 1.0) * side * (0.55 * pow(abs(x), 3.0) * sign(x)) * (1.0 - 0.5 * gum);
    let fall = select(-1.0, 1.0, upper) * 0.35 * smoothstep(0.6, 1.0, height_mm / max(gum_line, 1.0)) * (1.0 - gum);
    (*surface).normal = normalize((*surface).normal + slope * tangent + fall * bitangent);
    // Light that the teeth and the lining pass on to each other fills the shade of the lip in front; the cheeks close
    // in on the side teeth (the buccal corridor), which a smile should hint at and no more.
    (*surface).occlusion = max((*surface).occlusion, mix(0.80, 0.12, smoothstep(7.0, 32.0, s)));
    // Lips touch or nearly touch the teeth: a soft contact shadow, reddened by the lip, ends in the spread of the light.
    let cover = lip_cover((*surface).position, 3.5);
    let contact = 1.0 - 0.5 * exp(-cover.x / 1.1) - 0.25 * exp(-cover.y / 0.8);
    (*surface).occlusion *= max(contact, 0.1);
    (*surface).albedo *= mix(vec3f(0.78, 0.58, 0.52), vec3f(1.0), smoothstep(0.0, 2.2, min(cover.x, cover.y)));
    // They mirror and take on the red of the cheek that lies against them.
    (*surface).albedo = mix((*surface).albedo, vec3f(0.20, 0.075, 0.065), 0.9 * smoothstep(13.0, 26.0, s));
    (*surface).specular *= mix(1.0, 0.04, smoothstep(13.0, 24.0, s));
    // Saliva runs in a film of uneven thickness over the enamel.
    let wave = vec2f(eye_noise(vec2f(along_mm, height_mm) * 0.7), eye_noise(vec2f(along_mm, height_mm) * 0.7 + 31.0)) - 0.5;
    (*surface).normal = normalize((*surface).normal + 0.16 * (wave.x * tangent + wave.y * bitangent));
}

// Distances in mm along the picture up and down to the lips.
fn lip_cover(position: vec3f, reach: f32) -> vec2f {
    const OPEN = (1u << TEETH) | (1u << GUMS) | (1u << MUCOSA);
    let pixel = pixel_of(position);
    let pixels_per_mm = pixels_per_mm_at(position);
    let up = vec2f(0.0, -1.0);
    return vec2f(
        to_border(pixel, up, pixels_per_mm, reach, OPEN),
        to_border(pixel, -up, pixels_per_mm, reach, OPEN),
    );
}

// The lining of mouth and sockets, gums and the tongue.
fn lining(
    surface: ptr<function, Surface>,
    uv: vec2f,
    duv_dx: vec2f,
    duv_dy: vec2f,
    tangent: vec3f,
    bitangent: vec3f,
    is_tongue: bool,
) {
    (*surface).specular = 0.8;
    (*surface).roughness = 0.24;
    (*surface).spread_mm = LINING_SPREAD_MM;
    // Light falls in over the lower lip; deep, but never black, as red light is passed on from wall to wall.
    let cover = lip_cover((*surface).position, 14.0);
    let entering = exp(-cover.y / 7.0) * (1.0 - 0.6 * exp(-cover.x / 2.5));
    let depth = (*surface).occlusion * (*surface).occlusion * (*surface).occlusion;
    (*surface).occlusion = max(depth, mix(0.06, 0.36, entering));
    // Vessels under a thin wet skin, in patches; the tongue wears a pale coat of papillae.
    let at = uv * LINING_CELLS;
    let patches = eye_noise(at * 0.03) + 0.5 * eye_noise(at * 0.08 + 4.0) - 0.75;
    var color = vec3f(0.36, 0.105, 0.095) * (1.0 + vec3f(0.25, 0.45, 0.40) * patches);
    var bump = 0.5 * vec2f(eye_noise(at * 0.1) - 0.5, eye_noise(at * 0.1 + 17.0) - 0.5);
    if is_tongue {
        let pixel = LINING_CELLS * max(length(duv_dx), length(duv_dy));
        let fine = clamp(1.2 - pixel, 0.0, 1.0);
        let papillae = eye_noise(at) - 0.5;
        color = mix(vec3f(0.36, 0.105, 0.100), vec3f(0.39, 0.175, 0.155), clamp(0.4 + 0.5 * patches, 0.0, 1.0));
        color *= 1.0 + 0.3 * fine * papillae;
        bump += 0.55 * fine * vec2f(eye_noise(at + vec2f(0.7, 0.0)) - papillae - 0.5, eye_noise(at + vec2f(0.0, 0.7)) - papillae - 0.5);
    }
    (*surface).albedo = color;
    (*surface).normal = normalize((*surface).normal + bump.x * tangent + bump.y * bitangent);
}
