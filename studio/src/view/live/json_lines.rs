//! Messages of `rubor_maya`: one JSON object a line (`maya-bridge/python/rubor_maya/messages.py`).
//!
//! ```text
//! {"type": "hello", "version": 1, "from": "maya"}
//! {"type": "weights", "shapes": {"jawOpen": 0.3}, "head": {"yawDegrees": 4.0, "pitchDegrees": 0.0, "rollDegrees": 0.0}}
//! {"type": "bye"}
//! ```
//!
//! `weights` may also have `expressions` and `states`.

use std::collections::BTreeMap;
use std::io::Read;
use std::net::TcpStream;

use serde::Deserialize;

use super::{Event, PATIENCE, Post, Weights};

/// Bytes of a line.
const LONGEST_LINE: usize = 1 << 20;
/// Version of the messages.
const VERSION: u32 = 1;

#[derive(Deserialize)]
#[serde(tag = "type", rename_all = "lowercase")]
enum Message {
    Hello {
        version: u32,
        #[serde(default)]
        from: String,
    },
    Weights {
        #[serde(default)]
        shapes: BTreeMap<String, f32>,
        #[serde(default)]
        expressions: BTreeMap<String, f32>,
        #[serde(default)]
        states: BTreeMap<String, f32>,
        #[serde(default)]
        head: Option<Angles>,
    },
    Bye {},
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase", default)]
#[derive(Default)]
struct Angles {
    yaw_degrees: f32,
    pitch_degrees: f32,
    roll_degrees: f32,
}

/// Reads a connection until it ends, says bye or is not wanted any more.
pub(super) fn read(mut stream: TcpStream, from: &str, post: &Post) {
    if stream.set_nonblocking(false).and_then(|()| stream.set_read_timeout(Some(PATIENCE))).is_err() {
        return;
    }
    let mut name = from.to_owned();
    let (mut waiting, mut number) = (Vec::new(), 0);
    let mut bytes = [0; 4096];
    while !post.is_stopped() {
        let length = match stream.read(&mut bytes) {
            Ok(0) => break,
            Ok(length) => length,
            Err(e) if matches!(e.kind(), std::io::ErrorKind::WouldBlock | std::io::ErrorKind::TimedOut) => {
                continue;
            }
            Err(_) => break,
        };
        waiting.extend_from_slice(&bytes[..length]);
        while let Some(end) = waiting.iter().position(|b| *b == b'\n') {
            let line: Vec<u8> = waiting.drain(..=end).collect();
            number += 1;
            match message(&line) {
                Ok(None) => {}
                Ok(Some(Message::Hello { from, .. })) => {
                    name = if from.is_empty() { name } else { from };
                    post.send(Event::Connected(name.clone()));
                }
                Ok(Some(Message::Weights { shapes, expressions, states, head })) => {
                    let head = head.map(|h| [h.yaw_degrees, h.pitch_degrees, h.roll_degrees]);
                    post.send(Event::Weights(Weights {
                        shapes: shapes.into_iter().collect(),
                        expressions: expressions.into_iter().collect(),
                        states: states.into_iter().collect(),
                        head_degrees: head,
                    }));
                }
                Ok(Some(Message::Bye {})) => {
                    post.send(Event::Gone(name));
                    return;
                }
                Err(why) => post.send(Event::Wrong(format!("{name}, line {number}: {why}"))),
            }
        }
        if waiting.len() > LONGEST_LINE {
            post.send(Event::Wrong(format!(
                "{name}: a line of more than {LONGEST_LINE} bytes; disconnected"
            )));
            break;
        }
    }
    post.send(Event::Gone(name));
}

fn message(line: &[u8]) -> Result<Option<Message>, String> {
    if line.trim_ascii().is_empty() {
        return Ok(None);
    }
    let message: Message = serde_json::from_slice(line).map_err(|e| e.to_string())?;
    let fault = match &message {
        Message::Hello { version, .. } if *version != VERSION => {
            Some(format!("found version {version}, expected {VERSION}"))
        }
        Message::Weights { shapes, expressions, states, head } => {
            let weights = shapes.iter().chain(expressions).chain(states).map(|(_, w)| *w);
            let angles = head.iter().flat_map(|h| [h.yaw_degrees, h.pitch_degrees, h.roll_degrees]);
            // A number that is too large for 32 bits becomes infinite.
            let is_too_large = weights.chain(angles).any(|w| !w.is_finite());
            is_too_large.then(|| "found a number that is too large, expected finite weights".to_owned())
        }
        _ => None,
    };
    fault.map_or(Ok(Some(message)), Err)
}
