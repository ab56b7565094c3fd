//! The views of a head: from each lamp, and along the six axes of the head.

use glam::{Mat4, Vec3};

use crate::scene::{Light, LightKind, MAX_LIGHTS};

/// Axes of a head.
pub(crate) const AXES: usize = 6;
/// Layers of a head with the most lamps.
pub(crate) const MOST_LAYERS: usize = MAX_LIGHTS + AXES;
/// Room around the bounds of a head, relative to them: expressions leave the bounds of the neutral face.
const ROOM: f32 = 1.06;
/// Metres from the plane that a parallel view starts from to the head, and the least distance of a lamp.
const NEAR_METRES: f32 = 0.005;
/// Largest tangent of half the angle of a lamp's view: of a lamp within or close to the head.
const WIDEST: f32 = 3.0;

/// A view as common.wesl reads it; the fields are described there.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Layer {
    pub(crate) origin: [f32; 4],
    pub(crate) forward: [f32; 4],
    pub(crate) right: [f32; 4],
    pub(crate) up: [f32; 4],
    pub(crate) extent: [f32; 4],
}

/// Corners of the box of a head in the world, with room.
pub(crate) fn corners((low, high): (Vec3, Vec3), world_from_head: &Mat4) -> [Vec3; 8] {
    let (middle, half) = (0.5 * (low + high), 0.5 * ROOM * (high - low).max(Vec3::splat(1e-4)));
    std::array::from_fn(|i| {
        let sign = |bit: usize| if i >> bit & 1 == 0 { -1.0 } else { 1.0 };
        world_from_head.transform_point3(middle + half * Vec3::new(sign(0), sign(1), sign(2)))
    })
}

fn basis(forward: Vec3, up: Vec3) -> [Vec3; 2] {
    let right = forward.cross(up).normalize_or(Vec3::X);
    [right, right.cross(forward)]
}

impl Layer {
    /// A parallel view that the corners fill. `up` is at an angle to `forward`.
    pub(crate) fn parallel(forward: Vec3, up: Vec3, corners: &[Vec3; 8], lamp: f32) -> Self {
        let [right, up] = basis(forward, up);
        let range = |axis: Vec3| {
            let along = corners.map(|c| c.dot(axis));
            (
                along.into_iter().fold(f32::INFINITY, f32::min),
                along.into_iter().fold(f32::NEG_INFINITY, f32::max),
            )
        };
        let [x, y, z] = [right, up, forward].map(range);
        let half = |(low, high): (f32, f32)| 0.5 * (high - low);
        let middle = |(low, high): (f32, f32)| 0.5 * (high + low);
        let origin = right * middle(x) + up * middle(y) + forward * (z.0 - NEAR_METRES);
        Self {
            origin: origin.extend(0.0).to_array(),
            forward: forward.extend(0.5 * NEAR_METRES).to_array(),
            right: (right / half(x)).extend(0.0).to_array(),
            up: (up / half(y)).extend(0.0).to_array(),
            extent: [half(x), half(y), z.1 - z.0 + 2.0 * NEAR_METRES, lamp],
        }
    }

    /// A view from a place that the corners fill; from among them one as wide as a view may be.
    fn perspective(eye: Vec3, corners: &[Vec3; 8], lamp: f32) -> Self {
        let center = corners.iter().sum::<Vec3>() / 8.0;
        let forward = (center - eye).normalize_or(Vec3::NEG_Z);
        let [right, up] = basis(forward, if forward.y.abs() > 0.9 { Vec3::X } else { Vec3::Y });
        let (mut low, mut high) = ([f32::INFINITY; 2], [f32::NEG_INFINITY; 2]);
        let (mut near, mut far) = (f32::INFINITY, NEAR_METRES);
        for corner in corners {
            let v = *corner - eye;
            let z = v.dot(forward);
            (near, far) = (near.min(z), far.max(z));
            for (k, axis) in [right, up].into_iter().enumerate() {
                let at = match z > NEAR_METRES {
                    true => (v.dot(axis) / z).clamp(-WIDEST, WIDEST),
                    // Beside or behind the lamp: on either side of the view.
                    false => WIDEST.copysign(v.dot(axis)),
                };
                (low[k], high[k]) = (low[k].min(at), high[k].max(at));
            }
        }
        let half = [0, 1].map(|k| (0.5 * (high[k] - low[k])).max(1e-4));
        let shift = [0, 1].map(|k| -0.5 * (high[k] + low[k]) / half[k]);
        let near = near.max(NEAR_METRES);
        Self {
            origin: eye.extend(1.0).to_array(),
            forward: forward.extend(0.5 * near).to_array(),
            right: (right / half[0]).extend(shift[0]).to_array(),
            up: (up / half[1]).extend(shift[1]).to_array(),
            extent: [half[0], half[1], far + NEAR_METRES, lamp],
        }
    }

    /// The view of a lamp, whose number it carries.
    pub(crate) fn of_lamp(kind: &LightKind, number: usize, corners: &[Vec3; 8]) -> Self {
        match *kind {
            LightKind::Directional { direction } => {
                let forward = direction.normalize_or(Vec3::NEG_Z);
                let up = if forward.y.abs() > 0.9 { Vec3::X } else { Vec3::Y };
                Self::parallel(forward, up, corners, number as f32)
            }
            LightKind::Point { position } | LightKind::Spot { position, .. } => {
                Self::perspective(position, corners, number as f32)
            }
        }
    }

    /// Mean side of a texel of a parallel view, mm.
    pub(crate) fn texel_mm(&self, side: u32) -> f32 {
        1e3 * (self.extent[0] + self.extent[1]) / side as f32
    }
}

/// Whether a lamp gives light.
pub(crate) fn shines(light: &Light) -> bool {
    light.color_linear.max_element() > 0.0
}

/// The layers of a head: lamps that shine and cast shadows, then the axes. Returns how many are lamps.
pub(crate) fn layers(
    bounds: (Vec3, Vec3),
    world_from_head: &Mat4,
    lights: &[Light],
) -> ([Layer; MOST_LAYERS], usize) {
    let corners = corners(bounds, world_from_head);
    let mut all: [Layer; MOST_LAYERS] = bytemuck::Zeroable::zeroed();
    let mut lamps = 0;
    for (number, light) in
        lights.iter().take(MAX_LIGHTS).enumerate().filter(|(_, l)| l.casts_shadow && shines(l))
    {
        all[lamps] = Layer::of_lamp(&light.kind, number, &corners);
        lamps += 1;
    }
    for (slot, axis) in all[lamps..].iter_mut().zip(axes()) {
        let world = |v: Vec3| world_from_head.transform_vector3(v).normalize_or(Vec3::Z);
        let up = if axis.y == 0.0 { Vec3::Y } else { Vec3::Z };
        *slot = Layer::parallel(world(axis), world(up), &corners, -1.0);
    }
    (all, lamps)
}

/// Directions of the six views, in the head.
fn axes() -> [Vec3; AXES] {
    [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z]
}
