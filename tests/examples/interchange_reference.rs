//! Where every vertex of an exported head is at ten times, as rubor computes it: what other programs are compared with.
//!
//! `interchange_reference HEAD.glb FOLDER [frames]` writes `FOLDER/reference.json` (times, height of the head, weights)
//! and two lists of f32 triples, time by time: `vertices.bin` (the vertices of all primitives in their order) and
//! `points.bin` (the points of the head). `frames` moves the times to frames of the sequence.

use std::path::Path;

use rubor_assets::import;
use rubor_rig::deform::deform_points;
use rubor_rig::evaluate::Evaluator;
use rubor_rig::expression::Rig;
use rubor_rig::head::Head;
use rubor_rig::timeline::Sequence;

/// Sampled times.
const TIMES: u32 = 10;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [file, folder, rest @ ..] = &arguments[..] else {
        return Err("expected HEAD.glb FOLDER [frames]".into());
    };
    let imported = import::gltf::read(Path::new(file))?;
    let (Some(rig), Some(sequence)) = (imported.rig, imported.sequence) else {
        return Err(format!("{file} carries no rig and sequence").into());
    };
    let rig = Rig::from_json("rig", &rig.to_string())?;
    let sequence = Sequence::from_json("sequence", &sequence.to_string())?;
    let head = imported.head;
    let (evaluator, _) = Evaluator::new(&head, &rig, &sequence)?;
    let last_s = sequence.frame_time_s(sequence.frame_count() - 1);
    let on_frames = rest.first().is_some_and(|r| r == "frames");
    let mut times: Vec<f64> = (0..TIMES)
        .map(|i| {
            // Spread by the golden ratio: between frames and never at a pattern of the keys.
            let time = (0.381_966 + 0.618_034 * f64::from(i)).fract() * last_s;
            if on_frames { (time * sequence.fps).round() / sequence.fps } else { time }
        })
        .collect();
    times.sort_by(f64::total_cmp);
    let (mut vertices, mut points, mut weights) = (Vec::<u8>::new(), Vec::<u8>::new(), Vec::new());
    for time in &times {
        let face = evaluator.face_at(*time);
        let deformed = deform_points(&head.mesh, &head.shapes, &face.shapes);
        let moved: Vec<[f32; 3]> =
            (deformed.iter()).map(|p| (face.head_rotation * *p + face.head_translation).to_array()).collect();
        let push = |list: &mut Vec<u8>, p: &[f32; 3]| p.iter().for_each(|c| list.extend(c.to_le_bytes()));
        moved.iter().for_each(|p| push(&mut points, p));
        head.mesh.vertices.iter().for_each(|v| push(&mut vertices, &moved[v.point as usize]));
        weights.push(face.shapes);
    }
    let folder = Path::new(folder);
    std::fs::create_dir_all(folder)?;
    std::fs::write(folder.join("vertices.bin"), vertices)?;
    std::fs::write(folder.join("points.bin"), points)?;
    let json = serde_json::json!({
        "heightMetres": head.height(), "fps": sequence.fps, "times": times, "weights": weights,
        "pictureTime": picture_time_s(&head, &evaluator, &times),
        "names": head.shapes.iter().map(|s| &s.name).collect::<Vec<_>>(),
        "vertices": head.mesh.vertices.len(), "points": head.mesh.points.len(),
    });
    std::fs::write(folder.join("reference.json"), serde_json::to_vec(&json)?)?;
    Ok(())
}

/// Of these times, that at which the lids are widest open.
fn picture_time_s(head: &Head, evaluator: &Evaluator, times: &[f64]) -> f64 {
    let lids: Vec<usize> =
        ["eyeBlinkLeft", "eyeBlinkRight"].iter().filter_map(|name| head.shape_index(name)).collect();
    let closed = |t: f64| {
        let face = evaluator.face_at(t);
        lids.iter().map(|lid| face.shapes[*lid]).sum::<f32>()
    };
    times.iter().copied().min_by(|a, b| closed(*a).total_cmp(&closed(*b))).unwrap_or_default()
}
