use super::*;
use std::path::PathBuf;

/// The published table in `file`, or `None` without the shared data.
fn published(file: &str) -> Option<Vec<u8>> {
    let Some(folder) = std::env::var_os("RUBOR_SHARED") else {
        crate::testing::skipped(&format!("RUBOR_SHARED is not set, {file} is not compared"));
        return None;
    };
    let path = PathBuf::from(folder).join("smaa").join(file);
    Some(std::fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display())))
}

fn assert_same_texels(made: &[u8], published: &[u8], width: usize, channels: usize) {
    assert_eq!(made.len(), published.len());
    let wrong: Vec<_> = (0..made.len()).filter(|&i| made[i] != published[i]).collect();
    let sample: Vec<_> = wrong
        .iter()
        .take(20)
        .map(|&i| ((i / channels) % width, i / channels / width, i % channels, made[i], published[i]))
        .collect();
    assert!(
        wrong.is_empty(),
        "{} of {} bytes differ: (x, y, channel, made, published) {sample:?}",
        wrong.len(),
        made.len()
    );
}

#[test]
fn area_texture_equals_the_published_one() {
    let started = std::time::Instant::now();
    let made = area_texture();
    eprintln!("area texture made in {:?}", started.elapsed());
    if let Some(published) = published("area_160x560_rg8.bin") {
        assert_same_texels(&made, &published, AREA_WIDTH, 2);
    }
}

#[test]
fn search_textures_equal_the_published_ones() {
    if let Some(published) = published("search_66x33_r8.bin") {
        assert_same_texels(&search_texture_uncropped(), &published, 66, 1);
    }
    if let Some(published) = published("search_64x16_r8.bin") {
        assert_same_texels(&search_texture(), &published, SEARCH_WIDTH, 1);
    }
}

#[test]
fn areas_of_known_lines() {
    let area = |near, far, left, right| orthogonal_area(near, far, left, right, 0.0, Smoothing::None);
    // Crossing above at the near end of a line of 4: the contour falls from 1/2 to 0 over 2 pixels.
    assert_eq!(area(1, 0, 0, 3), [0.0, 0.375]);
    assert_eq!(area(1, 0, 1, 2), [0.0, 0.125]);
    assert_eq!(area(1, 0, 2, 1), [0.0, 0.0]);
    // Crossing below at the far end.
    assert_eq!(area(0, 2, 3, 0), [0.375, 0.0]);
    // From above to below: the middle pixel of an odd length has both parts.
    assert!(area(1, 2, 1, 1).iter().all(|a| (a - 1.0 / 24.0).abs() < 1e-15));
    // No crossing, or both at both ends: no contour follows.
    assert_eq!(area(0, 0, 5, 2), [0.0, 0.0]);
    assert_eq!(area(3, 3, 5, 2), [0.0, 0.0]);
}

#[test]
fn orthogonal_areas_are_mirrored_with_their_lines() {
    for (near, far) in all_crossings() {
        for (left, right) in (0..12).flat_map(|left| (0..12).map(move |right| (left, right))) {
            let direct = orthogonal_area(near, far, left, right, 0.0, Smoothing::Smaa);
            let mirrored = orthogonal_area(far, near, right, left, 0.0, Smoothing::Smaa);
            // Upside down: above and below swap.
            let flip = |crossing: Crossing| ((crossing & 1) << 1) | (crossing >> 1);
            let flipped = orthogonal_area(flip(near), flip(far), left, right, 0.0, Smoothing::Smaa);
            for side in 0..2 {
                assert!((direct[side] - mirrored[side]).abs() < 1e-12);
                assert!((direct[side] - flipped[1 - side]).abs() < 1e-12);
                assert!((0.0..=0.5).contains(&direct[side]));
            }
        }
    }
}

#[test]
fn the_table_holds_texels_at_square_distances_and_mixes_between() {
    let texture = area_texture();
    let table = AreaTable::smaa(&texture, 16, &[0, 3], &[0]);
    assert_eq!(table.stride, 17);
    assert_eq!(table.areas.len(), 2 * 16 * 17 * 17 + 16 * 20 * 20);
    let entry = |block: usize, pattern: usize, left: usize, right: usize| {
        table.areas[((block * 16 + pattern) * 17 + left) * 17 + right]
    };
    for (left, right) in (0..5).flat_map(|left| (0..5).map(move |right| (left, right))) {
        // Above near, below far: slots 1 and 3. The second block stands 3 * 80 rows down.
        let at = ((3 * 80 + 3 * 16 + right) * AREA_WIDTH + 16 + left) * 2;
        let expected = (u32::from(texture[at]) * 257, u32::from(texture[at + 1]) * 257);
        let found = entry(1, 1 + 4 * 2, left * left, right * right);
        assert_eq!((found & 0xffff, found >> 16), expected);
    }
    // Between the distances 1 and 4 the entry for 2 lies at sqrt(2).
    let (near, between, far) = (entry(0, 1, 1, 9) >> 16, entry(0, 1, 2, 9) >> 16, entry(0, 1, 4, 9) >> 16);
    let part = f64::from(near - between) / f64::from(near - far);
    assert!((part - (2f64.sqrt() - 1.0)).abs() < 1.0 / 256.0, "{part}");
}

#[test]
fn the_mlaa_table_covers_nine_distances() {
    let texture = mlaa_area_texture();
    assert_eq!(texture.len(), 45 * 45 * 2);
    // The slots of the impossible value 1/2 stay empty.
    assert!((0..45).all(|y| (18..27).all(|x| texture[(y * 45 + x) * 2..][..2] == [0, 0])));
    let table = AreaTable::mlaa(&texture);
    // Crossing above near, 3 pixels more to the right: 0.375 of 255, cut off.
    assert_eq!(table.areas[9 * 9 + 3] >> 16, 95 * 257);
}

#[test]
fn stairs_have_the_area_under_their_line() {
    for (before, after) in (0..9).flat_map(|b| (0..9).map(move |a| (b, a))).filter(|(b, a)| b % 2 == a % 2) {
        for block in 0..5 {
            let [below, above] = stair_area(before, after, DIAGONAL_OFFSETS[block]);
            assert!((0.0..=1.0).contains(&below) && (0.0..=1.0).contains(&above));
            // Turned by 180 degrees: ends, sides and the sample's place swap.
            let opposite = DIAGONAL_OFFSETS[OPPOSITE_DIAGONAL_OFFSET[block]];
            let turned = stair_area(after, before, opposite);
            assert!((below - turned[1]).abs() < 1e-12 && (above - turned[0]).abs() < 1e-12);
            // The same area by counting points.
            let points = 200;
            let (fx, fy) = DIAGONAL_OFFSETS[block];
            let start = if before.is_multiple_of(2) { 0.5 } else { -0.5 };
            let (length, shift) = ((before + after + 1) as f64, fy - fx);
            let counted = (0..points * points)
                .filter(|i| {
                    let at = |i: usize| (i as f64 + 0.5) / points as f64;
                    let (x, y) = (at(i % points), at(i / points));
                    let along = (x + y + before as f64) / length;
                    y - x + 0.5 < shift + start * (1.0 - 2.0 * along)
                })
                .count();
            assert!((above - counted as f64 / (points * points) as f64).abs() < 0.005);
        }
    }
    // At 45 degrees through the middles of all edges each pixel has a corner of 1/8.
    let endless = stair_area(4000, 4000, (0.0, 0.0));
    assert!(endless.iter().all(|area| (area - 0.125).abs() < 1e-3), "{endless:?}");
}
