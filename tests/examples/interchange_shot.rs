//! Camera and lights of a sequence on a head at its start, as other programs need them to draw the same picture.
//!
//! `interchange_shot HEAD.glb SEQUENCE.json SHOT.json` writes positions in metres in the space of the head's file, the
//! vertical field of view in radians, and the lights.

use std::path::Path;

use rubor_assets::import;
use rubor_rig::evaluate::Evaluator;
use rubor_rig::expression::Rig;
use rubor_rig::timeline::Sequence;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [file, sequence_file, out] = &arguments[..] else {
        return Err("expected HEAD.glb SEQUENCE.json SHOT.json".into());
    };
    let head = import::gltf::read(Path::new(file))?.head;
    let sequence = Sequence::from_json(sequence_file, &std::fs::read_to_string(sequence_file)?)?;
    let (evaluator, _) = Evaluator::new(&head, &Rig::default_rig()?, &sequence)?;
    let shot = evaluator.at(0.0);
    let lights: Vec<_> = (shot.lights.iter())
        .map(|light| {
            serde_json::json!({
                "power": light.power_linear.to_array(), "direction": light.direction.to_array(),
                "position": light.position.to_array(),
            })
        })
        .collect();
    let json = serde_json::json!({
        "camera": {
            "position": shot.camera.position.to_array(), "target": shot.camera.target.to_array(),
            "up": shot.camera.up.to_array(), "fovY": shot.camera.fov_y,
        },
        "lights": lights,
    });
    std::fs::write(out, serde_json::to_vec_pretty(&json)?)?;
    Ok(())
}
