//! Sets of robots as masks of 64 bits, and whether distinct robots can be found for all needs.

/// Whether distinct robots can be taken from the masks, one from each (Kuhn's augmenting paths).
#[must_use]
pub fn fillable(candidates: &[u64]) -> bool {
    fn fill(need: usize, candidates: &[u64], tried: &mut u64, by: &mut [u8; 64]) -> bool {
        for robot in bits(candidates[need]) {
            if *tried >> robot & 1 == 1 {
                continue;
            }
            *tried |= 1 << robot;
            if by[robot] == u8::MAX || fill(usize::from(by[robot]), candidates, tried, by) {
                by[robot] = need as u8;
                return true;
            }
        }
        false
    }
    let mut by = [u8::MAX; 64];
    (0..candidates.len()).all(|need| fill(need, candidates, &mut 0, &mut by))
}

/// The robots of a mask, lowest index first.
pub fn bits(mask: u64) -> impl Iterator<Item = usize> {
    (0..64).filter(move |robot| mask >> robot & 1 == 1)
}
