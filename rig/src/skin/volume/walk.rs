//! Paths of light, walked from the camera.

use std::f32::consts::{FRAC_1_PI, TAU};

use glam::Vec3;

use super::boundary::Event;
use super::lamp::{Arriving, Lamp};
use super::{CHANNELS, Flesh};
use crate::random::SplitMix64;

/// What a ray meets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum What {
    /// Skin.
    Skin,
    /// The rest of the closed surface: lining of mouth and eyes, and what closes the neck.
    Lining,
    /// Black.
    Blocker,
}

/// Where a ray meets something.
#[derive(Clone, Copy, Debug)]
pub struct Meet {
    /// From the origin of the ray.
    pub distance_mm: f32,
    /// The place, mm.
    pub place: Vec3,
    /// Normal of the triangle, outwards.
    pub facet: Vec3,
    /// Normal that light is refracted about, outwards.
    pub normal: Vec3,
    /// Where rays to lamps begin.
    pub lifted: Vec3,
    /// What it is.
    pub what: What,
    /// Its number, which rays that start on it leave out.
    pub number: u32,
}

/// A closed surface with what stands around it.
pub trait Surroundings: Sync {
    /// The first thing on the way from a place, which lies on thing number `on` if on any.
    fn meet(&self, origin: Vec3, direction: Vec3, far_mm: f32, on: Option<u32>) -> Option<Meet>;
    /// Whether there is any on the way from a place near a surface.
    fn is_blocked(&self, origin: Vec3, direction: Vec3, far_mm: f32) -> bool;
    /// Smallest and largest coordinate of the surface.
    fn bounds(&self) -> (Vec3, Vec3);
    /// Whether collisions look for lamps. Without it the light is the same and its noise larger: for tests.
    fn is_guiding(&self) -> bool {
        true
    }
}

/// Light that a path brings to the camera, R, G, B. What never was scattered inside does not count.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Brought {
    /// Through the boundary at the place that the camera sees: the diffuse light.
    pub(super) refracted: Vec3,
    /// By reflection there.
    pub(super) reflected: Vec3,
    /// 1 if the walk found no way out of a closed surface.
    pub(super) lost: u32,
}

/// Events after which a path ends.
const MOST_EVENTS: u32 = 200_000;
/// Weight below which paths end by chance.
const LIGHT: f32 = 0.25;
/// Mean free paths from which on a collision looks for no way to a lamp: e^-6 of the light arrives.
const REACH: f32 = 6.0;
const MOST_LAMPS: usize = 8;

/// What paths walk in.
pub(super) struct Walker<'a, S> {
    pub(super) flesh: &'a Flesh,
    pub(super) around: &'a S,
    pub(super) lamps: &'a [Lamp],
    /// Radiance from all sides.
    pub(super) sky: f32,
}

/// Where light of a lamp is likely to come from at a collision: the normal of the boundary there, and the probability of a
/// look.
#[derive(Clone, Copy, Default)]
struct Guide {
    normal: Vec3,
    chance: f32,
}

/// Where a flight began, if that was a collision.
struct Collision {
    place: Vec3,
    guides: [Guide; MOST_LAMPS],
}

/// Weights of the three channels on one path. The length of each flight is drawn for one channel, chosen at the start; the
/// mean of the densities of all three divides the light of each (the balance heuristic of Veach and Guibas 1995, for hero
/// wavelengths: Wilkie et al. 2014).
struct Throughput {
    light: Vec3,
    density: Vec3,
}

impl Throughput {
    fn times(&mut self, light: Vec3, density: Vec3) {
        self.light *= light;
        self.density *= density;
        let mean = self.density.element_sum() / CHANNELS as f32;
        self.light /= mean;
        self.density /= mean;
    }
}

fn exp(v: Vec3) -> Vec3 {
    Vec3::new(v.x.exp(), v.y.exp(), v.z.exp())
}

impl<S: Surroundings> Walker<'_, S> {
    /// Walks one path from what the camera sees.
    pub(super) fn path(&self, seen: &Meet, to_viewer: Vec3, random: &mut SplitMix64) -> Brought {
        let mut brought = Brought::default();
        let hero = random.below(CHANNELS);
        let boundary = &self.flesh.boundary;
        let [scattering, extinction] = [self.flesh.scattering, self.flesh.extinction];
        let (low, high) = self.around.bounds();
        let normal = facing(seen, to_viewer);
        let Some((first, direction, weight)) = boundary.sample(to_viewer, normal, random) else {
            return brought;
        };
        let mut path = Throughput { light: Vec3::splat(weight), density: Vec3::ONE };
        let mut direction = kept(direction, first, to_viewer, seen.facet);
        let mut is_inside = direction.dot(seen.facet) < 0.0;
        let (mut here, mut on) = (seen.place, Some(seen.number));
        let mut collisions = 0_u32;
        let mut begun: Option<Collision> = None;
        let mut sum = Vec3::ZERO;
        for _ in 0..MOST_EVENTS {
            let flight = if is_inside {
                -((1.0 - random.uniform()).ln() as f32) / extinction[hero]
            } else {
                f32::INFINITY
            };
            let Some(met) = self.around.meet(here, direction, flight, on) else {
                if !is_inside {
                    if collisions > 0 {
                        sum += self.sky * path.light;
                    }
                    break;
                }
                here += flight * direction;
                on = None;
                if here.cmplt(low).any() || here.cmpgt(high).any() {
                    brought.lost = 1;
                    break;
                }
                let through = exp(-flight * extinction);
                path.times(scattering * through, extinction * through);
                collisions += 1;
                let heaviest = path.light.max_element();
                if heaviest < LIGHT {
                    if random.uniform() as f32 * LIGHT >= heaviest {
                        break;
                    }
                    path.light *= LIGHT / heaviest;
                }
                let guides = self.guides(here, seen.normal);
                sum += path.light * self.connected(here, &guides, random);
                begun = Some(Collision { place: here, guides });
                direction = uniform_direction(random);
                continue;
            };
            if is_inside {
                let through = exp(-met.distance_mm * extinction);
                path.times(through, through);
            }
            if met.what == What::Blocker {
                break;
            }
            let back = -direction;
            let normal = facing(&met, back);
            if collisions > 0 {
                sum += path.light * self.lit(&met, back, normal, begun.as_ref(), random);
            }
            let Some((event, next, weight)) = boundary.sample(back, normal, random) else { break };
            path.light *= weight;
            direction = kept(next, event, back, met.facet);
            is_inside = direction.dot(met.facet) < 0.0;
            (here, on) = (met.place, Some(met.number));
            begun = None;
        }
        match first {
            Event::Refracted => brought.refracted = sum,
            Event::Reflected => brought.reflected = sum,
        }
        brought
    }

    /// Light of lamps that the boundary at a place reflects or refracts into a direction.
    fn lit(
        &self,
        met: &Meet,
        back: Vec3,
        normal: Vec3,
        begun: Option<&Collision>,
        random: &mut SplitMix64,
    ) -> Vec3 {
        let mut sum = Vec3::ZERO;
        let boundary = &self.flesh.boundary;
        for (i, lamp) in self.lamps.iter().enumerate() {
            let at = [random.uniform() as f32, random.uniform() as f32];
            let light = lamp.arriving(met.place, at);
            let cosine = light.to_lamp.dot(normal);
            if cosine <= 0.0 {
                continue;
            }
            let mut lobe = if back.dot(met.facet) > 0.0 {
                boundary.reflection(light.to_lamp, back, normal)
            } else {
                boundary.refraction(light.to_lamp, back, normal)
            };
            if lobe <= 0.0 {
                continue;
            }
            if back.dot(met.facet) <= 0.0
                && let Some(begun) = begun
            {
                let way = met.place - begun.place;
                let [guided, free] = self.densities(begun, i, lamp, at, back, way.length());
                lobe *= free / (free + guided);
            }
            if lobe > 0.0 && !self.is_blocked(met, &light) {
                sum += lobe * cosine * light.irradiance;
            }
        }
        sum
    }

    fn is_blocked(&self, met: &Meet, light: &Arriving) -> bool {
        self.around.is_blocked(met.lifted, light.to_lamp, light.distance_mm)
    }

    /// Densities by solid angle with which a flight from a collision goes back along `into` and arrives: guided by a lamp,
    /// and free.
    fn densities(
        &self,
        begun: &Collision,
        lamp_number: usize,
        lamp: &Lamp,
        at: [f32; 2],
        into: Vec3,
        way_mm: f32,
    ) -> [f32; 2] {
        let guide = begun.guides[lamp_number];
        let to_lamp = lamp.arriving(begun.place, at).to_lamp;
        let guided = if guide.chance > 0.0 {
            guide.chance * self.flesh.boundary.density_towards(to_lamp, into, guide.normal)
        } else {
            0.0
        };
        // Any positive numbers that both ways agree on give the right mean; these are the densities for the mean channel.
        let free = 0.25 * FRAC_1_PI * (-way_mm * self.flesh.extinction.element_sum() / CHANNELS as f32).exp();
        [guided, free]
    }

    /// Where light of each lamp is likely to come from: the boundary in the direction that it would have inside of a surface
    /// with a known normal.
    fn guides(&self, place: Vec3, known: Vec3) -> [Guide; MOST_LAMPS] {
        let mut guides = [Guide::default(); MOST_LAMPS];
        if !self.around.is_guiding() {
            return guides;
        }
        let thin = self.flesh.extinction.min_element();
        for (guide, lamp) in guides.iter_mut().zip(self.lamps) {
            let to_lamp = lamp.arriving(place, [0.0; 2]).to_lamp;
            let eta = self.flesh.boundary.eta;
            let way = if to_lamp.dot(known) > 0.0 { -(-to_lamp).refract(known, 1.0 / eta) } else { to_lamp };
            let Some(met) = self.around.meet(place, way, REACH / thin, None) else { continue };
            if met.what != What::Blocker && way.dot(met.facet) > 0.0 {
                let normal = facing(&met, -way);
                if normal.dot(to_lamp) > 0.0 {
                    let chance = (2.0 * (-met.distance_mm * thin).exp()).min(1.0);
                    *guide = Guide { normal, chance };
                }
            }
        }
        guides
    }

    /// Light of lamps that arrives at a collision through the boundary and is scattered there: next-event estimation through
    /// a rough boundary. The direction is drawn by the microfacets of the boundary where the light is likely to enter.
    fn connected(&self, place: Vec3, guides: &[Guide; MOST_LAMPS], random: &mut SplitMix64) -> Vec3 {
        let mut sum = Vec3::ZERO;
        let boundary = &self.flesh.boundary;
        for (i, (guide, lamp)) in guides.iter().zip(self.lamps).enumerate() {
            if guide.chance <= 0.0 || random.uniform() as f32 >= guide.chance {
                continue;
            }
            let at = [random.uniform() as f32, random.uniform() as f32];
            let to_lamp = lamp.arriving(place, at).to_lamp;
            let Some(into) = boundary.sample_towards(to_lamp, guide.normal, random) else { continue };
            let reach = 2.0 * REACH / self.flesh.extinction.min_element();
            let Some(met) = self.around.meet(place, -into, reach, None) else { continue };
            if met.what == What::Blocker || into.dot(met.facet) >= 0.0 {
                continue;
            }
            let normal = facing(&met, into);
            let light = lamp.arriving(met.place, at);
            let cosine = light.to_lamp.dot(normal);
            let lobe = boundary.refraction(light.to_lamp, into, normal);
            if cosine <= 0.0 || lobe <= 0.0 {
                continue;
            }
            let begun = Collision { place, guides: *guides };
            let [guided, free] = self.densities(&begun, i, lamp, at, into, met.distance_mm);
            if guided <= 0.0 || self.is_blocked(&met, &light) {
                continue;
            }
            let through = exp(-met.distance_mm * self.flesh.extinction);
            // Phase 1 / 4 pi over the density, times the share of this way of looking.
            let factor = 0.25 * FRAC_1_PI * lobe * cosine / (guided + free);
            sum += factor * through * light.irradiance;
        }
        sum
    }
}

/// The normal that light is refracted about, or that of the triangle where both disagree on the side of a direction.
fn facing(met: &Meet, direction: Vec3) -> Vec3 {
    if (met.normal.dot(direction) > 0.0) == (met.facet.dot(direction) > 0.0) { met.normal } else { met.facet }
}

/// A direction that an event about an interpolated normal gave, mirrored at the triangle where it left on the wrong side of
/// it: else light would pass the boundary unseen.
fn kept(direction: Vec3, event: Event, back: Vec3, facet: Vec3) -> Vec3 {
    let is_front = direction.dot(facet) > 0.0;
    let should = (back.dot(facet) > 0.0) == (event == Event::Reflected);
    if is_front == should { direction } else { direction - 2.0 * direction.dot(facet) * facet }
}

fn uniform_direction(random: &mut SplitMix64) -> Vec3 {
    let z = 2.0 * random.uniform() as f32 - 1.0;
    let (sin, cos) = (TAU * random.uniform() as f32).sin_cos();
    let r = (1.0 - z * z).max(0.0).sqrt();
    Vec3::new(r * cos, r * sin, z)
}
