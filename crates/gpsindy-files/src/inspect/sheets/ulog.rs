//! Every topic of a ULog.

use super::super::Sheet;
use super::super::column::Column;
use super::Looked;
use crate::error::Result;
use crate::formats::ulog::container::{Field, parse};
use crate::input::Input;
use gpsindy_core::Progress;
use std::collections::HashMap;

pub(crate) fn look(input: &Input, progress: &dyn Progress) -> Result<Looked> {
    let mut sheets: Vec<(Sheet, Vec<Field>)> = Vec::new();
    let mut known: HashMap<u16, usize> = HashMap::new();
    let broken = parse(input, progress, &mut |message| {
        let at = *known.entry(message.subscription).or_insert_with(|| {
            let column = |f: &Field| Column::new(&f.name, &f.name, f.type_name, "", true);
            let sheet = Sheet {
                topic: message.topic.into(),
                clock: "timestamp".into(),
                runs: vec![0],
                columns: message.fields.iter().map(column).collect(),
                ..Sheet::default()
            };
            sheets.push((sheet, message.fields.to_vec()));
            sheets.len() - 1
        });
        let Some(stamp) = message.stamp() else { return };
        let (sheet, fields) = &mut sheets[at];
        sheet.stamps.push(stamp as f64 / 1e9);
        for (column, field) in sheet.columns.iter_mut().zip(fields) {
            column.push(field.value(message.data));
        }
    })?;
    let mut sheets: Vec<Sheet> = sheets.into_iter().map(|(sheet, _)| sheet).collect();
    sheets.sort_by(|a, b| a.topic.cmp(&b.topic));
    Ok((input.file.clone(), "ULog", sheets, broken.into_iter().collect()))
}
