//! A file damaged in every simple way, for readers that must survive it.

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

/// What was done to the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Damage {
    /// Only the first `length` bytes are left.
    Cut { length: usize },
    /// One byte has another value.
    Byte { at: usize, value: u8 },
}

impl Damage {
    /// Everything before this byte is as it was.
    pub fn intact_bytes(self) -> usize {
        match self {
            Self::Cut { length } => length,
            Self::Byte { at, .. } => at,
        }
    }
}

/// Pseudo-random bytes, always the same (splitmix64).
struct Bytes(u64);

impl Bytes {
    fn next(&mut self) -> u8 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        ((mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb) >> 56) as u8
    }
}

/// Calls `check` with the file cut at every byte, and with each byte replaced by 0x00, 0xff and a random other value.
///
/// A panic of `check` (a failed assertion, or the reader's own) is passed on after the damage was named. Returns how many
/// damaged files were checked.
pub fn sweep(reference: &[u8], mut check: impl FnMut(&[u8], Damage)) -> usize {
    let mut checked = 0;
    let mut run = |bytes: &[u8], damage: Damage| {
        checked += 1;
        if let Err(panic) = catch_unwind(AssertUnwindSafe(|| check(bytes, damage))) {
            eprintln!("failed on {damage:?} of a file of {} bytes", reference.len());
            resume_unwind(panic);
        }
    };
    for length in 0..reference.len() {
        run(&reference[..length], Damage::Cut { length });
    }
    let mut random = Bytes(reference.len() as u64);
    let mut damaged = reference.to_vec();
    for at in 0..reference.len() {
        let original = reference[at];
        let other = std::iter::repeat_with(|| random.next()).find(|byte| ![original, 0, 0xff].contains(byte));
        for value in [Some(0), Some(0xff), other].into_iter().flatten().filter(|value| *value != original) {
            damaged[at] = value;
            run(&damaged, Damage::Byte { at, value });
        }
        damaged[at] = original;
    }
    checked
}
