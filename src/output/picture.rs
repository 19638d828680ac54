//! What pictures need besides the data: boxes, extent of the scene, scales of arrows and colours.
