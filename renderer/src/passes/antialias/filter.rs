//! Antialiasing of finished images: MLAA and SMAA 1x over pixels in memory.

use super::reference::{Edges, Picture, Weights};
use super::{Antialias, AntialiasError, Inputs, Mode, Settings};
use crate::device::{Gpu, PassTimer};
use crate::error::RenderError;
use wgpu::{TextureFormat, TextureUsages};

/// Filters images one after the other; images of the same size share what the device needs.
///
/// ```no_run
/// use rubor_renderer::{antialias::{Filter, Settings}, native};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let gpu = native::open(None)?;
/// let mut filter = Filter::new(&gpu, Settings::default())?;
/// let white_over_black = [[255; 8], [0; 8]].concat();
/// let smooth = native::wait(&gpu, filter.bytes(2, 2, &white_over_black))?;
/// assert_eq!(smooth.len(), 16);
/// # Ok(())
/// # }
/// ```
pub struct Filter<'a> {
    gpu: &'a Gpu,
    settings: Settings,
    ready: Option<Ready>,
}

/// Resources for images of one size and format.
struct Ready {
    size: [u32; 2],
    pass: Antialias,
    input: wgpu::Texture,
    output: wgpu::Texture,
}

impl<'a> Filter<'a> {
    /// A filter with the given settings.
    ///
    /// # Errors
    /// Settings out of range, depth wanted, or a mode that needs more than one image.
    pub fn new(gpu: &'a Gpu, settings: Settings) -> Result<Self, AntialiasError> {
        settings.validate()?;
        if !matches!(settings.mode, Mode::None | Mode::Mlaa | Mode::Smaa1x) {
            return Err(AntialiasError::NotAFilter { mode: settings.mode.name() });
        }
        if settings.needs_depth() {
            let mode = settings.mode.name();
            return Err(AntialiasError::Inputs { mode, what: "depths", expected: 1, found: 0 });
        }
        Ok(Self { gpu, settings, ready: None })
    }

    /// Filters RGBA bytes (`4 * width * height`, row 0 first, straight alpha).
    ///
    /// # Errors
    /// An empty or too large image, a wrong number of bytes, or the device failed.
    pub async fn bytes(&mut self, width: u32, height: u32, rgba: &[u8]) -> Result<Vec<u8>, AntialiasError> {
        self.run([width, height], TextureFormat::Rgba8Unorm, rgba)?;
        self.read(|ready| &ready.output).await
    }

    /// Filters floats, which must not be NaN.
    ///
    /// # Errors
    /// An empty or too large image, a wrong number of pixels, or the device failed.
    pub async fn picture(&mut self, picture: &Picture) -> Result<Picture, AntialiasError> {
        self.run_picture(picture)?;
        let pixels = bytemuck::pod_collect_to_vec(&self.read(|ready| &ready.output).await?);
        Ok(Picture { pixels, ..*picture })
    }

    /// Only the edges of a picture.
    ///
    /// # Errors
    /// As [`Filter::picture`].
    pub async fn edges(&mut self, picture: &Picture) -> Result<Edges, AntialiasError> {
        self.run_picture(picture)?;
        self.read_edges().await
    }

    /// Only the blending weights of a picture.
    ///
    /// # Errors
    /// As [`Filter::picture`].
    pub async fn weights(&mut self, picture: &Picture) -> Result<Vec<Weights>, AntialiasError> {
        self.run_picture(picture)?;
        let edges = self.read_edges().await?;
        let texels = self.read(|ready| &ready.pass.samples[0].weights_texture).await?;
        let weights = bytemuck::pod_collect_to_vec::<u8, Weights>(&texels);
        // Where there is no edge the texture is never written.
        let known = |i: usize| if edges.top[i] || edges.left[i] { weights[i] } else { [0; 4] };
        Ok((0..weights.len()).map(known).collect())
    }

    fn run_picture(&mut self, picture: &Picture) -> Result<(), AntialiasError> {
        let size = [picture.width as u32, picture.height as u32];
        self.run(size, TextureFormat::Rgba32Float, bytemuck::cast_slice(&picture.pixels))
    }

    fn run(&mut self, size: [u32; 2], format: TextureFormat, texels: &[u8]) -> Result<(), AntialiasError> {
        if self.ready.as_ref().is_none_or(|ready| ready.size != size || ready.input.format() != format) {
            self.ready = None;
            let pass = Antialias::new(self.gpu, &self.settings, size, format)?;
            let target = |usage| self.gpu.target("filter image", size, format, usage);
            let input = target(TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_DST);
            let output = target(TextureUsages::STORAGE_BINDING | TextureUsages::COPY_SRC);
            self.ready = Some(Ready { size, pass, input, output });
        }
        let Some(ready) = &self.ready else { return Err(AntialiasError::Device("no pass".to_owned())) };
        let bytes_per_row = format.block_copy_size(None).unwrap_or(4) * size[0];
        let expected = bytes_per_row as usize * size[1] as usize;
        if texels.len() != expected {
            let mode = self.settings.mode.name();
            return Err(AntialiasError::Inputs {
                mode,
                what: "bytes of pixels",
                expected,
                found: texels.len(),
            });
        }
        let extent = wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: 1 };
        let layout = wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(bytes_per_row),
            rows_per_image: None,
        };
        self.gpu.queue.write_texture(ready.input.as_image_copy(), texels, layout, extent);
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        let (color, output) =
            (ready.input.create_view(&Default::default()), ready.output.create_view(&Default::default()));
        let inputs = Inputs { colors: &[&color], ..Default::default() };
        let mut timer = PassTimer::default();
        ready.pass.record(self.gpu, &mut encoder, &mut timer, &inputs, &output, None)?;
        self.gpu.queue.submit([encoder.finish()]);
        Ok(())
    }

    async fn read(&self, texture: impl Fn(&Ready) -> &wgpu::Texture) -> Result<Vec<u8>, AntialiasError> {
        let ready =
            self.ready.as_ref().ok_or_else(|| AntialiasError::Device("nothing was filtered".to_owned()))?;
        self.gpu.read_texture(texture(ready)).await.map_err(device_error)
    }

    async fn read_edges(&self) -> Result<Edges, AntialiasError> {
        let ready =
            self.ready.as_ref().ok_or_else(|| AntialiasError::Device("nothing was filtered".to_owned()))?;
        let bytes = self.gpu.read_buffer(&ready.pass.samples[0].bits).await.map_err(device_error)?;
        let words: Vec<[u32; 2]> = bytemuck::pod_collect_to_vec(&bytes);
        let [width, height] = ready.size.map(|side| side as usize);
        let row = width.div_ceil(super::TILE as usize);
        let bit = |i: usize, side: usize| {
            let (x, y) = (i % width, i / width);
            words[y * row + x / 32][side] >> (x % 32) & 1 == 1
        };
        let all = |side: usize| (0..width * height).map(|i| bit(i, side)).collect();
        Ok(Edges { width, height, top: all(0), left: all(1) })
    }
}

fn device_error(error: RenderError) -> AntialiasError {
    AntialiasError::Device(error.to_string())
}
