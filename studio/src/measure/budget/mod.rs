//! What sequences need of a head, and the head with no more than that.
//!
//! ```text
//! sequences --all frames--> largest weights --> what is never used           \
//!           --looks-------> right pictures, with the whole head               --> Reduction
//! each shape, zone, map size, ... alone --trial--> error, bytes               |
//! by bytes over error --combine--> as many as stay under the bound together  /
//! Reduction --file--> .glb --read back--> error; beyond the bound the last ones stay after all
//! ```
//!
//! The error is the mean FLIP over the head and the pixels around it against the same frame of the whole head with the same settings, the
//! largest over the frames that are looked at ([`crate::measure::chart`] measures pictures in the same way). Errors of single losses order
//! them and nothing more: what counts is measured of all together, and at last of the file.
//!
//! What is never used is known of every frame. What is used but not seen is known of the frames that are looked at: those with the
//! peaks of weights, and some between them.
//!
//! Does not: change settings (samples of scattering and antialiasing are chosen by `render --max-error`), thin out triangles, merge maps.

mod combine;
mod file;
mod items;
mod looks;
mod told;
mod trial;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use rubor_renderer::settings::Settings;
use rubor_rig::evaluate::Evaluator;
use rubor_rig::expression::Rig;
use rubor_rig::head::Head;
use rubor_rig::reduce::Reduction;
use rubor_rig::timeline::Sequence;

use self::combine::{Step, combine, sort};
use self::file::{Written, written};
use self::items::{Subject, Use, device_bytes, file_bytes, may_go, subjects};
use self::looks::{Look, faces, frames};
use self::trial::{Errors, Trials};
use super::chart::Timing;
use crate::auto::Bound;
use crate::error::{Failure, Outcome};
use crate::notes::Note;
use crate::report::{BudgetCoding, BudgetReport};
use crate::studio::Studio;
use crate::watch::Watch;

/// The part of the bound that JPEG may have: what little it hides is better spent on shapes and maps.
const JPEG_SHARE: f64 = 0.25;
/// The part of it that 8 bits may have.
const PNG_SHARE: f64 = 0.5;

/// A head with its rig, and what it is to play.
#[derive(Clone, Debug)]
pub struct Scene {
    /// The whole head.
    pub head: Head,
    /// Bytes of the file that it came from, for the report.
    pub input_bytes: u64,
    /// Its rig.
    pub rig: Rig,
    /// Sequences with their files, at least one.
    pub sequences: Vec<(PathBuf, Sequence)>,
}

/// What is measured.
#[derive(Clone, Debug)]
pub struct Options {
    /// Error that each frame may have: [`Bound::Flip`].
    pub bound: Bound,
    /// Frames of each sequence that are looked at, at most; 1 or more.
    pub frames: usize,
    /// How the whole and the reduced head are timed, in turns; none times nothing.
    pub timing: Option<Timing>,
    /// Settings of each sequence.
    pub settings: Vec<Settings>,
}

/// What was found.
#[derive(Clone, Debug)]
pub struct Budget {
    /// All of it in numbers; nothing is written yet.
    pub report: BudgetReport,
    /// The reduced head as a `.glb`; none if nothing can go.
    pub file: Option<Vec<u8>>,
}

/// A single loss that was tried.
struct Tried {
    subject: Subject,
    /// For each level from 1: bytes on the device and in the file that it saves, and its error alone.
    levels: Vec<Level>,
    /// It has to stay, whatever its error.
    is_held: bool,
}

#[derive(Clone, Debug)]
struct Level {
    device_bytes: u64,
    file_bytes: u64,
    errors: Errors,
}

/// Names of expressions and states that sequences have tracks of.
fn needed_names(sequences: &[Sequence]) -> BTreeSet<String> {
    let names = |s: &Sequence| s.expressions.keys().chain(s.states.keys()).cloned().collect::<Vec<_>>();
    sequences.iter().flat_map(names).collect()
}

/// Shapes that have to stay for the names of sequences.
fn held(less: &Reduction, head: &Head, sequences: &[Sequence]) -> BTreeSet<usize> {
    sequences.iter().flat_map(|sequence| less.held(head, sequence)).collect()
}

/// Finds what sequences need of a head. `name` is that of the file to be, for messages.
///
/// # Errors
/// A bound that is no error; a rig or a sequence that does not fit the head; a head of which no file keeps the bound; errors of
/// the studio.
pub fn run(
    studio: &mut Studio,
    scene: &Scene,
    options: &Options,
    name: &Path,
    watch: &mut dyn Watch,
) -> Outcome<Budget> {
    let Bound::Flip(bound) = options.bound else {
        return Err(Failure::input(format!("found a bound of {}, expected flip=X", options.bound)));
    };
    let head = &scene.head;
    let sequences: Vec<Sequence> = scene.sequences.iter().map(|(_, sequence)| sequence.clone()).collect();
    let mut notes = Vec::new();
    let (looks, uses) = looks_of(scene, options.frames, &mut notes)?;
    watch.begin("right pictures", 1);
    let mut trials = Trials::new(studio, head, &scene.rig, &sequences, &looks, options.settings.clone())?;
    watch.end();
    let mut unused = uses.unused(head, &scene.rig);
    let names_held = let_go(&mut unused, head, &sequences);
    let (coding, whole) = coding(&mut trials, bound, name)?;
    let whole_sizes = rubor_assets::export::gltf::sizes::sizes(&whole.bytes);

    let all = subjects(head, trials.hairs, &unused);
    let saved = trials.saves(&unused)?;
    watch.begin("losses tried alone", all.len() as u64);
    let mut tried = Vec::new();
    for subject in all {
        let file_bytes = |level: u32| file_bytes(head, &whole_sizes, subject, level, &unused);
        tried.push(try_alone(&mut trials, subject, (&unused, saved), &names_held, bound, file_bytes)?);
        watch.step();
    }
    watch.end();

    // Room for what the coding of maps adds.
    let room = bound - whole.errors.largest();
    let mut steps = steps(&tried, bound);
    sort(&mut steps);
    let hairs = trials.hairs;
    let less = |taken: &[Step]| {
        let mut less = unused.clone();
        taken.iter().for_each(|s| tried[s.subject].subject.leave_out(s.level, hairs, &mut less));
        less
    };
    watch.begin("losses added up", steps.len() as u64);
    let mut decided = 0;
    let mut taken = combine(&steps, |taken| {
        let less = less(taken);
        // Each success decides some; what is refused is not counted.
        let keeps = held(&less, head, &sequences).is_empty() && trials.error(&less, room)?.largest() <= room;
        if keeps {
            (decided..taken.len()).for_each(|_| watch.step());
            decided = decided.max(taken.len());
        }
        Ok(keeps)
    })?;
    watch.end();

    watch.begin("files read back", 1);
    let complete = |taken: &[Step]| with_idle(less(taken), scene, &sequences);
    let mut file = reduced(&mut trials, &complete(&taken)?, coding, name)?;
    watch.step();
    if file.errors.largest() > bound {
        // The longest start of the list whose file keeps the bound: `low` and more may, `high` does not.
        let (mut low, mut high, mut kept) = (0, taken.len(), None);
        while low < high {
            let middle = low.midpoint(high);
            let tried = reduced(&mut trials, &complete(&taken[..middle])?, coding, name)?;
            watch.step();
            if tried.errors.largest() <= bound {
                (low, kept) = (middle + 1, Some((middle, tried)));
            } else {
                high = middle;
            }
        }
        let Some((count, kept)) = kept else { return Err(no_file(bound, &file.errors)) };
        taken.truncate(count);
        file = kept;
    }
    watch.end();
    let gone = complete(&taken)?;
    let found = told::Found { scene, options, uses, tried, unused, taken, gone, coding, whole, file, notes };
    found.budget(&mut trials, watch)
}

fn no_file(bound: f64, errors: &Errors) -> Failure {
    let found = errors.largest();
    Failure::job(format!(
        "found FLIP {found:.6} between the head and a file of all of it, expected at most {bound}: files hold 16 bits of a map at most"
    ))
    .hint("a larger --max-error")
}

/// The frames to look at, and the largest weights of all frames.
fn looks_of(scene: &Scene, most: usize, notes: &mut Vec<Note>) -> Outcome<(Vec<Look>, Use)> {
    let (mut looks, mut uses) = (Vec::new(), Use::default());
    for (i, (file, sequence)) in scene.sequences.iter().enumerate() {
        let (evaluator, found) = Evaluator::new(&scene.head, &scene.rig, sequence)?;
        let about = file.display().to_string();
        notes.extend(found.iter().map(|note| Note::of_rig(&about, note)));
        let faces = faces(&evaluator);
        faces.iter().for_each(|face| uses.add(face));
        let (chosen, open) = frames(&faces, most.max(1));
        if open > 0 {
            let message = format!(
                "{open} of what moves have their peak in none of the {} frames that are looked at; more --frames see them",
                chosen.len()
            );
            notes.push(Note::new(&about, message));
        }
        let look = |frame| Look { sequence: i, frame, shot: evaluator.at(evaluator.frame_time_s(frame)) };
        looks.extend(chosen.into_iter().map(look));
    }
    if looks.is_empty() {
        return Err(Failure::input("found no sequence, expected at least one"));
    }
    Ok((looks, uses))
}

/// Takes shapes that have to stay for their names out of what is to go, and returns them.
fn let_go(less: &mut Reduction, head: &Head, sequences: &[Sequence]) -> BTreeSet<usize> {
    let mut all = BTreeSet::new();
    loop {
        let held = held(less, head, sequences);
        if held.is_empty() {
            return all;
        }
        less.shapes.retain(|shape| !held.contains(shape));
        all.extend(held);
    }
}

/// The coarsest coding of maps that leaves most of the bound to other losses, with a file of the whole head.
fn coding(trials: &mut Trials<'_>, bound: f64, name: &Path) -> Outcome<(BudgetCoding, Written)> {
    let (head, rig) = (trials.head, trials.rig);
    for (coding, share) in
        [(BudgetCoding::Jpeg, JPEG_SHARE), (BudgetCoding::Png, PNG_SHARE), (BudgetCoding::Png16, 1.0)]
    {
        let file = written(trials, head, rig, coding, name)?;
        if file.errors.largest() <= share * bound {
            return Ok((coding, file));
        }
        if coding == BudgetCoding::Png16 {
            return Err(no_file(bound, &file.errors));
        }
    }
    Err(Failure::job("there is no coding of maps"))
}

fn try_alone(
    trials: &mut Trials<'_>,
    subject: Subject,
    (unused, saved): (&Reduction, u64),
    names_held: &BTreeSet<usize>,
    bound: f64,
    file_bytes: impl Fn(u32) -> u64,
) -> Outcome<Tried> {
    let head = trials.head;
    let of_weights = device_bytes(head, subject, unused);
    let mut tried = Tried { subject, levels: Vec::new(), is_held: false };
    let is_unused = match subject {
        Subject::Shape(i) => unused.shapes.contains(&i),
        Subject::Zone(i) => unused.zones.contains(&i),
        Subject::Distribution(i) => unused.distributions.contains(&i),
        Subject::Part(i) => unused.parts.contains(&i),
        _ => false,
    };
    tried.is_held = match subject {
        Subject::Shape(i) => names_held.contains(&i),
        Subject::Part(i) => !may_go(head, i),
        _ => false,
    };
    for level in 1..=subject.levels(head) {
        let mut less = unused.clone();
        subject.leave_out(level, trials.hairs, &mut less);
        let file_bytes = file_bytes(level);
        // What goes in any case has an error only together with the rest.
        if is_unused || tried.is_held {
            let saves = match of_weights {
                Some(bytes) => bytes,
                None if is_unused => saved,
                None => 0,
            };
            tried.levels.push(Level { device_bytes: saves, file_bytes, errors: Errors::default() });
            break;
        }
        if !held(&less, head, trials.sequences).is_empty() {
            tried.is_held = true;
        }
        let errors = trials.error(&less, bound)?;
        let is_over = errors.largest() > bound;
        let saves = match of_weights {
            Some(bytes) => bytes,
            None => trials.saves(&less)?.saturating_sub(saved),
        };
        tried.levels.push(Level { device_bytes: saves, file_bytes, errors });
        if is_over {
            break;
        }
    }
    Ok(tried)
}

/// Steps of everything that may go, with what each adds to the step before.
fn steps(tried: &[Tried], bound: f64) -> Vec<Step> {
    let mut steps = Vec::new();
    for (subject, of) in tried.iter().enumerate().filter(|(_, t)| !t.is_held) {
        let mut before = (0, 0.0);
        for (i, level) in of.levels.iter().enumerate() {
            let error = level.errors.largest();
            if level.errors.each.is_empty() || error > bound {
                break;
            }
            let bytes = level.device_bytes + level.file_bytes;
            steps.push(Step {
                subject,
                level: i as u32 + 1,
                saves: bytes.saturating_sub(before.0),
                error: (error - before.1).max(0.0),
            });
            before = (bytes.max(before.0), error.max(before.1));
        }
    }
    steps
}

/// With what nothing moves any more after all these losses, such as a combination shape without one of its drivers.
fn with_idle(mut less: Reduction, scene: &Scene, sequences: &[Sequence]) -> Outcome<Reduction> {
    let names = less.names_alone(&scene.head);
    let (rig, _) = less.rig(&scene.head, &scene.rig, &needed_names(sequences));
    let mut uses = Use::default();
    for sequence in sequences {
        faces(&Evaluator::new(&names, &rig, sequence)?.0).iter().for_each(|face| uses.add(face));
    }
    let idle = uses.unused(&names, &rig);
    let left: Vec<usize> = (0..scene.head.shapes.len()).filter(|i| !less.shapes.contains(i)).collect();
    let before = less.shapes.clone();
    less.shapes.extend(idle.shapes.iter().filter_map(|i| left.get(*i)));
    let held = held(&less, &scene.head, sequences);
    less.shapes.retain(|shape| before.contains(shape) || !held.contains(shape));
    Ok(less)
}

fn reduced(trials: &mut Trials<'_>, less: &Reduction, coding: BudgetCoding, name: &Path) -> Outcome<Written> {
    let head = less.head(trials.head);
    let (rig, _) = less.rig(trials.head, trials.rig, &needed_names(trials.sequences));
    written(trials, &head, &rig, coding, name)
}
