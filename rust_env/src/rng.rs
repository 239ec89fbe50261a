//! Random streams: one for each (seed, env, episode, purpose), so that nothing drawn in one world,
//! episode or part of the rules can move anything in another.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// What a stream is drawn for. The numbers are part of the snapshot's meaning: never reuse one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Purpose {
    /// Places of robots and obstacles at an episode's start.
    Start = 0,
    /// Kinds, numbers and places of victims.
    Victims = 1,
    /// When random faults begin.
    FaultOnsets = 2,
    /// Which control steps a fault that comes and goes strikes.
    FaultStrikes = 3,
    /// Errors of sensors.
    SensorNoise = 4,
    /// How long victims wait before they are lost.
    Deadlines = 5,
    /// How many victims arrive in a control step.
    Arrivals = 6,
    /// Where robots come back.
    Returns = 7,
    /// Where robots on wheels point when an episode starts.
    Headings = 8,
    /// Which messages do not arrive.
    Losses = 9,
}

/// A stream of random numbers whose state is its key and the count of words drawn.
pub struct Stream(ChaCha8Rng);

impl Stream {
    /// The stream of `purpose` in `episode` of world `env` under `seed`, from its first word.
    #[must_use]
    pub fn new(seed: u64, env: u64, episode: u64, purpose: Purpose) -> Self {
        let mut key = [0_u8; 32];
        for (bytes, word) in key.chunks_exact_mut(8).zip([seed, env, episode, purpose as u64]) {
            bytes.copy_from_slice(&word.to_le_bytes());
        }
        Self(ChaCha8Rng::from_seed(key))
    }

    /// The same stream, continued after `words` words.
    #[must_use]
    pub fn resume(mut self, words: u64) -> Self {
        self.0.set_word_pos(u128::from(words));
        self
    }

    /// How many 32-bit words have been drawn.
    #[must_use]
    pub fn words(&self) -> u64 {
        self.0.get_word_pos() as u64
    }

    /// Uniform in `[0, 1)`, a multiple of 2⁻²⁴.
    pub fn unit(&mut self) -> f32 {
        (self.0.next_u32() >> 8) as f32 * (1.0 / 16_777_216.0)
    }

    /// Uniform in `[0, 1)`, a multiple of 2⁻⁵³; two words.
    pub fn fine_unit(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 * f64::EPSILON * 0.5
    }

    /// Uniform in `[low, high)`.
    pub fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.unit()
    }

    /// Uniform integer in `0..n`, `n` at least 1 (bias below n/2³²).
    pub fn below(&mut self, n: usize) -> usize {
        ((u64::from(self.0.next_u32()) * n as u64) >> 32) as usize
    }
}

#[cfg(test)]
mod tests {
    use super::{Purpose, Stream};

    #[test]
    fn a_resumed_stream_goes_on_where_it_stopped() {
        let mut whole = Stream::new(1, 2, 3, Purpose::Victims);
        for _ in 0..37 {
            whole.unit();
        }
        let mut resumed = Stream::new(1, 2, 3, Purpose::Victims).resume(whole.words());
        for _ in 0..100 {
            assert_eq!(whole.unit().to_bits(), resumed.unit().to_bits());
        }
    }

    #[test]
    fn every_part_of_the_key_makes_another_stream() {
        let first = |seed, env, episode, purpose| {
            let mut stream = Stream::new(seed, env, episode, purpose);
            [stream.unit(), stream.unit()].map(f32::to_bits)
        };
        let base = first(0, 0, 0, Purpose::Start);
        assert_ne!(base, first(1, 0, 0, Purpose::Start));
        assert_ne!(base, first(0, 1, 0, Purpose::Start));
        assert_ne!(base, first(0, 0, 1, Purpose::Start));
        assert_ne!(base, first(0, 0, 0, Purpose::Victims));
    }

    #[test]
    fn integers_cover_their_range_evenly() {
        let mut stream = Stream::new(5, 0, 0, Purpose::Victims);
        let mut counts = [0_i32; 3];
        for _ in 0..30_000 {
            counts[stream.below(3)] += 1;
        }
        assert!(counts.iter().all(|count| (count - 10_000).abs() < 400), "{counts:?}");
    }
}
