//! Meaning of the channels of an EXR part, from their names.
//!
//! A name is `layer.channel` (OpenEXR, "Technical Introduction", section on channel names); programs write it in many
//! ways: `R`, `.R`, `red`, `ViewLayer.Combined.R`, `N.x`, `diffuse_g`.

/// Meaning of one channel within its layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Meaning {
    Red,
    Green,
    Blue,
    Alpha,
    X,
    /// Luminance, if there is no x and z beside it.
    Y,
    Z,
    U,
    V,
    Grey,
    Other,
}

fn meaning(word: &str) -> Meaning {
    match word.to_ascii_lowercase().as_str() {
        "r" | "red" => Meaning::Red,
        "g" | "green" => Meaning::Green,
        "b" | "blue" => Meaning::Blue,
        "a" | "alpha" => Meaning::Alpha,
        "x" => Meaning::X,
        "y" => Meaning::Y,
        "z" => Meaning::Z,
        "u" => Meaning::U,
        "v" => Meaning::V,
        "l" | "luma" | "luminance" | "grey" | "gray" | "value" => Meaning::Grey,
        _ => Meaning::Other,
    }
}

/// Layer and channel of a full name.
fn split(name: &str) -> (&str, &str) {
    if let Some((layer, channel)) = name.rsplit_once('.') {
        return (layer, channel);
    }
    // Not of the standard, so only before a word that has a meaning.
    match name.rfind([':', '/', '_']) {
        Some(at) if meaning(&name[at + 1..]) != Meaning::Other => (&name[..at], &name[at + 1..]),
        _ => ("", name),
    }
}

/// One layer of a part.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Layer {
    /// Name without that of its part; empty for plain `R`, `G`, `B`.
    pub(super) name: String,
    /// Places of the channels in the part that give the values, in order: colour, vector or one channel. Empty where
    /// the names have no known meaning.
    pub(super) values: Vec<usize>,
    /// Place of the alpha channel.
    pub(super) alpha: Option<usize>,
    /// Places of the channels that are not read.
    pub(super) unread: Vec<usize>,
}

/// The layers that these channel names make, in the order in which they first occur.
pub(super) fn layers(names: &[String]) -> Vec<Layer> {
    let mut groups: Vec<(String, Vec<(Meaning, usize)>)> = Vec::new();
    for (place, name) in names.iter().enumerate() {
        let (layer, channel) = split(name);
        let member = (meaning(channel), place);
        match groups.iter_mut().find(|g| g.0.eq_ignore_ascii_case(layer)) {
            Some(group) => group.1.push(member),
            None => groups.push((layer.to_owned(), vec![member])),
        }
    }
    groups.into_iter().map(|(name, members)| layer(name, &members)).collect()
}

fn layer(name: String, members: &[(Meaning, usize)]) -> Layer {
    let place = |wanted: Meaning| members.iter().find(|m| m.0 == wanted).map(|m| m.1);
    let all = |wanted: &[Meaning]| wanted.iter().map(|m| place(*m)).collect::<Option<Vec<usize>>>();
    let alpha = place(Meaning::Alpha);
    let values = all(&[Meaning::Red, Meaning::Green, Meaning::Blue])
        .or_else(|| all(&[Meaning::X, Meaning::Y, Meaning::Z]))
        .or_else(|| all(&[Meaning::Red, Meaning::Green]))
        .or_else(|| all(&[Meaning::X, Meaning::Y]))
        .or_else(|| all(&[Meaning::U, Meaning::V]))
        .or_else(|| all(&[Meaning::Y]))
        .or_else(|| all(&[Meaning::Grey]))
        .or_else(|| all(&[Meaning::Red]))
        .or_else(|| {
            let mut others = members.iter().filter(|m| m.0 != Meaning::Alpha).map(|m| m.1);
            let only = others.next()?;
            others.next().is_none().then(|| vec![only])
        })
        .unwrap_or_default();
    let unread = members.iter().map(|m| m.1).filter(|p| !values.contains(p) && alpha != Some(*p)).collect();
    Layer { name, values, alpha, unread }
}

/// Tells whether the values of a layer are a colour or grey, and no vector.
pub(super) fn is_color(names: &[String], layer: &Layer) -> bool {
    let meanings: Vec<Meaning> = layer.values.iter().map(|p| meaning(split(&names[*p]).1)).collect();
    matches!(meanings[..], [Meaning::Red, Meaning::Green, Meaning::Blue] | [Meaning::Y | Meaning::Grey])
}

/// Tells by the last word of its name whether a layer holds data and no picture, whatever its channels are called.
pub(super) fn is_data(last: &str) -> bool {
    const DATA: [&str; 14] = [
        "depth", "z", "zdepth", "uv", "st", "vector", "velocity", "motion", "position", "p", "pworld", "id",
        "mist", "mask",
    ];
    rank_as_normals(last) == 0 || DATA.contains(&last) || last.contains("crypto") || last.starts_with("index")
}

/// The last word of a layer's name, lower case: `combined` of `ViewLayer.Combined`.
pub(super) fn last_word(name: &str) -> String {
    name.rsplit(['.', '/', ':']).next().unwrap_or(name).to_ascii_lowercase()
}

/// Rank of a layer by the last word of its name where colours are wanted; the smallest is taken.
pub(super) fn rank_as_picture(last: &str) -> u32 {
    match last {
        "" => 0,
        "combined" | "beauty" | "rgba" | "rgb" | "color" | "colour" | "c" | "final" | "composite" => 1,
        _ => 2,
    }
}

/// Rank of a layer by the last word of its name where normals are wanted; the smallest is taken.
pub(super) fn rank_as_normals(last: &str) -> u32 {
    match last {
        "n" | "nn" | "nrm" | "norm" => 0,
        word if word.contains("normal") => 0,
        word => 1 + rank_as_picture(word),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layers_of(names: &[&str]) -> Vec<Layer> {
        layers(&names.iter().map(|n| (*n).to_owned()).collect::<Vec<_>>())
    }

    #[test]
    fn channels_are_found_by_meaning_and_not_by_the_order_of_their_names() {
        for names in [
            ["B", "G", "R"],
            [".B", ".G", ".R"],
            ["blue", "green", "red"],
            ["Blue", "Green", "Red"],
            ["ViewLayer.Combined.B", "ViewLayer.Combined.G", "ViewLayer.Combined.R"],
            ["beauty.blue", "beauty.green", "beauty.red"],
            ["diffuse_b", "diffuse_g", "diffuse_r"],
            ["L:B", "L:G", "L:R"],
        ] {
            let found = layers_of(&names);
            assert_eq!(found.len(), 1, "{names:?}");
            assert_eq!(found[0].values, [2, 1, 0], "{names:?}");
        }
        for names in [["X", "Y", "Z"], ["N.x", "N.y", "N.z"], ["Normal_X", "Normal_Y", "Normal_Z"]] {
            assert_eq!(layers_of(&names)[0].values, [0, 1, 2], "{names:?}");
        }
    }

    #[test]
    fn pictures_are_told_from_data() {
        let is_picture = |names: &[&str]| {
            let owned: Vec<String> = names.iter().map(|n| (*n).to_owned()).collect();
            let layer = &layers(&owned)[0];
            is_color(&owned, layer) && !is_data(&last_word(&layer.name))
        };
        for names in
            [&["B", "G", "R"][..], &["Y"], &["A", "luma"], &["V.DiffCol.B", "V.DiffCol.G", "V.DiffCol.R"]]
        {
            assert!(is_picture(names), "{names:?}");
        }
        for names in [
            &["X", "Y", "Z"][..],
            &["V.Normal.B", "V.Normal.G", "V.Normal.R"],
            &["CryptoObject00.b", "CryptoObject00.g", "CryptoObject00.r"],
            &["V.Depth.Y"],
            &["hemoglobin"],
            &["G", "R"],
        ] {
            assert!(!is_picture(names), "{names:?}");
        }
    }

    #[test]
    fn one_and_two_channels_alpha_and_what_is_not_read() {
        assert_eq!(layers_of(&["Y"])[0].values, [0]);
        assert_eq!(layers_of(&["hemoglobin"])[0].values, [0]);
        assert_eq!(layers_of(&["G", "R"])[0].values, [1, 0]);
        assert_eq!(
            layers_of(&["A", "Y"])[0],
            Layer { name: String::new(), values: vec![1], alpha: Some(0), unread: vec![] }
        );
        let with_depth = layers_of(&["A", "B", "G", "R", "Z", "id"]);
        assert_eq!((with_depth.len(), &with_depth[0].values), (1, &vec![3, 2, 1]));
        assert_eq!(with_depth[0].unread, [4, 5]);
        assert!(layers_of(&["hemoglobin", "melanin"])[0].values.is_empty());
        assert!(layers_of(&["A"])[0].values.is_empty());
        let two = layers_of(&["View.Combined.R", "View.Normal.X", "View.Combined.G", "View.Combined.B"]);
        assert_eq!(two.iter().map(|l| l.name.as_str()).collect::<Vec<_>>(), ["View.Combined", "View.Normal"]);
        assert_eq!(two[0].values, [0, 2, 3]);
        // An underscore before a word without meaning is a part of the name.
        assert_eq!(layers_of(&["skin_depth"])[0].name, "");
    }
}
