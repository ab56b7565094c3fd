//! The ladder of coarser surfaces of a head: triangles, error, time.
//!
//! ```text
//! cargo run --release -p rubor-assets --example levels -- [HEAD.glb]
//! ```

use std::path::Path;
use std::time::Instant;

use rubor_assets::convert::levels::levels;
use rubor_assets::import;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let file = std::env::args().nth(1).unwrap_or_else(|| "assets/head.glb".into());
    let head = import::gltf::read(Path::new(&file))?.head;
    let start = Instant::now();
    let ladder = levels(&head);
    let seconds = start.elapsed().as_secs_f64();
    println!(
        "{file}: {} triangles, {} points, {} shapes; {seconds:.2} s",
        head.mesh.triangles.len(),
        head.mesh.points.len(),
        head.shapes.len()
    );
    for level in &ladder {
        println!("{:6} triangles, {:7.3} mm", level.triangles.len(), 1e3 * level.error_metres);
    }
    Ok(())
}
