//! NASA's Astrobee.

use tumble_astrobee::bodies::BodyConfiguration;
use tumble_astrobee::propulsion::{ImpellerMode, PropulsionCommand, PropulsionReplay};
use tumble_astrobee::sensing::SensingPreset;
use tumble_formats::recording::RawMessage;
use tumble_formats::{ActuatorBytes, ActuatorReplay, BodyPreset, Embedded, FormatsError, Robot, SensorPreset};
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

    fn sensors(&self) -> Vec<SensorPreset> {
        let named = [
            ("nominal", "a healthy flight on the station, impellers at their nominal speed", SensingPreset::Nominal),
            (
                "thesis-flight",
                "the flights of the thesis: an accelerometer off in scale, jumps",
                SensingPreset::ThesisFlight,
            ),
            ("bumble", "Bumble as it flew on the station: its unit at 16 ms, poses 62 ms late", SensingPreset::Bumble),
        ];
        let described = |(name, sentence, preset): (&'static str, &'static str, SensingPreset)| {
            let sensing = preset.settings().description(ImpellerMode::Nominal).ok()?;
            Some(SensorPreset { name, sentence, sensing })
        };
        named.into_iter().filter_map(described).collect()
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
    fn command_type(&self) -> &'static str {
        "ff_hw_msgs/PmcCommand"
    }

    /// The type is one of those that every reader decodes.
    fn decode(&self, _message: &RawMessage<'_>) -> Result<Option<ActuatorBytes>, FormatsError> {
        Ok(None)
    }

    fn take(
        &mut self,
        time_ns: i64,
        command: &ActuatorBytes,
        speeds: Option<[u8; 2]>,
    ) -> Result<Option<Wrench<f64>>, FormatsError> {
        Ok(propulsion_command(command).and_then(|command| self.0.take(time_ns, command, speeds)))
    }

    fn overdue_ns(&self) -> Option<i64> {
        self.0.overdue_ns()
    }

    fn go_on(&mut self, speeds: Option<[u8; 2]>) -> Result<Option<Wrench<f64>>, FormatsError> {
        Ok(self.0.go_on(speeds))
    }

    fn silence(&mut self) {
        self.0.silence();
    }
}

/// Two impellers, then twelve nozzles; `None` for other bytes.
fn propulsion_command(command: &ActuatorBytes) -> Option<PropulsionCommand> {
    let (impellers, nozzles) = command.as_slice().split_at_checked(2)?;
    Some(PropulsionCommand { impeller_speeds: impellers.try_into().ok()?, nozzles: nozzles.try_into().ok()? })
}
