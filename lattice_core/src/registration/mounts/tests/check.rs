use super::*;

const LEAST: [f64; 3] = [0.005, 0.05, 0.005];

/// True if a number is certain and above `LEAST`.
fn is_wrong(found: &MountEstimate) -> bool {
    found.numbers.iter().enumerate().any(|(i, number)| {
        let limit = LEAST[i / 3].max(3.0 * number.sigma);
        number.is_observable && number.value.abs() > limit
    })
}

#[test]
fn a_check_finds_what_an_estimate_finds() {
    let mut random = Random(20);
    let mut wrong_ones = 0;
    let options = MountOptions::default();
    for seed in 20..32 {
        let drive = [Drive::Rough, Drive::Flat, Drive::Straight][seed as usize % 3];
        // From mounts that are hardly wrong to the ends of the search.
        let size = 0.9_f64.powi(31 - seed as i32);
        let turn = [(); 3].map(|()| 14.0 * size * random.next());
        let shift = [(); 3].map(|()| 0.9 * size * random.next());
        let samples = samples(drive, &wrong(turn, shift), 0.0, seed);
        let checked = check_mount(&samples, &options, LEAST);
        let found = estimate_mount(&samples, &options);
        match (&checked, &found) {
            (Ok(None), Ok(found)) => assert!(!is_wrong(found), "{seed}: {found:?}"),
            (Ok(None), Err(error)) => panic!("{seed}: {error}"),
            (Ok(Some(checked)), _) => assert_eq!(found.as_ref(), Ok(checked)),
            (Err(error), _) => assert_eq!(found.as_ref(), Err(error)),
        }
        wrong_ones += usize::from(found.is_ok_and(|found| is_wrong(&found)));
    }
    assert!(wrong_ones > 6, "{wrong_ones}");
}

#[test]
fn a_mount_that_fits_is_not_estimated() {
    for (drive, seed) in [(Drive::Rough, 40), (Drive::Flat, 41), (Drive::Straight, 42)] {
        let samples = samples(drive, &wrong([0.0; 3], [0.0; 3]), 0.0, seed);
        let checked = check_mount(&samples, &MountOptions::default(), LEAST);
        assert_eq!(checked, Ok(None));
    }
}
