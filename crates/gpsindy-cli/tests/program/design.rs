//! `gpsindy design`, and models that only the Python package's command steps.

use crate::common::Folder;

const DRAG: &str = r#"
schema = "gpsindy.model/1"
name = "drag"
[[state]]
name = "x"
unit = "m"
equation = "v"
[[state]]
name = "v"
unit = "m/s"
equation = "u - 4*x - 0.8*v - c*v*abs(v)"
[[control]]
name = "u"
unit = "N"
[[parameter]]
name = "c"
value = 0.3
tolerance = 0.2
"#;

fn models() -> Folder {
    let folder = Folder::new();
    let friction = DRAG.replace("c*v*abs(v)", "c*v").replace("\"drag\"", "\"friction\"").replace("0.3", "0.15");
    folder.write("drag.toml", DRAG).write("friction.toml", &friction);
    folder
}

#[test]
fn a_signal_that_parts_two_models_is_a_log_within_the_limits() {
    let folder = models();
    let line = "design drag.toml friction.toml --noise x=0.01 --limit u=-2:2 --rate-limit u=40 --duration 4";
    let ran = folder.run(&format!("{line} --out next.csv")).done();
    assert!(ran.stdout.contains("drag.toml or friction.toml"), "{}", ran.stdout);
    assert!(ran.stdout.contains("nats") && ran.stdout.ends_with("signal: next.csv\n"), "{}", ran.stdout);
    let text = folder.read("next.csv");
    assert!(text.starts_with("t [s],u [N]\n"));
    let values: Vec<f64> = text.lines().skip(1).map(|line| line.split(',').nth(1).unwrap().parse().unwrap()).collect();
    assert_eq!(values.len(), 201);
    assert!(values.iter().all(|u| u.abs() <= 2.0) && values.windows(2).all(|w| (w[1] - w[0]).abs() <= 0.8 + 1e-12));
    // The same numbers again, and on stdout alone.
    let json = folder.run(&format!("{line} --json")).done();
    let found: serde_json::Value = serde_json::from_str(&json.stdout).unwrap();
    assert_eq!(found["columns"]["u"].as_array().unwrap().len(), 201);
    assert!(found["pairs"][0]["nats"].as_f64().unwrap() > 1.0 && found["complete"] == true);
    let cut = folder.run(&format!("{line} --json --time-limit 1e-9")).done();
    let found: serde_json::Value = serde_json::from_str(&cut.stdout).unwrap();
    assert!(found["complete"] == false && cut.stderr.contains("this is the best signal so far"), "{cut:?}");
    // What was designed can be simulated.
    let rollout = folder.run("simulate drag.toml --data next.csv --initial x=0,v=0").done();
    assert_eq!(rollout.stdout.lines().count(), 202);
}

#[test]
fn what_is_missing_or_wrong_is_one_line() {
    let folder = models();
    folder.write("robot.xml", "<mujoco/>").write("run.csv", "t,x,u\n0,0,0\n");
    let two = "design drag.toml friction.toml --limit u=-2:2";
    for (line, words) in [
        ("design drag.toml --limit u=-2:2", "no folder of a diagnosis"),
        ("design robot.xml --limit u=-2:2", "robot.xml: a simulator's own file"),
        ("design drag.toml robot.xml --noise x=0.1 --limit u=-2:2", "robot.xml: a simulator's own file"),
        (two, "--noise: say the noise"),
        (&format!("{two} --noise y=0.1"), "`y`"),
        (&format!("{two} --noise x=0.1 --separate drag.toml"), "--separate: expected A,B"),
        (&format!("{two} --noise x=0.1 --separate a,b"), "no pair of a and b"),
        (&format!("{two} --noise x=0.1 --bound x=3:4"), "within its bounds"),
        ("design drag.toml friction.toml --noise x=0.1 --limit w=-2:2", "`w`"),
        ("design . --limit u=-2:2", "open.json"),
        ("diagnose robot.xml run.csv", "pip install 'gpsindy[mujoco]'"),
        ("export robot.xml --to c", "a simulator's own file (MJCF, URDF), not equations"),
    ] {
        let ran = folder.run(line);
        assert!(ran.refused().contains(words), "{line}: {ran:?}");
    }
}

#[test]
fn the_run_that_a_diagnosis_asks_for_decides_what_it_leaves_open() {
    let folder = models();
    // Of so slow a motion the drag might as well be a friction.
    let nominal =
        DRAG.replace(" - c*v*abs(v)", "").replace("[[parameter]]\nname = \"c\"\nvalue = 0.3\ntolerance = 0.2\n", "");
    folder.write("nominal.toml", &nominal);
    for run in 0..3 {
        let level = |i: usize| 0.6 * (((i / 20 + 5 * run) * 7919 % 13) as f64 / 6.0 - 1.0);
        let rows: String = (0..200).map(|i| format!("{},{}\n", 0.05 * i as f64, level(i))).collect();
        folder.write(&format!("u_{run}.csv"), &format!("t,u\n{rows}"));
        let out = folder.run(&format!("simulate drag.toml --data u_{run}.csv --initial x=0,v=0")).done().stdout;
        let noisy = |(i, line): (usize, &str)| {
            let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
            let noise = |k: usize| ((i * 2654435761 + k * 40503 + run * 97) % 1000) as f64 / 1000.0 - 0.5;
            format!("{},{},{},{}\n", cells[0], cells[1] + 0.02 * noise(1), cells[2] + 0.05 * noise(2), level(i))
        };
        let rows: String = out.lines().skip(1).enumerate().map(noisy).collect();
        folder.write(&format!("run_{run}.csv"), &format!("t,x,v,u\n{rows}"));
    }
    let effects = "--effects viscous_friction,quadratic_drag --hold zero --out diagnosis";
    folder.run(&format!("diagnose nominal.toml run_0.csv run_1.csv run_2.csv {effects}")).done();
    assert!(folder.read("diagnosis/open.json").contains("quadratic_drag"));
    // Nothing open is said, and the nearest candidates are distinguished once more.
    let mut open: serde_json::Value = serde_json::from_str(&folder.read("diagnosis/open.json")).unwrap();
    let kept = folder.read("diagnosis/open.json");
    open["pairs"] = serde_json::json!([]);
    folder.write("diagnosis/open.json", &open.to_string());
    let ran = folder.run("design diagnosis --limit u=-2:2 --duration 1 --rate 20 --out next.csv").done();
    assert!(ran.stderr.contains("the diagnosis leaves nothing open"), "{}", ran.stderr);
    folder.write("diagnosis/open.json", &kept);
    let line = "design diagnosis --limit u=-2:2 --separate viscous_friction,quadratic_drag --json";
    let ran = folder.run(line).done();
    let found: serde_json::Value = serde_json::from_str(&ran.stdout).unwrap();
    assert!(found["pairs"][0]["nats"].as_f64().unwrap() > 3.0, "{}", ran.stdout);
    // One explanation is no pair.
    let effects = "--effects quadratic_drag --hold zero --out alone";
    folder.run(&format!("diagnose nominal.toml run_0.csv run_1.csv run_2.csv {effects}")).done();
    let ran = folder.run("design alone --limit u=-2:2 --duration 1 --rate 20").ended(2);
    let stated = "error: alone: the diagnosis has fewer than two explanations of the logs, so there is nothing to distinguish; name models instead, or diagnose with more effects\n";
    assert_eq!(ran.stderr, stated);
}
