//! Blood and wrinkles on the device against equation 7.6 and section 8.2 on the CPU.

use rubor_rig::face_state::FaceState;
use rubor_rig::head::{Distribution, Head, WrinkleZone};
use rubor_rig::hemoglobin::blend_texel;
use rubor_rig::map::Map;
use rubor_rig::random;

use crate::channels::Channel;
use crate::settings::{ColorMethod, WrinkleMethod};
use crate::tests::{WHITE_TABLE, dome, draw, lamp, read_texels, renderer, settings};
use crate::{ColorTable, HeadOnGpu, MAX_HEMOGLOBIN, MAX_WRINKLE_MAPS, Renderer, footprint};

const SIZE: usize = 24;

/// A table whose red is the address of hemoglobin, so that an albedo tells the blood that made it.
const ADDRESS_TABLE: ColorTable<'static> = ColorTable {
    width: 2,
    height: 2,
    texels: &[[0.0, 0.5, 0.5], [0.0, 0.5, 0.5], [1.0, 0.5, 0.5], [1.0, 0.5, 0.5]],
};

/// More distributions than the 16 that a rig may blend at once.
fn flushed_dome() -> Head {
    let mut head = dome();
    let flat = |v| Map::filled(4, 4, &[v]);
    head.maps.distributions = (0..20)
        .map(|i| Distribution {
            name: format!("state-{i}"),
            scale: flat(0.3 + 0.15 * i as f32),
            bias: flat(0.004 + 0.006 * i as f32),
        })
        .collect();
    head
}

/// Numbers that look random, 0 to 1.
fn noise(i: usize) -> f32 {
    random::unit(random::mixed(i as u64 + 1)) as f32
}

/// Address of the hemoglobin in the middle of the picture, and all albedos.
fn blood(renderer: &mut Renderer, head: &HeadOnGpu, state: &FaceState) -> (f32, Vec<[f32; 4]>) {
    draw(renderer, head, state, &[], &settings([SIZE as u32; 2])).expect("it draws");
    let albedo = read_texels(renderer, Channel::Albedo);
    (albedo[SIZE / 2 * SIZE + SIZE / 2][0], albedo)
}

#[test]
fn twenty_distributions_blend_as_the_equation_says_and_never_leave_the_range() {
    let Some(mut renderer) = renderer() else { return };
    let head = flushed_dome();
    let on_gpu = HeadOnGpu::new(renderer.gpu(), &head, &ADDRESS_TABLE).expect("the dome uploads");
    // The neutral map is stored as codes of its cube root.
    let neutral = MAX_HEMOGLOBIN * (((0.02f32 / MAX_HEMOGLOBIN).cbrt() * 255.0).round() / 255.0).powi(3);
    let mut state = FaceState::neutral(&head);
    for round in 0..24 {
        let random = |i: usize| noise(round * 100 + i);
        let kind = round % 4;
        let n = state.distributions.len();
        for (i, w) in state.distributions.iter_mut().enumerate() {
            *w = match kind {
                // Weights of a rig: at most 1 together, all of them at once.
                0 | 1 => random(i) / n as f32,
                2 => 8.0 * random(i) - 4.0,
                _ => (random(i) - 0.5) * 10f32.powf(38.0 * random(i + 50)),
            };
        }
        state.hemoglobin_scale = [1.0, 0.81, 1.27, -1.0, 1e30][round % 5];
        let (found, albedo) = blood(&mut renderer, &on_gpu, &state);
        for a in albedo.iter().filter(|a| a[3] > 0.0) {
            assert!((0.0..=1.0).contains(&a[0]), "{a:?} at weights {:?}", state.distributions);
        }
        let parts = state.distributions.iter().zip(&head.maps.distributions);
        let parts = parts.map(|(w, d)| (*w, d.scale.values[0], d.bias.values[0]));
        let expected = blend_texel(neutral, 0.02, parts, state.hemoglobin_scale);
        assert!((0.0..=MAX_HEMOGLOBIN).contains(&expected));
        if kind < 2 {
            // 1/255 of the range; half floats of the sums and of the albedo take a tenth of it.
            let found = MAX_HEMOGLOBIN * found.powi(3);
            assert!((found - expected).abs() < MAX_HEMOGLOBIN / 255.0, "round {round}: {found} {expected}");
        }
    }
}

#[test]
fn neutral_weights_and_static_colour_are_the_neutral_map_bit_for_bit() {
    let Some(mut renderer) = renderer() else { return };
    let head = flushed_dome();
    let mut plain = dome();
    plain.maps.distributions.clear();
    let on_gpu = HeadOnGpu::new(renderer.gpu(), &head, &ADDRESS_TABLE).expect("the dome uploads");
    let without = HeadOnGpu::new(renderer.gpu(), &plain, &ADDRESS_TABLE).expect("the dome uploads");
    let (_, expected) = blood(&mut renderer, &without, &FaceState::neutral(&plain));
    assert_eq!(blood(&mut renderer, &on_gpu, &FaceState::neutral(&head)).1, expected);
    let mut flushed = FaceState::neutral(&head);
    flushed.distributions.fill(0.05);
    flushed.hemoglobin_scale = 1.27;
    assert_ne!(blood(&mut renderer, &on_gpu, &flushed).1, expected);
    let mut still = settings([SIZE as u32; 2]);
    still.quality.color = ColorMethod::Static;
    draw(&mut renderer, &on_gpu, &flushed, &[], &still).expect("it draws");
    assert_eq!(read_texels(&renderer, Channel::Albedo), expected);
}

#[test]
fn the_last_of_many_wrinkle_maps_shows_as_an_only_one_does() {
    let Some(mut renderer) = renderer() else { return };
    let s = settings([48, 48]);
    let frown =
        |head: &Head, weights: &[f32]| FaceState { zones: weights.to_vec(), ..FaceState::neutral(head) };
    let one = dome();
    let mut many = dome();
    let flat = Map::filled(8, 8, &[-0.7, 0.4]);
    many.maps.wrinkle_slopes = vec![flat; MAX_WRINKLE_MAPS - 1];
    many.maps.wrinkle_slopes.push(one.maps.wrinkle_slopes[0].clone());
    let zone = |i: usize| WrinkleZone {
        name: format!("zone-{i}"),
        wrinkle_map: i as u32,
        mask: Map::filled(2, 2, &[1.0]),
    };
    many.maps.zones = (0..MAX_WRINKLE_MAPS).map(zone).collect();
    let mut weights = vec![0.0; MAX_WRINKLE_MAPS];
    weights[MAX_WRINKLE_MAPS - 1] = 0.8;
    let one_on_gpu = HeadOnGpu::new(renderer.gpu(), &one, &WHITE_TABLE).expect("the dome uploads");
    let many_on_gpu = HeadOnGpu::new(renderer.gpu(), &many, &WHITE_TABLE).expect("the dome uploads");
    let mut picture = |head: &HeadOnGpu, state: &FaceState| {
        draw(&mut renderer, head, state, &[lamp()], &s).expect("it draws").rgba
    };
    let expected = picture(&one_on_gpu, &frown(&one, &[0.8]));
    assert_eq!(picture(&many_on_gpu, &frown(&many, &weights)), expected);
    weights[5] = 0.5;
    assert_ne!(picture(&many_on_gpu, &frown(&many, &weights)), expected);
    many.maps.wrinkle_slopes.push(Map::filled(1, 1, &[0.0, 0.0]));
    assert!(HeadOnGpu::new(renderer.gpu(), &many, &WHITE_TABLE).is_err());
}

#[test]
fn both_wrinkle_encodings_agree_where_slopes_are_small() {
    let Some(mut renderer) = renderer() else { return };
    let mut picture = |slope: f32, weight: f32, method: WrinkleMethod| {
        let mut head = dome();
        head.maps.slopes = Some(Map::filled(8, 8, &[0.1, -0.05]));
        head.maps.wrinkle_slopes = vec![Map::filled(8, 8, &[slope, 0.3 * slope])];
        let on_gpu = HeadOnGpu::new(renderer.gpu(), &head, &WHITE_TABLE).expect("the dome uploads");
        let state = FaceState { zones: vec![weight], ..FaceState::neutral(&head) };
        let mut s = settings([48, 48]);
        s.quality.wrinkles = method;
        draw(&mut renderer, &on_gpu, &state, &[lamp()], &s).expect("it draws").rgba
    };
    let largest = |a: &[u8], b: &[u8]| a.iter().zip(b).map(|(a, b)| a.abs_diff(*b)).max();
    let none = picture(0.08, 1.0, WrinkleMethod::None);
    let slopes = picture(0.08, 1.0, WrinkleMethod::PartialDerivative);
    let differences = picture(0.08, 1.0, WrinkleMethod::Difference);
    assert_eq!(picture(0.08, 0.0, WrinkleMethod::PartialDerivative), none);
    // A normal that is taken apart and put together again is rounded.
    assert!(largest(&picture(0.08, 0.0, WrinkleMethod::Difference), &none) <= Some(1));
    assert!(largest(&slopes, &none) > Some(4), "the wrinkle shows: {:?}", largest(&slopes, &none));
    assert!(largest(&slopes, &differences) <= Some(2), "{:?}", largest(&slopes, &differences));
    // Beyond 45 degrees slopes still add; the difference of normals is bounded.
    let steep = [WrinkleMethod::PartialDerivative, WrinkleMethod::Difference].map(|m| picture(2.5, 1.0, m));
    assert!(largest(&steep[0], &none) > Some(20) && largest(&steep[1], &none) > Some(20));
}

#[test]
fn the_footprint_is_what_the_device_holds() {
    let Some(renderer) = renderer() else { return };
    let mut head = flushed_dome();
    head.maps.slopes = Some(Map::filled(33, 17, &[0.1, 0.0]));
    head.maps.wrinkle_slopes.push(Map::filled(16, 16, &[0.1, 0.0]));
    let on_gpu = HeadOnGpu::new(renderer.gpu(), &head, &WHITE_TABLE).expect("the dome uploads");
    let listed: u64 = footprint::of_maps(&head.maps).iter().map(|f| f.bytes).sum();
    assert_eq!(listed, on_gpu.map_bytes());
}
