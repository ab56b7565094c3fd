//! The second copy of `RUBOR_facial_appearance` in the extras of the mesh: programs that do not know the extension drop it, but
//! keep extras, accessors and images, in another order. The copy says their names.

use std::collections::HashMap;

use serde_json::{Map, Value};

use super::document::Document;
use crate::facial_appearance::{ACCESSOR_FIELDS, ACCESSOR_NAMES, IMAGE_NAMES, NAME};
use crate::notes::Notes;

/// Places of what a copy names.
struct Places {
    images: HashMap<String, Option<u64>>,
    accessors: HashMap<String, Option<u64>>,
}

/// The extension with the indices of this document; `None` where there is no copy, or, with a note, where what the head is
/// made of is gone.
pub(super) fn extension(document: &Document, notes: &mut Notes) -> Option<Value> {
    let meshes = document.raw["meshes"].as_array()?;
    let (mesh, copy) =
        meshes.iter().enumerate().find_map(|(i, mesh)| Some((i, mesh["extras"].get(NAME)?)))?;
    let now = |list: &str| -> HashMap<&str, u64> {
        let items = document.raw[list].as_array().into_iter().flatten().enumerate();
        items.filter_map(|(i, item)| Some((item["name"].as_str()?, i as u64))).collect()
    };
    let then = |names: &str, now: HashMap<&str, u64>| -> HashMap<String, Option<u64>> {
        let names = copy[names].as_object().into_iter().flatten();
        names.map(|(index, name)| (index.clone(), name.as_str().and_then(|n| now.get(n)).copied())).collect()
    };
    let places = Places {
        images: then(IMAGE_NAMES, now("images")),
        accessors: then(ACCESSOR_NAMES, now("accessors")),
    };
    let mut extension = copy.clone();
    let fields = extension.as_object_mut()?;
    fields.remove(IMAGE_NAMES);
    fields.remove(ACCESSOR_NAMES);
    fields.insert("mesh".into(), Value::from(mesh as u64));
    notes.add(
        format!("{NAME} was dropped by another program: its copy in the extras of the mesh is read"),
        "",
    );
    if let Err(what) = relocate_geometry(fields, &places, notes) {
        let message =
            format!("the copy of {NAME} cannot be used, and the file is read as that of another program");
        notes.add(message, format!("{what} is gone"));
        return None;
    }
    if let Some(maps) = fields.get_mut("maps").and_then(Value::as_object_mut) {
        relocate_maps(maps, &places, notes);
    }
    for (name, what) in [("skinLookUp", "image"), ("skinAnimation", "times")] {
        // Made anew when the head is written.
        if fields.get(name).is_some_and(|entry| entry.get(what).is_some()) {
            fields.remove(name);
        }
    }
    Some(extension)
}

/// Points of parts must be there; visibility may be gone.
fn relocate_geometry(
    fields: &mut Map<String, Value>,
    places: &Places,
    notes: &mut Notes,
) -> Result<(), String> {
    for part in fields.get_mut("parts").and_then(Value::as_array_mut).into_iter().flatten() {
        let name = part["name"].as_str().unwrap_or_default().to_owned();
        let found = part.get_mut("points").is_some_and(|points| relocate(points, &places.accessors));
        if !found {
            return Err(format!("the list of points of part {name:?}"));
        }
    }
    if fields.get_mut("occlusion").is_some_and(|o| !relocate(o, &places.accessors)) {
        fields.remove("occlusion");
        notes.add("ambient visibility is lost: its accessor is gone", "");
    }
    if let Some(list) = fields.get_mut("shapeOcclusion").and_then(Value::as_array_mut) {
        list.retain_mut(|entry| {
            let kept = ACCESSOR_FIELDS
                .iter()
                .all(|field| entry.get_mut(*field).is_none_or(|index| relocate(index, &places.accessors)));
            if !kept {
                let shape = entry["shape"].as_str().unwrap_or_default();
                notes.add("changes of ambient visibility are lost: their accessors are gone", shape);
            }
            kept
        });
    }
    Ok(())
}

fn relocate_maps(maps: &mut Map<String, Value>, places: &Places, notes: &mut Notes) {
    let mut lost = |what: &str| notes.add("maps whose images are gone are lost", what);
    let mut is_here = |entry: &mut Value| entry.get_mut("image").is_some_and(|i| relocate(i, &places.images));
    let names: Vec<String> = maps.keys().cloned().collect();
    for name in names {
        let Some(entry) = maps.get_mut(&name) else { continue };
        match name.as_str() {
            "distributions" => {
                if let Some(list) = entry.as_array_mut() {
                    list.retain_mut(|d| {
                        let kept = ["scale", "bias"].iter().all(|m| d.get_mut(*m).is_some_and(&mut is_here));
                        if !kept {
                            lost(&format!("distribution {}", d["name"].as_str().unwrap_or_default()));
                        }
                        kept
                    });
                }
            }
            "wrinkleSlopes" | "zones" => {
                let whole = entry.as_array_mut().is_some_and(|list| {
                    list.iter_mut().all(|e| match name.as_str() {
                        "zones" => e.get_mut("mask").is_some_and(&mut is_here),
                        _ => is_here(e),
                    })
                });
                if !whole {
                    // Zones name wrinkle maps by their place.
                    lost(&name);
                    maps.remove(&name);
                }
            }
            _ => {
                if entry.get("image").is_some() && !is_here(entry) {
                    lost(&name);
                    maps.remove(&name);
                }
            }
        }
    }
    if maps.get("wrinkleSlopes").is_none() && maps.remove("zones").is_some() {
        lost("zones");
    }
    if maps.get("hemoglobinMean").is_none() && maps.remove("distributions").is_some() {
        lost("distributions, whose mean is gone");
    }
}

/// Puts the new index in; false where there is none.
fn relocate(index: &mut Value, places: &HashMap<String, Option<u64>>) -> bool {
    match places.get(&index.to_string()).copied().flatten() {
        Some(now) => {
            *index = Value::from(now);
            true
        }
        None => false,
    }
}
