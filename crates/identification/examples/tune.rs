//! tmp
#![allow(clippy::all, clippy::pedantic, clippy::unwrap_used)]
use std::time::Instant;
use tumble_identification::excitation::*; use tumble_identification::fourier::*; use tumble_identification::*;
fn main() {
    let crit = std::env::var("CRIT").unwrap_or("D".into());
    for n in [3usize, 5] {
        let limits: [ChannelLimits; 6] = std::array::from_fn(|c| { let l = [[0.3, 0.2, 0.15], [0.5, 0.4, 0.4]][c / 3]; ChannelLimits::symmetric(l[0], l[1], l[2]) });
        let limits = if std::env::var("POS").is_ok() { std::array::from_fn(|c| ChannelLimits::within([0.75,0.8][c/3])) } else { limits };
        let p = SpaceExcitation::try_new(FourierBasis::try_new(10.0, n).unwrap(), &limits, 100).unwrap();
        let p = if std::env::var("EVERY").is_ok() { p } else { p.with_limits_holding(LimitsHold::AtSamples) };
        let mut c = vec![]; let t = Instant::now(); let k: u64 = std::env::var("SEEDS").map(|s| s.parse().unwrap()).unwrap_or(24);
        for seed in 60..60 + k { 
            let d = match crit.as_str() { "D" => p.design(&DOptimality, 1, seed), "A" => p.design(&AOptimality, 1, seed), "E" => p.design(&EOptimality, 1, seed),
              "C" => p.design(&ConditionNumber, 1, seed), "V0" => p.design(&NormalizedCondition{rms_weights:[0.0;6]},1,seed), _ => p.design(&NormalizedCondition { rms_weights: [20.0; 6] }, 1, seed) };
            c.push(d.unwrap().cost); }
        let ms = t.elapsed().as_secs_f64() * 1e3 / k as f64; let first: Vec<_> = c.iter().take(3).map(|x| format!("{x:.3}")).collect();
        c.sort_by(f64::total_cmp); let q = |s: f64| c[((c.len() - 1) as f64 * s).round() as usize];
        println!("n {n} ms {ms:.2} best {:.3} q25 {:.3} median {:.3} q75 {:.3} worst {:.3} first {first:?}", q(0.0), q(0.25), q(0.5), q(0.75), q(1.0));
    }
}
