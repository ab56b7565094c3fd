use std::f64::consts::TAU;

use super::*;

/// A mesh under construction: quads of a grid with a place and a texture coordinate for each corner.
#[derive(Default)]
struct Grid {
    points: Vec<Vec3>,
    vertices: Vec<Vertex>,
    triangles: Vec<[u32; 3]>,
}

impl Grid {
    fn skin(&self) -> Skin<'_> {
        Skin { points: &self.points, vertices: &self.vertices, triangles: &self.triangles }
    }

    fn vertex(&mut self, point: u32, uv: [f64; 2]) -> u32 {
        self.vertices.push(Vertex { point, uv: Vec2::new(uv[0] as f32, uv[1] as f32) });
        self.vertices.len() as u32 - 1
    }

    fn quad(&mut self, [a, b, c, d]: [u32; 4]) {
        self.triangles.push([a, b, c]);
        self.triangles.push([a, c, d]);
    }

    /// A place in millimetres.
    fn at(&self, place: &Place) -> DVec3 {
        let skin = self.skin();
        let t = place.triangle as usize;
        (0..3).map(|k| f64::from(place.barycentric[k]) * skin.point(t, k)).sum()
    }
}

const RADIUS_MM: f64 = 20.0;
const HEIGHT_MM: f64 = 60.0;
const SIDES: u32 = 64;

/// A tube along y whose seam is at angle 0; u is the angle.
fn tube() -> Grid {
    let mut grid = Grid::default();
    let rows = 12;
    for y in 0..=rows {
        for i in 0..SIDES {
            let a = TAU * f64::from(i) / f64::from(SIDES);
            let p = DVec3::new(
                RADIUS_MM * a.cos(),
                HEIGHT_MM * f64::from(y) / f64::from(rows),
                RADIUS_MM * a.sin(),
            );
            grid.points.push((1e-3 * p).as_vec3());
        }
    }
    for y in 0..=rows {
        for i in 0..=SIDES {
            grid.vertex(
                y * SIDES + i % SIDES,
                [f64::from(i) / f64::from(SIDES), f64::from(y) / f64::from(rows)],
            );
        }
    }
    for y in 0..rows {
        for i in 0..SIDES {
            let v = |x: u32, y: u32| y * (SIDES + 1) + x;
            grid.quad([v(i, y), v(i + 1, y), v(i + 1, y + 1), v(i, y + 1)]);
        }
    }
    grid
}

#[test]
fn margins_continue_over_a_seam_and_are_reflected_at_an_open_border() {
    let tube = tube();
    let reach_mm = 8.0;
    let atlas = Atlas::new(&tube.skin(), 256, reach_mm).expect("it is laid out");
    assert_eq!((atlas.islands, atlas.overlap), (1, 0.0));
    assert!(f64::from(atlas.margin) * f64::from(atlas.mm_per_texel) >= reach_mm, "{}", atlas.margin);
    let [sx, sy, x0, y0] = atlas.texel_from_uv[0].map(f64::from);
    let (mut over, mut reflected) = (0, 0);
    for (i, place) in atlas.places.iter().enumerate() {
        let p = DVec2::new((i % 256) as f64 + 0.5, (i / 256) as f64 + 0.5);
        let (u, v) = ((p.x - x0) / sx, (p.y - y0) / sy);
        let Some(place) = place else { continue };
        let beside = !(0.0..=1.0).contains(&u);
        let beyond = !(0.0..=1.0).contains(&v);
        let v = if v < 0.0 {
            -v
        } else if v > 1.0 {
            2.0 - v
        } else {
            v
        };
        // Around the corners of the sheet the nearest place is a corner, and so is the walk's start.
        let a = TAU * u;
        let expected = DVec3::new(RADIUS_MM * a.cos(), HEIGHT_MM * v, RADIUS_MM * a.sin());
        let error = tube.at(place).distance(expected);
        // A chord of a 64th of the circle is 0.024 mm off it.
        assert!(error < 0.05, "{u} {v}: {error} mm");
        over += usize::from(beside);
        reflected += usize::from(beyond && !beside);
    }
    assert!(over > 4000 && reflected > 4000, "{over} {reflected}");
}

/// A flat sheet of two halves with texture coordinates from a rule.
fn halves(uv: impl Fn(f64, f64, bool) -> [f64; 2]) -> Grid {
    let mut grid = Grid::default();
    for y in 0..=8 {
        for x in 0..=8 {
            grid.points.push(1e-3 * Vec3::new(10.0 * x as f32, 10.0 * y as f32, 0.0));
        }
    }
    for (half, columns) in [(false, 0..=4u32), (true, 4..=8)] {
        let first = grid.vertices.len() as u32;
        for y in 0..=8 {
            for x in columns.clone() {
                grid.vertex(y * 9 + x, uv(f64::from(x) / 8.0, f64::from(y) / 8.0, half));
            }
        }
        for y in 0..8 {
            for x in 0..4 {
                let v = |x: u32, y: u32| first + y * 5 + x;
                grid.quad([v(x, y), v(x + 1, y), v(x + 1, y + 1), v(x, y + 1)]);
            }
        }
    }
    grid
}

/// Every place of the sheet, and how far a texel's place is from that of its neighbour.
fn check_sheet(grid: &Grid, islands: usize) {
    let atlas = Atlas::new(&grid.skin(), 128, 4.0).expect("it is laid out");
    assert_eq!((atlas.islands, atlas.overlap), (islands, 0.0));
    let skin = grid.skin();
    // Whether a texel is inside of an island and no margin: its place lies there in the texture.
    let is_inside = |x: usize, y: usize, place: &Place| {
        let t = place.triangle as usize;
        let uv: DVec2 = (0..3).map(|k| f64::from(place.barycentric[k]) * skin.uv(t, k)).sum();
        let [sx, sy, ox, oy] = atlas.texel_from_uv[t].map(f64::from);
        let at = DVec2::new(uv.x * sx + ox, uv.y * sy + oy);
        (at - DVec2::new(x as f64 + 0.5, y as f64 + 0.5)).abs().max_element() < 0.6
    };
    for y in 0..128 {
        for x in 0..127 {
            let [a, b] = [0, 1].map(|d| atlas.places[y * 128 + x + d].as_ref());
            let (Some(a), Some(b)) = (a, b) else { continue };
            // Margins of two islands meet without being neighbours.
            if !is_inside(x, y, a) && !is_inside(x + 1, y, b) {
                continue;
            }
            let step = grid.at(a).distance(grid.at(b));
            // Texels are as wide on the skin as it says, across seams too; walks from the corner of an island turn.
            assert!(step < 1.6 * f64::from(atlas.mm_per_texel), "{x} {y}: {step} of {}", atlas.mm_per_texel);
        }
    }
}

#[test]
fn mirrored_halves_and_tiles_are_islands_like_others() {
    // Both halves on the same texels, mirrored about the seam, which they share.
    let mirrored = halves(|x, y, _| [0.9 * (x - 0.5).abs(), y]);
    let islands = Islands::new(&mirrored.skin()).expect("it has coordinates");
    assert_eq!((islands.count, islands.mirrored()), (2, 1));
    check_sheet(&mirrored, 2);
    assert!(shared_texels(&mirrored.skin(), 64) > 0.95, "each texel has two places");
    // The second half in another tile and of another size there.
    let tiles = halves(|x, y, second| if second { [1.0 + x * 0.3, 0.2 * y] } else { [x, y] });
    assert_eq!(Islands::new(&tiles.skin()).expect("it has coordinates").mirrored(), 0);
    check_sheet(&tiles, 2);
    assert_eq!(shared_texels(&tiles.skin(), 64), 0.0);
}

#[test]
fn what_covers_itself_is_counted() {
    // Both halves on the same texels with the same winding, but joined along an edge: a spiral.
    let mut spiral = halves(|x, y, second| if second { [x - 0.5, y] } else { [x, y] });
    assert_eq!(Atlas::new(&spiral.skin(), 64, 2.0).expect("two islands").overlap, 0.0);
    // Columns of a strip that winds: the last lies on the first.
    for v in &mut spiral.vertices {
        let x = spiral.points[v.point as usize].x * 1e3 / 80.0;
        let y = spiral.points[v.point as usize].y * 1e3 / 80.0;
        let (angle, radius) = (1.25 * std::f32::consts::TAU * x, 1.0 + y);
        v.uv = Vec2::new(0.5 + 0.2 * radius * angle.cos(), 0.5 + 0.2 * radius * angle.sin());
    }
    let atlas = Atlas::new(&spiral.skin(), 64, 2.0).expect("it is laid out");
    assert!(atlas.islands == 1 && atlas.overlap > 0.1, "{} {}", atlas.islands, atlas.overlap);
}

#[test]
fn bad_skin_is_refused_with_its_reason_and_flat_triangles_do_no_harm() {
    let none = Skin { points: &[], vertices: &[], triangles: &[] };
    assert_eq!(Atlas::new(&none, 64, 4.0), Err(AtlasError::NoSkin));
    let bare = halves(|_, _, _| [0.5, 0.5]);
    assert_eq!(Atlas::new(&bare.skin(), 64, 4.0), Err(AtlasError::NoCoordinates { percent: 100.0 }));
    let mut nan = halves(|x, y, _| [x, y]);
    nan.points[3].y = f32::NAN;
    assert!(matches!(Atlas::new(&nan.skin(), 64, 4.0), Err(AtlasError::NotFinite { .. })));
    // Without area on the skin, or in the texture.
    let mut flat = halves(|x, y, _| [x, y]);
    let corner = flat.vertex(0, [0.0, 0.0]);
    flat.triangles.push([corner, corner, corner]);
    let beside = flat.vertex(80, [1.0, 1.0]);
    flat.triangles.push([beside, flat.triangles[5][0], flat.triangles[5][0]]);
    let atlas = Atlas::new(&flat.skin(), 64, 500.0).expect("it is laid out");
    assert_eq!(atlas.margin, 4, "a margin takes a sixteenth at most");
    for place in atlas.places.iter().flatten() {
        let sum: f32 = place.barycentric.iter().sum();
        assert!((sum - 1.0).abs() < 1e-5, "{place:?}");
    }
}
