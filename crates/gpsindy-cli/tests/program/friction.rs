//! Dry friction and drag of a swinging mass: effects that only show together, and a friction law of the user's own.

use crate::common::Folder;
use gpsindy_beside::random::Random;
use serde_json::Value;

/// Stiffness of the truth and of the nominal model, 1/s^2: 0.8 swings a second.
const STIFFNESS: f64 = 25.0;

/// What brakes the truth, per mass: viscous (1/s), dry (m/s^2) and quadratic (1/m).
struct Brakes {
    viscous: f64,
    dry: f64,
    quadratic: f64,
}

fn nominal(damping: f64) -> String {
    format!(
        "schema = \"gpsindy.model/1\"\nname = \"swing\"\n[[state]]\nname = \"x\"\nunit = \"m\"\nequation = \"v\"\n\
         [[state]]\nname = \"v\"\nunit = \"m/s\"\nequation = \"-k*x - b*v\"\n[[parameter]]\nname = \"k\"\n\
         value = {STIFFNESS}\n[[parameter]]\nname = \"b\"\nvalue = {damping}\n"
    )
}

/// Positions of a mass on a spring released at `start`, at 50 Hz for 10 s, with white noise of 1 mm.
///
/// Steps of 0.1 ms; where the speed changes sign while friction outweighs the spring, the mass sticks.
fn release(start: f64, brakes: &Brakes) -> String {
    const STEP: f64 = 1e-4;
    let mut text = String::from("t [s],x [m]\n");
    let (mut x, mut v) = (start, 0.0_f64);
    let mut random = Random::new((start * 1e6) as u64);
    for i in 0..500 {
        let noise = 0.001 * random.normal();
        text += &format!("{:.2},{:.6}\n", 0.02 * f64::from(i), x + noise);
        for _ in 0..200 {
            let spring = -STIFFNESS * x;
            if v == 0.0 && spring.abs() <= brakes.dry {
                continue;
            }
            let direction = if v == 0.0 { spring.signum() } else { v.signum() };
            let rate = |x: f64, v: f64| {
                -STIFFNESS * x - brakes.viscous * v - direction * (brakes.dry + brakes.quadratic * v * v)
            };
            let middle = v + 0.5 * STEP * rate(x, v);
            let next = v + STEP * rate(x + 0.5 * STEP * v, middle);
            x += STEP * middle;
            // Through the turning point, or stuck there.
            let sticks = next * direction < 0.0 && (STIFFNESS * x).abs() <= brakes.dry;
            v = if sticks { 0.0 } else { next };
        }
    }
    text
}

fn lab(nominal: &str, truth: &Brakes) -> Folder {
    let folder = Folder::new();
    folder.write("swing.toml", nominal);
    for (i, start) in [1.0, 0.7, 0.85].into_iter().enumerate() {
        folder.write(&format!("run_{}.csv", i + 1), &release(start, truth));
    }
    folder
}

fn diagnosed(folder: &Folder, options: &str) -> Value {
    folder
        .run(&format!("diagnose swing.toml run_1.csv run_2.csv --holdout run_3.csv {options} --out report --quiet"))
        .done();
    serde_json::from_str(&folder.read("report/report.json")).unwrap()
}

fn included(report: &Value) -> Vec<&Value> {
    report["causes"].as_array().unwrap().iter().filter(|c| c["included"] == true).collect()
}

#[test]
fn dry_and_quadratic_friction_are_found_together_where_the_model_has_viscous_damping_instead() {
    let truth = Brakes { viscous: 0.0, dry: 0.25, quadratic: 0.06 };
    // The viscous damping that loses as much energy on the whole: each friction alone would have to push.
    let folder = lab(&nominal(0.27), &truth);
    let suspects = "coulomb_friction,quadratic_drag,viscous_friction,parameter_error,cubic_stiffness,bias,drift";
    let report = diagnosed(&folder, &format!("--effects {suspects}"));
    // Three effects together are doubted, however well they fit; they are named all the same.
    assert_ne!(report["verdict"], "unexplained", "{report}");
    let causes = included(&report);
    let size = |effect: &str| {
        causes.iter().find(|c| c["effect"] == effect).unwrap()["parameters"][0]["value"].as_f64().unwrap()
    };
    assert_eq!(causes.len(), 3, "{report}");
    // Noise of a hundredth of the swing: the sizes come out within a few hundredths.
    assert!((size("coulomb_friction") - truth.dry).abs() < 0.03, "{report}");
    assert!((size("quadratic_drag") - truth.quadratic).abs() < 0.01, "{report}");
    let damping = size("parameter_error");
    assert!((0.0..0.03).contains(&damping), "{report}");
    assert!(report["closure"]["closed"].as_f64().unwrap() > 0.95, "{report}");
}

#[test]
fn a_friction_law_of_the_user_s_own_is_found_in_a_wide_range_of_sizes() {
    let folder = lab(&nominal(0.1), &Brakes { viscous: 0.1, dry: 0.2, quadratic: 0.0 });
    folder.write(
        "own.toml",
        "[[effect]]\nid = \"bearing\"\nstate = \"v\"\nform = \"-c*tanh(v/0.01)\"\n\
         parameters = [{ name = \"c\", low = -10.0, high = 10.0 }]\n",
    );
    let report = diagnosed(&folder, "--effects bearing,bias,linear_stiffness,drift --effects-file own.toml");
    assert_eq!(report["verdict"], "explained", "{report}");
    let causes = included(&report);
    assert_eq!(causes.len(), 1, "{report}");
    assert_eq!(causes[0]["effect"], "bearing");
    // It depends on the speed; its own parameter is none of its variables.
    assert_eq!(causes[0]["variables"], serde_json::json!(["v"]));
    let size = causes[0]["parameters"][0]["value"].as_f64().unwrap();
    assert!((size - 0.2).abs() < 0.02, "{report}");
}
