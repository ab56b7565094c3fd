//! Mutates seeds without instrumentation, on all cores, and reports what panics, what takes long and how much was run.
//!
//! `cargo run --release -- TARGET|all [--seconds N] [--seed N]`

use std::collections::HashSet;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Mutex;
use std::time::{Duration, Instant};

use rubor_fuzz::mutate::{Random, Stock, dictionary};
use rubor_fuzz::{TARGETS, Target};

/// Longest time of one input.
const LONGEST: Duration = Duration::from_secs(10);
/// Inputs that are kept to go on from.
const MOST_KEPT: usize = 4096;
/// Kinds of errors and notes that are told apart.
const MOST_KINDS: usize = 1 << 16;
/// Longest input that is kept, bytes.
const LARGEST: usize = 1 << 16;

#[derive(Default)]
struct Found {
    executions: u64,
    refused: u64,
    longest: Duration,
    /// Kinds of errors and notes.
    messages: usize,
    faults: Vec<String>,
}

/// A message without its numbers and without names in quotes; of what was found only two words, as that has no end of kinds.
fn kind(message: &str) -> String {
    let plain = |text: &str| -> String {
        let mut quoted = false;
        let mut out = String::new();
        for c in text.chars().take(300) {
            match c {
                '"' => quoted = !quoted,
                c if quoted || c.is_ascii_digit() => {}
                c => out.push(c),
            }
        }
        out
    };
    let found = message.split_once("found ").and_then(|(_, rest)| rest.rsplit_once(", expected "));
    let Some((found, expected)) = found else { return plain(message) };
    let is_word = |w: &&str| w.chars().all(char::is_alphabetic);
    let words: Vec<&str> = found.split_whitespace().take_while(is_word).take(2).collect();
    format!("{} / {}", words.join(" "), plain(expected))
}

fn fuzz(target: &Target, seconds: f64, seed: u64) -> Found {
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let found = Mutex::new(Found::default());
    let known: Mutex<HashSet<String>> = Mutex::default();
    let seeds = (target.seeds)();
    let seed_count = seeds.len();
    let kept = Mutex::new(seeds);
    let words = dictionary(target.dictionary);
    let start = Instant::now();
    std::thread::scope(|scope| {
        for thread in 0..threads {
            let (found, known, kept, words) = (&found, &known, &kept, &words);
            scope.spawn(move || {
                let mut random = Random::new(seed.wrapping_mul(1_000_003) + thread as u64);
                let mut mine = Found::default();
                // Every seed is read as it is before any is changed.
                let mut seeds = if thread == 0 { (target.seeds)() } else { Vec::new() };
                while start.elapsed().as_secs_f64() < seconds {
                    let input = seeds.pop().unwrap_or_else(|| {
                        let (mut input, other) = {
                            let kept = kept.lock().expect("no thread panics with it");
                            // Half of the time a seed: most of the others are refused.
                            let among = if random.below(2) == 0 { seed_count } else { kept.len() };
                            (kept[random.below(among)].clone(), kept[random.below(seed_count)].clone())
                        };
                        let stock = Stock { words, other: &other };
                        for _ in 0..=random.below(2) * random.below(4) {
                            (target.mutate)(&mut input, &stock, &mut random);
                        }
                        input
                    });
                    let began = Instant::now();
                    let result = catch_unwind(AssertUnwindSafe(|| (target.run)(&input)));
                    let took = began.elapsed();
                    mine.executions += 1;
                    mine.longest = mine.longest.max(took);
                    if took > LONGEST {
                        mine.faults.push(store(target, &input, "slow"));
                    }
                    let said = match result {
                        Err(_) => {
                            mine.faults.push(store(target, &input, "panic"));
                            continue;
                        }
                        Ok(Ok(notes)) => notes,
                        Ok(Err(message)) => {
                            mine.refused += 1;
                            vec![message]
                        }
                    };
                    let is_new = {
                        let mut known = known.lock().expect("no thread panics with it");
                        let room = MOST_KINDS.saturating_sub(known.len());
                        said.iter().take(room).fold(false, |is_new, said| known.insert(kind(said)) | is_new)
                    };
                    let mut kept = kept.lock().expect("no thread panics with it");
                    if is_new && input.len() < LARGEST && kept.len() < MOST_KEPT {
                        kept.push(input);
                    }
                }
                let mut all = found.lock().expect("no thread panics with it");
                all.executions += mine.executions;
                all.refused += mine.refused;
                all.longest = all.longest.max(mine.longest);
                all.faults.extend(mine.faults);
            });
        }
    });
    let mut found = found.into_inner().expect("no thread panics with it");
    found.messages = known.into_inner().expect("no thread panics with it").len();
    found
}

/// Writes an input that failed; its name tells where.
fn store(target: &Target, input: &[u8], why: &str) -> String {
    let hash = input
        .iter()
        .fold(0xcbf2_9ce4_8422_2325_u64, |h, b| (h ^ u64::from(*b)).wrapping_mul(0x100_0000_01b3));
    let folder = std::path::Path::new("artifacts").join(target.name);
    let path = folder.join(format!("{why}-{hash:016x}"));
    if let Err(e) = std::fs::create_dir_all(&folder).and_then(|()| std::fs::write(&path, input)) {
        eprintln!("{}: {e}", path.display());
    }
    path.display().to_string()
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let after = |flag: &str| arguments.iter().position(|a| a == flag).and_then(|i| arguments.get(i + 1));
    let seconds: f64 = after("--seconds").and_then(|s| s.parse().ok()).unwrap_or(10.0);
    let seed: u64 = after("--seed").and_then(|s| s.parse().ok()).unwrap_or(1);
    let name = arguments.first().map_or("all", String::as_str);
    // A file is read again as it is.
    if let Some(file) = after("--file") {
        let target = rubor_fuzz::target(name).expect("a target of that name");
        let input = std::fs::read(file).expect("the file");
        println!("{:?}", (target.run)(&input));
        return;
    }
    if let Some(folder) = after("--write-seeds") {
        let target = rubor_fuzz::target(name).expect("a target of that name");
        for (i, seed) in (target.seeds)().iter().enumerate() {
            std::fs::write(std::path::Path::new(folder).join(format!("seed-{i:03}")), seed).expect("a seed");
        }
        return;
    }
    let chosen: Vec<&Target> = TARGETS.iter().filter(|t| name == "all" || t.name == name).collect();
    assert!(!chosen.is_empty(), "found {name:?}, expected all or one of {:?}", TARGETS.map_names());
    std::panic::set_hook(Box::new(|info| {
        // Decoders of other crates whose panics the reader turns into errors come here too.
        if std::env::var_os("RUBOR_FUZZ_PANICS").is_some() {
            eprintln!("{info}");
        }
    }));
    println!("| target | executions | refused | kinds of messages | longest, ms | faults |");
    println!("| --- | --- | --- | --- | --- | --- |");
    let (mut executions, mut faults) = (0, Vec::new());
    for target in chosen {
        let found = fuzz(target, seconds, seed);
        let share = 100 * found.refused / found.executions.max(1);
        let (messages, longest) = (found.messages, found.longest.as_millis());
        println!(
            "| {} | {} | {share} % | {messages} | {longest} | {} |",
            target.name,
            found.executions,
            found.faults.len()
        );
        executions += found.executions;
        faults.extend(found.faults);
    }
    println!("\n{executions} executions, {} faults", faults.len());
    if !faults.is_empty() {
        faults.truncate(20);
        eprintln!("{}", faults.join("\n"));
        std::process::exit(1);
    }
}

trait Names {
    fn map_names(&self) -> Vec<&'static str>;
}

impl Names for [Target] {
    fn map_names(&self) -> Vec<&'static str> {
        self.iter().map(|t| t.name).collect()
    }
}
