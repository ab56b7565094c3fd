//! The lens of a frame, and what else decides how its light becomes a picture.

use glam::Vec3;

use super::Camera;

/// Lens, place of the backdrop and number of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Optics {
    /// Number of the frame: film grain and dither follow it.
    pub frame: u32,
    /// Height of the sensor, millimetres. With the field of view it gives the focal length.
    pub sensor_height_mm: f32,
    /// Focal length over the width of the aperture; without it everything is in focus.
    pub f_stop: Option<f32>,
    /// Distance of what is in focus along the view, metres.
    pub focus_metres: f32,
    /// What the backdrop is lit behind, world space, metres.
    pub subject: Vec3,
    /// Its height, metres: the unit of the backdrop.
    pub subject_height: f32,
}

impl Default for Optics {
    fn default() -> Self {
        Self {
            frame: 0,
            sensor_height_mm: 24.0,
            f_stop: None,
            focus_metres: 1.0,
            subject: Vec3::ZERO,
            subject_height: 0.23,
        }
    }
}

impl Optics {
    /// Focal length of a camera with this sensor, millimetres.
    pub fn focal_length_mm(&self, camera: &Camera) -> f32 {
        0.5 * self.sensor_height_mm / (0.5 * camera.fov_degrees.to_radians()).tan()
    }

    /// Radius of the circle of confusion of what is infinitely far, pixels of a picture of a height, from the thin-lens
    /// equation: `f^2 / (N (s - f))` is its diameter on the sensor (focal length f, f-number N, focus at s). At a distance d it
    /// is `1 - s / d` times as large; below 0 in front of the focus. 0 without an aperture.
    pub fn far_radius_px(&self, camera: &Camera, height_px: u32) -> f32 {
        let Some(f_stop) = self.f_stop else { return 0.0 };
        let focal = self.focal_length_mm(camera);
        // A lens does not focus nearer than a tenth more than its focal length.
        let focus = (1000.0 * self.focus_metres).max(1.1 * focal);
        let diameter_mm = focal * focal / (f_stop * (focus - focal));
        0.5 * diameter_mm / self.sensor_height_mm * height_px as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn circles_of_confusion_are_those_of_the_thin_lens() {
        let camera = Camera {
            position: Vec3::Z,
            target: Vec3::ZERO,
            up: Vec3::Y,
            fov_degrees: 2.0 * (12.0f32 / 85.0).atan().to_degrees(),
        };
        let optics = Optics { f_stop: Some(2.8), focus_metres: 1.4, ..Optics::default() };
        assert!((optics.focal_length_mm(&camera) - 85.0).abs() < 1e-3);
        // By the equation of the lens: images of the focus and of infinity lie at v and at f; the cone of the aperture between.
        let (f, s, n) = (85.0f64, 1400.0, 2.8);
        let v = 1.0 / (1.0 / f - 1.0 / s);
        let diameter_mm = f / n * (v - f) / f;
        let expected = 0.5 * diameter_mm / 24.0 * 1080.0;
        let found = f64::from(optics.far_radius_px(&camera, 1080));
        assert!((found / expected - 1.0).abs() < 1e-4, "{found}, expected {expected}");
        assert_eq!(Optics::default().far_radius_px(&camera, 1080), 0.0);
    }
}
