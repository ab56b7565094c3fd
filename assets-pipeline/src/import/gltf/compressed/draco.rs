//! Draco meshes, decoded by `draco-core`.

use draco_core::{DataType, DecodeLimits, DecoderBuffer, MeshDecoder, PointAttribute, PointIndex};

/// Points, and faces, of a mesh.
const MOST_ELEMENTS: u64 = 1 << 24;

/// Component types of glTF.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Number {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Number {
    pub(super) fn of_gltf(code: usize) -> Option<Self> {
        match code {
            5120 => Some(Self::I8),
            5121 => Some(Self::U8),
            5122 => Some(Self::I16),
            5123 => Some(Self::U16),
            5125 => Some(Self::U32),
            5126 => Some(Self::F32),
            _ => None,
        }
    }

    fn append(self, value: f64, to: &mut Vec<u8>) {
        match self {
            Self::I8 => to.extend((value as i8).to_le_bytes()),
            Self::U8 => to.extend((value as u8).to_le_bytes()),
            Self::I16 => to.extend((value as i16).to_le_bytes()),
            Self::U16 => to.extend((value as u16).to_le_bytes()),
            Self::U32 => to.extend((value as u32).to_le_bytes()),
            Self::F32 => to.extend((value as f32).to_le_bytes()),
        }
    }
}

/// A decoded mesh.
pub(super) struct Mesh(draco_core::Mesh);

impl Mesh {
    /// Decodes at most `room` bytes of attributes; the error says why not.
    pub(super) fn decode(data: &[u8], room: usize) -> Result<Self, String> {
        let limits = DecodeLimits::default()
            .with_max_points(MOST_ELEMENTS)
            .with_max_faces(MOST_ELEMENTS)
            .with_max_decoded_bytes(room as u64);
        let mut mesh = draco_core::Mesh::new();
        let mut buffer = DecoderBuffer::new(data).with_limits(limits);
        MeshDecoder::new().decode(&mut buffer, &mut mesh).map_err(|e| e.to_string())?;
        let points = mesh.num_points() as u64;
        if points > MOST_ELEMENTS {
            return Err(format!("{points} points"));
        }
        Ok(Self(mesh))
    }

    pub(super) fn points(&self) -> usize {
        self.0.num_points()
    }

    /// Three points of each triangle.
    pub(super) fn indices(&self) -> Vec<u32> {
        self.0.faces().iter().flatten().map(|point| point.0).collect()
    }

    /// Values of an attribute for each point, and the distance of two of them in bytes; `None` where there is no such
    /// attribute or it has another number of components.
    pub(super) fn attribute(&self, id: u32, kind: Number, components: usize) -> Option<(Vec<u8>, usize)> {
        let attribute = self.0.attribute_by_unique_id(id)?;
        if usize::from(attribute.num_components()) != components {
            return None;
        }
        let mut bytes = Vec::new();
        let mut stride = 0;
        for point in 0..self.points() {
            let start = bytes.len();
            for k in 0..components {
                kind.append(number(attribute, point, k)?, &mut bytes);
            }
            // As glTF has it for vertices.
            bytes.resize(bytes.len().next_multiple_of(4), 0);
            stride = bytes.len() - start;
        }
        Some((bytes, stride.max(4)))
    }
}

fn number(attribute: &PointAttribute, point: usize, component: usize) -> Option<f64> {
    let value = attribute.mapped_index(PointIndex(u32::try_from(point).ok()?)).0 as usize;
    let kind = attribute.data_type();
    let width = match kind {
        DataType::Int8 | DataType::Uint8 | DataType::Bool => 1,
        DataType::Int16 | DataType::Uint16 => 2,
        DataType::Int32 | DataType::Uint32 | DataType::Float32 => 4,
        _ => return None,
    };
    let stride = usize::try_from(attribute.byte_stride()).ok()?;
    let start = value.checked_mul(stride)?.checked_add(component * width)?;
    let b = attribute.buffer().data().get(start..start.checked_add(width)?)?;
    Some(match kind {
        DataType::Int8 => f64::from(b[0] as i8),
        DataType::Uint8 | DataType::Bool => f64::from(b[0]),
        DataType::Int16 => f64::from(i16::from_le_bytes([b[0], b[1]])),
        DataType::Uint16 => f64::from(u16::from_le_bytes([b[0], b[1]])),
        DataType::Int32 => f64::from(i32::from_le_bytes([b[0], b[1], b[2], b[3]])),
        DataType::Uint32 => f64::from(u32::from_le_bytes([b[0], b[1], b[2], b[3]])),
        _ => f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]])),
    })
}
