//! `rubor profile`: a diffusion profile as JSON, or the table of the errors of profiles against photon walks.

use rubor_rig::skin::accuracy::{AccuracyOptions, accuracy_table};
use std::str::FromStr;

use rubor_rig::names::nearest;
use rubor_rig::skin::directional::{DirectionalDipole, DirectionalMedium};
use rubor_rig::skin::medium::{Medium, SKIN1, SKIN2, rgb_media};
use rubor_rig::skin::model::{FORWARD, ProfileModel};
use rubor_rig::skin::profile::{Profile, RadialProfile};
use rubor_rig::skin::report::profile_report;

use rubor::walks;
use rubor::{Failure, Outcome};

use super::console;

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
    /// Print the error of every model against a photon walk for skin1 and skin2 instead
    #[arg(long)]
    accuracy: bool,
    /// The output is always JSON; accepted so that every command takes it
    #[arg(long)]
    json: bool,
}

/// Choice of the profile.
#[derive(clap::Args)]
pub(crate) struct Choice {
    /// deon-six, jimenez-four (sums of Gaussians), skin1 or skin2 (media of Jensen et al. 2001)
    #[arg(long, default_value = "deon-six", value_name = "NAME")]
    profile: String,
    /// Scattering coefficient of another medium, 1/mm: one number or R,G,B (reduced, unless --anisotropy is given)
    #[arg(
        long,
        value_name = "RGB",
        allow_hyphen_values = true,
        requires = "sigma_a",
        conflicts_with = "profile"
    )]
    sigma_s: Option<Rgb>,
    /// Absorption coefficient of that medium, 1/mm: one number or R,G,B
    #[arg(long, value_name = "RGB", allow_hyphen_values = true, requires = "sigma_s")]
    sigma_a: Option<Rgb>,
    /// Mean cosine g of its scattering; monte-carlo walks with it, directional-dipole takes it (else 0.8), other models
    /// reduce --sigma-s by 1 - g
    #[arg(long, value_name = "G", allow_negative_numbers = true, requires = "sigma_s")]
    anisotropy: Option<f64>,
    /// How the profile follows from the medium, such as monte-carlo, better-dipole, normalized-diffusion
    #[arg(long, default_value = "monte-carlo", value_name = "MODEL")]
    model: ProfileModel,
    /// Refractive index of the medium
    #[arg(long, default_value_t = 1.4, allow_negative_numbers = true)]
    eta: f64,
    /// Photons of the walk, for models that need one; walks of over a second are kept in the user's cache folder
    #[arg(long, default_value_t = 200_000)]
    photons: u64,
}

/// One number for all channels, or three.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Rgb(pub(crate) [f64; 3]);

impl FromStr for Rgb {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("found {text:?}, expected a number or three with commas between: R,G,B");
        let numbers: Result<Vec<f64>, _> = text.split(',').map(|n| n.trim().parse::<f64>()).collect();
        match numbers.map_err(|_| wrong())?[..] {
            [all] => Ok(Self([all; 3])),
            [r, g, b] => Ok(Self([r, g, b])),
            _ => Err(wrong()),
        }
    }
}

impl Choice {
    pub(crate) fn profile(&self) -> Outcome<Profile> {
        const NAMES: [&str; 4] = ["deon-six", "jimenez-four", "skin1", "skin2"];
        let (name, coefficients) = match (self.profile.as_str(), self.sigma_s, self.sigma_a) {
            (_, Some(s), Some(a)) => ("medium", [s.0, a.0]),
            ("deon-six", ..) => return Ok(Profile::deon_six()),
            ("jimenez-four", ..) => return Ok(Profile::jimenez_four()),
            ("skin1", ..) => ("skin1", SKIN1),
            ("skin2", ..) => ("skin2", SKIN2),
            (other, ..) => {
                let failure =
                    Failure::input(format!("--profile: found {other:?}, expected {}", NAMES.join(", ")));
                return Err(match nearest(other, NAMES) {
                    Some(name) => failure.hint(format!("did you mean {name:?}?")),
                    None => failure,
                });
            }
        };
        let name = format!("{name} {} at {}", self.model, self.eta);
        let anisotropy = self.anisotropy.unwrap_or(0.0);
        let [s, a] = coefficients;
        let reduced = |c: usize| Medium::reduced(s[c], anisotropy, a[c], self.eta).map_err(Failure::input);
        let media = [reduced(0)?, reduced(1)?, reduced(2)?];
        if self.model == ProfileModel::DirectionalDipole {
            let anisotropy = self.anisotropy.unwrap_or(FORWARD);
            let dipole = |medium| DirectionalDipole::new(DirectionalMedium { medium, anisotropy });
            let [r, g, b] =
                media.map(|m| dipole(m).map(RadialProfile::DirectionalDipole).map_err(Failure::input));
            return Ok(Profile { name, channels: [r?, g?, b?] });
        }
        if !self.model.needs_walk() {
            return self.model.profile(&name, &media, None, 0).map_err(Failure::input);
        }
        // Media without an answer are refused before the walk.
        let walked = if self.model == ProfileModel::MonteCarlo {
            rgb_media(&coefficients, self.eta).map_err(Failure::input)?
        } else {
            media
        };
        walks::check(&walked).map_err(Failure::input)?;
        if anisotropy != 0.0 && self.model == ProfileModel::MonteCarlo {
            let (table, note) = walks::table(anisotropy, self.eta, self.photons)?;
            console::notes(note.as_slice());
            let channel = |c: usize| table.profile_of(s[c], a[c]).map(RadialProfile::Tabulated);
            let channels = [channel(0), channel(1), channel(2)];
            let [r, g, b] = channels.map(|c| c.map_err(Failure::input));
            return Ok(Profile { name, channels: [r?, g?, b?] });
        }
        let (table, note) = walks::table(0.0, self.eta, self.photons)?;
        console::notes(note.as_slice());
        self.model.profile(&name, &media, Some(&table), 0).map_err(Failure::input)
    }
}

pub(crate) fn run(arguments: &Arguments) -> Outcome {
    // The output is always JSON, so the flag changes nothing.
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
    super::print_json(value)
}
