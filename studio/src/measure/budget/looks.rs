//! The frames that are looked at.

use rubor_rig::evaluate::{Evaluator, Shot};
use rubor_rig::face_state::FaceState;

/// A frame within this share of the largest weight of something counts as one of its peaks.
const NEAR_PEAK: f32 = 0.95;

/// A frame of a sequence.
#[derive(Clone, Debug)]
pub(super) struct Look {
    /// Index of the sequence.
    pub(super) sequence: usize,
    /// From 0.
    pub(super) frame: u32,
    /// What the whole head shows.
    pub(super) shot: Shot,
}

/// Weights of everything that can move, in one list.
fn weights(face: &FaceState) -> impl Iterator<Item = f32> + '_ {
    let blood = (face.hemoglobin_scale - 1.0).abs();
    face.shapes.iter().chain(&face.zones).chain(&face.distributions).map(|w| w.abs()).chain([blood])
}

/// Frames of a sequence, from 0, at most `most`: half of them evenly spread, the others those with the most peaks of weights that
/// no other has. How many of what moves have their peak in none of them.
pub(super) fn frames(faces: &[FaceState], most: usize) -> (Vec<u32>, usize) {
    if faces.len() <= most {
        return ((0..faces.len() as u32).collect(), 0);
    }
    let spread = most.div_ceil(2);
    let mut chosen: Vec<usize> = (0..spread).map(|i| (2 * i + 1) * faces.len() / (2 * spread)).collect();
    let all: Vec<Vec<f32>> = faces.iter().map(|face| weights(face).collect()).collect();
    let count = all.first().map_or(0, Vec::len);
    let peaks: Vec<f32> = (0..count).map(|i| all.iter().map(|w| w[i]).fold(0.0, f32::max)).collect();
    let is_peak = |frame: usize, i: usize| all[frame][i] >= NEAR_PEAK * peaks[i];
    let mut open: Vec<usize> = (0..count).filter(|i| peaks[*i] > 0.0).collect();
    open.retain(|i| !chosen.iter().any(|frame| is_peak(*frame, *i)));
    while chosen.len() < most && !open.is_empty() {
        let peaks_of = |frame: usize| open.iter().filter(|i| is_peak(frame, **i)).count();
        // The first of several equal ones.
        let Some(best) = (0..faces.len()).rev().max_by_key(|frame| peaks_of(*frame)) else { break };
        open.retain(|i| !is_peak(best, *i));
        chosen.push(best);
    }
    // What is left is spread between the others.
    while chosen.len() < most {
        let distance = |frame: usize| chosen.iter().map(|c| c.abs_diff(frame)).min().unwrap_or(0);
        let Some(next) = (0..faces.len()).rev().max_by_key(|frame| distance(*frame)) else { break };
        chosen.push(next);
    }
    chosen.sort_unstable();
    chosen.dedup();
    (chosen.into_iter().map(|frame| frame as u32).collect(), open.len())
}

/// Faces of all frames.
pub(super) fn faces(evaluator: &Evaluator) -> Vec<FaceState> {
    (0..evaluator.frame_count()).map(|f| evaluator.face_at(evaluator.frame_time_s(f))).collect()
}

#[cfg(test)]
mod tests {
    use rubor_rig::head::{BlendShape, Head};

    use super::*;

    #[test]
    fn every_peak_is_looked_at_where_frames_suffice() {
        let head = Head { shapes: vec![BlendShape::default(); 3], ..Head::default() };
        let faces: Vec<FaceState> = (0..100)
            .map(|frame| FaceState {
                // Shapes 0 and 1 have their peak together, shape 2 in a frame of its own.
                shapes: vec![
                    if frame == 37 { 1.0 } else { 0.1 },
                    if frame == 37 { -0.5 } else { 0.0 },
                    if frame == 99 { 0.2 } else { 0.0 },
                ],
                ..FaceState::neutral(&head)
            })
            .collect();
        let (found, open) = frames(&faces, 8);
        assert!(found.contains(&37) && found.contains(&99) && open == 0, "{found:?}");
        assert_eq!(found.len(), 8);
        assert!(found.windows(2).all(|w| w[0] < w[1]));
        assert_eq!(frames(&faces, 2), (vec![37, 50], 1), "one peak is left out, and that is said");
        assert_eq!(frames(&faces[..5], 8).0, [0, 1, 2, 3, 4]);
        assert_eq!(frames(&faces, 1).0, [50]);
    }
}
