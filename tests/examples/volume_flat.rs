//! What a flat piece of skin returns of a lamp by its angle, in the volume: over what it returns of one straight on, beside the
//! share that a smooth boundary lets in (docs/benchmark.md).
//!
//! `volume_flat [PATHS]`

use rubor::measure::volume::MediumName;
use rubor_rig::skin::medium::fresnel_from_inside;
use rubor_rig::skin::volume::flat_reflectance;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let paths = std::env::args().nth(1).map_or(Ok(1_000_000), |n| n.parse())?;
    let flesh = MediumName::Skin1.flesh()?;
    let eta = f64::from(flesh.boundary().eta);
    let entering = |mu: f64| 1.0 - fresnel_from_inside(mu, 1.0 / eta);
    let [front, _] = flat_reflectance(&flesh, 1.0, paths, 1);
    println!("straight on: {front:.4?}");
    println!("| cosine | red | green | blue | standard error | a smooth boundary lets in |");
    println!("| --- | --- | --- | --- | --- | --- |");
    for mu in [0.8, 0.5, 0.3, 0.2, 0.1] {
        // By reciprocity: seen at this cosine under an even sky.
        let [light, error] = flat_reflectance(&flesh, mu, paths, 2);
        let [r, g, b] = [0, 1, 2].map(|c| light[c] / front[c]);
        let worst = (0..3).map(|c| error[c] / front[c]).fold(0.0, f64::max);
        let smooth = entering(f64::from(mu)) / entering(1.0);
        println!("| {mu} | {r:.3} | {g:.3} | {b:.3} | {worst:.3} | {smooth:.3} |");
    }
    Ok(())
}
