// What all scattering methods share. Concatenated after view.wgsl.

const MM_PER_METRE = 1000.0;
// Depth of the background.
const NOTHING_MM = 1e8;
// Relative depths from here on are not of skin: FAR_MM, or a mixture with it. Skin that much behind the nearest head does
// not scatter, nor could that be seen.
const NO_SKIN_MM = 4000.0;
// Depth change for a millimetre across beyond which two neighbours are taken for two surfaces (76 degrees).
const MAX_SLOPE = 4.0;
// Depth that pixels of one surface may differ by where they are taken together as a texel of a smaller image.
const ONE_SURFACE_MM = 4.0;
// Radius of a kernel in pixels above which positions would leave the range of integers.
const MAX_REACH = 1e6;
const HALF_MAX = 65504.0;

// View depth in millimetres.
fn depth_mm(view: View, depth: f32) -> f32 {
    return select(NOTHING_MM, MM_PER_METRE * view_depth(view, depth), depth > 0.0);
}

// Pixels for a millimetre of a surface that faces the camera.
fn pixels_per_mm(view: View, depth_mm: f32) -> f32 {
    return min(view.origin.w / depth_mm, MAX_REACH);
}

// Depth change from a pixel to the next, millimetres, from its two neighbours along a line: the smaller step, as the
// larger one may cross an edge; 0 where both do.
fn surface_slope(before_mm: f32, here_mm: f32, after_mm: f32, per_mm: f32) -> f32 {
    let backward = here_mm - before_mm;
    let forward = after_mm - here_mm;
    let slope = select(forward, backward, abs(backward) < abs(forward));
    return select(0.0, slope, abs(slope) * per_mm <= MAX_SLOPE);
}

// Length on screen of a millimetre along a surface of this slope, over that of one that faces the camera.
fn foreshortening(slope_mm: f32, per_mm: f32) -> f32 {
    let slope = slope_mm * per_mm;
    return inverseSqrt(1.0 + slope * slope);
}

// Share of a neighbour's light that arrives: 1 on the tangent plane of the centre, 0 where the surface is
// 1 / follow_per_mm off it.
fn follow(gap_mm: f32, follow_per_mm: f32) -> f32 {
    return saturate(1.0 - follow_per_mm * abs(gap_mm));
}
