//! The search texture: decodes the end of a line from one bilinear fetch of the edges.
//!
//! A fetch a quarter of a pixel to the left and an eighth up of a pixel's centre mixes four edge bits with the
//! weights 21, 7, 3 and 1 (in 1/32), so that each of the 16 combinations has a sum of its own (equation 10.5).

/// Width of the cropped texture in texels; columns 0 to 32 serve searches to the left, 33 on to the right.
pub const SEARCH_WIDTH: usize = 64;
/// Height of the cropped texture in texels.
pub const SEARCH_HEIGHT: usize = 16;

const SIDE: usize = 33;
/// Bilinear weights in 1/32 of the bits: across and before, across, before, at the fetched pixel.
const WEIGHTS: [usize; 4] = [1, 3, 7, 21];
const ACROSS_BEFORE: usize = 0;
const ACROSS: usize = 1;
const BEFORE: usize = 2;
const AT: usize = 3;

/// Bits of a sum of [`WEIGHTS`], or nothing where no combination gives that sum.
fn bits_of(sum: usize) -> Option<[bool; 4]> {
    (0..16)
        .map(|code| std::array::from_fn(|bit| code >> bit & 1 == 1))
        .find(|bits: &[bool; 4]| (0..4).map(|i| if bits[i] { WEIGHTS[i] } else { 0 }).sum::<usize>() == sum)
}

/// Pixels that a search to the left may still go on: `crossing` holds left edges, `line` top edges.
fn steps_left(crossing: [bool; 4], line: [bool; 4]) -> u8 {
    match (line[AT], line[BEFORE]) {
        (false, _) => 0,
        (true, true) if !crossing[ACROSS] && !crossing[AT] => 2,
        _ => 1,
    }
}

/// The same to the right, where the fetched pixel's own left edge ends the line before the pixel.
fn steps_right(crossing: [bool; 4], line: [bool; 4]) -> u8 {
    match (line[AT] && !crossing[ACROSS] && !crossing[AT], line[BEFORE]) {
        (false, _) => 0,
        (true, true) if !crossing[ACROSS_BEFORE] && !crossing[BEFORE] => 2,
        _ => 1,
    }
}

/// All sums: 66 x 33 texels, 1 byte each, steps 0, 1, 2 stored as 0, 127, 254. The column is the sum of crossing
/// edges, the row the sum of edges along the line.
pub fn search_texture_uncropped() -> Vec<u8> {
    let mut texels = vec![0u8; 2 * SIDE * SIDE];
    for (row, texels) in texels.chunks_mut(2 * SIDE).enumerate() {
        for column in 0..SIDE {
            if let (Some(crossing), Some(line)) = (bits_of(column), bits_of(row)) {
                texels[column] = 127 * steps_left(crossing, line);
                texels[SIDE + column] = 127 * steps_right(crossing, line);
            }
        }
    }
    texels
}

/// The part that searches reach, bottom row first: 64 x 16 texels. Rows under 17 are zero, since a pixel without
/// an edge ends a line.
pub fn search_texture() -> Vec<u8> {
    let all = search_texture_uncropped();
    (0..SEARCH_HEIGHT)
        .flat_map(|y| all[(SIDE - 1 - y) * 2 * SIDE..][..SEARCH_WIDTH].iter().copied())
        .collect()
}
