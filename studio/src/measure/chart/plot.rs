//! Time against error as SVG: points with direct labels, the front as a line. Colours are variables of the page or of the file
//! itself, light and dark.
//!
//! ```text
//! dots --scales--> places --labels where there is room--> <svg>
//! ```

use std::fmt::Write;

/// A choice on a plot.
#[derive(Clone, Debug, PartialEq)]
pub struct Dot {
    /// Its label.
    pub name: String,
    /// Milliseconds of a frame.
    pub ms: f64,
    /// Tenth and ninetieth percentile, where they are known.
    pub spread_ms: Option<[f64; 2]>,
    /// Its error, 0 or more.
    pub error: f64,
    /// Whether it is on the front.
    pub is_on_front: bool,
    /// What a page opens for it: a group, a choice and perhaps a scene.
    pub opens: String,
}

/// A plot.
#[derive(Clone, Debug)]
pub struct Plot<'a> {
    /// Words above it.
    pub title: &'a str,
    /// Name and unit of the error.
    pub error_axis: &'a str,
    /// Choices.
    pub dots: &'a [Dot],
    /// An error without a time, as a line: its name and the error.
    pub floor: Option<(&'a str, f64)>,
    /// Width and height, units of the picture.
    pub size: [f64; 2],
    /// Whether dots and axes have labels; a small plot has only ticks.
    pub is_labelled: bool,
}

/// Colours in light and dark, for a file that stands alone.
pub const COLORS: &str = "svg{--paper:#fff;--ink:#1d1f24;--muted:#6a6f7a;--rule:#d9dbe0;--dot:#8a8f9a;--front:#b3202c}\
@media(prefers-color-scheme:dark){svg{--paper:#15171b;--ink:#e8e9ec;--muted:#a2a7b2;--rule:#33363d;--dot:#7d828d;--front:#ff7a7a}}\
svg{font:13px system-ui,sans-serif;background:var(--paper)}text{fill:var(--ink);paint-order:stroke;stroke:var(--paper);stroke-width:3px}";

/// Heights of letters and their mean width, units.
const LINE: f64 = 15.0;
const LETTER: f64 = 6.9;
const RADIUS: f64 = 4.5;

/// A scale from values to places.
#[derive(Clone, Copy, Debug)]
struct Scale {
    low: f64,
    high: f64,
    is_log: bool,
    /// Places of low and high.
    from: f64,
    to: f64,
}

impl Scale {
    fn place(self, value: f64) -> f64 {
        let f = |v: f64| if self.is_log { v.ln() } else { v };
        let t = (f(value) - f(self.low)) / (f(self.high) - f(self.low)).max(1e-12);
        self.from + t.clamp(0.0, 1.0) * (self.to - self.from)
    }

    /// Round values inside, at most about `most`.
    fn ticks(self, most: usize) -> Vec<f64> {
        let mut found = Vec::new();
        let fine = [1.0, 1.2, 1.4, 1.6, 1.8, 2.0, 2.5, 3.0, 3.5, 4.0, 4.5, 5.0, 6.0, 7.0, 8.0, 9.0];
        for steps in [&fine[..], &[1.0, 1.5, 2.0, 3.0, 5.0, 7.0], &[1.0, 2.0, 5.0], &[1.0, 3.0], &[1.0]] {
            found = if self.is_log {
                let decades = self.low.log10().floor() as i32..=self.high.log10().ceil() as i32;
                decades.flat_map(|d| steps.iter().map(move |s| s * 10f64.powi(d))).collect()
            } else {
                let rough = (self.high - self.low) / most.max(1) as f64;
                let decade = 10f64.powf(rough.log10().floor());
                let step = [1.0, 2.0, 5.0, 10.0]
                    .map(|s| s * decade)
                    .into_iter()
                    .find(|s| *s >= rough)
                    .unwrap_or(rough);
                let first = (self.low / step).ceil() as i64;
                (first..first + 2 * most as i64).map(|i| i as f64 * step).collect::<Vec<_>>()
            };
            found.retain(|v| *v >= self.low * (1.0 - 1e-9) && *v <= self.high * (1.0 + 1e-9));
            if found.len() <= most {
                break;
            }
        }
        found
    }
}

/// Labels of ticks: those of a straight axis have the digits that tell them apart.
fn tick_labels(ticks: &[f64], is_log: bool) -> Vec<String> {
    let step = ticks.windows(2).map(|w| (w[1] - w[0]).abs()).fold(f64::INFINITY, f64::min);
    if is_log || !step.is_finite() || step <= 0.0 {
        return ticks.iter().map(|v| number(*v)).collect();
    }
    let digits = (-step.log10().floor()).clamp(0.0, 9.0) as usize;
    ticks.iter().map(|v| format!("{v:.digits$}")).collect()
}

/// A number in as few digits as say it.
pub fn number(v: f64) -> String {
    let digits = match v.abs() {
        v if v == 0.0 || v >= 100.0 => 0,
        v if v >= 10.0 => 1,
        v if v >= 1.0 => 2,
        v => (2.0 - v.log10().floor()).min(6.0) as usize,
    };
    let text = format!("{v:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// Text inside of SVG and HTML.
pub fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, 0.0), |(low, high), v| (low.min(v), high.max(v)))
}

/// A box: left, top, right, bottom.
type Area = [f64; 4];

fn overlap(a: &Area, b: &Area) -> bool {
    a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3]
}

/// The plot as an `<svg>`; empty without dots.
pub fn svg(plot: &Plot<'_>) -> String {
    let (ms_low, ms_high) = range(plot.dots.iter().map(|d| d.ms).filter(|v| *v > 0.0));
    if plot.dots.is_empty() || ms_high <= 0.0 {
        return String::new();
    }
    let [width, height] = plot.size;
    let floor = plot.floor.map(|(_, error)| error);
    let errors = plot.dots.iter().map(|d| d.error).chain(floor).filter(|e| *e > 0.0 && e.is_finite());
    let (error_low, error_high, is_exact) = match range(errors) {
        (low, high) if high > 0.0 => (low, high, false),
        // Any range: all lie at 0.
        _ => (0.1, 1.0, true),
    };
    let [left, top, right, bottom] = if plot.is_labelled {
        [80.0, 34.0, width - 150.0, height - 46.0]
    } else {
        [34.0, 24.0, width - 8.0, height - 20.0]
    };
    let is_wide = ms_high / ms_low > 1.8;
    let air =
        if is_wide { (ms_high / ms_low).powf(0.06) } else { 1.0 + 0.08 * (1.0 - ms_low / ms_high) + 0.004 };
    let x = Scale { low: ms_low / air, high: ms_high * air, is_log: is_wide, from: left, to: right };
    let has_exact = plot.dots.iter().any(|d| d.error <= 0.0);
    let y_low = error_low / if has_exact { 2.0 } else { 1.25 };
    let y = Scale { low: y_low, high: error_high * 1.25, is_log: true, from: bottom, to: top };

    let mut out = String::new();
    let _ = write!(
        out,
        r#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" height="{height}" role="img" aria-label="{}">"#,
        escaped(plot.title)
    );
    let size = if plot.is_labelled { 15 } else { 12 };
    let _ = write!(
        out,
        r#"<text x="{}" y="{}" font-size="{size}" font-weight="600">{}</text>"#,
        if plot.is_labelled { left } else { 6.0 },
        if plot.is_labelled { 20 } else { 15 },
        escaped(plot.title)
    );
    let small = if plot.is_labelled { 12 } else { 9 };
    let ticks = x.ticks(if plot.is_labelled { 8 } else { 3 });
    for (v, label) in ticks.iter().zip(tick_labels(&ticks, x.is_log)) {
        let at = x.place(*v);
        let _ = write!(
            out,
            r#"<line x1="{at:.1}" y1="{top}" x2="{at:.1}" y2="{bottom}" stroke="var(--rule)"/><text x="{at:.1}" y="{:.1}" text-anchor="middle" font-size="{small}" style="fill:var(--muted)">{}</text>"#,
            bottom + f64::from(small) + 4.0,
            label
        );
    }
    let errors = if is_exact { Vec::new() } else { y.ticks(if plot.is_labelled { 8 } else { 4 }) };
    for v in errors {
        let at = y.place(v);
        let _ = write!(
            out,
            r#"<line x1="{left}" y1="{at:.1}" x2="{right}" y2="{at:.1}" stroke="var(--rule)"/><text x="{:.1}" y="{:.1}" text-anchor="end" font-size="{small}" style="fill:var(--muted)">{}</text>"#,
            left - 6.0,
            at + 4.0,
            number(v)
        );
    }
    if has_exact {
        let _ = write!(
            out,
            r#"<text x="{:.1}" y="{:.1}" text-anchor="end" font-size="{small}" style="fill:var(--muted)">0</text>"#,
            left - 6.0,
            bottom + 4.0
        );
    }
    if plot.is_labelled {
        let _ = write!(
            out,
            r#"<text x="{:.1}" y="{:.1}" text-anchor="middle" font-size="12" style="fill:var(--muted)">time of a frame, ms{}</text>"#,
            (left + right) / 2.0,
            height - 10.0,
            if is_wide { " (logarithmic)" } else { "" }
        );
        let _ = write!(
            out,
            r#"<text transform="translate(14 {:.1}) rotate(-90)" text-anchor="middle" font-size="12" style="fill:var(--muted)">{}</text>"#,
            (top + bottom) / 2.0,
            escaped(plot.error_axis)
        );
    }
    // The front, from fast to exact, as stairs: what a time buys.
    let mut front: Vec<&Dot> = plot.dots.iter().filter(|d| d.is_on_front).collect();
    front.sort_by(|a, b| a.ms.total_cmp(&b.ms));
    let mut path = String::new();
    for (i, dot) in front.iter().enumerate() {
        let (px, py) = (x.place(dot.ms), y.place(dot.error.max(y.low)));
        let _ = if i == 0 { write!(path, "M{px:.1} {py:.1}") } else { write!(path, "H{px:.1}V{py:.1}") };
    }
    if front.len() > 1 {
        let _ = write!(path, "H{right}");
        let _ = write!(
            out,
            r#"<path d="{path}" fill="none" stroke="var(--front)" stroke-width="1.5" opacity="0.7"/>"#
        );
    }
    if let Some((name, error)) = plot.floor.filter(|(_, error)| *error > 0.0) {
        let at = y.place(error);
        let _ = write!(
            out,
            r#"<line x1="{left}" y1="{at:.1}" x2="{right}" y2="{at:.1}" stroke="var(--muted)" stroke-dasharray="5 4"/>"#
        );
        if plot.is_labelled {
            let _ = write!(
                out,
                r#"<text x="{:.1}" y="{:.1}" font-size="12" style="fill:var(--muted)">{}</text>"#,
                left + 4.0,
                at - 5.0,
                escaped(name)
            );
        }
    }
    let mut taken: Vec<Area> = Vec::new();
    for dot in plot.dots {
        let (px, py) = (x.place(dot.ms), y.place(dot.error.max(y.low)));
        taken.push([px - RADIUS, py - RADIUS, px + RADIUS, py + RADIUS]);
    }
    let mut order: Vec<&Dot> = plot.dots.iter().collect();
    order.sort_by(|a, b| b.is_on_front.cmp(&a.is_on_front).then(b.error.total_cmp(&a.error)));
    for dot in order {
        let (px, py) = (x.place(dot.ms), y.place(dot.error.max(y.low)));
        let color = if dot.is_on_front { "var(--front)" } else { "var(--dot)" };
        if let Some([p10, p90]) = dot.spread_ms.filter(|_| plot.is_labelled) {
            let _ = write!(
                out,
                r#"<line x1="{:.1}" y1="{py:.1}" x2="{:.1}" y2="{py:.1}" stroke="{color}"/>"#,
                x.place(p10),
                x.place(p90)
            );
        }
        let radius = if plot.is_labelled { RADIUS } else { 3.0 };
        let about = format!("{}: {} ms, error {}", dot.name, number(dot.ms), number(dot.error));
        let _ = write!(
            out,
            r#"<circle class="dot" tabindex="0" role="button" data-opens="{}" cx="{px:.1}" cy="{py:.1}" r="{radius}" fill="{color}"><title>{}</title></circle>"#,
            escaped(&dot.opens),
            escaped(&about)
        );
        if !plot.is_labelled {
            continue;
        }
        let wide = LETTER * dot.name.chars().count() as f64;
        // Right of the dot, then left, then further up and down.
        let places = (0..14).flat_map(|i| {
            let away = f64::from((i + 1) / 2) * if i % 2 == 0 { 1.0 } else { -1.0 } * 0.8 * LINE;
            [(px + RADIUS + 4.0, away), (px - RADIUS - 4.0 - wide, away)]
        });
        let boxed =
            |(lx, away): (f64, f64)| [lx, py + away - 0.45 * LINE, lx + wide, py + away + 0.45 * LINE];
        let is_inside =
            |area: &Area| area[0] > left && area[2] < width && area[1] > top - LINE && area[3] < bottom + 2.0;
        let free = places.map(boxed).find(|area| is_inside(area) && !taken.iter().any(|t| overlap(t, area)));
        if let Some(area) = free {
            taken.push(area);
            let weight = if dot.is_on_front { 600 } else { 400 };
            let middle = (area[1] + area[3]) / 2.0;
            if (middle - py).abs() > LINE {
                let end = if area[0] > px { area[0] - 2.0 } else { area[2] + 2.0 };
                let _ = write!(
                    out,
                    r#"<line x1="{px:.1}" y1="{py:.1}" x2="{end:.1}" y2="{middle:.1}" stroke="var(--rule)"/>"#
                );
            }
            let _ = write!(
                out,
                r#"<text x="{:.1}" y="{:.1}" font-size="12" font-weight="{weight}">{}</text>"#,
                area[0],
                area[3] - 2.5,
                escaped(&dot.name)
            );
        }
    }
    out.push_str("</svg>");
    out
}

/// A line of a plot.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// Its label.
    pub name: String,
    /// One value for each place of the axis.
    pub values: Vec<f64>,
}

/// Lines over an axis, as an `<svg>`, each with its label at the right; empty without lines. The axis is words and values, and
/// logarithmic where its values are factors.
pub fn lines(
    title: &str,
    axis: (&str, &[f64], bool),
    value_axis: &str,
    lines: &[Line],
    size: [f64; 2],
) -> String {
    let (moves, places, is_geometric) = axis;
    let [width, height] = size;
    let [left, top, right, bottom] = [80.0, 34.0, width - 230.0, height - 46.0];
    let (high, low) = (range(lines.iter().flat_map(|l| l.values.iter().copied())).1, 0.0);
    let Some((first, last)) = places.first().zip(places.last()) else { return String::new() };
    if lines.is_empty() {
        return String::new();
    }
    let x =
        Scale { low: first.min(*last), high: first.max(*last), is_log: is_geometric, from: left, to: right };
    let y = Scale { low, high: high.max(1e-6) * 1.05, is_log: false, from: bottom, to: top };
    let mut out = String::new();
    let _ = write!(
        out,
        r#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" height="{height}" role="img" aria-label="{0}"><text x="{left}" y="20" font-size="15" font-weight="600">{0}</text>"#,
        escaped(title)
    );
    let ticks = x.ticks(9);
    for (v, label) in ticks.iter().zip(tick_labels(&ticks, x.is_log)) {
        let at = x.place(*v);
        let _ = write!(
            out,
            r#"<line x1="{at:.1}" y1="{top}" x2="{at:.1}" y2="{bottom}" stroke="var(--rule)"/><text x="{at:.1}" y="{:.1}" text-anchor="middle" font-size="12" style="fill:var(--muted)">{}</text>"#,
            bottom + 16.0,
            label
        );
    }
    for v in y.ticks(6) {
        let at = y.place(v);
        let _ = write!(
            out,
            r#"<line x1="{left}" y1="{at:.1}" x2="{right}" y2="{at:.1}" stroke="var(--rule)"/><text x="{:.1}" y="{:.1}" text-anchor="end" font-size="12" style="fill:var(--muted)">{}</text>"#,
            left - 6.0,
            at + 4.0,
            number(v)
        );
    }
    let _ = write!(
        out,
        r#"<text x="{:.1}" y="{:.1}" text-anchor="middle" font-size="12" style="fill:var(--muted)">{}</text><text transform="translate(14 {:.1}) rotate(-90)" text-anchor="middle" font-size="12" style="fill:var(--muted)">{}</text>"#,
        (left + right) / 2.0,
        height - 10.0,
        escaped(moves),
        (top + bottom) / 2.0,
        escaped(value_axis)
    );
    let worst = |l: &Line| l.values.iter().copied().fold(0.0, f64::max);
    let most = lines.iter().map(worst).fold(0.0, f64::max);
    // Labels from the top, none above the end of its line by less than its height.
    let mut ends: Vec<(&Line, f64)> =
        lines.iter().map(|l| (l, y.place(l.values.last().copied().unwrap_or(0.0)))).collect();
    ends.sort_by(|a, b| a.1.total_cmp(&b.1));
    let step = LINE.min((bottom - top) / ends.len() as f64);
    let mut label = top;
    let count = ends.len() as f64;
    for (i, (line, end)) in ends.into_iter().enumerate() {
        label = if i == 0 { end } else { end.max(label + step) };
        label = label.min(bottom - (count - 1.0 - i as f64) * step).max(top + i as f64 * step);
        let is_worst = worst(line) >= most;
        let color = if is_worst { "var(--front)" } else { "var(--dot)" };
        let mut path = String::new();
        for (i, (at, v)) in places.iter().zip(&line.values).enumerate() {
            let _ = write!(path, "{}{:.1} {:.1}", if i == 0 { "M" } else { "L" }, x.place(*at), y.place(*v));
        }
        let last_x = places.get(line.values.len().saturating_sub(1)).map_or(right, |v| x.place(*v));
        let _ = write!(
            out,
            r#"<path d="{path}" fill="none" stroke="{color}" stroke-width="{}"><title>{}</title></path>"#,
            if is_worst { 2.0 } else { 1.2 },
            escaped(&line.name)
        );
        let _ = write!(
            out,
            r#"<line x1="{last_x:.1}" y1="{end:.1}" x2="{:.1}" y2="{label:.1}" stroke="var(--rule)"/><text x="{:.1}" y="{:.1}" font-size="12" font-weight="{}">{}, {}</text>"#,
            right + 14.0,
            right + 17.0,
            label + 4.0,
            if is_worst { 600 } else { 400 },
            escaped(&line.name),
            number(worst(line))
        );
    }
    out.push_str("</svg>");
    out
}

/// Plots one below the other in a file of its own, under a line of words.
pub fn file(plots: &[String], size: [f64; 2], about: &str) -> String {
    let [width, height] = size;
    let shown: Vec<&String> = plots.iter().filter(|p| !p.is_empty()).collect();
    let all = 30.0 + height * shown.len() as f64;
    let mut out = format!(
        r#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {all}" width="{width}" height="{all}"><style>{COLORS}</style><rect width="{width}" height="{all}" style="fill:var(--paper)"/><text x="12" y="20" font-size="12" style="fill:var(--muted)">{}</text>"#,
        escaped(about)
    );
    for (i, plot) in shown.iter().enumerate() {
        let _ = write!(out, r#"<g transform="translate(0 {})">{plot}</g>"#, 30.0 + height * i as f64);
    }
    out.push_str("</svg>\n");
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dot(name: &str, ms: f64, error: f64, is_on_front: bool) -> Dot {
        Dot { name: name.into(), ms, spread_ms: None, error, is_on_front, opens: String::new() }
    }

    #[test]
    fn faster_is_left_and_worse_is_up() {
        let dots = [dot("none", 1.0, 0.5, true), dot("a & b", 2.0, 0.05, true), dot("exact", 3.0, 0.0, true)];
        let plot = Plot {
            title: "t",
            error_axis: "e",
            dots: &dots,
            floor: Some(("floor", 0.01)),
            size: [700.0, 400.0],
            is_labelled: true,
        };
        let text = svg(&plot);
        let at = |axis: &str| -> Vec<f64> {
            let of = |part: &str| part.split('"').next().unwrap().parse().unwrap();
            text.split(&format!(r#" {axis}=""#)).skip(1).map(of).collect()
        };
        // Labels are drawn in the order of their errors.
        let (x, y) = (at("cx"), at("cy"));
        assert!(x[0] < x[1] && x[1] < x[2], "{x:?}");
        assert!(y[0] < y[1] && y[1] < y[2], "{y:?}");
        assert!(text.contains("a &amp; b") && text.contains("floor"));
        assert!(svg(&Plot { dots: &[], ..plot }).is_empty());
    }

    #[test]
    fn labels_do_not_lie_on_each_other() {
        let dots: Vec<Dot> =
            (0..6).map(|i| dot(&format!("method {i}"), 1.0, 0.1 + 1e-4 * f64::from(i), false)).collect();
        let plot = Plot {
            title: "t",
            error_axis: "e",
            dots: &dots,
            floor: None,
            size: [700.0, 400.0],
            is_labelled: true,
        };
        assert_eq!(svg(&plot).matches("font-weight=\"400\">method ").count(), 6);
    }

    #[test]
    fn numbers_are_short() {
        let found = [0.0, 0.0123, 0.5, 1.25, 12.34, 1234.5].map(number);
        assert_eq!(found, ["0", "0.0123", "0.5", "1.25", "12.3", "1234"]);
    }
}
