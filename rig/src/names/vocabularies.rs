//! What other programs call the shapes of ARKit.
//!
//! | names | of | source |
//! | --- | --- | --- |
//! | `Brow_Drop_L` | Character Creator 3 and 4, extended facial profile | Reallusion, manual of Character Creator 4 |
//! | `CTRL_expressions_browDownL` | raw controls of a MetaHuman | Epic Games, MetaHuman documentation |
//! | `viseme_aa` | 15 visemes of Oculus Lipsync, which avatar services use | Meta, Oculus Lipsync viseme reference |
//! | `Fcl_EYE_Close_L` | VRoid Studio | pixiv, exports of VRoid Studio |
//! | `happy` | presets of VRM 1 | VRM Consortium, VRMC_vrm 1.0 |
//!
//! Names of one place and motion are the same shape in another spelling (`SPELLINGS`). Visemes and moods are mixtures: no
//! vendor publishes their shares of ARKit's shapes, so these are ours, judged by eye. Correctives and shapes that ARKit has
//! none of (ears, nostrils, lips that stick) keep their own names.

/// A written name and the canonical one; `*` is a side, `_L` or `L` there and `Left` here. Names that are canonical but for
/// case, separators and the spelling of a side are not listed.
pub(super) const SPELLINGS: [(&str, &str); 52] = [
    // Character Creator
    ("Brow_Drop_*", "browDown*"),
    ("Brow_Raise_Inner_*", "browInnerUp*"),
    ("Brow_Raise_Outer_*", "browOuterUp*"),
    ("Cheek_Raise_*", "cheekSquint*"),
    ("Eye_L_Look_L", "eyeLookOutLeft"),
    ("Eye_L_Look_R", "eyeLookInLeft"),
    ("Eye_R_Look_L", "eyeLookInRight"),
    ("Eye_R_Look_R", "eyeLookOutRight"),
    ("Eye_L_Look_Up", "eyeLookUpLeft"),
    ("Eye_R_Look_Up", "eyeLookUpRight"),
    ("Eye_L_Look_Down", "eyeLookDownLeft"),
    ("Eye_R_Look_Down", "eyeLookDownRight"),
    ("Mouth_Up_Upper_*", "mouthUpperUp*"),
    ("Mouth_Down_Lower_*", "mouthLowerDown*"),
    ("Mouth_Roll_In_Upper", "mouthRollUpper"),
    ("Mouth_Roll_In_Lower", "mouthRollLower"),
    ("Mouth_Roll_In_Upper_*", "mouthRollUpper_*"),
    ("Mouth_Roll_In_Lower_*", "mouthRollLower_*"),
    // MetaHuman
    ("browRaiseIn*", "browInnerUp*"),
    ("browRaiseOuter*", "browOuterUp*"),
    ("eyeWiden*", "eyeWide*"),
    ("eyeSquintInner*", "eyeSquint*"),
    ("eyeCheekRaise*", "cheekSquint*"),
    ("eyeLookLeftL", "eyeLookOutLeft"),
    ("eyeLookRightL", "eyeLookInLeft"),
    ("eyeLookLeftR", "eyeLookInRight"),
    ("eyeLookRightR", "eyeLookOutRight"),
    ("eyePupilWide*", "pupilDilate*"),
    ("noseWrinkle*", "noseSneer*"),
    ("mouthCheekBlow*", "cheekPuff*"),
    ("mouthUpperLipRaise*", "mouthUpperUp*"),
    ("mouthLowerLipDepress*", "mouthLowerDown*"),
    ("mouthCornerPull*", "mouthSmile*"),
    ("mouthCornerDepress*", "mouthFrown*"),
    ("mouthLipsPress*", "mouthPress*"),
    ("mouthUpperLipRollIn*", "mouthRollUpper_*"),
    ("mouthLowerLipRollIn*", "mouthRollLower_*"),
    ("jawFwd", "jawForward"),
    ("jawChinRaiseU*", "mouthShrugUpper_*"),
    ("jawChinRaiseD*", "mouthShrugLower_*"),
    // VRoid Studio
    ("Fcl_EYE_Close_*", "eyeBlink*"),
    ("Fcl_EYE_Close", "blink"),
    ("Fcl_ALL_Joy", "happy"),
    ("Fcl_ALL_Angry", "angry"),
    ("Fcl_ALL_Sorrow", "sad"),
    ("Fcl_ALL_Fun", "relaxed"),
    ("Fcl_ALL_Surprised", "surprised"),
    ("Fcl_MTH_A", "aa"),
    ("Fcl_MTH_I", "ih"),
    ("Fcl_MTH_U", "ou"),
    ("Fcl_MTH_E", "ee"),
    ("Fcl_MTH_O", "oh"),
];

/// What stands before a name and says nothing.
pub(super) const PREFIXES: [&str; 2] = ["CTRL_expressions_", "CTRL_expressions."];

/// VRoid Studio puts the name of the mesh before the name of the shape.
pub(super) const VROID: &str = "Fcl_";

/// Visemes of Oculus Lipsync as ARKit shapes; the shares are ours, judged by eye. Silence moves nothing and is not here.
pub const VISEMES: [(&str, &[(&str, f32)]); 14] = [
    (
        "viseme_PP",
        &[
            ("mouthPressLeft", 0.6),
            ("mouthPressRight", 0.6),
            ("mouthRollLower", 0.3),
            ("mouthRollUpper", 0.3),
        ],
    ),
    (
        "viseme_FF",
        &[("mouthRollLower", 0.6), ("mouthUpperUpLeft", 0.3), ("mouthUpperUpRight", 0.3), ("jawOpen", 0.05)],
    ),
    ("viseme_TH", &[("jawOpen", 0.15), ("tongueOut", 0.3)]),
    ("viseme_DD", &[("jawOpen", 0.15), ("mouthLowerDownLeft", 0.3), ("mouthLowerDownRight", 0.3)]),
    ("viseme_kk", &[("jawOpen", 0.2), ("mouthStretchLeft", 0.2), ("mouthStretchRight", 0.2)]),
    ("viseme_CH", &[("jawOpen", 0.1), ("mouthFunnel", 0.5)]),
    (
        "viseme_SS",
        &[
            ("jawOpen", 0.05),
            ("mouthStretchLeft", 0.4),
            ("mouthStretchRight", 0.4),
            ("mouthLowerDownLeft", 0.2),
            ("mouthLowerDownRight", 0.2),
        ],
    ),
    ("viseme_nn", &[("jawOpen", 0.1), ("mouthLowerDownLeft", 0.2), ("mouthLowerDownRight", 0.2)]),
    ("viseme_RR", &[("jawOpen", 0.15), ("mouthFunnel", 0.3), ("mouthPucker", 0.2)]),
    ("viseme_aa", &[("jawOpen", 0.6)]),
    ("viseme_E", &[("jawOpen", 0.25), ("mouthStretchLeft", 0.4), ("mouthStretchRight", 0.4)]),
    ("viseme_I", &[("jawOpen", 0.15), ("mouthSmileLeft", 0.4), ("mouthSmileRight", 0.4)]),
    ("viseme_O", &[("jawOpen", 0.35), ("mouthFunnel", 0.8)]),
    ("viseme_U", &[("jawOpen", 0.15), ("mouthPucker", 0.8)]),
];

/// What an ARKit shape drives on a head that lacks it, and its share of each. The first row of which the head has all
/// counts: rows of MetaHumans and VRoid avatars, then of heads with visemes alone.
pub(super) const ON_OTHER_HEADS: [(&str, &[(&str, f32)]); 26] = [
    // MetaHuman: quarters of the lips
    (
        "mouthFunnel",
        &[("mouthFunnelUL", 1.0), ("mouthFunnelUR", 1.0), ("mouthFunnelDL", 1.0), ("mouthFunnelDR", 1.0)],
    ),
    (
        "mouthPucker",
        &[
            ("mouthLipsPurseUL", 1.0),
            ("mouthLipsPurseUR", 1.0),
            ("mouthLipsPurseDL", 1.0),
            ("mouthLipsPurseDR", 1.0),
        ],
    ),
    (
        "mouthClose",
        &[
            ("mouthLipsTogetherUL", 1.0),
            ("mouthLipsTogetherUR", 1.0),
            ("mouthLipsTogetherDL", 1.0),
            ("mouthLipsTogetherDR", 1.0),
        ],
    ),
    // VRoid Studio
    ("mouthSmileLeft", &[("Fcl_MTH_Fun", 0.5)]),
    ("mouthSmileRight", &[("Fcl_MTH_Fun", 0.5)]),
    ("mouthFrownLeft", &[("Fcl_MTH_Sorrow", 0.5)]),
    ("mouthFrownRight", &[("Fcl_MTH_Sorrow", 0.5)]),
    ("browDownLeft", &[("Fcl_BRW_Angry", 0.5)]),
    ("browDownRight", &[("Fcl_BRW_Angry", 0.5)]),
    ("browInnerUp", &[("Fcl_BRW_Sorrow", 1.0)]),
    ("browOuterUpLeft", &[("Fcl_BRW_Surprised", 0.5)]),
    ("browOuterUpRight", &[("Fcl_BRW_Surprised", 0.5)]),
    ("eyeWideLeft", &[("Fcl_EYE_Surprised", 0.5)]),
    ("eyeWideRight", &[("Fcl_EYE_Surprised", 0.5)]),
    ("cheekSquintLeft", &[("Fcl_EYE_Joy_L", 0.3)]),
    ("cheekSquintRight", &[("Fcl_EYE_Joy_R", 0.3)]),
    // Visemes
    ("jawOpen", &[("viseme_aa", 1.0)]),
    ("mouthFunnel", &[("viseme_O", 1.0)]),
    ("mouthPucker", &[("viseme_U", 1.0)]),
    ("mouthStretchLeft", &[("viseme_E", 0.5)]),
    ("mouthStretchRight", &[("viseme_E", 0.5)]),
    ("mouthPressLeft", &[("viseme_PP", 0.5)]),
    ("mouthPressRight", &[("viseme_PP", 0.5)]),
    ("mouthRollLower", &[("viseme_FF", 1.0)]),
    ("mouthSmileLeft", &[("viseme_I", 0.3)]),
    ("mouthSmileRight", &[("viseme_I", 0.3)]),
];
