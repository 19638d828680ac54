//! Shared by the test binaries: random systems made of lumped nodes, and comparisons.
#![allow(dead_code, reason = "each test binary uses its own part")]

pub mod linkages;
pub mod loops;
pub mod lumped;
pub mod scenes;
pub mod trees;

/// Asserts that two slices agree within `allowed` of the largest entry of the expected one.
#[track_caller]
pub fn assert_close(found: &[f64], expected: &[f64], allowed: f64, what: &str) {
    assert_eq!(found.len(), expected.len(), "{what}: lengths");
    let size = expected.iter().fold(0.0_f64, |a, x| a.max(x.abs()));
    for (i, (f, e)) in found.iter().zip(expected).enumerate() {
        assert!(
            (f - e).abs() <= allowed * size,
            "{what}: entry {i} is {f:e}, expected {e:e}, error {:e} of {size:e}, allowed {allowed:e}",
            (f - e).abs() / size
        );
    }
}
