// Teeth and gums from the coordinates of rubor-assets' teeth: millimetres along the arch and from the biting edge.
// Concatenated after shade.wgsl.

// From the middle line to the far side of each tooth, mm (mean crown widths; R. C. Wheeler's dental anatomy).
const UPPER_TEETH = array<f32, 8>(0.0, 8.5, 15.0, 22.6, 29.7, 36.5, 46.5, 56.0);
const LOWER_TEETH = array<f32, 8>(0.0, 5.2, 10.9, 17.7, 24.7, 31.8, 42.8, 53.5);

fn teeth(surface: ptr<function, Surface>, uv: vec2f, tangent: vec3f, bitangent: vec3f) {
    (*surface).specular = 0.6;
    (*surface).f0 = 0.048;
    // Deep in the mouth hardly any light arrives; ambient visibility was taken with closed lips and says too little.
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
    let seam = smoothstep(0.55 - 0.06 * height_mm, 0.05, gap_mm) * (1.0 - gum);
    let root = smoothstep(0.55, 1.0, height_mm / crown_mm);
    let edge = smoothstep(1.6, 0.2, height_mm);
    let own = fract(sin(f32(number) * 12.9 + select(3.7, 0.0, along_mm > 0.0) + select(1.3, 0.0, upper)) * 437.5);
    var enamel = mix(vec3f(0.69, 0.62, 0.51), vec3f(0.57, 0.47, 0.34), 0.55 * root);
    enamel *= 0.88 + 0.16 * own - 0.10 * select(0.0, 1.0, number == 2u);
    enamel = mix(enamel, vec3f(0.44, 0.43, 0.40), 0.45 * edge);
    enamel *= 1.0 - 0.75 * seam;
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
    // They mirror and take on the red of the cheek that lies against them.
    (*surface).albedo = mix((*surface).albedo, vec3f(0.20, 0.075, 0.065), 0.9 * smoothstep(13.0, 26.0, s));
    (*surface).specular *= mix(1.0, 0.04, smoothstep(13.0, 24.0, s));
}
