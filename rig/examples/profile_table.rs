//! Measures every diffusion profile against photon walks and prints docs/profiles.md's table.
//!
//! `cargo run --release -p rubor-rig --example profile_table [REFERENCE_PHOTONS [TABLE_PHOTONS]]`

use rubor_rig::error::SkinError;
use rubor_rig::skin::accuracy::{AccuracyOptions, accuracy_table, similarity_error};
use rubor_rig::skin::medium::{SKIN1, rgb_media};
use rubor_rig::skin::monte_carlo::AlbedoTable;

fn main() -> Result<(), SkinError> {
    let mut options = AccuracyOptions::default();
    let mut arguments = std::env::args().skip(1);
    for photons in [&mut options.reference_photons, &mut options.table_photons] {
        if let Some(text) = arguments.next() {
            *photons = text.parse().map_err(|_| SkinError::new("arguments", &text, "a number of photons"))?;
        }
    }
    let start = std::time::Instant::now();
    print!("{}", accuracy_table(options)?);

    println!("\n| similarity, skin1 eta 1.4 | R | G | B |\n| --- | ---: | ---: | ---: |");
    let table = AlbedoTable::build(0.0, 1.4, options.table_photons, options.seed)?;
    for anisotropy in [0.5, 0.8, 0.9] {
        let mut line = format!("| g = {anisotropy} |");
        for medium in rgb_media(&SKIN1, 1.4)? {
            let photons = options.reference_photons / 4;
            let error = similarity_error(&medium, &table, anisotropy, photons, options.seed + 100)?;
            line += &format!(" {:.1} |", 100.0 * error.relative);
        }
        println!("{line}");
    }
    eprintln!("{:.1} s with {options:?}", start.elapsed().as_secs_f64());
    Ok(())
}
