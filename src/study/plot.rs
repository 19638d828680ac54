//! Work-precision plot: peak error against run time, and beside it against evaluations, which are the same on every machine; all
//! logarithmic, one curve per method and variant, the Pareto front of each panel ringed.

use super::report::{PointReport, StudyReport};
use plotters::coord::Shift;
use plotters::drawing::DrawingAreaErrorKind;
use plotters::prelude::*;
use std::error::Error;

/// Size of the picture.
const SIZE: (u32, u32) = (1280, 560);
/// Widths of the labels of the error, which stand at the left panel alone, and margin of the panels.
const ERROR_LABELS: u32 = 76;
const MARGIN: u32 = 12;
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

/// Where a point stands in a panel.
#[derive(Debug, Clone, Copy)]
struct Place {
    cost: f64,
    error: f64,
    /// From the least to the largest cost.
    spread: (f64, f64),
    /// Whether it is on the panel's Pareto front.
    ringed: bool,
}

/// One cost to draw the error against.
struct Panel {
    label: &'static str,
    /// Of each point of the report; none for a gap.
    places: Vec<Option<Place>>,
    /// The first panel names the errors and the curves for both.
    is_first: bool,
}

/// The plot as SVG.
///
/// # Errors
/// If there is no point to draw.
pub fn svg(report: &StudyReport) -> Result<String, Box<dyn Error>> {
    let points = || report.points.iter();
    let panels = [
        Panel { label: "run time (s), median", places: points().map(by_run_time).collect(), is_first: true },
        Panel { label: "evaluations of the dynamics", places: points().map(by_evaluations).collect(), is_first: false },
    ];
    if panels[0].places.iter().all(Option::is_none) {
        return Err("no point has an error to draw".into());
    }
    let mut text = String::new();
    {
        let root = SVGBackend::with_string(&mut text, SIZE).into_drawing_area();
        root.fill(&WHITE)?;
        let title = format!("{}: {} s, {} rounds", report.scene, report.duration_s, report.repeat);
        let (left, right) = root.titled(&title, ("sans-serif", 18))?.split_horizontally((SIZE.0 + ERROR_LABELS) / 2);
        draw(&left, report, &panels[0])?;
        draw(&right, report, &panels[1])?;
        root.present()?;
    }
    Ok(text)
}

/// Whole decades around values.
fn decades(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (low, high) = values.fold((f64::INFINITY, 0.0_f64), |(l, h), x| (l.min(x), h.max(x)));
    (10.0_f64.powf(low.log10().floor()), 10.0_f64.powf(high.log10().floor() + 1.0))
}

fn draw<B: DrawingBackend>(
    area: &DrawingArea<B, Shift>,
    report: &StudyReport,
    panel: &Panel,
) -> Result<(), DrawingAreaErrorKind<B::ErrorType>> {
    let Panel { label, places, is_first } = panel;
    let (left, right) = decades(places.iter().flatten().flat_map(|p| [p.spread.0, p.spread.1]));
    let (bottom, top) = decades(places.iter().flatten().map(|p| p.error));
    let mut chart = ChartBuilder::on(area)
        .margin(MARGIN)
        // the last label of a panel stands clear of the first of the next
        .margin_right(2 * MARGIN)
        .x_label_area_size(44)
        .y_label_area_size(if *is_first { ERROR_LABELS } else { 0 })
        .build_cartesian_2d((left..right).log_scale(), (bottom..top).log_scale())?;
    chart
        .configure_mesh()
        .x_desc(*label)
        .y_desc("largest peak error, relative")
        .axis_desc_style(("sans-serif", 15))
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
                (Some(place), Some(line)) => line.push((place.cost, place.error)),
                _ => lines.push(Vec::new()),
            }
        }
        let gaps = points.iter().filter(|&&i| places[i].is_none()).count();
        let label = if gaps > 0 { format!("{name} ({gaps} failed)") } else { name };
        for line in lines.iter().filter(|line| line.len() > 1) {
            chart.draw_series(LineSeries::new(line.iter().copied(), colour.stroke_width(2)))?;
        }
        let spread = points.iter().filter_map(|&i| places[i]).filter(|p| p.spread.0 < p.spread.1);
        let spread = spread.map(|p| PathElement::new([(p.spread.0, p.error), (p.spread.1, p.error)], colour.mix(0.4)));
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
    let ringed = places.iter().flatten().filter(|p| p.ringed);
    let series = chart.draw_series(ringed.map(|p| Circle::new((p.cost, p.error), 7, BLACK.stroke_width(1))))?;
    series.label("Pareto front").legend(|(x, y)| Circle::new((x + 8, y), 6, BLACK.stroke_width(1)));
    if *is_first {
        chart
            .configure_series_labels()
            .position(emptiest_corner(places, (left, right), (bottom, top), curves(report).len() + 3))
            .label_font(("sans-serif", 13))
            .background_style(WHITE.mix(0.85))
            .border_style(BLACK.mix(0.3))
            .draw()?;
    }
    Ok(())
}

/// The corner with the fewest points in the part of a panel that a legend of so many rows covers.
fn emptiest_corner(places: &[Option<Place>], costs: (f64, f64), errors: (f64, f64), rows: usize) -> SeriesLabelPosition {
    let share = |x: f64, (low, high): (f64, f64)| (x / low).ln() / (high / low).ln();
    // of half the picture and its height, less labels; a row takes 15 points, the frame some more
    let (width, height) = (0.48, (15 * rows + 25) as f64 / 466.0);
    let corners = [
        (SeriesLabelPosition::LowerLeft, false, false),
        (SeriesLabelPosition::UpperRight, true, true),
        (SeriesLabelPosition::LowerRight, true, false),
        (SeriesLabelPosition::UpperLeft, false, true),
    ];
    let covered = |right: bool, upper: bool| {
        let inside = |p: &&Place| {
            let (x, y) = (share(p.cost, costs), share(p.error, errors));
            (if right { 1.0 - x } else { x }) < width && (if upper { 1.0 - y } else { y }) < height
        };
        places.iter().flatten().filter(inside).count()
    };
    corners.into_iter().min_by_key(|(_, right, upper)| covered(*right, *upper)).map_or(SeriesLabelPosition::LowerLeft, |c| c.0)
}

/// Error against run time, from the fastest to the slowest round.
fn by_run_time(point: &PointReport) -> Option<Place> {
    let (time, error) = (point.run_time_s?, point.error?.peak.max(FLOOR));
    let [cost, least, most] = [time.median, time.min, time.max].map(|t| t.max(FASTEST));
    Some(Place { cost, error, spread: (least, most), ringed: point.pareto })
}

/// Error against evaluations, which are the same in every round.
fn by_evaluations(point: &PointReport) -> Option<Place> {
    let (cost, error) = (point.evaluations? as f64, point.error?.peak.max(FLOOR));
    Some(Place { cost, error, spread: (cost, cost), ringed: point.pareto_evaluations })
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_legend_goes_where_no_points_are() {
        let place = |cost, error| Some(Place { cost, error, spread: (cost, cost), ringed: false });
        let corner = |places: &[Option<Place>]| emptiest_corner(places, (1.0, 100.0), (1e-4, 1.0), 10);
        assert!(matches!(corner(&[place(2.0, 0.5), place(50.0, 2e-4)]), SeriesLabelPosition::LowerLeft));
        assert!(matches!(corner(&[place(2.0, 0.5), place(2.0, 2e-4), place(50.0, 2e-4)]), SeriesLabelPosition::UpperRight));
        assert!(matches!(corner(&[place(2.0, 2e-4), place(50.0, 0.5), None]), SeriesLabelPosition::LowerRight));
    }
}
