//! Texts of geometry: OBJ, USD, Maya ASCII.

use super::{Case, truncated, write};

fn repeated(line: impl Fn(usize) -> String, count: usize) -> String {
    (0..count).map(line).collect()
}

const TRIANGLE: &str = "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nvt 0 0\nvt 1 0\nvt 0 1\n";

fn obj(name: &str, text: impl FnOnce() -> String + 'static) -> Case {
    Case::check(format!("obj/{name}"), "a.obj", move || text().into_bytes())
}

fn obj_cases() -> Vec<Case> {
    let mut all = truncated(
        "obj",
        "a.obj",
        &["check", "{}/a.obj"],
        format!("{TRIANGLE}{}", "f 1/1 2/2 3/3\n".repeat(40)).as_bytes(),
    );
    all.push(obj("groups-100000", || {
        TRIANGLE.to_owned() + &repeated(|i| format!("g g{i}\nf 1/1 2/2 3/3\n"), 100_000)
    }));
    all.push(obj("materials-100000", || {
        TRIANGLE.to_owned() + &repeated(|i| format!("usemtl m{i}\nf 1/1 2/2 3/3\n"), 100_000)
    }));
    all.push(obj("one-group-100000-times", || {
        TRIANGLE.to_owned() + &"g a\nf 1/1 2/2 3/3\ng b\nf 1 2 3\n".repeat(100_000)
    }));
    all.push(obj("libraries-100000", || {
        repeated(|i| format!("mtllib m{i}.mtl\n"), 100_000) + TRIANGLE + "f 1 2 3\n"
    }));
    all.push(obj("statements-of-1M-kinds", || {
        repeated(|i| format!("x{i} 1\n"), 1_000_000) + TRIANGLE + "f 1 2 3\n"
    }));
    all.push(obj("line-of-200MB", || format!("{TRIANGLE}f{}\n", " 1".repeat(100_000_000))));
    all.push(obj("comment-of-200MB", || format!("#{}\n{TRIANGLE}f 1 2 3\n", "x".repeat(200_000_000))));
    all.push(obj("name-of-200MB", || format!("{TRIANGLE}g {}\nf 1 2 3\n", "x".repeat(200_000_000))));
    all.push(obj("continued-1M-times", || format!("{TRIANGLE}f 1 2 3{}\n", " \\\n 1".repeat(1_000_000))));
    all.push(obj("empty-lines-100M", || "\n".repeat(100_000_000)));
    all.push(obj("points-20M", || "v 0 0 0\n".repeat(20_000_000)));
    all.push(obj("points-4M", || "v 0 0 0\n".repeat(4_000_000) + "f 1 2 3\n"));
    all.push(obj("faces-10M", || TRIANGLE.to_owned() + &"f 1 2 3\n".repeat(10_000_000)));
    all.push(obj("face-of-100000-corners", || {
        let point = |i: usize| {
            let a = i as f64 * std::f64::consts::TAU / 100_000.0;
            let r = if i.is_multiple_of(2) { 1.0 } else { 0.5 };
            format!("v {} {} 0\n", r * a.cos(), r * a.sin())
        };
        let corners: String = (1..=100_000).map(|i| format!(" {i}")).collect();
        repeated(point, 100_000) + &format!("f{corners}\n")
    }));
    all.push(obj("faces-of-1000-corners", || {
        let point = |i: usize| format!("v {} {} 0\n", i % 7, (i * 37) % 11);
        let corners: String = (1..=1000).map(|i| format!(" {i}")).collect();
        repeated(point, 1000) + &format!("f{corners}\n").repeat(1000)
    }));
    for (name, face) in [
        ("1e9", "f 1000000000 2 3"),
        ("2e64", "f 18446744073709551615 2 3"),
        ("0", "f 0 1 2"),
        ("minus", "f -1 -2 -99"),
        ("slashes", "f 1//////1 2 3"),
        ("words", "f a b c"),
    ] {
        all.push(obj(&format!("index-{name}"), move || format!("{TRIANGLE}{face}\n")));
    }
    for (name, point) in [
        ("nan", "v nan 0 0"),
        ("inf", "v inf 0 0"),
        ("1e39", "v 1e39 0 0"),
        ("1e38", "v 1e38 -1e38 0"),
        ("short", "v 1"),
    ] {
        let case = obj(&format!("point-{name}"), move || format!("{point}\n{TRIANGLE}f 1 2 3\n"));
        all.push(if name == "nan" { case.small() } else { case });
    }
    all.push(
        Case::check("obj/utf-16", "a.obj", || {
            format!("\u{feff}{TRIANGLE}").encode_utf16().flat_map(u16::to_le_bytes).collect()
        })
        .refused(),
    );
    all.push(Case::check("obj/zeros", "a.obj", || vec![0; 10_000_000]));
    for (name, written) in [("above", "../secret.png"), ("absolute", "/etc/passwd"), ("zero", "/dev/zero")] {
        all.push(Case::new(format!("obj/picture-{name}"), &["check", "{}/a.obj"], move |f| {
            write(f, "a.obj", format!("mtllib a.mtl\n{TRIANGLE}usemtl m\nf 1/1 2/2 3/3\n").as_bytes());
            write(f, "a.mtl", format!("newmtl m\nmap_Kd {written}\nnorm {written}\n").as_bytes());
        }));
    }
    #[cfg(unix)]
    all.push(Case::new("obj/library-is-a-pipe", &["check", "{}/a.obj"], |f| {
        write(f, "a.obj", format!("mtllib a.mtl\n{TRIANGLE}f 1 2 3\n").as_bytes());
        super::gltf::fifo(f, "a.mtl");
    }));
    all.push(Case::new("obj/library-of-100000-materials", &["check", "{}/a.obj"], |f| {
        write(f, "a.obj", format!("mtllib a.mtl\n{TRIANGLE}usemtl m7\nf 1 2 3\n").as_bytes());
        write(f, "a.mtl", repeated(|i| format!("newmtl m{i}\nKd 1 0 0\nevil{i} 1\n"), 100_000).as_bytes());
    }));
    all.push(Case::new("obj/library-names-itself", &["check", "{}/a.obj"], |f| {
        write(f, "a.obj", format!("mtllib a.obj\n{TRIANGLE}f 1 2 3\n").as_bytes());
    }));
    all
}

const USD: &str = "#usda 1.0\n( metersPerUnit = 1\n upAxis = \"Y\" )\n";

fn mesh(name: &str) -> String {
    format!(
        "def Mesh \"{name}\" {{ int[] faceVertexCounts = [3]\n int[] faceVertexIndices = [0, 1, 2]\n \
         point3f[] points = [(0, 0, 0), (0.1, 0, 0), (0, 0.1, 0)] }}\n"
    )
}

fn usd(name: &str, text: impl FnOnce() -> String + 'static) -> Case {
    let file = "a.usda";
    Case::new(format!("usd/{name}"), &["import", "{}/a.usda", "--maps", "0", "-o", "{}/b.glb"], move |f| {
        write(f, file, format!("{USD}{}", text()).as_bytes());
    })
}

fn usd_check(name: &str, text: impl FnOnce() -> String + 'static) -> Case {
    Case::check(format!("usd/check-{name}"), "a.usda", move || format!("{USD}{}", text()).into_bytes())
}

fn usd_cases() -> Vec<Case> {
    let mut all =
        truncated("usda", "a.usda", &["check", "{}/a.usda"], format!("{USD}{}", mesh("face")).as_bytes());
    all.push(usd_check("plain", || mesh("a")));
    all.push(usd_check("prims-100000", || repeated(|i| format!("def Scope \"s{i}\" {{ }}\n"), 100_000)));
    all.push(usd_check("meshes-100000", || repeated(|i| mesh(&format!("m{i}")), 100_000)));
    all.push(usd("prims-100000", || {
        repeated(|i| format!("def Scope \"s{i}\" {{ }}\n"), 100_000) + &mesh("a")
    }));
    all.push(usd("meshes-20000", || repeated(|i| mesh(&format!("m{i}")), 20_000)));
    all.push(usd("bindings-to-nothing-100000", || {
        let bound = |i: usize| {
            let material = format!("rel material:binding = </m{i}>\n int[] faceVertexCounts");
            mesh(&format!("m{i}")).replace("int[] faceVertexCounts", &material)
        };
        repeated(bound, 20_000)
    }));
    all.push(usd_check("connections-to-nothing-100000", || {
        repeated(|i| format!("def Shader \"s{i}\" {{ token a.connect = </x{i}.b> }}\n"), 100_000)
    }));
    all.push(usd_check("levels-100000", || "def \"a\" {\n".repeat(100_000)));
    all.push(usd_check("brackets-100000", || format!("def \"a\" {{ float x = {}", "[".repeat(100_000))));
    all.push(usd_check("string-without-end-100MB", || {
        format!("def \"a\" {{ string s = \"{}", "x".repeat(100_000_000))
    }));
    all.push(usd_check("values-50M", || format!("def \"a\" {{ int[] x = [{}0] }}", "0,".repeat(50_000_000))));
    all.push(usd_check("line-of-200MB", || format!("# {}\n", "x".repeat(200_000_000))));
    for (name, from, to) in [
        ("counts-1e9", "faceVertexCounts = [3]", "faceVertexCounts = [1000000000]"),
        ("counts-minus", "faceVertexCounts = [3]", "faceVertexCounts = [-3]"),
        ("counts-nan", "faceVertexCounts = [3]", "faceVertexCounts = [nan]"),
        ("counts-2e64", "faceVertexCounts = [3]", "faceVertexCounts = [1e30, 1e30]"),
        ("index-1e9", "[0, 1, 2]", "[0, 1, 1000000000]"),
        ("index-minus", "[0, 1, 2]", "[0, 1, -1]"),
        ("index-nan", "[0, 1, 2]", "[0, 1, nan]"),
        ("points-nan", "(0.1, 0, 0)", "(nan, 0, 0)"),
        ("points-inf", "(0.1, 0, 0)", "(inf, 0, 0)"),
        ("points-1e300", "(0.1, 0, 0)", "(1e300, 0, 0)"),
    ] {
        all.push(usd(name, move || mesh("a").replace(from, to)));
    }
    all.push(usd("shapes-10000-of-30000-points", || {
        let points: String = (0..30_000).map(|i| format!("({}, 0, {}),", i % 100, i / 100)).collect();
        let shapes = repeated(|i| format!("def BlendShape \"s{i}\" {{ vector3f[] offsets = [(1, 0, 0)]\n int[] pointIndices = [{i}] }}\n"), 10_000);
        let names: String = (0..10_000).map(|i| format!("\"s{i}\",")).collect();
        let targets: String = (0..10_000).map(|i| format!("</a/s{i}>,")).collect();
        format!(
            "def Mesh \"a\" {{ int[] faceVertexCounts = [3]\n int[] faceVertexIndices = [0, 1, 102]\n \
             point3f[] points = [{points}]\n uniform token[] skel:blendShapes = [{names}]\n \
             rel skel:blendShapeTargets = [{targets}]\n{shapes}}}\n"
        )
    }));
    let package = |bytes: &[u8]| {
        rubor_assets::usdz::write(&[("a.usda", bytes), ("../evil.png", b"x")]).expect("a package")
    };
    let whole = package(format!("{USD}{}", mesh("face")).as_bytes());
    all.extend(truncated("usdz", "a.usdz", &["check", "{}/a.usdz"], &whole));
    let evil = whole.clone();
    all.push(Case::check("usdz/name-above", "a.usdz", move || evil));
    all.push(Case::check("usdz/directory-names-itself", "a.usdz", move || {
        let mut bytes = whole;
        let at = bytes.windows(4).position(|w| w == b"PK\x01\x02").expect("a directory");
        bytes[at + 20..at + 28].fill(0xff);
        bytes
    }));
    all.push(Case::check("usdz/binary-layer", "a.usdz", || {
        rubor_assets::usdz::write(&[("a.usdc", b"PXR-USDC")]).expect("a package")
    }));
    all
}

const MAYA: &str = "//Maya ASCII 2024 scene\nrequires maya \"2024\";\n";

fn maya(name: &str, text: impl FnOnce() -> String + 'static) -> Case {
    Case::check(format!("maya/{name}"), "a.ma", move || format!("{MAYA}{}", text()).into_bytes())
}

fn maya_cases() -> Vec<Case> {
    let node = "createNode transform -n \"t\";\ncreateNode mesh -n \"m\" -p \"t\";\n";
    let attribute = "setAttr -s 3 \".vt[0:2]\" 0 0 0 1 0 0 0 1 0;\nsetAttr -s 3 \".ed[0:2]\" 0 1 0 1 2 0 2 0 0;\n\
                     setAttr -s 1 \".fc[0]\" -type \"polyFaces\" f 3 0 1 2;\n";
    let mut all =
        truncated("ma", "a.ma", &["check", "{}/a.ma"], format!("{MAYA}{node}{attribute}").as_bytes());
    all.push(maya("plain", move || format!("{node}{attribute}")));
    all.push(maya("requires-100000", move || {
        repeated(|i| format!("requires \"plugin{i}\" \"1\";\n"), 100_000) + node + attribute
    }));
    all.push(maya("nodes-100000", || repeated(|i| format!("createNode transform -n \"t{i}\";\n"), 100_000)));
    all.push(maya("nodes-of-one-name-100000", || "createNode transform -n \"t\";\n".repeat(100_000)));
    all.push(maya("levels-100000", || {
        repeated(|i| format!("createNode transform -n \"t{}\" -p \"t{i}\";\n", i + 1), 100_000).replacen(
            " -p \"t0\"",
            "",
            1,
        )
    }));
    all.push(maya("meshes-20000", move || {
        repeated(|i| format!("{node}{attribute}").replace("\"t\"", &format!("\"t{i}\"")), 20_000)
    }));
    all.push(maya("connections-100000-to-nothing", || {
        repeated(|i| format!("connectAttr \"a{i}.x\" \"b{i}.y\";\n"), 100_000)
    }));
    all.push(maya("instances-100000", move || {
        format!("{node}{attribute}")
            + &repeated(
                |i| format!("createNode transform -n \"p{i}\";\nparent -s -nc -r -add \"|t|m\" \"p{i}\";\n"),
                100_000,
            )
    }));
    all.push(maya("references-100000", || {
        repeated(|i| format!("file -rdi 1 -ns \"n{i}\" -rfn \"r{i}\" \"f{i}.ma\";\n"), 100_000)
    }));
    all.push(maya("unknown-statements-1M", || "evil 1;\n".repeat(1_000_000)));
    for (name, text) in [
        ("vertices-50M", "setAttr -s 50000000 \".vt[0:49999999]\" 0 0 0;\n"),
        ("vertices-1e9", "setAttr -s 1000000000 \".vt[0:999999999]\" 0 0 0;\n"),
        ("vertex-49999999", "setAttr \".vt[49999999]\" 0 0 0;\n"),
        ("edges-50M", "setAttr -s 50000000 \".ed[0:49999999]\" 0 1 0;\n"),
        ("face-50M", "setAttr -s 1 \".fc[0]\" -type \"polyFaces\" f 50000000 0 1 2;\n"),
        ("faces-49999999", "setAttr \".fc[49999999]\" -type \"polyFaces\" f 3 0 1 2;\n"),
        ("uvs-50M", "setAttr \".uvst[0].uvsp[49999999]\" -type \"float2\" 0 0;\n"),
        ("uv-sets-49999999", "setAttr \".uvst[49999999].uvsn\" -type \"string\" \"a\";\n"),
        ("backwards", "setAttr \".vt[5:2]\" 0 0 0;\n"),
        ("nan", "setAttr \".vt[0]\" nan inf 1e400;\n"),
        ("double-array-2e31", "setAttr \".x\" -type \"doubleArray\" 2147483647 0;\n"),
        ("components-1e9", "setAttr \".ict\" -type \"componentList\" 1000000000 \"vtx[0]\";\n"),
    ] {
        all.push(maya(name, move || format!("{node}{attribute}{text}")));
    }
    all.push(maya("targets", move || {
        format!("{node}{attribute}createNode blendShape -n \"b\";\n")
            + &repeated(
                |i| format!("setAttr \".it[0].itg[{i}].iti[6000].ipt\" -type \"pointArray\" 1 0 0 1 1;\n"),
                100_000,
            )
    }));
    all.push(maya("target-49999999", move || {
        format!("{node}{attribute}createNode blendShape -n \"b\";\nsetAttr \".it[0].itg[49999999].iti[6000].ipt\" -type \"pointArray\" 49999999 0 0 1 1;\n")
    }));
    all.push(maya("curve-of-1e9-keys", || {
        "createNode animCurveTU -n \"c\";\nsetAttr -s 1000000000 \".ktv[0:999999999]\" 1 0;\n".into()
    }));
    all.push(maya("curve-of-years", move || {
        format!("{node}{attribute}createNode animCurveTU -n \"c\";\nsetAttr -s 2 \".ktv[0:1]\" 1 0 1e12 1;\ncreateNode blendShape -n \"b\";\nsetAttr -s 1 \".w[0]\";\nconnectAttr \"c.o\" \"b.w[0]\";\n")
    }));
    all.push(maya("string-without-end-100MB", || format!("setAttr \".x\" \"{}", "x".repeat(100_000_000))));
    all.push(maya("comment-without-end-100MB", || format!("/*{}", "x".repeat(100_000_000))));
    all.push(maya("line-of-200MB", move || {
        format!("{node}{attribute}setAttr \".x\"{};\n", " 1".repeat(100_000_000))
    }));
    all.push(Case::check("maya/binary", "a.ma", || b"FOR4\0\0\0\0".to_vec()).refused());
    all.push(Case::check("maya/zeros", "a.ma", || vec![0; 10_000_000]));
    all
}

pub(crate) fn cases() -> Vec<Case> {
    [obj_cases(), usd_cases(), maya_cases()].into_iter().flatten().collect()
}
