//! Colour: CIE XYZ, CIELAB, linear Rec. 709 and sRGB, and the CIEDE2000 difference.
//!
//! The white of everything here is D65 as tabulated at 5 nm, XYZ (0.95043, 1, 1.08880), so that a reflectance of 1 at
//! every wavelength is exactly (1, 1, 1) in Rec. 709 and L* = 100 in CIELAB.

/// XYZ of D65 under the CIE 1931 2-degree observer, both tabulated at 5 nm.
pub const D65_WHITE_XYZ: [f64; 3] = [0.9504296694021496, 1.0, 1.0888005470297513];

/// XYZ to linear Rec. 709: the primaries of ITU-R BT.709 with the white of [`D65_WHITE_XYZ`].
pub const REC709_FROM_XYZ: [[f64; 3]; 3] = [
    [3.240830118575194, -1.5373168511190023, -0.4985892490115683],
    [-0.9692293285718742, 1.8759398089894406, 0.0415544439828034],
    [0.055645288541011716, -0.2040327246503761, 1.057260482279222],
];

/// Linear Rec. 709 to XYZ, the inverse of [`REC709_FROM_XYZ`].
pub const XYZ_FROM_REC709: [[f64; 3]; 3] = [
    [0.4124085915760861, 0.357589618023847, 0.18043145980221642],
    [0.2126481800314194, 0.715179236047694, 0.07217258392088657],
    [0.019331652730129014, 0.1191965393412823, 0.95027235495834],
];

/// Product of a 3 x 3 matrix and a column.
pub fn transform(matrix: &[[f64; 3]; 3], v: [f64; 3]) -> [f64; 3] {
    matrix.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

/// CIELAB (L*, a*, b*) of an XYZ relative to D65 (CIE 15).
pub fn lab_from_xyz(xyz: [f64; 3]) -> [f64; 3] {
    let f = |t: f64| {
        // 6/29 is where the cube root meets its tangent.
        if t > (6.0f64 / 29.0).powi(3) { t.cbrt() } else { t * (29.0f64 / 6.0).powi(2) / 3.0 + 4.0 / 29.0 }
    };
    let [x, y, z] = [0, 1, 2].map(|i| f(xyz[i] / D65_WHITE_XYZ[i]));
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// XYZ of a CIELAB colour relative to D65, the inverse of [`lab_from_xyz`].
pub fn xyz_from_lab(lab: [f64; 3]) -> [f64; 3] {
    let y = (lab[0] + 16.0) / 116.0;
    let f = [y + lab[1] / 500.0, y, y - lab[2] / 200.0];
    let inverse = |t: f64| {
        if t > 6.0 / 29.0 { t * t * t } else { (t - 4.0 / 29.0) * 3.0 * (6.0f64 / 29.0).powi(2) }
    };
    [0, 1, 2].map(|i| inverse(f[i]) * D65_WHITE_XYZ[i])
}

/// CIELAB of a linear Rec. 709 colour.
pub fn lab_from_rec709(rgb_linear: [f64; 3]) -> [f64; 3] {
    lab_from_xyz(transform(&XYZ_FROM_REC709, rgb_linear))
}

/// Linear Rec. 709 of a CIELAB colour; components leave 0 to 1 outside the gamut.
pub fn rec709_from_lab(lab: [f64; 3]) -> [f64; 3] {
    transform(&REC709_FROM_XYZ, xyz_from_lab(lab))
}

/// sRGB transfer function: linear 0 to 1 to the display value (IEC 61966-2-1).
pub fn srgb_encode(linear: f32) -> f32 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// Inverse of [`srgb_encode`].
pub fn srgb_decode(encoded: f32) -> f32 {
    if encoded <= 0.040_45 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

/// Individual typology angle of a skin colour, degrees: atan((L* - 50) / b*) (Chardon, Cretois and Hourseau 1991).
///
/// Classes: very light > 55 > light > 41 > intermediate > 28 > tan > 10 > brown > -30 > dark.
pub fn individual_typology_angle_degrees(lab: [f64; 3]) -> f64 {
    (lab[0] - 50.0).atan2(lab[2]).to_degrees()
}

/// CIEDE2000 colour difference of two CIELAB colours, all weights 1 (Sharma, Wu and Dalal 2005).
pub fn ciede2000(lab1: [f64; 3], lab2: [f64; 3]) -> f64 {
    let pow7 = |x: f64| x.powi(7);
    let twenty_five = pow7(25.0);
    let chroma = |lab: [f64; 3]| lab[1].hypot(lab[2]);
    // The a* axis is stretched for colours near grey.
    let mean_chroma = 0.5 * (chroma(lab1) + chroma(lab2));
    let g = 0.5 * (1.0 - (pow7(mean_chroma) / (pow7(mean_chroma) + twenty_five)).sqrt());
    let (a1, a2) = ((1.0 + g) * lab1[1], (1.0 + g) * lab2[1]);
    let (c1, c2) = (a1.hypot(lab1[2]), a2.hypot(lab2[2]));
    let hue =
        |a: f64, b: f64| if a == 0.0 && b == 0.0 { 0.0 } else { b.atan2(a).to_degrees().rem_euclid(360.0) };
    let (h1, h2) = (hue(a1, lab1[2]), hue(a2, lab2[2]));

    let grey = c1 * c2 == 0.0;
    let mut dh = h2 - h1;
    if grey {
        dh = 0.0;
    } else if dh > 180.0 {
        dh -= 360.0;
    } else if dh < -180.0 {
        dh += 360.0;
    }
    let (d_lightness, d_chroma) = (lab2[0] - lab1[0], c2 - c1);
    let d_hue = 2.0 * (c1 * c2).sqrt() * (0.5 * dh).to_radians().sin();

    let mean_lightness = 0.5 * (lab1[0] + lab2[0]);
    let mean_c = 0.5 * (c1 + c2);
    let mean_h = if grey {
        h1 + h2
    } else if (h1 - h2).abs() <= 180.0 {
        0.5 * (h1 + h2)
    } else if h1 + h2 < 360.0 {
        0.5 * (h1 + h2 + 360.0)
    } else {
        0.5 * (h1 + h2 - 360.0)
    };
    let cos = |degrees: f64| degrees.to_radians().cos();
    let t = 1.0 - 0.17 * cos(mean_h - 30.0) + 0.24 * cos(2.0 * mean_h) + 0.32 * cos(3.0 * mean_h + 6.0)
        - 0.20 * cos(4.0 * mean_h - 63.0);
    let l50 = (mean_lightness - 50.0).powi(2);
    let s_l = 1.0 + 0.015 * l50 / (20.0 + l50).sqrt();
    let s_c = 1.0 + 0.045 * mean_c;
    let s_h = 1.0 + 0.015 * mean_c * t;
    // Interaction of chroma and hue in the blue.
    let d_theta = 30.0 * (-((mean_h - 275.0) / 25.0).powi(2)).exp();
    let r_c = 2.0 * (pow7(mean_c) / (pow7(mean_c) + twenty_five)).sqrt();
    let r_t = -r_c * (2.0 * d_theta).to_radians().sin();
    let (l, c, h) = (d_lightness / s_l, d_chroma / s_c, d_hue / s_h);
    (l * l + c * c + h * h + r_t * c * h).max(0.0).sqrt()
}
