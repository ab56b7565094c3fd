//! Scenes of a plate of 3 x 3 points, 2 cm apart, whose target "smile" lifts points 6, 7 and 8 by 1 cm.

const PLATE: &str = "	setAttr -s 9 \".vt[0:8]\" 0 0 0 2 0 0 4 0 0 0 2 0 2 2 0 4 2 0 0 4 0 2 4 0 4 4 0;
	setAttr -s 12 \".ed[0:11]\" 0 1 0 1 4 0 4 3 0 3 0 0 1 2 0 2 5 0 5 4 0 4 7 0 7 6 0 6 3 0 5 8 0 8 7 0;
	setAttr -s 4 \".fc[0:3]\" -type \"polyFaces\" f 4 0 1 2 3 f 4 4 5 6 -2 f 4 -3 7 8 9 f 4 -7 10 11 -8;
";
const TARGET: &str =
    "	setAttr \".it[0].itg[0].iti[6000].ipt\" -type \"pointArray\" 3 0 1 0 1 0 1 0 1 0 1 0 1;
	setAttr \".it[0].itg[0].iti[6000].ict\" -type \"componentList\" 1 \"vtx[6:8]\";
	setAttr \".aal\" -type \"attributeAlias\" {\"smile\",\"weight[0]\"};
";
/// Linear keys from 0 to 1 in a second.
pub(crate) const RISE: &str = "createNode animCurveTU -n \"rise\";
	setAttr \".tan\" 2;
	setAttr -s 2 \".ktv[0:1]\"  0 0 24 1;
";

/// A scene in the making: mesh "face", undeformed points "orig", blend shape "bs".
#[derive(Default)]
pub(crate) struct Scene {
    header: String,
    transform: String,
    mesh: String,
    shape: String,
    more: String,
    last: String,
    tweaked: bool,
}

impl Scene {
    pub(crate) fn new() -> Self {
        Self::default()
    }

    pub(crate) fn header(mut self, text: &str) -> Self {
        self.header += text;
        self
    }

    /// A statement about the transform "face".
    pub(crate) fn transform(mut self, line: &str) -> Self {
        self.transform += &format!("\t{line}\n");
        self
    }

    /// A statement about its mesh.
    pub(crate) fn mesh(mut self, line: &str) -> Self {
        self.mesh += &format!("\t{line}\n");
        self
    }

    /// A statement about the blend shape.
    pub(crate) fn shape(mut self, line: &str) -> Self {
        self.shape += &format!("\t{line}\n");
        self
    }

    /// Further nodes and connections.
    pub(crate) fn more(mut self, text: &str) -> Self {
        self.more += text;
        self
    }

    /// The source behind all connections.
    pub(crate) fn last(mut self, text: &str) -> Self {
        self.last += text;
        self
    }

    /// A tweak node between the points and the blend shape.
    pub(crate) fn tweak(mut self, lines: &str) -> Self {
        self.tweaked = true;
        self.more(&format!("createNode tweak -n \"tw\";\n{lines}\nconnectAttr \"orig.w\" \"tw.ip[0].ig\";\n"))
    }

    pub(crate) fn text(&self) -> String {
        let Self { header, transform, mesh, shape, more, last, tweaked } = self;
        let source = if *tweaked { "tw.og[0]" } else { "orig.w" };
        format!(
            "//Maya ASCII 2020 scene
{header}requires maya \"2020\";
currentUnit -l centimeter -a degree -t film;
createNode transform -n \"face\";
{transform}createNode mesh -n \"faceShape\" -p \"face\";
{mesh}createNode mesh -n \"orig\" -p \"face\";
	setAttr \".io\" yes;
{PLATE}createNode blendShape -n \"bs\";
{shape}{TARGET}{more}connectAttr \"{source}\" \"bs.ip[0].ig\";
connectAttr \"bs.og[0]\" \"faceShape.i\";
{last}"
        )
    }

    pub(crate) fn bytes(&self) -> Vec<u8> {
        self.text().into_bytes()
    }
}

/// A second plate, 10 cm to the right, whose target has the same name. `shape` stands at its blend shape.
pub(crate) fn second_plate(shape: &str) -> String {
    format!(
        "createNode transform -n \"brow\";
	setAttr \".t\" -type \"double3\" 10 0 0;
createNode mesh -n \"browShape\" -p \"brow\";
createNode mesh -n \"browOrig\" -p \"brow\";
	setAttr \".io\" yes;
{PLATE}createNode blendShape -n \"bs2\";
{shape}{TARGET}connectAttr \"browOrig.w\" \"bs2.ip[0].ig\";
connectAttr \"bs2.og[0]\" \"browShape.i\";
"
    )
}

/// A triangle in 2^levels places.
pub(crate) fn nested_instances(levels: usize) -> Vec<u8> {
    let mut text = String::new();
    for level in 0..levels {
        text += &format!("createNode transform -n \"a{level}\";\ncreateNode transform -n \"b{level}\";\n");
    }
    for level in 1..levels {
        for (child, parent) in [("a", "a"), ("a", "b"), ("b", "a"), ("b", "b")] {
            text += &format!("parent -add \"{child}{level}\" \"{parent}{}\";\n", level - 1);
        }
    }
    text += &format!(
        "createNode mesh -n \"m\" -p \"a{}\";\n{PLATE}parent -add \"m\" \"b{}\";\n",
        levels - 1,
        levels - 1
    );
    text.into_bytes()
}
