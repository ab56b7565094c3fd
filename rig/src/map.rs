//! A map: values over the unit square of texture space.

/// A rectangle of values, row 0 at the top (v = 0), channels interleaved.
///
/// Texel (x, y) covers [x, x+1) / width by [y, y+1) / height in texture space; its value stands at its centre.
#[derive(Clone, Debug, PartialEq)]
pub struct Map {
    /// Texels per row, at least 1.
    pub width: u32,
    /// Rows, at least 1.
    pub height: u32,
    /// Values per texel.
    pub channels: u32,
    /// `width * height * channels` values.
    pub values: Vec<f32>,
}

impl Map {
    /// A map of one value everywhere.
    pub fn filled(width: u32, height: u32, texel: &[f32]) -> Self {
        let values = texel.repeat(width as usize * height as usize);
        Self { width, height, channels: texel.len() as u32, values }
    }

    /// The values of a texel.
    ///
    /// # Panics
    /// Outside the map.
    pub fn texel(&self, x: u32, y: u32) -> &[f32] {
        let c = self.channels as usize;
        let i = (y as usize * self.width as usize + x as usize) * c;
        &self.values[i..i + c]
    }

    /// Bilinear sample of one channel, clamped at the borders.
    pub fn sample(&self, u: f32, v: f32, channel: u32) -> f32 {
        let x = (u * self.width as f32 - 0.5).clamp(0.0, (self.width - 1) as f32);
        let y = (v * self.height as f32 - 0.5).clamp(0.0, (self.height - 1) as f32);
        let (x0, y0) = (x as u32, y as u32);
        let (x1, y1) = ((x0 + 1).min(self.width - 1), (y0 + 1).min(self.height - 1));
        let (fx, fy) = (x - x0 as f32, y - y0 as f32);
        let at = |x, y| self.texel(x, y)[channel as usize];
        let top = at(x0, y0) * (1.0 - fx) + at(x1, y0) * fx;
        let bottom = at(x0, y1) * (1.0 - fx) + at(x1, y1) * fx;
        top * (1.0 - fy) + bottom * fy
    }

    /// Checks sizes and that all values are finite; the error is (place, found, expected).
    pub(crate) fn check(&self, name: &str, channels: u32) -> Result<(), (String, String, &'static str)> {
        let size = self.width as usize * self.height as usize * self.channels as usize;
        if self.channels != channels || size == 0 || self.values.len() != size {
            let found = format!(
                "{}x{} with {} channels and {} values",
                self.width,
                self.height,
                self.channels,
                self.values.len()
            );
            let expected = match channels {
                1 => "a filled map of 1 channel",
                2 => "a filled map of 2 channels",
                _ => "a filled map of 3 channels",
            };
            return Err((format!("map {name}"), found, expected));
        }
        match self.values.iter().position(|v| !v.is_finite()) {
            None => Ok(()),
            Some(i) => {
                let texel = i / channels as usize;
                let at = format!(
                    "map {name}, texel ({}, {})",
                    texel % self.width as usize,
                    texel / self.width as usize
                );
                Err((at, self.values[i].to_string(), "finite values"))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sample_is_exact_at_texel_centres_and_linear_between() {
        let map = Map { width: 2, height: 1, channels: 1, values: vec![1.0, 3.0] };
        assert_eq!(map.sample(0.25, 0.5, 0), 1.0);
        assert_eq!(map.sample(0.75, 0.5, 0), 3.0);
        assert_eq!(map.sample(0.5, 0.1, 0), 2.0);
        assert_eq!(map.sample(-4.0, 9.0, 0), 1.0);
    }
}
