//! What can be known of a frame without drawing it.

use std::f64::consts::PI;

use glam::Vec3;
use rubor_rig::bvh::Bvh;
use rubor_rig::deform::point_normals;
use rubor_rig::evaluate::{LightState, Shot};
use rubor_rig::head::{Head, Material};
use serde::{Deserialize, Serialize};

/// Points of a head that stand for its surface.
const MOST_POINTS: usize = 3000;
/// Share of a head's points in view that are nearer than the distance that counts.
const NEAR_SHARE: usize = 10;
/// Points of those in view on which light is estimated.
const MOST_LIT: usize = 400;
/// Slope by which relief tilts the surface: about that of pores.
const RELIEF_SLOPE: f32 = 0.2;
/// Skin, for estimates of light: albedo, reflectance head-on, root mean square slope of its facets (Beckmann).
const SKIN: Look = Look { albedo: 0.35, head_on: 0.028, roughness: 0.3 };
/// Linear light that a picture shows as white.
const WHITE: f64 = 0.55;
/// Thickness over which light that passes skin falls to 1/e, millimetres: of red through slabs of `docs/light.md`.
const PASSES_MM: f64 = 3.0;
/// Thickness from which nothing passes.
const THICKEST_MM: f32 = 20.0;
/// Rays into the skin start this far below it, millimetres.
const START_MM: f32 = 0.05;

/// Numbers of a shot of a head from which errors and costs are estimated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Features {
    /// Millimetres of skin across a pixel, where the head is near.
    pub mm_per_pixel: f64,
    /// Share of the picture that the head's box covers, 0 to 1.
    pub share: f64,
    /// How much of the lamps' light comes from behind the head, 0 to 1.
    pub backlight: f64,
    /// Share of lamps in all light, 0 to 1: a face in even light has no edges of shadows.
    pub contrast: f64,
    /// Largest weight of a wrinkle zone, 0 to 1.
    pub wrinkles: f64,
    /// How far blood is from neutral: weights of distributions and the change of the global factor.
    pub blood: f64,
    /// Mean displayed value of the skin in view, 0 to 1.
    pub brightness: f64,
    /// How much displayed values change by light through thin parts, in the mean over the skin in view.
    pub through: f64,
    /// Cosine of the angle between the way the face looks and the camera, at least 0: wrinkles and blood are in the face.
    pub facing: f64,
    /// How much displayed values change when the surface tilts by the slope of pores, root mean square: highlights and grazing
    /// light make relief visible, and what is finer than a pixel alias.
    pub relief: f64,
}

/// A place of the surface of a head.
#[derive(Clone, Copy, Debug)]
struct Place {
    point: Vec3,
    normal: Vec3,
    /// Square metres of the surface that it stands for.
    area: f64,
    /// Share of light from behind that passes the head here.
    passes: f64,
}

/// A place in view of the camera, in the world.
#[derive(Clone, Copy, Debug)]
struct Seen {
    point: Vec3,
    normal: Vec3,
    area: f64,
    passes: f64,
}

/// A head as features see it.
#[derive(Clone, Debug)]
pub struct Outline {
    places: Vec<Place>,
}

/// Skin, without maps.
struct Look {
    albedo: f64,
    head_on: f64,
    roughness: f64,
}

/// Light that reaches a place.
struct Arriving {
    to_light: Vec3,
    irradiance: f64,
}

impl Look {
    /// Displayed value of a surface with a normal.
    fn displayed(&self, normal: Vec3, to_camera: Vec3, lamps: &[Arriving], around: f64) -> f64 {
        display(self.light(normal, to_camera, lamps, around))
    }

    /// Light of it.
    fn light(&self, normal: Vec3, to_camera: Vec3, lamps: &[Arriving], around: f64) -> f64 {
        let mut light = (self.albedo + self.head_on) * around;
        for lamp in lamps {
            let cos = f64::from(normal.dot(lamp.to_light));
            if cos <= 0.0 {
                continue;
            }
            let half = lamp.to_light + to_camera;
            let cos_half = f64::from(normal.dot(half.normalize_or_zero())).max(1e-3);
            let tan_square = (1.0 - cos_half * cos_half).max(0.0) / (cos_half * cos_half);
            let m_square = self.roughness * self.roughness;
            let facets = (-tan_square / m_square).exp() / (PI * m_square * cos_half.powi(4));
            let toward = f64::from(half.normalize_or_zero().dot(to_camera)).clamp(0.0, 1.0);
            let fresnel = self.head_on + (1.0 - self.head_on) * (1.0 - toward).powi(5);
            let specular = facets * fresnel / f64::from(half.length_squared()).max(0.1);
            light += lamp.irradiance * cos * (self.albedo / PI + specular);
        }
        light
    }
}

/// Displayed value of light.
fn display(light: f64) -> f64 {
    (light / WHITE).clamp(0.0, 1.0).powf(1.0 / 2.2)
}

impl Outline {
    /// Some places of the neutral head.
    pub fn of(head: &Head) -> Self {
        let mesh = &head.mesh;
        let normals = point_normals(mesh, &mesh.points);
        let mut areas = vec![0.0; mesh.points.len()];
        for triangle in &mesh.triangles {
            let points = triangle.map(|v| mesh.vertices[v as usize].point as usize);
            let [a, b, c] = points.map(|p| mesh.points[p]);
            let area = f64::from((b - a).cross(c - a).length()) / 2.0;
            points.iter().for_each(|p| areas[*p] += area / 3.0);
        }
        let stride = mesh.points.len().div_ceil(MOST_POINTS).max(1);
        let corners = |t: &[u32; 3]| t.map(|v| mesh.points[mesh.vertices[v as usize].point as usize]);
        let skin = mesh.parts.iter().filter(|p| p.material == Material::Skin);
        let surface = Bvh::new(
            skin.flat_map(|p| p.triangles.clone()).map(|t| corners(&mesh.triangles[t as usize])).collect(),
        );
        let passes = |i: usize| {
            let start = mesh.points[i] - 1e-3 * START_MM * normals[i];
            let met = surface.first(start, -normals[i], 0.0, 1e-3 * THICKEST_MM, None);
            met.map_or(0.0, |met| (-1e3 * f64::from(met.distance) / PASSES_MM).exp())
        };
        let place =
            |i: usize| Place { point: mesh.points[i], normal: normals[i], area: areas[i], passes: passes(i) };
        Self { places: (0..mesh.points.len()).step_by(stride).map(place).collect() }
    }

    /// Features of a shot of the head, in a picture of a size in pixels. A head out of view has a share of 0.
    pub fn features(&self, shot: &Shot, size: [u32; 2]) -> Features {
        let camera = &shot.camera;
        let forward = (camera.target - camera.position).normalize_or_zero();
        let right = forward.cross(camera.up).normalize_or_zero();
        let up = right.cross(forward);
        let [width, height] = size.map(|n| f64::from(n.max(1)));
        let half_height = f64::from((camera.fov_y / 2.0).tan());
        let half_width = half_height * width / height;
        let face = &shot.face;
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        let mut depths = Vec::new();
        let mut seen = Vec::new();
        let mut middle = Vec3::ZERO;
        for place in &self.places {
            let world = face.head_rotation * place.point + face.head_translation;
            let surface = Seen {
                point: world,
                normal: face.head_rotation * place.normal,
                area: place.area,
                passes: place.passes,
            };
            let from_camera = world - camera.position;
            let depth = f64::from(from_camera.dot(forward));
            if depth <= 1e-4 {
                continue;
            }
            let place = [
                f64::from(from_camera.dot(right)) / (depth * half_width),
                f64::from(from_camera.dot(up)) / (depth * half_height),
            ];
            for axis in 0..2 {
                low[axis] = low[axis].min(place[axis].clamp(-1.0, 1.0));
                high[axis] = high[axis].max(place[axis].clamp(-1.0, 1.0));
            }
            if place.iter().all(|p| p.abs() <= 1.0) {
                depths.push(depth);
                middle += world;
                seen.push(surface);
            }
        }
        depths.sort_by(f64::total_cmp);
        let Some(near) = depths.get(depths.len() / NEAR_SHARE) else { return Features::default() };
        let middle = middle / depths.len() as f32;
        let to_camera = (camera.position - middle).normalize_or_zero();
        let (mut behind, mut lamps) = (0.0, 0.0);
        for light in &shot.lights {
            let (to_light, falloff) = toward(light, middle);
            let power = f64::from(light.power_linear.element_sum() * falloff / 3.0);
            lamps += power;
            behind += power * f64::from(-to_light.dot(to_camera)).max(0.0);
        }
        let around = shot.environment.as_ref().map_or(0.0, |e| f64::from(e.intensity));
        let [brightness, relief] = shown(&seen, shot, around);
        Features {
            brightness,
            relief,
            through: through(&seen, shot, around),
            facing: f64::from((face.head_rotation * Vec3::Z).dot(to_camera)).max(0.0),
            mm_per_pixel: 2000.0 * near * half_height / height,
            share: (high[0] - low[0]) * (high[1] - low[1]) / 4.0,
            backlight: if lamps > 0.0 { behind / lamps } else { 0.0 },
            contrast: if lamps > 0.0 { lamps / (lamps + std::f64::consts::PI * around) } else { 0.0 },
            wrinkles: face.zones.iter().fold(0.0, |most, w| most.max(f64::from(w.abs()))),
            blood: face.distributions.iter().map(|w| f64::from(w.abs())).sum::<f64>()
                + f64::from((face.hemoglobin_scale - 1.0).abs()),
        }
    }
}

/// Features of heads that stand side by side; camera and lamps are those of the first shot.
pub fn features_of(outlines: &[&Outline], shots: &[Shot], spacing_m: f32, size: [u32; 2]) -> Vec<Features> {
    let Some(first) = shots.first() else { return Vec::new() };
    let middle = (shots.len() as f32 - 1.0) / 2.0;
    let of = |(i, (outline, shot)): (usize, (&&Outline, &Shot))| {
        let mut face = shot.face.clone();
        face.head_translation.x += (i as f32 - middle) * spacing_m;
        outline.features(&Shot { face, ..first.clone() }, size)
    };
    outlines.iter().zip(shots).enumerate().map(of).collect()
}

impl Seen {
    /// Direction to the camera, and how much of the picture it covers: 0 where it faces away.
    fn toward_camera(&self, shot: &Shot) -> (Vec3, f64) {
        let away = shot.camera.position - self.point;
        let to_camera = away.normalize_or_zero();
        let facing = f64::from(self.normal.dot(to_camera)).max(0.0);
        (to_camera, self.area * facing / f64::from(away.length_squared()).max(1e-6))
    }

    /// Light of lamps that comes here.
    fn lamps(&self, shot: &Shot) -> Vec<Arriving> {
        let lamp = |light: &LightState| {
            let (to_light, falloff) = toward(light, self.point);
            Arriving { to_light, irradiance: f64::from(light.power_linear.element_sum() * falloff / 3.0) }
        };
        shot.lights.iter().map(lamp).collect()
    }
}

/// How much displayed values of places change by light through thin parts, in the mean.
fn through(places: &[Seen], shot: &Shot, around: f64) -> f64 {
    let (mut weights, mut changes) = (0.0, 0.0);
    for place in places {
        let (to_camera, weight) = place.toward_camera(shot);
        weights += weight;
        if weight <= 0.0 || place.passes < 1e-3 {
            continue;
        }
        let lamps = place.lamps(shot);
        let behind = |lamp: &Arriving| lamp.irradiance * f64::from(-place.normal.dot(lamp.to_light)).max(0.0);
        let passed = place.passes * lamps.iter().map(behind).sum::<f64>() / PI;
        let light = SKIN.light(place.normal, to_camera, &lamps, around);
        changes += weight * (display(light + passed) - display(light));
    }
    if weights > 0.0 { changes / weights } else { 0.0 }
}

/// Mean displayed value of places that face the camera, and how much it changes with the slope of relief.
fn shown(places: &[Seen], shot: &Shot, around: f64) -> [f64; 2] {
    let stride = places.len().div_ceil(MOST_LIT).max(1);
    let (mut weights, mut values, mut squares) = (0.0, 0.0, 0.0);
    for place in places.iter().step_by(stride) {
        let (to_camera, weight) = place.toward_camera(shot);
        if weight <= 0.0 {
            continue;
        }
        let (normal, lamps) = (place.normal, place.lamps(shot));
        let displayed = |normal: Vec3| SKIN.displayed(normal, to_camera, &lamps, around);
        let value = displayed(normal);
        let (along, across) = normal.any_orthonormal_pair();
        let tilts = [along, -along, across, -across];
        let changes = tilts.map(|t| (displayed((normal + RELIEF_SLOPE * t).normalize()) - value).powi(2));
        weights += weight;
        values += weight * value;
        squares += weight * changes.iter().sum::<f64>() / 4.0;
    }
    if weights > 0.0 { [values / weights, (squares / weights).sqrt()] } else { [0.0; 2] }
}

/// Direction from a point to a lamp, and what is left of its power there.
fn toward(light: &LightState, point: Vec3) -> (Vec3, f32) {
    if light.position == Vec3::ZERO {
        return (-light.direction, 1.0);
    }
    let away = light.position - point;
    (away.normalize_or_zero(), 1.0 / away.length_squared().max(1e-4))
}

#[cfg(test)]
mod tests {
    use rubor_rig::evaluate::Evaluator;
    use rubor_rig::timeline::Sequence;

    use super::*;
    use crate::inputs;

    #[test]
    fn features_say_what_a_shot_shows() {
        let loaded = inputs::head(None).unwrap();
        let rig = inputs::rig(None, loaded.rig.clone()).unwrap();
        let outline = Outline::of(&loaded.head);
        let of = |distance: f32, lamp_z: f32, more: &str| {
            let text = format!(
                r#"{{ "fps": 1, "duration": 1, "camera": {{ "position": [0, 0, {distance}], "target": [0, 0, 0], "fovDegrees": 20 }},
                    "lights": [{{ "kind": "point", "intensity": 2, "position": [0.1, 0.2, {lamp_z}] }}] {more} }}"#
            );
            let sequence = Sequence::from_json("s", &text).unwrap();
            let (evaluator, _) = Evaluator::new(&loaded.head, &rig, &sequence).unwrap();
            outline.features(&evaluator.at(0.0), [200, 100])
        };
        let near = of(1.0, 1.0, "");
        let far = of(4.0, 1.0, "");
        assert!((far.mm_per_pixel / near.mm_per_pixel - 4.0).abs() < 0.4, "{near:?} {far:?}");
        // 1 m less the 3 to 6 cm of a face before the eyes, over 100 pixels.
        let expected = 2000.0 * 0.95 * 10f64.to_radians().tan() / 100.0;
        assert!((near.mm_per_pixel / expected - 1.0).abs() < 0.08, "{near:?}");
        assert!(far.share < near.share && far.share > 0.0);
        let behind = of(1.0, -1.0, "");
        assert!(near.backlight == 0.0 && behind.backlight > 0.8);
        assert!(behind.through > 3.0 * near.through && behind.through > 1e-3, "{near:?} {behind:?}");
        let turned = of(1.0, 1.0, r#", "head": { "yawDegrees": 60 }"#);
        assert!(near.facing > 0.98 && (turned.facing - 0.5).abs() < 0.07, "{near:?} {turned:?}");
        assert_eq!(near.contrast, 1.0);
        assert!(of(1.0, 1.0, r#", "environment": { "name": "studio", "intensity": 1 }"#).contrast < 0.6);
        assert_eq!((near.wrinkles, near.blood), (0.0, 0.0));
        let angry = of(1.0, 1.0, r#", "expressions": { "anger": 1 }"#);
        assert!(angry.wrinkles > 0.3 && angry.blood > 0.1, "{angry:?}");
        let away = r#", "head": { "translation": [5, 0, 0] }"#;
        assert_eq!(of(1.0, 1.0, away).share, 0.0, "out of view");
    }
}
