//! Light that spreads in materials that `diffusion` does not scatter.

use glam::{DVec3, Mat4, Vec2, Vec3};
use rubor_rig::color::{srgb_decode, srgb_encode};
use rubor_rig::face_state::FaceState;
use rubor_rig::head::{
    BASE_COLOR_F0, Distribution, Head, Material, Mesh, Part, Provenance, ProvenanceKind, SKIN_F0, SkinMaps,
    Vertex,
};
use rubor_rig::map::Map;
use rubor_rig::random::SplitMix64;
use rubor_rig::skin::chromophores::{ChromophoreModel, MAX_HEMOGLOBIN, MAX_MELANIN, SkinModel};

use super::reference;
use crate::channels::Channel;
use crate::settings::{ScatterMethod, SpecularMethod, TransmitMethod};
use crate::tests::{
    WHITE_TABLE, dome, read, read_texels, read_vectors, render, renderer, seen_surface, settings,
};
use crate::{Camera, ColorTable, EnvironmentMap, HeadInstance, HeadOnGpu, Light, LightKind, Renderer, Scene};

const SIZE: u32 = 128;
/// Across the picture.
const SEEN_MM: f32 = 12.0;

/// A flap of skin beside the picture, 5 mm in front of what it shows: two of its corners, millimetres.
const FLAP: [Vec3; 2] = [Vec3::new(8.0, -30.0, 5.0), Vec3::new(30.0, 30.0, 5.0)];

/// A square of a material that faces +Z and flaps of skin in front of it.
fn head(material: Material, flaps: &[[Vec3; 2]]) -> Head {
    let mut mesh = Mesh::default();
    let mut quad = |low: Vec3, high: Vec3, material: Material| {
        let first = mesh.vertices.len() as u32;
        for (x, y) in [(low.x, low.y), (high.x, low.y), (high.x, high.y), (low.x, high.y)] {
            let point = mesh.points.len() as u32;
            mesh.points.push(0.001 * Vec3::new(x, y, low.z));
            // Millimetres along the arch and from the biting edge, as of teeth.
            mesh.vertices.push(Vertex { point, uv: Vec2::new(0.04 + 1e-3 * x, 0.55 + 1e-3 * y) });
        }
        let start = mesh.triangles.len() as u32;
        mesh.triangles.push([first, first + 1, first + 2]);
        mesh.triangles.push([first, first + 2, first + 3]);
        mesh.parts.push(Part { name: format!("{start}"), material, triangles: start..start + 2 });
    };
    quad(Vec3::new(-30.0, -30.0, 0.0), Vec3::new(30.0, 30.0, 0.0), material);
    flaps.iter().for_each(|[low, high]| quad(*low, *high, Material::Skin));
    Head { name: "flap".into(), mesh, ..Head::default() }
}

/// A ridge of teeth along Y whose sides fall off by 45 degrees, in four triangles, and a flap of skin close to its right side.
fn ridge(flap: Option<[Vec3; 2]>) -> Head {
    let mut head = head(Material::Teeth, flap.as_slice());
    let [left, right] = [-30.0, 30.0].map(|x: f32| 0.001 * Vec3::new(x, 0.0, -x.abs()));
    for (point, foot) in head.mesh.points[..4].iter_mut().zip([left, right, right, left]) {
        *point = foot + point.y * Vec3::Y;
    }
    // The square becomes two that share the points of the ridge.
    let top = head.mesh.points.len() as u32;
    head.mesh.points.extend([-0.03, 0.03].map(|y| y * Vec3::Y));
    let first = head.mesh.vertices.len() as u32;
    head.mesh.vertices.extend([top, top + 1].map(|point| Vertex { point, uv: Vec2::new(0.04, 0.55) }));
    let flaps = head.mesh.triangles.split_off(2);
    head.mesh.triangles =
        vec![[0, first, first + 1], [0, first + 1, 3], [first, 1, 2], [first, 2, first + 1]];
    head.mesh.triangles.extend(flaps);
    for (part, triangles) in head.mesh.parts.iter_mut().zip([0..4, 4..6]) {
        part.triangles = triangles;
    }
    head
}

/// Green light of the picture in front of a head, by a lamp or an even sky.
fn light_on(renderer: &mut Renderer, head: &Head, by_sky: bool) -> Vec<f32> {
    let sky = EnvironmentMap::from_fn(16, 8, |_| Vec3::ONE).upload(renderer.gpu());
    let on_gpu = HeadOnGpu::new(renderer.gpu(), head, &WHITE_TABLE).expect("it uploads");
    let state = FaceState::neutral(head);
    let heads = [HeadInstance { head: &on_gpu, state: &state, world_from_head: Mat4::IDENTITY }];
    let scene = Scene {
        heads: &heads,
        camera: Camera {
            position: 0.3 * Vec3::Z,
            target: Vec3::ZERO,
            up: Vec3::Y,
            fov_degrees: 2.0 * (0.5e-3 * SEEN_MM / 0.3).atan().to_degrees(),
        },
        // The edge of the flap shadows x = 3 mm.
        lights: &[Light {
            kind: LightKind::Directional { direction: Vec3::new(-1.0, 0.0, -1.0).normalize() },
            color_linear: Vec3::splat(if by_sky { 0.0 } else { 2.0 }),
            radius: 0.0,
            casts_shadow: true,
        }],
        environment: by_sky.then_some(&sky),
        environment_rotation: 0.0,
        environment_intensity: 1.0,
        background_linear: Vec3::ZERO,
        optics: Default::default(),
    };
    let mut settings = settings([SIZE; 2]);
    settings.quality.shadow_size = 1024;
    render(renderer, &scene, &settings).expect("it draws");
    read_texels(renderer, Channel::Radiance).iter().map(|texel| texel[1]).collect()
}

/// Light of the middle row.
fn row(renderer: &mut Renderer, material: Material, flaps: &[[Vec3; 2]]) -> Vec<f32> {
    let first = (SIZE / 2 * SIZE) as usize;
    light_on(renderer, &head(material, flaps), false)[first..first + SIZE as usize].to_vec()
}

/// Millimetres over which a shadow falls from nine to one tenth of the light, and where half of it is.
fn edge_mm(renderer: &mut Renderer, material: Material) -> (f32, f32) {
    let lit = row(renderer, material, &[]);
    let shadowed = row(renderer, material, &[FLAP]);
    let seen: Vec<f32> = shadowed.iter().zip(&lit).map(|(s, l)| s / l).collect();
    assert!(seen[8] > 0.99 && seen[SIZE as usize - 8] < 0.01, "{seen:?}");
    let place = |share: f32| {
        let pixels = seen.iter().filter(|s| **s > share).count();
        (pixels as f32 / SIZE as f32 - 0.5) * SEEN_MM
    };
    (place(0.1) - place(0.9), place(0.5))
}

#[test]
fn light_spreads_in_teeth_and_not_in_what_is_opaque() {
    let Some(mut renderer) = renderer() else { return };
    let (hard_mm, hard_at) = edge_mm(&mut renderer, Material::Other);
    let (soft_mm, soft_at) = edge_mm(&mut renderer, Material::Teeth);
    assert!(hard_mm < 0.5, "{hard_mm}");
    assert!((1.0..2.6).contains(&soft_mm), "a disc of 1.3 mm about each place: {soft_mm} mm");
    // The shadow lies where it did.
    assert!((hard_at - 3.0).abs() < 0.25 && (soft_at - hard_at).abs() < 0.35, "{hard_at} and {soft_at}");
}

#[test]
fn what_is_close_to_a_bent_crown_shades_it() {
    let Some(mut renderer) = renderer() else { return };
    // The lamp stands straight over the right side, whose tangent plane at the ridge passes in front of the flap.
    let flap = [Vec3::new(3.6, -30.0, -2.2), Vec3::new(30.0, 30.0, -2.2)];
    let mut light = |flap| {
        let picture = light_on(&mut renderer, &ridge(flap), false);
        let pixel = |mm: f32| ((mm / SEEN_MM + 0.5) * SIZE as f32) as usize;
        let row = (SIZE / 2 * SIZE) as usize;
        [pixel(1.0), pixel(3.4)].map(|x| picture[row + x])
    };
    let ([open, open_beside], [lit, shaded]) = (light(None), light(Some(flap)));
    assert!(lit > 0.98 * open, "{lit} of {open}");
    // The flap hides the lamp from x = 2.9 mm on, and light spreads from there.
    assert!(shaded < 0.3 * open_beside, "{shaded} of {open_beside}");
}

#[test]
fn teeth_see_the_sky_between_the_lips() {
    let Some(mut renderer) = renderer() else { return };
    let mut light = |flaps: &[[Vec3; 2]]| {
        let picture = light_on(&mut renderer, &head(Material::Teeth, flaps), true);
        // The middle, 2 mm to a side.
        let middle: Vec<usize> = (SIZE / 2 - 10..SIZE / 2 + 10).map(|i| i as usize).collect();
        let sum: f32 =
            middle.iter().flat_map(|y| middle.iter().map(|x| picture[*y * SIZE as usize + *x])).sum();
        sum / 400.0
    };
    let lips = |half: f32, before: f32| {
        [
            [Vec3::new(-30.0, half, before), Vec3::new(30.0, 30.0, before)],
            [Vec3::new(-30.0, -30.0, before), Vec3::new(30.0, -half, before)],
        ]
    };
    let open = light(&[]);
    for (half, before) in [(4.0, 3.0), (2.5, 4.0), (4.5, 1.0)] {
        // The form factor of a long slit in front of a plane.
        let expected = half / f32::hypot(half, before);
        let found = light(&lips(half, before)) / open;
        assert!((found - expected).abs() < 0.05, "{half} mm by {before} mm: {found} for {expected}");
    }
}

#[test]
fn lobes_keep_the_mean_square_slope() {
    for method in SpecularMethod::all() {
        let [first, second, share] = method.lobes();
        let square = (1.0 - share) * first * first + share * second * second;
        assert!((square - 1.0).abs() < 2e-3, "{method} keeps the mean square slope: {square}");
    }
}

/// Pixels of the square picture last drawn that were compared with the reflected radiance for irradiance 1 of a surface
/// with a normal, towards a directional lamp and towards the viewer; and the largest relative error.
pub(super) fn largest_error(
    renderer: &Renderer,
    head: &Head,
    camera: &Camera,
    size: u32,
    lamp: &Light,
    radiance: impl Fn(DVec3, DVec3, DVec3) -> f64,
) -> (usize, f64) {
    let LightKind::Directional { direction } = lamp.kind else { panic!("the lamp is directional") };
    let to_light = -direction.as_dvec3().normalize();
    let points = read_vectors(renderer, Channel::Positions);
    let frames: Vec<[f32; 7]> = read(renderer, Channel::TangentFrames).texels().collect();
    let ids: Vec<[f32; 1]> = read(renderer, Channel::Ids).texels().collect();
    let (mut compared, mut largest) = (0, 0.0f64);
    for (i, found) in read_texels(renderer, Channel::Radiance).iter().enumerate() {
        let Some(hit) = seen_surface(head, &points, ids[i][0].to_bits(), camera, size, i as u32, [0.0; 2])
        else {
            continue;
        };
        let normal_of = |k: usize| {
            let f = frames[hit.vertices[k] as usize];
            DVec3::new(f64::from(f[0]), f64::from(f[1]), f64::from(f[2]))
        };
        let normal = (0..3).map(|k| hit.barycentric[k] * normal_of(k)).sum::<DVec3>().normalize();
        let to_viewer = (camera.position.as_dvec3() - hit.position).normalize();
        // Past the horizon the shader fades; the equation does not apply there.
        if normal.dot(to_light) < 0.15 || normal.dot(to_viewer) < 0.15 {
            continue;
        }
        compared += 1;
        let expected = radiance(normal, to_light, to_viewer);
        for c in 0..3 {
            let irradiance = f64::from(lamp.color_linear[c]);
            largest = largest.max((f64::from(found[c]) / irradiance - expected).abs() / expected);
        }
    }
    (compared, largest)
}

#[test]
fn a_lamp_on_bare_skin_is_the_equation() {
    let Some(mut renderer) = renderer() else { return };
    let mut head = dome();
    let (specular, roughness) = (0.7f32, 0.34f32);
    head.maps.slopes = None;
    head.maps.hair = None;
    head.maps.specular = Some(Map::filled(1, 1, &[specular, roughness]));
    head.mesh.occlusion.clear();
    let on_gpu = HeadOnGpu::new(renderer.gpu(), &head, &WHITE_TABLE).expect("it uploads");
    let skin =
        reference::Skin { albedo: 0.8, specular: f64::from(specular), roughness: f64::from(roughness) };
    let state = FaceState::neutral(&head);
    let size = 45;
    let mut settings = settings([size; 2]);
    settings.quality.scatter = ScatterMethod::None;
    settings.quality.transmit = TransmitMethod::None;
    let camera = Camera { position: 0.5 * Vec3::Z, target: Vec3::ZERO, up: Vec3::Y, fov_degrees: 20.0 };
    for direction in [Vec3::new(0.1, -0.2, -1.0), Vec3::new(-0.8, -0.5, -0.6), Vec3::new(0.9, 0.3, -0.25)] {
        let kind = LightKind::Directional { direction };
        let lamp = Light { kind, color_linear: Vec3::new(2.0, 1.0, 0.5), radius: 0.0, casts_shadow: false };
        let scene = Scene {
            heads: &[HeadInstance { head: &on_gpu, state: &state, world_from_head: Mat4::IDENTITY }],
            camera,
            lights: &[lamp],
            environment: None,
            environment_rotation: 0.0,
            environment_intensity: 0.0,
            background_linear: Vec3::ZERO,
            optics: Default::default(),
        };
        render(&mut renderer, &scene, &settings).expect("it draws");
        let (compared, largest) =
            largest_error(&renderer, &head, &camera, size, &lamp, |n, l, v| skin.radiance(n, l, v));
        // The table of reflected shares is linear between 32 cosines and 32 roughnesses; halves keep 11 bits.
        assert!(compared > 200 && largest < 0.01, "{direction}: {compared} pixels, error up to {largest}");
    }
}

/// The dome without relief and hair, of a base colour and an alpha of GGX.
fn dome_of_own_color(base: f32, alpha: f32) -> Head {
    let mut head = dome();
    head.maps.slopes = None;
    head.maps.hair = None;
    head.maps.albedo = Some(Map::filled(1, 1, &[base; 3]));
    head.maps.specular = Some(Map::filled(1, 1, &[BASE_COLOR_F0 / SKIN_F0, alpha]));
    head.mesh.occlusion.clear();
    head.shapes.iter_mut().for_each(|shape| shape.occlusion.clear());
    head
}

#[test]
fn light_on_skin_of_its_own_colour_is_that_of_a_base_colour() {
    let Some(mut renderer) = renderer() else { return };
    let camera = Camera { position: 0.5 * Vec3::Z, target: Vec3::ZERO, up: Vec3::Y, fov_degrees: 20.0 };
    let size = 45;
    let directions = [Vec3::new(0.1, -0.2, -1.0), Vec3::new(-0.8, -0.5, -0.6), Vec3::new(0.9, 0.3, -0.4)];
    let lamps = directions.map(|direction| Light {
        kind: LightKind::Directional { direction },
        color_linear: Vec3::new(2.0, 1.0, 0.5),
        radius: 0.0,
        casts_shadow: false,
    });
    // The map keeps the colour in sRGB codes.
    let base = srgb_decode(srgb_encode(0.3).mul_add(255.0, 0.5).floor() / 255.0);
    for (alpha, specular) in
        [(0.25f32, SpecularMethod::OneLobe), (0.64, SpecularMethod::TwoLobes), (1.0, SpecularMethod::OneLobe)]
    {
        let head = dome_of_own_color(base, alpha);
        let on_gpu = HeadOnGpu::new(renderer.gpu(), &head, &WHITE_TABLE).expect("it uploads");
        let state = FaceState::neutral(&head);
        let sky = EnvironmentMap { width: 8, height: 4, texels: vec![Vec3::ONE; 32] }.upload(renderer.gpu());
        let mut settings = settings([size; 2]);
        settings.quality.scatter = ScatterMethod::None;
        settings.quality.transmit = TransmitMethod::None;
        settings.quality.specular = specular;
        let mut scene = Scene {
            heads: &[HeadInstance { head: &on_gpu, state: &state, world_from_head: Mat4::IDENTITY }],
            camera,
            lights: &[],
            environment: None,
            environment_rotation: 0.0,
            environment_intensity: 1.0,
            background_linear: Vec3::ZERO,
            optics: Default::default(),
        };
        let expected = reference::MetallicRoughness {
            base: f64::from(base),
            metallic: 0.0,
            roughness: f64::from(alpha).sqrt(),
        };
        for lamp in &lamps {
            scene.lights = std::slice::from_ref(lamp);
            render(&mut renderer, &scene, &settings).expect("it draws");
            let (compared, largest) =
                largest_error(&renderer, &head, &camera, size, lamp, |n, l, v| expected.radiance(n, l, v));
            assert!(
                compared > 200 && largest < 0.005,
                "{alpha} {:?}: {compared} pixels, error up to {largest}",
                lamp.kind
            );
        }
        // Of an even sky: what is reflected, and the colour of the rest. The middle of the picture sees the dome from in front.
        scene.lights = &[];
        scene.environment = Some(&sky);
        render(&mut renderer, &scene, &settings).expect("it draws");
        let found =
            f64::from(read_texels(&renderer, Channel::Radiance)[(size / 2 * size + size / 2) as usize][1]);
        let mirror = reference::MetallicRoughness { base: 0.04, metallic: 1.0, ..expected };
        let share = mirror.reflected_sky(1.0);
        let sum = share + (1.0 - share) * f64::from(base);
        assert!((found - sum).abs() < 0.006, "{alpha}: {found}, expected {sum}");
    }
}

/// A sheet that fills the picture of a camera far away, its texture once across: a texel is a pixel.
fn sheet(maps: SkinMaps) -> (Head, Camera) {
    let fov_degrees = 1.0f32;
    let half = 0.1;
    let mut mesh = Mesh::default();
    for (x, y) in [(-1.0, 1.0), (1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)] {
        let point = mesh.points.len() as u32;
        mesh.points.push(half * Vec3::new(x, y, 0.0));
        mesh.vertices.push(Vertex { point, uv: 0.5 + 0.5 * Vec2::new(x, -y) });
    }
    mesh.triangles = vec![[0, 2, 1], [0, 3, 2]];
    mesh.parts = vec![Part { name: "skin".into(), material: Material::Skin, triangles: 0..2 }];
    let distance = half / (0.5 * fov_degrees.to_radians()).tan();
    let camera = Camera { position: distance * Vec3::Z, target: Vec3::ZERO, up: Vec3::Y, fov_degrees };
    (Head { name: "sheet".into(), mesh, maps, ..Head::default() }, camera)
}

#[test]
fn skin_of_its_own_colour_shows_it_and_follows_blood() {
    let Some(mut renderer) = renderer() else { return };
    let lookup = SkinModel::new(&ChromophoreModel::default()).bake(64, 64);
    let table = ColorTable { width: lookup.width, height: lookup.height, texels: &lookup.texels };
    let size = 32;
    let mut random = SplitMix64(3);
    // Every kind of colour in sRGB codes: paint, black, white, skin.
    let codes: Vec<u8> = (0..3 * size * size)
        .map(|i| match i / (3 * size) {
            0 => 0,
            1 => 255,
            2..16 => random.below(256) as u8,
            _ => [225, 172, 150][i as usize % 3] - random.below(20) as u8,
        })
        .collect();
    let values = codes.iter().map(|c| srgb_decode(f32::from(*c) / 255.0)).collect();
    let flat = |v| Map::filled(1, 1, &[v]);
    let (melanin, blood, flushed) = (0.02f32, 0.016f32, 0.05f32);
    let maps = SkinMaps {
        albedo: Some(Map { width: size, height: size, channels: 3, values }),
        melanin: Some(flat(melanin)),
        hemoglobin: Some(flat(blood)),
        hemoglobin_mean: Some(flat(blood)),
        distributions: vec![Distribution { name: "blush".into(), scale: flat(1.0), bias: flat(flushed) }],
        specular: Some(Map::filled(1, 1, &[0.3, 0.4])),
        ..SkinMaps::default()
    };
    let (head, camera) = sheet(maps);
    let on_gpu = HeadOnGpu::new(renderer.gpu(), &head, &table).expect("it uploads");
    let mut state = FaceState::neutral(&head);
    let mut draw = |state: &FaceState| {
        let scene = Scene {
            heads: &[HeadInstance { head: &on_gpu, state, world_from_head: Mat4::IDENTITY }],
            camera,
            lights: &[],
            environment: None,
            environment_rotation: 0.0,
            environment_intensity: 0.0,
            background_linear: Vec3::ZERO,
            optics: Default::default(),
        };
        render(&mut renderer, &scene, &settings([size; 2])).expect("it draws");
        read_texels(&renderer, Channel::Albedo)
    };
    let neutral = draw(&state);
    for (i, found) in neutral.iter().enumerate() {
        for c in 0..3 {
            let code = 255.0 * srgb_encode(found[c]);
            let expected = f32::from(codes[3 * i + c]);
            assert!((code - expected).abs() < 0.75, "texel {i}: {code} for {expected}");
        }
    }
    state.distributions[0] = 1.0;
    // The map keeps 8 bits of the address, the device's filter 8 bits between texels of the table.
    let address = |v: f32, most: f64| {
        let code = (f64::from(v) / most).cbrt() * 255.0;
        (most * (code.round() / 255.0).powi(3)) as f32
    };
    let (m, h) = (address(melanin, MAX_MELANIN), address(blood, MAX_HEMOGLOBIN));
    let change = lookup.change(m, h, h + flushed - blood);
    assert!(change[1] < 0.8 * change[0], "a flush takes green: {change:?}");
    for (i, (found, before)) in draw(&state).iter().zip(&neutral).enumerate() {
        for c in 0..3 {
            let expected = (change[c] * before[c]).min(1.0);
            assert!((found[c] - expected).abs() < 0.01 * expected + 1e-3, "texel {i}: {found:?}, {expected}");
        }
    }
}

#[test]
fn relief_that_was_given_has_the_slopes_of_its_map() {
    let Some(mut renderer) = renderer() else { return };
    let slope = 0.5f32;
    let flat = |v| Map::filled(1, 1, &[v]);
    let (mut head, camera) = sheet(SkinMaps {
        melanin: Some(flat(0.02)),
        hemoglobin: Some(flat(0.02)),
        slopes: Some(Map::filled(1, 1, &[slope, 0.0])),
        // No reflection, so that light is the cosine.
        specular: Some(Map::filled(1, 1, &[0.0, 0.4])),
        ..SkinMaps::default()
    });
    let size = 16;
    let mut settings = settings([size; 2]);
    settings.quality.scatter = ScatterMethod::None;
    settings.quality.transmit = TransmitMethod::None;
    let mut light_over_flat = |head: &Head, expected: f32| {
        let on_gpu = HeadOnGpu::new(renderer.gpu(), head, &WHITE_TABLE).expect("it uploads");
        let state = FaceState::neutral(head);
        let kind = LightKind::Directional { direction: -Vec3::Z };
        let scene = Scene {
            heads: &[HeadInstance { head: &on_gpu, state: &state, world_from_head: Mat4::IDENTITY }],
            camera,
            lights: &[Light { kind, color_linear: Vec3::ONE, radius: 0.0, casts_shadow: false }],
            environment: None,
            environment_rotation: 0.0,
            environment_intensity: 0.0,
            background_linear: Vec3::ZERO,
            optics: Default::default(),
        };
        render(&mut renderer, &scene, &settings).expect("it draws");
        let middle = read_texels(&renderer, Channel::Irradiance)[(size / 2 * size + size / 2) as usize][1];
        let cosine = 1.0 / (1.0 + (expected * slope).powi(2)).sqrt();
        let found = middle * std::f32::consts::PI;
        assert!((found - cosine).abs() < 0.01, "{found}, expected {cosine}");
    };
    // A head that says nothing has relief that rubor made.
    light_over_flat(&head, super::RELIEF_SCALE);
    for (kind, scale) in [
        (ProvenanceKind::Synthesised, super::RELIEF_SCALE),
        (ProvenanceKind::Painted, 1.0),
        (ProvenanceKind::Measured, 1.0),
    ] {
        head.provenance = vec![Provenance {
            of: "maps.slopes".into(),
            kind,
            source: String::new(),
            licence: "CC0-1.0".into(),
        }];
        light_over_flat(&head, scale);
    }
}

#[test]
fn tiles_that_are_listed_get_the_light_of_whole_windows() {
    let Some(mut renderer) = renderer() else { return };
    if !renderer.gpu().is_software() {
        crate::testing::skipped("tiles are listed on software devices alone");
        return;
    }
    let mut head = dome();
    let triangles = head.mesh.triangles.len() as u32;
    let materials = [Material::Skin, Material::Eye, Material::Teeth, Material::Gums, Material::Skin];
    let ends = [0, 30, 33, 40, 47, 92].map(|part| part * triangles / 92);
    head.mesh.parts = (materials.iter().zip(ends.windows(2)))
        .map(|(material, end)| Part {
            name: format!("{material:?}"),
            material: *material,
            triangles: end[0]..end[1],
        })
        .collect();
    let on_gpu = HeadOnGpu::new(renderer.gpu(), &head, &WHITE_TABLE).expect("it uploads");
    let state = FaceState { shapes: vec![0.1, 0.6], ..FaceState::neutral(&head) };
    let at = |x: f32| HeadInstance {
        head: &on_gpu,
        state: &state,
        world_from_head: Mat4::from_translation(Vec3::new(x, 0.03, 0.0)),
    };
    let sky = EnvironmentMap { width: 8, height: 4, texels: vec![Vec3::splat(0.4); 32] };
    let sky = sky.upload(renderer.gpu());
    let lamps = [-0.6f32, 0.5].map(|x| Light {
        kind: LightKind::Directional { direction: Vec3::new(x, -0.3, -1.0) },
        color_linear: Vec3::new(2.0, 1.5, 1.0),
        radius: 0.05,
        casts_shadow: true,
    });
    let scene = Scene {
        heads: &[at(-0.1), at(0.12)],
        camera: Camera { position: 0.9 * Vec3::Z, target: Vec3::ZERO, up: Vec3::Y, fov_degrees: 32.0 },
        lights: &lamps,
        environment: Some(&sky),
        environment_rotation: 0.3,
        environment_intensity: 1.0,
        background_linear: Vec3::ZERO,
        optics: Default::default(),
    };
    let mut settings = settings([107, 83]);
    settings.quality.antialias = crate::settings::AntialiasMethod::SmaaS2x;
    settings.output.channels = vec![Channel::Irradiance, Channel::Albedo, Channel::Direct];
    let light = |renderer: &mut Renderer| {
        let picture = render(renderer, &scene, &settings).expect("it draws").0;
        let channels = settings.output.channels.iter();
        (picture, channels.map(|c| read(renderer, *c).values).collect::<Vec<_>>())
    };
    let listed = light(&mut renderer);
    let lit = listed.0.rgba.chunks(4).filter(|p| p[0] > 20).count();
    assert!((1000..6000).contains(&lit), "{lit} pixels of the picture are lit");
    renderer.shade().forget_tiles();
    assert!(light(&mut renderer) == listed, "the light is the same to the bit");
}

#[test]
fn light_that_came_through_is_what_no_transmittance_lacks() {
    let Some(mut renderer) = renderer() else { return };
    let head = dome();
    let on_gpu = HeadOnGpu::new(renderer.gpu(), &head, &WHITE_TABLE).expect("it uploads");
    let state = FaceState::neutral(&head);
    let lamps = [Vec3::new(0.5, -0.3, 1.0), Vec3::new(0.3, -0.6, -1.0)].map(|direction| Light {
        kind: LightKind::Directional { direction },
        color_linear: Vec3::new(2.0, 1.5, 1.0),
        radius: 0.02,
        casts_shadow: true,
    });
    let scene = Scene {
        heads: &[HeadInstance { head: &on_gpu, state: &state, world_from_head: Mat4::IDENTITY }],
        camera: Camera { position: 0.5 * Vec3::Z, target: Vec3::ZERO, up: Vec3::Y, fov_degrees: 32.0 },
        lights: &lamps,
        environment: None,
        environment_rotation: 0.0,
        environment_intensity: 0.0,
        background_linear: Vec3::ZERO,
        optics: Default::default(),
    };
    let mut light = |transmit: TransmitMethod| {
        let mut settings = settings([48, 48]);
        settings.quality.transmit = transmit;
        settings.output.channels = vec![Channel::Irradiance, Channel::Transmitted];
        render(&mut renderer, &scene, &settings).expect("it draws");
        [Channel::Irradiance, Channel::Transmitted].map(|c| read_texels(&renderer, c))
    };
    let [without, nothing] = light(TransmitMethod::None);
    let [with, through] = light(TransmitMethod::ShadowDepth);
    assert!(nothing.iter().all(|t| t[..3] == [0.0; 3]));
    let lit = through.iter().filter(|t| t[0] > 0.01).count();
    assert!(lit > 100, "light comes through at {lit} pixels");
    for i in 0..with.len() {
        for c in 0..3 {
            let [all, rest, part] = [with[i][c], without[i][c], through[i][c]];
            assert!((all - rest - part).abs() <= 1e-3 * all + 1e-6, "pixel {i}: {all} of {rest} and {part}");
        }
    }
}
