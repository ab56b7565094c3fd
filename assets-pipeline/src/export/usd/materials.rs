//! UsdPreviewSurface materials and the pictures beside the layer.

use std::fmt::Write as _;

use rubor_rig::head::{Head, Material};

use super::{Layer, Options, mesh};
use crate::error::ExportError;
use crate::export::eye_mouth::{EYE_TRANSFORM, TEETH_TRANSFORM};
use crate::export::image_codec::encode_picture;
use crate::export::pictures::{Picture, Pictures, appearance};

pub(super) fn write(
    layer: &mut Layer,
    head: &Head,
    options: &Options<'_>,
    stem: &str,
) -> Result<(), ExportError> {
    let pictures =
        Pictures::new(head, options.pose.as_ref(), options.color_map_size, options.normal_map_size, 1.0);
    let mut save = |name: &str, picture: &Option<Picture>| -> Result<Option<String>, ExportError> {
        let Some(p) = picture else { return Ok(None) };
        let (bytes, format) = encode_picture(name, &p.texels, p.size, p.color, options.textures)?;
        let file = format!("{stem}_{name}.{}", format.extension());
        layer.files.push((file.clone(), bytes));
        Ok(Some(file))
    };
    let base_color = save("base_color", &pictures.base_color)?;
    let normals = save("normals", &pictures.normals)?;
    let eye = save("eye", &pictures.eye)?;
    let teeth = save("teeth", &pictures.teeth)?;
    let lashes = save("lashes", &pictures.lashes)?;
    let out = &mut layer.text;
    out.push_str("    def Scope \"Looks\"\n    {\n");
    for (index, (part, name)) in head.mesh.parts.iter().zip(mesh::looks(head)).enumerate() {
        let (color, normal, moved) = match part.material {
            Material::Skin => (&base_color, &normals, None),
            Material::Eye => (&eye, &None, Some(EYE_TRANSFORM)),
            Material::Teeth => (&teeth, &None, Some(TEETH_TRANSFORM)),
            Material::Lash => (&lashes, &None, None),
            _ => (&None, &None, None),
        };
        let mut look = appearance(head, part.material, color.is_some());
        if let Some(material) = head.authored_material(index).map(|m| &head.authored.materials[m as usize]) {
            look.color_linear = material.base_color;
            look.roughness = material.roughness;
        }
        let path = format!("/rubor_head/Looks/{name}");
        let [r, g, b, alpha] = look.color_linear;
        let _ = write!(
            out,
            "        def Material \"{name}\"\n        {{\n            \
             token outputs:surface.connect = <{path}/Surface.outputs:surface>\n\n            \
             def Shader \"Surface\"\n            {{\n                uniform token info:id = \"UsdPreviewSurface\"\n"
        );
        match color {
            Some(_) => {
                let _ = writeln!(
                    out,
                    "                color3f inputs:diffuseColor.connect = <{path}/Color.outputs:rgb>"
                );
            }
            None => {
                let _ = writeln!(out, "                color3f inputs:diffuseColor = ({r}, {g}, {b})");
            }
        }
        out.push_str("                float inputs:metallic = 0\n");
        if normal.is_some() {
            let _ =
                writeln!(out, "                normal3f inputs:normal.connect = <{path}/Normal.outputs:rgb>");
        }
        if part.material == Material::Lash && color.is_some() {
            let _ = writeln!(out, "                float inputs:opacity.connect = <{path}/Color.outputs:a>");
        } else {
            let _ = writeln!(out, "                float inputs:opacity = {alpha}");
        }
        let _ = write!(
            out,
            "                float inputs:roughness = {}\n                float inputs:ior = {}\n                \
             token outputs:surface\n            }}\n",
            look.roughness, look.ior
        );
        if let Some(file) = color {
            let alpha =
                if part.material == Material::Lash { "                float outputs:a\n" } else { "" };
            let coordinates = if moved.is_some() { "Moved" } else { "Coordinates" };
            texture(out, (&path, coordinates), "Color", file, "sRGB", alpha);
        }
        if let Some(file) = normal {
            // Eight bits to -1 to 1.
            let range = "                float4 inputs:bias = (-1, -1, -1, 0)\n                \
                         float4 inputs:scale = (2, 2, 2, 1)\n";
            texture(out, (&path, "Coordinates"), "Normal", file, "raw", range);
        }
        if color.is_some() || normal.is_some() {
            out.push_str(
                "\n            def Shader \"Coordinates\"\n            {\n                \
                 uniform token info:id = \"UsdPrimvarReader_float2\"\n                \
                 string inputs:varname = \"st\"\n                float2 outputs:result\n            }\n",
            );
        }
        if let (Some(([u, v], [width, height])), true) = (moved, color.is_some()) {
            // Texture coordinates of USD grow upwards.
            let v = 1.0 - v - height;
            let _ = write!(
                out,
                "\n            def Shader \"Moved\"\n            {{\n                \
                 uniform token info:id = \"UsdTransform2d\"\n                \
                 float2 inputs:in.connect = <{path}/Coordinates.outputs:result>\n                \
                 float2 inputs:scale = ({width}, {height})\n                \
                 float2 inputs:translation = ({u}, {v})\n                float2 outputs:result\n            }}\n"
            );
        }
        out.push_str("        }\n\n");
    }
    out.push_str("    }\n");
    Ok(())
}

fn texture(
    out: &mut String,
    (path, coordinates): (&str, &str),
    name: &str,
    file: &str,
    color_space: &str,
    more: &str,
) {
    let _ = write!(
        out,
        "\n            def Shader \"{name}\"\n            {{\n                \
         uniform token info:id = \"UsdUVTexture\"\n                asset inputs:file = @./{file}@\n                \
         token inputs:sourceColorSpace = \"{color_space}\"\n                \
         float2 inputs:st.connect = <{path}/{coordinates}.outputs:result>\n                \
         token inputs:wrapS = \"clamp\"\n                token inputs:wrapT = \"clamp\"\n{more}                \
         float3 outputs:rgb\n            }}\n"
    );
}
