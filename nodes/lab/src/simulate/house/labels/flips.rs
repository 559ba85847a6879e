//! Choice of the regions that are labelled wrongly.

use crate::simulate::random::Stream;

/// More of the picture than asked for may be flipped by this, so that large regions get their turn.
const OVERSHOOT: f64 = 0.04;

/// Regions that are wrong in map and headset, met as nearly as whole regions allow.
pub(super) fn flipped(share: f64, pixels: &[u64], stream: &mut Stream) -> Vec<[bool; 2]> {
    let mut flipped = vec![[false; 2]; pixels.len()];
    let mut order: Vec<usize> = (0..pixels.len()).collect();
    for i in (1..order.len()).rev() {
        order.swap(i, (stream.uniform() * (i + 1) as f64) as usize);
    }
    let all = pixels.iter().sum::<u64>() as f64;
    let (goal, most) = (share * all, (share + OVERSHOOT) * all);
    let mut left = all;
    // Pixels of the wrong regions, and of those in the map and in the headset.
    let (mut wrong, mut of) = (0.0, [0.0; 2]);
    for i in order {
        let size = pixels[i] as f64;
        let [chance, coin] = [stream.uniform(), stream.uniform()];
        let flip = match pixels[i] {
            0 => chance < share,
            _ if share == 0.0 => false,
            _ if wrong + size <= most => true,
            // Too large, but without it there would be too few: whichever is nearer.
            _ => wrong + size - goal < goal - wrong - (left - size),
        };
        left -= size;
        if !flip {
            continue;
        }
        wrong += size;
        let in_map = match size == 0.0 {
            true => coin < 0.5,
            false => of[0] < of[1] || (of[0] == of[1] && coin < 0.5),
        };
        flipped[i] = [in_map, !in_map];
        for (sum, wrong) in of.iter_mut().zip(flipped[i]) {
            *sum += if wrong { size } else { 0.0 };
        }
    }
    flipped
}
