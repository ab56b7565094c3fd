//! Statements to a [`Scene`]: one pass, values go straight to where they stay.

mod deformers;

use deformers::axis;

use std::collections::BTreeMap;

use super::code_page;
use super::lexer::{Lexer, Token};
use super::scene::{
    BlendShapeData, CurveData, Data, Drawing, MeshData, Node, NodeId, Plug, PolyCube, Scene, Setting,
    Transform, TweakData,
};
use super::words::{fps, metres, number, short};
use crate::error::Fault;
use crate::notes::Notes;

/// Largest index of an array attribute: a scene that names a larger one is broken, and would fill the memory.
const LARGEST_INDEX: u64 = 50_000_000;

/// Most nodes above one another.
const DEEPEST: usize = 1000;
/// Most instances that a scene adds.
const MOST_INSTANCES: usize = 10_000;

/// Plugins whose nodes carry nothing that a head needs.
const HARMLESS_PLUGINS: [&str; 8] = [
    "stereoCamera",
    "mtoa",
    "mayaUsdPlugin",
    "fbxmaya",
    "Turtle",
    "renderSetup",
    "modelingToolkit",
    "ATFPlugin",
];

/// Reads a scene.
pub(crate) fn parse(bytes: &[u8]) -> Result<Scene, Fault> {
    if bytes.starts_with(b"FOR4") || bytes.starts_with(b"FOR8") {
        return Err(Fault::new(1, "a Maya binary scene (.mb)", "Maya ASCII: save the scene as .ma"));
    }
    let mut notes = Notes::default();
    let text = code_page::to_utf8(bytes, &mut notes);
    let mut parser = Parser {
        lexer: Lexer::new(&text),
        scene: Scene::default(),
        current: None,
        links: Vec::new(),
        instances: 0,
    };
    parser.scene.notes = notes;
    let mut statements = 0;
    let mut known = 0;
    while let Some(token) = parser.lexer.next()? {
        statements += 1;
        let Token::Word(command) = token else {
            // Stray texts and signs between statements.
            continue;
        };
        known += 1;
        match command {
            b"createNode" => parser.create_node()?,
            b"setAttr" => parser.set_attr()?,
            b"connectAttr" => parser.connect()?,
            b"select" => parser.select()?,
            b"currentUnit" => parser.current_unit()?,
            b"requires" => parser.requires()?,
            b"file" => parser.reference()?,
            b"parent" => parser.parent()?,
            b"disconnectAttr" | b"deleteAttr" | b"delete" => {
                let note = "statements that are not followed (save the scene again in Maya)";
                parser.scene.notes.about(note, String::from_utf8_lossy(command));
                parser.lexer.skip_statement()?;
            }
            b"rename" | b"addAttr" | b"fileInfo" | b"lockNode" | b"relationship" | b"dataStructure"
            | b"applyMetadata" | b"editMetadata" | b"namespace" | b"workspace" | b"evaluator"
            | b"scriptJob" | b"source" | b"python" | b"warning" | b"undo" => parser.lexer.skip_statement()?,
            _ => {
                known -= 1;
                parser.lexer.skip_statement()?;
            }
        }
    }
    if known == 0 {
        let found = if statements == 0 { "no statement" } else { "no statement of a Maya scene" };
        return Err(Fault::new(1, found, "Maya ASCII (createNode, setAttr, connectAttr)"));
    }
    parser.resolve_links();
    Ok(parser.scene)
}

struct Parser<'a> {
    lexer: Lexer<'a>,
    scene: Scene,
    /// Node that `setAttr ".x"` speaks of.
    current: Option<NodeId>,
    /// Connections as written; nodes may be created after them.
    links: Vec<(Box<str>, Box<str>)>,
    instances: usize,
}

/// An attribute path: `.it[0].itg[3].iti[6000].ipt` is `it`, 0, `itg`, 3, ...
#[derive(Debug)]
struct Attribute<'t> {
    steps: Vec<(&'t str, Option<(u32, u32)>)>,
}

impl<'t> Attribute<'t> {
    fn parse(text: &'t str, line: usize) -> Result<Self, Fault> {
        let wrong =
            || Fault::new(line, format!("attribute {text:?}"), "a name with indices such as .vt[0:7]");
        let mut steps = Vec::new();
        for part in text.split('.').filter(|p| !p.is_empty()) {
            let Some((name, rest)) = part.split_once('[') else {
                steps.push((part, None));
                continue;
            };
            let range = rest.strip_suffix(']').ok_or_else(wrong)?;
            let (from, to) = range.split_once(':').unwrap_or((range, range));
            let index = |s: &str| s.parse::<u64>().ok().filter(|i| *i <= LARGEST_INDEX).map(|i| i as u32);
            let (from, to) = (index(from).ok_or_else(wrong)?, index(to).ok_or_else(wrong)?);
            if to < from {
                return Err(wrong());
            }
            steps.push((name, Some((from, to))));
        }
        Ok(Self { steps })
    }

    fn last(&self) -> (&'t str, Option<(u32, u32)>) {
        self.steps.last().copied().unwrap_or(("", None))
    }

    /// Names joined, long names made short.
    fn key(&self) -> String {
        self.steps.iter().map(|(name, _)| short(name)).collect::<Vec<_>>().join(".")
    }

    fn index(&self, step: usize) -> u32 {
        self.steps.get(step).and_then(|s| s.1).map_or(0, |r| r.0)
    }
}

impl<'a> Parser<'a> {
    fn number(&mut self) -> Result<Option<f64>, Fault> {
        match self.lexer.argument()? {
            None => Ok(None),
            Some(Token::Word(word)) => match number(word) {
                Some(n) => Ok(Some(n)),
                None => {
                    let found = format!("{:?}", String::from_utf8_lossy(word));
                    Err(Fault::new(self.lexer.line(), found, "a finite number"))
                }
            },
            Some(Token::Text(text)) => Err(Fault::new(self.lexer.line(), format!("{text:?}"), "a number")),
            Some(Token::End) => Ok(None),
        }
    }

    fn needed(&mut self) -> Result<f64, Fault> {
        let line = self.lexer.line();
        self.number()?.ok_or_else(|| Fault::new(line, "the end of the statement", "a number"))
    }

    fn triple(&mut self) -> Result<[f64; 3], Fault> {
        Ok([self.needed()?, self.needed()?, self.needed()?])
    }

    /// Three numbers, or none at the end of the statement.
    fn next_triple(&mut self) -> Result<Option<[f64; 3]>, Fault> {
        match self.number()? {
            None => Ok(None),
            Some(x) => Ok(Some([x, self.needed()?, self.needed()?])),
        }
    }

    fn count(&mut self, what: &str) -> Result<u32, Fault> {
        let value = self.needed()?;
        if value >= 0.0 && value <= LARGEST_INDEX as f64 && value.fract() == 0.0 {
            return Ok(value as u32);
        }
        Err(Fault::new(self.lexer.line(), value.to_string(), format!("{what}: a whole number of 0 or more")))
    }

    fn flag_on(&mut self) -> Result<bool, Fault> {
        Ok(match self.lexer.argument()? {
            Some(Token::Word(word)) => matches!(word, b"yes" | b"on" | b"true" | b"1"),
            _ => false,
        })
    }

    fn text(&mut self) -> Result<Option<String>, Fault> {
        loop {
            match self.lexer.argument()? {
                Some(Token::Text(text)) => return Ok(Some(text.into_owned())),
                Some(_) => {}
                None => return Ok(None),
            }
        }
    }

    fn create_node(&mut self) -> Result<(), Fault> {
        let line = self.lexer.line();
        let Some(Token::Word(kind)) = self.lexer.argument()? else {
            return Err(Fault::new(line, "createNode without a type", "a node type"));
        };
        let kind = String::from_utf8_lossy(kind).into_owned();
        let (mut name, mut parent) = (None, None);
        while let Some(token) = self.lexer.argument()? {
            match token {
                Token::Word(b"-n" | b"-name") => name = self.text_argument()?,
                Token::Word(b"-p" | b"-parent") => {
                    let written = self.text_argument()?;
                    if let Some(written) = written {
                        parent = self.scene.find(&written);
                        if parent.is_none() {
                            let expected = "a parent that was created before";
                            return Err(Fault::new(line, format!("the parent {written:?}"), expected));
                        }
                    }
                }
                _ => {}
            }
        }
        self.lexer.skip_statement()?;
        let data = match kind.as_str() {
            "transform" | "joint" => Data::Transform(Box::default()),
            "mesh" => Data::Mesh(Box::<MeshData>::default()),
            "blendShape" => Data::BlendShape(Box::<BlendShapeData>::default()),
            "tweak" => Data::Tweak(Box::<TweakData>::default()),
            "animCurveTL" | "animCurveTA" | "animCurveTU" => Data::Curve(Box::<CurveData>::default()),
            "polyCube" => Data::PolyCube(PolyCube::default()),
            "script" => Data::Script(String::new()),
            "lambert" | "phong" | "phongE" | "blinn" | "standardSurface" | "aiStandardSurface"
            | "openPBRSurface" | "file" | "aiImage" | "place2dTexture" => Data::Shading(BTreeMap::new()),
            _ => Data::Other,
        };
        let name = name.unwrap_or_else(|| format!("{kind}{}", self.scene.nodes.len()));
        let depth = parent.map_or(0, |p| self.scene.nodes[p].depth + 1);
        if depth > DEEPEST {
            let found = format!("{name} below {depth} others");
            return Err(Fault::new(line, found, format!("at most {DEEPEST} nodes above one another")));
        }
        let node = Node {
            kind,
            name,
            parent,
            other_parents: Vec::new(),
            depth,
            line,
            state: 0,
            envelope: 1.0,
            drawing: Drawing::default(),
            data,
        };
        self.current = Some(self.scene.add(node));
        Ok(())
    }

    /// `parent -s -nc -r -add "|eyeLeft|eyeShape" "eyeRight";` makes an instance.
    fn parent(&mut self) -> Result<(), Fault> {
        let line = self.lexer.line();
        let mut add = false;
        let mut names = Vec::new();
        while let Some(token) = self.lexer.argument()? {
            match token {
                Token::Word(b"-add" | b"-addObject") => add = true,
                Token::Word(word) if word.starts_with(b"-") => {}
                Token::Word(word) => names.push(String::from_utf8_lossy(word).into_owned()),
                Token::Text(text) => names.push(text.into_owned()),
                Token::End => {}
            }
        }
        self.lexer.skip_statement()?;
        let Some((parent, children)) = names.split_last().filter(|(_, children)| !children.is_empty()) else {
            return Ok(());
        };
        if !add {
            let note = "statements that are not followed (save the scene again in Maya)";
            self.scene.notes.about(note, format!("line {line}: parent of {}", children.join(", ")));
            return Ok(());
        }
        for child in children {
            let (Some(above), Some(below)) = (self.scene.find(parent), self.scene.find(child)) else {
                let note = "instances that were left out, as one of both nodes is not in the scene";
                self.scene.notes.about(note, format!("line {line}: {child} below {parent}"));
                continue;
            };
            if self.is_above(below, above) {
                return Err(Fault::new(
                    line,
                    format!("{child} as its own ancestor"),
                    "an instance below others",
                ));
            }
            self.instances += 1;
            if self.instances > MOST_INSTANCES {
                let expected = format!("at most {MOST_INSTANCES}");
                return Err(Fault::new(line, format!("{} instances", self.instances), expected));
            }
            self.scene.add_instance(below, above);
        }
        Ok(())
    }

    /// True if a node is another one or above it.
    fn is_above(&self, above: NodeId, node: NodeId) -> bool {
        let mut seen = std::collections::HashSet::new();
        let mut open = vec![node];
        while let Some(at) = open.pop() {
            if at == above {
                return true;
            }
            if seen.insert(at) {
                let node = &self.scene.nodes[at];
                open.extend(node.parent.iter().chain(&node.other_parents));
            }
        }
        false
    }

    fn text_argument(&mut self) -> Result<Option<String>, Fault> {
        Ok(match self.lexer.argument()? {
            Some(Token::Text(text)) => Some(text.into_owned()),
            Some(Token::Word(word)) => Some(String::from_utf8_lossy(word).into_owned()),
            _ => None,
        })
    }

    /// `select -ne :time1;` makes a default node the current one.
    fn select(&mut self) -> Result<(), Fault> {
        let mut last = None;
        while let Some(token) = self.lexer.argument()? {
            last = match token {
                Token::Word(word) if !word.starts_with(b"-") => {
                    Some(String::from_utf8_lossy(word).into_owned())
                }
                Token::Text(text) => Some(text.into_owned()),
                _ => last,
            };
        }
        self.current = last.and_then(|name| self.scene.find(&name));
        self.lexer.skip_statement()
    }

    fn current_unit(&mut self) -> Result<(), Fault> {
        while let Some(token) = self.lexer.argument()? {
            let Token::Word(flag) = token else { continue };
            let Some(value) = self.text_argument()? else { break };
            let line = self.lexer.line();
            let wrong = |expected: &str| Fault::new(line, format!("the unit {value:?}"), expected);
            match flag {
                b"-l" | b"-linear" => {
                    self.scene.metres =
                        metres(&value).ok_or_else(|| wrong("mm, cm, m, km, in, ft, yd or mi"))?;
                }
                b"-a" | b"-angle" => {
                    self.scene.radians = match value.as_str() {
                        "deg" | "degree" => std::f64::consts::PI / 180.0,
                        "rad" | "radian" => 1.0,
                        _ => return Err(wrong("degree or radian")),
                    }
                }
                b"-t" | b"-time" => {
                    self.scene.fps = fps(&value).ok_or_else(|| wrong("film, pal, ntsc, 48fps, ..."))?;
                }
                _ => {}
            }
        }
        self.lexer.skip_statement()
    }

    fn requires(&mut self) -> Result<(), Fault> {
        let mut words = Vec::new();
        while let Some(token) = self.lexer.argument()? {
            match token {
                Token::Word(w) if w.starts_with(b"-") => {
                    self.lexer.argument()?;
                }
                Token::Word(w) => words.push(String::from_utf8_lossy(w).into_owned()),
                Token::Text(t) => words.push(t.into_owned()),
                Token::End => {}
            }
        }
        if let Some(plugin) = words.first()
            && plugin != "maya"
            && !HARMLESS_PLUGINS.contains(&plugin.as_str())
        {
            self.scene.notes.about("the scene requires plugins whose nodes are not read", words.join(" "));
        }
        self.lexer.skip_statement()
    }

    fn reference(&mut self) -> Result<(), Fault> {
        let line = self.lexer.line();
        let mut last = None;
        let mut is_reference = false;
        while let Some(token) = self.lexer.argument()? {
            match token {
                Token::Word(b"-r" | b"-reference") => is_reference = true,
                Token::Text(text) => last = Some(text.into_owned()),
                _ => {}
            }
        }
        if let Some(file) = last.filter(|_| is_reference) {
            let note = "references that are not followed (import them into the scene in Maya)";
            self.scene.notes.about(note, format!("line {line}: {file:?}"));
        }
        self.lexer.skip_statement()
    }

    fn connect(&mut self) -> Result<(), Fault> {
        let line = self.lexer.line();
        let (Some(from), Some(to)) = (self.text()?, self.text()?) else {
            return Err(Fault::new(
                line,
                "connectAttr with less than two attributes",
                "a source and a destination",
            ));
        };
        self.links.push((from.into(), to.into()));
        self.lexer.skip_statement()
    }

    fn resolve_links(&mut self) {
        for (from, to) in std::mem::take(&mut self.links) {
            if let (Some(from), Some(to)) = (self.plug(&from), self.plug(&to)) {
                self.scene.connect(from, to);
            }
        }
    }

    fn plug(&self, text: &str) -> Option<Plug> {
        let (node, attribute) = text.split_once('.')?;
        let short_steps = attribute.split('.').map(|step| match step.split_once('[') {
            Some((name, index)) => format!("{}[{index}", short(name)),
            None => short(step).to_owned(),
        });
        Some(Plug { node: self.scene.find(node)?, attribute: short_steps.collect::<Vec<_>>().join(".") })
    }

    fn set_attr(&mut self) -> Result<(), Fault> {
        let line = self.lexer.line();
        // Flags stand before the name, and only the name is in quotes.
        let Some(written) = self.text()? else { return self.lexer.skip_statement() };
        let (node, path) = match written.split_once('.') {
            Some(("", path)) => (self.current, path),
            Some((node, path)) => (self.scene.find(node), path),
            None => return self.lexer.skip_statement(),
        };
        let Some(id) = node else { return self.lexer.skip_statement() };
        match path {
            "nds" | "nodeState" if self.has_value()? => {
                self.scene.nodes[id].state = self.count("node state")?;
                return self.lexer.skip_statement();
            }
            "lodv" | "lodVisibility" if self.has_value()? => {
                self.scene.nodes[id].drawing.level_of_detail = self.visibility()?;
                return self.lexer.skip_statement();
            }
            "ove" | "overrideEnabled" if self.has_value()? => {
                self.scene.nodes[id].drawing.overridden = self.flag_on()?;
                return self.lexer.skip_statement();
            }
            "ovv" | "overrideVisibility" if self.has_value()? => {
                self.scene.nodes[id].drawing.override_visible = self.visibility()?;
                return self.lexer.skip_statement();
            }
            "v" | "visibility" if matches!(self.scene.nodes[id].data, Data::Other) && self.has_value()? => {
                self.scene.nodes[id].drawing.layer_visible = self.visibility()?;
                return self.lexer.skip_statement();
            }
            "en" | "envelope" if self.has_value()? => {
                self.scene.nodes[id].envelope = self.needed()?;
                return self.lexer.skip_statement();
            }
            _ => {}
        }
        // Taken out while it is filled, so that the parser can be used meanwhile.
        let mut data = std::mem::replace(&mut self.scene.nodes[id].data, Data::Other);
        let result = match &mut data {
            Data::Other => Ok(()),
            data => match Attribute::parse(path, line) {
                Ok(attribute) => self.fill(data, &attribute, line),
                Err(fault) => Err(fault),
            },
        };
        self.scene.nodes[id].data = data;
        result?;
        self.lexer.skip_statement()
    }

    /// False for `setAttr -l on ".tx";` and `setAttr -s 8 ".vt";`, which set no value.
    fn has_value(&mut self) -> Result<bool, Fault> {
        self.lexer.skip_type()?;
        Ok(!self.lexer.at_end()?)
    }

    fn fill(&mut self, data: &mut Data, attribute: &Attribute<'_>, line: usize) -> Result<(), Fault> {
        if !self.has_value()? {
            return Ok(());
        }
        match data {
            Data::Transform(transform) => self.fill_transform(transform, &attribute.key()),
            Data::Mesh(mesh) => self.fill_mesh(mesh, attribute, line),
            Data::BlendShape(shape) => self.fill_blend_shape(shape, attribute, line),
            Data::Tweak(tweak) => self.fill_tweak(tweak, attribute),
            Data::Curve(curve) => self.fill_curve(curve, attribute),
            Data::PolyCube(cube) => {
                let metres = self.scene.metres;
                match attribute.key().as_str() {
                    "w" => cube.size_m[0] = self.needed()? * metres,
                    "h" => cube.size_m[1] = self.needed()? * metres,
                    "d" => cube.size_m[2] = self.needed()? * metres,
                    "sw" => cube.segments[0] = self.count("segments")?,
                    "sh" => cube.segments[1] = self.count("segments")?,
                    "sd" => cube.segments[2] = self.count("segments")?,
                    _ => {}
                }
                Ok(())
            }
            Data::Script(body) => {
                if attribute.key() == "b"
                    && let Some(text) = self.text()?
                {
                    *body = text;
                }
                Ok(())
            }
            Data::Shading(settings) => {
                // Long names stay: shaders of plugins have no short ones that are known here.
                let (name, _) = attribute.last();
                if name == "ftn" || name == "fileTextureName" || name == "filename" {
                    if let Some(text) = self.text()? {
                        settings.insert(name.to_owned(), Setting::Text(text));
                    }
                    return Ok(());
                }
                let mut numbers = Vec::new();
                while numbers.len() < 4
                    && let Ok(Some(number)) = self.number()
                {
                    numbers.push(number);
                }
                if !numbers.is_empty() {
                    settings.insert(name.to_owned(), Setting::Numbers(numbers));
                }
                Ok(())
            }
            Data::Other => Ok(()),
        }
    }

    fn fill_transform(&mut self, transform: &mut Transform, key: &str) -> Result<(), Fault> {
        // Centimetres in a unit of length.
        let length = self.scene.metres * 100.0;
        let angle = self.scene.radians;
        let scaled = |v: [f64; 3], unit: f64| v.map(|c| c * unit);
        match key {
            "t" => transform.translate_cm = scaled(self.triple()?, length),
            "r" => transform.rotate = scaled(self.triple()?, angle),
            "s" => transform.scale = self.triple()?,
            "tx" | "t.tx" => transform.translate_cm[0] = self.needed()? * length,
            "ty" | "t.ty" => transform.translate_cm[1] = self.needed()? * length,
            "tz" | "t.tz" => transform.translate_cm[2] = self.needed()? * length,
            "rx" | "r.rx" => transform.rotate[0] = self.needed()? * angle,
            "ry" | "r.ry" => transform.rotate[1] = self.needed()? * angle,
            "rz" | "r.rz" => transform.rotate[2] = self.needed()? * angle,
            "sx" | "s.sx" => transform.scale[0] = self.needed()?,
            "sy" | "s.sy" => transform.scale[1] = self.needed()?,
            "sz" | "s.sz" => transform.scale[2] = self.needed()?,
            "ro" => transform.order = self.count("rotate order")?.min(5) as u8,
            "rp" => transform.rotate_pivot_cm = scaled(self.triple()?, length),
            "rpt" => transform.rotate_pivot_translate_cm = scaled(self.triple()?, length),
            "sp" => transform.scale_pivot_cm = scaled(self.triple()?, length),
            "spt" => transform.scale_pivot_translate_cm = scaled(self.triple()?, length),
            "jo" => transform.joint_orient = scaled(self.triple()?, angle),
            "ra" => transform.rotate_axis = scaled(self.triple()?, angle),
            "sh" => transform.shear = self.triple()?,
            "shxy" | "sh.shxy" => transform.shear[0] = self.needed()?,
            "shxz" | "sh.shxz" => transform.shear[1] = self.needed()?,
            "shyz" | "sh.shyz" => transform.shear[2] = self.needed()?,
            "opm" => {
                let mut matrix = [0.0; 16];
                for value in &mut matrix {
                    *value = self.needed()?;
                }
                transform.offset_parent = Some(matrix);
            }
            "it" => transform.inherits = self.flag_on()?,
            "v" => transform.visible = self.visibility()?,
            "rfa" => transform.facial_appearance = self.text()?,
            _ => {}
        }
        Ok(())
    }

    /// A `setAttr -k off ".v";` without a value says nothing about visibility.
    fn visibility(&mut self) -> Result<bool, Fault> {
        Ok(!matches!(self.lexer.argument()?, Some(Token::Word(b"no" | b"off" | b"false" | b"0"))))
    }

    fn fill_mesh(
        &mut self,
        mesh: &mut MeshData,
        attribute: &Attribute<'_>,
        line: usize,
    ) -> Result<(), Fault> {
        let (_, range) = attribute.last();
        let metres = self.scene.metres;
        let in_metres = |v: [f64; 3]| v.map(|c| (c * metres) as f32);
        match attribute.key().as_str() {
            "vt" => {
                let Some((from, _)) = range else { return Ok(()) };
                self.expect_end_of(from, mesh.points.len(), ".vt", line)?;
                while let Some(point) = self.next_triple()? {
                    mesh.points.push(in_metres(point));
                }
            }
            "pt" => {
                let Some((from, _)) = range else { return Ok(()) };
                let mut index = from;
                while let Some(tweak) = self.next_triple()? {
                    mesh.tweaks.insert(index, in_metres(tweak));
                    index = index.saturating_add(1);
                }
            }
            "pt.px" | "pt.py" | "pt.pz" => {
                let from = attribute.index(attribute.steps.len() - 2);
                self.components_of(&mut mesh.tweaks, from, axis(attribute))?;
            }
            "ed" => {
                let Some((from, _)) = range else { return Ok(()) };
                self.expect_end_of(from, mesh.edges.len(), ".ed", line)?;
                while let Some(start) = self.number()? {
                    let end = self.needed()?;
                    let _smooth = self.needed()?;
                    mesh.edges.push([whole(start, line)?, whole(end, line)?]);
                }
            }
            "fc" => {
                let Some((from, _)) = range else { return Ok(()) };
                self.expect_end_of(from, mesh.face_ends.len(), ".fc", line)?;
                self.faces(mesh)?;
            }
            "uvst.uvsp" => {
                let Some((from, _)) = range else { return Ok(()) };
                let set = mesh.uv_sets.entry(attribute.index(0)).or_default();
                self.expect_end_of(from, set.uvs.len(), ".uvsp", line)?;
                while let Some(u) = self.number()? {
                    // Maya's v grows upwards.
                    set.uvs.push([u as f32, (1.0 - self.needed()?) as f32]);
                }
            }
            "uvst.uvsn" => {
                let name = self.text()?.unwrap_or_default();
                mesh.uv_sets.entry(attribute.index(0)).or_default().name = name;
            }
            "cuvs" => mesh.current_uv_set = self.text()?,
            "io" => mesh.intermediate = self.flag_on()?,
            "v" => mesh.hidden = !self.visibility()?,
            "op" => mesh.opposite = self.flag_on()?,
            "iog.og.gcl" => {
                let group = (attribute.index(0), attribute.index(1));
                let (ranges, _) = self.components("f", line)?;
                mesh.face_groups.insert(group, ranges);
            }
            _ => {}
        }
        Ok(())
    }

    /// Blocks of an array must follow one another, as Maya writes them.
    fn expect_end_of(&self, from: u32, have: usize, name: &str, line: usize) -> Result<(), Fault> {
        if from as usize == have {
            return Ok(());
        }
        Err(Fault::new(
            line,
            format!("{name}[{from}:..] after {have} elements"),
            format!("{name}[{have}:..]"),
        ))
    }

    fn faces(&mut self, mesh: &mut MeshData) -> Result<(), Fault> {
        while let Some(token) = self.lexer.argument()? {
            let line = self.lexer.line();
            let Token::Word(word) = token else { continue };
            match word {
                b"f" => {
                    let count = self.count("edges of a face")?;
                    for _ in 0..count {
                        let edge = self.needed()?;
                        if !(edge.abs() <= LARGEST_INDEX as f64 && edge.fract() == 0.0) {
                            return Err(Fault::new(line, edge.to_string(), "an edge"));
                        }
                        mesh.corners.push(edge as i32);
                    }
                    mesh.face_ends.push(mesh.corners.len() as u32);
                }
                b"h" => {
                    mesh.holes += 1;
                    for _ in 0..self.count("edges of a hole")? {
                        self.needed()?;
                    }
                }
                b"mu" => {
                    let set = self.count("texture coordinate set")?;
                    let count = self.count("texture coordinates of a face")?;
                    let end = mesh.corners.len();
                    // Coordinates belong to the face before them, the last corners that there are.
                    let start = match mesh.face_ends.len() {
                        0 => end,
                        1 => 0,
                        n => mesh.face_ends[n - 2] as usize,
                    };
                    let uvs = mesh.corner_uvs.entry(set).or_default();
                    uvs.resize(start.max(uvs.len()), u32::MAX);
                    for _ in 0..count {
                        let uv = self.needed()?;
                        if uvs.len() < end {
                            uvs.push(whole(uv, line)?);
                        }
                    }
                }
                // Colours and the like: a set, a count and the values, or only the count.
                b"mc" => {
                    self.needed()?;
                    for _ in 0..self.count("colours of a face")? {
                        self.needed()?;
                    }
                }
                b"fc" => {
                    for _ in 0..self.count("colours of a face")? {
                        self.needed()?;
                    }
                }
                other => {
                    let found = format!("{:?}", String::from_utf8_lossy(other));
                    return Err(Fault::new(line, found, "f, h, mu, mc or fc of a face"));
                }
            }
        }
        Ok(())
    }

    /// `componentList 2 "vtx[0]" "vtx[6:7]"`: ranges, and whether there was a list.
    fn components(&mut self, kind: &str, line: usize) -> Result<(Vec<[u32; 2]>, bool), Fault> {
        let mut ranges = Vec::new();
        let mut any = false;
        while let Some(token) = self.lexer.argument()? {
            let Token::Text(text) = token else { continue };
            any = true;
            let wrong =
                || Fault::new(line, format!("the component {text:?}"), format!("{kind}[0] or {kind}[0:7]"));
            let inner =
                text.strip_prefix(kind).and_then(|t| t.strip_prefix('[')).and_then(|t| t.strip_suffix(']'));
            let inner = inner.ok_or_else(wrong)?;
            if inner == "*" {
                ranges.push([0, u32::MAX]);
                continue;
            }
            let (from, to) = inner.split_once(':').unwrap_or((inner, inner));
            let index = |s: &str| s.parse::<u32>().ok().filter(|i| u64::from(*i) <= LARGEST_INDEX);
            let (from, to) = (index(from).ok_or_else(wrong)?, index(to).ok_or_else(wrong)?);
            if to < from {
                return Err(wrong());
            }
            ranges.push([from, to]);
        }
        Ok((ranges, any))
    }
}

fn whole(value: f64, line: usize) -> Result<u32, Fault> {
    if value >= 0.0 && value <= LARGEST_INDEX as f64 && value.fract() == 0.0 {
        return Ok(value as u32);
    }
    Err(Fault::new(line, value.to_string(), "a whole number of 0 or more"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_name_the_line() {
        for (text, line, found) in [
            ("FOR4", 1, "binary"),
            ("", 1, "no statement"),
            ("hello world;\n", 1, "no statement of a Maya scene"),
            ("currentUnit -l\n parsec;", 2, "parsec"),
            ("createNode mesh -n \"a\" -p \"gone\";", 1, "the parent"),
            ("createNode mesh -n \"a\";\n\tsetAttr \".vt[0:1]\" 0 0 0 1 1;", 2, "end of the statement"),
            ("createNode mesh -n \"a\";\n\tsetAttr \".vt[0:1]\" 0 0\n wide;", 3, "wide"),
            ("createNode mesh -n \"a\";\n\tsetAttr \".vt[5:6]\" 0 0 0;", 2, ".vt[5:..] after 0"),
            ("createNode mesh -n \"a\";\n\tsetAttr \".vt[5\" 0 0 0;", 2, "attribute"),
            ("createNode mesh -n \"a\";\n\tsetAttr \".fc[0]\" -type \"polyFaces\"\n g 3 0 1 2;", 3, "\"g\""),
            ("createNode mesh -n \"a\";\n\tsetAttr \".ed[0]\" 0 -1 0;", 2, "-1"),
            (
                "createNode blendShape -n \"b\";\nsetAttr \".it[0].itg[0].iti[6000].ict\" -type \"componentList\" 1 \"e[0]\";",
                2,
                "e[0]",
            ),
        ] {
            let fault = parse(text.as_bytes()).unwrap_err();
            assert!(fault.found.contains(found), "{text:?}: {fault:?}");
            assert_eq!(fault.line, line, "{text:?}: {fault:?}");
        }
    }

    #[test]
    fn what_a_scene_requires_is_named() {
        let scene = parse(b"requires maya \"2024\";\nrequires -nodeType \"x\" \"mtoa\" \"5.3\";\nrequires \"faceware\" \"1\";\nfile -r -ns \"a\" -typ \"mayaAscii\" \"C:/a.ma\";").unwrap();
        let notes = scene.notes.lines();
        assert_eq!(notes.len(), 2, "{notes:?}");
        assert!(notes[0].contains("faceware 1") && notes[1].contains("C:/a.ma"));
    }
}
