//! Seeds of missions: a function of the campaign's seed and the mission's number, nothing else.

/// Seed of the `number`-th mission (from zero) of a campaign.
///
/// Output `number` of SplitMix64 begun at `master`, without its 11 lowest bits: whoever reads seeds as floating-point numbers (JSON
/// in a browser, a spreadsheet) reads them exactly.
///
/// # Source
/// Steele, Lea, Flood: Fast splittable pseudorandom number generators, OOPSLA 2014.
pub fn mission_seed(master: u64, number: u64) -> u64 {
    split_mix(master, number) >> 11
}

fn split_mix(state: u64, index: u64) -> u64 {
    let mut z = state.wrapping_add(index.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn the_published_stream() {
        // First outputs of the reference code (splitmix64.c of S. Vigna) for the state 1234567.
        let published = [
            6_457_827_717_110_365_317_u64,
            3_203_168_211_198_807_973,
            9_817_491_932_198_370_423,
            4_593_380_528_125_082_431,
            16_408_922_859_458_223_821,
        ];
        for (index, expected) in (0..).zip(published) {
            assert_eq!(split_mix(1_234_567, index), expected);
            assert_eq!(mission_seed(1_234_567, index), expected >> 11);
        }
    }

    #[test]
    fn seeds_stay_what_they_are() {
        assert_eq!([0, 1, 999].map(|k| mission_seed(1, k)), GOLDEN);
    }

    const GOLDEN: [u64; 3] = [5_103_132_997_656_651, 6_717_404_888_216_029, 8_130_968_316_977_257];

    #[test]
    fn seeds_differ_and_fit_a_double() {
        let seeds: BTreeSet<u64> = (0..4).flat_map(|master| (0..5000).map(move |k| mission_seed(master, k))).collect();
        assert_eq!(seeds.len(), 20_000);
        assert!(seeds.iter().all(|seed| *seed < 1 << 53));
    }
}
