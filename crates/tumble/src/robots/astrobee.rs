//! NASA's Astrobee.

use tumble_astrobee::bodies::BodyConfiguration;
use tumble_astrobee::propulsion::{PropulsionCommand, PropulsionReplay};
use tumble_formats::{ActuatorReplay, BodyPreset, Embedded, ModuleCommand, Robot};
use tumble_lie::Wrench;

/// Its bodies, its arm and its propulsion modules.
pub struct Astrobee;

impl Robot for Astrobee {
    fn name(&self) -> &'static str {
        "astrobee"
    }

    fn sentence(&self) -> &'static str {
        "NASA's free-flyer of the station: two impellers, twelve nozzles"
    }

    fn bodies(&self) -> Vec<BodyPreset> {
        let named = [
            ("iss", BodyConfiguration::Iss),
            ("granite", BodyConfiguration::Granite),
            ("mgtf", BodyConfiguration::Mgtf),
            ("gazebo", BodyConfiguration::Gazebo),
        ];
        named.map(|(name, configuration)| BodyPreset { name, body: configuration.parameters() }).to_vec()
    }

    fn arms(&self) -> &[Embedded] {
        &[Embedded { name: "astrobee-arm", text: include_str!("astrobee-arm.toml") }]
    }

    fn replay(&self) -> Option<Box<dyn ActuatorReplay>> {
        Some(Box::new(Modules::default()))
    }
}

/// Both propulsion modules under recorded commands.
#[derive(Default)]
struct Modules(PropulsionReplay);

impl ActuatorReplay for Modules {
    fn take(&mut self, time_ns: i64, command: &ModuleCommand, speeds: Option<[u8; 2]>) -> Option<Wrench<f64>> {
        let command = PropulsionCommand { impeller_speeds: command.impeller_speeds, nozzles: command.nozzles };
        self.0.take(time_ns, command, speeds)
    }

    fn overdue_ns(&self) -> Option<i64> {
        self.0.overdue_ns()
    }

    fn go_on(&mut self, speeds: Option<[u8; 2]>) -> Option<Wrench<f64>> {
        self.0.go_on(speeds)
    }

    fn silence(&mut self) {
        self.0.silence();
    }
}
