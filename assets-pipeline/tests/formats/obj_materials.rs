//! Materials of OBJ files.

use std::path::Path;

use rubor_assets::import::gltf::ImportedHead;
use rubor_assets::import::obj_file;
use rubor_rig::authored::{AlphaMode, Wrap};
use rubor_rig::head::Material;

use super::says;
use super::support::{Folder, face_obj};

fn png(texel: [u8; 4]) -> Vec<u8> {
    let picture = image::RgbaImage::from_pixel(2, 2, image::Rgba(texel));
    let mut bytes = Vec::new();
    picture.write_to(&mut std::io::Cursor::new(&mut bytes), image::ImageFormat::Png).expect("memory");
    bytes
}

fn read(name: &str, mtl: &str) -> ImportedHead {
    let obj = format!("mtllib look.mtl\n{}", face_obj(&[]).replace("usemtl skin", "usemtl Paint"));
    let folder = Folder::new(
        name,
        &[
            ("head.obj", obj.as_bytes()),
            ("look.mtl", mtl.as_bytes()),
            ("color.png", &png([10, 20, 30, 255])),
            ("cut out.png", &png([128, 128, 128, 255])),
            ("normal.png", &png([128, 128, 255, 255])),
            ("height.png", &png([90, 90, 90, 255])),
            ("rough.png", &png([50, 0, 0, 255])),
            ("metal.png", &png([200, 0, 0, 255])),
        ],
    );
    obj_file::read(&folder.0.join("head.obj")).unwrap()
}

#[test]
fn a_library_of_materials_is_the_look_of_the_head() {
    let imported = read(
        "mtl-rich",
        "# look\nnewmtl Other\nKd 1 0 0\n\nnewmtl Paint\nKd 0 0 0\nNs 10\nillum 4\nPr 0.5\nPm 0.25\nKe 1 0 0\n\
         map_Kd -s 2 2 1 -clamp on C:\\textures\\color.png\nmap_d cut out.png\nnorm normal.png\n\
         map_Pr rough.png\nmap_Pm metal.png\nmap_Ks gone.png\nKd oops\n",
    );
    let head = &imported.head;
    assert_eq!(head.mesh.parts[0].material, Material::Other);
    let material = &head.authored.materials[head.authored_material(0).expect("a material") as usize];
    assert_eq!(material.name, "Paint");
    assert_eq!((material.base_color, material.alpha), ([1.0; 4], AlphaMode::Blend));
    let color = material.base_color_texture.expect("a picture");
    assert_eq!(color.wrap, [Wrap::Clamp; 2]);
    assert_eq!(color.transform.scale, glam::Vec2::splat(2.0));
    assert_eq!(head.authored.images[color.image as usize].rgba[..4], [10, 20, 30, 128]);
    let packed = material.metallic_roughness_texture.expect("roughness and metal");
    assert_eq!(head.authored.images[packed.image as usize].rgba[1..3], [50, 200]);
    assert_eq!((material.roughness, material.metallic), (1.0, 1.0), "maps stand for the numbers");
    assert!(material.normal_texture.is_some());
    assert_eq!(material.emission_linear, [1.0, 0.0, 0.0]);
    says(&imported, "taken for white", "Paint");
    says(&imported, "illum of materials is not read", "Paint");
    says(&imported, "map_Ks of materials is not read", "Paint");
    says(&imported, "lines of materials", "look.mtl, line 17");
    says(&imported, "no shapes", "");
}

#[test]
fn what_is_missing_is_said() {
    let imported =
        read("mtl-poor", "newmtl Paint\nKd 0.5 0.5 0.5\nmap_Kd gone.png\nmap_Bump height.png\nNs 62.5\n");
    let material = &imported.head.authored.materials[0];
    assert!(material.base_color_texture.is_none() && material.normal_texture.is_none());
    // (0.5 + 0.055) / 1.055 to the power of 2.4.
    assert!((material.base_color[0] - 0.214_04).abs() < 1e-4);
    // (2 / 64.5)^(1/4)
    assert!((material.roughness - 0.419_6).abs() < 1e-3, "{}", material.roughness);
    says(&imported, "picture cannot be read", "Paint, map_Kd (\"gone.png\": no such file)");
    says(&imported, "heights are not read", "Paint");
    let folder =
        Folder::new("mtl-none", &[("head.obj", format!("mtllib a.mtl\n{}", face_obj(&[])).as_bytes())]);
    let imported = obj_file::read(&folder.0.join("head.obj")).unwrap();
    says(&imported, "files of materials that are missing", "a.mtl");
    assert_eq!(imported.head.mesh.parts[0].material, Material::Skin, "its name says it");
    assert!(obj_file::read(Path::new("/none/at/all.obj")).is_err());
}
