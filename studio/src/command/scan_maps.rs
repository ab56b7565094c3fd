//! Maps of a scan that come beside its mesh: colour, normals, displacement, gloss.

use std::path::{Path, PathBuf};

use rubor::notes::Note;
use rubor::{Failure, Outcome};
use rubor_assets::convert::chromophores::{self, AlbedoEncoding};
use rubor_assets::convert::displacement;
use rubor_assets::convert::into_head::{Origin, put_albedo, put_chromophores, put_slopes, put_specular};
use rubor_assets::convert::normals::{self, GreenAxis};
use rubor_assets::convert::skin_texels::{SkinTexels, require_layout};
use rubor_assets::image_io::{LoadedImage, Purpose, ReadOptions, load_image_with};
use rubor_rig::head::{Head, Material, ProvenanceKind};
use rubor_rig::map::Map;
use rubor_rig::mask::{Mask, fill_unmapped};
use rubor_rig::skin::chromophores::{ChromophoreModel, SkinModel};

/// Texels of the look-up along each axis.
const LOOKUP_SIZE: u32 = 128;
/// Largest side of relief from a displacement map.
const RELIEF_SIZE: u32 = 4096;
/// Beckmann roughness of skin where no map says it: that of the renderer for skin without maps.
const SKIN_ROUGHNESS: f32 = 0.32;

#[derive(clap::Args)]
#[group(skip)]
pub(crate) struct ScanMaps {
    /// Colour of the skin as an image: an albedo texture or a cross-polarised photograph
    #[arg(long, value_name = "IMAGE")]
    albedo: Option<PathBuf>,
    /// Normal map of the skin, tangent space, green upwards
    #[arg(long, value_name = "IMAGE")]
    normal: Option<PathBuf>,
    /// Green of the normal map grows downwards
    #[arg(long, requires = "normal")]
    directx: bool,
    /// Heights of the skin (grey, white outside) as relief; beside a normal map only what is finer than its texels
    #[arg(long, value_name = "IMAGE", requires = "displacement_mm")]
    displacement: Option<PathBuf>,
    /// Millimetres from black to white of the displacement
    #[arg(long, value_name = "MM", requires = "displacement", allow_negative_numbers = true)]
    displacement_mm: Option<f32>,
    /// Strength of reflection of the skin (grey; white is that of bare skin)
    #[arg(long, value_name = "IMAGE")]
    specular: Option<PathBuf>,
    /// Factor of the values of --specular [default: 1]
    #[arg(long, value_name = "FACTOR", requires = "specular")]
    specular_gain: Option<f32>,
}

impl ScanMaps {
    /// True where no map is given.
    fn is_empty(&self) -> bool {
        [&self.albedo, &self.normal, &self.displacement, &self.specular].iter().all(|file| file.is_none())
    }

    /// Puts the colour into a head. The part that the maps lie on becomes skin where none is.
    pub(crate) fn put_color(&self, head: &mut Head, gain: Option<f32>, notes: &mut Vec<Note>) -> Outcome {
        if self.is_empty() {
            return Ok(());
        }
        make_skin(head, notes)?;
        match &self.albedo {
            Some(file) => self.put_albedo(head, gain, file, notes),
            None => Ok(()),
        }
    }

    /// Puts relief and gloss into a head, in place of those that were made for it.
    pub(crate) fn put_surface(&self, head: &mut Head, notes: &mut Vec<Note>) -> Outcome {
        self.put_relief(head, notes)?;
        match &self.specular {
            Some(file) => self.put_specular(head, file, notes),
            None => Ok(()),
        }
    }

    fn put_albedo(&self, head: &mut Head, gain: Option<f32>, file: &Path, notes: &mut Vec<Note>) -> Outcome {
        let image = load(file, Purpose::Values, notes)?;
        let albedo = chromophores::linear_albedo(&image, AlbedoEncoding::Automatic)?;
        let skin = SkinTexels::new(head, albedo.width, albedo.height).mask();
        let mask = image.mask();
        let not_black = |(m, c): (&bool, &[f32])| *m && c.iter().any(|v| *v > 0.0);
        let data = Mask {
            mapped: mask.mapped.iter().zip(albedo.values.chunks_exact(3)).map(not_black).collect(),
            ..mask
        };
        require_layout(&file.display().to_string(), &data, &skin)?;
        let lookup = SkinModel::new(&ChromophoreModel::default()).bake(LOOKUP_SIZE, LOOKUP_SIZE);
        let mask = mask.and(&skin);
        let options = chromophores::Options { gain, ..chromophores::Options::default() };
        let maps = chromophores::convert(&albedo, &mask, &lookup, &options)?;
        let found = &maps.summary;
        let beyond = found.out_of_gamut_texels as f64 / found.mapped_texels.max(1) as f64;
        notes.push(Note::new(
            file.display().to_string(),
            format!(
                "melanin {:.3} and hemoglobin {:.3} in the mean, gain {}; {:.1} % of the skin has colours that skin alone \
                 does not make (hair, make-up, light in the picture): they stay, with the blood of the skin around",
                found.mean_melanin,
                found.mean_hemoglobin,
                maps.exposure,
                100.0 * beyond
            ),
        ));
        let origin = origin("albedo", file);
        put_chromophores(head, maps.melanin, maps.hemoglobin, &origin)?;
        let mut albedo = albedo;
        fill_unmapped(&mut albedo, &mask);
        put_albedo(head, albedo, &origin)?;
        Ok(())
    }

    fn put_relief(&self, head: &mut Head, notes: &mut Vec<Note>) -> Outcome {
        let of_normals = match &self.normal {
            Some(file) => {
                let image = load(file, Purpose::Normals, notes)?;
                let green = if self.directx { GreenAxis::DirectX } else { GreenAxis::OpenGl };
                let (slopes, found) = normals::slopes_of(&image, green)?;
                notes.extend(found.iter().map(|m| Note::new(file.display().to_string(), m)));
                Some((slopes.map, file))
            }
            None => None,
        };
        let of_displacement = match (&self.displacement, self.displacement_mm) {
            (Some(file), Some(range_mm)) => {
                let heights = grey(&load(file, Purpose::Values, notes)?)?;
                Some((displacement::slopes(head, &heights, range_mm, RELIEF_SIZE)?, file))
            }
            _ => None,
        };
        let (slopes, source) = match (of_normals, of_displacement) {
            (Some((n, from)), Some((d, file))) => {
                if n.width >= d.width && n.height >= d.height {
                    let message = "adds nothing: the normal map has as many texels";
                    notes.push(Note::new(file.display().to_string(), message));
                }
                (displacement::combined(&n, &d)?, from)
            }
            (Some(found), None) | (None, Some(found)) => found,
            (None, None) => return Ok(()),
        };
        if self.displacement.is_some() {
            let message = "is relief for light and does not move the mesh: the outline stays";
            let file = self.displacement.as_deref().unwrap_or(source);
            notes.push(Note::new(file.display().to_string(), message));
        }
        Ok(put_slopes(head, slopes, &origin("relief", source))?)
    }

    fn put_specular(&self, head: &mut Head, file: &Path, notes: &mut Vec<Note>) -> Outcome {
        let gain = self.specular_gain.unwrap_or(1.0);
        if !(gain.is_finite() && gain > 0.0) {
            return Err(Failure::input(format!("--specular-gain: found {gain}, expected a positive number")));
        }
        let map = grey(&load(file, Purpose::Values, notes)?)?;
        let values = map.values.iter().flat_map(|v| [(gain * v).clamp(0.0, 1.0), SKIN_ROUGHNESS]).collect();
        let message = format!("holds strength alone: skin has the roughness {SKIN_ROUGHNESS} everywhere");
        notes.push(Note::new(file.display().to_string(), message));
        Ok(put_specular(head, Map { channels: 2, values, ..map }, &origin("specular", file))?)
    }
}

fn origin(what: &str, file: &Path) -> Origin {
    let name =
        file.file_name().map_or_else(|| file.display().to_string(), |n| n.to_string_lossy().into_owned());
    Origin {
        kind: ProvenanceKind::Measured,
        source: format!("rubor import, {what} of {name}"),
        licence: "NOASSERTION".into(),
    }
}

fn load(file: &Path, purpose: Purpose, notes: &mut Vec<Note>) -> Outcome<LoadedImage> {
    let image = load_image_with(file, &ReadOptions { purpose, ..ReadOptions::default() })?;
    notes.extend(image.notes.iter().map(|m| Note::new(file.display().to_string(), m)));
    Ok(image)
}

/// One channel, finite everywhere: texels without alpha take those around them.
fn grey(image: &LoadedImage) -> Outcome<Map> {
    let mask = image.mask();
    image.require_finite(&mask)?;
    let mut map = image.require_grey()?;
    fill_unmapped(&mut map, &mask);
    Ok(map)
}

/// The maps are of skin: a head of one part is skin; of several, one of them must be.
fn make_skin(head: &mut Head, notes: &mut Vec<Note>) -> Outcome {
    if head.mesh.parts.iter().any(|p| p.material == Material::Skin) {
        return Ok(());
    }
    let [part] = &mut head.mesh.parts[..] else {
        let names: Vec<&str> = head.mesh.parts.iter().map(|p| p.name.as_str()).collect();
        return Err(Failure::input(
            "--albedo, --normal, --displacement, --specular: found no part that is skin",
        )
        .hint(format!("--parts NAME=skin makes a part skin; there are\n  {}", names.join("\n  "))));
    };
    part.material = Material::Skin;
    notes.push(Note::new(part.name.clone(), "is the only part and becomes skin: the maps are its own"));
    Ok(())
}
