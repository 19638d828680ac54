//! Work-precision plot: peak error against run time, both logarithmic, one curve per method and variant, the Pareto front ringed.

use super::report::{PointReport, StudyReport};
use plotters::prelude::*;
use std::error::Error;

/// Size of the picture.
const SIZE: (u32, u32) = (900, 560);
/// Errors below this are drawn here.
const FLOOR: f64 = 1e-16;
/// Run times below this are drawn here (s).
const FASTEST: f64 = 1e-9;
/// Colours of curves, in turn: those of Okabe and Ito, which all can tell apart.
const COLOURS: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(230, 159, 0),
    RGBColor(0, 0, 0),
];

/// The plot as SVG.
///
/// # Errors
/// If there is no point to draw.
pub fn svg(report: &StudyReport) -> Result<String, Box<dyn Error>> {
    let places: Vec<Option<(f64, f64)>> = report.points.iter().map(place).collect();
    if places.iter().all(Option::is_none) {
        return Err("no point has an error to draw".into());
    }
    // whole decades
    let range = |values: &mut dyn Iterator<Item = f64>| {
        let (low, high) = values.fold((f64::INFINITY, 0.0_f64), |(l, h), x| (l.min(x), h.max(x)));
        (10.0_f64.powf(low.log10().floor()), 10.0_f64.powf(high.log10().floor() + 1.0))
    };
    let (left, right) =
        range(&mut report.points.iter().filter_map(|p| p.run_time_s).flat_map(|t| [t.min.max(FASTEST), t.max.max(FASTEST)]));
    let (bottom, top) = range(&mut places.iter().flatten().map(|p| p.1));
    let mut text = String::new();
    {
        let root = SVGBackend::with_string(&mut text, SIZE).into_drawing_area();
        root.fill(&WHITE)?;
        let title = format!("{}: {} s, {} rounds", report.scene, report.duration_s, report.repeat);
        let mut chart = ChartBuilder::on(&root)
            .caption(title, ("sans-serif", 18))
            .margin(12)
            .x_label_area_size(44)
            .y_label_area_size(76)
            .build_cartesian_2d((left..right).log_scale(), (bottom..top).log_scale())?;
        chart
            .configure_mesh()
            .x_desc("run time (s), median")
            .y_desc("largest peak error of a load, relative")
            .x_label_formatter(&|x| format!("{x:.0e}"))
            .y_label_formatter(&|y| format!("{y:.0e}"))
            .light_line_style(BLACK.mix(0.04))
            .bold_line_style(BLACK.mix(0.12))
            .draw()?;
        let shades = [
            (report.error_budget, GREEN.mix(0.07), format!("within {} %", 100.0 * report.error_budget)),
            (report.reference.own_error.unwrap_or(0.0), BLACK.mix(0.1), "error of the reference".to_owned()),
        ];
        for (height, colour, label) in shades.into_iter().filter(|s| s.0 > bottom) {
            let series = chart.draw_series([Rectangle::new([(left, bottom), (right, height.min(top))], colour.filled())])?;
            series.label(label).legend(move |(x, y)| Rectangle::new([(x + 2, y - 5), (x + 14, y + 5)], colour.filled()));
        }
        for (number, (name, points)) in curves(report).into_iter().enumerate() {
            let colour = COLOURS[number % COLOURS.len()];
            // a gap ends a line, and the next begins behind it
            let mut lines: Vec<Vec<(f64, f64)>> = vec![Vec::new()];
            for &index in &points {
                match (places[index], lines.last_mut()) {
                    (Some(at), Some(line)) => line.push(at),
                    _ => lines.push(Vec::new()),
                }
            }
            let gaps = points.iter().filter(|&&i| places[i].is_none()).count();
            let label = if gaps > 0 { format!("{name} ({gaps} failed)") } else { name };
            for line in lines.iter().filter(|line| line.len() > 1) {
                chart.draw_series(LineSeries::new(line.iter().copied(), colour.stroke_width(2)))?;
            }
            // from the fastest to the slowest round
            let spread = points.iter().filter_map(|&i| Some((report.points[i].run_time_s?, places[i]?.1)));
            let spread = spread.map(|(t, y)| PathElement::new([(t.min.max(FASTEST), y), (t.max.max(FASTEST), y)], colour.mix(0.4)));
            chart.draw_series(spread)?;
            let dots = lines.concat();
            if number < COLOURS.len() {
                let series = chart.draw_series(dots.into_iter().map(|at| Circle::new(at, 3, colour.filled())))?;
                series.label(label).legend(move |(x, y)| Circle::new((x + 8, y), 4, colour.filled()));
            } else {
                // the second turn of the colours has another shape
                let series = chart.draw_series(dots.into_iter().map(|at| TriangleMarker::new(at, 5, colour.filled())))?;
                series.label(label).legend(move |(x, y)| TriangleMarker::new((x + 8, y), 6, colour.filled()));
            }
        }
        let ringed: Vec<_> = report.points.iter().zip(&places).filter(|(p, _)| p.pareto).filter_map(|(_, at)| *at).collect();
        let series = chart.draw_series(ringed.into_iter().map(|at| Circle::new(at, 7, BLACK.stroke_width(1))))?;
        series.label("Pareto front").legend(|(x, y)| Circle::new((x + 8, y), 6, BLACK.stroke_width(1)));
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::LowerLeft)
            .label_font(("sans-serif", 13))
            .background_style(WHITE.mix(0.85))
            .border_style(BLACK.mix(0.3))
            .draw()?;
        root.present()?;
    }
    Ok(text)
}

/// Run time and error of a point that has both.
fn place(point: &PointReport) -> Option<(f64, f64)> {
    Some((point.run_time_s?.median.max(FASTEST), point.error?.peak.max(FLOOR)))
}

/// Names of curves with the indices of their points, in order.
fn curves(report: &StudyReport) -> Vec<(String, Vec<usize>)> {
    let mut curves: Vec<(String, Vec<usize>)> = Vec::new();
    for (index, point) in report.points.iter().enumerate() {
        let name = point.point.curve();
        match curves.iter_mut().find(|(n, _)| *n == name) {
            Some((_, points)) => points.push(index),
            None => curves.push((name, vec![index])),
        }
    }
    curves
}
