//! Contents of a scene, as far as faces need them.

use std::collections::{BTreeMap, HashMap};

use crate::notes::Notes;

/// Index of a node.
pub(crate) type NodeId = usize;

/// A node of the scene.
#[derive(Clone, Debug)]
pub(crate) struct Node {
    /// `mesh`, `transform`, `blendShape`, ...
    pub(crate) kind: String,
    pub(crate) name: String,
    pub(crate) parent: Option<NodeId>,
    /// Further parents of an instance (`parent -add`).
    pub(crate) other_parents: Vec<NodeId>,
    /// Nodes above it.
    pub(crate) depth: usize,
    pub(crate) line: usize,
    /// `nodeState`: 0 normal, 1 has no effect, 2 blocking, 3 to 5 the same while waiting.
    pub(crate) state: u32,
    /// How much of its effect a deformer has.
    pub(crate) envelope: f64,
    pub(crate) drawing: Drawing,
    pub(crate) data: Data,
}

/// What hides a node beside its own visibility.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Drawing {
    pub(crate) level_of_detail: bool,
    pub(crate) overridden: bool,
    pub(crate) override_visible: bool,
    /// Visibility of a display layer.
    pub(crate) layer_visible: bool,
}

impl Default for Drawing {
    fn default() -> Self {
        Self { level_of_detail: true, overridden: false, override_visible: true, layer_visible: true }
    }
}

impl Node {
    /// True if the node state lets the geometry through unchanged.
    pub(crate) fn is_off(&self) -> bool {
        matches!(self.state, 1 | 2 | 4 | 5)
    }
}

/// The value of an attribute of a shader.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Setting {
    Numbers(Vec<f64>),
    Text(String),
}

#[derive(Clone, Debug)]
pub(crate) enum Data {
    Transform(Box<Transform>),
    Mesh(Box<MeshData>),
    BlendShape(Box<BlendShapeData>),
    Tweak(Box<TweakData>),
    Curve(Box<CurveData>),
    PolyCube(PolyCube),
    /// Attributes of shaders and textures, by the name as written.
    Shading(BTreeMap<String, Setting>),
    /// Body of a script node.
    Script(String),
    Other,
}

/// Lengths in centimetres, angles in radians.
#[derive(Clone, Debug)]
pub(crate) struct Transform {
    pub(crate) translate_cm: [f64; 3],
    pub(crate) rotate: [f64; 3],
    pub(crate) scale: [f64; 3],
    /// `ro`: 0 xyz, 1 yzx, 2 zxy, 3 xzy, 4 yxz, 5 zyx: the first letter acts first.
    pub(crate) order: u8,
    pub(crate) rotate_pivot_cm: [f64; 3],
    pub(crate) rotate_pivot_translate_cm: [f64; 3],
    pub(crate) scale_pivot_cm: [f64; 3],
    pub(crate) scale_pivot_translate_cm: [f64; 3],
    /// Orientation of a joint.
    pub(crate) joint_orient: [f64; 3],
    pub(crate) rotate_axis: [f64; 3],
    /// xy, xz, yz.
    pub(crate) shear: [f64; 3],
    /// Rows of `offsetParentMatrix`, centimetres in the last.
    pub(crate) offset_parent: Option<[f64; 16]>,
    pub(crate) inherits: bool,
    pub(crate) visible: bool,
    /// Attributes that this crate writes for a head.
    pub(crate) facial_appearance: Option<String>,
}

impl Default for Transform {
    fn default() -> Self {
        let zero = [0.0; 3];
        Self {
            translate_cm: zero,
            rotate: zero,
            scale: [1.0; 3],
            order: 0,
            rotate_pivot_cm: zero,
            rotate_pivot_translate_cm: zero,
            scale_pivot_cm: zero,
            scale_pivot_translate_cm: zero,
            joint_orient: zero,
            rotate_axis: zero,
            shear: zero,
            offset_parent: None,
            inherits: true,
            visible: true,
            facial_appearance: None,
        }
    }
}

/// Points are in metres: a scene's unit is turned into them before they are rounded to f32.
#[derive(Clone, Debug, Default)]
pub(crate) struct MeshData {
    pub(crate) points: Vec<[f32; 3]>,
    /// Tweaks added to points, metres.
    pub(crate) tweaks: BTreeMap<u32, [f32; 3]>,
    pub(crate) edges: Vec<[u32; 2]>,
    /// End of each face in `corners`.
    pub(crate) face_ends: Vec<u32>,
    /// Edge of each corner, negative (-e - 1) where it is walked backwards.
    pub(crate) corners: Vec<i32>,
    /// Texture coordinate of each corner per set, `u32::MAX` where there is none.
    pub(crate) corner_uvs: BTreeMap<u32, Vec<u32>>,
    pub(crate) uv_sets: BTreeMap<u32, UvSet>,
    pub(crate) current_uv_set: Option<String>,
    pub(crate) intermediate: bool,
    pub(crate) hidden: bool,
    /// Normals point to the other side, as after freezing a negative scale.
    pub(crate) opposite: bool,
    pub(crate) holes: usize,
    /// Face ranges of the object groups `iog[instance].og[n]`.
    pub(crate) face_groups: BTreeMap<(u32, u32), Vec<[u32; 2]>>,
}

/// Offsets of a `tweak` node, by geometry and point, metres.
#[derive(Clone, Debug)]
pub(crate) struct TweakData {
    pub(crate) moves: BTreeMap<u32, BTreeMap<u32, [f32; 3]>>,
    /// False: the values are places, not moves.
    pub(crate) relative: bool,
}

impl Default for TweakData {
    fn default() -> Self {
        Self { moves: BTreeMap::new(), relative: true }
    }
}

/// Painted weights of points: 1 where nothing was painted.
#[derive(Clone, Debug, Default)]
pub(crate) struct Painted {
    /// First point and weights of each written block.
    pub(crate) blocks: Vec<(u32, Vec<f32>)>,
}

impl Painted {
    /// A weight for each of `count` points; none where all are 1.
    pub(crate) fn dense(&self, count: usize) -> Option<Vec<f32>> {
        let mut weights = vec![1.0; count];
        for (start, values) in &self.blocks {
            let to = weights.iter_mut().skip(*start as usize);
            to.zip(values).for_each(|(weight, value)| *weight = *value);
        }
        weights.iter().any(|w| *w != 1.0).then_some(weights)
    }
}

#[derive(Clone, Debug, Default)]
pub(crate) struct UvSet {
    pub(crate) name: String,
    pub(crate) uvs: Vec<[f32; 2]>,
}

#[derive(Clone, Debug, Default)]
pub(crate) struct BlendShapeData {
    pub(crate) weights: BTreeMap<u32, f64>,
    /// Name of each weight.
    pub(crate) aliases: BTreeMap<u32, String>,
    /// By geometry, target and item (5000 + 1000 weight).
    pub(crate) items: BTreeMap<(u32, u32, u32), Item>,
    /// Name of each in-between, by target and item.
    pub(crate) item_names: BTreeMap<(u32, u32), String>,
    /// In-betweens that the shape editor hides, by target and item.
    pub(crate) hidden_items: BTreeMap<(u32, u32), bool>,
    /// Painted weights of all targets, by geometry.
    pub(crate) base_weights: BTreeMap<u32, Painted>,
    /// Painted weights by geometry and target.
    pub(crate) target_weights: BTreeMap<(u32, u32), Painted>,
    /// False where the shape editor hides a target (`targetVisibility`) or its group (`targetParentVisibility`).
    pub(crate) visible: BTreeMap<u32, bool>,
    pub(crate) parent_visible: BTreeMap<u32, bool>,
    /// Group of each target, group of each group, weight of each group.
    pub(crate) group_of: BTreeMap<u32, u32>,
    pub(crate) group_parents: BTreeMap<u32, u32>,
    pub(crate) group_weights: BTreeMap<u32, f64>,
    /// Targets whose offsets follow the surface or a transform (`postDeformersMode`).
    pub(crate) post_deformed: Vec<u32>,
}

/// Stored offsets of a target.
#[derive(Clone, Debug, Default)]
pub(crate) struct Item {
    pub(crate) line: usize,
    /// Metres.
    pub(crate) offsets: Vec<[f32; 3]>,
    /// Ranges of points, both ends included, in the order of the offsets; `u32::MAX` as an end means all.
    pub(crate) points: Vec<[u32; 2]>,
}

/// Keys as written: times in the scene's unit, values in its units of length and angle.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct CurveData {
    pub(crate) keys: BTreeMap<u32, [f64; 2]>,
    pub(crate) default_tangent: u32,
    pub(crate) weighted: bool,
    pub(crate) in_types: BTreeMap<u32, u32>,
    pub(crate) out_types: BTreeMap<u32, u32>,
    pub(crate) in_x: BTreeMap<u32, f64>,
    pub(crate) in_y: BTreeMap<u32, f64>,
    pub(crate) out_x: BTreeMap<u32, f64>,
    pub(crate) out_y: BTreeMap<u32, f64>,
    pub(crate) pre_infinity: u32,
    pub(crate) post_infinity: u32,
}

impl Default for CurveData {
    fn default() -> Self {
        Self {
            keys: BTreeMap::new(),
            default_tangent: 9,
            weighted: false,
            in_types: BTreeMap::new(),
            out_types: BTreeMap::new(),
            in_x: BTreeMap::new(),
            in_y: BTreeMap::new(),
            out_x: BTreeMap::new(),
            out_y: BTreeMap::new(),
            pre_infinity: 0,
            post_infinity: 0,
        }
    }
}

/// The one construction node that is understood, for cubes of one segment a side.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PolyCube {
    pub(crate) size_m: [f64; 3],
    pub(crate) segments: [u32; 3],
}

impl Default for PolyCube {
    fn default() -> Self {
        Self { size_m: [0.01; 3], segments: [1; 3] }
    }
}

/// One end of a connection.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Plug {
    pub(crate) node: NodeId,
    /// Without the leading dot: `it[0].itg[3].iti[6000].igt`.
    pub(crate) attribute: String,
}

/// The whole scene.
#[derive(Clone, Debug)]
pub(crate) struct Scene {
    pub(crate) nodes: Vec<Node>,
    pub(crate) connections: Vec<(Plug, Plug)>,
    by_destination: HashMap<(NodeId, String), usize>,
    by_source: HashMap<NodeId, Vec<usize>>,
    into: HashMap<NodeId, Vec<usize>>,
    by_name: HashMap<String, Vec<NodeId>>,
    by_parent: HashMap<(Option<NodeId>, String), NodeId>,
    /// Frames (units of time) in a second.
    pub(crate) fps: f64,
    /// Metres in a unit of length.
    pub(crate) metres: f64,
    /// Radians in a unit of angle.
    pub(crate) radians: f64,
    /// Plugins that the scene needs, and other files that it refers to.
    pub(crate) notes: Notes,
}

impl Default for Scene {
    fn default() -> Self {
        Self {
            nodes: Vec::new(),
            connections: Vec::new(),
            by_destination: HashMap::new(),
            by_source: HashMap::new(),
            into: HashMap::new(),
            by_name: HashMap::new(),
            by_parent: HashMap::new(),
            fps: 24.0,
            metres: 0.01,
            radians: std::f64::consts::PI / 180.0,
            notes: Notes::default(),
        }
    }
}

impl Scene {
    pub(crate) fn add(&mut self, node: Node) -> NodeId {
        self.by_name.entry(node.name.clone()).or_default().push(self.nodes.len());
        self.by_parent.entry((node.parent, node.name.clone())).or_insert(self.nodes.len());
        self.nodes.push(node);
        self.nodes.len() - 1
    }

    /// Puts a node below a further parent; paths find it there too.
    pub(crate) fn add_instance(&mut self, node: NodeId, parent: NodeId) {
        let name = self.nodes[node].name.clone();
        self.by_parent.entry((Some(parent), name)).or_insert(node);
        self.nodes[node].other_parents.push(parent);
    }

    pub(crate) fn connect(&mut self, from: Plug, to: Plug) {
        let index = self.connections.len();
        self.by_destination.insert((to.node, to.attribute.clone()), index);
        self.by_source.entry(from.node).or_default().push(index);
        self.into.entry(to.node).or_default().push(index);
        self.connections.push((from, to));
    }

    /// The node of a path: `|group|head|headShape`, `head|headShape`, `headShape`, `:time1`.
    pub(crate) fn find(&self, path: &str) -> Option<NodeId> {
        if let Some(full) = path.strip_prefix('|') {
            let mut at = None;
            let found = full.split('|').all(|name| {
                at = self.by_parent.get(&(at, name.to_owned())).copied();
                at.is_some()
            });
            if found {
                return at;
            }
        }
        let mut parts = path.trim_start_matches([':', '|']).rsplit('|');
        let leaf = parts.next()?;
        let candidates = self.by_name.get(leaf)?;
        let parents: Vec<&str> = parts.collect();
        let matches = |id: &&NodeId| {
            let mut node = self.nodes[**id].parent;
            parents.iter().all(|name| {
                let here = node.and_then(|n| self.nodes.get(n));
                node = here.and_then(|n| n.parent);
                here.is_some_and(|n| n.name == *name)
            })
        };
        candidates.iter().find(matches).copied()
    }

    /// The source connected into an attribute.
    pub(crate) fn source(&self, node: NodeId, attribute: &str) -> Option<&Plug> {
        let index = *self.by_destination.get(&(node, attribute.to_owned()))?;
        Some(&self.connections[index].0)
    }

    /// False where a node, or a display layer that it is in, is not drawn; its own `visibility` apart.
    pub(crate) fn is_drawn(&self, node: NodeId) -> bool {
        let drawing = &self.nodes[node].drawing;
        let layer = self.source(node, "do").map(|plug| &self.nodes[plug.node]);
        drawing.level_of_detail
            && (!drawing.overridden || drawing.override_visible)
            && layer.is_none_or(|l| l.kind != "displayLayer" || l.drawing.layer_visible)
    }

    /// What a node is connected to.
    pub(crate) fn outputs(&self, node: NodeId) -> impl Iterator<Item = &(Plug, Plug)> {
        self.by_source.get(&node).into_iter().flatten().map(|i| &self.connections[*i])
    }

    /// Sources connected into a node.
    pub(crate) fn inputs(&self, node: NodeId) -> impl Iterator<Item = &(Plug, Plug)> {
        self.into.get(&node).into_iter().flatten().map(|i| &self.connections[*i])
    }

    /// `|group|head|headShape`. A parent always comes before its child, so this ends.
    pub(crate) fn path(&self, node: NodeId) -> String {
        let mut names = vec![self.nodes[node].name.as_str()];
        let mut at = self.nodes[node].parent;
        while let Some(parent) = at {
            names.push(&self.nodes[parent].name);
            at = self.nodes[parent].parent;
        }
        names.reverse();
        format!("|{}", names.join("|"))
    }

    pub(crate) fn mesh(&self, node: NodeId) -> Option<&MeshData> {
        match &self.nodes[node].data {
            Data::Mesh(mesh) => Some(mesh),
            _ => None,
        }
    }

    pub(crate) fn transform(&self, node: NodeId) -> Option<&Transform> {
        match &self.nodes[node].data {
            Data::Transform(transform) => Some(transform),
            _ => None,
        }
    }
}
