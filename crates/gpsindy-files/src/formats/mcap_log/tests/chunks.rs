//! Chunks as other writers pack them.

use super::*;

#[test]
fn chunks_of_several_frames_and_with_bytes_behind_are_read() {
    let whole = robot(None);
    let expected = assembled(&whole, &MAP[..1], &[]);
    for packing in ["lz4", "zstd"] {
        let mut bytes = mcap::MAGIC.to_vec();
        let mut reader = mcap::sans_io::LinearReader::new_with_options(
            mcap::sans_io::LinearReaderOptions::default().with_emit_chunks(true),
        );
        let mut rest = whole.as_slice();
        while let Some(event) = reader.next_event() {
            match event.unwrap() {
                mcap::sans_io::LinearReadEvent::ReadRequest(wanted) => {
                    let (now, behind) = rest.split_at(wanted.min(rest.len()));
                    reader.insert(now.len()).copy_from_slice(now);
                    reader.notify_read(now.len());
                    rest = behind;
                }
                mcap::sans_io::LinearReadEvent::Record { data, opcode } => {
                    let data = if opcode == mcap::records::op::CHUNK { packed(data, packing) } else { data.to_vec() };
                    bytes.push(opcode);
                    bytes.extend((data.len() as u64).to_le_bytes());
                    bytes.extend(data);
                }
            }
        }
        bytes.extend(mcap::MAGIC);
        let found = assembled(&bytes, &MAP[..1], &[]);
        assert_eq!(found.notes, [""; 0], "{packing}");
        assert_eq!(found.data.runs()[0].time, expected.data.runs()[0].time);
        assert_eq!(found.data.runs()[0].column(0), expected.data.runs()[0].column(0));
        // Another checksum is reported, after the messages of its chunk.
        let at = bytes.windows(packing.len()).position(|w| w == packing.as_bytes()).unwrap();
        bytes[at - 5] ^= 1;
        let found = assembled(&bytes, &MAP[..1], &[]);
        assert!(found.notes[0].contains("Chunk CRC failed"), "{:?}", found.notes);
        assert!(found.data.runs()[0].n_samples() < 200);
    }
}

/// A chunk that was not packed, in two frames, with bytes behind its records.
fn packed(chunk: &[u8], packing: &str) -> Vec<u8> {
    let (head, records) = (&chunk[..28], &chunk[40..]);
    let frames: Vec<u8> = [&records[..records.len() / 3], &records[records.len() / 3..]]
        .iter()
        .flat_map(|part| match packing {
            "zstd" => zstd::bulk::compress(part, 1).unwrap(),
            _ => {
                let mut encoder = lz4::EncoderBuilder::new().build(Vec::new()).unwrap();
                std::io::Write::write_all(&mut encoder, part).unwrap();
                encoder.finish().0
            }
        })
        .collect();
    let size = frames.len() as u64 + 3;
    [head, &(packing.len() as u32).to_le_bytes(), packing.as_bytes(), &size.to_le_bytes(), &frames, &[0; 3 + 4]]
        .concat()
}
