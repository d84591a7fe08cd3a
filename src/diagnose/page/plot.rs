//! Plots as SVG. `plotters` finds ticks and draws; colours become CSS variables afterwards, so that one drawing serves light,
//! dark and paper.

use super::html::escaped;
use plotters::coord::ranged1d::{AsRangedCoord, Ranged, ValueFormatter};
use plotters::prelude::*;

/// Meaning of a curve.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Colour {
    Ink,
    Faint,
    Grid,
    Log,
    Simulated,
    Effect,
    Corrected,
    /// 0 (nothing) to [`HOTTEST`].
    Heat(u8),
}

/// The hottest colour.
pub(super) const HOTTEST: u8 = 5;

impl Colour {
    const ALL: [Self; 13] = [
        Self::Ink,
        Self::Faint,
        Self::Grid,
        Self::Log,
        Self::Simulated,
        Self::Effect,
        Self::Corrected,
        Self::Heat(0),
        Self::Heat(1),
        Self::Heat(2),
        Self::Heat(3),
        Self::Heat(4),
        Self::Heat(5),
    ];

    /// The CSS variable.
    pub fn css(self) -> String {
        match self {
            Self::Ink => "--ink".into(),
            Self::Faint => "--faint".into(),
            Self::Grid => "--grid".into(),
            Self::Log => "--log".into(),
            Self::Simulated => "--simulated".into(),
            Self::Effect => "--effect".into(),
            Self::Corrected => "--corrected".into(),
            Self::Heat(heat) => format!("--heat{heat}"),
        }
    }

    /// A colour that stands for it until the drawing is done.
    fn mark(self) -> RGBColor {
        let place = Self::ALL.iter().position(|other| *other == self).unwrap_or(0);
        RGBColor(1, 0, place as u8)
    }
}

/// A curve, or dots.
pub(super) struct PlotCurve {
    pub colour: Colour,
    /// Width of a line, or radius of dots, in pixels on a page.
    pub size: f64,
    pub dots: bool,
    pub points: Vec<(f64, f64)>,
}

impl PlotCurve {
    pub fn line(colour: Colour, points: Vec<(f64, f64)>) -> Self {
        // What is real lies below, and shows on both sides of what fits it.
        let size = if colour == Colour::Log { 4.0 } else { 1.5 };
        Self { colour, size, dots: false, points: thinned(points) }
    }

    pub fn dots(colour: Colour, points: Vec<(f64, f64)>) -> Self {
        Self { colour, size: 2.0, dots: true, points }
    }
}

/// Points to draw: more than a screen has. Of each stretch the lowest and the highest are kept, so that no peak is lost.
fn thinned(points: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    const STRETCHES: usize = 700;
    if points.len() <= 2 * STRETCHES {
        return points;
    }
    let size = points.len().div_ceil(STRETCHES);
    let mut kept = Vec::with_capacity(2 * STRETCHES);
    for stretch in points.chunks(size) {
        let extreme = |sign: f64| {
            let best =
                (0..stretch.len()).max_by(|a, b| (sign * stretch[*a].1).total_cmp(&(sign * stretch[*b].1)));
            best.unwrap_or(0)
        };
        let (low, high) = (extreme(-1.0), extreme(1.0));
        kept.extend([stretch[low.min(high)], stretch[low.max(high)]]);
    }
    kept
}

/// A plot.
pub(super) struct Plot<'a> {
    /// Text alternative of the plot.
    pub title: &'a str,
    pub x: &'a str,
    pub y: &'a str,
    pub curves: Vec<PlotCurve>,
    /// Width and height in pixels on a page.
    pub size: (u32, u32),
    pub logarithmic: bool,
    /// One scale for both axes.
    pub equal: bool,
    pub y_range: Option<(f64, f64)>,
}

impl<'a> Plot<'a> {
    pub fn new(title: &'a str, x: &'a str, y: &'a str, curves: Vec<PlotCurve>) -> Self {
        Self { title, x, y, curves, size: (860, 280), logarithmic: false, equal: false, y_range: None }
    }
}

/// The backend knows whole pixels only: it draws larger than a page shows.
const SCALE: u32 = 2;

impl Plot<'_> {
    /// The drawing; empty where there is nothing to draw.
    pub fn svg(&self) -> String {
        let finite = |(x, y): &(f64, f64)| x.is_finite() && y.is_finite() && (!self.logarithmic || *x > 0.0);
        let points = self.curves.iter().flat_map(|curve| &curve.points).filter(|point| finite(point));
        let unbounded = (f64::INFINITY, f64::NEG_INFINITY);
        let (mut x, mut y) = points.fold((unbounded, unbounded), |(x, y), point| {
            ((x.0.min(point.0), x.1.max(point.0)), (y.0.min(point.1), y.1.max(point.1)))
        });
        if x.0 > x.1 {
            return String::new();
        }
        let widen = |range: (f64, f64), share: f64| {
            let least = 1e-9 + 1e-6 * range.0.abs().max(range.1.abs());
            let margin = (share * (range.1 - range.0)).max(least);
            (range.0 - margin, range.1 + margin)
        };
        y = self.y_range.unwrap_or_else(|| widen(y, 0.06));
        if self.equal {
            // 90 and 60: what the axes take.
            let (width, height) = (f64::from(self.size.0) - 90.0, f64::from(self.size.1) - 60.0);
            x = widen(x, 0.03);
            let pixel = ((x.1 - x.0) / width).max((y.1 - y.0) / height);
            let around = |range: (f64, f64), pixels: f64| {
                let middle = 0.5 * (range.0 + range.1);
                (middle - 0.5 * pixels * pixel, middle + 0.5 * pixels * pixel)
            };
            (x, y) = (around(x, width), around(y, height));
        } else if x.0 == x.1 {
            x = widen(x, 0.0);
        }
        let mut text = String::new();
        let drawn = if self.logarithmic {
            self.draw(&mut text, (x.0..x.1).log_scale(), y)
        } else {
            self.draw(&mut text, x.0..x.1, y)
        };
        // Writing to memory does not fail; a scale that plotters refuses gives no plot.
        if drawn.is_err() { String::new() } else { self.finished(text) }
    }

    fn draw<X>(&self, text: &mut String, x: X, y: (f64, f64)) -> Result<(), Box<dyn std::error::Error>>
    where
        X: AsRangedCoord<Value = f64>,
        X::CoordDescType: Ranged<ValueType = f64> + ValueFormatter<f64>,
    {
        let size = (self.size.0 * SCALE, self.size.1 * SCALE);
        let root = SVGBackend::with_string(text, size).into_drawing_area();
        let font = |colour: Colour| ("sans-serif", 12 * SCALE).into_font().color(&colour.mark());
        let mut chart = ChartBuilder::on(&root)
            .margin(6 * SCALE)
            .x_label_area_size(40 * SCALE)
            .y_label_area_size(66 * SCALE)
            .build_cartesian_2d(x, y.0..y.1)?;
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(Colour::Grid.mark().stroke_width(SCALE))
            .axis_style(Colour::Faint.mark().stroke_width(SCALE))
            .label_style(font(Colour::Faint))
            .axis_desc_style(font(Colour::Ink))
            .x_labels(if self.logarithmic { 25 } else { (self.size.0 / 90) as usize })
            .y_labels((self.size.1 / 45) as usize)
            .x_label_formatter(&|value| short(*value))
            .y_label_formatter(&|value| short(*value))
            .x_desc(self.x)
            .y_desc(self.y)
            .draw()?;
        for curve in &self.curves {
            let colour = curve.colour.mark();
            let size = (curve.size * f64::from(SCALE)).round() as u32;
            if curve.dots {
                chart.draw_series(
                    curve.points.iter().map(|point| Circle::new(*point, size, colour.filled())),
                )?;
                continue;
            }
            // A line ends at a gap.
            for stretch in curve.points.split(|(x, y)| !x.is_finite() || !y.is_finite()) {
                chart.draw_series(LineSeries::new(stretch.iter().copied(), colour.stroke_width(size)))?;
            }
        }
        root.present()?;
        Ok(())
    }

    fn finished(&self, mut text: String) -> String {
        for colour in Colour::ALL {
            let RGBColor(r, g, b) = colour.mark();
            text =
                text.replace(&format!("\"#{r:02X}{g:02X}{b:02X}\""), &format!("\"var({})\"", colour.css()));
        }
        let (width, height) = (self.size.0 * SCALE, self.size.1 * SCALE);
        let title = escaped(self.title);
        text.replacen(
            &format!("width=\"{width}\" height=\"{height}\""),
            &format!("role=\"img\" aria-label=\"{title}\""),
            1,
        )
    }
}

/// A number on an axis.
fn short(value: f64) -> String {
    if value == 0.0 || value.abs() < 1e-12 {
        return "0".into();
    }
    if !(1e-4..1e5).contains(&value.abs()) {
        return format!("{value:.1e}");
    }
    let text = format!("{value:.5}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// A legend: each colour with its name.
pub(super) fn legend(entries: &[(Colour, &str)]) -> String {
    let entry = |(colour, name): &(Colour, &str)| {
        format!("<span class='key'><i style='background:var({})'></i>{}</span>", colour.css(), escaped(name))
    };
    entries.iter().map(entry).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thinning_keeps_peaks() {
        let mut points: Vec<(f64, f64)> = (0..100_000).map(|i| (f64::from(i), 0.0)).collect();
        points[77_777].1 = 5.0;
        let kept = thinned(points);
        assert!(kept.len() <= 1400 && kept.iter().any(|point| point.1 == 5.0));
    }

    #[test]
    fn colours_are_variables_and_what_cannot_be_drawn_is_left_out() {
        let line = |points| Plot::new("a < b", "x", "y", vec![PlotCurve::line(Colour::Log, points)]).svg();
        let svg = line(vec![(0.0, 1.0), (1.0, 2.0), (f64::NAN, 0.0), (2.0, 1.0)]);
        assert!(svg.contains("var(--log)") && svg.contains("a &lt; b") && !svg.contains("#0100"), "{svg}");
        assert_eq!(line(vec![(f64::NAN, 1.0)]), "");
        assert!(line(vec![(1.0, 1.0)]).contains("<svg"));
        assert_eq!(short(0.25), "0.25");
    }
}
