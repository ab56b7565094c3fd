//! `rubor kernel`: a separable kernel as JSON.

use clap::ValueEnum;
use rubor_rig::skin::kernel::{KernelMethod, kernel_report};

use crate::failure::{Failure, Outcome};
use crate::profile::{self, Choice};

#[derive(clap::Args)]
pub(crate) struct Arguments {
    #[command(flatten)]
    choice: Choice,
    /// Taps: an odd number from 5 to 65
    #[arg(long, default_value_t = 17)]
    samples: usize,
    /// How the kernel is made
    #[arg(long, value_enum, default_value = "line-spread")]
    method: Method,
    /// The output is always JSON; accepted so that every command takes it
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, ValueEnum)]
enum Method {
    /// Exact for light that varies along one axis
    LineSpread,
    /// Width, strength and falloff fitted (Jimenez 2012, eqs. 6.1 to 6.3)
    LeastSquares,
    /// First singular vector of the 2D kernel
    SingularValue,
}

pub(crate) fn run(arguments: &Arguments) -> Outcome {
    // JSON is what there is: the flag changes nothing.
    let _ = arguments.json;
    let method = match arguments.method {
        Method::LineSpread => KernelMethod::LineSpread,
        Method::LeastSquares => KernelMethod::LeastSquares,
        Method::SingularValue => KernelMethod::SingularValue,
    };
    let profile = arguments.choice.profile()?;
    profile::print(&kernel_report(&profile, method, arguments.samples).map_err(Failure::input)?)
}
