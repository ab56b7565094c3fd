//! The stages that frames are made of.

use super::Frame;
use crate::channels::Channel;
use crate::device::{Image, ImageSpec, Recorder};
use crate::error::RenderError;
use crate::passes::antialias::{self, History, Subsample};
use crate::passes::backdrop;
use crate::passes::diffusion::Before;
use crate::passes::geometry::surface_data;
use crate::passes::hair::Onto;
use crate::passes::lens::depth_of_field::Behind;
use crate::passes::shade::{Lighting, Lit, SkinLight};
use crate::scene::lamp::{Illumination, map_side, place_lights};
use crate::scene::placement::{average_light, receivers};
use crate::scene::view::{Seen, View, Window, nearest_pixel_metres, pixels_per_mm, view, windows};
use crate::settings::DetailMethod;

/// Results of the samples of a pixel so far.
#[derive(Default)]
pub(crate) struct Samples {
    seen: Vec<Seen>,
    displayed: Vec<Image>,
    /// The light of the last sample, which the next one may reuse.
    lit: Option<Lit>,
    velocity: Option<Image>,
}

impl<'a> Frame<'a> {
    /// Blend shapes, tangent frames, blood and wrinkle weights.
    pub(crate) fn pose(&self, r: &mut Recorder<'_>) {
        self.passes.morph.record(r, &self.heads);
        self.passes.tangent_frames.record(r, &self.heads);
        self.passes.appearance.record(r, &self.heads, self.settings.quality.color);
    }

    /// Lamps with their shadow maps, and the environment.
    pub(crate) fn light(&self, r: &mut Recorder<'_>) -> Illumination<'a> {
        let seen = receivers(self.scene, self.settings.output.size, self.needs.margin, self.needs.backs);
        let (lights, views) = place_lights(self.scene, &self.lamps, &seen);
        let most = self.settings.quality.shadow_size;
        let side = match self.settings.quality.detail {
            DetailMethod::Auto => map_side(&views, self.nearest_pixel_metres(), most),
            DetailMethod::Full => most,
        };
        let shadows = self.passes.shadow.record(r, &views, &self.heads, side);
        Illumination {
            lights,
            shadows,
            environment: self.scene.environment,
            environment_intensity: self.scene.environment_intensity,
            environment_rotation: self.scene.environment_rotation,
            bounces: false,
        }
    }

    /// Width of a pixel on the nearest part of a head.
    fn nearest_pixel_metres(&self) -> f32 {
        let size = self.settings.frame_size();
        let pixels = self.scene.heads.iter().map(|head| nearest_pixel_metres(self.scene, size, head));
        pixels.reduce(f32::min).unwrap_or(0.0)
    }

    /// Light that heads send to themselves.
    pub(crate) fn bounce(&self, r: &mut Recorder<'_>, light: &mut Illumination<'a>) {
        let Some(bounce) = &self.passes.bounce else { return };
        let before = self.before(r, light);
        let seen = before.without_picture(r);
        bounce.record(r, &self.passes.shade, &before.lighting(&seen, None), &self.heads);
        light.bounces = true;
    }

    /// Sample positions within a pixel in this frame.
    pub(crate) fn subsamples(&self) -> &'static [Subsample] {
        self.settings.antialias().mode.subsamples(self.past.frames)
    }

    /// The frame for methods that work before the view.
    pub(crate) fn before<'f>(&'f self, r: &mut Recorder<'_>, light: &'f Illumination<'f>) -> Before<'f> {
        Before {
            scene: self.scene,
            quality: &self.settings.quality,
            size: self.settings.frame_size(),
            heads: &self.heads,
            light,
            view: r.uniform("view", &self.view([[0.0; 2]; 2], &[])),
            shade: &self.passes.shade,
            transmittance: self.passes.transmittance.as_ref().map(|(_, t)| t),
        }
    }

    fn view(&self, jitters: [[f32; 2]; 2], windows: &[Window]) -> View {
        let size = self.settings.frame_size();
        view(self.scene, &self.lamps, size, jitters, windows, self.past.clip_from_world)
    }

    /// What the camera sees through one sample of each pixel.
    pub(crate) fn see(&self, r: &mut Recorder<'_>, subsample: &Subsample) -> Seen {
        let all = self.subsamples();
        let share = 1.0 / all.len() as f32;
        let shading_jitter = all
            .iter()
            .fold([0.0; 2], |sum, s| [sum[0] - share * s.position_px[0], sum[1] - share * s.position_px[1]]);
        // A camera samples a place in the pixel by shifting the image in the opposite direction.
        let jitters = [subsample.position_px.map(|p| -p), shading_jitter];
        let size = self.settings.frame_size();
        let windows = windows(self.scene, size);
        let view = self.view(jitters, &windows);
        let pixels_per_mm = pixels_per_mm(self.scene, &view);
        let view = r.uniform("view", &view);
        let [ids, depth] = self.passes.visibility.record(r, &view, &self.heads, size);
        Seen { view, pixels_per_mm, ids, depth, windows }
    }

    /// Light of the surface that a sample sees. A second sample reuses the light of the first where both see the same
    /// surface. `skin_light` is the rule of a diffusion method for skin.
    pub(crate) fn shade(
        &self,
        r: &mut Recorder<'_>,
        light: &Illumination<'_>,
        seen: &Seen,
        samples: &Samples,
        skin_light: Option<&dyn SkinLight>,
    ) -> Lit {
        let transmittance = self.passes.transmittance.as_ref().map(|(_, t)| t);
        let first = samples.seen.first();
        let lighting =
            Lighting { light, seen, first, transmittance, quality: &self.settings.quality, skin_light };
        self.passes.shade.record(r, &lighting, &self.heads, samples.lit.as_ref())
    }

    /// From the light of a sample to display values: compose, backdrop, hair and films, what is seen through, resolve, lens,
    /// display.
    pub(crate) fn show(
        &mut self,
        r: &mut Recorder<'_>,
        light: &Illumination<'_>,
        seen: Seen,
        lit: Lit,
        diffuse: &Image,
        samples: &mut Samples,
    ) {
        let passes = self.passes;
        let inputs = [diffuse, &lit.albedo, &lit.direct, &seen.depth];
        let look = &self.settings.look;
        let is_first = samples.seen.is_empty();
        let moves = is_first && self.remembers();
        let (hair, detail) = ((&passes.fibre, light), self.settings.quality.detail);
        // A backdrop comes between skin and hairs.
        let sums = match moves || passes.backdrop.is_some() {
            true => None,
            false => passes.cropped_hair.cover(r, hair, detail, &seen, &self.heads),
        };
        let mut hdr = passes.compose.record(r, self.scene.background_linear, inputs, sums);
        let mut behind = None;
        if let Some(pass) = &passes.backdrop {
            (hdr, behind) = pass.record(r, look, self.scene, &seen, &self.heads, &hdr);
        }
        let velocity = moves.then(|| passes.velocity.record(r, &seen, &self.heads));
        let rest = sums.is_some();
        let onto = Onto::Picture(&hdr, velocity.as_ref());
        passes.cropped_hair.record(r, hair, detail, &seen, &self.heads, rest, onto);
        let ambient = average_light(self.scene);
        passes.overlay.record(r, hair, ambient, detail, &seen, &self.heads, onto);
        if self.keeps(Channel::Hair) {
            // A new image is zero: nothing covers it.
            let spec = ImageSpec::light(seen.ids.size()).also(wgpu::TextureUsages::RENDER_ATTACHMENT);
            let layer = Image::new(r.gpu, "hair", spec);
            let onto = Onto::Layer(&layer);
            passes.cropped_hair.record(r, hair, detail, &seen, &self.heads, false, onto);
            passes.overlay.record(r, hair, ambient, detail, &seen, &self.heads, onto);
            self.keep([(Channel::Hair, &layer)]);
        }
        let lighting = Lighting {
            light,
            seen: &seen,
            first: None,
            transmittance: None,
            quality: &self.settings.quality,
            skin_light: None,
        };
        if self.keeps(Channel::Transmitted) {
            let transmittance = passes.transmittance.as_ref().map(|(_, t)| t);
            let through =
                passes.shade.record_through(r, &Lighting { transmittance, ..lighting }, &self.heads);
            self.keep([(Channel::Transmitted, &through)]);
        }
        let hdr = passes.see_through.record(r, &passes.shade, &lighting, &self.heads, hdr);

        self.keep([
            (Channel::Radiance, &hdr),
            (Channel::Diffuse, diffuse),
            (Channel::Irradiance, &lit.irradiance),
            (Channel::Albedo, &lit.albedo),
            (Channel::Direct, &lit.direct),
            (Channel::Depth, &seen.depth),
            (Channel::Ids, &seen.ids),
        ]);
        if let Some(velocity) = &velocity {
            self.keep([(Channel::Velocity, velocity)]);
        }
        if let Some(pass) = &passes.surface_data {
            let images = pass.record(r, &seen, &self.heads);
            self.keep(surface_data::CHANNELS.into_iter().zip(&images));
        }
        let camera = &self.scene.camera;
        let per_side = self.settings.samples_per_side();
        let mut resolved = passes.resolve.record(r, look, per_side, hdr);
        if let Some(pass) = &passes.depth_of_field {
            let behind = behind.as_ref().map_or(Behind::Plain(backdrop::plain(self.scene)), Behind::Image);
            let lens = (camera, &self.scene.optics);
            resolved = pass.record(r, lens, per_side, resolved, &seen.depth, &behind);
        }
        let spread = passes.bloom.as_ref().map(|pass| pass.record(r, look, &resolved));
        let spread = spread.as_ref();
        match self.into.filter(|_| passes.antialias.is_none() && passes.grain.is_none()) {
            Some(picture) => passes.display.record_into(r, look, camera, &resolved, spread, picture),
            None => samples.displayed.push(passes.display.record(r, look, camera, &resolved, spread)),
        }
        samples.velocity = samples.velocity.take().or(velocity);
        samples.seen.push(seen);
        samples.lit = Some(lit);
    }

    /// Combines the samples into one picture: the returned image, or the frame's target.
    ///
    /// # Errors
    /// An input is missing.
    pub(crate) fn antialias(
        &mut self,
        r: &mut Recorder<'_>,
        samples: Samples,
    ) -> Result<Option<Image>, RenderError> {
        let size = self.settings.output.size;
        let Some(antialias) = &self.passes.antialias else {
            self.remember(r);
            let displayed = samples.displayed.into_iter().next();
            return Ok(displayed.and_then(|displayed| self.finish(r, displayed)));
        };
        let colors: Vec<_> = samples.displayed.iter().map(Image::view).collect();
        let depths: Vec<_> = samples.seen.iter().map(|s| s.depth.view()).collect();
        let inputs = antialias::Inputs {
            colors: &colors,
            depths: if antialias.settings().needs_depth() { &depths } else { &[] },
            velocity: samples.velocity.as_ref().map(Image::view),
            frame: self.past.frames,
        };
        let is_temporal = self.settings.quality.antialias.is_temporal();
        if is_temporal && self.past.history.is_none() {
            self.past.history = Some(History::new(r.gpu, size));
        }
        let history = if is_temporal { self.past.history.as_mut() } else { None };
        let picture = match self.into.filter(|_| self.passes.grain.is_none()) {
            Some(_) => None,
            None => Some(r.image("image", ImageSpec::storage(size, self.passes.display.format()))),
        };
        let output = picture.as_ref().map(Image::view).or(self.into);
        if let Some(output) = output {
            antialias.record(r.gpu, r.encoder, r.timer, &inputs, output, history)?;
        }
        self.remember(r);
        Ok(picture.and_then(|picture| self.finish(r, picture)))
    }

    /// Grain and dither of the antialiased picture, where the look has them: the picture, or none if it is in the frame's
    /// target.
    fn finish(&self, r: &mut Recorder<'_>, displayed: Image) -> Option<Image> {
        let Some(grain) = &self.passes.grain else { return Some(displayed) };
        let size = displayed.size();
        let picture = match self.into {
            Some(_) => None,
            None => Some(r.image("picture", ImageSpec::storage(size, wgpu::TextureFormat::Rgba8Unorm))),
        };
        let into = picture.as_ref().map(Image::view).or(self.into)?;
        let (look, optics) = (&self.settings.look, &self.scene.optics);
        grain.record_into(r, look, optics, displayed.view(), into, size);
        picture
    }

    /// Whether frames know how the surface moved since the one before.
    fn remembers(&self) -> bool {
        self.settings.quality.antialias.is_temporal()
            || self.settings.output.channels.contains(&Channel::Velocity)
    }

    /// Keeps the places of the surface and the camera for the next frame.
    fn remember(&mut self, r: &mut Recorder<'_>) {
        if !self.remembers() {
            return;
        }
        for head in &self.heads {
            let (from, to) = (head.positions, head.kept_positions);
            r.encoder.copy_buffer_to_buffer(from, 0, to, 0, from.size());
        }
        let [width, height] = self.settings.output.size;
        let camera = &self.scene.camera;
        let clip_from_view = camera.clip_from_view(width as f32 / height as f32);
        self.past.clip_from_world = Some(clip_from_view * camera.view_from_world());
        // The places of samples alternate only where the previous frame takes part in the picture.
        self.past.frames += u64::from(self.settings.quality.antialias.is_temporal());
    }

    /// Whether a channel will be read back.
    fn keeps(&self, channel: Channel) -> bool {
        self.settings.output.channels.contains(&channel)
    }

    /// Holds images that will be read back, so that no later pass reuses them.
    fn keep<'i>(&mut self, images: impl IntoIterator<Item = (Channel, &'i Image)>) {
        for (channel, image) in images {
            if self.keeps(channel) {
                self.kept.insert(channel, image.clone());
            }
        }
    }
}
