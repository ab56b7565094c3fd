//! Landmarks that a user gives: JSON, name to place.
//!
//! ```json
//! { "pronasale": 1207, "menton": [0.0, 1.52, 0.09], "cheilion-left": { "pixel": [402, 611] } }
//! ```
//!
//! A number is a vertex of the head in the order of its file, three numbers are a place in the head's space, a pixel is one
//! of the picture that [`super::draw_picture`] makes of the same head (from the upper left corner).

use std::collections::BTreeMap;

use glam::{Vec2, Vec3};
use rubor_rig::head::Head;
use rubor_rig::names::nearest;
use serde::Deserialize;
use thiserror::Error;

use super::Fit;
use super::picture::Camera;
use super::template::names;

/// What is wrong with given landmarks.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("landmark {name:?}: found {found}, expected {expected}")]
pub struct GivenError {
    /// Name of the landmark; empty for the text as a whole.
    pub name: String,
    /// What there is.
    pub found: String,
    /// What should be.
    pub expected: String,
}

#[derive(Deserialize)]
#[serde(untagged)]
enum Place {
    Vertex(u32),
    Point([f32; 3]),
    Pixel { pixel: [f32; 2] },
}

/// Reads landmarks of a head. `fit` is what [`super::find`] says of it: pixels are those of the picture made with it.
///
/// # Errors
/// Text that is no such JSON, unknown names, vertices that do not exist, pixels that show no surface.
pub fn read(text: &str, head: &Head, fit: Option<&Fit>) -> Result<BTreeMap<String, Vec3>, GivenError> {
    let fail = |name: &str, found: String, expected: &str| {
        Err(GivenError { name: name.to_owned(), found, expected: expected.to_owned() })
    };
    let places: BTreeMap<String, serde_json::Value> = match serde_json::from_str(text) {
        Ok(places) => places,
        Err(e) => return fail("", e.to_string(), "a JSON object of names and places"),
    };
    let known = names();
    let camera = Camera::new(head, fit);
    let mut landmarks = BTreeMap::new();
    for (name, value) in places {
        if !known.contains(&name) {
            let expected = match nearest(&name, known.iter().map(String::as_str)) {
                Some(near) => format!("a known name; did you mean {near:?}?"),
                None => format!("one of {}", known.join(", ")),
            };
            return fail(&name, "an unknown name".into(), &expected);
        }
        let found = value.to_string();
        let place = match serde_json::from_value(value) {
            Ok(Place::Vertex(v)) => {
                let Some(vertex) = head.mesh.vertices.get(v as usize) else {
                    return fail(&name, found, &format!("a vertex below {}", head.mesh.vertices.len()));
                };
                head.mesh.points[vertex.point as usize]
            }
            Ok(Place::Point(p)) => Vec3::from_array(p),
            Ok(Place::Pixel { pixel }) => {
                let place = camera.as_ref().and_then(|c| c.place(head, Vec2::from_array(pixel)));
                let Some(place) = place else {
                    return fail(&name, found, "a pixel of the picture that shows the head");
                };
                place
            }
            Err(_) => {
                return fail(&name, found, "a vertex, three coordinates, or {\"pixel\": [x, y]}");
            }
        };
        if !place.is_finite() {
            return fail(&name, format!("{place}"), "finite coordinates");
        }
        landmarks.insert(name, place);
    }
    Ok(landmarks)
}
