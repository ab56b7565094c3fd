//! What a program needs to colour and wrinkle the skin without rubor: the look-up of its colour, and what the sequence does
//! to it. The formulas are in `docs/facial-appearance.md`.

use rubor_rig::color::srgb_encode;
use rubor_rig::evaluate::Evaluator;
use rubor_rig::face_state::FaceState;
use rubor_rig::skin::chromophores::{ChromophoreModel, MAX_HEMOGLOBIN, MAX_MELANIN, SkinModel, fractions_at};

use super::buffer::{Buffer, Precision, Target, WEIGHT};
use crate::error::ExportError;
use crate::export::image_codec::encode_png;
use crate::facial_appearance::{SkinAnimationEntry, SkinLookUpEntry};

/// Texels of the look-up along each axis.
const LOOK_UP_SIDE: u32 = 128;

/// The colours of the renderer's model.
pub(super) fn look_up(buffer: &mut Buffer) -> Result<SkinLookUpEntry, ExportError> {
    let table = SkinModel::new(&ChromophoreModel::default()).bake(LOOK_UP_SIDE, LOOK_UP_SIDE);
    let last = f64::from(LOOK_UP_SIDE - 1);
    let texel = |i: u32| {
        let (x, y) = (f64::from(i % LOOK_UP_SIDE) / last, f64::from(i / LOOK_UP_SIDE) / last);
        let [melanin, hemoglobin] = fractions_at(x, y).map(|f| f as f32);
        table.sample(melanin, hemoglobin).map(|c| (srgb_encode(c.clamp(0.0, 1.0)) * 255.0).round() as u8)
    };
    let texels: Vec<u8> = (0..LOOK_UP_SIDE * LOOK_UP_SIDE).flat_map(texel).collect();
    let name = "skin look-up";
    let bytes = encode_png(name, &texels, LOOK_UP_SIDE, LOOK_UP_SIDE, image::ExtendedColorType::Rgb8)?;
    Ok(SkinLookUpEntry {
        image: buffer.image(name, &bytes, "image/png") as u32,
        most_melanin: MAX_MELANIN as f32,
        most_hemoglobin: MAX_HEMOGLOBIN as f32,
    })
}

/// Weights at every frame of the sequence.
pub(super) fn animation(evaluator: &Evaluator, buffer: &mut Buffer) -> SkinAnimationEntry {
    let frames: Vec<f64> = (0..evaluator.frame_count()).map(|f| evaluator.frame_time_s(f)).collect();
    let faces: Vec<FaceState> = frames.iter().map(|t| evaluator.face_at(*t)).collect();
    let authored: Vec<_> = frames.iter().map(|t| evaluator.weights_at(*t)).collect();
    let mut rows =
        |width: usize, numbers: Vec<f32>| (width > 0).then(|| buffer.rows(&numbers, width, WEIGHT) as u32);
    let names = |list: &mut dyn Iterator<Item = &str>| list.map(str::to_owned).collect::<Vec<_>>();
    let expressions = names(&mut evaluator.rig().expression_names());
    let states = names(&mut evaluator.rig().state_names());
    let of = |list: fn(&FaceState) -> &Vec<f32>| faces.iter().flat_map(|f| list(f).clone()).collect();
    let (zones, distributions) =
        faces.first().map_or((0, 0), |face| (face.zones.len(), face.distributions.len()));
    let expression_weights =
        rows(expressions.len(), authored.iter().flat_map(|w| w.expressions.clone()).collect());
    let state_weights = rows(states.len(), authored.iter().flat_map(|w| w.states.clone()).collect());
    let zone_weights = rows(zones, of(|f| &f.zones));
    let distribution_weights = rows(distributions, of(|f| &f.distributions));
    let times: Vec<[f32; 1]> = frames.iter().map(|t| [*t as f32]).collect();
    let scales: Vec<f32> = faces.iter().map(|f| f.hemoglobin_scale).collect();
    let pupils: Vec<f32> = faces.iter().map(|f| f.pupil_mm).collect();
    SkinAnimationEntry {
        times: buffer.floats(&times, Target::None, true, Precision::Exact) as u32,
        expressions,
        expression_weights,
        states,
        state_weights,
        zone_weights,
        distribution_weights,
        hemoglobin_scales: buffer.rows(&scales, 1, WEIGHT) as u32,
        pupils_mm: buffer.rows(&pupils, 1, WEIGHT) as u32,
    }
}
