//! `rubor kernel`: a separable kernel as JSON.

use clap::ValueEnum;
use rubor_rig::skin::kernel::{ArtistKernel, KernelMethod, SeparableKernel, kernel_report};

use super::profile::{self, Choice, Rgb};
use rubor::{Failure, Outcome};

#[derive(clap::Args)]
pub(crate) struct Arguments {
    #[command(flatten)]
    choice: Choice,
    /// Taps: an odd number from 5 to 65
    #[arg(long, default_value_t = 17)]
    samples: usize,
    /// How the kernel is made from the profile
    #[arg(long, value_enum, default_value = "edges")]
    method: Method,
    /// Half width of a kernel made by hand instead of from a profile, mm (Jimenez 2012, eq. 6.1)
    #[arg(long, value_name = "MM", allow_negative_numbers = true, conflicts_with_all = ["profile", "method"])]
    width_mm: Option<f64>,
    /// Share of the light that scatters, 0 to 1: one number or R,G,B
    #[arg(
        long,
        value_name = "RGB",
        allow_hyphen_values = true,
        default_value = "0.78,0.7,0.75",
        requires = "width_mm"
    )]
    strength: Rgb,
    /// Width of the gradients relative to d'Eon's red, 0 or more: one number or R,G,B
    #[arg(
        long,
        value_name = "RGB",
        allow_hyphen_values = true,
        default_value = "0.57,0.13,0.08",
        requires = "width_mm"
    )]
    falloff: Rgb,
    /// The output is always JSON; accepted so that every command takes it
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, ValueEnum)]
enum Method {
    /// Least squares over straight edges of light in all directions
    Edges,
    /// Exact for light that varies along one axis
    LineSpread,
    /// Width, strength and falloff fitted (Jimenez 2012, eqs. 6.1 to 6.3)
    LeastSquares,
    /// First singular vector of the 2D kernel
    SingularValue,
}

pub(crate) fn run(arguments: &Arguments) -> Outcome {
    // The output is always JSON, so the flag changes nothing.
    let _ = arguments.json;
    if let Some(width_mm) = arguments.width_mm {
        let (strength, falloff) = (arguments.strength.0, arguments.falloff.0);
        let artist = ArtistKernel { width_mm, strength, falloff };
        return profile::print(&SeparableKernel::artist(&artist, arguments.samples).map_err(Failure::input)?);
    }
    let method = match arguments.method {
        Method::Edges => KernelMethod::Edges,
        Method::LineSpread => KernelMethod::LineSpread,
        Method::LeastSquares => KernelMethod::LeastSquares,
        Method::SingularValue => KernelMethod::SingularValue,
    };
    let profile = arguments.choice.profile()?;
    profile::print(&kernel_report(&profile, method, arguments.samples).map_err(Failure::input)?)
}
