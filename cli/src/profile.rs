//! `rubor profile`: a diffusion profile as JSON, or the table of how far profiles are from photon walks.

use rubor_rig::skin::accuracy::{AccuracyOptions, accuracy_table};
use rubor_rig::skin::medium::{SKIN1, SKIN2, rgb_media};
use rubor_rig::skin::model::ProfileModel;
use rubor_rig::skin::profile::Profile;
use rubor_rig::skin::report::profile_report;

use crate::failure::{Failure, Outcome};

#[derive(clap::Args)]
pub(crate) struct Arguments {
    #[command(flatten)]
    choice: Choice,
    /// Gaussians of the fit
    #[arg(long, default_value_t = 6)]
    terms: usize,
    /// Radii at which R(r) is printed
    #[arg(long, default_value_t = 64)]
    points: usize,
    /// Print how far every model is from a photon walk for skin1 and skin2 instead
    #[arg(long)]
    accuracy: bool,
    /// The output is always JSON; accepted so that every command takes it
    #[arg(long)]
    json: bool,
}

/// Which profile.
#[derive(clap::Args)]
pub(crate) struct Choice {
    /// deon-six, jimenez-four (sums of Gaussians), skin1 or skin2 (media of Jensen et al. 2001)
    #[arg(long, default_value = "deon-six", value_name = "NAME")]
    profile: String,
    /// How the profile follows from skin1 or skin2, such as monte-carlo, better-dipole, normalized-diffusion
    #[arg(long, default_value = "monte-carlo", value_name = "MODEL")]
    model: ProfileModel,
    /// Refractive index of skin1 or skin2
    #[arg(long, default_value_t = 1.4)]
    eta: f64,
    /// Photons of the walk, for models that need one
    #[arg(long, default_value_t = 200_000)]
    photons: u64,
}

impl Choice {
    pub(crate) fn profile(&self) -> Outcome<Profile> {
        let coefficients = match self.profile.as_str() {
            "deon-six" => return Ok(Profile::deon_six()),
            "jimenez-four" => return Ok(Profile::jimenez_four()),
            "skin1" => SKIN1,
            "skin2" => SKIN2,
            other => {
                return Err(Failure::input(format!(
                    "--profile: found {other:?}, expected deon-six, jimenez-four, skin1 or skin2"
                )));
            }
        };
        let media = rgb_media(&coefficients, self.eta).map_err(Failure::input)?;
        let name = format!("{} {} at {}", self.profile, self.model, self.eta);
        self.model.profile(&name, &media, None, self.photons).map_err(Failure::input)
    }
}

pub(crate) fn run(arguments: &Arguments) -> Outcome {
    // JSON is what there is: the flag changes nothing.
    let _ = arguments.json;
    if arguments.accuracy {
        let photons = arguments.choice.photons;
        let options = AccuracyOptions {
            reference_photons: photons,
            table_photons: photons,
            ..AccuracyOptions::default()
        };
        return print(&accuracy_table(options).map_err(Failure::input)?);
    }
    let profile = arguments.choice.profile()?;
    print(&profile_report(&profile, arguments.terms, arguments.points).map_err(Failure::input)?)
}

pub(crate) fn print(value: &impl serde::Serialize) -> Outcome {
    println!("{}", serde_json::to_string_pretty(value).map_err(Failure::job)?);
    Ok(())
}
