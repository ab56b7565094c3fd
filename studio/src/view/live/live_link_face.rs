//! Packets of Live Link Face (Epic Games' app for ARKit face tracking), version 6, over UDP.
//!
//! ```text
//! u8 version | i32 length, device | i32 length, subject | i32 frame, f32 sub-frame, i32 rate, i32 per | u8 count | f32 ...
//! ```
//!
//! Numbers are big-endian. The values are ARKit's 52 shapes in the app's order, then yaw, pitch and roll of the head and of
//! both eyes in radians; the shapes `eyeLook*` carry the eyes already. Signs of angles are those of recordings
//! (`rubor_assets::import::capture::live_link`).

use super::Weights;

/// Version of the packets.
const VERSION: u8 = 6;
/// Bytes of a name.
const LONGEST_NAME: usize = 1024;

/// Shapes in the order of the packets.
const ORDER: [&str; 52] = [
    "eyeBlinkLeft",
    "eyeLookDownLeft",
    "eyeLookInLeft",
    "eyeLookOutLeft",
    "eyeLookUpLeft",
    "eyeSquintLeft",
    "eyeWideLeft",
    "eyeBlinkRight",
    "eyeLookDownRight",
    "eyeLookInRight",
    "eyeLookOutRight",
    "eyeLookUpRight",
    "eyeSquintRight",
    "eyeWideRight",
    "jawForward",
    "jawLeft",
    "jawRight",
    "jawOpen",
    "mouthClose",
    "mouthFunnel",
    "mouthPucker",
    "mouthLeft",
    "mouthRight",
    "mouthSmileLeft",
    "mouthSmileRight",
    "mouthFrownLeft",
    "mouthFrownRight",
    "mouthDimpleLeft",
    "mouthDimpleRight",
    "mouthStretchLeft",
    "mouthStretchRight",
    "mouthRollLower",
    "mouthRollUpper",
    "mouthShrugLower",
    "mouthShrugUpper",
    "mouthPressLeft",
    "mouthPressRight",
    "mouthLowerDownLeft",
    "mouthLowerDownRight",
    "mouthUpperUpLeft",
    "mouthUpperUpRight",
    "browDownLeft",
    "browDownRight",
    "browInnerUp",
    "browOuterUpLeft",
    "browOuterUpRight",
    "cheekPuff",
    "cheekSquintLeft",
    "cheekSquintRight",
    "noseSneerLeft",
    "noseSneerRight",
    "tongueOut",
];

/// The weights of a datagram; none of a packet that says that the app sees no face.
pub(super) fn weights(datagram: &[u8]) -> Result<Weights, String> {
    let mut rest = datagram;
    let version = take(&mut rest, 1)?[0];
    if version != VERSION {
        let expected = format!("Live Link Face version {VERSION}, or an OSC address that starts with /");
        return Err(format!("found a first byte of {version}, expected {expected}"));
    }
    for what in ["device", "subject"] {
        let length = i32::from_be_bytes(four(&mut rest)?);
        let length = usize::try_from(length).ok().filter(|n| *n <= LONGEST_NAME);
        take(&mut rest, length.ok_or_else(|| format!("found no length of a {what}'s name"))?)?;
    }
    // Frame, sub-frame, rate.
    take(&mut rest, 16)?;
    let Some((count, values)) = rest.split_first() else { return Ok(Weights::default()) };
    let count = usize::from(*count);
    if count == 0 {
        return Ok(Weights::default());
    }
    if count < ORDER.len() || values.len() < 4 * count {
        return Err(format!(
            "found {count} values in {} bytes, expected at least {}",
            values.len(),
            ORDER.len()
        ));
    }
    let value = |i: usize| -> Option<f32> {
        Some(f32::from_be_bytes(values.get(4 * i..4 * i + 4)?.try_into().ok()?))
    };
    let all: Vec<f32> = (0..count).filter_map(value).collect();
    if all.iter().any(|v| !v.is_finite()) {
        return Err("found a value that is not finite".into());
    }
    let head = all.get(52..55).map(|h| [-h[0].to_degrees(), h[1].to_degrees(), -h[2].to_degrees()]);
    let shapes = ORDER.iter().map(|n| (*n).to_owned()).zip(all.iter().copied()).collect();
    Ok(Weights { shapes, head_degrees: head, ..Weights::default() })
}

fn take<'a>(rest: &mut &'a [u8], length: usize) -> Result<&'a [u8], String> {
    let (taken, left) = rest.split_at_checked(length).ok_or("a packet that ends too early")?;
    *rest = left;
    Ok(taken)
}

fn four(rest: &mut &[u8]) -> Result<[u8; 4], String> {
    take(rest, 4)?.try_into().map_err(|_| "a packet that ends too early".to_owned())
}

#[cfg(test)]
mod tests {
    use rubor_rig::names::ARKIT;

    use super::*;

    fn packet(values: &[f32]) -> Vec<u8> {
        let mut bytes = vec![6];
        for name in ["0123456789abcdef0123456789abcdef0123", "iPhone"] {
            bytes.extend((name.len() as i32).to_be_bytes());
            bytes.extend(name.as_bytes());
        }
        bytes.extend(123i32.to_be_bytes());
        bytes.extend(0.5f32.to_be_bytes());
        bytes.extend(60i32.to_be_bytes());
        bytes.extend(1i32.to_be_bytes());
        bytes.push(values.len() as u8);
        values.iter().for_each(|v| bytes.extend(v.to_be_bytes()));
        bytes
    }

    #[test]
    fn packets_have_shapes_by_number_and_the_head_in_radians() {
        let mut values = vec![0.0; 61];
        (values[17], values[52], values[53], values[54]) = (0.75, 0.1, 0.2, 0.3);
        let weights = weights(&packet(&values)).unwrap();
        assert_eq!(weights.shapes[17], ("jawOpen".to_owned(), 0.75));
        let [yaw, pitch, roll] = weights.head_degrees.unwrap();
        assert!((yaw + 5.7296).abs() < 1e-3 && (pitch - 11.459).abs() < 1e-3 && (roll + 17.189).abs() < 1e-3);
        let mut order = ORDER.to_vec();
        order.sort_unstable();
        let mut arkit = ARKIT.to_vec();
        arkit.sort_unstable();
        assert_eq!(order, arkit, "every shape once");
    }

    #[test]
    fn what_is_cut_or_wrong_is_refused_and_no_face_is_no_news() {
        assert_eq!(weights(&packet(&[])).unwrap(), Weights::default());
        let whole = packet(&[0.0; 61]);
        for end in 0..whole.len() {
            let cut = weights(&whole[..end]);
            assert!(cut.is_err() || cut == Ok(Weights::default()), "{end}");
        }
        assert!(weights(&packet(&[f32::NAN; 61])).is_err());
        assert!(weights(&packet(&[0.0; 12])).is_err());
        assert!(weights(&[6, 0xff, 0xff, 0xff, 0xff, 1]).is_err());
    }
}
