//! Scenarios that come with the program.

use tumble_formats::Embedded;

macro_rules! embedded {
    ($($name:literal),* $(,)?) => {
        [$(Embedded { name: $name, text: include_str!(concat!($name, ".toml")) }),*]
    };
}

/// All of them.
pub const EMBEDDED: [Embedded; 29] = embedded![
    "iss-hold",
    "iss-excite",
    "iss-payload",
    "iss-catch",
    "iss-slalom",
    "iss-gap",
    "iss-thesis-sensors",
    "tube-hold",
    "tube-slalom",
    "granite-hold",
    "granite-excite",
    "granite-room",
    "open-tumble",
    "jem10",
    "infoplan",
    "spheres-excite",
    "space-cobot-excite",
    "iss-cargo",
    "iss-cargo-set0",
    "iss-cargo-set2",
    "iss-free",
    "iss-astronaut",
    "iss-grasp",
    "iss-station",
    "granite-cargo",
    "granite-set0",
    "granite-set2",
    "granite-astronaut",
    "granite-grasp",
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::ScenarioSource;
    use std::path::Path;

    #[test]
    fn each_flies_under_its_name_and_survives_being_written() {
        for embedded in EMBEDDED {
            let source = ScenarioSource::parse(Path::new(embedded.name), embedded.text).unwrap();
            assert_eq!(source.scenario.name, embedded.name);
            assert!(source.scenario.description.is_some());
            source.flight().unwrap();
            let again = ScenarioSource::parse(Path::new("again"), &source.to_toml().unwrap()).unwrap();
            assert_eq!(again.scenario, source.scenario);
        }
    }
}
