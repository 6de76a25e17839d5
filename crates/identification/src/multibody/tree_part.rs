use crate::dynamics::{InertialParameters, Multibody, PARAMETERS};
use crate::lie::Pose;
use nalgebra::{SMatrix, SVector};

/// A body of a tree whose ten numbers are asked for.
///
/// # Frame
/// The numbers are about the origin of the part's frame, in its axes.
#[derive(Clone, Debug, PartialEq)]
pub struct TreePart {
    /// How results call it.
    pub name: String,
    /// The body of the tree it is, or is fixed to; 0 is the base.
    pub body: usize,
    /// Where its frame is on that body.
    pub body_from_part: Pose<f64>,
    /// What it is taken for where the data are silent; also sets its scale.
    pub nominal: InertialParameters<f64>,
    /// Whether it is the whole of that body, or comes on top of it while it is grasped.
    pub whole: bool,
    /// Its mass where a scale told it, and the standard deviation, kg: what calibrates drives.
    pub weighed_kg: Option<(f64, f64)>,
}

impl TreePart {
    /// The whole of body `body` (0 the base).
    pub fn whole(name: impl Into<String>, body: usize, nominal: InertialParameters<f64>) -> Self {
        Self { name: name.into(), body, body_from_part: Pose::identity(), nominal, whole: true, weighed_kg: None }
    }

    /// A payload grasped by body `body`, in the frame of the grasp.
    pub fn payload(
        name: impl Into<String>,
        body: usize,
        body_from_grasp: Pose<f64>,
        nominal: InertialParameters<f64>,
    ) -> Self {
        Self { name: name.into(), body, body_from_part: body_from_grasp, nominal, whole: false, weighed_kg: None }
    }

    /// The matrix that turns the ten numbers of the part into those of the tree's body.
    pub(super) fn body_from_part_parameters(&self) -> SMatrix<f64, PARAMETERS, PARAMETERS> {
        let mut matrix = SMatrix::<f64, PARAMETERS, PARAMETERS>::zeros();
        for (k, mut column) in matrix.column_iter_mut().enumerate() {
            let mut unit = SVector::<f64, PARAMETERS>::zeros();
            unit[k] = 1.0;
            let moved = InertialParameters::from_vector(&unit).transformed_by(&self.body_from_part);
            column.copy_from(&moved.to_vector());
        }
        matrix
    }
}

/// The tree without the unknown parts: what is known of it.
pub(super) fn known_part(tree: &Multibody<f64>, unknown: &[TreePart]) -> Multibody<f64> {
    let nothing = InertialParameters::from_vector(&SVector::zeros());
    let whole = unknown.iter().filter(|part| part.whole);
    whole.fold(tree.clone(), |tree, part| tree.with_body(part.body, nothing))
}

/// The known part and the unknown ones with these numbers, ten each; payloads only where something is `grasped`.
pub(super) fn completed(
    known: &Multibody<f64>,
    unknown: &[TreePart],
    numbers: &[f64],
    grasped: bool,
) -> Multibody<f64> {
    let mut tree = known.clone();
    for (part, own) in unknown.iter().zip(numbers.chunks_exact(PARAMETERS)).filter(|(part, _)| part.whole || grasped) {
        let own = InertialParameters::from_vector(&SVector::from_column_slice(own));
        if let Some(body) = tree.body(part.body) {
            let sum = *body + own.transformed_by(&part.body_from_part);
            tree = tree.with_body(part.body, sum);
        }
    }
    tree
}
