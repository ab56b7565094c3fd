//! Meaning of single words of a scene: numbers, units, attribute names.

/// Short name of an attribute that scenes also write long.
pub(crate) fn short(name: &str) -> &str {
    match name {
        "vrts" => "vt",
        "edge" => "ed",
        "face" => "fc",
        "pnts" => "pt",
        "uvSet" => "uvst",
        "uvSetPoints" => "uvsp",
        "uvSetName" => "uvsn",
        "currentUVSet" => "cuvs",
        "intermediateObject" => "io",
        "visibility" => "v",
        "translate" => "t",
        "rotate" => "r",
        "scale" => "s",
        "translateX" => "tx",
        "translateY" => "ty",
        "translateZ" => "tz",
        "rotateX" => "rx",
        "rotateY" => "ry",
        "rotateZ" => "rz",
        "scaleX" => "sx",
        "scaleY" => "sy",
        "scaleZ" => "sz",
        "rotateOrder" => "ro",
        "rotatePivot" => "rp",
        "rotatePivotTranslate" => "rpt",
        "scalePivot" => "sp",
        "scalePivotTranslate" => "spt",
        "jointOrient" => "jo",
        "rotateAxis" => "ra",
        "shear" => "sh",
        "shearXY" => "shxy",
        "shearXZ" => "shxz",
        "shearYZ" => "shyz",
        "offsetParentMatrix" => "opm",
        "inheritsTransform" => "it",
        "opposite" => "op",
        "pntx" | "xv" | "xValue" | "xVertex" | "vx" | "vrtx" => "px",
        "pnty" | "yv" | "yValue" | "yVertex" | "vy" | "vrty" => "py",
        "pntz" | "zv" | "zValue" | "zVertex" | "vz" | "vrtz" => "pz",
        "vlist" => "vl",
        "vertex" => "vt",
        "plist" => "pl",
        "controlPoints" => "cp",
        "relativeTweak" => "rtw",
        "tweakLocation" => "twl",
        "baseWeights" => "bw",
        "targetWeights" => "tw",
        "targetVisibility" => "tgvs",
        "targetParentVisibility" => "tpvs",
        "targetDirectory" => "tgdt",
        "directoryWeight" => "dwgh",
        "parentDirectory" => "pndr",
        "parentIndex" => "pnid",
        "postDeformersMode" => "pdm",
        "inbetweenVisibility" => "ibvs",
        "weight" => "w",
        "envelope" => "en",
        "drawOverride" => "do",
        "drawInfo" => "di",
        "inputTarget" => "it",
        "inputTargetGroup" => "itg",
        "inputTargetItem" => "iti",
        "inputPointsTarget" => "ipt",
        "inputComponentsTarget" => "ict",
        "inputGeomTarget" => "igt",
        "attributeAliasList" => "aal",
        "inBetweenInfoGroup" => "ibig",
        "inBetweenInfo" => "ibi",
        "inBetweenTargetName" => "ibtn",
        "keyTimeValue" => "ktv",
        "keyTanInType" => "kit",
        "keyTanOutType" => "kot",
        "keyTanInX" => "kix",
        "keyTanInY" => "kiy",
        "keyTanOutX" => "kox",
        "keyTanOutY" => "koy",
        "tangentType" => "tan",
        "weightedTangents" => "wgt",
        "preInfinity" => "pre",
        "postInfinity" => "pst",
        "output" => "o",
        "outMesh" => "o",
        "worldMesh" => "w",
        "inMesh" => "i",
        "input" => "ip",
        "inputGeometry" => "ig",
        "outputGeometry" => "og",
        "instObjGroups" => "iog",
        "objectGroups" => "og",
        "objectGrpCompList" => "gcl",
        "dagSetMembers" => "dsm",
        "before" => "b",
        "ruborFacialAppearance" => "rfa",
        other => other,
    }
}

/// A finite number. Whole numbers and short decimals, nearly all of a scene, take the quick way: digits as an integer
/// below 2^53 divided by a power of ten up to 10^22 round exactly once (W. D. Clinger 1990).
pub(super) fn number(word: &[u8]) -> Option<f64> {
    const POWERS: [f64; 23] = [
        1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17,
        1e18, 1e19, 1e20, 1e21, 1e22,
    ];
    let (negative, digits) = match word.split_first() {
        Some((b'-', rest)) => (true, rest),
        _ => (false, word),
    };
    if !digits.is_empty() && digits.len() <= 16 {
        let mut mantissa = 0_u64;
        let mut point = None;
        let plain = digits.iter().enumerate().all(|(i, b)| match b {
            b'0'..=b'9' => {
                mantissa = mantissa * 10 + u64::from(b - b'0');
                true
            }
            b'.' if point.is_none() && digits.len() > 1 => {
                point = Some(i);
                true
            }
            _ => false,
        });
        if plain && mantissa < 1 << 53 {
            let decimals = point.map_or(0, |p| digits.len() - 1 - p);
            let value = mantissa as f64 / POWERS[decimals];
            return Some(if negative { -value } else { value });
        }
    }
    let text = std::str::from_utf8(word).ok()?;
    // Words such as "inf" and "nan" are numbers to Rust and to Maya ("nan" occurs in broken scenes).
    text.parse::<f64>().ok().filter(|n| n.is_finite())
}

/// Metres in a unit of length.
pub(super) fn metres(unit: &str) -> Option<f64> {
    Some(match unit {
        "mm" | "millimeter" => 0.001,
        "cm" | "centimeter" => 0.01,
        "m" | "meter" => 1.0,
        "km" | "kilometer" => 1000.0,
        "in" | "inch" => 0.0254,
        "ft" | "foot" => 0.3048,
        "yd" | "yard" => 0.9144,
        "mi" | "mile" => 1609.344,
        _ => return None,
    })
}

/// Frames per second of a unit of time.
pub(crate) fn fps(unit: &str) -> Option<f64> {
    Some(match unit {
        "game" => 15.0,
        "film" => 24.0,
        "pal" => 25.0,
        "ntsc" => 30.0,
        "show" => 48.0,
        "palf" => 50.0,
        "ntscf" => 60.0,
        "sec" => 1.0,
        "min" => 1.0 / 60.0,
        "hour" => 1.0 / 3600.0,
        "millisec" => 1000.0,
        "23.976fps" => 24_000.0 / 1001.0,
        "29.97fps" | "29.97df" => 30_000.0 / 1001.0,
        "47.952fps" => 48_000.0 / 1001.0,
        "59.94fps" => 60_000.0 / 1001.0,
        _ => unit.strip_suffix("fps")?.parse().ok().filter(|f| *f > 0.0 && *f <= 100_000.0)?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_those_of_the_standard_library() {
        for text in [
            "0",
            "-0",
            "1",
            "-1.5",
            "0.1",
            "123456789.123456",
            "9007199254740991",
            "1e-7",
            "-2.5E+3",
            "1.4901161193847656e-08",
            "0.24537032842636108",
            "-37.538352729610985",
            ".5",
            "5.",
            "00012.50",
        ] {
            assert_eq!(number(text.as_bytes()), Some(text.parse::<f64>().unwrap()), "{text}");
        }
        for text in ["", "-", ".", "nan", "inf", "1.2.3", "0x10", "--1", "1e999", "abc"] {
            assert_eq!(number(text.as_bytes()), None, "{text}");
        }
    }
}
