//! The propulsion hardware against NASA's simulation of it, open loop.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use tumble_astrobee::propulsion::{PropulsionCommand, PropulsionPlant, PropulsionSettings};
use tumble_dynamics::nalgebra::Vector3;

#[test]
fn explore() {
    let text = std::fs::read_to_string("/work/shared/data/astrobee/plant_dynamics.csv").unwrap();
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    let col = |name: &str| header.iter().position(|h| *h == name).unwrap();
    let rows: Vec<Vec<f64>> = lines.map(|l| l.split(',').map(|c| c.parse().unwrap()).collect()).collect();
    let servo = col("servo1");
    let groups = [("N", col("N1"), 2), ("Nrate", col("Nrate1"), 2), ("Icur", col("imp_current1"), 2), ("flap", col("dtheta1"), 12), ("shaft", col("servo_theta1"), 12), ("scur", col("servo_current1"), 12), ("f1", col("fx1"), 3), ("t1", col("tx1"), 3), ("f2", col("fx2"), 3), ("t2", col("tx2"), 3)];
    for scenario in 0..6 {
        let run: Vec<&Vec<f64>> = rows.iter().filter(|r| r[0] as i32 == scenario).collect();
        let mut plant = PropulsionPlant::new(PropulsionSettings { supply_v: run[0][col("volt")], ..PropulsionSettings::AS_SIMULATED_UPSTREAM });
        let mut worst = [(0.0_f64, 0.0); 10];
        let mut index = 0;
        let last = run.last().unwrap()[1] as i64;
        for k in 1..=last {
            // the command of the last row at or before this step
            while index + 1 < run.len() && run[index + 1][1] as i64 <= k { index += 1; }
            let row = run[index];
            let mut command = PropulsionCommand { impeller_speeds: [row[3] as u8, row[4] as u8], nozzles: [0; 12] };
            for i in 0..12 { command.nozzles[i] = row[servo + i] as u8; }
            let out = plant.step(&command, &Vector3::new(row[5], row[6], row[7]));
            if row[1] as i64 != k { continue; }
            let mut mine = Vec::new();
            mine.extend(plant.impellers().iter().map(|i| i.speed_rad_s()));
            mine.extend(plant.impellers().iter().map(|i| i.speed_command_rad_s()));
            mine.extend(plant.impellers().iter().map(|i| i.current_a()));
            mine.extend(plant.flaps_rad());
            mine.extend(plant.servos().iter().map(|i| i.shaft_rad()));
            mine.extend(plant.servos().iter().map(|i| i.current_a()));
            for w in out.module_wrenches_body { mine.extend(w.force.iter()); mine.extend(w.torque.iter()); }
            let mut at = 0;
            for (g, (_, c, n)) in groups.iter().enumerate() {
                for i in 0..*n { let e = (mine[at + i] - row[c + i]).abs(); if e > worst[g].0 { worst[g] = (e, row[1]); } }
                at += n;
            }
        }
        print!("scenario {scenario}:");
        for ((name, ..), (e, k)) in groups.iter().zip(worst) { print!("  {name} {e:.1e}@{k}"); }
        println!();
    }
}
