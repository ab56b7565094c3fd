//! Specular reflection by region.
//!
//! Weyrich et al. (2006) measured ten regions of 149 faces. Roughnesses are Beckmann m about the middle of what d'Eon and
//! Luebke's specular map spans with them (Lee, "Realistic Skin Rendering" section 5: m = 0.23 + 0.09 w), widened on the T-zone and where skin
//! is wet; regions keep the measured order: nose, forehead and lips shine most, jaw and neck least. Intensities scale the
//! Fresnel reflectance of a clean surface (1 would be one of eta 1.4 without pores or hair); d'Eon and Luebke's are about
//! half of ours and look powdered under one lamp.

use glam::Vec3;

use super::face_space::plan;
use super::noise::{noise, smoothstep};
use super::regions::Regions;

/// Specular intensity rho_s and roughness m where no region speaks.
const SKIN: [f32; 2] = [0.34, 0.285];

/// Intensity factor and Beckmann roughness of a point.
pub(crate) fn specular(place: Vec3, r: &Regions, cavity: f32, hair: f32, seed: u32) -> [f32; 2] {
    // The T-zone is the middle of the forehead only.
    let centre = smoothstep(58.0, 30.0, plan(place).x.abs());
    // Offsets from SKIN of the regions.
    let regions = [
        (r.forehead * centre, 0.085, -0.032),
        (r.forehead * (1.0 - centre), -0.08, 0.030),
        (r.temple, -0.09, 0.030),
        (r.glabella, 0.070, -0.028),
        (r.lids, 0.060, -0.035),
        (r.nose, 0.160, -0.055),
        (r.nose_tip.max(r.nose_wing), 0.130, -0.035),
        (r.cheek.max(r.cheek_bone), 0.070, -0.022),
        (r.lower_cheek.max(r.jaw), -0.030, 0.018),
        (r.upper_lip, 0.020, 0.000),
        (r.chin, 0.080, -0.025),
        (r.neck.max(r.ear), -0.080, 0.035),
    ];
    let [mut intensity, mut roughness] = SKIN;
    for (weight, di, dm) in regions {
        intensity += weight * di;
        roughness += weight * dm;
    }
    // Oil lies in patches.
    let oil = noise(place, 11.0, seed ^ 0x01) + 0.6 * noise(place, 3.5, seed ^ 0x02);
    let oily = 0.35 + 0.65 * (r.forehead * centre).max(r.nose).max(r.nose_tip).max(r.chin);
    intensity *= 1.0 + 0.10 * oily * oil;
    roughness *= 1.0 - 0.045 * oily * oil;
    // Lips, linings and lid edges are wet.
    let wet = [(r.lips, 0.62, 0.205), (r.inner, 0.62, 0.24), (r.lid_edge * 0.7, 0.7, 0.19)];
    for (weight, i, m) in wet {
        intensity += weight * (i - intensity);
        roughness += weight * (m - roughness);
    }
    // Pores and furrows hold light back; hair scatters it.
    intensity *= (1.0 - 0.45 * cavity) * (1.0 - 0.88 * hair);
    roughness += 0.03 * hair;
    [intensity.clamp(0.05, 0.8), roughness.clamp(0.17, 0.36)]
}
