//! Accessors with every range checked: dense, sparse, normalized, strided.

use gltf::Accessor;
use gltf::accessor::DataType;

use super::document::{Document, Share};
use crate::error::ImportError;

/// Elements as floats; integers are scaled to 0..1 or -1..1 when normalized.
pub(super) fn floats<const N: usize>(
    document: &Document,
    at: &str,
    accessor: &Accessor<'_>,
) -> Result<Vec<[f32; N]>, ImportError> {
    check(document, at, accessor, N)?;
    let read = |bytes: &[u8]| component(bytes, accessor.data_type(), accessor.normalized());
    let size = accessor.data_type().size();
    let element = |bytes: &[u8]| std::array::from_fn(|k| read(&bytes[k * size..]));
    let mut values = match accessor.view() {
        Some(view) => {
            let data = strided(document, at, &view, accessor.offset(), accessor.count(), N * size)?;
            data.map(element).collect()
        }
        None => vec![[0.0; N]; accessor.count()],
    };
    if let Some(sparse) = accessor.sparse() {
        let (indices, replaced) = (sparse.indices(), sparse.values());
        let width = indices.index_type().size();
        let places = strided(document, at, &indices.view(), indices.offset(), sparse.count(), width)?;
        let new = strided(document, at, &replaced.view(), replaced.offset(), sparse.count(), N * size)?;
        for (place, bytes) in places.zip(new) {
            let place = integer(place);
            let Some(value) = values.get_mut(place) else {
                let expected = format!("an element below {}", accessor.count());
                return Err(document.fail(at, format!("sparse index {place}"), expected));
            };
            *value = element(bytes);
        }
    }
    if let Some(i) = values.iter().position(|v| v.iter().any(|c| !c.is_finite())) {
        return Err(document.fail(at, format!("{:?} in element {i}", values[i]), "finite numbers"));
    }
    Ok(values)
}

/// Elements as unsigned integers.
pub(super) fn integers(
    document: &Document,
    at: &str,
    accessor: &Accessor<'_>,
) -> Result<Vec<u32>, ImportError> {
    check(document, at, accessor, 1)?;
    if !matches!(accessor.data_type(), DataType::U8 | DataType::U16 | DataType::U32) {
        return Err(document.fail(at, format!("{:?} indices", accessor.data_type()), "unsigned integers"));
    }
    let Some(view) = accessor.view() else { return Ok(vec![0; accessor.count()]) };
    let size = accessor.data_type().size();
    let data = strided(document, at, &view, accessor.offset(), accessor.count(), size)?;
    Ok(data.map(|bytes| integer(bytes) as u32).collect())
}

/// The accessor that the extension names.
pub(super) fn by_index<'a>(
    document: &'a Document,
    at: &str,
    index: u32,
) -> Result<Accessor<'a>, ImportError> {
    document.gltf.accessors().nth(index as usize).ok_or_else(|| {
        let expected = format!("one of {}", document.gltf.accessors().count());
        document.fail(at, format!("accessor {index}"), expected)
    })
}

fn check(
    document: &Document,
    at: &str,
    accessor: &Accessor<'_>,
    components: usize,
) -> Result<(), ImportError> {
    let found = accessor.dimensions().multiplicity();
    if found != components {
        return Err(document.fail(at, format!("{found} components"), format!("{components}")));
    }
    document.take(at, Share::Numbers, accessor.count().saturating_mul(components))
}

/// Byte slices of the elements of a view.
fn strided<'a>(
    document: &'a Document,
    at: &str,
    view: &gltf::buffer::View<'_>,
    offset: usize,
    count: usize,
    size: usize,
) -> Result<impl Iterator<Item = &'a [u8]> + use<'a>, ImportError> {
    let bytes = document.view(at, view)?;
    let stride = view.stride().unwrap_or(size).max(size);
    let length = count.checked_sub(1).map_or(Some(0), |n| n.checked_mul(stride)?.checked_add(size));
    let inside = length.and_then(|l| offset.checked_add(l)).and_then(|end| bytes.get(offset..end));
    let Some(inside) = inside else {
        let found = format!("{count} elements of {stride} bytes from byte {offset}");
        return Err(document.fail(
            at,
            found,
            format!("a place inside view {} of {} bytes", view.index(), bytes.len()),
        ));
    };
    Ok((0..count).map(move |i| &inside[i * stride..i * stride + size]))
}

fn integer(bytes: &[u8]) -> usize {
    bytes.iter().rev().fold(0, |value, b| value << 8 | usize::from(*b))
}

fn component(b: &[u8], kind: DataType, normalized: bool) -> f32 {
    let (value, full) = match kind {
        DataType::F32 => return f32::from_le_bytes([b[0], b[1], b[2], b[3]]),
        DataType::U32 => (u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as f32, u32::MAX as f32),
        DataType::U16 => (f32::from(u16::from_le_bytes([b[0], b[1]])), 65535.0),
        DataType::I16 => (f32::from(i16::from_le_bytes([b[0], b[1]])), 32767.0),
        DataType::U8 => (f32::from(b[0]), 255.0),
        DataType::I8 => (f32::from(b[0] as i8), 127.0),
    };
    if normalized { (value / full).max(-1.0) } else { value }
}
