//! Colours and spacing: dark and neutral, so that skin is judged by itself; one warm accent.

use eframe::egui::{self, Color32, CornerRadius, FontId, Margin, Stroke, TextStyle, Visuals};

/// What is active, held or selected.
pub(crate) const ACCENT: Color32 = Color32::from_rgb(0xe0, 0x7a, 0x5f);
/// Fill of a weight that follows its track.
pub(crate) const FILL: Color32 = Color32::from_rgb(0x4a, 0x5a, 0x72);
/// Fill of a weight that arrives live.
pub(crate) const LIVE: Color32 = Color32::from_rgb(0x3d, 0x7a, 0x63);
/// Behind the picture.
pub(crate) const BACKDROP: Color32 = Color32::from_rgb(0x14, 0x15, 0x17);
/// Behind widgets.
pub(crate) const PANEL: Color32 = Color32::from_rgb(0x1f, 0x20, 0x23);
/// Of fields and bars.
pub(crate) const FIELD: Color32 = Color32::from_rgb(0x2b, 0x2d, 0x31);
/// Plain text.
pub(crate) const TEXT: Color32 = Color32::from_rgb(0xd6, 0xd7, 0xd9);
/// Text of less weight; 5.9 to 1 on a panel.
pub(crate) const WEAK: Color32 = Color32::from_rgb(0x9b, 0x9e, 0xa4);
/// Errors.
pub(crate) const ERROR: Color32 = Color32::from_rgb(0xff, 0x8f, 0x85);
/// Behind errors.
pub(crate) const ERROR_FILL: Color32 = Color32::from_rgb(0x45, 0x1f, 0x1f);
/// Lines between things.
pub(crate) const LINE: Color32 = Color32::from_rgb(0x3a, 0x3c, 0x41);

/// Height of a row of a list, points.
pub(crate) const ROW: f32 = 19.0;

/// Sets the look of a window.
pub(crate) fn set(ctx: &egui::Context) {
    ctx.set_theme(egui::Theme::Dark);
    ctx.all_styles_mut(|style| {
        let mut visuals = Visuals::dark();
        visuals.panel_fill = PANEL;
        visuals.window_fill = PANEL;
        visuals.extreme_bg_color = FIELD;
        visuals.faint_bg_color = FIELD;
        visuals.window_stroke = Stroke::new(1.0, LINE);
        visuals.selection.bg_fill = ACCENT.gamma_multiply(0.55);
        visuals.selection.stroke = Stroke::new(1.0, Color32::WHITE);
        visuals.weak_text_color = Some(WEAK);
        let radius = CornerRadius::same(3);
        let widgets = &mut visuals.widgets;
        for widget in [
            &mut widgets.noninteractive,
            &mut widgets.inactive,
            &mut widgets.hovered,
            &mut widgets.active,
            &mut widgets.open,
        ] {
            widget.corner_radius = radius;
        }
        widgets.noninteractive.bg_stroke = Stroke::new(1.0, LINE);
        widgets.noninteractive.fg_stroke = Stroke::new(1.0, TEXT);
        widgets.inactive.weak_bg_fill = FIELD;
        widgets.inactive.bg_fill = FIELD;
        widgets.inactive.fg_stroke = Stroke::new(1.0, TEXT);
        widgets.hovered.weak_bg_fill = Color32::from_rgb(0x38, 0x3b, 0x40);
        widgets.active.weak_bg_fill = ACCENT.gamma_multiply(0.6);
        visuals.window_corner_radius = CornerRadius::same(5);
        visuals.menu_corner_radius = CornerRadius::same(4);
        style.visuals = visuals;
        style.spacing.item_spacing = egui::vec2(6.0, 4.0);
        style.spacing.button_padding = egui::vec2(7.0, 2.0);
        style.spacing.interact_size.y = 20.0;
        style.spacing.indent = 10.0;
        style.spacing.window_margin = Margin::same(10);
        style.spacing.combo_width = 90.0;
        style.spacing.scroll = egui::style::ScrollStyle::thin();
        for (text, size) in [
            (TextStyle::Small, 11.0),
            (TextStyle::Body, 12.5),
            (TextStyle::Button, 12.5),
            (TextStyle::Heading, 14.0),
        ] {
            style.text_styles.insert(text, FontId::proportional(size));
        }
        style.text_styles.insert(TextStyle::Monospace, FontId::monospace(11.5));
        style.interaction.tooltip_delay = 0.4;
    });
}
