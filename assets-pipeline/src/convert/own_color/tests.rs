use rubor_rig::authored::Authored;
use rubor_rig::head::{Mesh, Part, Vertex};
use rubor_rig::random::SplitMix64;

use super::*;

/// A sheet of one material: two triangles over a square of texture coordinates.
fn add_sheet(head: &mut Head, name: &str, low: Vec2, high: Vec2, material: u32) {
    let mesh = &mut head.mesh;
    let first = mesh.vertices.len() as u32;
    for (i, uv) in [low, Vec2::new(high.x, low.y), high, Vec2::new(low.x, high.y)].into_iter().enumerate() {
        mesh.points.push(glam::Vec3::new((i % 3) as f32 * 0.1, (i / 2) as f32 * 0.1, first as f32));
        mesh.vertices.push(Vertex { point: first + i as u32, uv });
    }
    let start = mesh.triangles.len() as u32;
    mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    mesh.parts.push(Part { name: name.into(), material: Material::Skin, triangles: start..start + 2 });
    head.authored.of_parts.push(Some(material));
}

fn texture(image: u32) -> Option<AuthoredTexture> {
    let transform = TextureTransform::default();
    Some(AuthoredTexture { image, uv_set: 0, transform, wrap: [Wrap::Repeat; 2] })
}

fn matte(image: u32) -> AuthoredMaterial {
    AuthoredMaterial { base_color_texture: texture(image), metallic: 0.0, ..AuthoredMaterial::default() }
}

fn picture(width: u32, height: u32, texel: impl FnMut(u32) -> [u8; 4]) -> AuthoredImage {
    let rgba = (0..width * height).flat_map(texel).collect();
    AuthoredImage { name: "skin".into(), width, height, rgba }
}

/// Skin of several tones with a brow, lips and a blue mark of paint.
fn face(width: u32, height: u32) -> AuthoredImage {
    let lookup = SkinModel::new(&ChromophoreModel::default()).bake(64, 64);
    let code = |c: f32| (rubor_rig::color::srgb_encode(c) * 255.0).round() as u8;
    picture(width, height, |i| {
        let (x, y) = (i % width, i / width);
        let melanin = 0.015 + 0.01 * (x as f32 / width as f32);
        let [r, g, b] = lookup.sample(melanin, 0.012 + 0.01 * (y as f32 / height as f32)).map(code);
        match (5 * x / width, 5 * y / height) {
            (1 | 3, 1) => [30, 22, 20, 255],
            (2, 3) => [200, 60, 110, 255],
            (4, 4) => [20, 60, 220, 255],
            _ => [r, g, b, 255],
        }
    })
}

fn one_sheet(material: AuthoredMaterial, images: Vec<AuthoredImage>) -> Head {
    let authored = Authored { images, materials: vec![material], ..Authored::default() };
    let mut head = Head { mesh: Mesh::default(), authored, ..Head::default() };
    add_sheet(&mut head, "face", Vec2::ZERO, Vec2::ONE, 0);
    head
}

fn adopted(mut head: Head) -> (Head, Vec<String>) {
    let notes = adopt(&mut head, &Options::default()).unwrap();
    head.validate().unwrap();
    (head, notes.iter().map(ToString::to_string).collect())
}

fn says(notes: &[String], what: &str) -> bool {
    notes.iter().any(|n| n.contains(what))
}

#[test]
fn neutral_skin_is_its_texture_at_every_texel_whatever_it_shows() {
    let noise = {
        let mut random = SplitMix64(7);
        picture(27, 51, |_| std::array::from_fn(|c| if c < 3 { random.below(256) as u8 } else { 255 }))
    };
    for image in [face(51, 27), noise] {
        let (head, _) = adopted(one_sheet(matte(0), vec![image.clone()]));
        let maps = &head.maps;
        let (albedo, melanin, blood) = (
            maps.albedo.as_ref().unwrap(),
            maps.melanin.as_ref().unwrap(),
            maps.hemoglobin.as_ref().unwrap(),
        );
        let lookup = SkinModel::new(&ChromophoreModel::default()).bake(64, 64);
        for (i, texel) in image.rgba.chunks_exact(4).enumerate() {
            let own = [0, 1, 2].map(|c| albedo.values[3 * i + c]);
            let (m, h) = (melanin.values[i], blood.values[i]);
            let shown = lookup.with_blood(own, m, h, h).map(rubor_rig::color::srgb_encode);
            for c in 0..3 {
                assert!(
                    (shown[c] * 255.0 - f32::from(texel[c])).abs() < 0.01,
                    "texel {i}: {shown:?} {texel:?}"
                );
            }
            // Whatever it is, its blood is that of skin, and a blush moves it by no more than that of skin.
            assert!((0.0..=0.16).contains(&h) && (0.0..=0.5).contains(&m), "texel {i}: {m} {h}");
            let flushed = lookup.with_blood(own, m, h, (2.0 * h).min(0.3));
            assert!(flushed.iter().zip(own).all(|(f, o)| *f <= o + 1e-6), "texel {i}: {flushed:?} {own:?}");
        }
    }
}

#[test]
fn what_is_no_skin_has_the_blood_of_the_skin_around() {
    let (head, notes) = adopted(one_sheet(matte(0), vec![face(60, 60)]));
    let (melanin, blood) = (head.maps.melanin.unwrap(), head.maps.hemoglobin.unwrap());
    let at = |map: &Map, x: u32, y: u32| map.values[(y * 60 + x) as usize];
    // Middle of a brow, of the lips and of the paint, against the fractions that the skin has there.
    for (x, y) in [(18, 18), (30, 42), (54, 54)] {
        let (m, h) = (0.015 + 0.01 * x as f32 / 60.0, 0.012 + 0.01 * y as f32 / 60.0);
        assert!((at(&melanin, x, y) - m).abs() < 0.25 * m, "({x}, {y}): {} for {m}", at(&melanin, x, y));
        assert!((at(&blood, x, y) - h).abs() < 0.25 * h, "({x}, {y}): {} for {h}", at(&blood, x, y));
    }
    // No step where the brow begins.
    for x in 8..28 {
        let step = (at(&blood, x, 18) - at(&blood, x + 1, 18)).abs();
        assert!(step < 0.003, "{x}: {step}");
    }
    assert!(says(&notes, "keeps its own colour") && says(&notes, "gain 1.00") && says(&notes, "skin around"));
}

#[test]
fn several_materials_share_the_unit_square() {
    let other = picture(51, 27, |i| [(i % 251) as u8, 120, (i % 83) as u8, 255]);
    let mut head = one_sheet(matte(0), vec![face(51, 27), other.clone()]);
    head.authored.materials.push(AuthoredMaterial { base_color: [0.5, 1.0, 1.0, 1.0], ..matte(1) });
    // The second repetition of its texture, and a vertex that another part uses too.
    add_sheet(&mut head, "body", Vec2::new(3.0, -1.0), Vec2::new(4.0, 0.0), 1);
    head.mesh.parts.push(Part { name: "scarf".into(), material: Material::Other, triangles: 4..5 });
    head.mesh.triangles.push([4, 5, 6]);
    head.authored.of_parts.push(None);
    let before = head.clone();
    let (head, _) = adopted(head);
    let albedo = head.maps.albedo.as_ref().unwrap();
    assert_eq!((albedo.width, albedo.height), (102, 54));
    for t in 0..4 {
        let uv = |head: &Head, corner: usize| head.mesh.vertices[head.mesh.triangles[t][corner] as usize].uv;
        for weights in [[0.6, 0.3, 0.1], [0.2, 0.3, 0.5]] {
            let place = |head: &Head| (0..3).map(|k| weights[k] * uv(head, k)).sum::<Vec2>();
            let (image, factor) = if t < 2 { (&before.authored.images[0], 1.0) } else { (&other, 0.5) };
            let old = place(&before) - place(&before).floor();
            let expected = color_map(image);
            let new = place(&head);
            assert!((0.0..=1.0).contains(&new.x) && (0.0..=1.0).contains(&new.y), "{new}");
            let (found, expected) =
                (albedo.sample(new.x, new.y, 0), factor * expected.sample(old.x, old.y, 0));
            assert!((found - expected).abs() < 1e-4, "triangle {t}: {found} for {expected}");
        }
    }
    let scarf = head.mesh.triangles[4].map(|v| head.mesh.vertices[v as usize].uv);
    assert_eq!(scarf[2], Vec2::new(4.0, 0.0), "the other part stays where it was");
    assert!(head.authored.of_parts.iter().all(Option::is_none));
}

#[test]
fn skin_that_cannot_be_skin_keeps_its_look() {
    let unlit = AuthoredMaterial { is_unlit: true, ..matte(0) };
    let (head, notes) = adopted(one_sheet(unlit.clone(), vec![face(8, 8)]));
    assert_eq!(head.mesh.parts[0].material, Material::Other);
    assert!(says(&notes, "without light") && head.maps.albedo.is_none());
    let mut insisted = one_sheet(unlit, vec![face(8, 8)]);
    adopt(&mut insisted, &Options { insisted: vec![0], ..Options::default() }).unwrap();
    assert!(insisted.mesh.parts[0].material == Material::Skin && insisted.maps.albedo.is_some());

    let mut repeats = one_sheet(matte(0), vec![face(8, 8)]);
    repeats.mesh.vertices[2].uv = Vec2::splat(2.5);
    let (head, notes) = adopted(repeats);
    assert_eq!(head.mesh.parts[0].material, Material::Other);
    assert!(says(&notes, "repeats"));

    // Without a texture there is no colour to keep, and a head of rubor has its own already.
    let plain = AuthoredMaterial { base_color: [0.6, 0.6, 0.8, 1.0], ..AuthoredMaterial::default() };
    let (head, notes) = adopted(one_sheet(plain, Vec::new()));
    assert!(head.maps.albedo.is_none() && says(&notes, "plain colour"));
    let mut own = one_sheet(matte(0), vec![face(8, 8)]);
    own.maps.melanin = Some(Map::filled(1, 1, &[0.1]));
    let (head, notes) = adopted(own);
    assert!(head.maps.albedo.is_none() && notes.is_empty());
    let wrong = Options {
        chromophores: chromophores::Options { gain: Some(0.0), ..Default::default() },
        ..Options::default()
    };
    assert!(adopt(&mut one_sheet(matte(0), vec![face(8, 8)]), &wrong).is_err());
}

#[test]
fn masks_of_skin_keep_their_holes_in_the_atlas() {
    let cut = |alpha: u8| {
        let mut image = face(20, 20);
        image.rgba[4 * 47 + 3] = alpha;
        let material = AuthoredMaterial { alpha: AlphaMode::Mask { cutoff: 0.5 }, ..matte(0) };
        let mut head = one_sheet(material, vec![image]);
        head.authored.materials.push(matte(0));
        add_sheet(&mut head, "body", Vec2::ZERO, Vec2::ONE, 1);
        adopted(head).0
    };
    assert_eq!(cut(200).hole_material(0), None);
    let head = cut(100);
    let material = &head.authored.materials[head.hole_material(0).unwrap() as usize];
    assert_eq!((head.hole_material(1), head.authored_material(0)), (None, None));
    // The material finds the texels of the skin where they now are.
    let texture = material.base_color_texture.unwrap();
    let corners = head.mesh.triangles[0].map(|v| head.mesh.vertices[v as usize].uv);
    let back = corners.map(|uv| texture.transform.matrix().transform_point2(uv));
    assert!(
        back.iter().zip([Vec2::ZERO, Vec2::X, Vec2::ONE]).all(|(a, b)| a.abs_diff_eq(b, 1e-6)),
        "{back:?}"
    );
}

#[test]
fn normal_map_and_roughness_come_along_and_the_rest_is_said() {
    // A slope of 0.5 along u in codes; green 0.5 of a roughness of 0.8.
    let normal = glam::Vec3::new(0.5, 0.0, 1.0).normalize();
    let code = |v: f32| ((0.5 + 0.5 * v) * 255.0).round() as u8;
    let bumps = picture(4, 4, |_| [code(normal.x), code(normal.y), code(normal.z), 255]);
    let gloss = picture(2, 2, |_| [0, 128, 255, 255]);
    let material = AuthoredMaterial {
        normal_texture: texture(1),
        normal_scale: 2.0,
        metallic_roughness_texture: texture(2),
        roughness: 0.8,
        metallic: 1.0,
        emission_linear: [0.1, 0.0, 0.0],
        occlusion_texture: texture(2),
        clearcoat: 0.5,
        specular: 0.7,
        specular_texture: texture(3),
        specular_color: [1.0, 0.5, 0.5],
        ior: 2.0,
        ..matte(0)
    };
    // Alpha 0.2 of a strength of 0.7, with an f0 of 1/9.
    let strength = picture(1, 1, |_| [255, 255, 255, 51]);
    let (head, notes) = adopted(one_sheet(material, vec![face(16, 16), bumps, gloss, strength]));
    let slopes = head.maps.slopes.unwrap();
    assert!(
        (slopes.values[0] - 1.0).abs() < 0.03 && slopes.values[1].abs() < 0.03,
        "{:?}",
        &slopes.values[..2]
    );
    let specular = head.maps.specular.unwrap();
    let [intensity, roughness] = [specular.values[0], specular.values[1]];
    assert!((intensity * SKIN_F0 - 0.2 * 0.7 / 9.0).abs() < 1e-6, "{intensity}");
    assert!((roughness - (0.8f32 * 128.0 / 255.0).powi(2)).abs() < 1e-3, "{roughness}");
    for what in
        ["no metal", "no light", "occlusion maps", "no coat", "of 1.5", "reflections of skin are white"]
    {
        assert!(says(&notes, what), "{what}: {notes:#?}");
    }
    for of in ["albedo", "melanin", "hemoglobin", "slopes", "specular"] {
        assert!(head.provenance.iter().any(|p| p.of == format!("maps.{of}")), "{of}");
    }
}

#[test]
fn stray_texels_of_a_normal_map_are_no_cliffs() {
    // The first texel lies on its side.
    let bumps = picture(4, 4, |i| if i == 0 { [255, 128, 128, 255] } else { [128, 128, 255, 255] });
    let material = AuthoredMaterial { normal_texture: texture(1), ..matte(0) };
    let (head, _) = adopted(one_sheet(material, vec![face(16, 16), bumps]));
    let slopes = head.maps.slopes.unwrap();
    assert_eq!(slopes.values[0], STEEPEST);
}

#[test]
fn colours_of_vertices_are_factors() {
    let mut head = one_sheet(matte(0), vec![picture(16, 16, |_| [255; 4])]);
    head.authored.colors_linear =
        vec![[0.2, 0.4, 0.6, 1.0], [0.6, 0.4, 0.6, 1.0], [0.6, 0.4, 0.6, 1.0], [0.2, 0.4, 0.6, 1.0]];
    let (head, _) = adopted(head);
    let albedo = head.maps.albedo.unwrap();
    for (u, red) in [(0.25, 0.3), (0.5, 0.4), (0.75, 0.5)] {
        let found = [0, 1, 2].map(|c| albedo.sample(u, 0.5, c));
        assert!((found[0] - red).abs() < 0.01 && (found[1] - 0.4).abs() < 1e-3, "{u}: {found:?}");
    }
}
