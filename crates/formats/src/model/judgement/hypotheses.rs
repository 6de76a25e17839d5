//! Other readings of the six numbers of a tensor: the slips that people and exporters make.

use super::finding::FindingKind;
use crate::model::links::{Inertial, Written};
use tumble_dynamics::nalgebra::{Matrix3, Vector3};

/// One reading.
pub(super) struct Hypothesis {
    pub kind: FindingKind,
    /// In words that go on with "it is ...".
    pub reading: String,
    /// About the centre of mass, link axes, kg m^2.
    pub inertia: Matrix3<f64>,
}

/// Signs of the products xy, xz, yz, the whole tensor mirrored first.
const SIGNS: [([f64; 3], &str); 7] = [
    ([-1.0, -1.0, 1.0], "mirrored along x (`xy` and `xz` of the other sign)"),
    ([-1.0, 1.0, -1.0], "mirrored along y (`xy` and `yz` of the other sign)"),
    ([1.0, -1.0, -1.0], "mirrored along z (`xz` and `yz` of the other sign)"),
    ([-1.0, -1.0, -1.0], "with all products of the other sign"),
    ([-1.0, 1.0, 1.0], "with `xy` of the other sign"),
    ([1.0, -1.0, 1.0], "with `xz` of the other sign"),
    ([1.0, 1.0, -1.0], "with `yz` of the other sign"),
];

/// For each new axis the old one.
const AXES: [([usize; 3], &str); 5] = [
    ([1, 0, 2], "with x and y exchanged"),
    ([0, 2, 1], "with y and z exchanged"),
    ([2, 1, 0], "with x and z exchanged"),
    ([2, 0, 1], "with x, y, z taken for y, z, x"),
    ([1, 2, 0], "with x, y, z taken for z, x, y"),
];

/// Readings that differ from the one written.
pub(super) fn hypotheses(inertial: &Inertial) -> Vec<Hypothesis> {
    let (j, mass) = (&inertial.inertia, inertial.mass);
    let mut all = Vec::new();
    let mut add = |kind, reading: &str, inertia| {
        all.push(Hypothesis { kind, reading: reading.to_owned(), inertia });
    };
    for (axes, reading) in AXES {
        let permuted = Matrix3::from_fn(|row, column| j[(axes[row], axes[column])]);
        add(FindingKind::Swapped, reading, inertial.in_link_axes(&permuted));
    }
    for ([xy, xz, yz], reading) in SIGNS {
        let signs = Matrix3::new(1.0, xy, xz, xy, 1.0, yz, xz, yz, 1.0);
        add(FindingKind::Mirrored, reading, inertial.in_link_axes(&j.component_mul(&signs)));
    }
    if let Written::Full(_) = inertial.written {
        // the six in the order in which they stand
        let [a, b, c, d, e, f] = [j.m11, j.m22, j.m33, j.m12, j.m13, j.m23];
        let of_urdf = Matrix3::new(a, b, c, b, d, e, c, e, f);
        let cyclic = Matrix3::new(a, d, f, d, b, e, f, e, c);
        add(FindingKind::Order, "read in the order xx xy xz yy yz zz", inertial.in_link_axes(&of_urdf));
        add(FindingKind::Order, "read in the order xx yy zz xy yz xz", inertial.in_link_axes(&cyclic));
    }
    let turn = inertial.link_from_inertial.rotation;
    if turn.angle() > 1e-3 {
        let turned = |turn: tumble_dynamics::nalgebra::UnitQuaternion<f64>| {
            let turn = turn.to_rotation_matrix();
            turn * j * turn.transpose()
        };
        add(FindingKind::Axes, "written in the axes of the link", *j);
        add(FindingKind::Axes, "turned the other way", turned(turn.inverse()));
        if let Some((other, reading)) = inertial.other_turn {
            add(FindingKind::Axes, reading, turned(other));
        }
    }
    let com = inertial.center_of_mass();
    if com != Vector3::zeros() {
        let shift = (Matrix3::identity() * com.norm_squared() - com * com.transpose()) * mass;
        add(FindingKind::AboutOrigin, "about the origin of the link", inertial.in_link_axes(j) - shift);
    }
    let written = inertial.in_link_axes(j);
    all.retain(|other| (other.inertia - written).norm() > 1e-3 * written.norm());
    all
}
