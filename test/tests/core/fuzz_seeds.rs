//! The bodies of the fuzz targets hold over their seeds and over damaged copies of them.
//!
//! With `LATTICE_FUZZ_CORPUS` set to a directory this writes the seeds there, for `test/fuzz`.

use crate::fuzz;

use std::path::PathBuf;

#[test]
fn fuzz_targets_hold_over_their_seeds_and_damaged_copies() {
    for (target, run, seeds) in fuzz::TARGETS {
        over_seeds(target, run, &seeds());
    }
}

fn over_seeds(target: &str, run: fn(&[u8]), seeds: &[Vec<u8>]) {
    // So that many seeds take no more time than a few.
    let copies = (1200 / seeds.len()).clamp(5, 40);
    let mut state = 1_u64;
    let mut random = |below: usize| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % below
    };
    for (number, seed) in seeds.iter().enumerate() {
        run(seed);
        for _ in 0..copies {
            let mut bytes = seed.clone();
            for _ in 0..=random(4) {
                let at = random(bytes.len());
                bytes[at] = random(256) as u8;
            }
            if random(4) == 0 {
                bytes.truncate(random(bytes.len()));
            }
            run(&bytes);
        }
        if let Some(corpus) = std::env::var_os("LATTICE_FUZZ_CORPUS") {
            let directory = PathBuf::from(corpus).join(target);
            std::fs::create_dir_all(&directory).unwrap();
            std::fs::write(directory.join(format!("seed_{number:02}")), seed).unwrap();
        }
    }
}
