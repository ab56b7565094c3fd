//! Wavefront OBJ polygons.
//!
//! Why not `tobj`: blend shape sets are matched by the order of `v` lines, Catmull-Clark needs the quads, and texture
//! seams need separate position and texture indices; its triangulated single-index mode loses all three.
//! Read here: `v`, `vt`, `f` (absolute and relative indices), `g`, `o`, `usemtl`. Everything else is skipped.

use std::fs;
use std::path::Path;

use glam::{Vec2, Vec3};

use crate::error::ImportError;
use crate::poly::{Corner, PolyMesh};

/// Which statement names the groups of the mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GroupBy {
    /// `g` and `o`.
    Group,
    /// `usemtl`.
    Material,
}

/// Reads polygons. Positions are in the file's units; v is turned to grow downwards.
///
/// # Errors
/// Unreadable file, a line that cannot be parsed, numbers that are not finite, indices out of range, no faces.
pub fn read_polygons(path: &Path, group_by: GroupBy) -> Result<PolyMesh, ImportError> {
    let text = fs::read(path).map_err(ImportError::read(path))?;
    let mut mesh = PolyMesh::default();
    let mut group = None;
    let mut missing_uv = None; // texture coordinate of corners without one
    for (number, line) in lines(&text) {
        let fail = |found: &str, expected: &str| {
            Err(ImportError::content(path, format!("line {number}"), found, expected))
        };
        let mut words = line.split_ascii_whitespace();
        match words.next() {
            Some("v") => mesh.points.push(position(path, number, words)?),
            Some("vt") => {
                let [u, v] = numbers::<2>(path, number, words)?;
                mesh.uvs.push(Vec2::new(u, 1.0 - v));
            }
            Some("f") => {
                let first = mesh.corners.len();
                for word in words {
                    let mut indices = word.split('/');
                    let Some(point) = index(indices.next(), mesh.points.len()) else {
                        return fail(
                            &format!("corner {word:?}"),
                            &format!("a position from 1 to {}", mesh.points.len()),
                        );
                    };
                    let uv = match indices.next().filter(|w| !w.is_empty()) {
                        Some(word_uv) => match index(Some(word_uv), mesh.uvs.len()) {
                            Some(uv) => uv,
                            None => {
                                return fail(
                                    &format!("corner {word:?}"),
                                    &format!("a texture coordinate from 1 to {}", mesh.uvs.len()),
                                );
                            }
                        },
                        None => *missing_uv.get_or_insert_with(|| {
                            mesh.uvs.push(Vec2::ZERO);
                            mesh.uvs.len() as u32 - 1
                        }),
                    };
                    mesh.corners.push(Corner { point, uv });
                }
                let found = mesh.corners.len() - first;
                if found < 3 {
                    return fail(&format!("a face of {found} corners"), "3 or more");
                }
                let group = *group.get_or_insert_with(|| mesh.group("default"));
                mesh.face_starts.push(mesh.corners.len() as u32);
                mesh.face_groups.push(group);
            }
            Some("g" | "o") if group_by == GroupBy::Group => {
                group = Some(mesh.group(words.next().unwrap_or("default")));
            }
            Some("usemtl") if group_by == GroupBy::Material => {
                group = Some(mesh.group(words.next().unwrap_or("default")));
            }
            _ => {}
        }
    }
    if mesh.face_count() == 0 {
        let found = format!("{} positions and no faces", mesh.points.len());
        return Err(ImportError::content(path, "end of file", found, "a mesh"));
    }
    Ok(mesh)
}

/// Reads only the positions: enough for a shape whose topology is that of the neutral mesh.
///
/// # Errors
/// As [`read_polygons`], for `v` lines.
pub fn read_positions(path: &Path) -> Result<Vec<Vec3>, ImportError> {
    let text = fs::read(path).map_err(ImportError::read(path))?;
    let mut points = Vec::new();
    for (number, line) in lines(&text) {
        if let Some(rest) = line.strip_prefix("v ").or_else(|| line.strip_prefix("v\t")) {
            points.push(position(path, number, rest.split_ascii_whitespace())?);
        }
    }
    Ok(points)
}

/// Numbered lines. Bytes that are not UTF-8 can only stand in comments and names: such lines read as empty.
fn lines(text: &[u8]) -> impl Iterator<Item = (usize, &str)> {
    let line = |(i, l): (usize, _)| (i + 1, std::str::from_utf8(l).unwrap_or("").trim_start());
    text.split(|b| *b == b'\n').enumerate().map(line)
}

fn position<'a>(
    path: &Path,
    number: usize,
    words: impl Iterator<Item = &'a str>,
) -> Result<Vec3, ImportError> {
    numbers::<3>(path, number, words).map(Vec3::from_array)
}

fn numbers<'a, const N: usize>(
    path: &Path,
    number: usize,
    mut words: impl Iterator<Item = &'a str>,
) -> Result<[f32; N], ImportError> {
    let mut out = [0.0; N];
    for value in &mut out {
        let word = words.next().unwrap_or("end of line");
        *value = match word.parse::<f32>() {
            Ok(v) if v.is_finite() => v,
            _ => {
                let found = format!("{word:?}");
                return Err(ImportError::content(path, format!("line {number}"), found, "a finite number"));
            }
        };
    }
    Ok(out)
}

/// Zero-based index of a one-based or negative (relative) one.
fn index(word: Option<&str>, count: usize) -> Option<u32> {
    let i: i64 = word?.parse().ok()?;
    let i = if i < 0 { count as i64 + i } else { i - 1 };
    (i >= 0 && i < count as i64).then_some(i as u32)
}
