//! Chains of flexible panels from modal files, and the cost of one evaluation of them: `order0`, `order1`, `order2` of the inertia.

use crate::protocol::Case;
use nalgebra::Vector3;
use pliant::dynamics::{Workspace, accelerations};
use pliant::io::ModalFile;
use pliant::model::build::{BodyDefinition, BodyDefinitionKind, Definition, FlexibleDefinition, Frame, HingeDefinition, WORLD};
use pliant::model::flexible_body::ModalIntegrals;
use pliant::model::modal_body::ModalBody;
use pliant::model::{InertiaOrder, State, System};
use std::error::Error;
use std::f64::consts::TAU;
use std::path::Path;
use std::sync::Arc;

/// Modal damping over modal stiffness (s).
const DAMPING: f64 = 5e-5;
/// All orders, by their numbers.
const ORDERS: [InertiaOrder; 3] = [InertiaOrder::Zeroth, InertiaOrder::First, InertiaOrder::Second];

/// The panel of that many modes, as bodies share it.
pub struct Panel {
    modal: Arc<ModalBody>,
    integrals: Arc<ModalIntegrals>,
    /// Interface that carries the next panel.
    pub tip: &'static str,
}

impl Panel {
    /// `panel_<modes>.h5` of `folder`.
    ///
    /// # Errors
    /// If there is none.
    pub fn of(folder: &Path, modes: usize) -> Result<Self, Box<dyn Error>> {
        Self::read(&folder.join(format!("panel_{modes}.h5")), "tip")
    }

    /// The body of a modal file, which carries the next one at the interface `tip`.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn read(path: &Path, tip: &'static str) -> Result<Self, Box<dyn Error>> {
        // without the rules on nodal masses, which the coarse mesh of the benchmark breaks: they take no part in the motion
        let modal = ModalFile::open(path)?.read_body()?;
        Ok(Self { tip, integrals: Arc::new(ModalIntegrals::of(&modal)), modal: Arc::new(modal) })
    }

    /// The modal data.
    pub fn modal(&self) -> &ModalBody {
        &self.modal
    }

    fn body(&self, name: String, order: InertiaOrder) -> BodyDefinition {
        let kind = BodyDefinitionKind::Flexible(FlexibleDefinition {
            modal: Arc::clone(&self.modal),
            integrals: Arc::clone(&self.integrals),
            mode_names: (1..=self.modal.mode_count()).map(|i| format!("mode {i}")).collect(),
            // 2 zeta omega = DAMPING omega^2
            damping_ratio: self.modal.frequency_hz.iter().map(|f| 0.5 * DAMPING * TAU * f).collect(),
            order,
            modal_position: vec![],
            modal_velocity: vec![],
        });
        BodyDefinition { name, kind }
    }

    /// Adds `count` panels in a row, each hinged about y at the tip of the one before, the first at `at` on `parent`.
    pub fn append(&self, definition: &mut Definition, count: usize, order: InertiaOrder, parent: &str, at: Vector3<f64>, spring: [f64; 2]) {
        for k in 0..count {
            let name = format!("panel {}", k + 1);
            let (parent, parent_node) = if k > 0 { (format!("panel {k}"), Some(self.tip.into())) } else { (parent.to_owned(), None) };
            let position = if k > 0 { Vector3::zeros() } else { at };
            definition.hinges.push(HingeDefinition {
                name: format!("hinge {}", k + 1),
                kind: "revolute".into(),
                axes: vec![Vector3::y()],
                parent,
                parent_node,
                parent_frame: Frame { position, ..Frame::default() },
                child: name.clone(),
                stiffness: vec![spring[0]],
                damping: vec![spring[1]],
                ..HingeDefinition::default()
            });
            definition.bodies.push(self.body(name, order));
        }
    }
}

/// A chain of panels on a fixed base, once for every order.
pub struct Chain {
    orders: Vec<(System, State, Workspace)>,
    /// Rate of the last hinge.
    last: f64,
    /// Order of the last evaluation.
    shown: usize,
}

impl Chain {
    /// `bodies` panels of `modes` modes each.
    ///
    /// # Errors
    /// If `bodies` is no number or there is no such panel.
    pub fn build(folder: &Path, bodies: &str, modes: usize) -> Result<Option<Self>, Box<dyn Error>> {
        Self::of(&Panel::of(folder, modes)?, bodies.parse()?).map(Some)
    }

    /// `count` times the same panel.
    ///
    /// # Errors
    /// If they do not make a system.
    pub fn of(panel: &Panel, count: usize) -> Result<Self, Box<dyn Error>> {
        let system = |order| {
            let mut definition = Definition { gravity: Vector3::new(0.0, 0.0, -9.81), ..Definition::default() };
            panel.append(&mut definition, count, order, WORLD, Vector3::zeros(), [0.0, 0.0]);
            let (system, mut state) = definition.build()?;
            for (j, (position, velocity)) in state.position.iter_mut().zip(&mut state.velocity).enumerate() {
                let j = j as f64;
                (*position, *velocity) = (0.3 * (j + 1.0).sin(), 0.2 * (2.0 * j + 1.0).cos());
            }
            // deflections of a millimetre or so, the less the higher the mode
            let modes = panel.modal().mode_count();
            for (i, (position, velocity)) in state.modal_position.iter_mut().zip(&mut state.modal_velocity).enumerate() {
                let (i, mode) = (i as f64, (i % modes) as f64 + 1.0);
                (*position, *velocity) = (2e-3 * (i + 1.0).sin() / (mode * mode), 2e-2 * (2.0 * i + 1.0).cos() / mode);
            }
            let workspace = Workspace::new(&system);
            Ok::<_, Box<dyn Error>>((system, state, workspace))
        };
        let orders = ORDERS.into_iter().map(system).collect::<Result<Vec<_>, _>>()?;
        let last = orders[0].1.velocity.last().copied().ok_or("a chain of no panels")?;
        Ok(Self { orders, last, shown: 0 })
    }
}

impl Case for Chain {
    fn call(&mut self, op: &str, call: u32) -> Result<bool, Box<dyn Error>> {
        let order = op.strip_prefix("order").and_then(|order| order.parse().ok());
        let Some((system, state, workspace)) = order.and_then(|order: usize| self.orders.get_mut(order)) else { return Ok(false) };
        if let Some(rate) = state.velocity.last_mut() {
            *rate = self.last + 1e-12 * f64::from(call);
        }
        accelerations(system, state, workspace)?;
        self.shown = order.unwrap_or_default();
        Ok(true)
    }

    fn check(&self) -> f64 {
        self.orders[self.shown].2.acceleration.hinge.iter().map(|a| a.abs()).sum()
    }

    fn numbers(&mut self, _op: &str) -> Result<Option<Vec<f64>>, Box<dyn Error>> {
        Ok(None)
    }
}
