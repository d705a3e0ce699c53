//! A log gives the same numbers in whatever pieces its bytes come.

use super::*;
use crate::log::Log;
use crate::logs::Logs;
use crate::options::LogOptions;
use std::io::SeekFrom;

/// Reads one to `most` bytes at a time.
pub(super) struct Pieces {
    bytes: Cursor<Arc<[u8]>>,
    state: u64,
    most: u64,
}

impl Pieces {
    pub(super) fn new(bytes: &Arc<[u8]>, seed: u64) -> Self {
        Self { bytes: Cursor::new(Arc::clone(bytes)), state: seed, most: [1, 7, 100, 5_000][seed as usize % 4] }
    }
}

impl Read for Pieces {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        self.state = self.state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let size = (1 + (self.state >> 33) % self.most) as usize;
        let end = size.min(buffer.len());
        self.bytes.read(&mut buffer[..end])
    }
}

impl Seek for Pieces {
    fn seek(&mut self, place: SeekFrom) -> std::io::Result<u64> {
        self.bytes.seek(place)
    }
}

fn bits(input: Input, options: &LogOptions, columns: &[&str]) -> Vec<u64> {
    let data = Logs::of(Log::open(input, options, &gpsindy_core::Silent).unwrap()).dataset(columns, &[]).unwrap();
    let values = |run: &gpsindy_core::Run| {
        let columns = (0..columns.len()).flat_map(|j| run.column(j).to_vec()).collect::<Vec<_>>();
        run.time.iter().copied().chain(columns).map(f64::to_bits).collect::<Vec<_>>()
    };
    data.runs().iter().flat_map(values).collect()
}

fn same_in_pieces(bytes: &[u8], map: &[(&str, &str)], columns: &[&str]) {
    let map = map.iter().map(|(a, b)| ((*a).into(), (*b).into())).collect();
    let options = LogOptions { map, ..LogOptions::default() };
    let whole = bits(Input::of_bytes("log", bytes), &options, columns);
    assert!(whole.len() > 200, "{}", whole.len());
    for seed in 0..12 {
        let pieces = Input { file: "log".into(), place: Place::Pieces(bytes.into(), seed) };
        assert_eq!(bits(pieces, &options, columns), whole, "seed {seed}");
    }
}

#[test]
fn a_table_of_text_is_the_same_in_any_pieces() {
    let mut text = String::from("\u{feff}# a remark\r\nt [s],x,\"ä, b\",u\r\n");
    (0..200).for_each(|i| {
        text += &format!("{}.5,{},\"a\r\n\"\"b\"\"\",{}\r\n", i, f64::from(i).sin(), 1.0 / f64::from(i + 1))
    });
    same_in_pieces(text.as_bytes(), &[], &["x", "u"]);
}

#[cfg(feature = "mcap")]
#[test]
fn messages_are_the_same_in_any_pieces() {
    use mcap::Compression;
    for compression in [None, Some(Compression::Zstd), Some(Compression::Lz4)] {
        let map = [("q", "/joint_states.position[pan]"), ("u", "/command.data[1]")];
        same_in_pieces(&crate::formats::mcap_log::tests::robot(compression), &map, &["q", "u"]);
    }
}

#[cfg(feature = "ulog")]
#[test]
fn topics_of_a_flight_are_the_same_in_any_pieces() {
    same_in_pieces(&crate::formats::ulog::tests::flight(), &[("w", "rate.xyz[1]"), ("u", "motor.u")], &["w", "u"]);
}
