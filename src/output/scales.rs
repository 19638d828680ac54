//! Scales of colours and arrows, and the legend that names them.

use super::picture::Picture;

/// A range that ends at a limit or at the smallest of 1, 2, 5, 10, ... above everything seen so far, so that it changes seldom.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scale {
    fixed: bool,
    /// The value that fills the scale; zero before anything was seen.
    pub full: f64,
}

impl Scale {
    /// A scale that ends at `limit` for good, or grows if there is none.
    #[must_use]
    pub fn fixed(limit: Option<f64>) -> Self {
        Self { fixed: limit.is_some(), full: limit.unwrap_or(0.0) }
    }

    /// A scale that grows.
    #[must_use]
    pub fn growing() -> Self {
        Self { fixed: false, full: 0.0 }
    }

    /// Takes in a value; true if the scale had to change.
    pub fn cover(&mut self, value: f64) -> bool {
        if self.fixed || value <= self.full || !value.is_finite() {
            return false;
        }
        let decade = 10.0_f64.powf(value.log10().floor());
        self.full = [1.0, 2.0, 5.0, 10.0].into_iter().map(|m| m * decade).find(|full| *full >= value).unwrap_or(value);
        true
    }

    /// The share of the scale that `value` fills.
    #[must_use]
    pub fn share(&self, value: f64) -> f64 {
        if self.full > 0.0 { value / self.full } else { 0.0 }
    }
}

/// The scales of a picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scales {
    /// Pa, of the colours.
    pub stress: Scale,
    /// N m, of the longest arrow.
    pub moment: Scale,
    /// N, of the longest arrow.
    pub force: Scale,
}

impl Scales {
    /// Colours end at the largest stress limit, if there is one.
    #[must_use]
    pub fn new(picture: &Picture) -> Self {
        let limits = picture.bodies.iter().filter_map(|b| b.surface.as_ref()?.stress_limit);
        Self { stress: Scale::fixed(limits.reduce(f64::max)), moment: Scale::growing(), force: Scale::growing() }
    }

    /// One line with all three ranges.
    #[must_use]
    pub fn line(&self) -> String {
        format!(
            "scales: stress {}, moment {} N m, force {} N",
            megapascal(self.stress.full),
            plain(self.moment.full),
            plain(self.force.full)
        )
    }

    /// The legend in Markdown.
    #[must_use]
    pub fn legend(&self, picture: &Picture) -> String {
        let end = if self.stress.fixed { ", the limit, and above" } else { "" };
        let (by, about) = if picture.closures.iter().any(|c| c.gear_unit.is_none()) {
            ("; at closures, by a on b", "; of closures, about b's point in a's axes")
        } else {
            ("", "")
        };
        format!(
            "**Colour**: von Mises stress, {} from dark = 0 to yellow = **{}**{end}\n\n\
             **Arrows** at hinges, by parent on child{by}: orange moment, longest **{} N m**; blue force, longest **{} N**\n\n\
             **Plots** of loads, about O in O axes{about}: red x, green y, blue z, white magnitude, yellow limit\n\n\
             Deformation drawn **x {}**",
            ColourMap::NAME,
            megapascal(self.stress.full),
            plain(self.moment.full),
            plain(self.force.full),
            picture.deformation_scale,
        )
    }
}

/// A number for people, to five digits and without the noise of the last.
#[must_use]
pub fn plain(x: f64) -> String {
    let rounded: f64 = format!("{x:.4e}").parse().unwrap_or(x);
    if rounded != 0.0 && !(1e-3..1e6).contains(&rounded) { format!("{rounded:e}") } else { rounded.to_string() }
}

fn megapascal(pascal: f64) -> String {
    format!("{} MPa", plain(pascal * 1e-6))
}

/// Colours from none to full stress.
#[derive(Debug, Clone)]
pub struct ColourMap(Vec<[u8; 3]>);

impl Default for ColourMap {
    fn default() -> Self {
        Self((0..256_usize).map(|i| colorous::VIRIDIS.eval_rational(i, 256).as_array()).collect())
    }
}

impl ColourMap {
    /// Name for legends.
    pub const NAME: &'static str = "viridis";

    /// Colour of the share `x` from 0 to 1.
    #[must_use]
    pub fn colour(&self, x: f64) -> [u8; 3] {
        self.0[(x.clamp(0.0, 1.0) * 255.0) as usize]
    }
}

/// Colour of the line `i` in a plot of many.
#[must_use]
pub fn line_colour(i: usize) -> [u8; 3] {
    colorous::TABLEAU10[i % colorous::TABLEAU10.len()].as_array()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scales_grow_in_steps_and_limits_stay() {
        let mut scale = Scale::growing();
        assert!(scale.cover(0.013) && (scale.full - 0.02).abs() < 1e-15 && !scale.cover(0.019));
        assert!(scale.cover(430.0) && (scale.full - 500.0).abs() < 1e-9 && (scale.share(250.0) - 0.5).abs() < 1e-12);
        let mut limit = Scale::fixed(Some(30.0));
        assert!(!limit.cover(400.0) && limit.full == 30.0);
        assert_eq!((plain(50.000_000_000_1), megapascal(2e6), plain(2e-7)), ("50".into(), "2 MPa".into(), "2e-7".into()));
    }

    #[test]
    fn colours_run_from_dark_to_bright_and_saturate() {
        let map = ColourMap::default();
        let light = |x| map.colour(x).iter().map(|&c| u32::from(c)).sum::<u32>();
        assert!(light(0.0) < light(0.5) && light(0.5) < light(1.0));
        assert_eq!(map.colour(7.0), map.colour(1.0));
        assert_eq!(map.colour(f64::NAN), map.colour(0.0));
    }
}
