//! Faults of a file: bits, bytes and words changed, pieces cut out, doubled, put elsewhere, the end missing.

/// Random numbers, the same in every run.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn below(&mut self, n: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as usize % n.max(1)
    }
}

/// A file with one to six faults.
pub(crate) fn broken(whole: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = whole.to_vec();
    for _ in 0..=random.below(6) {
        if bytes.is_empty() {
            break;
        }
        // Heads and ends hold most of what is structure.
        let at = match random.below(3) {
            0 => random.below(bytes.len().min(400)),
            1 => bytes.len() - 1 - random.below(bytes.len().min(400)),
            _ => random.below(bytes.len()),
        };
        let end = (at + 1 + random.below(64)).min(bytes.len());
        match random.below(9) {
            0 => bytes[at] = random.below(256) as u8,
            1 => bytes[at] ^= 1 << random.below(8),
            2 => bytes.truncate(at),
            3 => drop(bytes.drain(at..end)),
            4 => {
                let piece = bytes[at..end].to_vec();
                bytes.splice(at..at, piece);
            }
            5 => {
                let (piece, to) = (bytes[at..end].to_vec(), random.below(bytes.len()));
                let end = (to + piece.len()).min(bytes.len());
                let length = end - to;
                bytes[to..end].copy_from_slice(&piece[..length]);
            }
            6 => {
                let value =
                    [0, 1, 0x7fff_ffff_ffff_ffff, u64::MAX, 0x8000_0000, random.below(1 << 20) as u64][random.below(6)];
                let size = [1, 2, 4, 8][random.below(4)].min(bytes.len() - at);
                bytes[at..at + size].copy_from_slice(&value.to_le_bytes()[..size]);
            }
            7 => bytes[at] = bytes[at].wrapping_add([1, 255, 16][random.below(3)]),
            _ => bytes[at..end].fill([0, 0x7f, 0xff, b'"', b'\n'][random.below(5)]),
        }
    }
    bytes
}
