//! Photon walks, stored between runs, in the user's cache folder.

use rubor_rig::error::SkinError;
use rubor_rig::skin::medium::Medium;
use rubor_rig::skin::monte_carlo::{AlbedoTable, TABLE_MAX_ALBEDO};

use crate::error::{Failure, Outcome};
use crate::notes::Note;
use crate::output;

/// Walks of fewer photons are not stored: they take less than a second.
const WORTH_KEEPING: u64 = 100_000;
/// Seed of the walks.
const SEED: u64 = 1;

/// Media for which a table has an answer.
///
/// # Errors
/// One absorbs nothing, or so little that a walk would not end.
pub fn check(media: &[Medium; 3]) -> Result<(), SkinError> {
    for medium in media {
        let albedo = medium.albedo();
        if albedo > TABLE_MAX_ALBEDO {
            return Err(SkinError::new(
                "medium.albedo",
                albedo,
                "an albedo of at most 0.999 for a photon walk",
            ));
        }
    }
    Ok(())
}

/// The table of an anisotropy and an index, from the cache if it is there, and a note if it could not be kept.
///
/// # Errors
/// The walk's numbers are out of range.
pub fn table(anisotropy: f64, eta: f64, photons: u64) -> Outcome<(AlbedoTable, Option<Note>)> {
    let file = crate::cache::folder().map(|f| f.join(name(anisotropy, eta, photons)));
    if let Some(kept) = file.as_ref().and_then(|f| read(f, anisotropy, eta)) {
        return Ok((kept, None));
    }
    let table = AlbedoTable::build(anisotropy, eta, photons, SEED).map_err(Failure::input)?;
    if photons >= WORTH_KEEPING
        && let Some(file) = file
    {
        match keep(&file, &table) {
            // JSON may round the last digit: every run continues with the numbers in the file.
            Ok(()) => return Ok((read(&file, anisotropy, eta).unwrap_or(table), None)),
            // The result is valid all the same.
            Err(error) => {
                let note = Note::new("", format!("the photon walk was not kept: {error}"));
                return Ok((table, Some(note)));
            }
        }
    }
    Ok((table, None))
}

/// Everything that a walk depends on is in its file's name, and so is the version of the program.
fn name(anisotropy: f64, eta: f64, photons: u64) -> String {
    format!("walk-{}-g{anisotropy}-eta{eta}-{photons}-{SEED}.json", env!("CARGO_PKG_VERSION"))
}

/// A table that is complete and of the right medium; otherwise the walk is repeated.
fn read(file: &std::path::Path, anisotropy: f64, eta: f64) -> Option<AlbedoTable> {
    let table: AlbedoTable = serde_json::from_slice(&rubor_rig::limits::read(file).ok()?).ok()?;
    let walk = &table.result().walk;
    (walk.anisotropy == anisotropy && walk.eta == eta).then_some(table)
}

fn keep(file: &std::path::Path, table: &AlbedoTable) -> Outcome {
    if let Some(folder) = file.parent() {
        output::folder(folder)?;
    }
    output::write(file, &serde_json::to_vec(table).map_err(Failure::job)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_kept_table_reads_back_and_a_broken_or_other_one_does_not() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("made").join(name(0.0, 1.3, 640));
        let table = AlbedoTable::build(0.0, 1.3, 640, SEED).unwrap();
        keep(&file, &table).unwrap();
        let kept = read(&file, 0.0, 1.3).unwrap();
        // The writer also continues with the numbers in the file, because JSON may round the last digit.
        assert_eq!(read(&file, 0.0, 1.3).as_ref(), Some(&kept));
        let pairs = kept.result().walk.albedos.iter().zip(&table.result().walk.albedos);
        assert!(pairs.clone().count() > 4 && pairs.into_iter().all(|(a, b)| (a / b - 1.0).abs() < 1e-15));
        assert_eq!(read(&file, 0.0, 1.4), None);
        let whole = std::fs::read(&file).unwrap();
        std::fs::write(&file, &whole[..whole.len() / 2]).unwrap();
        assert_eq!(read(&file, 0.0, 1.3), None);
        let names = [name(0.0, 1.3, 640), name(0.8, 1.3, 640), name(0.0, 1.4, 640), name(0.0, 1.3, 641)];
        assert!((1..4).all(|i| !names[..i].contains(&names[i])), "{names:?}");
    }
}
