//! The ten numbers that people compare, and what a report says beside them.

use tumble_dynamics::InertialParameters;
use tumble_formats::actuator_file::ActuatorFile;
use tumble_identification::{StandardDeviations, Validation};

/// One of the ten numbers that people compare: mass, centre of mass, inertia about it.
pub(crate) struct Quantity {
    pub name: &'static str,
    /// Key, row and column of it in JSON.
    pub json: (&'static str, usize, usize),
    pub unit: &'static str,
    pub value: f64,
    pub std: f64,
}

pub(crate) fn quantities(body: &InertialParameters<f64>, std: &StandardDeviations) -> Vec<Quantity> {
    let (com, inertia) = (body.center_of_mass(), body.inertia_about_com());
    let mut list =
        vec![Quantity { name: "mass", json: ("mass", 0, 0), unit: "kg", value: body.mass, std: std.mass_kg }];
    for (i, name) in ["centre of mass x", "centre of mass y", "centre of mass z"].into_iter().enumerate() {
        list.push(Quantity { name, json: ("com", i, 0), unit: "m", value: com[i], std: std.center_of_mass_m[i] });
    }
    let entries = [("xx", 0, 0), ("yy", 1, 1), ("zz", 2, 2), ("xy", 0, 1), ("xz", 0, 2), ("yz", 1, 2)];
    let names = ["inertia xx", "inertia yy", "inertia zz", "inertia xy", "inertia xz", "inertia yz"];
    for (name, (_, i, j)) in names.into_iter().zip(entries) {
        list.push(Quantity {
            name,
            json: ("inertia", i, j),
            unit: "kg m^2",
            value: inertia[(i, j)],
            std: std.inertia_about_com_kg_m2[(i, j)],
        });
    }
    list
}

/// One sigma relative to the body's own scale: mass, radius of gyration, mean principal inertia.
pub(crate) fn relative_std(body: &InertialParameters<f64>, quantity: &Quantity) -> f64 {
    let mean_inertia = body.inertia_about_com().trace() / 3.0;
    match quantity.json.0 {
        "mass" => quantity.std / body.mass,
        "com" => quantity.std / (mean_inertia / body.mass).sqrt(),
        _ => quantity.std / mean_inertia,
    }
}

/// What the command line adds to a library result.
#[derive(Default)]
pub struct Context<'a> {
    /// What was read: a file name, or the demo.
    pub source: String,
    /// A body to compare with: its name and parameters.
    pub reference: Option<(String, &'a InertialParameters<f64>)>,
    /// Judgement on the last part of the log.
    pub validation: Option<Validation>,
    /// Warnings of the reader, before those of the estimator.
    pub reader_warnings: Vec<String>,
    /// Duration of the record, s.
    pub duration_s: f64,
    /// What its commands drive, where they make the wrench.
    pub actuators: Option<&'a ActuatorFile>,
}
