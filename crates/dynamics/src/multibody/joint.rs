use crate::error::DynamicsError;
use tumble_lie::nalgebra::{Matrix3, Vector3};
use tumble_lie::{Pose, Scalar, skew};

/// What a joint lets its link do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JointAxis {
    /// Turn about the axis; positions in rad.
    Revolute,
    /// Slide along the axis; positions in m.
    Prismatic,
}

/// A joint with one axis, and the passive elements in it.
///
/// A reaction wheel is a revolute joint without spring; a sloshing pendulum or a flexible mode is one with spring and
/// damper.
/// # Frame
/// `parent_from_link` is the pose of the link frame in its parent at position zero; the axis goes through the origin of
/// the link frame and has the same components in it at every position.
/// # Units
/// rad and N m for a revolute joint, m and N for a prismatic one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Joint<T: Scalar> {
    kind: JointAxis,
    axis: Vector3<T>,
    parent_from_link: Pose<T>,
    /// Rotation of the link at position q: `fixed + cos(q) cosine + sin(q) sine`.
    fixed: Matrix3<T>,
    cosine: Matrix3<T>,
    sine: Matrix3<T>,
    /// Axis in parent axes.
    axis_parent: Vector3<T>,
    /// Spring, N m/rad or N/m.
    pub stiffness: T,
    /// Where the spring is at rest, rad or m.
    pub rest_position: T,
    /// Viscous damper, N m s/rad or N s/m.
    pub damping: T,
    /// Inertia that turns with the joint only, such as a rotor seen through its gear, kg m^2 or kg.
    pub rotor_inertia: T,
}

impl<T: Scalar> Joint<T> {
    /// A hinge; the axis in link axes, of any length.
    ///
    /// # Errors
    /// [`DynamicsError::NoAxis`] unless the axis has a length.
    pub fn revolute(axis: Vector3<T>, parent_from_link: Pose<T>) -> Result<Self, DynamicsError> {
        Self::new(JointAxis::Revolute, axis, parent_from_link)
    }

    /// A slide; the axis in link axes, of any length.
    ///
    /// # Errors
    /// [`DynamicsError::NoAxis`] unless the axis has a length.
    pub fn prismatic(axis: Vector3<T>, parent_from_link: Pose<T>) -> Result<Self, DynamicsError> {
        Self::new(JointAxis::Prismatic, axis, parent_from_link)
    }

    fn new(kind: JointAxis, axis: Vector3<T>, parent_from_link: Pose<T>) -> Result<Self, DynamicsError> {
        let length = axis.norm();
        if !(length > T::zero() && length.is_finite()) {
            return Err(DynamicsError::NoAxis);
        }
        let axis = axis / length;
        let rotation = parent_from_link.rotation.to_rotation_matrix().into_inner();
        let along = axis * axis.transpose();
        let (fixed, cosine, sine) = match kind {
            JointAxis::Revolute => (along, Matrix3::identity() - along, skew(&axis)),
            JointAxis::Prismatic => (Matrix3::identity(), Matrix3::zeros(), Matrix3::zeros()),
        };
        Ok(Self {
            kind,
            axis,
            parent_from_link,
            fixed: rotation * fixed,
            cosine: rotation * cosine,
            sine: rotation * sine,
            axis_parent: rotation * axis,
            stiffness: T::zero(),
            rest_position: T::zero(),
            damping: T::zero(),
            rotor_inertia: T::zero(),
        })
    }

    /// The same joint with a spring and a damper.
    #[must_use]
    pub fn with_spring(self, stiffness: T, rest_position: T, damping: T) -> Self {
        Self { stiffness, rest_position, damping, ..self }
    }

    /// The same joint with a rotor that turns with it only.
    #[must_use]
    pub fn with_rotor(self, rotor_inertia: T) -> Self {
        Self { rotor_inertia, ..self }
    }

    /// Hinge or slide.
    pub fn kind(&self) -> JointAxis {
        self.kind
    }

    /// Unit vector, link axes.
    pub fn axis(&self) -> &Vector3<T> {
        &self.axis
    }

    /// Pose of the link in its parent at position zero.
    pub fn parent_from_link(&self) -> &Pose<T> {
        &self.parent_from_link
    }

    /// Force or torque of the spring and the damper, N m or N.
    #[inline]
    pub fn passive_force(&self, position: T, rate: T) -> T {
        -self.stiffness * (position - self.rest_position) - self.damping * rate
    }

    /// Pose of the link in its parent.
    #[inline(always)]
    pub(super) fn placement(&self, position: T) -> Placement<T> {
        let offset = self.parent_from_link.translation.vector;
        match self.kind {
            JointAxis::Revolute => {
                let (sin, cos) = position.sin_cos();
                Placement { rotation: self.fixed + self.cosine * cos + self.sine * sin, offset }
            }
            JointAxis::Prismatic => Placement { rotation: self.fixed, offset: offset + self.axis_parent * position },
        }
    }
}

/// Where a frame is in another: rotation matrix and origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Placement<T: Scalar> {
    pub rotation: Matrix3<T>,
    pub offset: Vector3<T>,
}

impl<T: Scalar> Placement<T> {
    pub fn identity() -> Self {
        Self { rotation: Matrix3::identity(), offset: Vector3::zeros() }
    }

    #[inline(always)]
    pub fn then(&self, next: &Self) -> Self {
        Self { rotation: self.rotation * next.rotation, offset: self.rotation * next.offset + self.offset }
    }
}

/// `R M R^T` of a symmetric `M`, symmetric to the bit.
#[inline(always)]
pub(super) fn congruent<T: Scalar>(r: &Matrix3<T>, m: &Matrix3<T>) -> Matrix3<T> {
    let half = r * m;
    let entry = |i: usize, j: usize| half[(i, 0)] * r[(j, 0)] + half[(i, 1)] * r[(j, 1)] + half[(i, 2)] * r[(j, 2)];
    let (xy, xz, yz) = (entry(0, 1), entry(0, 2), entry(1, 2));
    Matrix3::new(entry(0, 0), xy, xz, xy, entry(1, 1), yz, xz, yz, entry(2, 2))
}

impl Joint<f64> {
    /// The same joint over another scalar.
    #[cfg(feature = "dual")]
    pub(super) fn lifted<T: Scalar>(&self) -> Joint<T> {
        use tumble_lie::real;
        Joint {
            kind: self.kind,
            axis: self.axis.map(real),
            parent_from_link: tumble_lie::nalgebra::convert(self.parent_from_link),
            fixed: self.fixed.map(real),
            cosine: self.cosine.map(real),
            sine: self.sine.map(real),
            axis_parent: self.axis_parent.map(real),
            stiffness: real(self.stiffness),
            rest_position: real(self.rest_position),
            damping: real(self.damping),
            rotor_inertia: real(self.rotor_inertia),
        }
    }
}
