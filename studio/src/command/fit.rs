//! What of a file becomes the head and how large it is: flags of every import.

use std::path::Path;

use clap::ValueEnum;
use rubor_assets::convert::crop::{self, Dropped, HeadBy};
use rubor_assets::convert::size;
use rubor_assets::import::gltf::Extent;
use rubor_assets::import::obj_set;
use rubor_rig::head::Head;

use super::console;
use rubor::notes::Note;
use rubor::{Failure, Outcome};

#[derive(clap::Args)]
#[group(skip)]
pub(crate) struct Fit {
    /// Unit of length of the file [default: what its format says, cm for folders of OBJ files; another one where no head is
    /// of that size, with a note]
    #[arg(long, value_enum, conflicts_with_all = ["scale", "height"])]
    units: Option<Units>,
    /// Factor of all lengths, which are in metres after it
    #[arg(long, value_name = "FACTOR", value_parser = positive, conflicts_with = "height")]
    scale: Option<f32>,
    /// Height of what is imported, metres
    #[arg(long, value_name = "METRES", value_parser = positive)]
    height: Option<f32>,
    /// Turn texture coordinates upside down
    #[arg(long)]
    flip_v: bool,
    /// Keep the head of a whole figure: what follows the joints of head and neck, else what is around the face
    #[arg(long)]
    crop_head: bool,
}

#[derive(Clone, Copy, ValueEnum)]
pub(crate) enum Units {
    Mm,
    Cm,
    Dm,
    M,
    In,
}

impl From<Units> for obj_set::Units {
    fn from(units: Units) -> Self {
        match units {
            Units::Mm => Self::Millimetres,
            Units::Cm => Self::Centimetres,
            Units::Dm => Self::Decimetres,
            Units::M => Self::Metres,
            Units::In => Self::Inches,
        }
    }
}

fn positive(text: &str) -> Result<f32, String> {
    let number = text.parse::<f32>().ok().filter(|n| *n > 0.0 && n.is_finite());
    number.ok_or_else(|| format!("found {text:?}, expected a number above 0"))
}

/// What a reader took the lengths of a file for.
#[derive(Clone, Copy)]
pub(crate) struct Read {
    /// Metres of a unit of the file.
    pub(crate) metres: f32,
    /// The unit in words.
    pub(crate) unit: &'static str,
}

impl Read {
    pub(crate) const METRES: Self = Self { metres: 1.0, unit: "metres" };
    pub(crate) const CENTIMETRES: Self = Self { metres: 0.01, unit: "centimetres" };
}

impl Fit {
    /// Keeps the meshes whose path contains a text.
    pub(crate) fn choose(head: &mut Head, extent: &mut Extent, mesh: &str, path: &Path) -> Outcome {
        let name = |part: usize| {
            let known = extent.meshes.get(part).map_or("", String::as_str);
            if known.is_empty() { head.mesh.parts[part].name.as_str() } else { known }
        };
        let is_kept: Vec<bool> = (0..head.mesh.parts.len()).map(|p| name(p).contains(mesh)).collect();
        if !is_kept.contains(&true) {
            let mut names: Vec<&str> = (0..head.mesh.parts.len()).map(name).collect();
            names.dedup();
            return Err(Failure::input(format!("--mesh: no mesh has {mesh:?} in its name"))
                .hint(format!("expected a part of one of\n  {}", names.join("\n  "))));
        }
        let keeps: Vec<bool> = (head.mesh.parts.iter().zip(&is_kept))
            .flat_map(|(part, kept)| std::iter::repeat_n(*kept, part.triangles.len()))
            .collect();
        let vertices = kept_vertices(head, |t| keeps[t]);
        let dropped = crop::retain(head, |t| keeps[t]);
        extent.head_share =
            vertices.iter().filter_map(|v| extent.head_share.get(*v as usize).copied()).collect();
        let mut kept = is_kept.iter();
        extent.meshes.retain(|_| *kept.next().unwrap_or(&false));
        say_dropped(path, &format!("--mesh {mesh}"), &dropped);
        Ok(())
    }

    /// Crops, scales and turns as the user says; says what it guesses. True where the size is a guess by the height alone.
    pub(crate) fn apply(&self, head: &mut Head, extent: &Extent, read: Read, path: &Path) -> Outcome<bool> {
        let note = |text: String| console::notes(&[Note::new(path.display().to_string(), text)]);
        let mut head_share = &extent.head_share[..];
        let mut is_guess = false;
        if self.crop_head {
            let Some((by, dropped)) = crop::to_head(head, &extent.head_share) else {
                let found = "--crop-head: found no joints named head or neck and no shapes of a face";
                return Err(Failure::input(found).hint("cut the head out in the program that made the file"));
            };
            let how = match by {
                HeadBy::Joints => "what follows the joints of head and neck is kept",
                HeadBy::Shapes => "no joints of a head: a box around what shapes of the face move is kept",
            };
            say_dropped(path, &format!("--crop-head: {how}"), &dropped);
            head_share = &[];
        }
        if let Some(height) = self.height {
            let found = head.height();
            if found <= 0.0 {
                return Err(Failure::input("--height: the mesh has none"));
            }
            size::scale(head, height / found);
        } else if let Some(scale) = self.scale {
            size::scale(head, scale / read.metres);
        } else if let Some(units) = self.units {
            size::scale(head, obj_set::Units::from(units).metres() / read.metres);
        } else {
            let height = head.height() / read.metres;
            // In units of the file: the guess is of a number without a unit.
            if size::guess(head, head_share).is_some() {
                is_guess = true;
                size::scale(head, 1.0 / read.metres);
                let guess = size::guess(head, head_share);
                let factor = guess.as_ref().map_or(1.0, |g| g.factor);
                size::scale(head, factor);
                let what = if guess.as_ref().is_some_and(|g| g.is_figure) { "whole figure" } else { "head" };
                let how = match guess.as_ref().and_then(|g| g.unit) {
                    Some(unit) => format!("taken for {unit}"),
                    None if guess.is_none() => "taken for metres".into(),
                    None => "no unit fits, so it gets a usual size".into(),
                };
                note(format!(
                    "the {what} is {height:.3} units high, which as {} is unlikely: {how}, {:.3} m (--units, --scale or --height say otherwise)",
                    read.unit,
                    head.height()
                ));
            }
        }
        if size::is_figure(head, head_share) && !self.crop_head {
            note("this is a whole figure: maps are shared with the body (--crop-head keeps its head)".into());
        }
        if self.flip_v {
            size::flip_v(head);
        }
        Ok(is_guess)
    }
}

/// Vertices of kept triangles, in the order in which cropping numbers them.
fn kept_vertices(head: &Head, keep: impl Fn(usize) -> bool) -> Vec<u32> {
    let mut is_seen = vec![false; head.mesh.vertices.len()];
    let mut vertices = Vec::new();
    for (_, triangle) in head.mesh.triangles.iter().enumerate().filter(|(t, _)| keep(*t)) {
        for v in triangle {
            if !std::mem::replace(&mut is_seen[*v as usize], true) {
                vertices.push(*v);
            }
        }
    }
    vertices
}

fn say_dropped(path: &Path, why: &str, dropped: &Dropped) {
    let mut text = format!("{why}; {} triangles are left out", dropped.triangles);
    for (what, names) in [("parts", &dropped.parts), ("shapes", &dropped.shapes)] {
        if !names.is_empty() {
            text += &format!(", {what}: {}", rubor_assets::check::list(names));
        }
    }
    console::notes(&[Note::new(path.display().to_string(), text)]);
}

#[cfg(test)]
mod tests {
    use glam::{Vec2, Vec3};
    use rubor_rig::head::{Material, Part, Vertex};

    use super::*;

    fn two_meshes() -> (Head, Extent) {
        let mut head = Head::default();
        for p in 0..2_u32 {
            let first = head.mesh.vertices.len() as u32;
            for k in 0..3 {
                let corner = [Vec3::ZERO, Vec3::X, Vec3::Y][k as usize] * (1.0 + p as f32);
                head.mesh.points.push(corner);
                head.mesh.vertices.push(Vertex { point: first + k, uv: Vec2::ZERO });
            }
            head.mesh.triangles.push([first, first + 1, first + 2]);
            let part = Part { name: "skin".into(), material: Material::Skin, triangles: p..p + 1 };
            head.mesh.parts.push(part);
        }
        let meshes = vec!["Body|body_mesh".to_owned(), "Head|head_mesh".to_owned()];
        (head, Extent { meshes, head_share: vec![0.0, 0.0, 0.0, 1.0, 1.0, 0.9] })
    }

    #[test]
    fn a_mesh_is_chosen_by_a_part_of_its_path() {
        let (mut head, mut extent) = two_meshes();
        Fit::choose(&mut head, &mut extent, "head_", Path::new("a.glb")).unwrap();
        head.validate().unwrap();
        assert_eq!(head.mesh.points[1], Vec3::X * 2.0);
        assert_eq!(
            (extent.meshes, extent.head_share),
            (vec!["Head|head_mesh".to_owned()], vec![1.0, 1.0, 0.9])
        );
        let (mut head, mut extent) = two_meshes();
        let wrong = Fit::choose(&mut head, &mut extent, "nose", Path::new("a.glb")).unwrap_err();
        assert!(wrong.to_string().contains("\"nose\""), "{wrong}");
    }

    #[test]
    fn sizes_are_as_said_or_as_guessed() {
        let fit = Fit { units: None, scale: None, height: None, flip_v: false, crop_head: false };
        let height = |fit: &Fit, height: f32, read: Read| {
            let mut head = Head::default();
            head.mesh.points = vec![Vec3::ZERO, Vec3::Y * height * read.metres];
            fit.apply(&mut head, &Extent::default(), read, Path::new("a")).unwrap();
            head.height()
        };
        let near = |a: f32, b: f32| (a - b).abs() < 1e-4;
        assert!(near(height(&fit, 2.3, Read::METRES), 0.23));
        assert!(near(height(&fit, 8.0, Read::METRES), 0.2032));
        assert!(near(height(&fit, 0.3, Read::METRES), 0.3));
        // A folder of OBJ files in metres, read as centimetres.
        assert!(near(height(&fit, 0.3, Read::CENTIMETRES), 0.3));
        assert!(near(height(&Fit { scale: Some(1.0), ..fit }, 2.3, Read::METRES), 2.3));
        let fit = Fit { units: Some(Units::In), scale: None, height: None, flip_v: false, crop_head: false };
        assert!(near(height(&fit, 10.0, Read::CENTIMETRES), 0.254));
        let fit = Fit { units: None, scale: None, height: Some(0.25), flip_v: false, crop_head: false };
        assert!(near(height(&fit, 8.0, Read::METRES), 0.25));
    }
}
