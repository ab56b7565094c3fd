//! What a head may do without, and what each of it costs.

use std::collections::BTreeSet;

use rubor_assets::export::gltf::sizes::Sizes;
use rubor_renderer::footprint;
use rubor_rig::expression::Rig;
use rubor_rig::face_state::FaceState;
use rubor_rig::framing::FaceFrame;
use rubor_rig::head::{BlendShape, Head, Material};
use rubor_rig::names::Resolver;
use rubor_rig::reduce::{MapKind, Reduction};

use super::looks::Look;
use crate::report::BudgetKind;

/// Bytes on the device of a point that a shape moves or hides.
const DELTA_BYTES: u64 = 16;

/// Something that a head may do without.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Subject {
    Shape(usize),
    Distribution(usize),
    Zone(usize),
    Part(usize),
    Map(MapKind),
    Hairs,
}

impl Subject {
    pub(super) fn kind(self) -> BudgetKind {
        match self {
            Self::Shape(_) => BudgetKind::Shape,
            Self::Distribution(_) => BudgetKind::Distribution,
            Self::Zone(_) => BudgetKind::Zone,
            Self::Part(_) => BudgetKind::Part,
            Self::Map(_) => BudgetKind::Map,
            Self::Hairs => BudgetKind::Hairs,
        }
    }

    pub(super) fn name(self, head: &Head) -> String {
        match self {
            Self::Shape(i) => head.shapes[i].name.clone(),
            Self::Distribution(i) => head.maps.distributions[i].name.clone(),
            Self::Zone(i) => head.maps.zones[i].name.clone(),
            Self::Part(i) => head.mesh.parts[i].name.clone(),
            Self::Map(kind) => kind.name().to_owned(),
            Self::Hairs => "hairs of the scalp".to_owned(),
        }
    }

    /// Takes it out of a head, or makes it smaller: a map has half its sides with each level, and hairs half their number, on the
    /// last level none.
    pub(super) fn leave_out(self, level: u32, hairs: u32, less: &mut Reduction) {
        match self {
            Self::Shape(i) => {
                less.shapes.insert(i);
            }
            Self::Distribution(i) => {
                less.distributions.insert(i);
            }
            Self::Zone(i) => {
                less.zones.insert(i);
            }
            Self::Part(i) => {
                less.parts.insert(i);
            }
            Self::Map(kind) => {
                less.halvings.insert(kind, level);
            }
            Self::Hairs => less.hairs = Some(hairs_at(level, hairs)),
        }
    }

    /// Levels that it has at most.
    pub(super) fn levels(self, head: &Head) -> u32 {
        match self {
            Self::Map(kind) => {
                let side = kind.size(&head.maps, &head.authored).map_or(1, |size| size[0].max(size[1]));
                side.max(1).ilog2()
            }
            Self::Hairs => HAIR_LEVELS,
            _ => 1,
        }
    }
}

/// Levels of hairs: a half to a 64th of them, then none.
const HAIR_LEVELS: u32 = 7;

/// Hairs at a level.
pub(super) fn hairs_at(level: u32, hairs: u32) -> u32 {
    if level >= HAIR_LEVELS { 0 } else { hairs >> level }
}

/// Weights of shapes, zones and distributions that some frame has, the largest of each.
#[derive(Clone, Debug, Default)]
pub(super) struct Use {
    pub(super) shapes: Vec<f32>,
    pub(super) zones: Vec<f32>,
    pub(super) distributions: Vec<f32>,
}

impl Use {
    pub(super) fn add(&mut self, face: &FaceState) {
        let most = |all: &mut Vec<f32>, weights: &[f32]| {
            all.resize(weights.len(), 0.0);
            all.iter_mut().zip(weights).for_each(|(a, w)| *a = a.max(w.abs()));
        };
        most(&mut self.shapes, &face.shapes);
        most(&mut self.zones, &face.zones);
        most(&mut self.distributions, &face.distributions);
    }

    pub(super) fn of(&self, subject: Subject) -> Option<f32> {
        match subject {
            Subject::Shape(i) => self.shapes.get(i).copied(),
            Subject::Distribution(i) => self.distributions.get(i).copied(),
            Subject::Zone(i) => self.zones.get(i).copied(),
            _ => None,
        }
    }

    /// What no frame shows. A shape whose in-betweens act is driven, although its own weight may be 0.
    pub(super) fn unused(&self, head: &Head, rig: &Rig) -> Reduction {
        let still = |weights: &[f32]| -> BTreeSet<usize> {
            weights.iter().enumerate().filter(|(_, w)| **w == 0.0).map(|(i, _)| i).collect()
        };
        let mut shapes = still(&self.shapes);
        let names = Resolver::shapes(head);
        for inbetween in &rig.inbetweens {
            let acts = names.resolve(&inbetween.target).iter().any(|t| !shapes.contains(&(t.index as usize)));
            if acts {
                for driven in names.resolve(&inbetween.shape) {
                    shapes.remove(&(driven.index as usize));
                }
            }
        }
        let hidden = head.mesh.parts.iter().enumerate().filter(|(_, p)| p.material == Material::Hidden);
        Reduction {
            shapes,
            zones: still(&self.zones),
            distributions: still(&self.distributions),
            parts: hidden.map(|(i, _)| i).filter(|i| may_go(head, *i)).collect(),
            ..Reduction::default()
        }
    }
}

/// Whether a part may go: the head has others, and the camera of a sequence stays where it is.
pub(super) fn may_go(head: &Head, part: usize) -> bool {
    let less = Reduction { parts: [part].into(), ..Reduction::default() };
    let bare = Head { mesh: head.mesh.clone(), landmarks: head.landmarks.clone(), ..Head::default() };
    let reduced = less.head(&bare);
    !reduced.mesh.triangles.is_empty() && FaceFrame::of(&reduced) == FaceFrame::of(head)
}

/// Everything to try on a head with this number of hairs, of which what is not used goes in any case.
pub(super) fn subjects(head: &Head, hairs: u32, unused: &Reduction) -> Vec<Subject> {
    let has_maps = head.maps.melanin.is_some() && head.maps.hemoglobin.is_some();
    let is_drawn = |kind: &MapKind| match kind {
        MapKind::Pictures => true,
        MapKind::Distributions => has_maps && unused.distributions.len() < head.maps.distributions.len(),
        MapKind::WrinkleSlopes | MapKind::ZoneMasks => has_maps && unused.zones.len() < head.maps.zones.len(),
        _ => has_maps,
    };
    let mut all: Vec<Subject> = (0..head.shapes.len()).map(Subject::Shape).collect();
    all.extend((0..head.maps.distributions.len()).map(Subject::Distribution));
    all.extend((0..head.maps.zones.len()).map(Subject::Zone));
    let parts = head.mesh.parts.iter().enumerate().filter(|(_, p)| p.material != Material::Skin);
    all.extend(parts.map(|(i, _)| Subject::Part(i)));
    let large = |kind: &MapKind| {
        kind.size(&head.maps, &head.authored).is_some_and(|[width, height]| width.max(height) > 1)
    };
    all.extend(MapKind::ALL.into_iter().filter(|k| is_drawn(k) && large(k)).map(Subject::Map));
    all.extend((hairs > 0).then_some(Subject::Hairs));
    all
}

/// The part of its wrinkle map that goes with a zone: all of it with the last zone that is used, and equal parts with zones of which none
/// is; else none.
fn part_of_map(head: &Head, zone: usize, unused: &Reduction, bytes: u64) -> u64 {
    let zones = &head.maps.zones;
    let map = zones[zone].wrinkle_map;
    let sharing: Vec<usize> = (0..zones.len()).filter(|i| zones[*i].wrinkle_map == map).collect();
    let used: Vec<&usize> = sharing.iter().filter(|i| !unused.zones.contains(i)).collect();
    match used[..] {
        [] => bytes / sharing.len() as u64,
        [only] if *only == zone => bytes,
        _ => 0,
    }
}

/// Bytes on the device of what only weights decide; of what shares a texture its part of it. `None` of anything else.
pub(super) fn device_bytes(head: &Head, subject: Subject, unused: &Reduction) -> Option<u64> {
    let texture = |name: &str| {
        footprint::of_maps(&head.maps).into_iter().find(|f| f.texture == name).map_or(0, |f| f.bytes)
    };
    match subject {
        Subject::Shape(i) => Some(DELTA_BYTES * changes(&head.shapes[i])),
        Subject::Distribution(_) => Some(texture("distributions") / head.maps.distributions.len() as u64),
        Subject::Zone(i) => {
            let of_map = texture("wrinkles") / head.maps.wrinkle_slopes.len().max(1) as u64;
            let mask = texture("zone masks") / head.maps.zones.len() as u64;
            Some(mask + part_of_map(head, i, unused, of_map))
        }
        _ => None,
    }
}

/// Points that a shape moves or hides.
fn changes(shape: &BlendShape) -> u64 {
    let hidden = shape.occlusion.iter().filter(|c| shape.points.binary_search(&c.point).is_err()).count();
    (shape.points.len() + hidden) as u64
}

/// Bytes in a file of the whole head that going, or a level, saves.
pub(super) fn file_bytes(
    head: &Head,
    sizes: &Sizes,
    subject: Subject,
    level: u32,
    unused: &Reduction,
) -> u64 {
    let image = |name: &str| sizes.images.get(name).copied().unwrap_or(0);
    let maps = &head.maps;
    let wrinkles = |map: usize| image(&format!("wrinkle slopes {map}"));
    // Images of masks are called by the zones that share them.
    let mask = |name: &str| -> u64 {
        let shared = sizes.images.iter().map(|(image, bytes)| (image.split(", "), bytes));
        let mut found = shared.filter(|(zones, _)| zones.clone().any(|zone| zone == name));
        found.next().map_or(0, |(zones, bytes)| bytes / zones.count() as u64)
    };
    let of_distribution = |i: usize| {
        let name = &maps.distributions[i].name;
        image(&format!("{name} scale")) + image(&format!("{name} bias"))
    };
    let smaller = |bytes: u64| bytes - (bytes >> (2 * level).min(63));
    match subject {
        Subject::Shape(i) => sizes.shapes.get(&head.shapes[i].name).copied().unwrap_or(0),
        Subject::Distribution(i) => of_distribution(i),
        Subject::Zone(i) => {
            let map = wrinkles(maps.zones[i].wrinkle_map as usize);
            mask(&maps.zones[i].name) + part_of_map(head, i, unused, map)
        }
        Subject::Part(i) => sizes.parts.get(i).copied().unwrap_or(0),
        Subject::Map(kind) => smaller(match kind {
            MapKind::Distributions => {
                (0..maps.distributions.len()).map(of_distribution).sum::<u64>() + image("hemoglobin mean")
            }
            MapKind::WrinkleSlopes => (0..maps.wrinkle_slopes.len()).map(wrinkles).sum(),
            MapKind::ZoneMasks => maps.zones.iter().map(|z| mask(&z.name)).sum(),
            MapKind::Pictures => (head.authored.images.iter()).map(|i| image(&i.name)).sum(),
            single => image(single.name()),
        }),
        Subject::Hairs => 0,
    }
}

/// How far a shape moves the surface in a look, at most, pixels: seen across, at the distance of the camera's target.
pub(super) fn pixels(shape: &BlendShape, index: usize, look: &Look, height: u32) -> f64 {
    let weight = look.shot.face.shapes.get(index).copied().unwrap_or(0.0).abs();
    let metres = shape.offsets.iter().map(|o| o.length()).fold(0.0, f32::max) * weight;
    let camera = &look.shot.camera;
    let distance = (camera.position - camera.target).length().max(1e-3);
    f64::from(metres * 0.5 * height as f32 / (distance * (0.5 * camera.fov_y).tan()))
}

#[cfg(test)]
mod tests {
    use rubor_rig::head::{SkinMaps, WrinkleZone};
    use rubor_rig::map::Map;

    use super::*;

    #[test]
    fn a_wrinkle_map_is_worth_something_to_its_last_zone_alone() {
        let zone =
            |wrinkle_map| WrinkleZone { name: String::new(), wrinkle_map, mask: Map::filled(1, 1, &[1.0]) };
        let head = Head {
            maps: SkinMaps { zones: [0, 0, 1].map(zone).to_vec(), ..SkinMaps::default() },
            ..Head::default()
        };
        let parts = |unused: &[usize]| {
            let unused = Reduction { zones: unused.iter().copied().collect(), ..Reduction::default() };
            [0, 1, 2].map(|zone| part_of_map(&head, zone, &unused, 100))
        };
        assert_eq!(parts(&[]), [0, 0, 100]);
        assert_eq!(parts(&[1]), [100, 0, 100]);
        assert_eq!(parts(&[0, 1]), [50, 50, 100]);
    }
}
