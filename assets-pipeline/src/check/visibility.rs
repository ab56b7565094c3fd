//! Why a wrinkle zone or a hemoglobin distribution does not show.
//!
//! A zone shows where slope x mask x weight is not 0 on skin; a distribution where it differs from the neutral. The
//! first factor that is 0 is the reason.

use glam::Vec2;
use rubor_rig::evaluate::Evaluator;
use rubor_rig::expression::Rig;
use rubor_rig::head::{Head, Material};
use rubor_rig::map::Map;
use rubor_rig::names::{Resolver, nearest};

use super::{Finding, list};

/// Slopes below this are 0.6 degrees of tilt: they are invisible.
const LEAST_SLOPE: f32 = 0.01;
/// Weights and mask values below this show nothing in 8 bits.
const LEAST_WEIGHT: f32 = 1.0 / 255.0;
/// Change of the hemoglobin fraction that shifts skin by less than half a step of an 8-bit colour.
const LEAST_BLOOD: f32 = 2e-4;

/// The maps that could show, and a performance if there is one.
pub struct Scene<'a> {
    /// The head.
    pub head: &'a Head,
    /// The rig that drives it.
    pub rig: &'a Rig,
    /// Weights over time; without it only the rig is asked.
    pub evaluator: Option<&'a Evaluator>,
}

/// One finding a zone and a distribution that does not show, with the reason.
pub fn check(scene: &Scene<'_>) -> Vec<Finding> {
    let head = scene.head;
    let mut findings = Vec::new();
    if head.maps.zones.is_empty() && head.maps.distributions.is_empty() {
        return findings;
    }
    let places = skin_places(head);
    if places.is_empty() {
        let message = "no part is skin: neither wrinkles nor blood show anywhere";
        return vec![Finding::warning("maps", message).fix("name the material of the face skin")];
    }
    if head.maps.melanin.is_none() || head.maps.hemoglobin.is_none() {
        let missing = if head.maps.melanin.is_none() { "melanin" } else { "hemoglobin" };
        let message =
            format!("there is no {missing} map: skin gets one plain colour without blood and wrinkles");
        return vec![
            Finding::warning("maps", message)
                .fix("import the head again: `rubor import` makes maps for heads without melanin"),
        ];
    }
    let reach = Reach::new(scene);
    let mut idle: [Vec<String>; 2] = Default::default();
    let mut put = |kind: usize, name: &str, reason: Option<Reason>| match reason {
        None => {}
        Some(Reason::Wrong(why, fix)) => {
            let at = format!("{} {name:?}", ["zone", "distribution"][kind]);
            findings.push(Finding::warning(at, why).fix(fix));
        }
        Some(Reason::Idle(by)) => idle[kind].push(format!("{name} ({by})")),
    };
    for (i, zone) in head.maps.zones.iter().enumerate() {
        put(0, &zone.name, zone_reason(head, i, &places).or_else(|| reach.zone(i)));
    }
    for (i, distribution) in head.maps.distributions.iter().enumerate() {
        put(1, &distribution.name, distribution_reason(head, i, &places).or_else(|| reach.distribution(i)));
    }
    for (kind, names) in ["wrinkle zones", "distributions"].into_iter().zip(&idle) {
        if !names.is_empty() {
            let message = format!(
                "the sequence never reaches {} {kind}, as what raises them has no weight: {}",
                names.len(),
                names.join(", ")
            );
            findings.push(Finding::note(kind, message).fix("key what stands in brackets"));
        }
    }
    if let Some(evaluator) = scene.evaluator.filter(|e| step(e) > 1) {
        let (count, step) = (evaluator.frame_count(), step(evaluator));
        let message =
            format!("of {count} frames one in {step} was looked at: what shows for less may be missed above");
        findings.push(Finding::note("sequence", message));
    }
    findings
}

/// Why something does not show.
enum Reason {
    /// Why, and what helps.
    Wrong(String, String),
    /// The sequence gives no weight to these expressions and states.
    Idle(String),
}

/// Texture coordinates of corners and middles of skin triangles.
fn skin_places(head: &Head) -> Vec<Vec2> {
    let mesh = &head.mesh;
    let skin = mesh.parts.iter().filter(|p| p.material == Material::Skin);
    let triangles = skin.flat_map(|p| &mesh.triangles[p.triangles.start as usize..p.triangles.end as usize]);
    triangles
        .flat_map(|t| {
            let [a, b, c] = t.map(|v| mesh.vertices[v as usize].uv);
            [a, (a + b + c) / 3.0]
        })
        .collect()
}

fn most(values: impl Iterator<Item = f32>) -> f32 {
    values.fold(0.0, f32::max)
}

fn zone_reason(head: &Head, index: usize, places: &[Vec2]) -> Option<Reason> {
    let zone = &head.maps.zones[index];
    let Some(slopes) = head.maps.wrinkle_slopes.get(zone.wrinkle_map as usize) else {
        let why = format!("its wrinkle map {} is missing", zone.wrinkle_map);
        return Some(Reason::Wrong(why, "import the head with its wrinkle maps".into()));
    };
    if most(zone.mask.values.iter().copied()) < LEAST_WEIGHT {
        let why = "its mask is black: it covers nothing";
        return Some(Reason::Wrong(why.into(), "paint the mask where the zone is".into()));
    }
    let mask = |uv: &Vec2| zone.mask.sample(uv.x, uv.y, 0);
    if most(places.iter().map(mask)) < LEAST_WEIGHT {
        let why = "its mask covers only texels that no skin uses";
        return Some(Reason::Wrong(why.into(), "paint the mask in the texture layout of this head".into()));
    }
    let slope = |map: &Map, uv: &Vec2| map.sample(uv.x, uv.y, 0).hypot(map.sample(uv.x, uv.y, 1));
    // Wrinkles are finer than triangles: texels under the mask count, not only corners.
    let under = (0..slopes.height).flat_map(|y| (0..slopes.width).map(move |x| (x, y))).map(|(x, y)| {
        let uv = Vec2::new((x as f32 + 0.5) / slopes.width as f32, (y as f32 + 0.5) / slopes.height as f32);
        if mask(&uv) >= LEAST_WEIGHT { slope(slopes, &uv) } else { 0.0 }
    });
    let strongest = most(under);
    (strongest < LEAST_SLOPE).then(|| {
        let why =
            format!("strength 0: the wrinkle map is flat under its mask (steepest slope {strongest:.4})");
        Reason::Wrong(why, "use a wrinkle map whose slopes lie under the mask".into())
    })
}

fn distribution_reason(head: &Head, index: usize, places: &[Vec2]) -> Option<Reason> {
    let maps = &head.maps;
    let distribution = &maps.distributions[index];
    let (Some(neutral), Some(mean)) = (&maps.hemoglobin, &maps.hemoglobin_mean) else {
        let why = "there is no hemoglobin mean map, which distributions are relative to";
        return Some(Reason::Wrong(
            why.into(),
            "`rubor maps hemoglobin` makes it from the neutral map".into(),
        ));
    };
    let change = |uv: &Vec2| {
        let at = |map: &Map| map.sample(uv.x, uv.y, 0);
        (at(&distribution.bias) - at(mean) + (at(&distribution.scale) - 1.0) * (at(neutral) - at(mean))).abs()
    };
    let largest = most(places.iter().map(change));
    (largest < LEAST_BLOOD).then(|| {
        let why = format!("it is the neutral one: hemoglobin changes by {largest:.5} at most");
        Reason::Wrong(why, "measure it from another state than the neutral".into())
    })
}

/// Which weights get where.
struct Reach<'a> {
    scene: &'a Scene<'a>,
    /// Strongest weight over the performance; of zones and distributions.
    reached: Option<(Vec<f32>, Vec<f32>)>,
}

/// An expression or state and what it asks for.
struct Ask<'a> {
    name: &'a str,
    weight: f32,
}

impl<'a> Reach<'a> {
    fn new(scene: &'a Scene<'a>) -> Self {
        let reached = scene.evaluator.map(|evaluator| {
            let maps = &scene.head.maps;
            let mut zones = vec![0.0_f32; maps.zones.len()];
            let mut distributions = vec![0.0_f32; maps.distributions.len()];
            for time_s in looked_at(evaluator) {
                let face = evaluator.face_at(time_s);
                zones.iter_mut().zip(&face.zones).for_each(|(m, w)| *m = m.max(*w));
                distributions.iter_mut().zip(&face.distributions).for_each(|(m, w)| *m = m.max(*w));
            }
            (zones, distributions)
        });
        Self { scene, reached }
    }

    fn zone(&self, index: usize) -> Option<Reason> {
        let resolver = Resolver::zones(self.scene.head);
        let mut asks = Vec::new();
        let mut unknown = Vec::new();
        for (name, expression) in &self.scene.rig.expressions {
            for (zone, weight) in &expression.wrinkles {
                let targets = resolver.resolve(zone);
                if targets.is_empty() {
                    unknown.push(zone.as_str());
                }
                for target in targets.iter().filter(|t| t.index as usize == index) {
                    asks.push(Ask { name, weight: weight * target.factor });
                }
            }
        }
        let name = &self.scene.head.maps.zones[index].name;
        self.reason(name, "wrinkles", &asks, unknown, self.reached.as_ref().map(|r| r.0[index]))
    }

    fn distribution(&self, index: usize) -> Option<Reason> {
        let resolver = Resolver::distributions(self.scene.head);
        let rig = self.scene.rig;
        let mut asks = Vec::new();
        let mut unknown = Vec::new();
        let expressions = rig.expressions.iter().map(|(n, e)| (n, &e.hemoglobin));
        let states = rig.states.iter().map(|(n, s)| (n, &s.hemoglobin));
        let fallbacks = rig.states.iter().filter_map(|(n, s)| Some((n, &s.fallback.as_ref()?.hemoglobin)));
        for (name, weights) in expressions.chain(states).chain(fallbacks) {
            for (distribution, weight) in weights {
                let targets = resolver.resolve(distribution);
                if targets.is_empty() {
                    unknown.push(distribution.as_str());
                }
                for target in targets.iter().filter(|t| t.index as usize == index) {
                    asks.push(Ask { name, weight: weight * target.factor });
                }
            }
        }
        let name = &self.scene.head.maps.distributions[index].name;
        self.reason(name, "hemoglobin", &asks, unknown, self.reached.as_ref().map(|r| r.1[index]))
    }

    fn reason(
        &self,
        name: &str,
        field: &str,
        asks: &[Ask<'_>],
        unknown: Vec<&str>,
        reached: Option<f32>,
    ) -> Option<Reason> {
        if asks.is_empty() {
            let fix = match nearest(name, unknown) {
                Some(written) => format!("the rig writes {written:?}: is {name:?} meant?"),
                None => format!("add {name:?} to the {field} of an expression"),
            };
            return Some(Reason::Wrong("nothing in the rig names it: its weight is always 0".into(), fix));
        }
        let raising: Vec<&str> = asks.iter().filter(|a| a.weight >= LEAST_WEIGHT).map(|a| a.name).collect();
        if raising.is_empty() {
            let names: Vec<&str> = asks.iter().map(|a| a.name).collect();
            let why = format!("its weight is 0 or negative in all that name it ({})", list(&names));
            return Some(Reason::Wrong(why, "give it a positive weight in one of them".into()));
        }
        let reached = reached?;
        if reached >= LEAST_WEIGHT {
            return None;
        }
        let used: Vec<&str> = raising.iter().copied().filter(|n| self.is_used(n)).collect();
        if used.is_empty() {
            return Some(Reason::Idle(list(&raising)));
        }
        let against: Vec<&str> =
            asks.iter().filter(|a| a.weight < 0.0 && self.is_used(a.name)).map(|a| a.name).collect();
        let why = if against.is_empty() {
            format!("its weight stays below {LEAST_WEIGHT:.3}, although it is raised by {}", list(&used))
        } else {
            format!("it is raised by {} and taken away by {} at the same time", list(&used), list(&against))
        };
        Some(Reason::Wrong(why, "key them one after the other, or change their weights".into()))
    }

    fn is_used(&self, name: &str) -> bool {
        let Some(evaluator) = self.scene.evaluator else { return true };
        let sequence = evaluator.sequence();
        let tracks = sequence.expressions.get(name).into_iter().chain(sequence.states.get(name));
        tracks.into_iter().any(|track| looked_at(evaluator).any(|t| track.at(t) >= LEAST_WEIGHT))
    }
}

/// Frames of a sequence that are looked at: all of three minutes at 24 a second, evenly chosen ones of longer ones.
const MOST_FRAMES: u32 = 4320;

/// Times of the frames that are looked at, seconds.
fn looked_at(evaluator: &Evaluator) -> impl Iterator<Item = f64> + '_ {
    (0..evaluator.frame_count()).step_by(step(evaluator) as usize).map(|frame| evaluator.frame_time_s(frame))
}

/// From a frame that is looked at to the next.
fn step(evaluator: &Evaluator) -> u32 {
    evaluator.frame_count().div_ceil(MOST_FRAMES).max(1)
}
