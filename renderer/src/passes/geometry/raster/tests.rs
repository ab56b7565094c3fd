//! Against areas in exact integers, and whole frames against the raster units of the device.

use glam::{Mat4, Vec3};
use rubor_rig::face_state::FaceState;
use rubor_rig::head::{Head, Material, Mesh, Part, Vertex};
use rubor_rig::random::SplitMix64;

use super::*;
use crate::channels::Channel;
use crate::passes::geometry::visibility::Visibility;
use crate::scene::posed_head::{Instance, posed};
use crate::scene::view::View;
use crate::settings::RasterMethod;
use crate::testing::{assert_layout, assert_workgroups, gpu, offsets, read_image, recorded};
use crate::tests::{WHITE_TABLE, dome, lamp, read, render, renderer, settings};
use crate::{Camera, HeadInstance, HeadOnGpu, Image as Picture, Renderer, Scene};

const SIGHTS: [Sight; 3] = [Sight::Camera { wide: true }, Sight::Camera { wide: false }, Sight::Lights];

#[test]
fn shaders_are_valid_and_their_structs_are_those_of_rust() {
    for sight in SIGHTS {
        for (cut, second) in [(false, false), (true, false), (false, true), (true, true)] {
            if second && sight != (Sight::Camera { wide: false }) {
                continue;
            }
            let program = program(sight, cut, second);
            assert_workgroups(
                &program,
                &[("raster_each", [64, 1, 1]), ("raster_large", [64, 1, 1]), ("raster_rest", [64, 1, 1])],
            );
        }
        assert_workgroups(&resolve_program(sight), &[("raster_resolve", [8, 8, 1])]);
    }
    assert_layout(
        &program(Sight::Lights, false, false),
        "raster_each",
        "Draw",
        size_of::<DrawParams>(),
        &offsets!(DrawParams; size as "size", first as "first", count as "count", head as "head"),
    );
    assert_layout(
        &resolve_program(Sight::Lights),
        "raster_resolve",
        "Resolve",
        size_of::<ResolveParams>(),
        &offsets!(ResolveParams; size as "size", layers as "layers"),
    );
}

/// Triangles in a picture, corners in 1/256 of a pixel, each at a depth of its own.
fn scattered(
    size: [u32; 2],
    count: usize,
    reach: usize,
    random: &mut SplitMix64,
) -> Vec<([[i64; 2]; 3], f32)> {
    (0..count)
        .map(|_| {
            let middle = size.map(|n| random.below(256 * n as usize) as i64);
            let corner = |random: &mut SplitMix64| {
                middle.map(|m| m + random.below(2 * reach + 1) as i64 - reach as i64)
            };
            let depth = (1 + random.below(1 << 16)) as f32 / (1 << 17) as f32;
            ([corner(random), corner(random), corner(random)], depth)
        })
        .collect()
}

/// A strip of triangles that share edges, corners on pixel centres and edges through them.
fn grid(size: [u32; 2]) -> Vec<([[i64; 2]; 3], f32)> {
    let step = 3 * 256;
    let at = |x: i64, y: i64| [128 + x * step, 128 + y * step];
    let mut triangles = Vec::new();
    for y in 0..i64::from(size[1]) / 3 {
        for x in 0..i64::from(size[0]) / 3 {
            triangles.push(([at(x, y), at(x + 1, y), at(x + 1, y + 1)], 0.5));
            triangles.push(([at(x, y), at(x, y + 1), at(x + 1, y + 1)], 0.5));
        }
    }
    triangles
}

/// Number of the nearest triangle plus one in each pixel, by areas in 64 bits.
fn expected(size: [u32; 2], triangles: &[([[i64; 2]; 3], f32)]) -> Vec<u32> {
    let mut nearest = vec![(0.0f32, 0u32); (size[0] * size[1]) as usize];
    for (number, (corners, depth)) in triangles.iter().enumerate() {
        let [a, mut b, mut c] = *corners;
        let area = |p: [i64; 2], q: [i64; 2], r: [i64; 2]| {
            (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])
        };
        if area(a, b, c) < 0 {
            (b, c) = (c, b);
        }
        if area(a, b, c) == 0 {
            continue;
        }
        for y in 0..size[1] {
            for x in 0..size[0] {
                let center = [i64::from(x) * 256 + 128, i64::from(y) * 256 + 128];
                let is_within = [[a, b], [b, c], [c, a]].iter().all(|[p, q]| {
                    let way = [q[0] - p[0], q[1] - p[1]];
                    let owns = way[1] < 0 || (way[1] == 0 && way[0] > 0);
                    area(*p, *q, center) > if owns { -1 } else { 0 }
                });
                let pixel = &mut nearest[(y * size[0] + x) as usize];
                if is_within && *depth > pixel.0 {
                    *pixel = (*depth, number as u32 + 1);
                }
            }
        }
    }
    nearest.into_iter().map(|(_, number)| number).collect()
}

/// A head of loose triangles whose places and depths are those in clip space.
fn loose(size: [u32; 2], triangles: &[([[i64; 2]; 3], f32)]) -> Head {
    let mut mesh = Mesh::default();
    for (corners, depth) in triangles {
        let first = mesh.vertices.len() as u32;
        for corner in corners {
            let ndc = |i: usize| 2.0 * (corner[i] as f64 / (256.0 * f64::from(size[i]))) - 1.0;
            let point = mesh.points.len() as u32;
            mesh.points.push(Vec3::new(ndc(0) as f32, -ndc(1) as f32, *depth));
            mesh.vertices.push(Vertex { point, uv: glam::Vec2::ZERO });
        }
        mesh.triangles.push([first, first + 1, first + 2]);
    }
    let end = mesh.triangles.len() as u32;
    mesh.parts.push(Part { name: "skin".into(), material: Material::Skin, triangles: 0..end });
    Head { name: "loose".into(), mesh, ..Head::default() }
}

/// Ids and depths of a head whose points are in clip space.
fn seen(gpu: &Gpu, head: &Head, size: [u32; 2], rasteriser: Rasteriser) -> (Vec<u32>, Vec<f32>) {
    let on_gpu = HeadOnGpu::new(gpu, head, &WHITE_TABLE).expect("the triangles upload");
    let state = FaceState::neutral(head);
    let placed = [HeadInstance { head: &on_gpu, state: &state, world_from_head: Mat4::IDENTITY }];
    let scene = Scene {
        heads: &placed,
        camera: Camera { position: Vec3::Z, target: Vec3::ZERO, up: Vec3::Y, fov_degrees: 20.0 },
        lights: &[],
        environment: None,
        environment_rotation: 0.0,
        environment_intensity: 0.0,
        background_linear: Vec3::ZERO,
        optics: Default::default(),
    };
    let instances = [Instance::new(gpu, &on_gpu)];
    let points: Vec<[f32; 4]> = head.mesh.points.iter().map(|p| p.extend(1.0).to_array()).collect();
    gpu.queue.write_buffer(&instances[0].positions, 0, bytemuck::cast_slice(&points));
    let heads = posed(&scene, &instances, false);
    let mut view: View = bytemuck::Zeroable::zeroed();
    view.clip_from_world = Mat4::IDENTITY;
    view.size = size;
    let view = gpu.uniform("view", &view);
    let mut pass = Visibility::new(gpu, rasteriser);
    pass.prepare(gpu, size, 1, false);
    // Twice: the keys of the first frame are gone in the second.
    let draw = || {
        let [ids, depth] = recorded(gpu, |r| pass.record(r, &view, &heads, size));
        (read_image::<u32>(gpu, &ids), read_image::<f32>(gpu, &depth))
    };
    let first = draw();
    assert_eq!(first, draw(), "frames repeat");
    first
}

/// Both widths of atomics, as far as the device has them.
fn rasterisers(gpu: &Gpu) -> Vec<Rasteriser> {
    let mut all = vec![Rasteriser::Compute { wide: false }];
    match Rasteriser::compute(gpu) {
        Rasteriser::Compute { wide: true } => all.push(Rasteriser::Compute { wide: true }),
        _ => crate::testing::skipped("this device has no 64-bit atomics"),
    }
    all
}

#[test]
fn pixels_belong_to_the_triangles_of_exact_areas() {
    let Some(gpu) = gpu() else { return };
    let mut random = SplitMix64(7);
    // Sides are powers of two so that places in steps survive the way through clip space.
    let size = [128, 64];
    let mut all = vec![grid(size)];
    for (count, reach) in [(400, 3 * 256), (60, 40 * 256), (8, 300 * 256), (300, 300)] {
        all.push(scattered(size, count, reach, &mut random));
    }
    let mut all: Vec<_> = all.into_iter().map(|triangles| (size, triangles)).collect();
    // More large triangles than the list holds.
    let small = [16, 8];
    all.push((small, scattered(small, LARGE_CAPACITY as usize + 20_000, 200 * 256, &mut random)));
    for (size, triangles) in &all {
        let (size, expected) = (*size, expected(*size, triangles));
        for rasteriser in rasterisers(gpu) {
            let (ids, depths) = seen(gpu, &loose(size, triangles), size, rasteriser);
            let wrong = ids.iter().zip(&expected).filter(|(a, b)| a != b).count();
            assert_eq!(wrong, 0, "{rasteriser:?}, {} triangles: of {} pixels", triangles.len(), ids.len());
            for (id, depth) in ids.iter().zip(depths) {
                let expected = if *id == 0 { 0.0 } else { triangles[*id as usize - 1].1 };
                assert!((depth - expected).abs() <= 1e-6, "{depth} {expected}");
            }
        }
    }
}

const SIDE: u32 = 96;

/// A picture, ids and depths of a frame.
struct Frame {
    picture: Picture,
    ids: Vec<u32>,
    depths: Vec<f32>,
}

fn frame(renderer: &mut Renderer, scene: &Scene<'_>, method: RasterMethod) -> Frame {
    let mut settings = settings([SIDE; 2]);
    settings.quality.raster = method;
    let (picture, _) = render(renderer, scene, &settings).expect("it draws");
    let ids = read(renderer, Channel::Ids).values.into_iter().map(f32::to_bits).collect();
    Frame { picture, ids, depths: read(renderer, Channel::Depth).values }
}

/// Share of pixels with another triangle, and mean difference of the channels of the picture. Where the triangle is the
/// same, so is its depth, up to rounding and to the change of depth over 1/128 of a pixel each way: both round corners
/// to 1/256. On outlines the neighbours do not tell how steep a triangle is.
fn difference(a: &Frame, b: &Frame) -> (f64, f64) {
    let side = SIDE as usize;
    let mut beyond = 0;
    for i in 0..side * side {
        if a.ids[i] != b.ids[i] {
            continue;
        }
        let depth = a.depths[i];
        let change = |n: Option<&f32>| n.filter(|d| **d > 0.0).map_or(0.0, |d| (d - depth).abs());
        let across = change(a.depths.get(i + 1)).max(change(a.depths.get(i.wrapping_sub(1))));
        let down = change(a.depths.get(i + side)).max(change(a.depths.get(i.wrapping_sub(side))));
        let bound = 1e-5 * depth + (across + down) / 128.0;
        let apart = (depth - b.depths[i]).abs();
        beyond += usize::from(apart > bound);
        assert!(apart <= 2e-3 * depth, "{depth} {} in pixel {i}", b.depths[i]);
    }
    assert!(beyond * 200 < side * side, "{beyond} depths are farther apart than rounding explains");
    let pixels = (side * side) as f64;
    let changed = a.ids.iter().zip(&b.ids).filter(|(a, b)| a != b).count();
    let sum: u64 = a.picture.rgba.iter().zip(&b.picture.rgba).map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
    (changed as f64 / pixels, sum as f64 / (4.0 * pixels))
}

#[test]
fn frames_are_those_of_the_raster_units() {
    let Some(mut renderer) = renderer() else { return };
    let head = dome();
    let on_gpu = HeadOnGpu::new(renderer.gpu(), &head, &WHITE_TABLE).expect("the dome uploads");
    let state = FaceState::neutral(&head);
    let lights = [lamp()];
    let near = |z: f32| Camera {
        position: Vec3::new(0.01, 0.02, z),
        target: Vec3::ZERO,
        up: Vec3::Y,
        fov_degrees: 25.0,
    };
    // From afar, close up, and inside of the dome, whose triangles then reach behind the viewer.
    let views = [(near(0.5), 1), (near(0.12), 1), (near(0.02), 1), (near(0.6), 2)];
    let mut all = |method: RasterMethod| -> Vec<Frame> {
        let each = views.iter().map(|(camera, count)| {
            let heads: Vec<_> = (0..*count)
                .map(|i| HeadInstance {
                    head: &on_gpu,
                    state: &state,
                    world_from_head: Mat4::from_translation(Vec3::new(0.05, 0.0, -0.03) * i as f32),
                })
                .collect();
            let scene = Scene {
                heads: &heads,
                camera: *camera,
                lights: &lights,
                environment: None,
                environment_rotation: 0.0,
                environment_intensity: 0.0,
                background_linear: Vec3::ZERO,
                optics: Default::default(),
            };
            frame(&mut renderer, &scene, method)
        });
        each.collect()
    };
    let by_hardware = all(RasterMethod::Hardware);
    let by_compute = all(RasterMethod::Compute);
    for ((a, b), (camera, _)) in by_hardware.iter().zip(&by_compute).zip(&views) {
        let (ids, picture) = difference(a, b);
        assert!(ids < 0.01 && picture < 0.1, "{camera:?}: {ids} of the pixels, mean difference {picture}");
    }
}
