//! The curves of trainings as an SVG file.

use crate::config::Row;
use crate::io_error;
use plotters::prelude::*;
use softras::Result;
use softras_io::output;
use std::path::Path;

/// Steps whose mean is one point of a curve.
const SMOOTHED: usize = 50;
const SIZE: (u32, u32) = (640, 360);

/// Draws the IoU of silhouettes by step, each point the mean of 50 steps, a line for each training; those of one name have one
/// colour.
pub fn draw(path: &Path, curves: &[(String, Vec<Row>)]) -> Result<()> {
    let mut text = String::new();
    plot(&mut text, curves).map_err(|e| io_error(path, e.to_string()))?;
    output::write_file(path, text.as_bytes())
}

fn plot(text: &mut String, curves: &[(String, Vec<Row>)]) -> std::result::Result<(), Box<dyn std::error::Error>> {
    let point = |rows: &[Row]| {
        let mean = rows.iter().map(|row| f64::from(row.overlap())).sum::<f64>() / rows.len() as f64;
        (rows.last().map_or(0, |row| row.step) as f64, mean)
    };
    let curves: Vec<(&str, Vec<(f64, f64)>)> =
        curves.iter().map(|(name, rows)| (name.as_str(), rows.chunks(SMOOTHED).map(point).collect())).collect();
    let all = || curves.iter().flat_map(|(_, points)| points.iter());
    let last = all().map(|p| p.0).fold(1.0, f64::max);
    let (low, high) = all().fold((1.0, 0.0), |(low, high), p| (p.1.min(low), p.1.max(high)));
    let area = SVGBackend::with_string(text, SIZE).into_drawing_area();
    area.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&area)
        .margin(10)
        .x_label_area_size(36)
        .y_label_area_size(44)
        .build_cartesian_2d(0.0..last, f64::min(low, high)..f64::max(high, low + 0.01))?;
    chart.configure_mesh().x_desc("step").y_desc("IoU of silhouettes in training").draw()?;
    let mut names: Vec<&str> = Vec::new();
    for (name, points) in &curves {
        let known = names.iter().position(|known| known == name);
        let color = Palette99::pick(known.unwrap_or(names.len())).to_rgba();
        let line = chart.draw_series(LineSeries::new(points.iter().copied(), color.stroke_width(2)))?;
        if known.is_none() {
            names.push(name);
            line.label(*name).legend(move |(x, y)| PathElement::new(vec![(x, y), (x + 16, y)], color.stroke_width(2)));
        }
    }
    chart
        .configure_series_labels()
        .background_style(WHITE.mix(0.8))
        .position(SeriesLabelPosition::LowerRight)
        .draw()?;
    area.present()?;
    Ok(())
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn every_training_has_a_line_with_its_name() {
        let rows = |slope: f32| {
            let row = |step| Row { step, losses: [1.0, 1.0 - slope * step as f32, 0.0, 0.0, 0.0] };
            (1..=200).map(row).collect::<Vec<Row>>()
        };
        let mut text = String::new();
        plot(&mut text, &[("steep".into(), rows(4e-3)), ("gentle".into(), rows(1e-3)), ("steep".into(), rows(5e-3))])
            .unwrap();
        assert!(text.matches("steep").count() == 1 && text.contains("gentle"));
        // The three curves and the marks of two names in the legend.
        let lines = text.matches("stroke-width=\"2\"").count();
        assert_eq!(lines, 5, "{text}");
        plot(&mut String::new(), &[("empty".into(), Vec::new())]).unwrap();
    }
}
