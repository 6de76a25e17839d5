//! Which unknowns there are, in which order and of what size.

use crate::body_scale::BodyScale;
use crate::dynamics::{PARAMETER_NAMES, PARAMETER_UNITS};
use crate::error::IdentificationError;
use nalgebra::DVector;

/// Numbers of one body.
pub(super) const BODY: usize = 10;

/// A body whose ten numbers are unknown.
#[derive(Debug, Clone, PartialEq)]
pub struct UnknownBody {
    /// What it is called in words, such as `link2`.
    pub name: String,
    /// Its rough size; puts kilograms and kilogram square metres in like units.
    pub scale: BodyScale,
}

/// An unknown beside the bodies that enters linearly: friction of a joint, gain of a drive.
#[derive(Debug, Clone, PartialEq)]
pub struct LinkNuisance {
    /// What it is called in words, such as `viscous friction of joint 2`.
    pub name: String,
    /// Its unit, such as `N m s/rad`.
    pub unit: String,
    /// Typical size, in that unit.
    pub magnitude: f64,
    /// Smallest value physics allows, in that unit: zero for friction, rotor inertia and gains.
    pub lower_bound: Option<f64>,
}

/// The vector of unknowns: ten numbers of each body in Newton-Euler order, then the nuisances.
///
/// # Shape
/// `[m, hx, hy, hz, J11, J12, J13, J22, J23, J33]` of each body about its origin and in its axes, SI units.
#[derive(Debug, Clone, PartialEq)]
pub struct ParameterLayout {
    bodies: Vec<UnknownBody>,
    nuisances: Vec<LinkNuisance>,
}

impl ParameterLayout {
    /// These bodies and nuisances, in this order.
    ///
    /// # Errors
    /// [`IdentificationError::InvalidNuisance`] where a magnitude is not positive and finite or a bound is not finite.
    pub fn try_new(bodies: Vec<UnknownBody>, nuisances: Vec<LinkNuisance>) -> Result<Self, IdentificationError> {
        for (index, nuisance) in nuisances.iter().enumerate() {
            let lower_bound = nuisance.lower_bound.unwrap_or(0.0);
            let magnitude = nuisance.magnitude;
            if !(magnitude.is_finite() && magnitude > 0.0 && lower_bound.is_finite()) {
                return Err(IdentificationError::InvalidNuisance { index, magnitude, lower_bound });
            }
        }
        Ok(Self { bodies, nuisances })
    }

    /// The unknown bodies.
    pub fn bodies(&self) -> &[UnknownBody] {
        &self.bodies
    }

    /// The nuisances.
    pub fn nuisances(&self) -> &[LinkNuisance] {
        &self.nuisances
    }

    /// Number of unknowns: columns of a row.
    pub fn unknowns(&self) -> usize {
        BODY * self.bodies.len() + self.nuisances.len()
    }

    /// Where the ten numbers of a body begin.
    pub fn body_column(&self, body: usize) -> usize {
        BODY * body
    }

    /// Where a nuisance stands.
    pub fn nuisance_column(&self, nuisance: usize) -> usize {
        BODY * self.bodies.len() + nuisance
    }

    /// What an unknown is called, such as `link2.h_x`; empty beyond the last.
    pub fn label(&self, column: usize) -> String {
        match self.bodies.get(column / BODY) {
            Some(body) => format!("{}.{}", body.name, PARAMETER_NAMES[column % BODY]),
            None => self.nuisance_at(column).map(|nuisance| nuisance.name.clone()).unwrap_or_default(),
        }
    }

    /// Names of all unknowns.
    pub fn labels(&self) -> Vec<String> {
        (0..self.unknowns()).map(|column| self.label(column)).collect()
    }

    /// Unit of an unknown; empty beyond the last.
    pub fn unit(&self, column: usize) -> &str {
        if column / BODY < self.bodies.len() {
            PARAMETER_UNITS[column % BODY]
        } else {
            self.nuisance_at(column).map_or("", |nuisance| &nuisance.unit)
        }
    }

    /// Typical sizes of all unknowns: what divides them into like units.
    pub fn magnitudes(&self) -> DVector<f64> {
        let bodies = self.bodies.iter().flat_map(|body| body.scale.parameter_magnitudes().data.0[0]);
        let sizes = bodies.chain(self.nuisances.iter().map(|nuisance| nuisance.magnitude));
        DVector::from_iterator(self.unknowns(), sizes)
    }

    pub(super) fn require_length(&self, given: usize) -> Result<(), IdentificationError> {
        require_unknowns(given, self.unknowns())
    }

    fn nuisance_at(&self, column: usize) -> Option<&LinkNuisance> {
        self.nuisances.get(column.checked_sub(BODY * self.bodies.len())?)
    }
}

pub(super) fn require_unknowns(given: usize, expected: usize) -> Result<(), IdentificationError> {
    if given == expected { Ok(()) } else { Err(IdentificationError::UnknownCount { given, expected }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unknowns_have_names_units_and_sizes() {
        let body =
            |name: &str, mass: f64| UnknownBody { name: name.into(), scale: BodyScale::try_new(mass, 0.5).unwrap() };
        let friction = |magnitude: f64| LinkNuisance {
            name: "viscous friction of joint 2".into(),
            unit: "N m s/rad".into(),
            magnitude,
            lower_bound: Some(0.0),
        };
        let layout =
            ParameterLayout::try_new(vec![body("base", 8.0), body("link1", 2.0)], vec![friction(0.1)]).unwrap();
        assert_eq!((layout.unknowns(), layout.body_column(1), layout.nuisance_column(0)), (21, 10, 20));
        let named = |column: usize| (layout.label(column), layout.unit(column).to_owned());
        assert_eq!(named(0), ("base.mass".into(), "kg".into()));
        assert_eq!(named(19), ("link1.J_zz".into(), "kg m^2".into()));
        assert_eq!(named(20), ("viscous friction of joint 2".into(), "N m s/rad".into()));
        assert_eq!(named(21), (String::new(), String::new()));
        assert_eq!(layout.labels().len(), 21);
        let sizes = layout.magnitudes();
        assert_eq!((sizes[0], sizes[10], sizes[11], sizes[19], sizes[20]), (8.0, 2.0, 1.0, 0.5, 0.1));
        for wrong in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let refused = ParameterLayout::try_new(vec![], vec![friction(0.1), friction(wrong)]);
            assert!(matches!(refused, Err(IdentificationError::InvalidNuisance { index: 1, .. })));
        }
    }
}
