//! White balance: a matrix that makes the light of a colour temperature and tint white.
//!
//! Theory: chromaticity of the Planckian locus by Krystek 1985 (CIE 1960 uv, 1000 to 15 000 K, error under 8e-5), moved by
//! the distance between D65 and that locus at 6504 K, so that the neutral setting is D65 itself and hues change smoothly on both sides; tint moves
//! along the normal of the locus (1/3000 of uv a step, as in the DNG specification). Light is adapted to D65 by scaling
//! cones (Lam 1985, "Bradford").

use glam::{DMat3, DVec2, DVec3};

use crate::settings::NEUTRAL_KELVIN;

/// Steps of tint in CIE 1960 uv.
const TINT_SCALE: f64 = 1.0 / 3000.0;
/// CIE 1931 xy of D65.
const D65: DVec2 = DVec2::new(0.3127, 0.3290);
/// Linear Rec. 709 to CIE XYZ (ITU-R BT.709-6 primaries, D65), by columns.
const XYZ_FROM_RGB: DMat3 = DMat3::from_cols(
    DVec3::new(0.412_390_8, 0.212_639_0, 0.019_330_8),
    DVec3::new(0.357_584_3, 0.715_168_7, 0.119_194_8),
    DVec3::new(0.180_480_8, 0.072_192_3, 0.950_532_2),
);
/// CIE XYZ to the cone space of Lam, by columns.
const CONES_FROM_XYZ: DMat3 = DMat3::from_cols(
    DVec3::new(0.8951, -0.7502, 0.0389),
    DVec3::new(0.2664, 1.7135, -0.0685),
    DVec3::new(-0.1614, 0.0367, 1.0296),
);

/// CIE 1960 uv of the Planckian locus.
fn planckian_uv(kelvin: f64) -> DVec2 {
    let t = kelvin;
    let u = (0.860_117_757 + 1.541_182_54e-4 * t + 1.286_412_12e-7 * t * t)
        / (1.0 + 8.424_202_35e-4 * t + 7.081_451_63e-7 * t * t);
    let v = (0.317_398_726 + 4.228_062_45e-5 * t + 4.204_816_91e-8 * t * t)
        / (1.0 - 2.897_418_16e-5 * t + 1.614_560_53e-7 * t * t);
    DVec2::new(u, v)
}

fn uv_of(xy: DVec2) -> DVec2 {
    DVec2::new(4.0 * xy.x, 6.0 * xy.y) / (-2.0 * xy.x + 12.0 * xy.y + 3.0)
}

fn xy_of(uv: DVec2) -> DVec2 {
    DVec2::new(3.0 * uv.x, 2.0 * uv.y) / (2.0 * uv.x - 8.0 * uv.y + 4.0)
}

/// CIE 1931 xy of the light that a setting shows as white.
pub(crate) fn white_xy(kelvin: f32, tint: f32) -> DVec2 {
    let kelvin = f64::from(kelvin);
    let at = planckian_uv(kelvin);
    let along = (planckian_uv(kelvin * 1.001) - planckian_uv(kelvin / 1.001)).normalize_or_zero();
    // Green lies above the locus, magenta below. A light that is greener has to be shown more magenta.
    let greener = if along.x < 0.0 { DVec2::new(along.y, -along.x) } else { DVec2::new(-along.y, along.x) };
    let offset = uv_of(D65) - planckian_uv(f64::from(NEUTRAL_KELVIN));
    xy_of(at + offset + greener * (f64::from(tint) * TINT_SCALE))
}

fn xyz_of(xy: DVec2) -> DVec3 {
    DVec3::new(xy.x / xy.y, 1.0, (1.0 - xy.x - xy.y) / xy.y)
}

/// Linear Rec. 709 to linear Rec. 709: the light of a temperature in kelvin and a tint becomes white.
pub(crate) fn matrix(kelvin: f32, tint: f32) -> DMat3 {
    let cones_from_rgb = CONES_FROM_XYZ * XYZ_FROM_RGB;
    let scale = (CONES_FROM_XYZ * xyz_of(D65)) / (CONES_FROM_XYZ * xyz_of(white_xy(kelvin, tint)));
    cones_from_rgb.inverse() * DMat3::from_diagonal(scale) * cones_from_rgb
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neutral_changes_nothing_and_the_chosen_light_becomes_white() {
        assert!(matrix(NEUTRAL_KELVIN, 0.0).abs_diff_eq(DMat3::IDENTITY, 1e-6));
        for (kelvin, tint) in [(2856.0, 0.0), (4000.0, 30.0), (5000.0, -20.0), (9000.0, 0.0), (15000.0, 10.0)]
        {
            let light = XYZ_FROM_RGB.inverse() * xyz_of(white_xy(kelvin, tint));
            let white = matrix(kelvin, tint) * light;
            let spread = white.max_element() - white.min_element();
            assert!(spread < 1e-3, "{kelvin} K, tint {tint}: {white}");
        }
    }

    #[test]
    fn white_points_are_near_to_those_of_the_literature() {
        // Illuminant A is Planckian at 2856 K; the offset of D65 moves it by 0.003 of uv.
        assert!(planckian_uv(2856.0).distance(uv_of(DVec2::new(0.44757, 0.40745))) < 2e-4);
        assert!(white_xy(2856.0, 0.0).distance(DVec2::new(0.44757, 0.40745)) < 0.012);
        // Daylight of 5003 K (D50).
        assert!(white_xy(5003.0, 0.0).distance(DVec2::new(0.3457, 0.3585)) < 0.002);
    }

    #[test]
    fn less_kelvin_is_bluer_and_more_tint_more_magenta() {
        let grey = DVec3::ONE;
        let (cold, warm) = (matrix(4000.0, 0.0) * grey, matrix(9000.0, 0.0) * grey);
        assert!(cold.z > 1.1 && cold.x < 0.95 && warm.z < 0.9 && warm.x > 1.02, "{cold} {warm}");
        let magenta = matrix(NEUTRAL_KELVIN, 50.0) * grey;
        assert!(magenta.y < 0.97 && magenta.x > magenta.y && magenta.z > magenta.y, "{magenta}");
    }
}
