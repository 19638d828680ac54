//! Aggregate bodies: the sub-trees that constraint embedding treats as one body with fewer coordinates (Paper sections 5.1 to 5.3).
//!
//! An aggregate holds the hinges and modes that its closures couple and nothing else: the bodies from each closure's two ends up to
//! the last body that carries both, which is its root. Closures that share a hinge or modes share an aggregate; independent loops, and a
//! loop on a member of another one, stay apart. Where modes of the root move what hangs on it, they belong to the aggregate too, so that
//! every aggregate is carried by one rigid frame: the root's own, or O of the root's hinge.

use super::closure::{Closure, ClosureJoint, ClosureMethod};
use super::{Body, System};
use std::collections::BTreeSet;
use std::ops::Range;

/// One body of an aggregate.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Member {
    /// Index of the body.
    pub body: usize,
    /// Index of its parent among the members; none if the aggregate's root carries it.
    pub parent: Option<usize>,
    /// Its hinge rates among the aggregate's coordinates; empty for a root that lends its modes only.
    pub rates: Range<usize>,
    /// Its modes among the aggregate's coordinates.
    pub modes: Range<usize>,
}

/// A sub-tree with the closures that are embedded in it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Aggregate {
    /// Body that carries all members; none for the world.
    pub root: Option<usize>,
    /// True if the root's modes are coordinates of the aggregate: the root is then its first member, and O of the root's hinge carries it.
    pub holds_root_modes: bool,
    /// Parents first, ascending body indices.
    pub members: Vec<Member>,
    /// Indices of the closures.
    pub closures: Vec<usize>,
    /// Blocked directions of all closures.
    pub row_count: usize,
    /// Per coordinate: false for the rates of prescribed hinges.
    pub free: Vec<bool>,
}

impl Aggregate {
    /// Number of coordinates, prescribed ones included.
    #[must_use]
    pub fn size(&self) -> usize {
        self.free.len()
    }

    /// What coordinate `j` is, for messages, and the name of its body.
    #[must_use]
    pub fn name_of(&self, system: &System, j: usize) -> (String, String) {
        let named = |m: &Member| {
            let body = &system.bodies[m.body];
            let what = if m.rates.contains(&j) {
                format!("rate {} of hinge \"{}\"", j - m.rates.start + 1, body.hinge.name)
            } else {
                body.flexible().map_or_else(String::new, |f| f.mode_names[j - m.modes.start].clone())
            };
            (what, body.name.clone())
        };
        self.members.iter().find(|m| (m.rates.start..m.modes.end).contains(&j)).map_or_else(Default::default, named)
    }

    /// Names of the closures, quoted, for messages.
    #[must_use]
    pub fn closure_names(&self, system: &System) -> String {
        self.closures.iter().map(|&c| format!("\"{}\"", system.closures[c].name)).collect::<Vec<_>>().join(", ")
    }

    /// Index among the members of a body.
    #[must_use]
    pub fn member_of(&self, body: usize) -> Option<usize> {
        self.members.binary_search_by_key(&body, |m| m.body).ok()
    }
}

/// What a sweep does at a body.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// Its own hinge and modes.
    Own,
    /// The aggregate of that index, of which this body comes first.
    Heads(usize),
    /// Nothing: the aggregate of that index has done it.
    Member(usize),
}

/// The last body that carries both, none for the world: parents have smaller indices.
#[must_use]
pub fn common_ancestor(bodies: &[Body], mut a: Option<usize>, mut b: Option<usize>) -> Option<usize> {
    while a != b {
        if a > b {
            a = a.and_then(|k| bodies[k].parent);
        } else {
            b = b.and_then(|k| bodies[k].parent);
        }
    }
    a
}

/// What one closure couples, or several that were merged.
#[derive(Debug, Clone)]
struct Group {
    bodies: BTreeSet<usize>,
    roots: BTreeSet<Option<usize>>,
    /// Bodies whose modes belong, members included.
    modes: BTreeSet<usize>,
    closures: Vec<usize>,
}

impl Group {
    fn of(system: &System, index: usize) -> Self {
        let bodies = &system.bodies;
        let parent = |k: usize| bodies[k].parent;
        let (ends, root) = match &system.closures[index].joint {
            ClosureJoint::Frames { a, b, .. } => ([a.body, b.body], common_ancestor(bodies, a.body, b.body)),
            ClosureJoint::Gear { a, b, .. } => ([Some(a.body), Some(b.body)], common_ancestor(bodies, parent(a.body), parent(b.body))),
        };
        let mut group = Self { bodies: BTreeSet::new(), roots: BTreeSet::from([root]), modes: BTreeSet::new(), closures: vec![index] };
        for end in ends {
            let mut open = end;
            while let Some(k) = open.filter(|_| open != root) {
                group.bodies.insert(k);
                open = parent(k);
            }
        }
        group.modes.extend(group.bodies.iter().copied().filter(|&k| bodies[k].mode_count() > 0));
        if let Some(root) = root {
            let carried = group.bodies.iter().any(|&k| parent(k) == Some(root) && bodies[k].parent_side.moves());
            let closed = match &system.closures[index].joint {
                ClosureJoint::Frames { a, b, .. } => [a, b].into_iter().any(|s| s.body == Some(root) && s.attachment.moves()),
                ClosureJoint::Gear { .. } => false,
            };
            if carried || closed {
                group.modes.insert(root);
            }
        }
        group
    }

    fn meets(&self, other: &Self) -> bool {
        !self.bodies.is_disjoint(&other.bodies) || !self.modes.is_disjoint(&other.modes)
    }

    fn merge(&mut self, other: Self) {
        self.bodies.extend(other.bodies);
        self.roots.extend(other.roots);
        self.modes.extend(other.modes);
        self.closures.extend(other.closures);
    }

    fn aggregate(mut self, system: &System) -> Aggregate {
        self.closures.sort_unstable();
        // merged groups share a body or its modes, so that all roots but the outermost are members
        let root = self.roots.iter().copied().find(|r| r.is_none_or(|k| !self.bodies.contains(&k))).flatten();
        let holds_root_modes = root.is_some_and(|k| self.modes.contains(&k));
        let mut aggregate = Aggregate {
            root,
            holds_root_modes,
            members: Vec::new(),
            row_count: self.closures.iter().map(|&c| system.closures[c].row_count()).sum(),
            closures: self.closures,
            free: Vec::new(),
        };
        for body in root.filter(|_| holds_root_modes).into_iter().chain(self.bodies) {
            let own = &system.bodies[body];
            let rates = if Some(body) == root { 0 } else { own.hinge.kind.rate_count() };
            let start = aggregate.free.len();
            aggregate.free.extend(std::iter::repeat_n(!own.hinge.is_prescribed(), rates));
            aggregate.free.extend(std::iter::repeat_n(true, own.mode_count()));
            let parent = own.parent.and_then(|p| aggregate.member_of(p)).filter(|_| Some(body) != root);
            aggregate.members.push(Member { body, parent, rates: start..start + rates, modes: start + rates..aggregate.free.len() });
        }
        aggregate
    }
}

/// Loops from which on embedding wins: the cost of cut ones grows with the square of their number and more.
pub const MANY_LOOPS: usize = 3;
/// Coordinates of a loop beyond which cutting wins: the cost of an embedded one grows with the square of its size and more.
pub const LARGE_LOOP: usize = 16;

/// Decides on the closures whose method was left to the program: they are embedded if they close [`MANY_LOOPS`] independent loops or more
/// of up to [`LARGE_LOOP`] coordinates each, or share a loop with an embedded one; else they are cut.
pub fn choose_methods(system: &mut System) {
    let given: Vec<_> = system.closures.iter().map(|c| (!c.chosen).then_some(c.method)).collect();
    for closure in system.closures.iter_mut().filter(|c| c.chosen) {
        closure.method = ClosureMethod::ConstraintEmbedding;
    }
    let (all, _) = aggregates(system);
    let small = |a: &Aggregate| a.size() <= LARGE_LOOP;
    let many = all.iter().filter(|a| small(a)).count() >= MANY_LOOPS;
    for aggregate in &all {
        let joins = aggregate.closures.iter().any(|&c| given[c] == Some(ClosureMethod::ConstraintEmbedding));
        if !(joins || many && small(aggregate)) {
            aggregate.closures.iter().for_each(|&c| system.closures[c].method = ClosureMethod::TreeAugmented);
        }
    }
}

/// The aggregates of all closures that are embedded, and what the sweeps do at each body; nothing without such closures.
#[must_use]
pub fn aggregates(system: &System) -> (Vec<Aggregate>, Vec<Role>) {
    let embedded = |c: &Closure| c.method == ClosureMethod::ConstraintEmbedding;
    let mut groups: Vec<Group> = Vec::new();
    for index in (0..system.closures.len()).filter(|&i| embedded(&system.closures[i])) {
        let mut group = Group::of(system, index);
        while let Some(other) = groups.iter().position(|g| g.meets(&group)) {
            group.merge(groups.swap_remove(other));
        }
        groups.push(group);
    }
    groups.sort_by_key(|g| g.closures.iter().copied().min());
    let aggregates: Vec<_> = groups.into_iter().map(|g| g.aggregate(system)).collect();
    if aggregates.is_empty() {
        return (aggregates, Vec::new());
    }
    let mut roles = vec![Role::Own; system.bodies.len()];
    for (index, aggregate) in aggregates.iter().enumerate() {
        for member in aggregate.members.iter().rev() {
            roles[member.body] = Role::Member(index);
        }
        roles[aggregate.members[0].body] = Role::Heads(index);
    }
    (aggregates, roles)
}
