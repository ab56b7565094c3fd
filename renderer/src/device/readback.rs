//! From the device to the host, without waiting: the frame's commands make a copy, whose bytes are available when the
//! device is done.

use futures_channel::oneshot;

use super::gpu::Gpu;
use crate::error::RenderError;

/// A copy of a buffer that the host can read once the commands that fill it are done.
pub(crate) struct Readback {
    staging: wgpu::Buffer,
}

/// A copy that was asked for, and arrives when the device is done.
pub(crate) struct Coming {
    staging: wgpu::Buffer,
    receiver: oneshot::Receiver<Result<(), wgpu::BufferAsyncError>>,
}

/// A copy that the host can read now.
pub(crate) struct Mapped(wgpu::Buffer);

/// A copy of a texture: a [`Readback`], [`Coming`] or [`Mapped`] buffer.
pub(crate) struct TextureReadback<B = Readback> {
    bytes: B,
    row: u32,
    padded: u32,
    /// Columns and rows.
    pub(crate) size: [u32; 2],
}

impl Readback {
    /// A readback buffer of `bytes` bytes.
    pub(crate) fn new(gpu: &Gpu, label: &str, bytes: u64) -> Self {
        let staging = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size: bytes,
            usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        Self { staging }
    }

    /// A copy of all of a buffer.
    pub(crate) fn of_buffer(gpu: &Gpu, encoder: &mut wgpu::CommandEncoder, buffer: &wgpu::Buffer) -> Self {
        let readback = Self::new(gpu, "read back", buffer.size());
        encoder.copy_buffer_to_buffer(buffer, 0, &readback.staging, 0, buffer.size());
        readback
    }

    /// The buffer that the copy is written to.
    pub(crate) fn buffer(&self) -> &wgpu::Buffer {
        &self.staging
    }

    /// Asks for its bytes. The commands that fill it must have been submitted.
    pub(crate) fn ask(self) -> Coming {
        let (sender, receiver) = oneshot::channel();
        self.staging.map_async(wgpu::MapMode::Read, .., |result| {
            // The receiver may have been dropped.
            let _ = sender.send(result);
        });
        Coming { staging: self.staging, receiver }
    }

    /// Its bytes. The commands that fill it must have been submitted.
    ///
    /// # Errors
    /// The device failed.
    pub(crate) async fn read(self) -> Result<Vec<u8>, RenderError> {
        self.ask().arrive().await?.bytes()
    }
}

fn lost(error: impl std::fmt::Display) -> RenderError {
    RenderError::Lost(error.to_string())
}

impl Coming {
    /// Waits for it.
    ///
    /// # Errors
    /// The device failed.
    pub(crate) async fn arrive(self) -> Result<Mapped, RenderError> {
        self.receiver.await.map_err(lost)?.map_err(lost)?;
        Ok(Mapped(self.staging))
    }
}

impl Mapped {
    /// Its bytes; any thread may take them.
    ///
    /// # Errors
    /// The device failed.
    pub(crate) fn bytes(self) -> Result<Vec<u8>, RenderError> {
        let bytes = self.0.get_mapped_range(..).map_err(lost)?.to_vec();
        self.0.unmap();
        Ok(bytes)
    }
}

impl TextureReadback {
    /// A copy of level 0 of a 2D texture.
    pub(crate) fn new(gpu: &Gpu, encoder: &mut wgpu::CommandEncoder, texture: &wgpu::Texture) -> Self {
        let texel = texture.format().block_copy_size(None).unwrap_or(4);
        let row = texel * texture.width();
        let padded = row.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
        let bytes = Readback::new(gpu, "read back", u64::from(padded) * u64::from(texture.height()));
        encoder.copy_texture_to_buffer(
            texture.as_image_copy(),
            wgpu::TexelCopyBufferInfo {
                buffer: &bytes.staging,
                layout: wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(padded),
                    rows_per_image: None,
                },
            },
            wgpu::Extent3d { width: texture.width(), height: texture.height(), depth_or_array_layers: 1 },
        );
        Self { bytes, row, padded, size: [texture.width(), texture.height()] }
    }

    /// Asks for its texels. The commands that fill it must have been submitted.
    pub(crate) fn ask(self) -> TextureReadback<Coming> {
        self.with(Readback::ask)
    }

    /// Its texels, rows tightly packed. The commands that fill it must have been submitted.
    ///
    /// # Errors
    /// The device failed.
    pub(crate) async fn read(self) -> Result<Vec<u8>, RenderError> {
        self.ask().arrive().await?.texels()
    }
}

impl<B> TextureReadback<B> {
    fn with<C>(self, step: impl FnOnce(B) -> C) -> TextureReadback<C> {
        TextureReadback { bytes: step(self.bytes), row: self.row, padded: self.padded, size: self.size }
    }
}

impl TextureReadback<Coming> {
    /// Waits for it.
    ///
    /// # Errors
    /// The device failed.
    pub(crate) async fn arrive(self) -> Result<TextureReadback<Mapped>, RenderError> {
        let TextureReadback { bytes, row, padded, size } = self;
        Ok(TextureReadback { bytes: bytes.arrive().await?, row, padded, size })
    }
}

impl TextureReadback<Mapped> {
    /// Its texels, rows tightly packed; any thread may take them.
    ///
    /// # Errors
    /// The device failed.
    pub(crate) fn texels(self) -> Result<Vec<u8>, RenderError> {
        let bytes = self.bytes.bytes()?;
        if self.row == self.padded {
            return Ok(bytes);
        }
        Ok(bytes.chunks(self.padded as usize).flat_map(|r| &r[..self.row as usize]).copied().collect())
    }
}

impl Gpu {
    /// Bytes of a buffer, once the device is done with all that was submitted.
    ///
    /// # Errors
    /// The device failed.
    pub async fn read_buffer(&self, buffer: &wgpu::Buffer) -> Result<Vec<u8>, RenderError> {
        let mut encoder = self.device.create_command_encoder(&Default::default());
        let readback = Readback::of_buffer(self, &mut encoder, buffer);
        self.queue.submit([encoder.finish()]);
        let bytes = readback.read().await?;
        self.check()?;
        Ok(bytes)
    }

    /// Texels of level 0 of a 2D texture, rows tightly packed, once the device is done with all that was submitted.
    ///
    /// # Errors
    /// The device failed.
    pub async fn read_texture(&self, texture: &wgpu::Texture) -> Result<Vec<u8>, RenderError> {
        let mut encoder = self.device.create_command_encoder(&Default::default());
        let readback = TextureReadback::new(self, &mut encoder, texture);
        self.queue.submit([encoder.finish()]);
        let bytes = readback.read().await?;
        self.check()?;
        Ok(bytes)
    }

    /// Resolves when the device is done with everything that was submitted.
    pub(crate) async fn idle(&self) -> Result<(), RenderError> {
        let (sender, receiver) = oneshot::channel();
        self.queue.on_submitted_work_done(move || {
            // The receiver may have been dropped.
            let _ = sender.send(());
        });
        receiver.await.map_err(|e| RenderError::Lost(e.to_string()))?;
        self.check()
    }
}
