//! The robot and what it holds as a URDF, for viewers of logs.

use super::ScenarioSource;
use crate::TumbleError;
use std::fmt::Write as _;
use tumble_dynamics::InertialParameters;
use tumble_formats::body_file::{self, BodyFile};
use tumble_formats::recording::foxglove::BODY_FRAME;
use tumble_lie::Pose;

impl ScenarioSource {
    /// A cube within the robot's sphere and, fixed to it, the solid box of the payload's mass and inertia; the masses are the true ones.
    ///
    /// # Errors
    /// As of the scenario's bodies.
    pub(crate) fn description(&self) -> Result<String, TumbleError> {
        let robot = self.bodies(self.place()?)?.0;
        let edge_m = 2.0 * self.robot_radius_m()? / 3_f64.sqrt();
        let mut text = "<?xml version=\"1.0\"?>\n<robot name=\"robot\">\n".to_owned();
        link(&mut text, BODY_FRAME, &robot, &Pose::identity(), [edge_m; 3]);
        if let Some(grasp) = self.drawn_grasp()? {
            let (payload_from_box, edges_m) = grasp.payload.as_box();
            link(&mut text, "payload", &grasp.payload, &payload_from_box, edges_m);
            let _ = writeln!(
                text,
                "<joint name=\"grasp\" type=\"fixed\">\n{}<parent link=\"{BODY_FRAME}\"/>\n<child link=\"payload\"/>\n</joint>",
                origin(&grasp.robot_from_payload)
            );
        }
        text.push_str("</robot>\n");
        Ok(text)
    }
}

fn link(text: &mut String, name: &str, body: &InertialParameters<f64>, link_from_box: &Pose<f64>, edges_m: [f64; 3]) {
    let [x, y, z] = edges_m;
    let _ = writeln!(
        text,
        "<link name=\"{name}\">\n{}<visual>\n{}<geometry><box size=\"{x} {y} {z}\"/></geometry>\n</visual>\n</link>",
        body_file::urdf(&BodyFile::from(body)),
        origin(link_from_box)
    );
}

/// Without the sign of a zero pitch.
fn origin(pose: &Pose<f64>) -> String {
    let (roll, pitch, yaw) = pose.rotation.euler_angles();
    let place = pose.translation.vector;
    format!("<origin xyz=\"{} {} {}\" rpy=\"{roll} {} {yaw}\"/>\n", place.x, place.y, place.z, pitch + 0.0)
}
