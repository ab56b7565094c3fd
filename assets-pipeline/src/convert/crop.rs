//! Parts of a head: chosen triangles with the points, vertices and offsets that they need.

use rubor_rig::head::{BlendShape, Head, Part, Vertex};
use rubor_rig::names::is_known_shape;

/// What was taken away.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Dropped {
    /// Triangles.
    pub triangles: usize,
    /// Names of parts of which nothing is left.
    pub parts: Vec<String>,
    /// Names of shapes that moved something and now move nothing: they are gone too.
    pub shapes: Vec<String>,
}

/// How the head of a whole figure was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HeadBy {
    /// Its vertices follow joints of head and neck.
    Joints,
    /// It is around the points that shapes of the face move.
    Shapes,
}

/// Keeps the triangles for which `keep` is true of their index. All may be taken away: look at the head after it.
pub fn retain(head: &mut Head, keep: impl Fn(usize) -> bool) -> Dropped {
    const NONE: u32 = u32::MAX;
    let mut dropped = Dropped::default();
    let old = std::mem::take(&mut head.mesh);
    let authored = &mut head.authored;
    let of_parts = std::mem::take(&mut authored.of_parts);
    let (second_uvs, colors) =
        (std::mem::take(&mut authored.second_uvs), std::mem::take(&mut authored.colors_linear));
    let normals = std::mem::take(&mut authored.normals);
    let mut new_point = vec![NONE; old.points.len()];
    let mut new_vertex = vec![NONE; old.vertices.len()];
    let mesh = &mut head.mesh;
    for (p, part) in old.parts.into_iter().enumerate() {
        let start = mesh.triangles.len() as u32;
        for t in part.triangles.start as usize..part.triangles.end as usize {
            if !keep(t) {
                dropped.triangles += 1;
                continue;
            }
            let triangle = old.triangles[t].map(|v| {
                let vertex = &mut new_vertex[v as usize];
                if *vertex == NONE {
                    *vertex = mesh.vertices.len() as u32;
                    let Vertex { point, uv } = old.vertices[v as usize];
                    let new = &mut new_point[point as usize];
                    if *new == NONE {
                        *new = mesh.points.len() as u32;
                        mesh.points.push(old.points[point as usize]);
                        mesh.occlusion.extend(old.occlusion.get(point as usize));
                    }
                    mesh.vertices.push(Vertex { point: *new, uv });
                    authored.second_uvs.extend(second_uvs.get(v as usize));
                    authored.colors_linear.extend(colors.get(v as usize));
                    authored.normals.extend(
                        (!normals.is_empty()).then(|| normals.get(v as usize).copied().unwrap_or_default()),
                    );
                }
                *vertex
            });
            mesh.triangles.push(triangle);
        }
        let end = mesh.triangles.len() as u32;
        if end > start {
            authored.of_parts.resize(mesh.parts.len(), None);
            authored.of_parts.push(of_parts.get(p).copied().flatten());
            mesh.parts.push(Part { triangles: start..end, ..part });
        } else {
            dropped.parts.push(part.name);
        }
    }
    // Materials and pictures that nothing shows any more.
    drop_unused(head);
    head.shapes.retain_mut(|shape| {
        let moved_before = !shape.points.is_empty();
        renumber(shape, &new_point);
        let is_kept = !moved_before || !shape.points.is_empty();
        if !is_kept {
            dropped.shapes.push(shape.name.clone());
        }
        is_kept
    });
    dropped
}

fn renumber(shape: &mut BlendShape, new_point: &[u32]) {
    let place = |point: u32| new_point.get(point as usize).copied().filter(|p| *p != u32::MAX);
    let mut moved: Vec<_> =
        shape.points.iter().zip(&shape.offsets).filter_map(|(p, o)| Some((place(*p)?, *o))).collect();
    moved.sort_unstable_by_key(|(p, _)| *p);
    (shape.points, shape.offsets) = moved.into_iter().unzip();
    shape.occlusion.retain_mut(|change| match place(change.point) {
        Some(point) => {
            change.point = point;
            true
        }
        None => false,
    });
    shape.occlusion.sort_unstable_by_key(|c| c.point);
}

/// Drops materials that no part has and pictures that no material shows.
fn drop_unused(head: &mut Head) {
    let authored = &mut head.authored;
    let mut new_material = vec![None; authored.materials.len()];
    let mut materials = Vec::new();
    for of_part in authored.of_parts.iter_mut().flatten() {
        let old = *of_part as usize;
        let new = *new_material[old].get_or_insert_with(|| {
            materials.push(authored.materials[old].clone());
            materials.len() as u32 - 1
        });
        *of_part = new;
    }
    let mut images = std::mem::take(&mut authored.images);
    let mut new_image = vec![None; images.len()];
    for material in &mut materials {
        for texture in material.textures_mut().into_iter().flatten() {
            let old = texture.image as usize;
            texture.image = *new_image[old].get_or_insert_with(|| {
                authored.images.push(std::mem::take(&mut images[old]));
                authored.images.len() as u32 - 1
            });
        }
    }
    authored.materials = materials;
}

/// Keeps the head of a whole figure. `head_share` says how much each vertex follows the joints of head and neck; where it
/// is empty the head is a box around what shapes of the face move. `None`, and nothing is changed, where neither says it.
pub fn to_head(head: &mut Head, head_share: &[f32]) -> Option<(HeadBy, Dropped)> {
    let triangles = head.mesh.triangles.clone();
    if head_share.len() == head.mesh.vertices.len() && !head_share.is_empty() {
        let share = |t: usize| triangles[t].iter().map(|v| head_share[*v as usize]).sum::<f32>() / 3.0;
        if !(0..triangles.len()).any(|t| share(t) >= 0.5) {
            return None;
        }
        return Some((HeadBy::Joints, retain(head, |t| share(t) >= 0.5)));
    }
    let (low, high) = face_box(head)?;
    let (center, height) = (0.5 * (low + high), high.y - low.y);
    let corners: Vec<glam::Vec3> =
        head.mesh.vertices.iter().map(|v| head.mesh.points[v.point as usize]).collect();
    // From half a face below the chin, that is the throat, up to the hair; ears and back of the head are 1.5 faces away.
    let is_inside = |p: glam::Vec3| {
        let d = (p - center) / height;
        d.x.abs() < 1.2 && d.y > -1.0 && d.y < 2.0 && d.z > -1.8 && d.z < 1.2
    };
    let is_head = |t: usize| triangles[t].iter().all(|v| is_inside(corners[*v as usize]));
    Some((HeadBy::Shapes, retain(head, is_head)))
}

/// Around the points that shapes of the face move: those with known names, else all.
pub(super) fn face_box(head: &Head) -> Option<(glam::Vec3, glam::Vec3)> {
    let has_known = head.shapes.iter().any(|s| is_known_shape(&s.name));
    let shapes = head.shapes.iter().filter(|s| !has_known || is_known_shape(&s.name));
    // Of each shape, what moves by a tenth of its longest way: skin far away often moves by a little.
    let moved = shapes.flat_map(|s| {
        let least = 0.1 * s.offsets.iter().map(|o| o.length()).fold(0.0, f32::max);
        let far = s.points.iter().zip(&s.offsets).filter(move |(_, o)| o.length() > least);
        far.map(|(p, _)| head.mesh.points[*p as usize])
    });
    let bounds = moved.fold(None, |bounds: Option<(glam::Vec3, glam::Vec3)>, p| {
        let (low, high) = bounds.unwrap_or((p, p));
        Some((low.min(p), high.max(p)))
    });
    bounds.filter(|(low, high)| high.y > low.y)
}

#[cfg(test)]
mod tests {
    use glam::{Vec2, Vec3};
    use rubor_rig::authored::{AuthoredImage, AuthoredMaterial, AuthoredTexture, TextureTransform};
    use rubor_rig::head::Material;

    use super::*;

    /// Two triangles a part, one above the other; a shape moves the upper one.
    fn figure() -> Head {
        let mut head = Head::default();
        for (p, y) in [0.0_f32, 1.5].into_iter().enumerate() {
            let first = head.mesh.vertices.len() as u32;
            for (k, corner) in [[-0.1, 0.0], [0.1, 0.0], [0.0, 0.1]].into_iter().enumerate() {
                head.mesh.points.push(Vec3::new(corner[0], y + corner[1], 0.0));
                head.mesh.vertices.push(Vertex { point: first + k as u32, uv: Vec2::ZERO });
                head.authored.second_uvs.push(Vec2::splat(p as f32));
            }
            head.mesh.triangles.push([first, first + 1, first + 2]);
            let triangles = p as u32..p as u32 + 1;
            head.mesh.parts.push(Part { name: format!("part {p}"), material: Material::Other, triangles });
            let image =
                AuthoredImage { name: format!("image {p}"), width: 1, height: 1, rgba: vec![p as u8; 4] };
            head.authored.images.push(image);
            let texture = AuthoredTexture {
                image: p as u32,
                uv_set: 0,
                transform: TextureTransform::default(),
                wrap: Default::default(),
            };
            head.authored
                .materials
                .push(AuthoredMaterial { base_color_texture: Some(texture), ..AuthoredMaterial::default() });
            head.authored.of_parts.push(Some(p as u32));
        }
        let shape = |name: &str, points: Vec<u32>| BlendShape {
            name: name.into(),
            offsets: vec![Vec3::Z * 0.01; points.len()],
            points,
            ..BlendShape::default()
        };
        head.shapes = vec![shape("waist", vec![0]), shape("jawOpen", vec![3, 4, 5])];
        head
    }

    #[test]
    fn the_head_of_a_figure_stays_by_joints_or_by_the_face() {
        for (share, expected) in
            [(vec![0.0, 0.0, 0.2, 1.0, 1.0, 0.9], HeadBy::Joints), (Vec::new(), HeadBy::Shapes)]
        {
            let mut head = figure();
            let (by, dropped) = to_head(&mut head, &share).expect("a head");
            head.validate().expect("a valid head");
            assert_eq!(by, expected);
            assert_eq!(dropped.triangles, 1);
            assert_eq!(
                (dropped.parts, dropped.shapes),
                (vec!["part 0".to_owned()], vec!["waist".to_owned()])
            );
            assert_eq!(head.mesh.points.len(), 3);
            assert!(head.mesh.points.iter().all(|p| p.y >= 1.5));
            assert_eq!(head.shapes[0].points, [0, 1, 2], "offsets keep their points");
            assert_eq!(head.authored.second_uvs, vec![Vec2::ONE; 3]);
            assert_eq!(head.authored.of_parts, [Some(0)]);
            assert_eq!(head.authored.images.len(), 1);
            assert_eq!(head.authored.images[0].name, "image 1");
        }
    }

    #[test]
    fn a_figure_that_says_nothing_of_its_head_stays_whole() {
        let mut head = figure();
        head.shapes.clear();
        assert!(to_head(&mut head, &[]).is_none());
        assert!(to_head(&mut head, &[0.1; 6]).is_none());
        assert_eq!(head.mesh.triangles.len(), 2);
    }
}
