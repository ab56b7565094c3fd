//! Which morph targets of a scene are one shape of the head.
//!
//! ```text
//! same name, same weights over time        one shape
//! same name, one of them without weights   one shape; the other follows it, with a note
//! same name, other weights over time       two shapes, the second numbered, with a note
//! same name twice in one mesh              two shapes, the second numbered, with a note
//! no name                                  a shape of its mesh alone
//! ```

use std::collections::{HashMap, HashSet};

use gltf::Mesh;
use rubor_rig::timeline::Track;

use super::document::Document;
use super::motion::{Driver, Motion};
use super::names::{NamePlace, Unique, of_mesh};
use crate::notes::Notes;

/// Weights that differ by less are the same.
const SAME_WEIGHT: f32 = 1e-4;

struct Slot {
    name: String,
    driver: Driver,
    /// Mesh that it came from first.
    mesh: String,
}

/// Shapes in order of first use.
pub(super) struct Shapes {
    slots: Vec<Slot>,
    /// Slots that share the name of the file, or the target of a mesh that has none.
    same: HashMap<Key, Vec<usize>>,
    unique: Unique,
}

#[derive(Clone, PartialEq, Eq, Hash)]
enum Key {
    Name(String),
    Target(usize, usize),
}

impl Shapes {
    pub(super) fn new(document: &Document, notes: &mut Notes) -> Self {
        let mut unique = Unique::default();
        for mesh in document.gltf.meshes() {
            let (names, place) = of_mesh(document, &mesh);
            names.iter().filter(|n| n.given).for_each(|n| unique.reserve(&n.text));
            if names.is_empty() {
                continue;
            }
            let from = match place {
                NamePlace::Mesh => None,
                NamePlace::Primitive => Some("names of shapes are those in the extras of primitives"),
                NamePlace::Target => Some("names of shapes are those of single targets"),
                NamePlace::Accessor => Some("names of shapes are those of accessors"),
                NamePlace::None => None,
            };
            if let Some(message) = from {
                notes.add(message, label(&mesh));
            }
            let listed =
                document.raw["meshes"][mesh.index()]["extras"]["targetNames"].as_array().map_or(0, Vec::len);
            if listed > names.len() {
                let place = format!("{listed} names for {} targets of {}", names.len(), label(&mesh));
                notes.add("names of targets that do not exist are left out", place);
            }
            let unnamed = names.iter().filter(|n| !n.given).count();
            if unnamed > 0 {
                let message = "morph targets have no name and are numbered: nothing can drive them by name";
                notes.add(message, format!("{unnamed} of {}", label(&mesh)));
            }
        }
        Self { slots: Vec::new(), same: HashMap::new(), unique }
    }

    /// Shape of each target of a mesh that a node shows.
    pub(super) fn of_instance(
        &mut self,
        document: &Document,
        mesh: &Mesh<'_>,
        node: Option<usize>,
        motion: &Motion,
        notes: &mut Notes,
    ) -> Vec<u32> {
        let mut slots: Vec<u32> = Vec::new();
        let mut used: HashSet<usize> = HashSet::new();
        // How many of the first slots of a key are used: many targets of one name take no time that grows with their square.
        let mut full: HashMap<Key, usize> = HashMap::new();
        for (t, name) in of_mesh(document, mesh).0.into_iter().enumerate() {
            let driver = motion.driver(node, mesh, t);
            let key = if name.given { Key::Name(name.text.clone()) } else { Key::Target(mesh.index(), t) };
            let start = full.entry(key.clone()).or_default();
            let known = self.same.entry(key).or_default();
            *start += known[*start..].iter().take_while(|s| used.contains(s)).count();
            let fitting = known[*start..]
                .iter()
                .find(|s| !used.contains(s) && agree(&self.slots[**s].driver, &driver))
                .copied();
            if let Some(slot) = fitting {
                let Slot { driver: of_slot, mesh: first, .. } = &mut self.slots[slot];
                let follows = match (&*of_slot, &driver) {
                    (Driver::Rest, Driver::Rest) => None,
                    (Driver::Rest, _) => Some((first.clone(), label(mesh))),
                    (_, Driver::Rest) => Some((label(mesh), first.clone())),
                    _ => None,
                };
                if let Some((follower, leader)) = follows {
                    notes.add(
                        "shapes of one name are one shape: meshes without weights of their own follow the other",
                        format!("{:?} of {follower} follows {leader}", name.text),
                    );
                }
                if *of_slot == Driver::Rest {
                    *of_slot = driver;
                }
                used.insert(slot);
                slots.push(slot as u32);
                continue;
            }
            let new = if !name.given {
                let text = if self.unique.is_taken(&name.text) {
                    format!("{} {}", label(mesh), name.text)
                } else {
                    name.text.clone()
                };
                self.unique.name(&text)
            } else if known.is_empty() {
                name.text.clone()
            } else {
                let numbered = self.unique.numbered(&name.text);
                let twice = *start > 0 || known[*start..].iter().any(|s| used.contains(s));
                let message = if twice {
                    "targets of one mesh share a name and stay apart, numbered"
                } else {
                    "shapes of one name move differently on two meshes and stay apart, numbered"
                };
                notes.add(message, format!("{:?} of {} is {numbered:?}", name.text, label(mesh)));
                numbered
            };
            known.push(self.slots.len());
            used.insert(self.slots.len());
            slots.push(self.slots.len() as u32);
            self.slots.push(Slot { name: new, driver, mesh: label(mesh) });
        }
        slots
    }

    /// Names and weights, in order.
    pub(super) fn finish(self) -> Vec<(String, Driver)> {
        self.slots.into_iter().map(|s| (s.name, s.driver)).collect()
    }
}

/// Name of a mesh for messages.
fn label(mesh: &Mesh<'_>) -> String {
    mesh.name().filter(|n| !n.is_empty()).map_or_else(|| format!("mesh {}", mesh.index()), str::to_owned)
}

/// Whether two targets can be one shape.
fn agree(a: &Driver, b: &Driver) -> bool {
    let (Some(a), Some(b)) = (a.track(), b.track()) else { return true };
    let times = |track: &Track<f32>| match track {
        Track::Constant(_) => vec![0.0],
        Track::Keys(keys) => {
            let middles = keys.windows(2).map(|w| 0.5 * (w[0].t + w[1].t));
            keys.iter().map(|k| k.t).chain(middles).collect()
        }
    };
    let same = |t: f64| (a.at(t) - b.at(t)).abs() <= SAME_WEIGHT;
    a == b || times(&a).into_iter().chain(times(&b)).all(same)
}
