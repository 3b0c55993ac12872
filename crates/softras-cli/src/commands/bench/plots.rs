//! Pictures of a run: run time against error, growth, and the time of the stages.

use super::rows::Row;
use crate::commands::svg;
use plotters::coord::combinators::IntoLogRange;
use plotters::prelude::*;
use softras::Result;
use softras_check::measure::sweep::{Curve, Growth};
use std::path::Path;

const SIZE: (u32, u32) = (900, 560);
const COLORS: [RGBColor; 8] = [
    RGBColor(31, 119, 180),
    RGBColor(214, 39, 40),
    RGBColor(44, 160, 44),
    RGBColor(148, 103, 189),
    RGBColor(255, 127, 14),
    RGBColor(23, 190, 207),
    RGBColor(127, 127, 127),
    RGBColor(188, 189, 34),
];

/// The range of the positive numbers with some room around it; 0.1 to 10 if there are none.
fn room(values: impl Iterator<Item = f64>) -> std::ops::Range<f64> {
    let (low, high) = values
        .filter(|x| *x > 0.0 && x.is_finite())
        .fold((f64::INFINITY, 0.0f64), |(low, high), x| (low.min(x), high.max(x)));
    if low < high {
        low / 1.5..high * 1.5
    } else if low == high {
        low / 10.0..high * 10.0
    } else {
        0.1..10.0
    }
}

/// Curves of positive points on two logarithmic axes.
fn curves(
    path: &Path,
    title: &str,
    axes: [&str; 2],
    names_at: SeriesLabelPosition,
    all: &[(String, Vec<(f64, f64)>)],
) -> Result<()> {
    svg::write(path, SIZE, |root| {
        root.fill(&WHITE)?;
        let points = || all.iter().flat_map(|(_, points)| points.iter());
        let x = room(points().map(|p| p.0)).log_scale();
        let y = room(points().map(|p| p.1)).log_scale();
        let mut chart = ChartBuilder::on(root)
            .caption(title, ("sans-serif", 18))
            .margin(14)
            .x_label_area_size(46)
            .y_label_area_size(66)
            .build_cartesian_2d(x, y)?;
        let plain =
            |value: &f64| if *value >= 0.01 && *value < 1e5 { format!("{value}") } else { format!("{value:.0e}") };
        chart
            .configure_mesh()
            .x_desc(axes[0])
            .y_desc(axes[1])
            .x_label_formatter(&plain)
            .y_label_formatter(&plain)
            .draw()?;
        for ((name, points), color) in all.iter().zip(COLORS.iter().cycle()) {
            let points: Vec<_> = points.iter().copied().filter(|p| p.0 > 0.0 && p.1 > 0.0).collect();
            let style = ShapeStyle::from(color).stroke_width(2);
            chart
                .draw_series(LineSeries::new(points.clone(), style))?
                .label(name.as_str())
                .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], style));
            chart.draw_series(points.iter().map(|&point| Circle::new(point, 3, color.filled())))?;
        }
        chart
            .configure_series_labels()
            .position(names_at)
            .background_style(WHITE.mix(0.8))
            .border_style(BLACK.mix(0.3))
            .draw()?;
        Ok(())
    })
}

/// Draws run time against error as τ changes.
pub fn front(path: &Path, title: &str, all: &[Curve]) -> Result<()> {
    let series: Vec<_> = all
        .iter()
        .map(|c| (c.name.to_string(), c.points.iter().map(|p| (p.milliseconds, p.error)).collect()))
        .collect();
    let axes = ["milliseconds, forward and backward", "largest error against the untruncated model"];
    // The curves fall, so that no point lies at the upper right.
    curves(path, title, axes, SeriesLabelPosition::UpperRight, &series)
}

/// Draws times against the size of inputs, with the fitted exponents in the names.
pub fn growth(path: &Path, title: &str, all: &[Growth]) -> Result<()> {
    let name = |g: &Growth| format!("{}: time ~ x^{:.2}", g.name, g.exponent());
    // All curves are relative to their first points, so that they fit one picture.
    let points = |g: &Growth| {
        let first = g.points.first().copied().unwrap_or((1.0, 1.0));
        g.points.iter().map(|p| (p.0 / first.0, p.1 / first.1)).collect()
    };
    let series: Vec<_> = all.iter().map(|g| (name(g), points(g))).collect();
    let axes = ["x, relative to the first", "milliseconds, relative to the first"];
    // The curves rise, so that no point lies at the lower right.
    curves(path, title, axes, SeriesLabelPosition::LowerRight, &series)
}

/// Draws the stages of each row of the pass `frame` as a stacked bar.
pub fn stages(path: &Path, title: &str, rows: &[Row]) -> Result<()> {
    let rows: Vec<&Row> = rows.iter().filter(|row| row.pass == "frame").collect();
    let names = stage_names(&rows);
    // Room for the bars, and for the names beside them.
    let height = (110 + 26 * rows.len()).max(110 + 16 * names.len()) as u32;
    svg::write(path, (SIZE.0, height.max(300)), |root| {
        root.fill(&WHITE)?;
        let end = |row: &&Row| row.span(&names, names.len() - 1).1;
        let most = rows.iter().map(end).fold(1e-3, f64::max);
        let mut chart = ChartBuilder::on(root)
            .caption(title, ("sans-serif", 18))
            .margin(14)
            .x_label_area_size(40)
            .y_label_area_size(240)
            .build_cartesian_2d(0.0..most * 1.45, (0..rows.len()).into_segmented())?;
        let label = |at: &SegmentValue<usize>| match at {
            SegmentValue::CenterOf(i) => {
                rows.get(*i).map_or(String::new(), |r| format!("{} {} {}", r.scene, r.size, r.mode))
            }
            _ => String::new(),
        };
        chart
            .configure_mesh()
            .disable_y_mesh()
            .x_desc("milliseconds; grey: what the device does not spend in its stages")
            .y_labels(rows.len().max(1))
            .y_label_formatter(&label)
            .draw()?;
        for (k, name) in names.iter().enumerate() {
            let color = if *name == "host" { RGBColor(200, 200, 200) } else { COLORS[k % 6] };
            let shade = if *name == "host" { color.to_rgba() } else { color.mix([1.0, 0.55, 0.25][k / 6 % 3]) };
            let bar = |(i, row): (usize, &&Row)| {
                let (start, end) = row.span(&names, k);
                Rectangle::new([(start, SegmentValue::Exact(i)), (end, SegmentValue::Exact(i + 1))], shade.filled())
            };
            chart
                .draw_series(rows.iter().enumerate().map(bar))?
                .label(name.as_str())
                .legend(move |(x, y)| Rectangle::new([(x, y - 5), (x + 12, y + 5)], shade.filled()));
        }
        chart.configure_series_labels().background_style(WHITE.mix(0.8)).border_style(BLACK.mix(0.3)).draw()?;
        Ok(())
    })
}

/// The stages that take more than a hundredth of the time of some row, in order, and at last the host.
fn stage_names(rows: &[&Row]) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for row in rows {
        for stage in row.stages() {
            let seen = names.iter().any(|name| name == stage.stage);
            if !seen && stage.milliseconds > 0.01 * row.median {
                names.push(stage.stage.to_string());
            }
        }
    }
    names.push("host".into());
    names
}
