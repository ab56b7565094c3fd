use super::*;
use std::path::PathBuf;

/// The published table in `file`, or nothing where the shared data is not at hand.
fn published(file: &str) -> Option<Vec<u8>> {
    let Some(folder) = std::env::var_os("RUBOR_SHARED") else {
        eprintln!("SKIPPED: RUBOR_SHARED is not set, {file} is not compared");
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
