//! What the page on other programs says of their versions is what the comparison installs.

use std::path::Path;

#[test]
fn versions_on_the_page_are_those_of_the_package_file() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let package = std::fs::read_to_string(root.join("interchange/package.json")).unwrap();
    let package: serde_json::Value = serde_json::from_str(&package).unwrap();
    let page = std::fs::read_to_string(root.join("../docs/interchange.md")).unwrap();
    let version = |name: &str| {
        let range =
            package["dependencies"][name].as_str().unwrap_or_else(|| panic!("{name} is not installed"));
        range.trim_start_matches(['^', '~']).to_owned()
    };
    let minor = |name: &str| version(name).split('.').take(2).collect::<Vec<_>>().join(".");
    let release = version("three").split('.').nth(1).map(str::to_owned).unwrap();
    let expected = [
        format!("three.js r{release} (Chromium)"),
        format!("Babylon.js {} (Chromium)", minor("babylonjs")),
        format!("glTF Transform {}", minor("@gltf-transform/cli")),
        format!("glTF Validator {}", version("gltf-validator")),
    ];
    for name in expected {
        assert!(page.contains(&name), "docs/interchange.md does not name {name}");
    }
    assert_eq!(version("babylonjs"), version("babylonjs-loaders"));
}
