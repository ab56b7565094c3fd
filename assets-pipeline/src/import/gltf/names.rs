//! Names of morph targets. glTF 2.0 has no place for them; files have them in five.

use std::collections::HashSet;

use gltf::Mesh;
use serde_json::Value;

use super::document::Document;

/// Of a morph target.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct TargetName {
    /// The name in the file, else `target 0` and so on.
    pub(super) text: String,
    /// Whether the file says it.
    pub(super) given: bool,
}

/// Where the names of a mesh stand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum NamePlace {
    /// `mesh.extras.targetNames`: where most writers put them.
    Mesh,
    /// `primitive.extras.targetNames`: UniVRM 0.x.
    Primitive,
    /// `name` in the extras of the target, or in `extra`: older writers.
    Target,
    /// Names of the accessors of positions.
    Accessor,
    /// Nowhere.
    None,
}

/// Names of the targets of a mesh; the first place that has one for a target gives it.
pub(super) fn of_mesh(document: &Document, mesh: &Mesh<'_>) -> (Vec<TargetName>, NamePlace) {
    let count = mesh.primitives().map(|p| p.morph_targets().count()).max().unwrap_or(0);
    let raw = &document.raw["meshes"][mesh.index()];
    let primitives = raw["primitives"].as_array().map_or(&[][..], Vec::as_slice);
    let text = |value: &Value| value.as_str().filter(|s| !s.trim().is_empty()).map(str::to_owned);
    let of_target = |target: &Value| {
        ["extras", "extra"].iter().find_map(|k| text(&target[k]["name"])).or_else(|| text(&target["name"]))
    };
    let of_accessor = |target: &Value| {
        let accessor = target["POSITION"].as_u64().and_then(|a| usize::try_from(a).ok())?;
        text(&document.raw["accessors"][accessor]["name"])
    };
    let list = |of: &dyn Fn(usize) -> Option<String>| -> Vec<Option<String>> { (0..count).map(of).collect() };
    let first = |of: &dyn Fn(&Value) -> Option<String>| primitives.iter().find_map(of);
    let mut accessors = list(&|i| first(&|p| of_accessor(&p["targets"][i])));
    // Numbers, or one name for all, are no names of shapes.
    let mut seen = HashSet::new();
    let told_apart = accessors.iter().all(|n| n.as_ref().is_some_and(|n| !is_generic(n) && seen.insert(n)));
    if !told_apart {
        accessors.iter_mut().for_each(|n| *n = None);
    }
    let places = [
        (NamePlace::Mesh, list(&|i| text(&raw["extras"]["targetNames"][i]))),
        (NamePlace::Primitive, list(&|i| first(&|p| text(&p["extras"]["targetNames"][i])))),
        (NamePlace::Target, list(&|i| first(&|p| of_target(&p["targets"][i])))),
        (NamePlace::Accessor, accessors),
    ];
    let names = (0..count)
        .map(|i| match places.iter().find_map(|(_, list)| list[i].clone()) {
            Some(text) => TargetName { text, given: true },
            None => TargetName { text: format!("target {i}"), given: false },
        })
        .collect();
    let used = places.iter().find(|(_, list)| list.iter().any(Option::is_some)).map(|(place, _)| *place);
    (names, used.unwrap_or(NamePlace::None))
}

/// Names that writers give to accessors of any mesh.
fn is_generic(name: &str) -> bool {
    let name = name.to_ascii_lowercase();
    name.contains("accessor") || name.contains("position") || name.contains("bufferview")
}

/// Gives names that no shape of a head has yet.
#[derive(Default)]
pub(super) struct Unique {
    taken: HashSet<String>,
    next: std::collections::HashMap<String, usize>,
}

impl Unique {
    /// Keeps a name from being made for another shape.
    pub(super) fn reserve(&mut self, name: &str) {
        self.taken.insert(name.to_owned());
    }

    /// Whether a shape has the name.
    pub(super) fn is_taken(&self, name: &str) -> bool {
        self.taken.contains(name)
    }

    /// The name with the first number from 1 on that makes it new.
    pub(super) fn numbered(&mut self, name: &str) -> String {
        let next = self.next.entry(name.to_owned()).or_insert(1);
        loop {
            let numbered = format!("{name}_{next}");
            *next += 1;
            if self.taken.insert(numbered.clone()) {
                return numbered;
            }
        }
    }

    /// The name itself if it is new, else numbered.
    pub(super) fn name(&mut self, name: &str) -> String {
        if self.taken.insert(name.to_owned()) { name.to_owned() } else { self.numbered(name) }
    }
}
