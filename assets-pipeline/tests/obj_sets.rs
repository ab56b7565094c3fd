//! OBJ sets: a small one, broken ones, and the ICT head.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use rubor_assets::import::obj::{GroupBy, from_bytes as read_obj, read_polygons};
use rubor_assets::import::obj_set::{Options, Units, import};
use rubor_rig::head::Material;

/// A folder that is removed when dropped.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str, files: &[(&str, &str)]) -> Self {
        let path = std::env::temp_dir().join(format!("rubor-obj-{}-{name}", std::process::id()));
        fs::create_dir_all(&path).unwrap();
        for (file, text) in files {
            fs::write(path.join(file), text).unwrap();
        }
        Self(path)
    }

    fn import(&self) -> Result<rubor_rig::head::Head, String> {
        import(&Options { folder: self.0.clone(), occlusion_rays: 0, ..Options::default() })
            .map_err(|e| e.to_string())
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

const NEUTRAL: &str = "v 0 0 0\nv 10 0 0\nv 10 10 0\nv 0 10 0\nv 5 5 5\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n\
    usemtl M_Face\nf 1/1 2/2 3/3 4/4\nusemtl M_EyeLashes\nf -2/1 3/3 -1/2\n";

#[test]
fn a_set_becomes_a_head_in_metres() {
    let smile = NEUTRAL.replace("v 10 10 0", "v 10 12.5 0");
    let head = Folder::new("good", &[("neutral.obj", NEUTRAL), ("smile.obj", &smile)]).import().unwrap();
    assert_eq!(
        head.mesh.parts.iter().map(|p| p.material).collect::<Vec<_>>(),
        [Material::Skin, Material::Lash]
    );
    assert_eq!(head.mesh.triangles.len(), 3);
    assert!(head.bounds().unwrap().1.abs_diff_eq(glam::Vec3::new(0.1, 0.1, 0.05), 1e-6));
    let shape = &head.shapes[0];
    assert_eq!((shape.name.as_str(), shape.points.len()), ("smile", 1));
    assert!((shape.offsets[0].y - 0.025).abs() < 1e-6);
    // v of the file grows upwards, ours downwards.
    assert_eq!(head.mesh.vertices[0].uv.to_array(), [0.0, 1.0]);
}

/// Name, files (name and text), words of the message.
type Case<'a> = (&'a str, &'a [(&'a str, &'a str)], &'a [&'a str]);

#[test]
fn broken_sets_say_file_place_found_and_expected() {
    let short = "v 0 0 0\nv 1 0 0\n";
    let cases: [Case<'_>; 8] = [
        ("empty-folder", &[], &["no *.obj files"]),
        ("no-neutral", &[("a.obj", NEUTRAL)], &["neutral", "1 OBJ files"]),
        (
            "count",
            &[("neutral.obj", NEUTRAL), ("jaw.obj", short)],
            &["jaw.obj", "found 2", "expected 5", "neutral.obj"],
        ),
        (
            "nan",
            &[("neutral.obj", &NEUTRAL.replace("v 10 10 0", "v 10 nan 0"))],
            &["neutral.obj, line 3", "nan"],
        ),
        ("word", &[("neutral.obj", NEUTRAL), ("b.obj", "v 1 2\n")], &["b.obj, line 1", "end of line"]),
        ("range", &[("neutral.obj", &NEUTRAL.replace("f 1/1", "f 9/1"))], &["line 11", "9/1", "1 to 5"]),
        ("uv", &[("neutral.obj", &NEUTRAL.replace("f 1/1", "f 1/7"))], &["line 11", "1 to 4"]),
        ("nothing", &[("neutral.obj", "")], &["neutral.obj", "no faces"]),
    ];
    for (name, files, words) in cases {
        let error = Folder::new(name, files).import().expect_err(name);
        assert!(words.iter().all(|w| error.contains(w)), "{name}: {error}");
    }
    let missing = import(&Options { folder: "/nowhere/at/all".into(), ..Options::default() }).unwrap_err();
    assert!(missing.to_string().contains("/nowhere/at/all"), "{missing}");
    let bytes = Folder::new("bytes", &[]);
    fs::write(bytes.0.join("neutral.obj"), [0xff, 0xfe, b'\n', 0, b'f', b' ', 0xc3]).unwrap();
    assert!(bytes.import().is_err());
    assert!(read_polygons(Path::new("/nowhere.obj"), GroupBy::Group).is_err());
}

/// Found by fuzzing: `tobj` takes a coordinate that does not exist for none where the file has none at all.
#[test]
fn corners_need_the_texture_coordinates_that_they_name() {
    let text = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf 1//1 2/1 2\n";
    let error = read_obj(text, Path::new("a.obj"), GroupBy::Group).unwrap_err().to_string();
    assert!(error.contains("a texture coordinate from 1 to 0"), "{error}");
}

#[test]
fn units_are_read() {
    assert_eq!("cm".parse::<Units>().unwrap().metres(), 0.01);
    assert_eq!("in".parse::<Units>().unwrap().metres(), 0.0254);
    assert!("yd".parse::<Units>().unwrap_err().contains("mm, cm, dm, m or in"));
}

#[test]
fn the_ict_head_is_understood() {
    let Ok(shared) = std::env::var("RUBOR_SHARED") else {
        writeln!(std::io::stderr(), "SKIPPED: RUBOR_SHARED is not set, the ICT head was not imported")
            .expect("stderr is open");
        return;
    };
    let folder = Path::new(&shared).join("heads/ict");
    let head = import(&Options { folder, occlusion_rays: 0, ..Options::default() }).unwrap();
    assert_eq!((head.mesh.points.len(), head.shapes.len()), (28167, 57));
    let triangles = |m: Material| -> u32 {
        head.mesh.parts.iter().filter(|p| p.material == m).map(|p| p.triangles.len() as u32).sum()
    };
    // 25 836 quads and 548 triangles, of which cards of lashes became hairs.
    let others = head.mesh.triangles.len() as u32 - triangles(Material::Lash);
    assert!((51_000..=2 * 25836 + 548).contains(&others), "{others}");
    for m in
        [Material::Skin, Material::Mucosa, Material::Eye, Material::Teeth, Material::Gums, Material::Lash]
    {
        assert!(triangles(m) > 1000, "{m:?}: {}", triangles(m));
    }
    assert!(
        triangles(Material::Wet) > 0 && triangles(Material::Hidden) > 0 && triangles(Material::Other) == 0
    );
    let at = |name: &str| head.landmarks[name];
    assert!(at("eye-left").x > 0.02 && at("eye-right").x < -0.02);
    assert!(at("exocanthion-left").x > at("endocanthion-left").x);
    assert!(at("pronasale").z > at("sellion").z && at("menton").y < at("stomion").y);
    assert!((at("eye-left").x + at("eye-right").x).abs() < 1e-3);
    let jaw = &head.shapes[head.shape_index("jawOpen").unwrap()];
    let longest = jaw.offsets.iter().map(|o| o.length()).fold(0.0, f32::max);
    assert!((0.041..0.043).contains(&longest), "{longest}");
}
