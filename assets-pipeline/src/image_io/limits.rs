//! How large an image may be before its header is believed.

use std::path::Path;

use super::ImageError;

/// Limits that hold before anything of an image is allocated: a header may claim any size.
///
/// With 2 GiB of memory, the default of a process, a decoder stays below that. They admit grey maps of 16384 x 16384 texels and colour maps of about
/// 11000 x 11000; raise [`Limits::bytes`] for larger colour maps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Largest width and largest height, texels.
    pub side: u32,
    /// Largest product of width and height, texels.
    pub pixels: u64,
    /// Largest file, and largest sum of the decoded samples and the floats made of them, bytes.
    pub bytes: u64,
}

impl Default for Limits {
    /// Those of this process ([`rubor_rig::limits`]): in proportion to the memory that it may take.
    fn default() -> Self {
        let bytes = rubor_rig::limits::Limits::of_process().memory_bytes();
        Self { side: 1 << 16, pixels: bytes / 8, bytes }
    }
}

impl Limits {
    /// Accepts a claimed size with this many bytes of working memory per texel, or says which limit it breaks.
    pub(super) fn check(
        &self,
        file: &Path,
        at: &str,
        (width, height): (u64, u64),
        bytes_per_pixel: u64,
    ) -> Result<(u32, u32), ImageError> {
        let fail = |expected: String| ImageError::Content {
            file: file.to_owned(),
            at: at.into(),
            found: format!("{width}x{height} texels"),
            expected,
        };
        if width == 0 || height == 0 {
            return Err(fail("sides of at least 1 texel".into()));
        }
        let side = u64::from(self.side);
        if width > side || height > side {
            return Err(fail(format!("sides of at most {side} texels (the limit on sides)")));
        }
        // Sides are 32-bit numbers here, so the product fits.
        let pixels = width * height;
        if pixels > self.pixels {
            return Err(fail(format!("at most {} texels in all (the limit on pixels)", self.pixels)));
        }
        let bytes = pixels.saturating_mul(bytes_per_pixel);
        if bytes > self.bytes {
            let found = format!("{} MiB to decode it", bytes >> 20);
            return Err(fail(format!("at most {} MiB (the limit on memory), not {found}", self.bytes >> 20)));
        }
        Ok((width as u32, height as u32))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_limit_is_named_and_can_be_set() {
        let limits = Limits { side: 100, pixels: 5000, bytes: 10_000 };
        let check = |size, per_pixel| limits.check("a.png".as_ref(), "size", size, per_pixel);
        assert_eq!(check((100, 50), 2).unwrap(), (100, 50));
        for (size, per_pixel, word) in [
            ((101, 1), 1, "sides"),
            ((100, 51), 1, "pixels"),
            ((100, 50), 3, "memory"),
            ((0, 5), 1, "at least 1"),
        ] {
            let message = check(size, per_pixel).unwrap_err().to_string();
            assert!(message.contains(word) && message.contains("a.png"), "{message}");
        }
        assert!(limits.check("a".as_ref(), "size", (1 << 32, 1 << 32), u64::MAX).is_err());
        // The documentation of the defaults promises this.
        let default = Limits::default();
        assert!(default.check("a".as_ref(), "size", (16384, 16384), 6).is_ok());
        assert!(default.check("a".as_ref(), "size", (11000, 11000), 15).is_ok());
    }
}
