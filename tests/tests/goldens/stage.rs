//! The only place of the goldens that calls the renderer: a scene goes in, pixels or values come out.

use std::collections::BTreeMap;
use std::error::Error;

use glam::{Mat4, Vec2, Vec3};
use rubor_assets::import;
use rubor_renderer::channels;
use rubor_renderer::settings::{Look, Output, Quality, Settings};
use rubor_renderer::{
    Camera, ColorTable, Environment, EnvironmentMap, HeadInstance, HeadOnGpu, Light, LightKind, Optics,
    Renderer, Scene, native,
};
use rubor_rig::authored::{
    AlphaMode, AuthoredImage, AuthoredMaterial, AuthoredTexture, TextureTransform, Wrap,
};
use rubor_rig::evaluate::{LightState, Shot};
use rubor_rig::head::{Head, Material, Part, SkinMaps, Vertex};
use rubor_rig::map::Map;
use rubor_rig::skin::chromophores::{ChromophoreModel, SkinModel};
use rubor_rig::timeline;
use rubor_tests::tolerance::Adapter;

use crate::cases::{Channel, Methods, Model};

/// Radiance behind the heads: a dark grey that shows outlines.
const BACKDROP_LINEAR: Vec3 = Vec3::new(0.016, 0.018, 0.021);
/// Distance of heads that stand side by side, metres.
const SPACING: f32 = 0.26;
/// Side of the skin colour table, texels.
const COLOR_TABLE_SIDE: u32 = 64;
/// Texels on a side of a shadow map: 0.3 mm in a picture of a face.
const SHADOW_SIZE: u32 = 512;
/// Melanin of the dark skin in units of the default one.
const DARK_MELANIN: f32 = 6.0;

pub(crate) type Outcome<T> = Result<T, Box<dyn Error>>;

/// What a frame left on the device.
pub(crate) enum Drawn {
    /// The displayed image, RGBA.
    Image(Vec<u8>),
    /// An image of numbers, rows from the top.
    Values(Vec<[f32; 4]>),
    /// Points of the head with a vector each, metres.
    Points(Vec<(Vec3, [f32; 4])>),
}

/// A renderer with every head that cases draw.
pub(crate) struct Stage {
    renderer: Renderer,
    heads: BTreeMap<Model, (Head, HeadOnGpu)>,
    environments: BTreeMap<String, Environment>,
}

/// The default head and its variants.
fn models() -> Outcome<[(Model, Head); 6]> {
    let file = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../assets/head.glb"));
    let default = import::gltf::from_bytes(&std::fs::read(file)?, file)?.head;
    let mut dark = default.clone();
    for value in dark.maps.melanin.iter_mut().flat_map(|map| &mut map.values) {
        *value = (*value * DARK_MELANIN).min(0.5);
    }
    let bare = Head { maps: SkinMaps::default(), ..default.clone() };
    let authored = tiled(bare.clone());
    let (painted, panes) = (painted(default.clone()), behind_panes(default.clone()));
    Ok([
        (Model::Default, default),
        (Model::Dark, dark),
        (Model::WithoutMaps, bare),
        (Model::Authored, authored),
        (Model::Painted, painted),
        (Model::BehindPanes, panes),
    ])
}

/// A head whose skin has a colour by itself: pale stripes of three colours across the unit square.
fn painted(mut head: Head) -> Head {
    const SIDE: u32 = 256;
    let stripe = |i: u32| match (i % SIDE + i / SIDE) / 10 % 3 {
        0 => [0.75, 0.52, 0.42],
        1 => [0.55, 0.60, 0.78],
        _ => [0.30, 0.16, 0.10],
    };
    let values = (0..SIDE * SIDE).flat_map(stripe).collect();
    head.maps.albedo = Some(Map { width: SIDE, height: SIDE, channels: 3, values });
    head.maps.hair = None;
    head
}

/// A head behind a blended pane and one of coated glass, which cross before its nose.
fn behind_panes(mut head: Head) -> Head {
    let (_, high) = head.bounds().unwrap_or_default();
    for (name, turn) in [("blended", 0.6f32), ("glass", -0.6)] {
        let mesh = &mut head.mesh;
        let first = mesh.vertices.len() as u32;
        for (x, y) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 0.2), (-1.0, 0.2)] {
            let point = mesh.points.len() as u32;
            let place = 0.05 * Vec3::new(x * turn.cos(), y, x * turn.sin());
            mesh.points.push(place + Vec3::new(0.0, -0.02, high.z + 0.03));
            mesh.vertices.push(Vertex { point, uv: Vec2::new(x, y) });
        }
        let start = mesh.triangles.len() as u32;
        mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        mesh.parts.push(Part { name: name.into(), material: Material::Other, triangles: start..start + 2 });
    }
    head.mesh.occlusion.resize(head.mesh.points.len(), 1.0);
    let plain = AuthoredMaterial { metallic: 0.0, is_double_sided: true, ..AuthoredMaterial::default() };
    head.authored.materials = vec![
        AuthoredMaterial {
            base_color: [0.9, 0.5, 0.1, 0.6],
            roughness: 0.4,
            alpha: AlphaMode::Blend,
            ..plain.clone()
        },
        AuthoredMaterial {
            base_color: [0.4, 0.9, 0.7, 1.0],
            roughness: 0.6,
            transmission: 0.9,
            clearcoat: 1.0,
            clearcoat_roughness: 0.1,
            ..plain
        },
    ];
    head.authored.of_parts = vec![None; head.mesh.parts.len() - 2];
    head.authored.of_parts.extend([Some(0), Some(1)]);
    head
}

/// A head whose skin is of tiles: half of them metal, with bumps, dark joints, and holes where alpha is none.
fn tiled(mut head: Head) -> Head {
    const SIDE: u32 = 16;
    fn is_metal(x: u32, y: u32) -> bool {
        (x / 8 + y / 8).is_multiple_of(2)
    }
    let image = |name: &str, texel: fn(u32, u32) -> [u8; 4]| AuthoredImage {
        name: name.into(),
        width: SIDE,
        height: SIDE,
        rgba: (0..SIDE * SIDE).flat_map(|i| texel(i % SIDE, i / SIDE)).collect(),
    };
    let color = image("colours", |x, y| match (x % 8, y % 8) {
        (3 | 4, 3 | 4) if y < 8 => [255, 255, 255, 0],
        _ if is_metal(x, y) => [255, 196, 110, 255],
        _ => [40, 90, 170, 255],
    });
    let surface = image("roughness and metal", |x, y| {
        let metal = if is_metal(x, y) { 255 } else { 0 };
        [0, if x < 8 { 90 } else { 180 }, metal, 255]
    });
    let bumps = image("bumps", |x, y| {
        let slope = |i: u32| 128 - (i % 8) as u8 * 12 + 42;
        [slope(x), 255 - slope(y), 240, 255]
    });
    let joints = image("joints", |x, y| if x % 8 == 0 || y % 8 == 0 { [90, 0, 0, 255] } else { [255; 4] });
    head.authored.images = vec![color, surface, bumps, joints];
    let texture = |image: u32| {
        let transform =
            TextureTransform { scale: Vec2::splat(12.0), rotation_radians: 0.3, ..Default::default() };
        Some(AuthoredTexture { image, uv_set: 0, transform, wrap: [Wrap::Repeat; 2] })
    };
    head.authored.materials = vec![AuthoredMaterial {
        name: "tiles".into(),
        base_color_texture: texture(0),
        metallic_roughness_texture: texture(1),
        normal_texture: texture(2),
        occlusion_texture: texture(3),
        alpha: AlphaMode::Mask { cutoff: 0.5 },
        is_double_sided: true,
        ..AuthoredMaterial::default()
    }];
    let parts = head.mesh.parts.iter_mut();
    head.authored.of_parts = parts
        .map(|part| {
            let is_skin = part.material == Material::Skin;
            part.material = if is_skin { Material::Other } else { part.material };
            is_skin.then_some(0)
        })
        .collect();
    head
}

impl Stage {
    /// Opens the adapter that `RUBOR_ADAPTER` names, else the software rasteriser, else the best one.
    pub(crate) fn open() -> Outcome<Self> {
        let software =
            native::adapters().into_iter().find(|a| a.name.starts_with("llvmpipe")).map(|a| a.name);
        let wanted = std::env::var("RUBOR_ADAPTER").ok().or(software);
        let renderer = Renderer::new(native::open(wanted.as_deref())?)?;
        let lookup = SkinModel::new(&ChromophoreModel::default()).bake(COLOR_TABLE_SIDE, COLOR_TABLE_SIDE);
        let color = ColorTable { width: lookup.width, height: lookup.height, texels: &lookup.texels };
        let mut heads = BTreeMap::new();
        for (model, head) in models()? {
            let on_gpu = HeadOnGpu::new(renderer.gpu(), &head, &color)?;
            heads.insert(model, (head, on_gpu));
        }
        Ok(Self { renderer, heads, environments: BTreeMap::new() })
    }

    /// The adapter.
    pub(crate) fn adapter(&self) -> Adapter {
        let info = &self.renderer.gpu().info;
        Adapter {
            name: info.name.clone(),
            driver: format!("{} {}", info.driver, info.driver_info).trim().to_owned(),
        }
    }

    /// A head on the CPU.
    pub(crate) fn head(&self, model: Model) -> &Head {
        &self.heads[&model].0
    }

    /// Draws the frames of a scene, one after the other from a cut, and reads a channel of the last one.
    pub(crate) fn draw(
        &mut self,
        models: &[Model],
        frames: &[Shot],
        size: [u32; 2],
        methods: &Methods,
        channel: Channel,
    ) -> Outcome<Drawn> {
        let mut settings = Settings {
            output: Output {
                size,
                channels: channels::CHANNELS.iter().map(|row| row.channel).collect(),
                ..Output::default()
            },
            quality: Quality {
                scatter: methods.scatter.parse()?,
                transmit: methods.transmit.parse()?,
                bounce: methods.bounce.parse()?,
                curvature: methods.curvature.parse()?,
                color: methods.color.parse()?,
                raster: methods.raster.parse()?,
                wrinkles: methods.wrinkles.parse()?,
                specular: methods.specular.parse()?,
                antialias: methods.antialias.parse()?,
                depth_of_field: methods.depth_of_field.parse()?,
                shadow_size: SHADOW_SIZE,
                ..Quality::default()
            },
            look: Look {
                exposure: methods.exposure,
                tone_map: methods.tone_map.parse()?,
                backdrop: methods.backdrop.parse()?,
                dither: methods.dither.parse()?,
                ..Look::default()
            },
        };
        settings.overlay(
            &serde_json::json!({ "look": serde_json::from_str::<serde_json::Value>(methods.look)? }),
        )?;
        let mut image = Vec::new();
        self.renderer.cut(0);
        for shot in frames {
            if let Some(state) = &shot.environment {
                let map = EnvironmentMap::named(&state.name).ok_or("no such environment")?;
                let upload = || map.upload(self.renderer.gpu());
                self.environments.entry(state.name.clone()).or_insert_with(upload);
            }
            let middle = (models.len() as f32 - 1.0) / 2.0;
            let place = |i: usize| Mat4::from_translation(Vec3::X * ((i as f32 - middle) * SPACING));
            let instances: Vec<_> = models
                .iter()
                .enumerate()
                .map(|(i, model)| HeadInstance {
                    head: &self.heads[model].1,
                    state: &shot.face,
                    world_from_head: place(i),
                })
                .collect();
            let scene = Scene {
                heads: &instances,
                camera: Camera {
                    position: shot.camera.position,
                    target: shot.camera.target,
                    up: shot.camera.up,
                    fov_degrees: shot.camera.fov_y.to_degrees(),
                },
                lights: &shot.lights.iter().map(light).collect::<Vec<_>>(),
                environment: shot.environment.as_ref().map(|e| &self.environments[&e.name]),
                environment_rotation: shot.environment.as_ref().map_or(0.0, |e| e.rotation_y),
                environment_intensity: shot.environment.as_ref().map_or(0.0, |e| e.intensity),
                background_linear: BACKDROP_LINEAR,
                optics: Optics {
                    frame: shot.frame,
                    sensor_height_mm: shot.camera.lens.sensor_height_mm,
                    f_stop: shot.camera.lens.f_stop,
                    focus_metres: shot.camera.lens.focus_metres,
                    subject: shot.place.origin,
                    subject_height: shot.place.head_height,
                },
            };
            let gpu = self.renderer.gpu().clone();
            image = native::wait(&gpu, self.renderer.render(&scene, &settings))?.0.rgba;
        }
        let read = |channel| native::wait(self.renderer.gpu(), self.renderer.read(channel));
        let points = read(channels::Channel::Positions)?;
        let points: Vec<Vec3> = points.texels::<3>().map(Vec3::from_array).collect();
        let values = |channel| -> Outcome<Vec<[f32; 4]>> { Ok(read(channel)?.texels().collect()) };
        let mesh = &self.head(models[0]).mesh;
        Ok(match channel {
            Channel::Image => Drawn::Image(image),
            Channel::Hdr => Drawn::Values(values(channels::Channel::Radiance)?),
            Channel::Albedo => Drawn::Values(values(channels::Channel::Albedo)?),
            Channel::Diffuse => {
                let light = values(channels::Channel::Diffuse)?;
                let strength = values(channels::Channel::Albedo)?;
                let pixel = |([r, g, b, _], [.., a]): ([f32; 4], [f32; 4])| [r, g, b, a];
                Drawn::Values(light.into_iter().zip(strength).map(pixel).collect())
            }
            Channel::Depth | Channel::Ids => {
                let channel =
                    if channel == Channel::Depth { channels::Channel::Depth } else { channels::Channel::Ids };
                Drawn::Values(read(channel)?.values.into_iter().map(|v| [v, 0.0, 0.0, 0.0]).collect())
            }
            Channel::Velocity => {
                let velocity = read(channels::Channel::Velocity)?;
                Drawn::Values(velocity.texels::<2>().map(|[x, y]| [x, y, 0.0, 0.0]).collect())
            }
            Channel::Positions => {
                Drawn::Points(points.into_iter().map(|p| (p, [p.x, p.y, p.z, 0.0])).collect())
            }
            Channel::Occlusion => {
                let visibility = read(channels::Channel::Visibility)?.values;
                Drawn::Points(points.into_iter().zip(visibility).map(|(p, v)| (p, [v; 4])).collect())
            }
            Channel::Normals | Channel::Tangents => {
                let frames = read(channels::Channel::TangentFrames)?;
                let vector = |[nx, ny, nz, tx, ty, tz, sign]: [f32; 7]| match channel {
                    Channel::Normals => [nx, ny, nz, 0.0],
                    _ => [tx, ty, tz, sign],
                };
                let placed = mesh.vertices.iter().zip(frames.texels::<7>());
                Drawn::Points(placed.map(|(v, frame)| (points[v.point as usize], vector(frame))).collect())
            }
        })
    }
}

fn light(state: &LightState) -> Light {
    let kind = match state.kind {
        timeline::LightKind::Directional => LightKind::Directional { direction: state.direction },
        timeline::LightKind::Spot => {
            let [inner_degrees, outer_degrees] = state.cone_half_angles.map(f32::to_degrees);
            let (position, direction) = (state.position, state.direction);
            LightKind::Spot { position, direction, inner_degrees, outer_degrees }
        }
        timeline::LightKind::Point => LightKind::Point { position: state.position },
    };
    Light { kind, color_linear: state.power_linear, radius: state.radius, casts_shadow: state.shadow }
}
