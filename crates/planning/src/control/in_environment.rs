//! A controller where more acts than it commands.

use super::{Adoption, ControlCommand, ControlRequest, Controller};
use crate::belief::ModelBelief;
use crate::error::PlanningError;
use tumble_dynamics::{Environment, InertialParameters, WrenchModel};

/// Any [`Controller`] that is told what the environment does: gravity gradient, drag.
///
/// The controller decides as if nothing acted; what the environment does to the believed body at the measured state is
/// taken off its command. Limits of the controller should leave room for that. The time of the models is the mission's.
///
/// # Example
/// ```
/// use tumble_planning::control::{Controller, InEnvironment};
/// use tumble_planning::dynamics::Environment;
///
/// fn outdoors<C: Controller>(controller: C, wind: Environment) -> impl Controller {
///     InEnvironment::new(controller, wind)
/// }
/// ```
#[derive(Clone, Debug)]
pub struct InEnvironment<C> {
    controller: C,
    environment: Environment,
    body: Option<InertialParameters<f64>>,
}

impl<C: Controller> InEnvironment<C> {
    /// The controller in this environment; on the body that its models know until a belief is adopted.
    pub fn new(controller: C, environment: Environment) -> Self {
        Self { controller, environment, body: None }
    }

    /// The controller itself.
    pub fn controller(&self) -> &C {
        &self.controller
    }
}

impl<C: Controller> Controller for InEnvironment<C> {
    fn adopt(&mut self, belief: &ModelBelief) -> Result<Adoption, PlanningError> {
        let adoption = self.controller.adopt(belief)?;
        if !matches!(adoption, Adoption::Contradicts { .. }) {
            self.body = Some(*belief.parameters());
        }
        Ok(adoption)
    }

    fn command(&mut self, request: &ControlRequest<'_>) -> Result<ControlCommand, PlanningError> {
        let command = self.controller.command(request)?;
        let acting = match &self.body {
            Some(body) => self.environment.wrench_on(body, request.time_s, request.state),
            None => self.environment.wrench_body(request.time_s, request.state),
        };
        Ok(ControlCommand { wrench_body: command.wrench_body - acting, ..command })
    }

    fn tube_m(&self) -> [f64; 3] {
        self.controller.tube_m()
    }
}
