//! A simulated flight and its log allocate nothing: a process of its own, under an allocator that counts.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]
#![allow(
    unsafe_code,
    reason = "an allocator that counts has to implement `GlobalAlloc`; it hands everything to the system's"
)]

use tumble::flight_log::Recorder;
use tumble::scenario::ScenarioSource;
use tumble_astrobee::sensing::SensingPreset;

tumble_lie::counting_allocator!();

/// Hardware, drag, sensors, a payload taken and let go, either controller, and the log.
#[test]
fn a_simulated_flight_and_its_log() {
    for (controller, sensing) in [("tracker", SensingPreset::Nominal), ("flown", SensingPreset::ThesisFlight)] {
        let mut source = ScenarioSource::find("iss-payload").unwrap();
        let scenario = &mut source.scenario;
        scenario.duration_s = 320.0;
        scenario.drive.controller = Some(controller.to_owned());
        scenario.propulsion.drag = true;
        let payload = scenario.payload.as_mut().unwrap();
        (payload.attach_s, payload.release_s) = (40.0, Some(200.0));
        scenario.sensing.preset = Some(sensing);
        let mut flight = source.flight().unwrap();
        let mut recorder = Recorder::new(std::io::sink()).unwrap();
        let before = counting::ALLOCATIONS.get();
        while let Some(measured) = flight.step().unwrap() {
            recorder.record(&measured, flight.simulator.estimates()).unwrap();
        }
        assert_eq!(counting::ALLOCATIONS.get() - before, 0, "{controller}");
        let (rows, _) = recorder.finish().unwrap();
        assert!(rows > 10_000 && flight.simulator.events().len() > 1, "it ran: {rows} rows");
    }
}
