//! What was found, in numbers and words.

use std::collections::BTreeSet;

use rubor_rig::head::Head;
use rubor_rig::reduce::{Reduction, RigLoss};

use super::combine::Step;
use super::file::Written;
use super::items::{Subject, Use, hairs_at, pixels};
use super::trial::{Trials, shots};
use super::{Budget, Level, Options, Scene, Tried, needed_names};
use crate::error::Outcome;
use crate::notes::{Note, summed};
use crate::report::{
    BudgetCoding, BudgetFate, BudgetFrame, BudgetItem, BudgetReport, BudgetSequence, BudgetTotals, PassCost,
};
use crate::watch::Watch;

/// Frames that raise the clock of a graphics card.
const WAKING_FRAMES: u32 = 300;

pub(super) struct Found<'a> {
    pub(super) scene: &'a Scene,
    pub(super) options: &'a Options,
    pub(super) uses: Use,
    pub(super) tried: Vec<Tried>,
    /// What no frame uses.
    pub(super) unused: Reduction,
    pub(super) taken: Vec<Step>,
    /// All that goes.
    pub(super) gone: Reduction,
    pub(super) coding: BudgetCoding,
    pub(super) whole: Written,
    pub(super) file: Written,
    pub(super) notes: Vec<Note>,
}

impl Found<'_> {
    pub(super) fn budget(mut self, trials: &mut Trials<'_>, watch: &mut dyn Watch) -> Outcome<Budget> {
        let scene = self.scene;
        let is_loss = !self.gone.is_empty();
        // Nothing that may go: the head stays as it is.
        trials.studio.set_heads([if is_loss { &self.file.head } else { &scene.head }])?;
        let (bytes, hairs) = (trials.studio.head_bytes(), trials.studio.hairs());
        let mut whole = totals(&scene.head, self.whole.bytes.len(), trials.device_bytes, trials.hairs);
        let mut reduced = totals(&self.file.head, self.file.bytes.len(), bytes, hairs);
        [whole.frame_ms, reduced.frame_ms] = self.times(trials, watch)?;
        let (_, loss) = self.gone.rig(&scene.head, &scene.rig, &needed_names(trials.sequences));
        self.notes.extend(words(&loss).into_iter().map(|message| Note::new("rig", message)));
        self.notes.extend(self.file.notes.iter().map(|message| Note::new("reduced head", message)));
        let worst = &trials.looks[self.file.errors.worst()];
        let of_sequence = |(i, (file, sequence)): (usize, &(std::path::PathBuf, _))| BudgetSequence {
            file: file.clone(),
            frames: rubor_rig::timeline::Sequence::frame_count(sequence),
            looked_at: trials.looks.iter().filter(|l| l.sequence == i).map(|l| l.frame + 1).collect(),
        };
        let report = BudgetReport {
            adapter: trials.studio.adapter(),
            settings: self.options.settings.first().cloned().unwrap_or_default(),
            head: scene.head.name.clone(),
            input_bytes: scene.input_bytes,
            sequences: scene.sequences.iter().enumerate().map(of_sequence).collect(),
            bound: self.options.bound,
            whole,
            reduced,
            error: self.file.errors.summed(),
            worst: BudgetFrame {
                sequence: scene.sequences[worst.sequence].0.clone(),
                frame: worst.frame + 1,
            },
            coding_error: self.whole.errors.summed(),
            coding: self.coding,
            items: self.items(trials),
            written: None,
            notes: summed(&self.notes),
        };
        Ok(Budget { report, file: is_loss.then_some(self.file.bytes) })
    }

    fn items(&self, trials: &Trials<'_>) -> Vec<BudgetItem> {
        let mut items: Vec<BudgetItem> = (0..self.tried.len()).map(|i| self.item(i, trials)).collect();
        let bytes = |item: &BudgetItem| item.device_bytes + item.file_bytes;
        items.sort_by(|a, b| {
            (a.fate.is_loss().cmp(&b.fate.is_loss()).reverse())
                .then(a.fate.cmp(&b.fate))
                .then(bytes(b).cmp(&bytes(a)))
                .then_with(|| (a.kind, &a.name).cmp(&(b.kind, &b.name)))
        });
        items
    }

    fn item(&self, index: usize, trials: &Trials<'_>) -> BudgetItem {
        let Tried { subject, levels, is_held } = &self.tried[index];
        let head = &self.scene.head;
        let chosen = self.taken.iter().filter(|s| s.subject == index).map(|s| s.level).max().unwrap_or(0);
        let is_in = |all: &BTreeSet<usize>, i: &usize| all.contains(i);
        let (is_gone, is_unused) = match subject {
            Subject::Shape(i) => (is_in(&self.gone.shapes, i), is_in(&self.unused.shapes, i)),
            Subject::Distribution(i) => {
                (is_in(&self.gone.distributions, i), is_in(&self.unused.distributions, i))
            }
            Subject::Zone(i) => (is_in(&self.gone.zones, i), is_in(&self.unused.zones, i)),
            Subject::Part(i) => (is_in(&self.gone.parts, i), is_in(&self.unused.parts, i)),
            Subject::Map(_) | Subject::Hairs => (false, false),
        };
        let fate = match subject {
            _ if is_unused => BudgetFate::Unused,
            _ if is_gone => BudgetFate::Gone,
            Subject::Map(_) | Subject::Hairs if chosen > 0 => BudgetFate::Smaller,
            _ if *is_held => BudgetFate::Held,
            _ => BudgetFate::Needed,
        };
        let level: Option<&Level> = levels.get(chosen.saturating_sub(1) as usize);
        let size = |of: &Head| match subject {
            Subject::Map(kind) => kind.size(&of.maps, &of.authored),
            _ => None,
        };
        let hairs = |level: u32| [hairs_at(level, trials.hairs), 1];
        let (from, to) = match subject {
            Subject::Hairs => (Some(hairs(0)), Some(hairs(chosen))),
            _ => (size(head), size(&self.file.head).or(size(head).map(|_| [0, 0]))),
        };
        let height = |look: &super::Look| self.options.settings[look.sequence].output.size[1];
        let moves = |i: usize| {
            trials.looks.iter().map(|look| pixels(&head.shapes[i], i, look, height(look))).fold(0.0, f64::max)
        };
        BudgetItem {
            kind: subject.kind(),
            name: subject.name(head),
            fate,
            most_weight: self.uses.of(*subject).map(f64::from),
            moves_pixels: match subject {
                Subject::Shape(i) => Some(moves(*i)),
                _ => None,
            },
            device_bytes: level.map_or(0, |l| l.device_bytes),
            file_bytes: level.map_or(0, |l| l.file_bytes),
            error: level.filter(|l| !l.errors.each.is_empty()).map(|l| l.errors.summed()),
            from,
            to,
        }
    }

    /// Milliseconds of a frame of the whole and the reduced head, taking turns.
    fn times(&self, trials: &mut Trials<'_>, watch: &mut dyn Watch) -> Outcome<[Option<f64>; 2]> {
        let Some(timing) = self.options.timing.filter(|_| trials.studio.has_timestamps()) else {
            return Ok([None; 2]);
        };
        let whole: Vec<_> = trials.looks.iter().map(|look| look.shot.clone()).collect();
        let reduced = shots(&self.file.head, &self.file.rig, trials.sequences, trials.looks)?;
        let heads = [(&self.scene.head, whole), (&self.file.head, reduced)];
        let mut times = [Vec::new(), Vec::new()];
        watch.begin("rounds of timing", u64::from(timing.rounds));
        for round in 0..timing.rounds {
            for ((head, shots), times) in heads.iter().zip(&mut times) {
                trials.studio.set_heads([*head])?;
                for (look, shot) in trials.looks.iter().zip(shots) {
                    let settings = &self.options.settings[look.sequence];
                    let is_first = round == 0 && times.is_empty() && !trials.studio.is_software();
                    let warm_up = if is_first { WAKING_FRAMES } else { timing.warm_up };
                    let shot = std::slice::from_ref(shot);
                    let frames = trials.studio.measure(shot, 0.0, settings, warm_up, timing.frames)?;
                    times.extend(frames.iter().map(|f| f.frame_ms));
                }
            }
            watch.step();
        }
        watch.end();
        Ok(times.map(|ms| (!ms.is_empty()).then(|| PassCost::of("frame", 1, ms).median)))
    }
}

fn totals(head: &Head, file_bytes: usize, device_bytes: u64, hairs: u32) -> BudgetTotals {
    BudgetTotals {
        device_bytes,
        file_bytes: file_bytes as u64,
        frame_ms: None,
        points: head.mesh.points.len(),
        triangles: head.mesh.triangles.len(),
        shapes: head.shapes.len(),
        distributions: head.maps.distributions.len(),
        zones: head.maps.zones.len(),
        wrinkle_maps: head.maps.wrinkle_slopes.len(),
        hairs,
    }
}

/// What became of a rig.
fn words(loss: &RigLoss) -> Vec<String> {
    let mut all = Vec::new();
    let mut tell = |names: Vec<String>, what: &str| {
        if !names.is_empty() {
            all.push(format!("{}: {what}", names.join(", ")));
        }
    };
    tell(loss.emptied.clone(), "nothing of these is left, so the rig of the reduced head is without them");
    tell(
        loss.empty.clone(),
        "nothing of these is left; they stay as names, since a sequence has tracks of them",
    );
    tell(
        loss.lessened.clone(),
        "these lost shapes, wrinkles or blood that no frame shows: elsewhere they are not whole",
    );
    tell(loss.combinations.clone(), "these combination shapes went");
    let inbetweens = loss.inbetweens.iter().map(|(shape, target)| format!("{target} of {shape}"));
    tell(inbetweens.collect(), "these in-betweens went");
    all
}
