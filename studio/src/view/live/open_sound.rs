//! Open Sound Control 1.0: weights by address.
//!
//! | message | meaning |
//! | --- | --- |
//! | `/jawOpen 0.3`, `/shape/jawOpen 0.3`, `/avatar/parameters/JawOpen 0.3` | weight of a shape: the last word of the address |
//! | `/expression/joy 0.5`, `/state/blush 1` | weight of an expression or a state |
//! | `/VMC/Ext/Blend/Val "Joy" 0.5` | the Virtual Motion Capture protocol: the name is an argument |
//! | `/head yaw pitch roll` | rotation of the head as a sequence has it, degrees |
//!
//! Weights by number, as some apps send them, are refused: the number says nothing of the shape.

use super::Weights;
use rosc::{OscMessage, OscPacket, OscType};

/// Bundles in bundles.
const DEEPEST: usize = 8;
/// The weights of a datagram.
pub(super) fn weights(datagram: &[u8]) -> Result<Weights, String> {
    let (_, packet) =
        rosc::decoder::decode_udp(datagram).map_err(|e| format!("no Open Sound Control: {e}"))?;
    let mut weights = Weights::default();
    take(&packet, &mut weights, 0)?;
    Ok(weights)
}

fn take(packet: &OscPacket, weights: &mut Weights, depth: usize) -> Result<(), String> {
    match packet {
        OscPacket::Message(message) => message_weights(message, weights),
        OscPacket::Bundle(_) if depth >= DEEPEST => {
            Err(format!("more than {DEEPEST} bundles in one another"))
        }
        OscPacket::Bundle(bundle) => {
            bundle.content.iter().try_for_each(|inner| take(inner, weights, depth + 1))
        }
    }
}

fn message_weights(message: &OscMessage, weights: &mut Weights) -> Result<(), String> {
    let address = message.addr.as_str();
    let numbers: Vec<f32> = message.args.iter().filter_map(number).collect();
    if let Some(bad) = numbers.iter().find(|n| !n.is_finite()) {
        return Err(format!("{address}: found {bad}, expected a finite number"));
    }
    let words: Vec<&str> = address.split('/').filter(|w| !w.is_empty()).collect();
    match (&words[..], &message.args[..], &numbers[..]) {
        (["VMC", "Ext", "Blend", "Val"], [OscType::String(name), _], [weight]) => {
            weights.shapes.push((name.clone(), *weight));
        }
        // Other messages of that protocol: apply, bones, time.
        (["VMC", ..], ..) => {}
        (["head"], _, [yaw, pitch, roll]) => weights.head_degrees = Some([*yaw, *pitch, *roll]),
        ([.., "expression" | "expressions", name], _, [weight]) => {
            weights.expressions.push(((*name).to_owned(), *weight));
        }
        ([.., "state" | "states", name], _, [weight]) => weights.states.push(((*name).to_owned(), *weight)),
        ([.., name], _, [weight]) => weights.shapes.push(((*name).to_owned(), *weight)),
        _ => return Err(format!("{address}: found {} numbers, expected one weight", numbers.len())),
    }
    Ok(())
}

fn number(argument: &OscType) -> Option<f32> {
    match argument {
        OscType::Float(v) => Some(*v),
        OscType::Double(v) => Some(*v as f32),
        OscType::Int(v) => Some(*v as f32),
        OscType::Long(v) => Some(*v as f32),
        OscType::Bool(v) => Some(f32::from(*v)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use rosc::{OscBundle, OscTime, encoder};

    use super::*;

    fn sent(address: &str, args: Vec<OscType>) -> Result<Weights, String> {
        let message = OscMessage { addr: address.into(), args };
        weights(&encoder::encode(&OscPacket::Message(message)).unwrap())
    }

    #[test]
    fn the_dialects_of_the_field_are_read() {
        let float = OscType::Float;
        let shapes = |w: Result<Weights, String>| w.unwrap().shapes;
        assert_eq!(
            shapes(sent("/avatar/parameters/JawOpen", vec![float(0.3)])),
            [("JawOpen".to_owned(), 0.3)]
        );
        let vmc = sent("/VMC/Ext/Blend/Val", vec![OscType::String("A".into()), float(1.0)]);
        assert_eq!(shapes(vmc), [("A".to_owned(), 1.0)]);
        assert_eq!(sent("/VMC/Ext/Blend/Apply", vec![]).unwrap(), Weights::default());
        let joy = sent("/expression/joy", vec![OscType::Double(0.5)]).unwrap();
        assert_eq!(joy.expressions, [("joy".to_owned(), 0.5)]);
        let head = sent("/head", vec![float(1.0), float(2.0), float(3.0)]).unwrap();
        assert_eq!(head.head_degrees, Some([1.0, 2.0, 3.0]));
        assert!(sent("/W", vec![OscType::Int(17), float(0.4)]).unwrap_err().contains("one weight"));
        assert!(sent("/jawOpen", vec![float(f32::NAN)]).unwrap_err().contains("finite"));
        assert!(sent("/jawOpen", vec![]).is_err());
        assert!(weights(b"/broken").is_err());
    }

    #[test]
    fn bundles_are_opened_to_a_depth() {
        let message =
            |v| OscPacket::Message(OscMessage { addr: "/jawOpen".into(), args: vec![OscType::Float(v)] });
        let bundle = |content| {
            OscPacket::Bundle(OscBundle { timetag: OscTime { seconds: 0, fractional: 1 }, content })
        };
        let two = encoder::encode(&bundle(vec![message(0.1), message(0.2)])).unwrap();
        assert_eq!(weights(&two).unwrap().shapes.len(), 2);
        let deep = (0..20).fold(message(0.1), |inner, _| bundle(vec![inner]));
        assert!(weights(&encoder::encode(&deep).unwrap()).is_err());
    }
}
