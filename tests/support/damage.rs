//! Damage of a file as disks and networks do it: cut, flipped, zeroed, copied, extreme.

use rand::Rng;
use rand::rngs::StdRng;

/// Number of kinds of damage that any file can take.
pub const KINDS: usize = 6;

/// Damage of one kind, below [`KINDS`], where the seed decides.
pub fn damage(kind: usize, bytes: &mut Vec<u8>, random: &mut StdRng) -> &'static str {
    let length = bytes.len();
    let span = |random: &mut StdRng| {
        let from = random.random_range(0..length);
        from..(from + random.random_range(1..=512)).min(length)
    };
    match kind {
        0 => {
            bytes.truncate(random.random_range(0..length));
            "truncated"
        }
        1 => {
            for _ in 0..random.random_range(1..=8) {
                bytes[random.random_range(0..length)] ^= 1 << random.random_range(0..8);
            }
            "bits flipped"
        }
        2 => {
            for _ in 0..random.random_range(1..=4) {
                bytes[random.random_range(0..length.min(4096))] ^= 1 << random.random_range(0..8);
            }
            "bits flipped in the head"
        }
        3 => {
            let span = span(random);
            bytes[span].fill(0);
            "block zeroed"
        }
        4 => {
            let from = span(random);
            let to = random.random_range(0..length - from.len());
            bytes.copy_within(from, to);
            "block copied"
        }
        _ => {
            let at = random.random_range(0..length - 8) & !7;
            let word = [u64::MAX, 1 << 63, 1 << 40, 1 << 31, 0][random.random_range(0..5)];
            bytes[at..at + 8].copy_from_slice(&word.to_le_bytes());
            "extreme word"
        }
    }
}
