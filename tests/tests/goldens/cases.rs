//! Every picture: its name, its scene (a sequence in `tests/scenes`) and what is special about it.

/// Which head is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Model {
    /// `assets/head.glb`.
    Default,
    /// The same with more melanin.
    Dark,
    /// The same without maps.
    WithoutMaps,
    /// The same with a material of its own in place of skin: tiles, bumps, metal and holes.
    Authored,
    /// Skin with a colour by itself.
    Painted,
    /// A blended pane and one of glass in front.
    BehindPanes,
}

/// What is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Channel {
    /// The displayed image.
    Image,
    /// Linear radiance before display.
    Hdr,
    /// Albedo of skin, linear Rec. 709.
    Albedo,
    /// Diffuse light before albedo, scattered where the method scatters.
    Diffuse,
    /// Reversed depth.
    Depth,
    /// Which triangle of which head is seen.
    Ids,
    /// Motion since the previous frame, pixels.
    Velocity,
    /// Deformed points, metres.
    Positions,
    /// Ambient visibility of points, 0 to 1.
    Occlusion,
    /// Normals of vertices.
    Normals,
    /// Tangents of vertices.
    Tangents,
}

/// How a picture is drawn: methods by the names that users write.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Methods {
    pub(crate) scatter: &'static str,
    pub(crate) transmit: &'static str,
    pub(crate) bounce: &'static str,
    pub(crate) curvature: &'static str,
    pub(crate) color: &'static str,
    pub(crate) wrinkles: &'static str,
    pub(crate) specular: &'static str,
    pub(crate) raster: &'static str,
    pub(crate) detail: &'static str,
    pub(crate) antialias: &'static str,
    pub(crate) tone_map: &'static str,
    pub(crate) depth_of_field: &'static str,
    pub(crate) backdrop: &'static str,
    pub(crate) dither: &'static str,
    pub(crate) exposure: f32,
    /// Further settings of the look, as JSON.
    pub(crate) look: &'static str,
}

/// One picture.
#[derive(Clone, Debug)]
pub(crate) struct Case {
    /// `group-detail`: the name of its file.
    pub(crate) name: String,
    /// Name of its file in `tests/scenes`.
    pub(crate) scene: &'static str,
    /// The heads, side by side.
    pub(crate) models: &'static [Model],
    /// Pixels.
    pub(crate) size: [u32; 2],
    /// Frames that are drawn; the last one is the picture.
    pub(crate) frames: u32,
    pub(crate) methods: Methods,
    pub(crate) channel: Channel,
}

/// What a user gets who chooses nothing, without antialiasing, so that each pixel is that of one sample.
const USUAL: Methods = Methods {
    scatter: "separable:17",
    transmit: "shadow-depth",
    bounce: "patches",
    curvature: "mesh",
    color: "hemoglobin",
    wrinkles: "partial-derivative",
    specular: "one-lobe",
    raster: "auto",
    detail: "auto",
    antialias: "none",
    tone_map: "filmic",
    depth_of_field: "none",
    backdrop: "plain",
    dither: "none",
    exposure: 1.0,
    look: "{}",
};

fn case(name: &str, scene: &'static str, methods: Methods) -> Case {
    Case {
        name: name.to_owned(),
        scene,
        models: &[Model::Default],
        size: [80, 80],
        frames: 1,
        methods,
        channel: Channel::Image,
    }
}

impl Methods {
    /// The method of a group of the renderer's table; nothing for a group that no picture varies.
    pub(crate) fn of_group(&self, group: &str) -> Option<&'static str> {
        Some(match group {
            "scatter" => self.scatter,
            "transmit" => self.transmit,
            "bounce" => self.bounce,
            "curvature" => self.curvature,
            "color" => self.color,
            "wrinkles" => self.wrinkles,
            "specular" => self.specular,
            "raster" => self.raster,
            "detail" => self.detail,
            "antialias" => self.antialias,
            "tone-map" => self.tone_map,
            "depth-of-field" => self.depth_of_field,
            "backdrop" => self.backdrop,
            "dither" => self.dither,
            _ => return None,
        })
    }
}

/// All pictures.
pub(crate) fn all() -> Vec<Case> {
    [
        scatter(),
        transmit(),
        bounce(),
        appearance(),
        antialias(),
        lights(),
        materials(),
        passes(),
        raster(),
        detail(),
        heads(),
        small(lens()),
        small(display()),
    ]
    .concat()
}

/// Stages after the light: smaller pictures show them as well.
fn small(cases: Vec<Case>) -> Vec<Case> {
    cases.into_iter().map(|case| Case { size: [64, 64], ..case }).collect()
}

fn scatter() -> Vec<Case> {
    let methods = [
        "none",
        "texture-space:512",
        "pre-integrated:1",
        "pre-integrated:3",
        "separable:5",
        "separable:17",
        "separable:65",
        "screen-gauss:4",
        "screen-gauss:6",
        "screen-jitter",
        "burley-disk:16",
        "burley-disk:64",
        "dipole-cubemap:16",
        "reference-screen",
        "reference-surface:2",
    ];
    let picture = |scatter: &'static str| {
        let name = format!("scatter-{}", scatter.replace(':', "-"));
        case(&name, "nose", Methods { scatter, transmit: "none", ..USUAL })
    };
    let pre_integrated = |name: &str, scene, curvature| {
        case(name, scene, Methods { scatter: "pre-integrated:3", curvature, ..USUAL })
    };
    let more = [
        pre_integrated("scatter-pre-integrated-front", "portrait", "mesh"),
        pre_integrated("scatter-pre-integrated-side", "ear", "mesh"),
        pre_integrated("scatter-pre-integrated-frown", "frown", "mesh"),
        pre_integrated("scatter-pre-integrated-screen", "nose", "screen"),
    ];
    methods.into_iter().map(picture).chain(more).collect()
}

fn transmit() -> Vec<Case> {
    let picture = |transmit: &'static str| {
        case(&format!("transmit-{transmit}"), "ear", Methods { transmit, exposure: 1.4, ..USUAL })
    };
    let over_skin = |transmit: &'static str| {
        let methods = Methods { scatter: "texture-space:512", transmit, exposure: 1.4, ..USUAL };
        case(&format!("transmit-{transmit}-texture-space"), "ear", methods)
    };
    let maps = Case { name: "transmit-translucent-shadow-map".into(), ..over_skin("translucent-shadow-map") };
    let mut all: Vec<Case> = ["none", "shadow-depth"].into_iter().map(picture).collect();
    all.extend([over_skin("shadow-depth"), maps]);
    // Its disks carry the light that comes through.
    let through = Methods { scatter: "dipole-cubemap:16", exposure: 1.4, ..USUAL };
    all.push(case("transmit-dipole-cubemap", "ear", through));
    all
}

/// The open mouth, which skin on all sides lights.
fn bounce() -> Vec<Case> {
    let picture =
        |bounce: &'static str| case(&format!("bounce-{bounce}"), "mouth", Methods { bounce, ..USUAL });
    ["none", "patches"].map(picture).to_vec()
}

/// Alpha with holes and a shadow, by both ways to make pixels of triangles.
fn raster() -> Vec<Case> {
    ["hardware", "compute"]
        .map(|raster| Case {
            models: &[Model::Authored],
            ..case(&format!("raster-{raster}"), "portrait", Methods { raster, ..USUAL })
        })
        .to_vec()
}

/// A head from so far that a pixel is wider than a hair.
fn detail() -> Vec<Case> {
    ["full", "auto"]
        .map(|detail| case(&format!("detail-{detail}"), "head", Methods { detail, ..USUAL }))
        .to_vec()
}

fn appearance() -> Vec<Case> {
    vec![
        case("color-static", "blush", Methods { color: "static", ..USUAL }),
        case("color-hemoglobin", "blush", USUAL),
        case("wrinkles-none", "frown", Methods { wrinkles: "none", ..USUAL }),
        case("wrinkles-partial-derivative", "frown", USUAL),
        case("wrinkles-difference", "frown", Methods { wrinkles: "difference", ..USUAL }),
        case("specular-one-lobe", "forehead", USUAL),
        case("specular-two-lobes", "forehead", Methods { specular: "two-lobes", ..USUAL }),
    ]
}

/// The two modes that keep a history show the fourth frame of a turning head, the others a head at rest.
fn antialias() -> Vec<Case> {
    let names = ["none", "mlaa", "smaa-1x", "smaa-s2x", "smaa-t2x", "smaa-4x", "ssaa:2", "ssaa:4"];
    let picture = |antialias: &'static str| {
        let name = format!("antialias-{}", antialias.replace(':', "-"));
        let is_temporal = ["smaa-t2x", "smaa-4x"].contains(&antialias);
        let (scene, frames) = if is_temporal { ("turn", 4) } else { ("head", 1) };
        Case { frames, ..case(&name, scene, Methods { antialias, ..USUAL }) }
    };
    names.into_iter().map(picture).collect()
}

fn lights() -> Vec<Case> {
    let scenes = [
        ("light-directional", "light-directional"),
        ("light-without-shadow", "light-without-shadow"),
        ("light-spot", "light-spot"),
        ("light-point", "light-point"),
        ("light-three-point", "portrait"),
        ("environment-studio", "environment-studio"),
        ("environment-soft-box", "environment-soft-box"),
        ("environment-sky", "environment-sky"),
        ("environment-turned", "environment-turned"),
    ];
    scenes.into_iter().map(|(name, scene)| case(name, scene, USUAL)).collect()
}

fn materials() -> Vec<Case> {
    let of = |name: &str, scene: &'static str, model: &'static [Model]| Case {
        models: model,
        ..case(name, scene, USUAL)
    };
    vec![
        of("material-skin", "skin", &[Model::Default]),
        of("material-dark-skin", "portrait", &[Model::Dark]),
        of("material-without-maps", "portrait", &[Model::WithoutMaps]),
        of("material-eye", "eye", &[Model::Default]),
        of("material-wide-pupil", "dark-room-eye", &[Model::Default]),
        of("material-mouth", "mouth", &[Model::Default]),
        of("material-cropped-hair", "scalp", &[Model::Default]),
        of("material-brow-and-lashes", "brow", &[Model::Default]),
        of("material-authored", "portrait", &[Model::Authored]),
        of("material-authored-sky", "environment-studio", &[Model::Authored]),
        of("material-own-colour", "portrait", &[Model::Painted]),
        of("material-own-colour-flushed", "blush", &[Model::Painted]),
        of("material-see-through", "portrait", &[Model::BehindPanes]),
        of("material-see-through-sky", "environment-studio", &[Model::BehindPanes]),
    ]
}

fn passes() -> Vec<Case> {
    let read = |name: &str, scene: &'static str, channel| Case { channel, ..case(name, scene, USUAL) };
    let light = |name: &str, scatter| Case {
        channel: Channel::Diffuse,
        ..case(name, "nose", Methods { scatter, transmit: "none", ..USUAL })
    };
    let moving = |name: &str, antialias| Case {
        channel: Channel::Velocity,
        frames: 3,
        ..case(name, "turn", Methods { antialias, ..USUAL })
    };
    vec![
        read("pass-morph", "surprise", Channel::Positions),
        read("pass-morph-occlusion", "mouth", Channel::Occlusion),
        read("pass-tangent-frames-normals", "surprise", Channel::Normals),
        read("pass-tangent-frames-tangents", "surprise", Channel::Tangents),
        read("pass-shade-albedo", "blush", Channel::Albedo),
        light("pass-shade-irradiance", "none"),
        light("pass-scatter-diffuse", "separable:17"),
        read("pass-visibility-depth", "portrait", Channel::Depth),
        read("pass-visibility-ids", "crowd", Channel::Ids),
        read("pass-compose-hdr", "portrait", Channel::Hdr),
        moving("pass-velocity", "smaa-t2x"),
        case("pass-display-linear", "portrait", Methods { tone_map: "linear", ..USUAL }),
        case("pass-display-dark", "portrait", Methods { exposure: 0.25, ..USUAL }),
        case("pass-display-bright", "portrait", Methods { exposure: 4.0, ..USUAL }),
    ]
}

/// Each stage of the lens by itself, and a portrait with all of them.
fn lens() -> Vec<Case> {
    let open = |name: &str, scene, depth_of_field| {
        case(&format!("lens-{name}"), scene, Methods { depth_of_field, ..USUAL })
    };
    let look = |name: &str, look| case(&format!("lens-{name}"), "portrait", Methods { look, ..USUAL });
    vec![
        open("depth-of-field", "lens", "gather:48"),
        open("depth-of-field-8", "lens", "gather:8"),
        open("focus-on-the-ear", "lens-ear", "gather:48"),
        look("bloom", r#"{ "bloom": 0.3, "bloomRadius": 0.3 }"#),
        look("grain", r#"{ "grain": 60, "grainSize": 20 }"#),
        look("coarse-grain", r#"{ "grain": 60, "grainSize": 200 }"#),
        case("lens-fade", "bust", Methods { look: r#"{ "fade": 90 }"#, ..USUAL }),
        Case {
            // Nothing of the noise may stay in the history.
            frames: 4,
            ..case(
                "lens-portrait",
                "lens",
                Methods {
                    depth_of_field: "gather:48",
                    backdrop: "gradient",
                    dither: "triangular",
                    antialias: "smaa-t2x",
                    look: r#"{ "bloom": 0.1, "grain": 20, "vignette": 1, "fade": 60 }"#,
                    ..USUAL
                },
            )
        },
    ]
}

fn display() -> Vec<Case> {
    let tone_map = |tone_map: &'static str| {
        case(&format!("display-{tone_map}"), "portrait", Methods { tone_map, exposure: 1.4, ..USUAL })
    };
    let backdrop = |backdrop: &'static str| {
        case(&format!("display-backdrop-{backdrop}"), "bust", Methods { backdrop, ..USUAL })
    };
    let look = |name: &str, look| case(&format!("display-{name}"), "portrait", Methods { look, ..USUAL });
    vec![
        tone_map("aces"),
        tone_map("agx"),
        tone_map("neutral"),
        backdrop("gradient"),
        backdrop("environment"),
        look("warm", r#"{ "temperature": 9000, "tint": 20, "ev": 0.5 }"#),
        look("vignette", r#"{ "vignette": 8 }"#),
    ]
}

fn heads() -> Vec<Case> {
    let row = &[Model::Default, Model::Dark, Model::WithoutMaps];
    vec![
        case("head-surprise", "surprise", Methods { antialias: "smaa-1x", ..USUAL }),
        Case {
            models: row,
            size: [144, 80],
            ..case("head-three-in-a-row", "crowd", Methods { antialias: "smaa-1x", ..USUAL })
        },
    ]
}
