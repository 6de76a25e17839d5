//! One-step integrators of systems on manifolds.

mod gauss_legendre4;
mod lie_euler;
mod munthe_kaas4;
mod runge_kutta4;
#[cfg(feature = "dual")]
mod variational;

pub use gauss_legendre4::GaussLegendre4;
pub use lie_euler::LieEuler;
pub use munthe_kaas4::MuntheKaas4;
pub use runge_kutta4::RungeKutta4;
#[cfg(feature = "dual")]
pub use variational::Variational;
