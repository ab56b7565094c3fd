//! Makes `rig/src/skin/slab/table.json`: light through slabs of an index of 1.4, from photons.
//!
//! `cargo run --release -p rubor-rig --example slab_table > rig/src/skin/slab/table.json`, one minute on two cores.

use rubor_rig::skin::slab::SlabTable;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut table = SlabTable::build(1.4, 0.9, 16.0, [48, 19], 100_000, 1)?;
    // Noise of the walk is 0.001.
    table.rows.iter_mut().flatten().for_each(|v| *v = (*v * 1e5).round() / 1e5);
    println!("{}", serde_json::to_string(&table)?.replace("],[", "],\n["));
    Ok(())
}
