//! Makes separable kernels of d'Eon's skin by every method and prints the table of docs/profiles.md.
//!
//! `cargo run --release -p rubor-rig --example kernel_table`

use rubor_rig::error::SkinError;
use rubor_rig::skin::fit::{Emphasis, fit_gaussians};
use rubor_rig::skin::kernel::{KernelMethod, kernel_report};
use rubor_rig::skin::medium::{SKIN1, SKIN2, rgb_media};
use rubor_rig::skin::model::ProfileModel;
use rubor_rig::skin::profile::Profile;

fn main() -> Result<(), SkinError> {
    let profile = Profile::deon_six();
    println!(
        "| taps | method | squared error R / G / B | misplaced light R / G / B |\n| --- | --- | --- | --- |"
    );
    for samples in [9, 17, 33] {
        let methods = [
            KernelMethod::Edges,
            KernelMethod::LineSpread,
            KernelMethod::LeastSquares,
            KernelMethod::SingularValue,
        ];
        for method in methods {
            let report = kernel_report(&profile, method, samples)?;
            let squared = report.errors.map(|e| format!("{:.1} %", 100.0 * e.root_mean_square)).join(" / ");
            let misplaced = report.errors.map(|e| format!("{:.1} %", 100.0 * e.misplaced)).join(" / ");
            println!("| {samples} | {method:?} | {squared} | {misplaced} |");
            if let (17, Some(artist)) = (samples, report.artist) {
                eprintln!("{artist:.3?}, separability {:.3?}", report.separability);
            }
        }
    }

    println!("\n| dipole | Gaussians | error of eq. 2.2 R / G / B |\n| --- | --- | --- |");
    for (name, skin) in [("skin1", SKIN1), ("skin2", SKIN2)] {
        let dipole = ProfileModel::StandardDipole.profile(name, &rgb_media(&skin, 1.3)?, None, 0)?;
        for k in [2, 4, 6] {
            let one = |c: usize| {
                let channel = &dipole.channels[c];
                let alone = Profile { name: name.into(), channels: std::array::from_fn(|_| channel.clone()) };
                Ok(format!(
                    "{:.2} %",
                    100.0 * fit_gaussians(&alone, k, Emphasis::Peak)?.errors[0].root_mean_square
                ))
            };
            let alone: Result<Vec<String>, SkinError> = (0..3).map(one).collect();
            println!("| {name} | {k}, own variances | {} |", alone?.join(" / "));
            let shared = fit_gaussians(&dipole, k, Emphasis::Peak)?.errors;
            let shared = shared.map(|e| format!("{:.2} %", 100.0 * e.root_mean_square)).join(" / ");
            println!("| {name} | {k}, common variances | {shared} |");
        }
    }
    Ok(())
}
