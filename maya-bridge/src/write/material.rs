//! Shading: a group a part; the skin as an Arnold standard surface with subsurface, coloured by the OSL shader.

use std::fmt::Write as _;

use image::ImageEncoder;
use rubor_rig::head::{Head, Material};
use rubor_rig::map::Map;
use rubor_rig::skin::chromophores::{ChromophoreModel, SkinModel};

use super::{Options, line};
use crate::SKIN_OSL;
use crate::ascii::lexer::quoted;
use crate::error::WriteError;
use crate::read::head::shading_group;

/// Side of the look-up table, texels.
const LOOKUP: u32 = 128;
/// Distributions, zones and wrinkle maps that the shader has parameters for.
pub(super) const MOST_DISTRIBUTIONS: usize = 12;
const MOST_ZONES: usize = 16;
const MOST_WRINKLE_MAPS: usize = 4;

/// Files and parameters of the facial colour.
pub(super) struct Colour {
    base_color: Option<String>,
    parameters: Vec<(String, Parameter)>,
}

enum Parameter {
    Text(String),
    Number(f32),
    Whole(usize),
}

impl Colour {
    pub(super) fn new(
        head: &Head,
        stem: &str,
        options: &Options,
        files: &mut Vec<(String, Vec<u8>)>,
    ) -> Result<Self, WriteError> {
        let encode =
            |e: image::ImageError| WriteError::Encode { what: "texture".into(), reason: e.to_string() };
        let mut colour = Self { base_color: None, parameters: Vec::new() };
        if let Some(image) = &options.base_color {
            let mut png = Vec::new();
            image::codecs::png::PngEncoder::new(&mut png)
                .write_image(image, image.width(), image.height(), image::ExtendedColorType::Rgb8)
                .map_err(encode)?;
            let name = format!("{stem}_base_color.png");
            files.push((name.clone(), png));
            colour.base_color = Some(name);
        }
        let maps = &head.maps;
        let (Some(melanin), Some(hemoglobin)) = (&maps.melanin, &maps.hemoglobin) else { return Ok(colour) };
        let mut add = |role: &str, layers: &[&Map]| -> Result<(), WriteError> {
            let Some(first) = layers.first() else { return Ok(()) };
            let (low, high) = layers
                .iter()
                .flat_map(|m| &m.values)
                .fold((f32::MAX, f32::MIN), |(l, h), v| (l.min(*v), h.max(*v)));
            let range = if high > low { high - low } else { 1.0 };
            let mut texels: Vec<u8> = Vec::new();
            for map in layers {
                for c in 0..map.channels as usize {
                    for v in map.values.iter().skip(c).step_by(map.channels as usize) {
                        let step = (f64::from(v - low) / f64::from(range) * 65535.0).round() as u16;
                        texels.extend_from_slice(&step.to_ne_bytes());
                    }
                }
            }
            let height = layers.iter().map(|m| m.height * m.channels).sum();
            let mut png = Vec::new();
            image::codecs::png::PngEncoder::new(&mut png)
                .write_image(&texels, first.width, height, image::ExtendedColorType::L16)
                .map_err(encode)?;
            let name = format!("{stem}_osl_{role}.png");
            files.push((name.clone(), png));
            colour.parameters.push((format!("{role}_map"), Parameter::Text(name)));
            colour.parameters.push((format!("{role}_offset"), Parameter::Number(low)));
            colour.parameters.push((format!("{role}_range"), Parameter::Number(range)));
            Ok(())
        };
        // Layers below each other must be of one size.
        let same = |layers: &[&Map]| {
            layers.windows(2).all(|w| (w[0].width, w[0].height) == (w[1].width, w[1].height))
        };
        add("melanin", &[melanin])?;
        add("hemoglobin", &[hemoglobin])?;
        let mut counts = Vec::new();
        let distributions: Vec<_> = maps.distributions.iter().take(MOST_DISTRIBUTIONS).collect();
        if let (Some(mean), false) = (&maps.hemoglobin_mean, distributions.is_empty()) {
            let scales: Vec<&Map> = distributions.iter().map(|d| &d.scale).collect();
            let biases: Vec<&Map> = distributions.iter().map(|d| &d.bias).collect();
            if same(&scales) && same(&biases) {
                add("mean", &[mean])?;
                add("scales", &scales)?;
                add("biases", &biases)?;
                counts.push(("distribution_count".to_owned(), Parameter::Whole(distributions.len())));
            }
        }
        if let Some(slopes) = &maps.slopes {
            add("slopes", &[slopes])?;
        }
        let wrinkles: Vec<&Map> = maps.wrinkle_slopes.iter().take(MOST_WRINKLE_MAPS).collect();
        let zones: Vec<_> = maps.zones.iter().take(MOST_ZONES).collect();
        let masks: Vec<&Map> = zones.iter().map(|z| &z.mask).collect();
        if !wrinkles.is_empty() && !zones.is_empty() && same(&wrinkles) && same(&masks) {
            add("wrinkles", &wrinkles)?;
            add("zones", &masks)?;
            counts.push(("wrinkle_count".to_owned(), Parameter::Whole(wrinkles.len())));
            counts.push(("zone_count".to_owned(), Parameter::Whole(zones.len())));
            for (i, zone) in zones.iter().enumerate() {
                counts.push((format!("zone_map_{i}"), Parameter::Whole(zone.wrinkle_map as usize)));
            }
        }
        let lookup = lookup_map();
        add("lookup", &[&lookup])?;
        colour.parameters.push(("lookup_size".into(), Parameter::Whole(LOOKUP as usize)));
        colour.parameters.extend(counts);
        colour.parameters.push(("hemoglobin_scale".into(), Parameter::Number(1.0)));
        for i in 0..distributions.len() {
            colour.parameters.push((format!("distribution_weight_{i}"), Parameter::Number(0.0)));
        }
        for i in 0..zones.len() {
            colour.parameters.push((format!("zone_weight_{i}"), Parameter::Number(0.0)));
        }
        files.push(("rubor_skin.osl".into(), SKIN_OSL.as_bytes().to_vec()));
        Ok(colour)
    }

    pub(super) fn has_shader(&self) -> bool {
        !self.parameters.is_empty()
    }
}

/// The skin colour table, three channels below each other: linear Rec. 709.
pub fn lookup_map() -> Map {
    let table = SkinModel::new(&ChromophoreModel::default()).bake(LOOKUP, LOOKUP);
    Map { width: LOOKUP, height: LOOKUP, channels: 3, values: table.texels.concat() }
}

pub(super) fn write(out: &mut String, head: &Head, stem: &str, colour: &Colour) {
    for (i, part) in head.mesh.parts.iter().enumerate().filter(|(_, p)| !p.triangles.is_empty()) {
        let group = shading_group(i, &part.name);
        line(
            out,
            &format!(
                "createNode shadingEngine -n \"{group}\";\n\tsetAttr \".ihi\" 0;\n\tsetAttr \".ro\" yes;"
            ),
        );
        line(out, &format!("createNode groupId -n \"{group}_id\";\n\tsetAttr \".ihi\" 0;"));
        line(out, &format!("createNode lambert -n \"{group}_viewport\";"));
        let [r, g, b] = plain_colour(part.material);
        line(out, &format!("\tsetAttr \".c\" -type \"float3\" {r} {g} {b} ;"));
        line(out, &format!("connectAttr \"{group}_viewport.oc\" \"{group}.ss\";"));
        if part.material == Material::Skin {
            line(out, &format!("connectAttr \"rubor_skin.out\" \"{group}.aiSurfaceShader\";"));
            if colour.base_color.is_some() {
                line(out, &format!("connectAttr \"rubor_base_color.oc\" \"{group}_viewport.c\";"));
            }
        }
    }
    if !head.mesh.parts.iter().any(|p| p.material == Material::Skin) {
        return;
    }
    if let Some(file) = &colour.base_color {
        line(out, "createNode file -n \"rubor_base_color\";");
        line(out, &format!("\tsetAttr \".ftn\" -type \"string\" {};", quoted(file)));
        line(out, "\tsetAttr \".cs\" -type \"string\" \"sRGB\";");
        line(out, "createNode place2dTexture -n \"rubor_place2d\";");
        line(out, "connectAttr \"rubor_place2d.o\" \"rubor_base_color.uv\";");
        line(out, "connectAttr \"rubor_place2d.ofs\" \"rubor_base_color.fs\";");
    }
    line(out, "createNode aiStandardSurface -n \"rubor_skin\";");
    line(out, "\tsetAttr \".base\" 0;\n\tsetAttr \".subsurface\" 1;\n\tsetAttr \".subsurfaceType\" 1;");
    // Mean distances of light in skin, millimetres (E. d'Eon and D. Luebke 2007, mean of the profile), in centimetres.
    line(
        out,
        "\tsetAttr \".subsurfaceRadius\" -type \"float3\" 1.09 0.45 0.34 ;\n\tsetAttr \".subsurfaceScale\" 0.1;",
    );
    line(
        out,
        "\tsetAttr \".specular\" 0.5;\n\tsetAttr \".specularRoughness\" 0.4;\n\tsetAttr \".specularIOR\" 1.4;",
    );
    if colour.has_shader() {
        line(out, "createNode aiOslShader -n \"rubor_skin_color\";");
        for (name, parameter) in &colour.parameters {
            let attribute = format!("param_{name}");
            let (kind, value) = match parameter {
                Parameter::Text(text) => ("-dt \"string\"", format!("-type \"string\" {}", quoted(text))),
                Parameter::Number(number) => ("-at \"float\" -k true", number.to_string()),
                Parameter::Whole(number) => ("-at \"long\"", number.to_string()),
            };
            line(out, &format!("\taddAttr -ci true -sn \"{attribute}\" -ln \"{attribute}\" {kind};"));
            line(out, &format!("\tsetAttr \".{attribute}\" {value};"));
        }
        let mut code = String::new();
        let _ = write!(code, "\tsetAttr \".code\" -type \"string\" {};", quoted(SKIN_OSL));
        line(out, &code);
        line(out, "connectAttr \"rubor_skin_color.outColor\" \"rubor_skin.subsurfaceColor\";");
    } else if colour.base_color.is_some() {
        line(out, "connectAttr \"rubor_base_color.oc\" \"rubor_skin.subsurfaceColor\";");
    }
    line(out, &format!("fileInfo \"ruborTextures\" {};", quoted(stem)));
}

/// Linear Rec. 709, for the viewport.
fn plain_colour(material: Material) -> [f32; 3] {
    match material {
        Material::Skin => [0.42, 0.24, 0.17],
        Material::Mucosa | Material::Gums => [0.36, 0.11, 0.10],
        Material::Eye => [0.56, 0.52, 0.48],
        Material::Teeth => [0.62, 0.55, 0.42],
        Material::Lash | Material::Hair => [0.03, 0.02, 0.015],
        Material::Wet | Material::Hidden | Material::Other => [0.2, 0.2, 0.2],
    }
}
