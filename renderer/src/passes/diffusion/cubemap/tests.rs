//! Shaders against Rust and the CPU, the integral on known shapes, the fixes of section 4.4, refinement, hostile input.

use std::f32::consts::{PI, TAU};

use glam::{Mat4, Vec2, Vec3};
use rubor_rig::face_state::FaceState;
use rubor_rig::head::{Head, Material, Mesh, Part, Vertex};
use rubor_rig::skin::profile::Profile;

use super::*;
use crate::channels::Channel;
use crate::settings::{AntialiasMethod, Look, Output, ScatterMethod, Settings, TransmitMethod};
use crate::testing::{assert_layout, assert_workgroups, offsets, own_gpu};
use crate::tests::{read_texels, render};
use crate::{Camera, ColorTable, EnvironmentMap, HeadInstance, HeadOnGpu, LightKind, Renderer, Scene};

const MM: f32 = 1e-3;

#[test]
fn shaders_link_and_structs_are_laid_out_alike() {
    for entry in ["draw_depth", "draw_ids"] {
        assert_workgroups(&draw_program(), &[(entry, [64, 1, 1])]);
    }
    let square = |entry| [(entry, [8, 8, 1])];
    assert_workgroups(&light_program(), &square("light_layers"));
    for (refines, directional) in [(false, false), (true, false), (false, true), (true, true)] {
        assert_workgroups(&gather_program(refines, directional), &square("gather_layers"));
    }
    assert_workgroups(&combine_program(), &square("combine"));
    assert_workgroups(&near_program(), &square("near_disk"));
    for (program, entry) in [
        (draw_program(), "draw_ids"),
        (light_program(), "light_layers"),
        (gather_program(false, true), "gather_layers"),
        (combine_program(), "combine"),
    ] {
        assert_layout(
            &program,
            entry,
            "Cube",
            size_of::<Cube>(),
            &offsets!(Cube; head as "head", size as "size", lamps as "lamps", layers as "layers",
                triangles as "triangles", samples as "samples", refined as "refined", fixes as "fixes",
                has_sky as "has_sky", half_width_mm as "half_width_mm", near_start_mm as "near_start_mm",
                near_end_mm as "near_end_mm", lamp_shrink_mm as "lamp_shrink_mm",
                axis_shrink_mm as "axis_shrink_mm", bias_mm as "bias_mm", texel_mm as "texel_mm",
                near_light as "near_light", plane_factor as "plane_factor", dipole as "dipole", layer as "layer"),
        );
        assert_layout(
            &program,
            entry,
            "Layer",
            size_of::<Layer>(),
            &offsets!(Layer; origin as "origin", forward as "forward", right as "right", up as "up",
                extent as "extent"),
        );
        assert_layout(
            &program,
            entry,
            "Dipole",
            size_of::<Dipole>(),
            &offsets!(Dipole; boundary as "boundary", diffusion_mm as "diffusion_mm",
                sigma_tr_per_mm as "sigma_tr_per_mm", d_e_mm as "d_e_mm", least_mm2 as "least_mm2", white as "white"),
        );
    }
    assert_layout(
        &gather_program(false, false),
        "gather_layers",
        "Entry",
        size_of::<tables::Entry>(),
        &offsets!(tables::Entry; reflectance as "reflectance", beyond as "beyond"),
    );
}

// ---- Shapes ----

/// A head of skin without maps from a grid of points that may close around; corners are counter-clockwise from outside.
fn grid(columns: usize, rows: usize, place: impl Fn(f32, f32) -> Vec3) -> Head {
    let mut mesh = Mesh::default();
    for y in 0..=rows {
        for x in 0..=columns {
            let uv = Vec2::new(x as f32 / columns as f32, y as f32 / rows as f32);
            mesh.vertices.push(Vertex { point: mesh.points.len() as u32, uv });
            mesh.points.push(MM * place(uv.x, uv.y));
        }
    }
    let at = |x: usize, y: usize| (y * (columns + 1) + x) as u32;
    for y in 0..rows {
        for x in 0..columns {
            mesh.triangles.push([at(x, y), at(x + 1, y), at(x + 1, y + 1)]);
            mesh.triangles.push([at(x, y), at(x + 1, y + 1), at(x, y + 1)]);
        }
    }
    let end = mesh.triangles.len() as u32;
    mesh.parts.push(Part { name: "skin".into(), material: Material::Skin, triangles: 0..end });
    Head { name: "test".into(), mesh, ..Head::default() }
}

/// A sphere; the triangles at its poles have no area.
fn sphere(radius_mm: f32) -> Head {
    grid(48, 24, |u, v| {
        let (turn, tilt) = (TAU * u, PI * (v - 0.5));
        radius_mm * Vec3::new(tilt.cos() * turn.sin(), tilt.sin(), tilt.cos() * turn.cos())
    })
}

/// A slab of two sides and a round rim, thin along z.
fn lamella(radius_mm: f32, thickness_mm: f32) -> Head {
    grid(48, 32, |u, v| {
        let turn = TAU * u;
        // Along v: the back from its middle out, the rim, the front inwards.
        let (r, z) = match v {
            v if v < 0.35 => (v / 0.35 * radius_mm, -0.5 * thickness_mm),
            v if v > 0.65 => ((1.0 - v) / 0.35 * radius_mm, 0.5 * thickness_mm),
            v => {
                let a = PI * ((v - 0.35) / 0.3 - 0.5);
                (radius_mm + 0.5 * thickness_mm * a.cos(), 0.5 * thickness_mm * a.sin())
            }
        };
        Vec3::new(r * turn.cos(), r * turn.sin(), z) 
    })
}

/// A plane with waves, and a flat one without.
fn waves(height_mm: f32) -> Head {
    grid(60, 60, |u, v| {
        let (x, y) = (60.0 * (u - 0.5), 60.0 * (v - 0.5));
        Vec3::new(x, y, height_mm * (0.6 * x).sin() * (0.5 * y + 0.7).cos())
    })
}

/// A stage: one head, a camera on +Z whose picture is `across_mm` wide at z = 0.
struct Stage {
    renderer: Renderer,
    head: Head,
    on_gpu: HeadOnGpu,
    lights: Vec<Light>,
    sky: Option<crate::Environment>,
    across_mm: f32,
    pixels: u32,
    profile: Profile,
    from: Vec3,
}

impl Stage {
    fn new(head: Head, lights: Vec<Light>, across_mm: f32, pixels: u32) -> Option<Self> {
        let mut renderer = Renderer::new(own_gpu()?).unwrap();
        let white = ColorTable { width: 2, height: 2, texels: &[[0.8; 3]; 4] };
        let on_gpu = HeadOnGpu::new(renderer.gpu(), &head, &white).unwrap();
        let _ = &mut renderer;
        Some(Self {
            renderer,
            head,
            on_gpu,
            lights,
            sky: None,
            across_mm,
            pixels,
            profile: Profile::deon_six(),
            from: Vec3::Z,
        })
    }

    fn with_sky(mut self, radiance: impl Fn(Vec3) -> Vec3 + Sync) -> Self {
        self.sky = Some(EnvironmentMap::from_fn(64, 32, radiance).upload(self.renderer.gpu()));
        self
    }

    fn settings(&self, scatter: ScatterMethod) -> Settings {
        Settings {
            output: Output {
                size: [self.pixels; 2],
                channels: vec![Channel::Diffuse, Channel::Albedo],
                ..Output::default()
            },
            quality: Quality {
                scatter,
                transmit: TransmitMethod::None,
                antialias: AntialiasMethod::None,
                profile: self.profile.clone().into(),
                shadow_size: 512,
                ..Quality::default()
            },
            look: Look { exposure: 1.0, ..Look::default() },
        }
    }

    /// Diffuse light and strength of each pixel of the next frame.
    fn frame(&mut self, scatter: ScatterMethod) -> Vec<[f32; 4]> {
        let settings = self.settings(scatter);
        let state = FaceState::neutral(&self.head);
        let distance_mm = 600.0;
        let heads = [HeadInstance { head: &self.on_gpu, state: &state, world_from_head: Mat4::IDENTITY }];
        let scene = Scene {
            heads: &heads,
            camera: Camera {
                position: self.from.normalize() * distance_mm * MM,
                target: Vec3::ZERO,
                up: Vec3::Y,
                fov_degrees: 2.0 * (0.5 * self.across_mm / distance_mm).atan().to_degrees(),
            },
            lights: &self.lights,
            environment: self.sky.as_ref(),
            environment_rotation: 0.0,
            environment_intensity: 1.0,
            background_linear: Vec3::ZERO,
        };
        render(&mut self.renderer, &scene, &settings).unwrap();
        let strength = read_texels(&self.renderer, Channel::Albedo);
        let diffuse = read_texels(&self.renderer, Channel::Diffuse);
        diffuse.into_iter().zip(strength).map(|([r, g, b, _], [.., a])| [r, g, b, a]).collect()
    }

    /// A frame after a cut.
    fn draw(&mut self, scatter: ScatterMethod) -> Vec<[f32; 4]> {
        self.renderer.cut(0);
        self.frame(scatter)
    }

    /// A frame without some of the fixes.
    fn draw_with(&mut self, scatter: ScatterMethod, fixes: Fixes) -> Vec<[f32; 4]> {
        self.draw(scatter);
        let ScatterMethod::DipoleCubemap(samples) = scatter else { panic!("{scatter} has no fixes") };
        let method = DipoleCubemap::new(self.renderer.gpu(), &self.profile, samples).unwrap();
        *self.renderer.diffusion() = Some(Box::new(method.with_fixes(fixes)));
        let drawn = self.draw(scatter);
        self.renderer.diffusion().take();
        // The next frame makes the method anew.
        self.draw(ScatterMethod::None);
        drawn
    }
}

fn sun(direction: Vec3) -> Light {
    Light {
        kind: LightKind::Directional { direction },
        color_linear: Vec3::splat(2.0),
        radius: 0.0,
        casts_shadow: true,
    }
}

/// Relative root mean square difference over skin, and the largest difference relative to the largest value.
fn error(found: &[[f32; 4]], expected: &[[f32; 4]]) -> (f64, f64) {
    let (mut square, mut signal, mut largest, mut peak) = (0.0, 0.0, 0.0f64, 0.0f64);
    for (f, e) in found.iter().zip(expected).filter(|(_, e)| e[3] > 0.5) {
        for c in 0..3 {
            assert!(f[c].is_finite() && f[c] >= 0.0, "{f:?}");
            let d = f64::from(f[c] - e[c]);
            square += d * d;
            signal += f64::from(e[c]).powi(2);
            largest = largest.max(d.abs());
            peak = peak.max(f64::from(e[c]));
        }
    }
    ((square / signal).sqrt(), largest / peak)
}

const CUBEMAP: ScatterMethod = ScatterMethod::DipoleCubemap(32);

#[test]
fn probe_errors() {
    let shapes: [(&str, Head, Vec3, f32); 4] = [
        ("sphere front", sphere(40.0), Vec3::new(-0.3, -0.3, -1.0), 90.0),
        ("sphere side", sphere(40.0), Vec3::new(-1.0, 0.0, -0.2), 90.0),
        ("waves", waves(1.5), Vec3::new(-1.0, 0.0, -0.6), 50.0),
        ("lamella", lamella(20.0, 3.0), Vec3::new(0.2, 0.0, 1.0), 50.0),
    ];
    for (name, head, direction, across) in shapes {
        let Some(mut stage) = Stage::new(head, vec![sun(direction)], across, 64) else { return };
        let truth = stage.draw(ScatterMethod::ReferenceSurface(8));
        let other = stage.draw(ScatterMethod::ReferenceSurface(7));
        eprintln!("{name}: noise {:?}", error(&other, &truth));
        for n in [2, 8, 32, 128] {
            eprintln!("  {n}: {:?}", error(&stage.draw(ScatterMethod::DipoleCubemap(n)), &truth));
        }
        eprintln!("  none {:?} separable {:?}", error(&stage.draw(ScatterMethod::None), &truth), error(&stage.draw(ScatterMethod::Separable(33)), &truth));
        for (what, fixes) in [
            ("no lamp shrink", Fixes { shrinks_to_lamp: false, ..Fixes::ALL }),
            ("no axis shrink", Fixes { shrinks_to_axis: false, ..Fixes::ALL }),
            ("no bias", Fixes { has_bias: false, ..Fixes::ALL }),
            ("no facing", Fixes { weighs_by_facing: false, ..Fixes::ALL }),
        ] {
            eprintln!("  {what}: {:?}", error(&stage.draw_with(CUBEMAP, fixes), &truth));
        }
    }
}
