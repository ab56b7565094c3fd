//! Targets: text files of `vertex dx dy dz`, plain or gzipped, decimetres.

use std::fs;
use std::io::Read;
use std::path::{Path, PathBuf};

use glam::Vec3;

use super::Options;
use crate::error::ImportError;
use crate::poly::Shape;

/// A target that moves every point of the base mesh has 1 MB of text; a few kilobytes of gzip can hold gigabytes.
const LARGEST_TEXT: u64 = 64 << 20;

/// Reads a target. Points are below `point_count`.
pub(super) fn read(path: &Path, point_count: usize) -> Result<Vec<(u32, Vec3)>, ImportError> {
    let bytes = rubor_rig::limits::read(path).map_err(ImportError::read(path))?;
    from_bytes(&bytes, path, point_count)
}

/// Reads a target from memory; `path` is for messages, and gzipped if it ends in `.gz`.
///
/// # Errors
/// A line that is no point below `point_count` with three finite numbers, more than 64 MiB of text, broken gzip.
pub fn from_bytes(bytes: &[u8], path: &Path, point_count: usize) -> Result<Vec<(u32, Vec3)>, ImportError> {
    let mut text = String::new();
    let decoded = if path.extension().is_some_and(|e| e == "gz") {
        flate2::read::GzDecoder::new(bytes).take(LARGEST_TEXT + 1).read_to_string(&mut text)
    } else {
        bytes.take(LARGEST_TEXT + 1).read_to_string(&mut text)
    };
    decoded.map_err(ImportError::read(path))?;
    if text.len() as u64 > LARGEST_TEXT {
        let found = format!("more than {} MiB of text", LARGEST_TEXT >> 20);
        return Err(ImportError::content(path, "size", found, "a target"));
    }
    let mut offsets = Vec::new();
    for (i, line) in text.lines().enumerate() {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        let parsed = match words[..] {
            [point, x, y, z] => point.parse::<u32>().ok().zip(number(x).zip(number(y)).zip(number(z))),
            _ => None,
        };
        match parsed {
            Some((point, ((x, y), z))) if (point as usize) < point_count => {
                offsets.push((point, Vec3::new(x, y, z)));
            }
            _ => {
                let expected = format!("a point below {point_count} and three finite numbers");
                return Err(ImportError::content(
                    path,
                    format!("line {}", i + 1),
                    format!("{line:?}"),
                    expected,
                ));
            }
        }
    }
    Ok(offsets)
}

fn number(word: &str) -> Option<f32> {
    word.parse().ok().filter(|v: &f32| v.is_finite())
}

/// Every face unit of a folder as a shape, sorted by name; file names are the ARKit names.
pub(super) fn face_units(folder: &Path, point_count: usize) -> Result<Vec<Shape>, ImportError> {
    let mut paths = Vec::new();
    for entry in fs::read_dir(folder).map_err(ImportError::read(folder))? {
        let path = entry.map_err(ImportError::read(folder))?.path();
        if path.extension().is_some_and(|e| e == "target") {
            paths.push(path);
        }
    }
    paths.sort();
    if paths.is_empty() {
        return Err(ImportError::content(folder, "folder", "no *.target files", "the ARKit face units"));
    }
    let shape = |path: &PathBuf| {
        let mut offsets = vec![Vec3::ZERO; point_count];
        for (p, offset) in read(path, point_count)? {
            offsets[p as usize] += offset;
        }
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        Ok(Shape { name, offsets })
    };
    paths.iter().map(shape).collect()
}

/// Files and weights of the macro mix: each file stands for one combination of extremes, its weight is the product of
/// the weights of its words (MakeHuman's scheme, `macrodetails/macro.json`).
pub(super) fn macro_targets(options: &Options) -> Vec<(PathBuf, f32)> {
    let sum: f32 = options.ethnicity.iter().sum();
    let race: Vec<_> =
        ["caucasian", "asian", "african"].into_iter().zip(options.ethnicity.map(|w| w / sum)).collect();
    let gender = between(&[(0.0, "female"), (1.0, "male")], options.gender);
    let age = between(&[(0.0, "baby"), (0.1875, "child"), (0.5, "young"), (1.0, "old")], options.age);
    let muscle = between(&[(0.0, "minmuscle"), (0.5, "averagemuscle"), (1.0, "maxmuscle")], options.muscle);
    let weight = between(&[(0.0, "minweight"), (0.5, "averageweight"), (1.0, "maxweight")], options.weight);
    let proportions =
        between(&[(0.0, "uncommonproportions"), (0.5, ""), (1.0, "idealproportions")], options.proportions);
    let height = between(&[(0.0, "minheight"), (0.5, ""), (1.0, "maxheight")], options.height);

    let root = options.data.join("mpfb2/targets");
    let mut files = Vec::new();
    let mut mix = |folder: &str, axes: &[&[(&str, f32)]]| {
        for (words, weight) in product(axes) {
            if weight > 0.0 && !words.contains(&"") {
                files.push((root.join(folder).join(format!("{}.target.gz", words.join("-"))), weight));
            }
        }
    };
    mix("macrodetails", &[&race, &gender, &age]);
    mix("macrodetails", &[&[("universal", 1.0)], &gender, &age, &muscle, &weight]);
    mix("macrodetails/proportions", &[&gender, &age, &muscle, &weight, &proportions]);
    mix("macrodetails/height", &[&gender, &age, &muscle, &weight, &height]);
    files.extend(options.targets.iter().map(|(name, w)| (root.join(format!("{name}.target.gz")), *w)));
    files
}

/// Weights of the two words around a value on an axis; words without weight are left out.
fn between<'a>(axis: &[(f32, &'a str)], value: f32) -> Vec<(&'a str, f32)> {
    let mut words = Vec::new();
    for pair in axis.windows(2) {
        let ((low, low_word), (high, high_word)) = (pair[0], pair[1]);
        if value >= low && (value < high || (value == high && high == axis[axis.len() - 1].0)) {
            let t = (value - low) / (high - low);
            words.extend([(low_word, 1.0 - t), (high_word, t)]);
        }
    }
    words.retain(|(_, w)| *w > 0.0);
    words
}

/// Every combination of one word an axis, with the product of the weights.
fn product<'a>(axes: &[&[(&'a str, f32)]]) -> Vec<(Vec<&'a str>, f32)> {
    let mut rows = vec![(Vec::new(), 1.0)];
    for axis in axes {
        rows = (rows.iter())
            .flat_map(|(words, weight)| {
                axis.iter().map(move |(word, w)| ([words.as_slice(), &[*word]].concat(), weight * w))
            })
            .collect();
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gzip_that_unfolds_without_end_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("bomb.target.gz");
        let file = fs::File::create(&path).unwrap();
        let mut encoder = flate2::write::GzEncoder::new(file, flate2::Compression::best());
        let line = b"# nothing but remarks\n".repeat(1 << 16);
        for _ in 0..=LARGEST_TEXT / line.len() as u64 {
            std::io::Write::write_all(&mut encoder, &line).unwrap();
        }
        encoder.finish().unwrap();
        let message = read(&path, 3).unwrap_err().to_string();
        assert!(message.contains("64 MiB") && message.contains("bomb.target.gz"), "{message}");
    }

    #[test]
    fn axis_weights_are_linear_between_words_and_sum_to_one() {
        let axis = [(0.0, "a"), (0.5, "b"), (1.0, "c")];
        assert_eq!(between(&axis, 0.0), [("a", 1.0)]);
        assert_eq!(between(&axis, 0.5), [("b", 1.0)]);
        assert_eq!(between(&axis, 1.0), [("c", 1.0)]);
        assert_eq!(between(&axis, 0.125), [("a", 0.75), ("b", 0.25)]);
    }

    #[test]
    fn macro_weights_of_each_family_sum_to_one() {
        let options = Options {
            ethnicity: [2.0, 1.0, 1.0],
            targets: Vec::new(),
            proportions: 0.5,
            gender: 0.3,
            age: 0.6,
            muscle: 0.7,
            weight: 0.2,
            ..Options::default()
        };
        let files = macro_targets(&options);
        let total = |universal: bool| -> f32 {
            let in_family = |p: &PathBuf| p.to_string_lossy().contains("universal") == universal;
            files.iter().filter(|(p, _)| in_family(p)).map(|(_, w)| w).sum()
        };
        assert_eq!(files.len(), 3 * 2 * 2 + 2 * 2 * 2 * 2);
        assert!((total(true) - 1.0).abs() < 1e-6 && (total(false) - 1.0).abs() < 1e-6);
    }
}
