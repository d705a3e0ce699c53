//! `gpsindy simulate` as a user runs it.

use crate::common::{Folder, data};
use gpsindy_beside::shared;

const CART: &str = "
schema = \"gpsindy.model/1\"
name = \"cart\"
[[state]]
name = \"x\"
unit = \"m\"
equation = \"v\"
[[state]]
name = \"v\"
unit = \"m/s\"
equation = \"u - v\"
[[control]]
name = \"u\"
";
const DECAY: &str = "[[state]]\nname = \"x\"\nequation = \"-x\"\nmeasured = \"2*x\"\n";

/// A column of a CSV text by its whole header.
fn column(csv: &str, header: &str) -> Vec<f64> {
    let mut lines = csv.lines();
    let at = lines.next().unwrap().split(',').position(|h| h == header).unwrap();
    lines.map(|line| line.split(',').nth(at).unwrap().parse().unwrap()).collect()
}

#[test]
fn a_rollout_starts_at_the_log_s_first_sample_and_holds_the_controls() {
    let folder = Folder::new();
    folder.write("cart.toml", CART).write("log.csv", "t,u,x [m],v,remark\n0,1,5,0,a\n1,0,9,9,b\n2,0,9,9,c\n");
    let ran = folder.run("simulate cart.toml --data log.csv").done();
    assert!(ran.stdout.starts_with("t [s],x [m],v [m/s]\n0,5,0\n"), "{}", ran.stdout);
    assert_eq!(ran.stderr, "columns ignored: remark\n");
    let v = column(&ran.stdout, "v [m/s]");
    let expected = 1.0 - (-1.0_f64).exp();
    // The integrator's default tolerance is 1e-8.
    assert!((v[1] - expected).abs() < 1e-6 && (v[2] - expected * (-1.0_f64).exp()).abs() < 1e-6, "{v:?}");
}

#[test]
fn a_model_without_controls_needs_no_log() {
    let folder = Folder::new();
    folder.write("decay.toml", DECAY);
    let ran = folder.run("simulate decay.toml --initial x=3 --to 1 --period 0.5").done();
    let x = column(&ran.stdout, "x");
    assert_eq!(x[0], 6.0);
    assert!((x[2] - 6.0 * (-1.0_f64).exp()).abs() < 1e-6, "{x:?}");
}

#[test]
fn a_model_runs_without_a_log_under_constant_controls() {
    let folder = Folder::new();
    folder.write("cart.toml", CART);
    let ran = folder.run("simulate cart.toml --initial x=0,v=0 --control u=2 --duration 3").done();
    let (t, v) = (column(&ran.stdout, "t [s]"), column(&ran.stdout, "v [m/s]"));
    assert_eq!((t.len(), t[1000]), (1001, 3.0));
    for (t, v) in t.iter().zip(v) {
        // The integrator's default tolerance is 1e-8.
        assert!((v - 2.0 * (1.0 - (-t).exp())).abs() < 1e-6, "{t} {v}");
    }
    let same = folder.run("simulate cart.toml --initial x=0,v=0 --control u=2 --to 3 --period 0.003").done();
    assert_eq!(same.stdout.lines().count(), 1002);
}

#[test]
fn a_control_that_is_kept_at_a_value_replaces_the_log_s() {
    let folder = Folder::new();
    folder.write("cart.toml", CART).write("log.csv", "t,u,x,v\n0,1,5,0\n1,9,6,1\n2,0,7,1\n");
    folder.write("no_u.csv", "t,x,v\n0,5,0\n1,6,1\n2,7,1\n");
    let kept = folder.run("simulate cart.toml --data log.csv --control u=0.5 --quiet").done().stdout;
    assert_eq!(folder.run("simulate cart.toml --data no_u.csv --control u=0.5 --quiet").done().stdout, kept);
    let v = column(&kept, "v [m/s]");
    assert!((v[2] - 0.5 * (1.0 - (-2.0_f64).exp())).abs() < 1e-6, "{v:?}");
    let cut =
        folder.run("simulate cart.toml --data log.csv --control u=0.5 --from 1 --duration 1 --quiet").done().stdout;
    assert_eq!(cut.lines().count(), 3);
}

#[test]
fn from_and_to_cut_the_rollout_and_initial_overrides_the_log() {
    let folder = Folder::new();
    folder.write("cart.toml", CART).write("log.csv", "t,u,x,v\n0,1,5,0\n1,0,6,1\n2,0,7,1\n3,0,8,1\n");
    let ran = folder.run("simulate cart.toml --data log.csv --from 1 --to 2 --initial v=2 --quiet").done();
    assert!(ran.stdout.starts_with("t [s],x [m],v [m/s]\n1,6,2\n2,"), "{}", ran.stdout);
    assert_eq!((ran.stdout.lines().count(), ran.stderr.as_str()), (3, ""));
}

#[test]
fn json_holds_the_same_numbers_and_nothing_else() {
    let folder = Folder::new();
    folder.write("decay.toml", DECAY);
    let csv = folder.run("simulate decay.toml --initial x=3 --to 1 --period 0.5").done().stdout;
    let json = folder.run("simulate decay.toml --initial x=3 --to 1 --period 0.5 --json").done().stdout;
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    let x: Vec<f64> = serde_json::from_value(json["columns"]["x"].clone()).unwrap();
    assert_eq!(x, column(&csv, "x"));
}

#[test]
fn model_and_log_are_read_from_stdin() {
    let folder = Folder::new();
    folder.write("cart.toml", CART).write("log.csv", "t,u,x,v\n0,1,5,0\n1,0,6,1\n");
    let expected = folder.run("simulate cart.toml --data log.csv").done().stdout;
    assert_eq!(folder.run_with("simulate - --data log.csv", CART).done().stdout, expected);
    assert_eq!(folder.run_with("simulate cart.toml --data -", &folder.read("log.csv")).done().stdout, expected);
}

#[test]
fn every_mistake_is_one_line_and_nothing_is_written() {
    let folder = Folder::new();
    folder.write("cart.toml", CART).write("decay.toml", DECAY).write("log.csv", "t,u,x,v\n0,1,5,0\n1,0,6,1\n");
    folder
        .write("no_u.csv", "t,x,v\n0,5,0\n1,6,1\n")
        .write("other.csv", "t,y\n0,1\n1,2\n")
        .write("bad.csv", "t,u,x,v\n0,1,5,0\n1,off,6,1\n");
    folder.write("unknown.toml", &CART.replace("u - v", "u - w"));
    folder.write("syntax.toml", &CART.replace("u - v", "u - (v"));
    for (arguments, expected) in [
        ("simulate cart.toml --data no_u.csv", "no_u.csv: column `u` is not in the file; found: x, v"),
        ("simulate cart.toml --data bad.csv", "bad.csv:3: column `u`: not a number: \"off\"; leave the cell empty"),
        (
            "simulate unknown.toml --data log.csv",
            "unknown.toml: `u - w`, at character 5: name `w` is unknown in the equation of state `v`",
        ),
        ("simulate syntax.toml --data log.csv", "syntax.toml:11: `u - (v`, at character 7"),
        ("simulate nothing.toml --data log.csv", "nothing.toml: cannot be read: there is no such file"),
        ("simulate cart.toml --data log.csv --initial y=1", "--initial: no state `y`; the model has: x, v"),
        (
            "simulate cart.toml --data log.csv --from 7",
            "log.csv: no sample between start and end; the log runs from 0 to 1 s",
        ),
        (
            "simulate decay.toml --data other.csv",
            "other.csv: no column is a state of the model (x); found: y; name them with --rename",
        ),
        ("simulate log.csv --data cart.toml", "log.csv: not a model; a model is TOML or JSON, a log is CSV"),
        ("simulate cart.toml --data log.csv --period 0.1", "the model has the control `u`"),
        ("simulate decay.toml --period 0.1 --to 1", "state `x` has no initial value; give it with --initial x=..."),
        (
            "simulate decay.toml --initial x=1",
            "without a log the end of the rollout is needed; give it with --duration or --to, or a log with --data",
        ),
        (
            "simulate cart.toml --initial x=1,v=0 --to 1",
            "the model has the control `u`; keep it at a value with --control u=0",
        ),
        ("simulate cart.toml --control w=1 --to 1", "--control: no control `w`; the model has: u"),
        ("simulate decay.toml --control u=1 --to 1 --initial x=1", "--control: no control `u`; the model has: none"),
        ("simulate decay.toml --duration 0 --initial x=1", "--period must be above 0 and the end after the start"),
        ("simulate decay.toml --period -1 --to 1 --initial x=1", "--period must be above 0"),
        (
            "simulate cart.toml --data log.csv --out no/such/out.csv",
            "--out: folder no/such does not exist; create it first",
        ),
        (
            "simulate cart.toml --data log.csv --rename w=v",
            "log.csv: --rename: column `w` is not in the file; found: t, u, x, v",
        ),
        ("simulate cart.toml --data .", ".: a folder that is neither a LeRobot data set"),
    ] {
        let ran = folder.run(&format!("{arguments} --quiet"));
        assert!(ran.refused().starts_with(expected), "{arguments}\n{ran:?}\nexpected {expected}");
    }
    assert_eq!(
        folder.names(),
        ["bad.csv", "cart.toml", "decay.toml", "log.csv", "no_u.csv", "other.csv", "syntax.toml", "unknown.toml"]
    );
}

#[test]
fn a_model_that_blows_up_fails_with_status_1_and_writes_nothing() {
    let folder = Folder::new();
    folder.write("m.toml", "[[state]]\nname = \"x\"\nequation = \"x^2\"\n");
    let ran = folder.run("simulate m.toml --initial x=1 --to 2 --period 0.1 --out out.csv");
    assert_eq!(ran.status, 1, "{ran:?}");
    assert!(ran.stderr.starts_with("error: ") && ran.stderr.contains("diverged"), "{ran:?}");
    assert_eq!(folder.names(), ["m.toml"]);
}

#[test]
fn the_pendulum_s_four_runs_stay_apart() {
    let folder = Folder::new();
    let ran =
        folder.run(&format!("simulate {} --data {} --run run", data("pendulum.toml"), data("pendulum.csv"))).done();
    assert!(ran.stdout.starts_with("run,t [s],phi [rad],omega [rad/s]\npendulum.csv:1,0,"), "{}", &ran.stdout[..200]);
    assert_eq!(ran.stdout.lines().count(), 1601);
}

#[test]
fn the_car_rolls_where_its_logs_are_at_hand() {
    let (Some(model), Some(log)) = (shared("data/jetracer/nominal.toml"), shared("data/jetracer/rollout_01.csv"))
    else {
        return;
    };
    let (model, log) = (model.display(), log.display());
    let ran = Folder::new().run(&format!("simulate {model} --data {log} --angle heading")).done();
    assert!(ran.stdout.lines().count() > 100);
}
