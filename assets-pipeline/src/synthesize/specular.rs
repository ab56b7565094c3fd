//! Specular reflection by region.
//!
//! Weyrich et al. (2006) measured ten regions of 149 faces. Intensities and Beckmann roughnesses here lie in the
//! range that d'Eon and Luebke's specular map spans with them (papers/002 section 5: rho_s = 0.18 + 0.16 x,
//! m = 0.23 + 0.09 w), in the measured order: nose and lips shine most, cheeks and neck least.

use glam::Vec3;

use super::noise::noise;
use super::regions::Regions;

/// Specular intensity rho_s and roughness m where no region speaks.
const SKIN: [f32; 2] = [0.215, 0.295];

/// Intensity factor and Beckmann roughness of a point.
pub(crate) fn specular(place: Vec3, r: &Regions, cavity: f32, hair: f32, seed: u32) -> [f32; 2] {
    // Offsets from SKIN of the ten regions.
    let regions = [
        (r.forehead, 0.045, -0.030),
        (r.glabella, 0.020, -0.012),
        (r.lids, 0.015, -0.020),
        (r.nose, 0.060, -0.035),
        (r.nose_tip.max(r.nose_wing), 0.045, -0.020),
        (r.cheek.max(r.cheek_bone), 0.015, -0.004),
        (r.lower_cheek.max(r.jaw), -0.015, 0.012),
        (r.upper_lip, 0.000, 0.004),
        (r.chin, 0.030, -0.015),
        (r.neck.max(r.ear), -0.030, 0.022),
    ];
    let [mut intensity, mut roughness] = SKIN;
    for (weight, di, dm) in regions {
        intensity += weight * di;
        roughness += weight * dm;
    }
    // Oil lies in patches.
    let oil = noise(place, 11.0, seed ^ 0x01) + 0.6 * noise(place, 3.5, seed ^ 0x02);
    intensity *= 1.0 + 0.05 * oil;
    roughness *= 1.0 - 0.02 * oil;
    // Lips, linings and lid edges are wet.
    let wet = [(r.lips, 0.33, 0.232), (r.inner, 0.34, 0.230), (r.lid_edge * 0.7, 0.33, 0.230)];
    for (weight, i, m) in wet {
        intensity += weight * (i - intensity);
        roughness += weight * (m - roughness);
    }
    // Pores and furrows hold light back; hair scatters it.
    intensity *= (1.0 - 0.25 * cavity) * (1.0 - 0.45 * hair);
    roughness += 0.03 * hair;
    [intensity.clamp(0.05, 0.36), roughness.clamp(0.21, 0.34)]
}
