//! Shaders and file textures of scenes.

use rubor_maya::read::{self, Imported};
use rubor_rig::authored::AlphaMode;
use rubor_rig::head::Material;

fn png(texel: [u8; 4]) -> Vec<u8> {
    let picture = image::RgbaImage::from_pixel(2, 2, image::Rgba(texel));
    let mut bytes = Vec::new();
    picture.write_to(&mut std::io::Cursor::new(&mut bytes), image::ImageFormat::Png).expect("memory");
    bytes
}

/// A quad in one shading group, a second one in another.
fn scene(shaders: &str) -> String {
    let mut text = String::from(
        "//Maya ASCII 2024 scene\nrequires maya \"2024\";\ncurrentUnit -l centimeter -a degree -t film;\n",
    );
    for (name, x) in [("face", 0), ("hat", 30)] {
        text += &format!(
            "createNode transform -n \"{name}\";\ncreateNode mesh -n \"{name}Shape\" -p \"{name}\";\n\
             \tsetAttr -s 4 \".vt[0:3]\" {x} 0 0 {} 0 0 {} 20 0 {x} 20 0;\n\
             \tsetAttr -s 4 \".ed[0:3]\" 0 1 0 1 2 0 2 3 0 3 0 0;\n\
             \tsetAttr -s 4 \".uvst[0].uvsp[0:3]\" -type \"float2\" 0 0 1 0 1 1 0 1;\n\
             \tsetAttr \".fc[0]\" -type \"polyFaces\"\n\t\tf 4 0 1 2 3\n\t\tmu 0 4 0 1 2 3;\n",
            x + 20,
            x + 20,
        );
        text += &format!("createNode shadingEngine -n \"{name}SG\";\n");
        text += &format!("connectAttr \"{name}Shape.iog\" \"{name}SG.dsm\" -na;\n");
    }
    text + shaders
}

fn read(shaders: &str, files: &[(&str, Vec<u8>)]) -> Imported {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, bytes) in files {
        std::fs::write(folder.path().join(name), bytes).expect("a file");
    }
    let path = folder.path().join("head.ma");
    std::fs::write(&path, scene(shaders)).expect("a scene");
    read::read(&path, &read::Options::default()).unwrap_or_else(|e| panic!("{e}"))
}

fn says(imported: &Imported, words: &[&str]) {
    let found = imported.notes.iter().any(|note| words.iter().all(|w| note.contains(w)));
    assert!(found, "{words:?} in {:#?}", imported.notes);
}

#[test]
fn file_textures_of_shaders_are_the_look_of_parts() {
    let shaders = r#"
createNode standardSurface -n "skinShader";
	setAttr ".sr" 0.35;
createNode file -n "colorFile";
	setAttr ".ftn" -type "string" "D:/project/sourceimages/color.png";
	setAttr ".cs" -type "string" "sRGB";
createNode place2dTexture -n "place";
	setAttr ".re" -type "float2" 2 3 ;
connectAttr "place.o" "colorFile.uv";
connectAttr "colorFile.oc" "skinShader.bc";
createNode file -n "metalFile";
	setAttr ".ftn" -type "string" "metal.png";
connectAttr "metalFile.ocr" "skinShader.m";
createNode file -n "normalFile";
	setAttr ".ftn" -type "string" "normal.png";
createNode bump2d -n "bump";
	setAttr ".bi" 1;
connectAttr "normalFile.oa" "bump.bv";
connectAttr "bump.o" "skinShader.n";
connectAttr "skinShader.oc" "faceSG.ss";
createNode phong -n "hatShader";
	setAttr ".c" -type "float3" 0.25 0.5 1 ;
	setAttr ".dc" 1;
	setAttr ".cp" 14;
	setAttr ".it" -type "float3" 0.25 0.25 0.25 ;
connectAttr "hatShader.oc" "hatSG.ss";
"#;
    let files = [
        ("color.png", png([10, 20, 30, 255])),
        ("metal.png", png([77, 0, 0, 255])),
        ("normal.png", png([128, 128, 255, 255])),
    ];
    let imported = read(shaders, &files);
    let head = &imported.head;
    head.validate().unwrap();
    let looks: Vec<_> = (0..2).map(|p| head.authored.of_parts[p].expect("a material") as usize).collect();
    let face = &head.authored.materials[looks[0]];
    assert_eq!((face.name.as_str(), face.roughness, face.metallic), ("skinShader", 0.35, 1.0));
    let color = face.base_color_texture.expect("a picture");
    assert_eq!(head.authored.images[color.image as usize].rgba[..4], [10, 20, 30, 255]);
    assert_eq!(color.transform.scale, glam::Vec2::new(2.0, 3.0));
    // v = 0 is below in Maya and stays below.
    let below = color.transform.matrix().transform_point2(glam::Vec2::new(0.0, 1.0));
    assert!((below - glam::Vec2::new(0.0, 1.0)).length() < 1e-6, "{below}");
    let packed = face.metallic_roughness_texture.expect("metal");
    assert_eq!(head.authored.images[packed.image as usize].rgba[1..3], [255, 77]);
    assert!(face.normal_texture.is_some());
    assert_eq!(head.mesh.parts[0].material, Material::Other);
    says(&imported, &["keep the look of their author", "face"]);
    let hat = &head.authored.materials[looks[1]];
    assert_eq!(hat.base_color, [0.25, 0.5, 1.0, 0.75]);
    assert_eq!(hat.alpha, AlphaMode::Blend);
    // (2 / 16)^(1/4)
    assert!((hat.roughness - 0.594_6).abs() < 1e-3, "{}", hat.roughness);
}

#[test]
fn pictures_that_are_missing_and_nodes_that_are_not_read_are_said() {
    let shaders = r#"
createNode aiStandardSurface -n "skinShader";
	setAttr ".base_color" -type "float3" 0.5 0.25 0.125 ;
	setAttr ".specular_roughness" 0.625;
createNode file -n "colorFile";
	setAttr ".ftn" -type "string" "gone.png";
connectAttr "colorFile.oc" "skinShader.base_color";
createNode checker -n "checker1";
connectAttr "checker1.ocr" "skinShader.specular_roughness";
createNode file -n "heights";
	setAttr ".ftn" -type "string" "height.png";
createNode bump2d -n "bump";
connectAttr "heights.oa" "bump.bv";
connectAttr "bump.o" "skinShader.n";
connectAttr "skinShader.out" "faceSG.ss";
createNode toonShader -n "toon";
connectAttr "toon.oc" "hatSG.ss";
"#;
    let imported = read(shaders, &[("height.png", png([90, 90, 90, 255]))]);
    let head = &imported.head;
    head.validate().unwrap();
    assert_eq!(head.authored.of_parts[1], None);
    let face = &head.authored.materials[head.authored.of_parts[0].expect("a material") as usize];
    assert!(face.base_color_texture.is_none() && face.normal_texture.is_none());
    assert_eq!((face.base_color, face.roughness), ([0.5, 0.25, 0.125, 1.0], 0.625));
    assert_eq!(head.mesh.parts[0].material, Material::Skin, "no texture: it is skin by its name");
    says(&imported, &["file textures that cannot be read", "gone.png", "no such file"]);
    says(&imported, &["checker nodes are not evaluated", "checker1 of skinShader"]);
    says(&imported, &["heights are not read"]);
    says(&imported, &["shaders of type toonShader are not read", "toon"]);
}
