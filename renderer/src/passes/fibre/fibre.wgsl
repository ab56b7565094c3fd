// Light that a fibre of hair scatters. Needs math.wgsl and light.wgsl; mod.rs has the theory.

const FIBRE_ETA = 1.55;
const FIBRE_F0 = 0.0465;
// Where lobes stand, as sums of the sines of both inclinations: cuticle scales lean by about two degrees.
const FIBRE_SHIFT = vec3f(-0.07, 0.035, 0.14);
// Deviations of the lobes in the same sums.
const FIBRE_WIDTH = vec3f(0.17, 0.12, 0.30);
// Concentrations of exp(k cos(azimuth)) for light that passes through and light that comes back, and the integral of
// each over a turn: 2 pi I0(k).
const FIBRE_AROUND = vec2f(3.65, 6.0);
const FIBRE_TURN = vec2f(52.6224, 422.4462);
// Share of the light through a fibre that is seen past it, and of what other hairs scatter back: cropped hair lies on
// more hair, where the rest of both ends.
const FIBRE_THROUGH = 0.15;
const FIBRE_DIFFUSE = 0.4;

fn fibre_lobe(x: f32, width: f32) -> f32 {
    let y = x / width;
    return exp(-0.5 * y * y) / (2.50662827 * width);
}

// Radiance of a fibre for unit irradiance across the light. Directions are unit; `tangent` runs from root to tip;
// `color` is the albedo of a dense mass of such hair; `spread` is the tangent of half the angle of the source.
fn fibre_radiance(tangent: vec3f, to_light: vec3f, to_viewer: vec3f, color: vec3f, spread: f32) -> vec3f {
    let sin_light = clamp(dot(tangent, to_light), -1.0, 1.0);
    let sin_view = clamp(dot(tangent, to_viewer), -1.0, 1.0);
    let cos_light = sqrt(1.0 - sin_light * sin_light);
    let cos_view = sqrt(1.0 - sin_view * sin_view);
    let cos_between = dot(to_light, to_viewer);
    let cos_azimuth = clamp((cos_between - sin_light * sin_view) / max(cos_light * cos_view, 1e-4), -1.0, 1.0);
    // Half the difference of the inclinations.
    let cos2_half = clamp(0.5 * (1.0 + cos_light * cos_view + sin_light * sin_view), 1e-4, 1.0);
    let cos_half = sqrt(cos2_half);

    // Attenuation of a path that meets the fibre at sqrt(3) / 2 of its radius, where most of the returned light does.
    let bent_eta = sqrt(FIBRE_ETA * FIBRE_ETA - 1.0 + cos2_half) / cos_half;
    let sin_inside = 0.8660254 / bent_eta;
    let cos_inside = sqrt(1.0 - (1.0 - cos2_half) / (FIBRE_ETA * FIBRE_ETA));
    let path = 2.0 * sqrt(1.0 - sin_inside * sin_inside) / cos_inside;
    let absorption = log(clamp(color, vec3f(1e-4), vec3f(1.0))) / 5.888;
    let passed = exp(-absorption * absorption * path);
    let mirrored = schlick(FIBRE_F0, 0.5 * cos_half);

    let sines = vec3f(sin_light + sin_view) - FIBRE_SHIFT;
    let widths = sqrt(FIBRE_WIDTH * FIBRE_WIDTH + spread * spread);
    let around = exp(FIBRE_AROUND * vec2f(-cos_azimuth, cos_azimuth)) / FIBRE_TURN;
    let reflected = fibre_lobe(sines.x, widths.x) * 0.25 * sqrt(0.5 + 0.5 * cos_azimuth)
        * schlick(FIBRE_F0, sqrt(clamp(0.5 + 0.5 * cos_between, 0.0, 1.0)));
    let through = square(1.0 - mirrored) * fibre_lobe(sines.y, widths.y) * around.x * passed;
    let returned = square(1.0 - mirrored) * mirrored * fibre_lobe(sines.z, widths.z) * around.y * passed * passed;
    let azimuth = acos(cos_azimuth);
    let cylinder = ((PI - azimuth) * cos_azimuth + sin(azimuth)) / (4.0 * PI);
    return (reflected + FIBRE_THROUGH * through + returned) * min(1.0, cos_light / max(cos_view, 1e-4))
        + FIBRE_DIFFUSE * cylinder * cos_light * color;
}
