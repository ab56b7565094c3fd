//! Faces whose skin changes colour and wrinkles as they act: jobs, measurements and review pictures.
//!
//! ```text
//! files --inputs--> LoadedHead, Rig, Sequence --Job--> job.json
//!                                                |
//! Job + LoadedHead --Plan (checked)--> frames --Studio (device)--> pictures
//!                                        |
//!        run: a folder of frames, review page, contact sheet, video, timeline, animated head, stats.json (Report), manifest
//!        measure: bench, chart, difference --> Report          gallery: one page --> Report
//! ```
//!
//! The command `rubor` is a thin layer over this library: arguments in, a job or a report, text out. The library prints
//! nothing and ends no process: remarks and progress go to a [`Watch`], failures are a [`Failure`].
//!
//! A job is a value that can be written, read back and drawn again:
//!
//! ```
//! use rubor::{Job, inputs};
//! use rubor_rig::{expression::Rig, timeline::Sequence};
//!
//! let sequence = Sequence::from_json("wink.json", r#"{ "fps": 24, "duration": 1, "expressions": { "joy": 1 } }"#)?;
//! let mut job = Job::new(&[], Rig::default_rig()?, sequence)?;
//! job.settings.output.size = [64, 48];
//! job.relight(inputs::lights("window")?)?;
//! let read = Job::from_json("job.json", &job.to_json()?, std::path::Path::new("."), None)?;
//! assert_eq!(read, job);
//! # Ok::<(), rubor::Failure>(())
//! ```
//!
//! ```no_run
//! # use rubor::{Destination, Job, Plan, Studio, run};
//! # fn draw(job: Job) -> rubor::Outcome {
//! let heads = job.load_heads()?;
//! let plan = Plan::new(&job, &heads)?;
//! let report = run::run(&plan, &mut Studio::open(None)?, &Destination::new("out"), &mut ())?;
//! println!("{} frames", report.frames_drawn);
//! # Ok(())
//! # }
//! ```

#![deny(clippy::print_stdout, clippy::print_stderr, clippy::exit)]

pub mod auto;
pub mod cache;
mod claim;
pub mod environment;
pub mod error;
pub mod farm;
pub mod gallery;
pub mod inputs;
pub mod job;
pub mod layers;
pub mod looks;
pub mod manifest;
pub mod measure;
pub mod notes;
pub mod output;
pub mod plan;
pub mod report;
pub mod review;
pub mod run;
pub mod stop;
pub mod studio;
pub mod utilisation;
#[cfg(feature = "view")]
pub mod view;
pub mod walks;
pub mod watch;
mod writers;

pub use error::{Failure, Fault, Outcome};
pub use job::Job;
pub use plan::Plan;
pub use report::Report;
pub use run::Destination;
pub use stop::Stop;
pub use studio::Studio;
pub use watch::Watch;
