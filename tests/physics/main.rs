//! Physics of the library: identities against independent routes, conservation laws, published numbers.

#[path = "../support/mod.rs"]
mod support;

mod identities;
