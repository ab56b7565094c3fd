//! What the tables of pre-integrated scattering leave out, for docs/scatter.md.
//!
//! `cargo run --release -p rubor-rig --example preintegrated_table`

use rubor_rig::error::SkinError;
use rubor_rig::skin::preintegrated::{
    DiffuseTable, Shape, band_shares, curvature_towards, curvedness, scattered_cosine,
};
use rubor_rig::skin::profile::Profile;

const RADII_MM: [f64; 7] = [1.0, 2.0, 3.0, 5.0, 10.0, 20.0, 50.0];

/// Largest difference of two functions of the cosine and a channel, in percent of full light, R / G / B.
fn largest(
    of: impl Fn(usize, f64) -> Result<f64, SkinError>,
    from: impl Fn(usize, f64) -> Result<f64, SkinError>,
) -> Result<String, SkinError> {
    let mut worst = [0.0f64; 3];
    for (c, worst) in worst.iter_mut().enumerate() {
        for i in 0..=200 {
            let cosine = f64::from(i) / 100.0 - 1.0;
            *worst = worst.max((of(c, cosine)? - from(c, cosine)?).abs());
        }
    }
    Ok(worst.map(|w| format!("{:.2}", 100.0 * w)).join(" / "))
}

fn main() -> Result<(), SkinError> {
    let profile = Profile::deon_six();
    let table = DiffuseTable::new(&profile, 129, 64)?;
    let light = |shape, radius: f64| {
        let profile = &profile;
        move |c: usize, cosine: f64| scattered_cosine(&profile.channels[c], shape, cosine, radius)
    };
    println!("Largest difference from a sphere over all cosines, percent of full light, R / G / B\n");
    println!(
        "| radius, mm | table of 129 x 64 | cylinder | ring | no scattering |\n| --- | --- | --- | --- | --- |"
    );
    for radius in RADII_MM {
        let sphere = light(Shape::Sphere, radius);
        println!(
            "| {radius} | {} | {} | {} | {} |",
            largest(|c, x| Ok(table.sample(x, 1.0 / radius)[c]), sphere)?,
            largest(light(Shape::Cylinder, radius), sphere)?,
            largest(light(Shape::Ring, radius), sphere)?,
            largest(|_, x| Ok(x.max(0.0)), sphere)?,
        );
    }
    println!("\nA cylinder lit across its axis, looked up in the table of spheres by a curvature\n");
    println!("| radius, mm | mean curvature | curvedness | towards the light |\n| --- | --- | --- | --- |");
    for radius in RADII_MM {
        let k = [1.0 / radius, 0.0];
        let exact = light(Shape::Cylinder, radius);
        let by = |curvature: &dyn Fn(f64) -> f64| largest(|c, x| Ok(table.sample(x, curvature(x))[c]), exact);
        println!(
            "| {radius} | {} | {} | {} |",
            by(&|_| 0.5 / radius)?,
            by(&|_| curvedness(k))?,
            by(&|x| curvature_towards(k, x, 0.0))?,
        );
    }
    println!("\nShare of bands 1 and 2 of the sky's harmonics, R / G / B\n");
    println!("| radius, mm | band 1 | band 2 |\n| --- | --- | --- |");
    for radius in RADII_MM {
        let shares = profile.channels.each_ref().map(|c| band_shares(c, radius));
        let band = |l: usize| shares.map(|s| format!("{:.3}", s[l])).join(" / ");
        println!("| {radius} | {} | {} |", band(1), band(2));
    }
    Ok(())
}
