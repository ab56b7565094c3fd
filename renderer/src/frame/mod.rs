//! How a frame is put together: [`realtime`] records it in one go, [`reference`] accumulates batches of samples.
//!
//! [`stages`] holds the stages that both share. A stage calls passes and does not know their methods.

pub(crate) mod realtime;
pub(crate) mod reference;
pub(crate) mod stages;

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::Mat4;
use rubor_rig::skin::profile::Profile;

use crate::channels::Channel;
use crate::device::{Gpu, Image};
use crate::error::RenderError;
use crate::passes::antialias::{self, Antialias, History};
use crate::passes::appearance::Appearance;
use crate::passes::backdrop::{self, Backdrop};
use crate::passes::bounce::Bounce;
use crate::passes::compose::Compose;
use crate::passes::diffusion::Needs;
use crate::passes::display::{Display, Flavour};
use crate::passes::geometry::morph::Morph;
use crate::passes::geometry::raster::Rasteriser;
use crate::passes::geometry::shadow::Shadow;
use crate::passes::geometry::surface_data::{self, SurfaceData};
use crate::passes::geometry::tangent_frames::TangentFrames;
use crate::passes::geometry::velocity::Velocity;
use crate::passes::geometry::visibility::Visibility;
use crate::passes::hair::cropped_hair::CroppedHair;
use crate::passes::hair::fibre::Fibre;
use crate::passes::hair::overlay::Overlay;
use crate::passes::lens::bloom::Bloom;
use crate::passes::lens::depth_of_field::DepthOfField;
use crate::passes::lens::grain::Grain;
use crate::passes::resolve::Resolve;
use crate::passes::see_through::SeeThrough;
use crate::passes::shade::{Shade, Transmittance};
use crate::scene::{Light, MAX_LIGHTS, PosedHead, Scene};
use crate::settings::{BounceMethod, DepthOfFieldMethod, Look, Settings, ToneMap, TransmitMethod};

/// The passes of frames, with their pipelines.
pub(crate) struct Passes {
    pub(crate) rasteriser: Rasteriser,
    pub(crate) morph: Morph,
    pub(crate) tangent_frames: TangentFrames,
    pub(crate) appearance: Appearance,
    pub(crate) shadow: Shadow,
    pub(crate) visibility: Visibility,
    pub(crate) shade: Shade,
    pub(crate) compose: Compose,
    pub(crate) velocity: Velocity,
    pub(crate) fibre: Fibre,
    pub(crate) cropped_hair: CroppedHair,
    pub(crate) overlay: Overlay,
    pub(crate) see_through: SeeThrough,
    pub(crate) tone_map: ToneMap,
    pub(crate) resolve: Resolve,
    pub(crate) display: Display,
    /// Each present if the look or the lens asks for it.
    pub(crate) backdrop: Option<Backdrop>,
    pub(crate) depth_of_field: Option<DepthOfField>,
    pub(crate) bloom: Option<Bloom>,
    pub(crate) grain: Option<Grain>,
    /// Format of what `antialias` writes.
    antialias_format: wgpu::TextureFormat,
    /// Present if the settings ask for it.
    pub(crate) antialias: Option<Antialias>,
    pub(crate) transmittance: Option<(Arc<Profile>, Transmittance)>,
    pub(crate) surface_data: Option<SurfaceData>,
    /// Present if the settings ask for it.
    pub(crate) bounce: Option<Bounce>,
}

/// A frame while it is recorded.
pub(crate) struct Frame<'a> {
    pub(crate) passes: &'a Passes,
    pub(crate) scene: &'a Scene<'a>,
    pub(crate) settings: &'a Settings,
    pub(crate) heads: Vec<PosedHead<'a>>,
    pub(crate) lamps: Vec<Light>,
    pub(crate) needs: Needs,
    pub(crate) past: &'a mut Past,
    /// Target of the picture; without one the frame makes an image.
    pub(crate) into: Option<&'a wgpu::TextureView>,
    /// Images that will be read back.
    pub(crate) kept: BTreeMap<Channel, Image>,
}

/// The history: all data that one frame passes to the next.
#[derive(Default)]
pub(crate) struct Past {
    pub(crate) history: Option<History>,
    pub(crate) clip_from_world: Option<Mat4>,
    pub(crate) frames: u64,
}

impl Past {
    /// Clears the history. The frame count continues.
    pub(crate) fn forget(&mut self) {
        *self = Self { frames: self.frames, ..Self::default() };
    }
}

impl Passes {
    pub(crate) fn new(gpu: &Gpu, rasteriser: Rasteriser) -> Self {
        let tone_map = ToneMap::Filmic;
        Self {
            rasteriser,
            morph: Morph::new(gpu),
            tangent_frames: TangentFrames::new(gpu),
            appearance: Appearance::new(gpu),
            shadow: Shadow::new(gpu, rasteriser),
            visibility: Visibility::new(gpu, rasteriser),
            shade: Shade::new(gpu, rasteriser),
            compose: Compose::new(gpu),
            velocity: Velocity::new(gpu),
            fibre: Fibre::new(gpu),
            cropped_hair: CroppedHair::new(gpu, rasteriser),
            overlay: Overlay::new(gpu, rasteriser),
            see_through: SeeThrough::default(),
            tone_map,
            resolve: Resolve::new(gpu, tone_map),
            display: Display::new(gpu, Flavour::of(&Look::default())),
            backdrop: None,
            depth_of_field: None,
            bloom: None,
            grain: None,
            antialias_format: wgpu::TextureFormat::Rgba8Unorm,
            antialias: None,
            transmittance: None,
            surface_data: None,
            bounce: None,
        }
    }

    /// Makes the passes that frames with these settings need, unless they exist.
    ///
    /// # Errors
    /// The profile cannot be tabulated, or the antialiasing is out of range.
    pub(crate) fn prepare(
        &mut self,
        gpu: &Gpu,
        scene: &Scene<'_>,
        settings: &Settings,
        needs: &Needs,
    ) -> Result<(), RenderError> {
        let has_holes = scene.heads.iter().any(|h| h.head.cut_triangles > 0);
        self.visibility.prepare(gpu, settings.frame_size(), scene.heads.len(), has_holes);
        // One more than the scene has: a dark lamp may be added for transmittance.
        let lights = (scene.lights.len() + 1).min(MAX_LIGHTS);
        self.shadow.prepare(gpu, lights, settings.quality.shadow_size, scene.heads.len(), has_holes);
        let [width, height] = settings.frame_size().map(u64::from);
        let has_hairs = scene.heads.iter().any(|h| h.head.hair_root_count > 0);
        self.cropped_hair.prepare(gpu, width * height, has_hairs);
        let wanted = settings.antialias();
        let size = settings.output.size;
        self.prepare_lens(gpu, scene, settings);
        let format = self.display.format();
        if wanted.mode == antialias::Mode::None {
            self.antialias = None;
        } else if self.antialias_format != format
            || self.antialias.as_ref().is_none_or(|a| *a.settings() != wanted || a.size() != size)
        {
            self.antialias = Some(Antialias::new(gpu, &wanted, size, format)?);
        }
        self.antialias_format = format;
        let profile = settings.quality.profile.shared();
        if settings.quality.transmit != TransmitMethod::ShadowDepth || !needs.transmittance {
            self.transmittance = None;
        } else if self.transmittance.as_ref().is_none_or(|(p, _)| p != profile) {
            self.transmittance = Some((profile.clone(), Transmittance::new(gpu, profile)?));
        }
        if settings.quality.bounce == BounceMethod::None {
            self.bounce = None;
        } else if self.bounce.is_none() {
            self.bounce = Some(Bounce::new(gpu, self.rasteriser.stores_depth()));
        }
        if !surface_data::is_wanted(settings) {
            self.surface_data = None;
        } else if self.surface_data.is_none() {
            self.surface_data = Some(SurfaceData::new(gpu));
        }
        let has_own_color = scene.heads.iter().any(|h| h.head.maps.as_ref().is_some_and(|m| m.has_own_color));
        self.shade.prepare_specular(gpu, settings.quality.specular, has_own_color);
        Ok(())
    }

    /// Makes the passes from the resolve to the picture.
    fn prepare_lens(&mut self, gpu: &Gpu, scene: &Scene<'_>, settings: &Settings) {
        let (look, height) = (&settings.look, settings.output.size[1]);
        if self.tone_map != look.tone_map {
            self.tone_map = look.tone_map;
            self.resolve = Resolve::new(gpu, self.tone_map);
        }
        let flavour = Flavour::of(look);
        if self.display.flavour() != flavour {
            self.display = Display::new(gpu, flavour);
        }
        let taps = match settings.quality.depth_of_field {
            DepthOfFieldMethod::Gather(taps) if scene.optics.f_stop.is_some() => Some(taps),
            _ => None,
        };
        let has_backdrop = backdrop::is_needed(look);
        let keeps = taps.is_some();
        if !has_backdrop {
            self.backdrop = None;
        } else if self.backdrop.as_ref().is_none_or(|b| !b.fits(keeps)) {
            self.backdrop = Some(Backdrop::new(gpu, keeps));
        }
        match taps {
            None => self.depth_of_field = None,
            Some(taps) if self.depth_of_field.as_ref().is_some_and(|d| d.fits(taps, has_backdrop)) => {}
            Some(taps) => self.depth_of_field = Some(DepthOfField::new(gpu, taps, has_backdrop)),
        }
        if look.bloom <= 0.0 {
            self.bloom = None;
        } else if self.bloom.as_ref().is_none_or(|b| !b.fits(look, height)) {
            self.bloom = Some(Bloom::new(gpu, look, height));
        }
        if !look.has_noise() {
            self.grain = None;
        } else if self.grain.is_none() {
            self.grain = Some(Grain::new(gpu));
        }
    }
}
