//! A scan whose skin keeps the colour of its map: the Lee Perry-Smith head of `RUBOR_SHARED`, drawn as skin and as the plain
//! map under an even white sky.

use std::path::{Path, PathBuf};

use glam::{Mat4, Vec3};
use rubor_assets::convert::chromophores::{self, AlbedoEncoding};
use rubor_assets::convert::into_head::{Origin, put_albedo, put_chromophores};
use rubor_assets::convert::skin_texels::SkinTexels;
use rubor_assets::image_io::load_image;
use rubor_renderer::channels::{CHANNELS, Channel};
use rubor_renderer::settings::{AntialiasMethod, Output, Quality, Settings};
use rubor_renderer::{Camera, ColorTable, EnvironmentMap, HeadInstance, HeadOnGpu, Renderer, Scene, native};
use rubor_rig::authored::{AuthoredImage, AuthoredMaterial, AuthoredTexture, TextureTransform, Wrap};
use rubor_rig::color::{ciede2000, lab_from_rec709};
use rubor_rig::face_state::FaceState;
use rubor_rig::head::{Head, Material, ProvenanceKind};
use rubor_rig::mask::fill_unmapped;
use rubor_rig::skin::chromophores::{ChromophoreModel, SkinModel};

const SIZE: u32 = 160;

fn folder() -> Option<PathBuf> {
    let shared = std::env::var("RUBOR_SHARED").ok().map(|s| Path::new(&s).join("heads/lee-perry-smith"));
    let found = shared.filter(|f| f.is_dir());
    if found.is_none() {
        eprintln!("SKIPPED: RUBOR_SHARED has no heads/lee-perry-smith, the scan was not drawn");
    }
    found
}

/// Its v grows upwards, and its unit is about 50 mm.
fn scan(folder: &Path) -> Head {
    let file = folder.join("LeePerrySmith.glb");
    let mut head = rubor_assets::import::gltf::read(&file).expect("the scan reads").head;
    head.mesh.vertices.iter_mut().for_each(|v| v.uv.y = 1.0 - v.uv.y);
    head.mesh.points.iter_mut().for_each(|p| *p *= 0.05);
    head
}

fn as_skin(mut head: Head, folder: &Path) -> Head {
    head.mesh.parts[0].material = Material::Skin;
    let image = load_image(&folder.join("Map-COL.jpg")).expect("the map reads");
    let mut albedo = chromophores::linear_albedo(&image, AlbedoEncoding::Automatic).expect("it is a colour");
    let mask = SkinTexels::new(&head, albedo.width, albedo.height).mask();
    let lookup = SkinModel::new(&ChromophoreModel::default()).bake(64, 64);
    let found = chromophores::convert(&albedo, &mask, &lookup, &chromophores::Options::default())
        .expect("the colours convert");
    let summary = found.summary;
    println!(
        "exposure: gain {}; {:.0} % of the skin is out of gamut; melanin {:.3}, hemoglobin {:.4}",
        found.exposure,
        100.0 * summary.out_of_gamut_texels as f64 / summary.mapped_texels as f64,
        summary.mean_melanin,
        summary.mean_hemoglobin
    );
    assert!(!summary.is_painted && found.exposure.gain < 1.0, "the map is brighter than skin");
    let origin =
        Origin { kind: ProvenanceKind::Measured, source: "scan".into(), licence: "CC-BY-3.0".into() };
    put_chromophores(&mut head, found.melanin, found.hemoglobin, &origin).expect("they fit");
    fill_unmapped(&mut albedo, &mask);
    put_albedo(&mut head, albedo, &origin).expect("it fits");
    head
}

fn as_map(mut head: Head, folder: &Path) -> Head {
    let picture = image::open(folder.join("Map-COL.jpg")).expect("the map reads").into_rgba8();
    let (width, height) = picture.dimensions();
    let image = AuthoredImage { name: "colour".into(), width, height, rgba: picture.into_raw() };
    let transform = TextureTransform::default();
    let texture = AuthoredTexture { image: 0, uv_set: 0, transform, wrap: [Wrap::Repeat; 2] };
    head.mesh.parts[0].material = Material::Other;
    head.authored.images = vec![image];
    head.authored.materials = vec![AuthoredMaterial {
        base_color_texture: Some(texture),
        is_unlit: true,
        is_double_sided: true,
        ..AuthoredMaterial::default()
    }];
    head.authored.of_parts = vec![Some(0)];
    head
}

/// A channel of the head from the front under an even sky of radiance 1.
fn draw(renderer: &mut Renderer, head: &Head, channel: Channel) -> Vec<[f32; 4]> {
    let lookup = SkinModel::new(&ChromophoreModel::default()).bake(64, 64);
    let table = ColorTable { width: 64, height: 64, texels: &lookup.texels };
    let gpu = renderer.gpu().clone();
    let on_gpu = HeadOnGpu::new(&gpu, head, &table).expect("it uploads");
    let state = FaceState::neutral(head);
    let sky = EnvironmentMap { width: 8, height: 4, texels: vec![Vec3::ONE; 32] }.upload(&gpu);
    let target = Vec3::new(0.0, 0.03, 0.1);
    let scene = Scene {
        heads: &[HeadInstance { head: &on_gpu, state: &state, world_from_head: Mat4::IDENTITY }],
        camera: Camera { position: target + Vec3::Z, target, up: Vec3::Y, fov_degrees: 12.0 },
        lights: &[],
        environment: Some(&sky),
        environment_rotation: 0.0,
        environment_intensity: 1.0,
        background_linear: Vec3::ZERO,
        optics: Default::default(),
    };
    let settings = Settings {
        output: Output {
            size: [SIZE; 2],
            channels: CHANNELS.iter().map(|row| row.channel).collect(),
            ..Output::default()
        },
        quality: Quality { antialias: AntialiasMethod::None, ..Quality::default() },
        ..Settings::default()
    };
    native::wait(&gpu, renderer.render(&scene, &settings)).expect("it draws");
    native::wait(&gpu, renderer.read(channel)).expect("the channel comes back").texels().collect()
}

/// Places of the picture, as shares of its sides.
const PLACES: [(&str, [f32; 2]); 6] = [
    ("forehead", [0.50, 0.22]),
    ("cheek, right", [0.36, 0.58]),
    ("cheek, left", [0.64, 0.58]),
    ("lip", [0.50, 0.755]),
    ("chin", [0.50, 0.88]),
    ("brow", [0.38, 0.385]),
];

#[test]
fn a_scan_keeps_the_colour_of_its_map() {
    let Some(folder) = folder() else { return };
    let gpu = native::open(None).expect("RUBOR_SHARED asks for this test, which needs a device");
    let mut renderer = Renderer::new(gpu).expect("the passes compile");
    let map = draw(&mut renderer, &as_map(scan(&folder), &folder), Channel::Radiance);
    let skin = as_skin(scan(&folder), &folder);
    let albedo = draw(&mut renderer, &skin, Channel::Albedo);
    let radiance = draw(&mut renderer, &skin, Channel::Radiance);
    let difference = |a: [f32; 4], b: [f32; 4]| {
        let lab = |t: [f32; 4]| lab_from_rec709([t[0], t[1], t[2]].map(f64::from));
        ciede2000(lab(a), lab(b))
    };
    for (name, [x, y]) in PLACES {
        // The mean over 5 x 5 pixels.
        let mean = |picture: &[[f32; 4]]| {
            let at = |share: f32| (share * SIZE as f32) as usize;
            let pixels = (0..25).map(|k| picture[(at(y) + k / 5 - 2) * SIZE as usize + at(x) + k % 5 - 2]);
            pixels.fold([0.0; 4], |sum: [f32; 4], t| std::array::from_fn(|c| sum[c] + t[c] / 25.0))
        };
        let (in_albedo, in_light) =
            (difference(mean(&albedo), mean(&map)), difference(mean(&radiance), mean(&map)));
        println!(
            "{name}: CIEDE2000 {in_albedo:.2} of the colour, {in_light:.2} under an even sky with reflections"
        );
        assert!(mean(&map)[0] > 0.02, "{name} is not on the head");
        assert!(in_albedo < 2.0, "{name}: {in_albedo}");
    }
}
