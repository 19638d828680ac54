//! The largest von Mises stress of bodies, from the modal coordinates that a run records.
//!
//! Compared is the stress of the bodies that the scene asks for by name, in a monitor or in `output.stress`; a scene that names none pays
//! nothing. It is the largest value over all nodes (or surface triangles), as results files, reports and limits hold it. The node may be
//! another one at every output time: the error is that of what sizes the body, not that at one place.
//!
//! Stress costs nodes times modes at every output time whatever the accuracy, often more than the run. It is therefore evaluated when the
//! clock has stopped: run times are those of the motion and the loads.

#[cfg(feature = "hdf5")]
use crate::io::ModalFileError;
#[cfg(feature = "hdf5")]
use crate::model::ModeBasis;
use crate::model::Surface;
use crate::scene::Scene;
use std::sync::Arc;
use thiserror::Error;

/// Why the stress of a scene cannot be compared.
#[derive(Debug, Error)]
pub enum StressError {
    /// A modal file that cannot be read.
    #[cfg(feature = "hdf5")]
    #[error(transparent)]
    File(#[from] ModalFileError),
}

/// The stress of one body at given modal coordinates.
#[derive(Debug, Clone)]
pub struct StressGauge {
    /// Index of the body.
    pub body: usize,
    /// Modes of its modal file, those left out included.
    pub available: usize,
    /// Stress modes; the mode shapes are not kept.
    surface: Arc<Surface>,
}

impl StressGauge {
    /// Largest von Mises stress (Pa) at the modal coordinates `eta`.
    #[must_use]
    pub fn read(&self, eta: &[f64]) -> f64 {
        self.surface.stress_peak(eta).value
    }
}

/// Makes the gauges of scenes; what several have in common is read and kept once.
#[derive(Debug, Default)]
pub struct StressGauges {
    /// Digest of the modal file, choice of modes, and what was read.
    #[cfg(feature = "hdf5")]
    known: Vec<(String, Arc<ModeBasis>, Arc<Surface>)>,
}

impl StressGauges {
    /// The gauges of the bodies whose stress `scene` asks for by name, in the order in which it defines them.
    ///
    /// # Errors
    /// If a modal file cannot be read.
    #[cfg(feature = "hdf5")]
    pub fn of(&mut self, scene: &Scene) -> Result<Vec<StressGauge>, StressError> {
        let mut gauges = Vec::new();
        for body in scene.asked_stress() {
            let Some((_, selection)) = scene.flexible.iter().find(|(k, _)| *k == body) else { continue };
            // a scene refuses such a file, unless the body was told to retain no mode
            if selection.file.stress_location()?.is_none() {
                continue;
            }
            let (digest, basis) = (&selection.content_sha256, &selection.basis);
            let surface = match self.known.iter().find(|(d, b, _)| d == digest && b == basis) {
                Some((_, _, surface)) => Arc::clone(surface),
                None => {
                    let read = selection.file.read_surface_in(basis)?;
                    let surface = Arc::new(Surface { displacement: Vec::new(), ..read });
                    self.known.push((digest.clone(), Arc::clone(basis), Arc::clone(&surface)));
                    surface
                }
            };
            gauges.push(StressGauge { body, available: basis.available(), surface });
        }
        Ok(gauges)
    }

    /// None: without modal files there is no stress.
    ///
    /// # Errors
    /// Never.
    #[cfg(not(feature = "hdf5"))]
    pub fn of(&mut self, _scene: &Scene) -> Result<Vec<StressGauge>, StressError> {
        Ok(Vec::new())
    }
}
