//! Which points are worth taking: the Pareto front, and the cheapest within an error budget.

/// Cost and error of a point; none for a gap.
pub type Figures = Option<(f64, f64)>;

/// Indices of the points that no other point beats in cost and error at once, by rising cost.
#[must_use]
pub fn front(points: &[Figures]) -> Vec<usize> {
    let mut order: Vec<(usize, f64, f64)> =
        points.iter().enumerate().filter_map(|(i, p)| p.map(|(cost, error)| (i, cost, error))).collect();
    order.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.2.total_cmp(&b.2)).then(a.0.cmp(&b.0)));
    let mut best = f64::INFINITY;
    let mut front = Vec::new();
    for (index, _, error) in order {
        if error < best {
            best = error;
            front.push(index);
        }
    }
    front
}

/// The point of least cost whose error is at most `budget`.
#[must_use]
pub fn cheapest(points: &[Figures], budget: f64) -> Option<usize> {
    cheapest_where(points, budget, |_| true)
}

/// The same among the points of which `wanted` is true.
#[must_use]
pub fn cheapest_where(points: &[Figures], budget: f64, wanted: impl Fn(usize) -> bool) -> Option<usize> {
    let meeting = points.iter().enumerate().filter_map(|(i, p)| p.filter(|(_, error)| *error <= budget).map(|(cost, _)| (i, cost)));
    meeting.filter(|(i, _)| wanted(*i)).min_by(|a, b| a.1.total_cmp(&b.1)).map(|(i, _)| i)
}

#[cfg(test)]
mod tests {
    use super::*;

    const POINTS: [Figures; 6] = [Some((3.0, 1e-6)), Some((1.0, 1e-2)), None, Some((2.0, 1e-2)), Some((2.0, 1e-4)), Some((5.0, 1e-5))];

    #[test]
    fn the_front_holds_what_nothing_beats() {
        assert_eq!(front(&POINTS), [1, 4, 0]);
        assert_eq!(front(&[None, None]), Vec::<usize>::new());
        // equal points are on the front once
        assert_eq!(front(&[Some((1.0, 0.5)), Some((1.0, 0.5))]), [0]);
    }

    #[test]
    fn the_cheapest_meets_the_budget() {
        assert_eq!(cheapest(&POINTS, 1e-3), Some(4));
        assert_eq!(cheapest(&POINTS, 1e-2), Some(1));
        assert_eq!(cheapest(&POINTS, 1e-9), None);
        assert_eq!(cheapest_where(&POINTS, 1e-2, |i| i != 1), Some(3));
    }
}
