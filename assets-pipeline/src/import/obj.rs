//! Wavefront OBJ polygons, read by `tobj` with its separate indices of positions and texture coordinates.
//!
//! ```text
//! bytes --logical lines--> v, vt, f as tobj reads them --tobj--> positions, texture coordinates, indices --> PolyMesh
//!                     \--> names of groups and materials, lines of statements ---------------------------/
//! ```
//!
//! What `tobj` 4.0 does worse is done here, before and after it:
//! - it numbers points anew in each group, in order of use, and drops unused ones; sets of shapes are matched by the order
//!   of `v` lines. A first face that names every position and texture coordinate once keeps their order;
//! - it needs UTF-8, `\n` and one line a statement: a byte order mark, CR, names in Latin-1, continued lines and comments
//!   after a statement are dealt with before;
//! - it cuts groups at `g` and `o`, names materials only from an `.mtl` file, and takes a polyline for a face: names are
//!   kept here by face, lines left out;
//! - a corner without `vt` gets the texture coordinate of the corner before: here it gets 0, 0;
//! - it divides by the fourth number of `v` (which concerns rational curves alone) and refuses files in which some points
//!   have colours: three numbers go to it;
//! - large indices overflow in it, and its errors have no place: indices are checked before, and a line is sought after.

use std::borrow::Cow;
use std::collections::{HashMap, HashSet};
use std::fmt::Write as _;
use std::path::Path;

use glam::{Vec2, Vec3};
use rubor_rig::limits::{self, Limits};

use crate::error::ImportError;
use crate::notes::{Note, Notes};
use crate::poly::{Corner, MOST_CORNERS, PolyMesh};

/// Which statement names the groups of the mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GroupBy {
    /// `g` and `o`, whichever stands last before a face.
    Group,
    /// `usemtl`; `g` and `o` for faces without a material, or with the default one of a program.
    Material,
}

/// A file in memory.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ObjFile {
    /// All points in the order of the file, used or not.
    pub mesh: PolyMesh,
    /// Files of materials that it names.
    pub libraries: Vec<String>,
    /// Notes on everything that was left out, guessed or repaired.
    pub notes: Vec<Note>,
}

/// Reads polygons. Positions are in the file's units; v is turned to grow downwards.
///
/// # Errors
/// As [`read`].
pub fn read_polygons(path: &Path, group_by: GroupBy) -> Result<PolyMesh, ImportError> {
    read(path, group_by).map(|file| file.mesh)
}

/// Reads polygons with what there is to say about the file.
///
/// # Errors
/// Unreadable file, a line that cannot be parsed, numbers that are not finite, indices out of range, no faces.
pub fn read(path: &Path, group_by: GroupBy) -> Result<ObjFile, ImportError> {
    let file = read_points(path, group_by)?;
    if file.mesh.face_count() == 0 {
        let found = format!("{} positions and no faces", file.mesh.points.len());
        return Err(ImportError::content(path, "end of file", found, "a mesh"));
    }
    Ok(file)
}

/// As [`read`], of a file that may have points alone.
pub(crate) fn read_points(path: &Path, group_by: GroupBy) -> Result<ObjFile, ImportError> {
    let text = limits::read(path).map_err(ImportError::read(path))?;
    from_bytes(&text, path, group_by)
}

/// Reads from memory; `path` is for messages. A file without faces is points alone.
///
/// # Errors
/// As [`read`], except errors of the file itself.
pub fn from_bytes(text: &[u8], path: &Path, group_by: GroupBy) -> Result<ObjFile, ImportError> {
    limits::check_text(text)
        .map_err(|(found, expected)| ImportError::content(path, "file", found, expected))?;
    if text.starts_with(&[0xff, 0xfe]) || text.starts_with(&[0xfe, 0xff]) {
        return Err(ImportError::content(path, "byte order mark", "UTF-16", "UTF-8 or Latin-1: save it so"));
    }
    let mut reader = Reader::new(path);
    let text = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text);
    for (number, line) in logical_lines(text) {
        reader.statement(number, &line)?;
    }
    reader.finish(group_by)
}

/// Statements whose continued lines hold numbers.
fn has_numbers(keyword: &[u8]) -> bool {
    matches!(keyword, b"v" | b"vt" | b"vn" | b"vp" | b"f" | b"fo" | b"l" | b"p")
}

/// Statements that may follow a name which ends with `\`: that one is a path and no continued line.
fn is_keyword(word: &[u8]) -> bool {
    has_numbers(word) || matches!(word, b"g" | b"o" | b"s" | b"usemtl" | b"mtllib") || word.starts_with(b"#")
}

fn keyword(line: &[u8]) -> &[u8] {
    let line = line.trim_ascii_start();
    &line[..line.iter().position(u8::is_ascii_whitespace).unwrap_or(line.len())]
}

/// Physical lines: they end in LF, CR LF or CR.
fn physical_lines(text: &[u8]) -> impl Iterator<Item = &[u8]> {
    let mut rest = text;
    std::iter::from_fn(move || {
        if rest.is_empty() {
            return None;
        }
        let end = rest.iter().position(|b| matches!(b, b'\n' | b'\r')).unwrap_or(rest.len());
        let line = &rest[..end];
        let two = rest.get(end..end + 2) == Some(b"\r\n");
        rest = rest.get(end + if two { 2 } else { 1 }..).unwrap_or(&[]);
        Some(line)
    })
}

/// Numbered lines without comments and empty lines; a line goes on after `\` at its end.
fn logical_lines(text: &[u8]) -> impl Iterator<Item = (usize, Cow<'_, [u8]>)> {
    let mut physical = physical_lines(text).enumerate().peekable();
    std::iter::from_fn(move || {
        loop {
            let (i, first) = physical.next()?;
            let mut line = Cow::Borrowed(without_comment(first));
            while let (Some(begun), Some((_, next))) =
                (line.trim_ascii_end().strip_suffix(b"\\"), physical.peek())
            {
                if !has_numbers(keyword(&line)) && is_keyword(keyword(next)) {
                    break;
                }
                let kept = begun.trim_ascii_end().len();
                let next = without_comment(next).trim_ascii_start();
                // In place: many continued lines take no time that grows with their square.
                let joined = line.to_mut();
                joined.truncate(kept);
                joined.push(b' ');
                joined.extend_from_slice(next);
                physical.next();
            }
            let last = physical.peek().is_none() && has_numbers(keyword(&line));
            if let Some(begun) = line.trim_ascii_end().strip_suffix(b"\\").filter(|_| last) {
                line = Cow::Owned(begun.to_vec());
            }
            if !line.trim_ascii().is_empty() {
                return Some((i + 1, line));
            }
        }
    })
}

/// A `#` at the start or after a space begins a comment; inside a word it is part of a name.
fn without_comment(line: &[u8]) -> &[u8] {
    let starts = |i: usize| line[i] == b'#' && (i == 0 || line[i - 1].is_ascii_whitespace());
    let numbers = has_numbers(keyword(line));
    let end = (0..line.len()).find(|i| starts(*i) || numbers && line[*i] == b'#');
    &line[..end.unwrap_or(line.len())]
}

/// Names that programs give to the material of whatever has none: they say nothing about a part.
fn is_default_material(name: &str) -> bool {
    let name = name.to_ascii_lowercase();
    let bare = name.trim_end_matches(|c: char| c.is_ascii_digit() || matches!(c, '.' | '_'));
    matches!(
        name.as_str(),
        "default"
            | "none"
            | "(null)"
            | "null"
            | "initialshadinggroup"
            | "lambert1"
            | "lambert1sg"
            | "defaultmat"
    ) || matches!(bare, "material" | "defaultmaterial" | "default_material")
}

/// A `v`, `vt` or `f` line that was given to `tobj`.
struct Given {
    line: usize,
    /// Its end in the text for `tobj`; it starts where the one before ends.
    end: usize,
}

struct Reader<'a> {
    path: &'a Path,
    notes: Notes,
    /// For `tobj`: `v` and `vt` first, then `f`.
    vertices: String,
    faces: String,
    given_vertices: Vec<Given>,
    given_faces: Vec<Given>,
    point_count: usize,
    uv_count: usize,
    /// Of each corner: no `vt`.
    without_uv: Vec<bool>,
    faces_without_uv: usize,
    libraries: Vec<String>,
    known_libraries: HashSet<String>,
    names: HashMap<String, u32>,
    groups: Vec<String>,
    group: Option<u32>,
    material: Option<u32>,
    /// Of each face.
    group_of: Vec<Option<u32>>,
    material_of: Vec<Option<u32>>,
}

impl<'a> Reader<'a> {
    fn new(path: &'a Path) -> Self {
        Self {
            path,
            notes: Notes::default(),
            vertices: String::new(),
            faces: String::new(),
            given_vertices: Vec::new(),
            given_faces: Vec::new(),
            point_count: 0,
            uv_count: 0,
            without_uv: Vec::new(),
            faces_without_uv: 0,
            libraries: Vec::new(),
            known_libraries: HashSet::new(),
            names: HashMap::new(),
            groups: Vec::new(),
            group: None,
            material: None,
            group_of: Vec::new(),
            material_of: Vec::new(),
        }
    }

    fn fail<T>(&self, line: usize, found: String, expected: impl Into<String>) -> Result<T, ImportError> {
        Err(ImportError::content(self.path, format!("line {line}"), found, expected))
    }

    fn within(&self, line: usize, what: &str, count: usize, most: u64) -> Result<(), ImportError> {
        limits::within(what, count as u64, most).or_else(|(found, expected)| self.fail(line, found, expected))
    }

    fn statement(&mut self, line: usize, bytes: &[u8]) -> Result<(), ImportError> {
        let bytes = bytes.trim_ascii();
        let keyword = keyword(bytes);
        let rest = bytes[keyword.len()..].trim_ascii();
        match keyword {
            b"v" => {
                let count = self.numbers(line, "v", rest, 3)?;
                self.point_count += 1;
                self.within(line, "points", self.point_count, Limits::of_process().vertices())?;
                match count {
                    3 => {}
                    4 => {
                        self.notes.say("the fourth number of points (weight of rational curves) is not used")
                    }
                    _ => self.notes.say("colours of points are not read"),
                }
            }
            b"vt" => {
                self.numbers(line, "vt", rest, 2)?;
                self.uv_count += 1;
                self.within(line, "texture coordinates", self.uv_count, 2 * Limits::of_process().vertices())?;
            }
            b"f" | b"fo" => self.face(line, rest)?,
            b"g" | b"o" => self.group = Some(self.name(rest)),
            b"usemtl" => self.material = Some(self.name(rest)),
            b"l" | b"p" => {
                self.notes.add("lines and points are no surface and are left out", format!("line {line}"))
            }
            b"mtllib" => {
                let name = String::from_utf8_lossy(rest).into_owned();
                if !name.is_empty() && self.known_libraries.insert(name.clone()) {
                    self.libraries.push(name);
                }
            }
            // Normals follow from the surface; smoothing groups are not used.
            b"vn" | b"s" => {}
            other => {
                let word = String::from_utf8_lossy(other).into_owned();
                self.notes.add("statements that are not read", format!("{word:?} in line {line}"));
            }
        }
        Ok(())
    }

    /// Gives the first numbers of a statement to `tobj`; returns how many there are.
    fn numbers(
        &mut self,
        line: usize,
        keyword: &str,
        rest: &[u8],
        needed: usize,
    ) -> Result<usize, ImportError> {
        let rest = String::from_utf8_lossy(rest);
        let words: Vec<&str> = rest.split_ascii_whitespace().collect();
        // A texture may be a line of texels: v is 0 then, as the format has it.
        let count = if keyword == "vt" && words.len() == 1 { 1 } else { needed };
        if words.len() < count {
            return self.fail(line, "\"end of line\"".into(), "a finite number");
        }
        self.vertices.push_str(keyword);
        for word in &words[..count] {
            self.vertices.push(' ');
            self.vertices.push_str(word);
        }
        self.vertices.push_str(if count < needed { " 0\n" } else { "\n" });
        self.given_vertices.push(Given { line, end: self.vertices.len() });
        Ok(words.len())
    }

    fn face(&mut self, line: usize, rest: &[u8]) -> Result<(), ImportError> {
        let rest = String::from_utf8_lossy(rest);
        let words = rest.split_ascii_whitespace();
        let corners = words.clone().count();
        if corners < 3 {
            self.notes.add("faces of fewer than 3 corners are left out", format!("line {line}"));
            return Ok(());
        }
        // Faces of four corners around each point, and as many again.
        let all = self.without_uv.len() + corners;
        self.within(line, "corners of faces", all, 8 * Limits::of_process().vertices())?;
        if corners > MOST_CORNERS {
            let message =
                format!("faces of more than {MOST_CORNERS} corners are right only where they are convex");
            self.notes.add(message, format!("line {line}"));
        }
        self.faces.push('f');
        let first = self.without_uv.len();
        for word in words {
            let mut indices = word.split('/');
            let counts = [("a position", self.point_count), ("a texture coordinate", self.uv_count)];
            let mut texts = [0_i64; 2];
            for (text, (what, count)) in texts.iter_mut().zip(counts) {
                let index = match indices.next() {
                    Some(index) if !(index.is_empty() && what != "a position") => index,
                    _ => continue,
                };
                // Those before the statement count backwards; those from the start may come later in the file.
                *text = match index.parse::<i64>() {
                    Ok(i) if i < 0 && i.unsigned_abs() <= count as u64 => count as i64 + i + 1,
                    Ok(i) if i > 0 && i <= i64::from(u32::MAX) => i,
                    _ => {
                        return self.fail(
                            line,
                            format!("corner {word:?}"),
                            format!("{what} from 1 to {count}"),
                        );
                    }
                };
            }
            if indices.nth(1).is_some() {
                return self.fail(line, format!("corner {word:?}"), "position/texture coordinate/normal");
            }
            let [point, uv] = texts;
            self.without_uv.push(uv == 0);
            let written =
                if uv == 0 { write!(self.faces, " {point}") } else { write!(self.faces, " {point}/{uv}") };
            written.expect("a string takes all that fits the memory");
        }
        self.faces.push('\n');
        self.given_faces.push(Given { line, end: self.faces.len() });
        self.faces_without_uv += usize::from(self.without_uv[first..].contains(&true));
        self.group_of.push(self.group);
        self.material_of.push(self.material);
        Ok(())
    }

    /// Number of a name; spaces belong to it.
    fn name(&mut self, bytes: &[u8]) -> u32 {
        let name = match std::str::from_utf8(bytes) {
            Ok(name) => name.to_owned(),
            Err(_) => {
                let latin: String = bytes.iter().map(|b| char::from(*b)).collect();
                self.notes.add("names that are not UTF-8 are read as Latin-1", format!("{latin:?}"));
                latin
            }
        };
        let name = if name.is_empty() { "default".to_owned() } else { name };
        let next = self.groups.len() as u32;
        *self.names.entry(name).or_insert_with_key(|name| {
            self.groups.push(name.clone());
            next
        })
    }

    fn finish(mut self, group_by: GroupBy) -> Result<ObjFile, ImportError> {
        if self.point_count == 0 {
            return Ok(ObjFile { notes: self.notes.into_vec(), ..ObjFile::default() });
        }
        let read = self.read_by_tobj()?;
        let vec3 = |p: &[f32]| Vec3::new(p[0], p[1], p[2]);
        let mut mesh = PolyMesh {
            points: read.positions.chunks_exact(3).map(vec3).collect(),
            uvs: read.texcoords.chunks_exact(2).map(|t| Vec2::new(t[0], 1.0 - t[1])).collect(),
            ..PolyMesh::default()
        };
        let all = self.all_count();
        let arity = |f: usize| read.face_arities.get(f).map_or(3, |n| *n as usize);
        let complete = mesh.points.len() == self.point_count
            && mesh.uvs.len() == self.uv_count
            && read.indices.len() == all + self.without_uv.len()
            && mesh.points.iter().all(|p| p.is_finite())
            && mesh.uvs.iter().all(|t| t.is_finite());
        if !complete {
            return Err(self.fault("numbers that are not finite"));
        }
        let by_material = group_by == GroupBy::Material && self.material_of.iter().any(Option::is_some);
        if group_by == GroupBy::Material && !by_material && self.group_of.iter().any(Option::is_some) {
            self.notes.say("no face has a material: parts are the groups of the file");
        }
        // Texture coordinate of corners that have none.
        let missing = mesh.uvs.len() as u32;
        if self.without_uv.contains(&true) {
            mesh.uvs.push(Vec2::ZERO);
            let message = "faces without texture coordinates have them all at 0";
            self.notes.add(message, format!("{} of {}", self.faces_without_uv, self.given_faces.len()));
        }
        let mut default = None;
        let mut by_group = 0;
        let mut used: HashMap<u32, u32> = HashMap::new();
        let mut corner = 0;
        for f in 0..self.given_faces.len() {
            for _ in 0..arity(f + 1) {
                let uv = match self.without_uv[corner] {
                    true => missing,
                    false => *read.texcoord_indices.get(all + corner).ok_or_else(|| {
                        self.fault("corners with texture coordinates, of which the file has none")
                    })?,
                };
                mesh.corners.push(Corner { point: read.indices[all + corner], uv });
                corner += 1;
            }
            mesh.face_starts.push(mesh.corners.len() as u32);
            let (material, group) = (self.material_of[f], self.group_of[f]);
            let said = material.filter(|m| !is_default_material(&self.groups[*m as usize]));
            let name = match (by_material, group) {
                (true, Some(group)) if said.is_none() => {
                    by_group += 1;
                    Some(group)
                }
                (true, _) => material,
                (false, _) => group,
            };
            let name = name.unwrap_or_else(|| *default.get_or_insert_with(|| self.name(b"default")));
            let groups = &mut mesh.groups;
            let group = *used.entry(name).or_insert_with(|| {
                groups.push(self.groups[name as usize].clone());
                groups.len() as u32 - 1
            });
            mesh.face_groups.push(group);
        }
        if by_group > 0 {
            let place = format!("{by_group} of {}", self.given_faces.len());
            self.notes.add(
                "faces without a material, or with a program's default, are parts by their groups",
                place,
            );
        }
        Ok(ObjFile { mesh, libraries: self.libraries, notes: self.notes.into_vec() })
    }

    /// Corners of the first face.
    fn all_count(&self) -> usize {
        self.point_count.max(self.uv_count)
    }

    fn read_by_tobj(&self) -> Result<tobj::Mesh, ImportError> {
        // Names every position and texture coordinate in order.
        let mut all = String::from("f");
        for i in 1..=self.all_count() {
            let point = i.min(self.point_count);
            match self.uv_count {
                0 => all.push_str(&format!(" {point}")),
                count => all.push_str(&format!(" {point}/{}", i.min(count))),
            }
        }
        all.push('\n');
        let mut text = std::io::Read::chain(all.as_bytes(), self.vertices.as_bytes());
        let text: &mut dyn std::io::BufRead = &mut text;
        let mut text = std::io::Read::chain(text, self.faces.as_bytes());
        let no_materials = |_: &Path| Err(tobj::LoadError::OpenFileFailed);
        match tobj::load_obj_buf(&mut text, &tobj::LoadOptions::default(), no_materials) {
            Ok((models, _)) if models.len() == 1 => {
                models.into_iter().next().map(|m| m.mesh).ok_or_else(|| self.fault("no mesh"))
            }
            Ok((models, _)) => Err(self.fault(&format!("{} meshes", models.len()))),
            Err(e) => Err(self.fault(&e.to_string())),
        }
    }

    /// The line that `tobj` could not read.
    fn fault(&self, reason: &str) -> ImportError {
        let fail = |line: usize, found: String, expected: String| {
            ImportError::content(self.path, format!("line {line}"), found, expected)
        };
        let mut start = 0;
        for given in &self.given_vertices {
            let words = self.vertices[start..given.end].split_ascii_whitespace().skip(1);
            start = given.end;
            for word in words {
                if !word.parse::<f32>().is_ok_and(f32::is_finite) {
                    return fail(given.line, format!("{word:?}"), "a finite number".into());
                }
            }
        }
        start = 0;
        for given in &self.given_faces {
            let words = self.faces[start..given.end].split_ascii_whitespace().skip(1);
            start = given.end;
            for word in words {
                let counts = [("a position", self.point_count), ("a texture coordinate", self.uv_count)];
                for (index, (what, count)) in word.split('/').zip(counts) {
                    if !index.parse::<usize>().is_ok_and(|i| (1..=count).contains(&i)) {
                        return fail(
                            given.line,
                            format!("corner {word:?}"),
                            format!("{what} from 1 to {count}"),
                        );
                    }
                }
            }
        }
        ImportError::content(self.path, "file", reason, "a mesh that tobj reads")
    }
}
