//! UsdPreviewSurface materials and the pictures beside the layer.

use std::fmt::Write as _;

use rubor_rig::head::{Head, Material};

use super::{Layer, Options, mesh};
use crate::error::ExportError;
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
    let lashes = save("lashes", &pictures.lashes)?;
    let out = &mut layer.text;
    out.push_str("    def Scope \"Looks\"\n    {\n");
    for (part, name) in head.mesh.parts.iter().zip(mesh::looks(head)) {
        let look = appearance(part.material, base_color.is_some());
        let (color, normal) = match part.material {
            Material::Skin => (&base_color, &normals),
            Material::Eye => (&eye, &None),
            Material::Lash => (&lashes, &None),
            _ => (&None, &None),
        };
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
            "                float inputs:roughness = {}\n                token outputs:surface\n            }}\n",
            look.roughness
        );
        if let Some(file) = color {
            let alpha =
                if part.material == Material::Lash { "                float outputs:a\n" } else { "" };
            texture(out, &path, "Color", file, "sRGB", alpha);
        }
        if let Some(file) = normal {
            // Eight bits to -1 to 1.
            let range = "                float4 inputs:bias = (-1, -1, -1, 0)\n                \
                         float4 inputs:scale = (2, 2, 2, 1)\n";
            texture(out, &path, "Normal", file, "raw", range);
        }
        if color.is_some() || normal.is_some() {
            out.push_str(
                "\n            def Shader \"Coordinates\"\n            {\n                \
                 uniform token info:id = \"UsdPrimvarReader_float2\"\n                \
                 string inputs:varname = \"st\"\n                float2 outputs:result\n            }\n",
            );
        }
        out.push_str("        }\n\n");
    }
    out.push_str("    }\n");
    Ok(())
}

fn texture(out: &mut String, path: &str, name: &str, file: &str, color_space: &str, more: &str) {
    let _ = write!(
        out,
        "\n            def Shader \"{name}\"\n            {{\n                \
         uniform token info:id = \"UsdUVTexture\"\n                asset inputs:file = @./{file}@\n                \
         token inputs:sourceColorSpace = \"{color_space}\"\n                \
         float2 inputs:st.connect = <{path}/Coordinates.outputs:result>\n                \
         token inputs:wrapS = \"clamp\"\n                token inputs:wrapT = \"clamp\"\n{more}                \
         float3 outputs:rgb\n            }}\n"
    );
}
