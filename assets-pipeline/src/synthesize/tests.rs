//! The maps as a whole, on a made-up head: a cylinder with canonical landmarks and a texture cut down its front.

use std::io::Write;
use std::sync::LazyLock;

use glam::{Vec2, Vec3};
use rubor_rig::deform::{point_normals, vertex_tangents};
use rubor_rig::head::{Head, MM_PER_METRE, Material, Mesh, Part, Vertex};
use rubor_rig::map::Map;

use super::face_space::{canonical, plan};
use super::*;

/// Radius of the cylinder, mm.
const RADIUS_MM: f32 = 85.0;
/// Columns of the front patch; its two halves are separate islands, the right one turned by a quarter.
const COLUMNS: usize = 48;
const ROWS: usize = 48;

/// Places every landmark of the canonical face on the head; on the cylinder they need not touch the skin.
pub(super) fn landmarks(head: &mut Head) {
    for name in rubor_rig::landmarks::MIDDLE {
        head.landmarks.insert(name.into(), canonical(name) / MM_PER_METRE);
    }
    for name in rubor_rig::landmarks::PAIRED.into_iter().filter(|n| *n != "eye") {
        let c = canonical(name) / MM_PER_METRE;
        head.landmarks.insert(format!("{name}-left"), c);
        head.landmarks.insert(format!("{name}-right"), c * Vec3::new(-1.0, 1.0, 1.0));
    }
}

/// The front half of a cylinder, cut along the middle plane: left half upright, right half turned in the texture.
fn head() -> Head {
    let mut mesh = Mesh::default();
    for j in 0..=ROWS {
        for i in 0..=2 * COLUMNS {
            let angle = (i as f32 / COLUMNS as f32 - 1.0) * 1.3;
            let y = 85.0 - 215.0 * j as f32 / ROWS as f32;
            let p = Vec3::new(RADIUS_MM * angle.sin(), y, RADIUS_MM * angle.cos());
            mesh.points.push(p / MM_PER_METRE);
        }
    }
    for half in 0..2 {
        let first = mesh.vertices.len() as u32;
        for j in 0..=ROWS {
            for i in 0..=COLUMNS {
                let (a, b) = (i as f32 / COLUMNS as f32, j as f32 / ROWS as f32);
                let uv = if half == 1 {
                    Vec2::new(0.53 + 0.45 * a, 0.02 + 0.96 * b)
                } else {
                    // Turned: the middle line lies along the top of the island.
                    Vec2::new(0.02 + 0.45 * (1.0 - b), 0.98 - 0.94 * a)
                };
                let point = (j * (2 * COLUMNS + 1) + half * COLUMNS + i) as u32;
                mesh.vertices.push(Vertex { point, uv });
            }
        }
        let at = |i: usize, j: usize| first + (j * (COLUMNS + 1) + i) as u32;
        for j in 0..ROWS {
            for i in 0..COLUMNS {
                mesh.triangles.push([at(i, j), at(i, j + 1), at(i + 1, j + 1)]);
                mesh.triangles.push([at(i, j), at(i + 1, j + 1), at(i + 1, j)]);
            }
        }
    }
    let triangles = 0..mesh.triangles.len() as u32;
    mesh.parts.push(Part { name: "skin".into(), material: Material::Skin, triangles });
    let mut head = Head { name: "cylinder".into(), mesh, ..Head::default() };
    landmarks(&mut head);
    head
}

fn options(resolution: u32) -> Options {
    Options { resolution, ..Options::default() }
}

/// The head with its maps at 512 texels, made once for all tests that only look.
fn made() -> &'static Head {
    static MADE: LazyLock<Head> = LazyLock::new(|| {
        let mut head = head();
        synthesize_into(&mut head, &options(512)).unwrap();
        head
    });
    &MADE
}

/// The vertex of each half at row `j` of the middle line.
fn seam(j: usize) -> [usize; 2] {
    let right = j * (COLUMNS + 1) + COLUMNS;
    let left = (ROWS + 1) * (COLUMNS + 1) + j * (COLUMNS + 1);
    [right, left]
}

/// Mean over a disc of places on the plan, found through the vertices of the mesh.
fn mean_about(head: &Head, map: &Map, place: Vec3, radius_mm: f32) -> f32 {
    let target = plan(place);
    let near: Vec<f32> = head
        .mesh
        .vertices
        .iter()
        .filter(|v| plan(head.mesh.points[v.point as usize] * MM_PER_METRE).distance(target) < radius_mm)
        .map(|v| map.sample(v.uv.x, v.uv.y, 0))
        .collect();
    assert!(!near.is_empty());
    near.iter().sum::<f32>() / near.len() as f32
}

#[test]
fn maps_are_valid_in_range_and_labelled() {
    let head = made();
    head.validate().unwrap();
    let maps = &head.maps;
    let melanin = maps.melanin.as_ref().unwrap();
    assert_eq!((melanin.width, melanin.height), (512, 512));
    assert!(melanin.values.iter().all(|v| (0.0..=0.5).contains(v)));
    assert!(maps.hemoglobin.as_ref().unwrap().values.iter().all(|v| (0.0..=0.32).contains(v)));
    assert!(maps.scattering.as_ref().unwrap().values.iter().all(|v| (0.0..=1.0).contains(v)));
    for s in maps.specular.as_ref().unwrap().values.chunks(2) {
        assert!((0.0..=1.0).contains(&s[0]) && (0.15..=0.5).contains(&s[1]), "{s:?}");
    }
    assert!(maps.zones.len() == 12 && maps.distributions.len() == 9 && maps.hemoglobin_mean.is_some());
    for zone in &maps.zones {
        assert!(zone.mask.values.iter().all(|v| (0.0..=1.0).contains(v)));
        assert!(zone.mask.values.iter().any(|v| *v > 0.9), "zone {} has no core", zone.name);
    }
    // Slopes stay where a partial-derivative normal has precision (45 degrees is 1), pores give them life.
    let slopes = &maps.slopes.as_ref().unwrap().values;
    let rms = (slopes.iter().map(|s| s * s).sum::<f32>() / slopes.len() as f32).sqrt();
    assert!((0.01..0.3).contains(&rms), "{rms}");
    let maps_of: Vec<_> = head.provenance.iter().filter(|p| p.of.starts_with("maps.")).collect();
    assert!(maps_of.len() == 8 && maps_of.iter().all(|p| p.kind == ProvenanceKind::Synthesised));
}

#[test]
fn the_same_input_gives_the_same_maps_on_any_number_of_threads() {
    let head = head();
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| synthesize(&head, &options(256)).unwrap())
    };
    let one = on(1);
    assert!(one == on(3));
    assert!(one != synthesize(&head, &Options { seed: 2, ..options(256) }).unwrap());
}

#[test]
fn values_agree_across_a_texture_border() {
    let head = made();
    let maps = &head.maps;
    let uv = |v: usize| head.mesh.vertices[v].uv;
    let specular = maps.specular.as_ref().unwrap();
    let scalars: [(&str, &Map); 5] = [
        ("melanin", maps.melanin.as_ref().unwrap()),
        ("hemoglobin", maps.hemoglobin.as_ref().unwrap()),
        ("scattering", maps.scattering.as_ref().unwrap()),
        ("specular", specular),
        ("chin", &maps.zones[7].mask),
    ];
    for (name, map) in scalars {
        let (mut across, mut away, mut size) = (0.0f32, 0.0f32, 0.0f32);
        for j in 2..ROWS - 2 {
            let [right, left] = seam(j);
            let at = |v: usize| map.sample(uv(v).x, uv(v).y, 0);
            across += (at(right) - at(left)).abs();
            // A step of one column (2.3 mm) and of one row (4.5 mm) of the mesh on one side: what change within the
            // skin looks like.
            away += (at(left) - at(left + 1)).abs() + (at(left) - at(seam(j + 1)[1])).abs();
            size += at(left).abs();
        }
        assert!(
            across < 0.25 * away + 1e-3 * size,
            "{name}: {across} across the border, {away} beside it, of {size}"
        );
    }
    // Slopes live in frames that differ by a quarter turn; the displaced normals must agree.
    let points = &head.mesh.points;
    let normals = point_normals(&head.mesh, points);
    let tangents = vertex_tangents(&head.mesh, points, &normals);
    // Pores and grooves are three texels wide here, so a bilinear fetch differs with where the texels fall; two unrelated sides
    // would differ by 1.4 times their size. The next test asks for equality before the texels.
    for (map, bound) in [(maps.slopes.as_ref().unwrap(), 0.75), (&maps.wrinkle_slopes[0], 0.6)] {
        let (mut across, mut size) = (0.0, 0.0);
        for j in 2..ROWS - 2 {
            let [right, left] = seam(j);
            let tilt = |v: usize| {
                let n = normals[head.mesh.vertices[v].point as usize];
                let t = tangents[v];
                let b = t.w * n.cross(t.truncate());
                let [x, y] = [0, 1].map(|c| map.sample(uv(v).x, uv(v).y, c));
                t.truncate() * x + b * y
            };
            across += tilt(right).distance(tilt(left));
            size += tilt(left).length();
        }
        assert!(across < bound * size, "slopes differ by {across} of {size}");
    }
}

#[test]
fn both_sides_of_a_border_are_the_same_place_with_the_same_tilt() {
    let head = head();
    let surface = SkinSurface::new(&head, &FaceSpace::fit(&head));
    let coverage = surface.rasterise(256);
    let relief = Relief::new(1, 0.2, 30.0);
    let wrinkles = Wrinkles::new(1);
    let points = &head.mesh.points;
    let normals = point_normals(&head.mesh, points);
    let tangents = vertex_tangents(&head.mesh, points, &normals);
    for j in 3..ROWS - 3 {
        let [right, left] = seam(j).map(|v| {
            let vertex = head.mesh.vertices[v];
            let site = coverage.site_near(vertex.uv).unwrap();
            let relief = relief.sample(&site, &Regions::at(site.place));
            let [x, y] = site.slopes(relief.gradient + wrinkles.gradient(site.place));
            let t = tangents[v];
            let b = t.w * normals[vertex.point as usize].cross(t.truncate());
            (site.place, t.truncate() * x + b * y)
        });
        assert!(right.0.distance(left.0) < 2e-3, "places {} and {}", right.0, left.0);
        assert!(right.1.distance(left.1) < 0.02, "tilts {} and {} at {}", right.1, left.1, right.0);
    }
}

#[test]
fn hemoglobin_is_locally_near_gaussian() {
    let maps = &made().maps;
    let map = maps.hemoglobin.as_ref().unwrap();
    for (name, s, y) in
        [("cheek", 42.0, -32.0), ("forehead", 18.0, 55.0), ("jaw", 45.0, -75.0), ("chin", 4.0, -104.0)]
    {
        // Texels of the upright half within 7 mm: there uv is linear in plan coordinates.
        let mut values = Vec::new();
        for i in -40..=40 {
            for j in -40..=40 {
                let (ds, dy) = (i as f32 * 0.175, j as f32 * 0.175);
                if ds * ds + dy * dy < 49.0 {
                    let angle = (s + ds) / super::face_space::PLAN_RADIUS_MM;
                    let (a, b) = (angle / 1.3, (85.0 - y - dy) / 215.0);
                    values.push(f64::from(map.sample(0.53 + 0.45 * a, 0.02 + 0.96 * b, 0)));
                }
            }
        }
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let moment = |k: i32| values.iter().map(|v| (v - mean).powi(k)).sum::<f64>() / n;
        let skewness = moment(3) / moment(2).powf(1.5);
        let kurtosis = moment(4) / moment(2).powi(2);
        println!(
            "{name}: mean {mean:.4} deviation {:.5} skewness {skewness:.2} kurtosis {kurtosis:.2}",
            moment(2).sqrt()
        );
        assert!(skewness.abs() < 0.8, "{name}: skewness {skewness}");
        assert!((2.0..4.6).contains(&kurtosis), "{name}: kurtosis {kurtosis}");
    }
}

#[test]
fn regions_are_coloured_as_a_face_is() {
    let head = made();
    let maps = &head.maps;
    let hemoglobin = maps.hemoglobin.as_ref().unwrap();
    let red = |c: Vec3| mean_about(head, hemoglobin, c, 5.0);
    let forehead = red(Vec3::new(0.0, 55.0, 85.0));
    let cheek = red(canonical("cheek"));
    let lips = mean_about(head, hemoglobin, Vec3::new(0.0, -76.0, 96.0), 3.0);
    assert!(cheek > 1.3 * forehead, "cheek {cheek}, forehead {forehead}");
    assert!(lips > 1.8 * cheek, "lips {lips}, cheek {cheek}");
    assert!(red(canonical("alare")) > 1.1 * forehead);
    let hair = |c: Vec3| mean_about(head, maps.hair.as_ref().unwrap(), c, 4.0);
    let (brow, skin) = (hair(canonical("brow-middle")), hair(Vec3::new(0.0, 50.0, 86.0)));
    assert!(brow > 0.3 && skin < 0.02, "brow {brow}, skin {skin}");
    let scattering = maps.scattering.as_ref().unwrap();
    assert!(mean_about(head, scattering, canonical("brow-middle"), 4.0) < 0.85);
    let specular = maps.specular.as_ref().unwrap();
    let shine = |c: Vec3| mean_about(head, specular, c, 5.0);
    assert!(shine(Vec3::new(0.0, 55.0, 85.0)) > shine(Vec3::new(50.0, -70.0, 54.0)), "the T-zone is oily");
}

#[test]
fn states_move_blood_as_measured() {
    let head = made();
    let maps = &head.maps;
    let ratio = |state: &str, c: Vec3| {
        let of = maps.distributions.iter().find(|d| d.name == state).unwrap();
        let neutral = mean_about(head, maps.hemoglobin_mean.as_ref().unwrap(), c, 6.0);
        mean_about(head, &of.bias, c, 6.0) / neutral
    };
    let (cheek_bone, cheek) = (Vec3::new(52.0, -20.0, 60.0), canonical("cheek"));
    let (forehead, nose) = (Vec3::new(0.0, 55.0, 85.0), canonical("pronasale"));
    let mouth = Vec3::new(0.0, -66.0, 97.0);
    // Section 7.3.1, observation 2: a smile gathers blood over the cheek bones and drains other places.
    assert!(ratio("joy", cheek_bone) > 1.15, "{}", ratio("joy", cheek_bone));
    assert!(ratio("joy", mouth) < 0.95);
    assert!(ratio("fear", cheek) < 0.8 && ratio("fear", mouth) < 0.8);
    assert!(ratio("anger", forehead) > 1.2 && ratio("blush", cheek) > 1.6);
    // Observation 5: exercise and alcohol differ in pattern, not by a factor.
    let exercise = ratio("exercise", forehead) / ratio("exercise", nose);
    let alcohol = ratio("alcohol", forehead) / ratio("alcohol", nose);
    assert!(exercise > 1.2 && alcohol < 0.9, "exercise {exercise}, alcohol {alcohol}");
    for d in &maps.distributions {
        assert!(d.scale.values.iter().all(|s| (0.05..6.0).contains(s)), "{} has an odd scale", d.name);
        assert!(d.bias.values.iter().all(|b| (0.0..0.32).contains(b)), "{} has an odd bias", d.name);
    }
}

#[test]
fn full_weight_of_a_state_reaches_its_mean() {
    let head = made();
    let maps = &head.maps;
    let index = maps.distributions.iter().position(|d| d.name == "alcohol").unwrap();
    let mut weights = vec![0.0; maps.distributions.len()];
    weights[index] = 1.0;
    let neutral = maps.hemoglobin.as_ref().unwrap();
    let blended = rubor_rig::hemoglobin::blend(
        neutral,
        maps.hemoglobin_mean.as_ref().unwrap(),
        &maps.distributions,
        &weights,
        1.0,
    );
    let cheek = Vec3::new(45.0, -34.0, 72.0);
    let (found, wanted) = (
        mean_about(head, &blended, cheek, 8.0),
        mean_about(head, &maps.distributions[index].bias, cheek, 8.0),
    );
    assert!((found / wanted - 1.0).abs() < 0.06, "{found} is not {wanted}");
}

#[test]
fn relief_has_its_depth_in_millimetres_on_a_head_of_any_size() {
    let wrinkle_slope = |scale: f32| {
        let mut head = head();
        head.mesh.points.iter_mut().for_each(|p| *p *= scale);
        head.landmarks.values_mut().for_each(|p| *p *= scale);
        let maps = synthesize(&head, &options(256)).unwrap();
        let map = &maps.wrinkle_slopes[0];
        map.values.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>().sqrt()
    };
    // A head twice as large has wrinkles twice as wide and just as deep, so half as steep.
    let ratio = wrinkle_slope(2.0) / wrinkle_slope(1.0);
    assert!((ratio - 0.5).abs() < 0.02, "{ratio}");
}

#[test]
fn heads_without_landmarks_or_with_broken_triangles_get_maps() {
    let mut head = head();
    head.landmarks.clear();
    head.mesh.vertices[5].uv = Vec2::new(7.0, -3.0);
    head.mesh.triangles[9] = [3, 3, 3];
    assert!(!finds_face(&head));
    synthesize_into(&mut head, &options(256)).unwrap();
    head.validate().unwrap();
    // Their places would be guesses.
    assert!(head.maps.zones.is_empty() && head.maps.wrinkle_slopes.is_empty());
    assert!(head.maps.hair.as_ref().unwrap().values.iter().all(|t| *t == 0.0));
    assert!(!head.maps.distributions.is_empty());
}

#[test]
fn wrong_options_and_heads_are_refused() {
    let refuse = |o: Options| synthesize(&head(), &o).unwrap_err();
    assert_eq!(refuse(options(100)), SynthesizeError::Resolution { found: 100 });
    assert_eq!(refuse(options(8192)), SynthesizeError::Resolution { found: 8192 });
    let error = refuse(Options { melanin: f32::NAN, ..options(256) });
    assert!(matches!(error, SynthesizeError::Option { option: "melanin", .. }), "{error}");
    assert!(matches!(
        refuse(Options { brows: -1.0, ..options(256) }),
        SynthesizeError::Option { option: "brows", .. }
    ));
    let error = synthesize(&Head { name: "bald".into(), ..Head::default() }, &options(256)).unwrap_err();
    assert!(matches!(&error, SynthesizeError::NoSkin { head } if head == "bald"), "{error}");
}

#[test]
fn relief_and_shine_are_calm_beside_the_t_zone() {
    // Root mean square of slopes in a box of places, as a map of 4096 texels holds them.
    let head = head();
    let surface = SkinSurface::new(&head, &FaceSpace::fit(&head));
    let site = surface.rasterise(256).site(190, 128).unwrap();
    let relief = Relief::new(1, 0.19, 30.0);
    let rms = |middle: Vec3| {
        let mut sum = 0.0;
        for i in 0..600 {
            let f = |k: i32| ((i * k) % 601) as f32 / 60.1 - 5.0;
            let place = middle + Vec3::new(0.0, f(37), f(211));
            let r = Regions::at(place);
            let mut here = site;
            (here.place, here.normal) = (place, Vec3::X);
            sum += relief.sample(&here, &r).gradient.length_squared();
        }
        (sum / 600.0).sqrt()
    };
    let (cheek, ear) = (rms(Vec3::new(60.0, -40.0, 50.0)), rms(Vec3::new(88.0, -22.0, -24.0)));
    let neck = rms(Vec3::new(50.0, -130.0, 10.0));
    assert!(ear < 0.3 * cheek, "ear {ear}, cheek {cheek}");
    assert!(neck < 0.8 * cheek, "neck {neck}, cheek {cheek}");
    let shine = |c: Vec3| specular::specular(c, &Regions::at(c), 0.0, 0.0, 1);
    let (middle, temple) = (shine(Vec3::new(0.0, 50.0, 86.0)), shine(Vec3::new(66.0, 24.0, 40.0)));
    assert!(temple[0] < 0.75 * middle[0] && temple[1] > middle[1] + 0.04, "{temple:?} {middle:?}");
}

#[test]
fn the_ears_of_every_character_are_bald() {
    let Ok(data) = std::env::var("RUBOR_MAKEHUMAN") else {
        writeln!(std::io::stderr(), "SKIPPED: RUBOR_MAKEHUMAN is not set, no character was built")
            .expect("stderr is open");
        return;
    };
    for character in &crate::import::makehuman::CHARACTERS {
        let mut geometry = character.head();
        (geometry.data, geometry.subdivide, geometry.occlusion_rays) = (data.clone().into(), 0, 0);
        let head = crate::import::makehuman::import(&geometry).unwrap();
        let space = FaceSpace::fit(&head);
        let hairs = Hairs::new(&Options { scalp_hair: 1.0, stubble: 0.0, ..options(512) }, 0.7);
        let skin = head.mesh.parts.iter().find(|p| p.material == Material::Skin).unwrap();
        let (mut ear, mut scalp) = (0, 0);
        for v in
            head.mesh.triangles[skin.triangles.start as usize..skin.triangles.end as usize].iter().flatten()
        {
            let c = space.warp(head.mesh.points[head.mesh.vertices[*v as usize].point as usize]);
            let cover = hairs.cover(c, &Regions::at(c));
            // At the height of the ears, points that stand out from the head are ear; points 5 to 20 mm above them are
            // scalp.
            if c.x.abs() > 84.0 && c.y < 2.0 && c.y > -54.0 {
                ear += 1;
                assert!(cover < 0.1, "{}: {cover} of the ear is covered at {c}", character.name);
            } else if (8.0..22.0).contains(&c.y) && (-50.0..-8.0).contains(&c.z) {
                scalp += 1;
                assert!(cover > 0.5, "{}: {cover} of the scalp is covered at {c}", character.name);
            }
        }
        assert!(ear > 200 && scalp > 20, "{}: {ear} corners of the ears, {scalp} above them", character.name);
    }
}
