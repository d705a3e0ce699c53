//! A drive that a controller moves to and fro, positions only and nearly without noise: dry friction and a constant force
//! that are worth little alone, with a tolerated damping that would absorb the friction.

use crate::common::Folder;
use serde_json::Value;

const MASS: f64 = 95.0;
const DAMPING: f64 = 200.0;
const DRY: f64 = 20.0;
const OFFSET: f64 = 3.0;

const NOMINAL: &str = "schema = \"gpsindy.model/1\"\nname = \"drive\"\n[[state]]\nname = \"q\"\nunit = \"m\"\nequation = \"v\"\n\
    [[state]]\nname = \"v\"\nunit = \"m/s\"\nequation = \"(f - d*v)/m\"\n[[control]]\nname = \"f\"\nunit = \"N\"\n\
    [[parameter]]\nname = \"m\"\nvalue = 95.0\ntolerance = 0.05\n[[parameter]]\nname = \"d\"\nvalue = 200.0\ntolerance = 0.2\n";

/// Positions and forces at 200 Hz under a stiff controller that follows a sine of growing pace; steps of 0.05 ms.
fn log(pace: f64) -> String {
    const STEP: f64 = 5e-5;
    let mut text = String::from("t [s],q [m],f [N]\n");
    let (mut q, mut v) = (0.0_f64, 0.0_f64);
    for i in 0..2400 {
        let t = 0.005 * f64::from(i);
        let angle = pace * (t + 0.03 * t * t);
        let (wanted, speed) = (0.12 * angle.sin(), 0.12 * angle.cos() * pace * (1.0 + 0.06 * t));
        let force = 12_000.0 * (wanted - q) + 900.0 * (speed - v);
        text += &format!("{t:.3},{q:.7},{force:.4}\n");
        for _ in 0..100 {
            let push = force - DAMPING * v - OFFSET;
            let rate = if v == 0.0 {
                if push.abs() <= DRY { 0.0 } else { (push - DRY * push.signum()) / MASS }
            } else {
                (push - DRY * v.signum()) / MASS
            };
            let next = v + STEP * rate;
            q += STEP * 0.5 * (v + next);
            // A reversal passes through rest.
            v = if v * next < 0.0 { 0.0 } else { next };
        }
    }
    text
}

#[test]
fn dry_friction_of_a_drive_is_named_beside_the_offset_and_not_a_doubled_damping() {
    let folder = Folder::new();
    folder.write("drive.toml", NOMINAL);
    folder.write("slow.csv", &log(1.5));
    folder.write("fast.csv", &log(2.3));
    let suspects = "coulomb_friction,viscous_friction,quadratic_drag,bias,input_bias,input_gain,input_saturation,product_coupling,parameter_error";
    folder
        .run(&format!("diagnose drive.toml slow.csv --holdout fast.csv --effects {suspects} --out report --quiet"))
        .done();
    let report: Value = serde_json::from_str(&folder.read("report/report.json")).unwrap();
    assert_eq!(report["verdict"], "explained", "{report}");
    let causes: Vec<&Value> = report["causes"].as_array().unwrap().iter().filter(|c| c["included"] == true).collect();
    let friction = causes.iter().find(|c| c["effect"] == "coulomb_friction").unwrap();
    // The mass is known to a twentieth, and the friction is reported per mass.
    let size = friction["parameters"][0]["value"].as_f64().unwrap();
    assert!((size * MASS / DRY - 1.0).abs() < 0.1, "{report}");
    assert!(causes.iter().any(|c| c["effect"] == "bias" || c["effect"] == "input_bias"), "{report}");
    assert_eq!(causes.len(), 2, "{report}");
    assert!(report["closure"]["closed"].as_f64().unwrap() > 0.9, "{report}");
}
