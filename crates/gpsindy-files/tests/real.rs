//! Logs and models of real machines, which are not in the repository.
#![allow(clippy::unwrap_used)]

use gpsindy_beside::shared;
use gpsindy_files::{LogOptions, Logs, model_to_toml, parse_model, read_model};

#[test]
fn real_logs_can_be_read() {
    let Some(root) = shared("data") else { return };
    let folders = std::fs::read_dir(root).unwrap();
    let mut read = 0;
    for file in folders.flatten().filter_map(|d| std::fs::read_dir(d.path()).ok()).flatten().flatten() {
        // balls.csv is a table of properties, not a log.
        if file.path().extension().is_none_or(|e| e != "csv") || file.file_name() == "balls.csv" {
            continue;
        }
        let logs = Logs::read(&[file.path()], &LogOptions::default()).unwrap();
        let names: Vec<&str> = logs.files()[0].columns().map(|header| header.name.as_str()).collect();
        logs.dataset(&names, &[]).unwrap();
        read += 1;
    }
    assert!(read > 50, "{read}");
}

#[test]
fn real_models_can_be_read_and_written_back() {
    for (folder, file) in [("data", "nominal.toml"), ("practice", "model.toml")] {
        let Some(root) = shared(folder) else { continue };
        let mut read = 0;
        for path in std::fs::read_dir(root).unwrap().flatten().map(|e| e.path().join(file)).filter(|p| p.exists()) {
            let model = read_model(&path).unwrap();
            assert_eq!(parse_model("again", &model_to_toml(&model).unwrap()).unwrap(), model);
            read += 1;
        }
        assert!(read > 1, "{folder}: {read}");
    }
}
