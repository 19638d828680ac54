//! Rigid models of the benchmark: by formula, or from a file that `scripts/benchmark/models.py` wrote.

use nalgebra::{Matrix3, Vector3};
use pliant::model::TimeFunction;
use pliant::model::build::{BodyDefinition, BodyDefinitionKind, Definition, Frame, HingeDefinition, WORLD};
use pliant::spatial::rotation::Quaternion;
use std::error::Error;

/// One rigid body and the hinge that carries it.
struct Link {
    parent: Option<usize>,
    /// A free hinge, or a revolute one.
    free: bool,
    axis: Vector3<f64>,
    frame: Frame,
    mass: f64,
    center_of_mass: Vector3<f64>,
    /// About the centre of mass.
    inertia: Matrix3<f64>,
    position: f64,
    velocity: f64,
    torque: f64,
}

/// What moves, and how a free body starts: (angular; linear).
pub struct Model {
    gravity: Vector3<f64>,
    hub_velocity: [f64; 6],
    links: Vec<Link>,
}

const GRAVITY: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);
const HUB_VELOCITY: [f64; 6] = [0.01, 0.02, 0.03, 0.1, 0.0, 0.0];

/// Link `k` of an arm whose hinge sits `x` along the parent, turned by `yaw` about z; `hinge` counts revolute hinges.
fn arm_link(parent: Option<usize>, k: usize, x: f64, yaw: f64, hinge: usize) -> Link {
    let j = hinge as f64;
    Link {
        parent,
        free: false,
        axis: if k % 2 == 1 { Vector3::y() } else { Vector3::z() },
        frame: Frame {
            position: Vector3::new(x * yaw.cos(), x * yaw.sin(), 0.0),
            quaternion: [(yaw / 2.0).cos(), 0.0, 0.0, (yaw / 2.0).sin()],
        },
        mass: 1.0,
        center_of_mass: Vector3::new(0.25, 0.0, 0.0),
        inertia: Matrix3::from_diagonal(&Vector3::new(0.002, 0.022, 0.022)),
        position: 0.3 * (j + 1.0).sin(),
        velocity: 0.2 * (2.0 * j + 1.0).cos(),
        torque: 0.1 * (3.0 * j + 2.0).sin(),
    }
}

impl Model {
    /// `chain`: n links from the world. `tree`: a free hub and four arms of n links. Anything else is a file.
    pub fn of(name: &str, n: usize) -> Result<Self, Box<dyn Error>> {
        match name {
            "chain" => Ok(Self::by_formula((0..n).map(|k| arm_link(k.checked_sub(1), k, if k > 0 { 0.5 } else { 0.0 }, 0.0, k)).collect())),
            "tree" => Ok(Self::by_formula(tree(n))),
            path => Self::read(&std::fs::read_to_string(path).map_err(|e| format!("{path}: {e}"))?),
        }
    }

    fn by_formula(links: Vec<Link>) -> Self {
        Self { gravity: GRAVITY, hub_velocity: HUB_VELOCITY, links }
    }

    /// First line gravity and the velocity of a free body; then per link: parent (-1: world), 1 if free, axis, position and quaternion of
    /// its hinge on the parent, mass, centre of mass, inertia (xx yy zz xy xz yz) about it, hinge position, rate, torque.
    fn read(text: &str) -> Result<Self, Box<dyn Error>> {
        let mut rows = text.lines().map(|line| line.split_whitespace().map(str::parse).collect::<Result<Vec<f64>, _>>());
        let head = rows.next().ok_or("the model file is empty")??;
        let [gx, gy, gz, velocity @ ..] = &head[..] else { return Err("the first line of the model file holds 9 numbers".into()) };
        let links = rows.map(|row| {
            let row: [f64; 25] =
                row?.try_into().map_err(|r: Vec<f64>| format!("a link of the model file has {} numbers, not 25", r.len()))?;
            let vector = |at: usize| Vector3::new(row[at], row[at + 1], row[at + 2]);
            let quaternion: Quaternion = [row[8], row[9], row[10], row[11]];
            let (xx, yy, zz, xy, xz, yz) = (row[16], row[17], row[18], row[19], row[20], row[21]);
            Ok(Link {
                parent: (row[0] >= 0.0).then_some(row[0] as usize),
                free: row[1] != 0.0,
                axis: vector(2),
                frame: Frame { position: vector(5), quaternion },
                mass: row[12],
                center_of_mass: vector(13),
                inertia: Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz),
                position: row[22],
                velocity: row[23],
                torque: row[24],
            })
        });
        let links = links.collect::<Result<_, Box<dyn Error>>>()?;
        Ok(Self { gravity: Vector3::new(*gx, *gy, *gz), hub_velocity: velocity.try_into()?, links })
    }

    /// The same as pliant's definition, bodies named by their numbers.
    pub fn definition(&self) -> Definition {
        let body = |(k, link): (usize, &Link)| BodyDefinition {
            name: k.to_string(),
            kind: BodyDefinitionKind::Rigid { mass: link.mass, center_of_mass: link.center_of_mass, inertia: link.inertia },
        };
        let hinge = |(k, link): (usize, &Link)| {
            let common = HingeDefinition {
                name: k.to_string(),
                parent: link.parent.map_or(WORLD.to_owned(), |p| p.to_string()),
                parent_frame: link.frame,
                child: k.to_string(),
                ..HingeDefinition::default()
            };
            if link.free {
                return HingeDefinition { kind: "free".into(), velocity: self.hub_velocity.to_vec(), ..common };
            }
            HingeDefinition {
                kind: "revolute".into(),
                axes: vec![link.axis],
                position: vec![link.position],
                velocity: vec![link.velocity],
                torque: Some(TimeFunction::Constant(vec![link.torque])),
                ..common
            }
        };
        Definition {
            gravity: self.gravity,
            bodies: self.links.iter().enumerate().map(body).collect(),
            hinges: self.links.iter().enumerate().map(hinge).collect(),
            ..Definition::default()
        }
    }
}

fn tree(n: usize) -> Vec<Link> {
    let hub = Link {
        parent: None,
        free: true,
        frame: Frame::default(),
        mass: 10.0,
        center_of_mass: Vector3::zeros(),
        inertia: Matrix3::from_diagonal(&Vector3::new(1.0, 1.2, 1.4)),
        ..arm_link(None, 0, 0.0, 0.0, 0)
    };
    let mut links = vec![hub];
    for arm in 0..4 {
        for k in 0..n {
            let (parent, yaw) = if k > 0 { (links.len() - 1, 0.0) } else { (0, f64::from(arm) * std::f64::consts::FRAC_PI_2) };
            links.push(arm_link(Some(parent), k, 0.5, yaw, links.len() - 1));
        }
    }
    links
}
