//! Stills for other programs, with our light of the same definition.
//!
//! ```text
//! FOLDER/STILL/scene.json     camera, lamps, medium; lengths in mm, power at a metre
//!              surface.ply    the closed surface, facets      blockers.ply   what is black
//!              scattered.f32, scattered-all-facets.f32        light that was scattered inside, for two boundaries (`Masking`)
//!              ...-error.f32  its standard error              patches.u8     what each pixel shows, 255 for no skin
//! ```
//!
//! Lamps are points or parallel light, spots without a cone, all with shadows; a pixel is a box; normals are those of the
//! triangles. `tests/interchange/volume.sh` draws them with Mitsuba and Cycles and compares.

use std::path::Path;

use rubor_rig::evaluate::LightState;
use rubor_rig::head::{Head, MM_PER_METRE};
use rubor_rig::skin::volume::{self, Body, Filter, Lamp, Masking, Normals, Patch, View};
use rubor_rig::timeline::LightKind;
use serde_json::{Value, json};

use super::{MediumName, SEED, Scene, folder_of, skin};
use crate::error::{Failure, Outcome};
use crate::output;
use crate::watch::Watch;

/// Writes stills of a head into folders of their own.
///
/// # Errors
/// A head without an inside; files that cannot be written.
pub fn write(
    folder: &Path,
    head: &Head,
    stills: &[Scene],
    medium: MediumName,
    size: [u32; 2],
    paths: u32,
    watch: &mut dyn Watch,
) -> Outcome {
    watch.begin("stills", stills.len() as u64);
    for still in stills {
        let folder = folder_of(folder, still)?;
        let shot = skin::bare_shot(&still.shot);
        let body = Body::new(head, &shot.face, Normals::Facets).map_err(Failure::input)?;
        let view = View::new(&shot.camera, size);
        let lights: Vec<LightState> = shot.lights.iter().map(without_cone).collect();
        let lamps: Vec<Lamp> = lights.iter().map(|l| Lamp::new(l, 0.0, 0.0)).collect();
        output::write(&folder.join("surface.ply"), &ply(&body, body.surface()))?;
        output::write(&folder.join("blockers.ply"), &ply(&body, body.blockers()))?;
        let number = |patch: &Option<Patch>| {
            patch.and_then(|p| Patch::ALL.iter().position(|q| *q == p)).map_or(255, |i| i as u8)
        };
        let patches: Vec<u8> = volume::patches(&body, &lamps, &view).iter().map(number).collect();
        output::write(&folder.join("patches.u8"), &patches)?;
        let mut alpha = 0.0;
        for (masking, name) in
            [(Masking::Separable, "scattered"), (Masking::AllFacets, "scattered-all-facets")]
        {
            let (flesh, roughness) = medium.exported_flesh(masking)?;
            alpha = roughness;
            let options = volume::Options { paths, seed: SEED, filter: Filter::Box };
            let picture = volume::picture(&flesh, &body, &lamps, &view, &options);
            output::write(&folder.join(format!("{name}.f32")), &floats(picture.scattered.as_flattened()))?;
            let error = floats(picture.scattered_error.as_flattened());
            output::write(&folder.join(format!("{name}-error.f32")), &error)?;
        }
        let camera = shot.camera;
        let [scattering, absorption] = {
            let media = medium.media()?;
            [media.map(|m| m.sigma_s_prime_per_mm), media.map(|m| m.sigma_a_per_mm)]
        };
        let scene = json!({
            "name": still.name,
            "size": size,
            "paths": paths,
            "camera": {
                "positionMm": (MM_PER_METRE * camera.position).to_array(),
                "targetMm": (MM_PER_METRE * camera.target).to_array(),
                "up": camera.up.to_array(),
                "fovYDegrees": camera.fov_y.to_degrees(),
            },
            "lamps": lights.iter().map(described).collect::<Vec<Value>>(),
            "medium": {
                "name": medium.name(),
                "sigmaSPerMm": scattering,
                "sigmaAPerMm": absorption,
                "anisotropy": 0.0,
                "eta": skin::BOUNDARY[0],
                "alpha": alpha,
            },
            "closedRims": body.holes(),
            "volumeMm3": body.volume_mm3(),
        });
        output::write_json(&folder.join("scene.json"), &scene)?;
        watch.step();
    }
    watch.end();
    Ok(())
}

fn without_cone(light: &LightState) -> LightState {
    let kind = if light.kind == LightKind::Spot { LightKind::Point } else { light.kind };
    LightState { kind, ..light.clone() }
}

/// Irradiance of parallel light, or radiant intensity: irradiance at a metre.
fn described(light: &LightState) -> Value {
    let power = light.power_linear.to_array();
    match light.kind {
        LightKind::Directional => {
            json!({ "kind": "directional", "power": power, "direction": light.direction.to_array() })
        }
        _ => {
            let position = (MM_PER_METRE * light.position).to_array();
            json!({ "kind": "point", "power": power, "positionMm": position })
        }
    }
}

fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

/// Triangles as a binary PLY: x, y, z in mm.
fn ply(body: &Body, triangles: &[[u32; 3]]) -> Vec<u8> {
    let points = body.points_mm();
    let mut out = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
         element face {}\nproperty list uchar uint vertex_indices\nend_header\n",
        points.len(),
        triangles.len()
    )
    .into_bytes();
    out.extend(floats(points.iter().flat_map(|p| p.to_array()).collect::<Vec<f32>>().as_slice()));
    for t in triangles {
        out.push(3);
        t.iter().for_each(|p| out.extend(p.to_le_bytes()));
    }
    out
}
