//! Every column of a Parquet table or a LeRobot data set.

use super::super::Sheet;
use super::super::column::Column;
use super::Looked;
use crate::error::Result;
use crate::formats::parquet_log::ParquetLog;
use crate::topic::Source;
use gpsindy_core::Progress;

pub(crate) fn look(log: &ParquetLog, file: String, format: &'static str, progress: &dyn Progress) -> Result<Looked> {
    let headers = log.columns();
    let (time, stated) = log.clock();
    let mut sheet = Sheet { clock: time.name.clone(), single: stated == "float32", ..Sheet::default() };
    let mut notes = Vec::new();
    let mut columns: Vec<Column> = headers
        .iter()
        .enumerate()
        .map(|(i, h)| Column::new(&h.text, &h.name, log.kind(i), &h.unit, log.is_numeric(i)))
        .collect();
    // The elements of a list at once, the columns otherwise one by one: so little is in memory at a time.
    let mut at = 0;
    loop {
        let mut group: Vec<usize> = (at..headers.len()).take_while(|&i| i == at || log.same_list(at, i)).collect();
        at += group.len().max(1);
        group.retain(|&i| log.is_numeric(i));
        let reading = log.gather(&group, progress, false)?;
        if sheet.runs.is_empty() {
            for topic in &reading.topics {
                sheet.runs.push(sheet.stamps.len());
                sheet.stamps.extend(&topic.stamps);
            }
            sheet.origin = reading.origin;
            notes = reading.notes;
        }
        for topic in reading.topics {
            for (j, values) in topic.columns {
                columns[group[j]].end_run();
                values.into_iter().for_each(|value| columns[group[j]].push(value));
            }
        }
        if at >= headers.len() {
            break;
        }
    }
    sheet.columns = columns;
    // The reading says it only of stamps that were taken for seconds.
    let doubt = crate::time::doubt(time, &sheet.stamps);
    let is_said = |note: &String| doubt.as_ref().is_some_and(|doubt| note.ends_with(doubt));
    sheet.doubt = doubt.clone().filter(|_| notes.iter().any(is_said));
    notes.retain(|note| !is_said(note));
    // Stamps that were made again are no longer float32.
    sheet.single &= !notes.iter().any(|note| note.contains("made again"));
    Ok((file, format, vec![sheet], notes))
}
