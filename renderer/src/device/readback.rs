//! From the device to the host, without waiting: the frame's commands make a copy, whose bytes are available when the
//! device is done.

use futures_channel::oneshot;

use super::gpu::Gpu;
use crate::error::RenderError;

/// A copy of a buffer that the host can read once the commands that fill it are done.
pub(crate) struct Readback {
    staging: wgpu::Buffer,
}

/// A copy of a texture.
pub(crate) struct TextureReadback {
    bytes: Readback,
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

    /// Its bytes. The commands that fill it must have been submitted.
    ///
    /// # Errors
    /// The device failed.
    pub(crate) async fn read(self) -> Result<Vec<u8>, RenderError> {
        let (sender, receiver) = oneshot::channel();
        self.staging.map_async(wgpu::MapMode::Read, .., |result| {
            // The receiver may have been dropped.
            let _ = sender.send(result);
        });
        let lost = |reason: String| RenderError::Lost(reason);
        receiver.await.map_err(|e| lost(e.to_string()))?.map_err(|e| lost(e.to_string()))?;
        let bytes = self.staging.get_mapped_range(..).map_err(|e| lost(e.to_string()))?.to_vec();
        self.staging.unmap();
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

    /// Its texels, rows tightly packed. The commands that fill it must have been submitted.
    ///
    /// # Errors
    /// The device failed.
    pub(crate) async fn read(self) -> Result<Vec<u8>, RenderError> {
        let bytes = self.bytes.read().await?;
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
