//! Materials of foreign meshes, guessed from the names that their authors gave.

use rubor_rig::head::Material;

/// Words in names (lower case) and what they mean; the first that occurs wins, so special ones stand first.
const WORDS: [(&str, Material); 48] = [
    ("glasses", Material::Other),
    ("eyewear", Material::Other),
    ("headwear", Material::Other),
    ("facewear", Material::Other),
    ("headband", Material::Other),
    ("headphone", Material::Other),
    ("earring", Material::Other),
    ("necklace", Material::Other),
    ("outfit", Material::Other),
    ("shirt", Material::Other),
    ("cloth", Material::Other),
    ("helmet", Material::Other),
    ("hairband", Material::Other),
    // A line painted around the eye, and what stands before a face.
    ("eyeline", Material::Other),
    ("mask", Material::Other),
    ("eyeocclusion", Material::Hidden),
    ("eye_occlusion", Material::Hidden),
    ("occlusion", Material::Hidden),
    ("eyeblend", Material::Hidden),
    ("eye_blend", Material::Hidden),
    ("eyeshell", Material::Hidden),
    ("eyeshadow", Material::Hidden),
    ("lacrimal", Material::Wet),
    ("tearline", Material::Wet),
    ("tear", Material::Wet),
    ("cornea", Material::Wet),
    ("eyewet", Material::Wet),
    ("lash", Material::Lash),
    ("brow", Material::Hair),
    ("hair", Material::Hair),
    ("beard", Material::Hair),
    ("sclera", Material::Eye),
    ("iris", Material::Eye),
    ("eyeball", Material::Eye),
    ("gum", Material::Gums),
    ("tongue", Material::Gums),
    ("teeth", Material::Teeth),
    ("tooth", Material::Teeth),
    ("socket", Material::Mucosa),
    ("mouth", Material::Mucosa),
    ("face", Material::Skin),
    ("head", Material::Skin),
    ("skin", Material::Skin),
    ("body", Material::Skin),
    ("neck", Material::Skin),
    ("ears", Material::Skin),
    ("lip", Material::Skin),
    ("eye", Material::Eye),
];

/// The material that a name speaks of; skin where it speaks of nothing known (a mesh without names is mostly a scan).
pub fn guess_material(name: &str) -> Material {
    recognise(name).unwrap_or(Material::Skin)
}

/// The material that a name speaks of, if it speaks of one.
pub fn recognise(name: &str) -> Option<Material> {
    let name = name.to_lowercase();
    WORDS.iter().find(|(word, _)| name.contains(word)).map(|(_, m)| *m)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_common_sets_are_understood() {
        for (name, material) in [
            ("M_Face", Material::Skin),
            ("M_BackHead", Material::Skin),
            ("M_GumsTongue", Material::Gums),
            ("M_Teeth", Material::Teeth),
            ("M_ScleraLeft", Material::Eye),
            ("M_IrisRight", Material::Eye),
            ("M_LacrimalFluid", Material::Wet),
            ("M_EyeBlend", Material::Hidden),
            ("M_EyeOcclusion", Material::Hidden),
            ("M_EyeLashes", Material::Lash),
            ("eyeball_L", Material::Eye),
            ("Wolf3D_Glasses", Material::Other),
            ("Wolf3D_Skin", Material::Skin),
            ("Wolf3D_Body", Material::Skin),
            ("avaturn_body_material", Material::Skin),
            ("N00_000_00_Face_00_SKIN (Instance)", Material::Skin),
            ("N00_000_00_Body_00_SKIN (Instance)", Material::Skin),
            ("N00_000_00_FaceEyeline_00_FACE (Instance)", Material::Other),
            ("N00_000_00_FaceBrow_00_FACE (Instance)", Material::Hair),
            ("Material.001", Material::Skin),
        ] {
            assert_eq!(guess_material(name), material, "{name}");
        }
        assert_eq!(recognise("Material.001"), None);
    }
}
