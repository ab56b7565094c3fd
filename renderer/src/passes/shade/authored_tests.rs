//! Materials of authors: the equation, energy, textures and holes.

use glam::{Mat4, Vec2, Vec3};
use rubor_rig::authored::{
    AlphaMode, AuthoredImage, AuthoredMaterial, AuthoredTexture, TextureTransform, Wrap,
};
use rubor_rig::face_state::FaceState;
use rubor_rig::head::{Head, Material};

use super::reference::{Coated, MetallicRoughness};
use super::tests::largest_error;
use crate::channels::Channel;
use crate::tests::{WHITE_TABLE, dome, read_texels, render, renderer, settings};
use crate::{Camera, EnvironmentMap, HeadInstance, HeadOnGpu, Light, LightKind, Renderer, Scene};

const SIZE: u32 = 45;
const CAMERA: Camera =
    Camera { position: Vec3::new(0.0, 0.0, 0.5), target: Vec3::ZERO, up: Vec3::Y, fov_degrees: 20.0 };

/// The dome with a material.
fn head(material: AuthoredMaterial) -> Head {
    let mut head = dome();
    head.mesh.occlusion.clear();
    head.shapes.iter_mut().for_each(|shape| shape.occlusion.clear());
    head.mesh.parts[0].material = Material::Other;
    head.authored.materials = vec![material];
    head.authored.of_parts = vec![Some(0)];
    head
}

fn draw(renderer: &mut Renderer, head: &Head, lights: &[Light], with_sky: bool) -> Vec<[f32; 4]> {
    let on_gpu = HeadOnGpu::new(renderer.gpu(), head, &WHITE_TABLE).expect("it uploads");
    let state = FaceState::neutral(head);
    let sky = EnvironmentMap { width: 8, height: 4, texels: vec![Vec3::ONE; 32] };
    let sky = with_sky.then(|| sky.upload(renderer.gpu()));
    let scene = Scene {
        heads: &[HeadInstance { head: &on_gpu, state: &state, world_from_head: Mat4::IDENTITY }],
        camera: CAMERA,
        lights,
        environment: sky.as_ref(),
        environment_rotation: 0.0,
        environment_intensity: 1.0,
        background_linear: Vec3::ZERO,
        optics: Default::default(),
    };
    render(renderer, &scene, &settings([SIZE; 2])).expect("it draws");
    read_texels(renderer, Channel::Radiance)
}

fn lamp(direction: Vec3) -> Light {
    let kind = LightKind::Directional { direction };
    Light { kind, color_linear: Vec3::new(2.0, 1.0, 0.5), radius: 0.0, casts_shadow: false }
}

fn texture(transform: TextureTransform) -> AuthoredTexture {
    AuthoredTexture { image: 0, uv_set: 0, transform, wrap: [Wrap::Clamp; 2] }
}

#[test]
fn a_lamp_on_it_is_the_equation() {
    let Some(mut renderer) = renderer() else { return };
    let (base, metallic, roughness) = (0.6f32, 0.35f32, 0.4f32);
    let material =
        AuthoredMaterial { base_color: [base, base, base, 1.0], metallic, roughness, ..Default::default() };
    let head = head(material);
    let expected = MetallicRoughness {
        base: f64::from(base),
        metallic: f64::from(metallic),
        roughness: f64::from(roughness),
    };
    for direction in [Vec3::new(0.1, -0.2, -1.0), Vec3::new(-0.8, -0.5, -0.6), Vec3::new(0.9, 0.3, -0.4)] {
        let light = lamp(direction);
        draw(&mut renderer, &head, &[light], false);
        let (compared, largest) =
            largest_error(&renderer, &head, &CAMERA, SIZE, &light, |n, l, v| expected.radiance(n, l, v));
        // Halves keep 11 bits; the rest is f32 in a lobe whose slope multiplies errors of the half vector.
        assert!(compared > 200 && largest < 0.004, "{direction}: {compared} pixels, error up to {largest}");
    }
}

#[test]
fn index_strength_and_coat_are_those_of_the_extensions() {
    let Some(mut renderer) = renderer() else { return };
    let base = 0.5f32;
    for (ior, specular, coat) in
        [(2.0f32, 1.0f32, [0.0f32, 0.0f32]), (1.5, 0.3, [0.0; 2]), (1.33, 0.8, [0.7, 0.25])]
    {
        let material = AuthoredMaterial {
            base_color: [base, base, base, 1.0],
            metallic: 0.0,
            roughness: 0.5,
            ior,
            specular,
            clearcoat: coat[0],
            clearcoat_roughness: coat[1],
            ..Default::default()
        };
        let head = head(material);
        let under = MetallicRoughness { base: f64::from(base), metallic: 0.0, roughness: 0.5 };
        let expected =
            Coated { under, ior: f64::from(ior), specular: f64::from(specular), coat: coat.map(f64::from) };
        let light = lamp(Vec3::new(-0.5, -0.4, -0.8));
        draw(&mut renderer, &head, &[light], false);
        let (compared, largest) =
            largest_error(&renderer, &head, &CAMERA, SIZE, &light, |n, l, v| expected.radiance(n, l, v));
        assert!(compared > 200 && largest < 0.006, "{ior}: {compared} pixels, error up to {largest}");
    }
}

#[test]
fn a_coloured_reflection_has_its_colour() {
    let Some(mut renderer) = renderer() else { return };
    // Black paint under an even sky shows its reflection alone.
    let material = AuthoredMaterial {
        base_color: [0.0, 0.0, 0.0, 1.0],
        metallic: 0.0,
        roughness: 0.4,
        specular_color: [1.0, 0.5, 0.0],
        ..Default::default()
    };
    let hdr = draw(&mut renderer, &head(material), &[], true);
    let [r, g, b, _] = hdr[(SIZE / 2 * SIZE + SIZE / 2) as usize];
    let share = |f0: f64| MetallicRoughness { base: f0, metallic: 1.0, roughness: 0.4 }.reflected_sky(1.0);
    for (found, f0) in [(r, 0.04), (g, 0.02), (b, 0.0)] {
        assert!((f64::from(found) - share(f0)).abs() < 0.002, "{found} for {}", share(f0));
    }
}

#[test]
fn an_even_sky_is_not_made_brighter() {
    // Metals reflect no more than comes; the model itself lets dielectrics gain towards grazing angles (its diffuse part
    // loses what the half vector reflects, and that is little there), so they are bound where faces are seen.
    for roughness in [0.1, 0.3, 0.6, 1.0] {
        for cosine in [0.2, 0.5, 0.8, 1.0] {
            let metal = MetallicRoughness { base: 1.0, metallic: 1.0, roughness };
            let share = metal.reflected_sky(cosine);
            assert!((0.3..1.005).contains(&share), "metal {roughness} {cosine}: {share}");
            let paint = MetallicRoughness { base: 1.0, metallic: 0.0, roughness };
            let share = paint.reflected_sky(cosine);
            let most = if cosine >= 0.5 { 1.06 } else { 1.35 };
            assert!((0.85..most).contains(&share), "paint {roughness} {cosine}: {share}");
        }
    }
}

#[test]
fn the_sky_on_the_device_is_that_of_the_equation() {
    let Some(mut renderer) = renderer() else { return };
    for (metallic, roughness) in [(0.0, 0.3), (0.0, 1.0), (1.0, 0.3), (1.0, 0.7)] {
        let base = 0.7;
        let material = AuthoredMaterial {
            base_color: [base, base, base, 1.0],
            metallic,
            roughness,
            ..Default::default()
        };
        let hdr = draw(&mut renderer, &head(material), &[], true);
        // The middle of the picture sees the dome from in front.
        let found = f64::from(hdr[(SIZE / 2 * SIZE + SIZE / 2) as usize][1]);
        let (base, metallic, roughness) = (f64::from(base), f64::from(metallic), f64::from(roughness));
        let share = |f0: f64| MetallicRoughness { base: f0, metallic: 1.0, roughness }.reflected_sky(1.0);
        // The diffuse part keeps what a dielectric does not reflect of the sky as a whole.
        let diffuse = (1.0 - metallic) * base * (1.0 - share(0.04));
        let expected = diffuse + share(0.04 + (base - 0.04) * metallic);
        assert!((found - expected).abs() < 0.01, "{metallic} {roughness}: {found}, expected {expected}");
        assert!(hdr.iter().flatten().all(|v| *v <= 1.01), "{metallic} {roughness}");
    }
}

#[test]
fn unlit_parts_show_their_texture_where_the_transform_puts_it() {
    let Some(mut renderer) = renderer() else { return };
    // Left half red, right half green; sRGB 188 is 0.503 in linear light.
    let rgba = [[188, 0, 0, 255], [0, 188, 0, 255]].concat();
    let image = AuthoredImage { name: "halves".into(), width: 2, height: 1, rgba };
    let shown = |renderer: &mut Renderer, offset: f32| {
        let transform = TextureTransform {
            offset: Vec2::new(offset, 0.0),
            scale: Vec2::new(0.0, 1.0),
            ..Default::default()
        };
        let material = AuthoredMaterial {
            base_color_texture: Some(texture(transform)),
            base_color: [0.5, 1.0, 1.0, 1.0],
            is_unlit: true,
            ..Default::default()
        };
        let mut head = head(material);
        head.authored.images = vec![image.clone()];
        head.authored.colors_linear = vec![[1.0, 0.25, 1.0, 1.0]; head.mesh.vertices.len()];
        draw(renderer, &head, &[], false)[(SIZE / 2 * SIZE + SIZE / 2) as usize]
    };
    let close = |found: [f32; 4], expected: [f32; 3]| {
        assert!((0..3).all(|c| (found[c] - expected[c]).abs() < 2e-3), "{found:?}, expected {expected:?}");
    };
    // Factor, vertex colour and texture multiply; beyond the edge the texture holds its last texel.
    close(shown(&mut renderer, 0.2), [0.5 * 0.503, 0.0, 0.0]);
    close(shown(&mut renderer, -3.0), [0.5 * 0.503, 0.0, 0.0]);
    close(shown(&mut renderer, 0.8), [0.0, 0.25 * 0.503, 0.0]);
    close(shown(&mut renderer, 7.0), [0.0, 0.25 * 0.503, 0.0]);
}

#[test]
fn masks_leave_holes() {
    let Some(mut renderer) = renderer() else { return };
    let rgba = [[255, 255, 255, 100], [255, 255, 255, 200]].concat();
    let covered = |renderer: &mut Renderer, alpha: AlphaMode| {
        let material = AuthoredMaterial {
            base_color_texture: Some(texture(TextureTransform::default())),
            alpha,
            is_unlit: true,
            ..Default::default()
        };
        let mut head = head(material);
        head.authored.images =
            vec![AuthoredImage { name: "halves".into(), width: 2, height: 1, rgba: rgba.clone() }];
        // A lamp with a shadow map draws its holes too.
        let light = Light { casts_shadow: true, ..lamp(-Vec3::Z) };
        draw(renderer, &head, &[light], false).iter().filter(|t| t[0] > 0.5).count()
    };
    let whole = covered(&mut renderer, AlphaMode::Opaque);
    assert!(whole > 200, "{whole}");
    assert_eq!(covered(&mut renderer, AlphaMode::Mask { cutoff: 0.3 }), whole);
    assert_eq!(covered(&mut renderer, AlphaMode::Mask { cutoff: 0.9 }), 0);
    for alpha in [AlphaMode::Mask { cutoff: 0.59 }, AlphaMode::Blend] {
        let half = covered(&mut renderer, alpha);
        assert!((half as f32 / whole as f32 - 0.5).abs() < 0.1, "{alpha:?}: {half} of {whole}");
    }
}
