//! `gpsindy smooth` as a user runs it.

use crate::common::{Folder, data};

fn sine() -> String {
    let mut text = String::from("# a sine with a rounded column\ntime (s),\"height, above ground (m)\",v [m/s],note\n");
    for i in 0..40 {
        let t = 0.1 * f64::from(i);
        // A missing cell every seventh sample.
        let height = if i % 7 == 3 { String::new() } else { format!("{:.3}", t.sin()) };
        text += &format!("{t},{height},{:.3},ok\n", t.cos());
    }
    text
}

#[test]
fn columns_have_derivatives_and_standard_deviations_with_units() {
    let folder = Folder::new();
    folder.write("log.csv", &sine());
    let ran = folder.run("smooth log.csv").done();
    let mut lines = ran.stdout.lines();
    let header = "t [s],height [m],height_std [m],height_dot [m/s],height_dot_std [m/s],v [m/s],v_std [m/s],v_dot [m/s^2],v_dot_std [m/s^2]";
    assert_eq!(lines.next().unwrap(), header);
    for (i, line) in lines.enumerate() {
        let cells: Vec<f64> = line.split(',').map(|c| c.parse().unwrap()).collect();
        let t = 0.1 * i as f64;
        // The columns are rounded to 1e-3; derivatives are less certain, most so at the ends.
        assert!((cells[1] - t.sin()).abs() < 2e-3 && (cells[3] - t.cos()).abs() < 0.02, "{line}");
        assert!(cells[2] > 0.0 && cells[4] > 0.0, "{line}");
    }
    assert!(ran.stderr.contains("columns ignored: note\n") && ran.stderr.contains("height: kernel "), "{}", ran.stderr);
}

#[test]
fn options_choose_columns_and_the_kernel() {
    let folder = Folder::new();
    folder.write("log.csv", &sine());
    let ran = folder
        .run("smooth log.csv --state 'height, above ground (m)' --rename 'v [m/s]=speed' --kernel matern52")
        .done();
    assert!(ran.stdout.starts_with("t [s],height [m],height_std [m],"), "{}", ran.stdout);
    assert!(
        ran.stderr.contains("columns ignored: speed, note\n") && ran.stderr.contains("kernel matern52"),
        "{}",
        ran.stderr
    );
    let quiet = folder.run("smooth log.csv --state height --kernel matern52 --quiet").done();
    assert_eq!((quiet.stdout, quiet.stderr.as_str()), (ran.stdout, ""));
}

#[test]
fn the_result_does_not_depend_on_the_number_of_threads() {
    let folder = Folder::new();
    let log = data("lotka_volterra.csv");
    let one = folder.run(&format!("smooth {log} --threads 1 --state x1,x2 --kernel matern52")).done().stdout;
    for threads in [2, 7] {
        assert_eq!(
            folder.run(&format!("smooth {log} --threads {threads} --state x1,x2 --kernel matern52")).done().stdout,
            one
        );
    }
}

#[test]
fn stdin_json_and_files_say_the_same() {
    let folder = Folder::new();
    let text = folder.run_with("smooth - --kernel se --quiet", &sine()).done().stdout;
    let file = folder.write("log.csv", &sine()).run("smooth log.csv --kernel se --quiet --out s.csv").done();
    assert_eq!((file.stdout.as_str(), folder.read("s.csv")), ("", text.clone()));
    let json: serde_json::Value =
        serde_json::from_str(&folder.run("smooth log.csv --kernel se --json").done().stdout).unwrap();
    let first: f64 = text.lines().nth(1).unwrap().split(',').nth(1).unwrap().parse().unwrap();
    assert_eq!(json["columns"]["height"][0].as_f64(), Some(first));
    assert_eq!(json["channels"][1]["name"], "v");
    assert_eq!(json["channels"][0]["kernel"], "se");
}

#[test]
fn several_logs_are_several_runs() {
    let folder = Folder::new();
    folder.write("a.csv", &sine()).write("b.csv", &sine());
    let ran = folder.run("smooth a.csv b.csv --state v --quiet").done();
    assert!(ran.stdout.starts_with("run,t [s],v [m/s]"), "{}", ran.stdout);
    assert_eq!(ran.stdout.lines().filter(|l| l.starts_with("b.csv,")).count(), 40);
}

#[test]
fn every_mistake_is_one_line_and_nothing_is_written() {
    let folder = Folder::new();
    folder.write("log.csv", &sine()).write("text.csv", "t,x\n0,a\n1,b\n").write("empty.csv", "t,x\n0,\n1,\n");
    for (arguments, expected) in [
        ("smooth log.csv --state w", "log.csv: column `w` is not in the file; found: height, v, note"),
        ("smooth log.csv --state v,v", "column `v` is named twice"),
        ("smooth log.csv --state note", "log.csv:3: column `note`: not a number: \"ok\""),
        ("smooth log.csv --kernel gauss", "--kernel: "),
        ("smooth log.csv --angle w", "log.csv: column `w` is not in the file"),
        ("smooth log.csv --state v --angle height", "--angle: column `height` is not used by this task"),
        ("smooth log.csv --time v", "log.csv:4: column `v`: time goes back, from 1 to 0.995"),
        ("smooth text.csv", "the logs have no numeric column besides the time"),
        ("smooth empty.csv --state x", "channel `x`: has no value at all"),
        ("smooth log.csv --out no/s.csv", "--out: folder no does not exist"),
        ("smooth - -", "stdin"),
    ] {
        let ran = folder.run(&format!("{arguments} --quiet"));
        assert!(ran.refused().starts_with(expected), "{arguments}\n{ran:?}\nexpected {expected}");
    }
    assert_eq!(folder.names(), ["empty.csv", "log.csv", "text.csv"]);
}

#[test]
fn rates_are_per_the_log_s_own_unit_of_time() {
    let folder = Folder::new();
    let rows: String = (0..40).map(|i| 0.1 * f64::from(i)).map(|t| format!("{t},{},1\n", t.sin())).collect();
    folder.write("log.csv", &format!("t [years],hare [kpelts],v [m/s]\n{rows}"));
    let ran = folder.run("smooth log.csv --state hare,v").done();
    let header = "t [years],hare [kpelts],hare_std [kpelts],hare_dot [kpelts/years],hare_dot_std [kpelts/years],";
    assert!(ran.stdout.starts_with(header) && ran.stdout.contains("v_dot [m/(s*years)]"), "{}", ran.stdout);
}

#[test]
fn what_a_file_holds_does_not_fill_the_screen() {
    let folder = Folder::new();
    for (text, expected) in [
        ("x".repeat(5_000_000), "log.csv:1: no column `t` or `time`"),
        (format!("t,{0},{0}\n0,1,2\n", "x".repeat(5_000_000)), "log.csv:1: column `xxx"),
        (format!("t,x\n0,{}\n1,2\n", "x".repeat(5_000_000)), "the logs have no numeric column"),
        ((0..100_000).map(|i| format!("c{i},")).collect::<String>() + "d", "log.csv:1: no column `t` or `time`"),
    ] {
        let ran = folder.write("log.csv", &text).run("smooth log.csv --quiet");
        assert!(ran.refused().starts_with(expected), "{:.200}", ran.stderr);
        assert!(ran.stderr.len() < 3_000, "{} bytes", ran.stderr.len());
    }
}

/// Twice the columns take about twice the time; where each is looked for among all, it is four times.
#[test]
fn the_time_for_a_log_grows_with_its_columns_and_not_with_their_square() {
    let folder = Folder::new();
    let seconds = |columns: usize| {
        let row = |cell: &dyn Fn(usize) -> String| (0..columns).map(|i| format!(",{}", cell(i))).collect::<String>();
        let rows: String = (0..3).map(|t| format!("{t}{}\n", row(&|i| format!("{}", i + t)))).collect();
        folder.write("log.csv", &format!("t{}\n{rows}", row(&|i| format!("c{i}"))));
        let best = |_| {
            let begun = std::time::Instant::now();
            folder.run("inspect log.csv --json --quiet").done();
            begun.elapsed().as_secs_f64()
        };
        (0..3).map(best).fold(f64::INFINITY, f64::min)
    };
    let (small, large) = (seconds(10_000), seconds(40_000));
    // Four times the columns; 16 times would be the square.
    assert!(large < 8.0 * small + 0.1, "{small} s and {large} s");
}
