//! A slider that coasts down: its simulator and its logs.

/// The simulator, which knows no quadratic drag.
pub const SLIDER: &str = "
schema = \"gpsindy.model/1\"
name = \"slider\"
[[state]]
name = \"v\"
unit = \"m/s\"
equation = \"-b*v\"
[[parameter]]
name = \"b\"
value = 0.2
";

/// `v' = -0.2*v - drag*v^2` from `start`, in closed form, with a small error that no seed is needed for.
pub fn coast(start: f64, drag: f64) -> String {
    let mut text = String::from("t [s],v [m/s],note\n");
    for i in 0..80 {
        let t = 0.05 * f64::from(i);
        let decay = (-0.2 * t).exp();
        let v = start * decay / (1.0 + start * drag / 0.2 * (1.0 - decay));
        let error = 0.004 * (f64::from(i * i) * 1.7 + start).sin();
        text += &format!("{t:.2},{:.5},x\n", v + error);
    }
    text
}
