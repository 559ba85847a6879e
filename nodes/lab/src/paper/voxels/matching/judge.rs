//! The verdict of the trials on the claim.

use super::group::{BCC, BEST_HEX, FCC, Group, HEX, MCC, SHARE_NAMES, name};
use crate::report::{Check, Verdict};

/// Change of median and 95th percentile against cubic, %, in simulated rooms of another program with the
/// same settings and 300 to 400 trials each; by lattice.
pub(super) const ELSEWHERE: [[f64; 2]; 6] = [
    [0.0, 0.0],
    [-12.9, -30.8],
    [-4.9, -16.1],
    [-8.8, -28.1],
    [-7.2, -10.9],
    [-18.3, -17.6],
];

/// Finding of the groups, rooms first.
pub(super) fn finding(groups: &[(&str, Group)], trials: usize, doubt_m: Option<f64>) -> String {
    let mut words = format!(
        "{trials} alignments a lattice and setting, each from a random start and with a random heading and \
         origin of the lattice. Change against cubic, all settings of a place together: "
    );
    for (place, group) in groups {
        let each = [FCC, BCC, BEST_HEX].map(|l| format!("{}: {}", name(l), group.words(l)));
        words.push_str(&format!("{place}: {}. ", each.join("; ")));
        words.push_str(&format!(
            "FCC tries {:+.1} % poses, BCC {:+.1} %. ",
            group.evaluations[FCC], group.evaluations[BCC]
        ));
    }
    if groups.len() == 1 {
        words.push_str("No real pairs were given (--pairs). ");
    }
    if let Some(doubt_m) = doubt_m {
        words.push_str(&format!(
            "The room of PCL comes without a pose; its truth is our own search and GICP, which from the one \
             scan and from the other agree to {:.1} mm. ",
            1000.0 * doubt_m
        ));
    }
    let elsewhere = [FCC, BCC, BEST_HEX].map(|l| {
        let [median, tail] = ELSEWHERE.get(l).copied().unwrap_or_default();
        format!("{}: {median:+.1} and {tail:+.1} %", name(l))
    });
    words.push_str(&format!(
        "Another simulation with the same three settings had, in median and 95th percentile, {}. How large \
         the errors are depends on the room and on the last step, a sixteenth of a cell side; the original ends with a quarter.",
        elsewhere.join("; ")
    ));
    words
}

pub(super) fn verdict(groups: &[(&str, Group)]) -> Verdict {
    const NO_DATA: &str =
        "the office scans behind Fig. 6 are not published, and its plot has no numbers";
    let Some(((_, rooms), real)) = groups.split_first() else {
        return Verdict::DependsOnData(NO_DATA.into());
    };
    let (below, surely) = rooms.better(FCC);
    if rooms.change.iter().any(|of| of[FCC].low > 0.0) {
        let words = rooms.words(FCC);
        return Verdict::NotReproduced(format!("FCC against cubic in simulated rooms: {words}"));
    }
    if !surely {
        let words = match below {
            true => "in simulated rooms FCC has lower errors than cubic, but not beyond chance",
            false => "in simulated rooms FCC and cubic are not told apart by so few alignments",
        };
        return Verdict::DependsOnData(format!("{words}; {NO_DATA}"));
    }
    let mut why =
        vec!["FCC has lower errors and shorter tails than cubic in simulated rooms".into()];
    if rooms.at_least_fcc(BCC) {
        why.push("BCC is at least as good, so FCC is not special".to_owned());
    }
    for (place, group) in real {
        let stands = match (group.better(FCC).1, group.as_cubic(FCC)) {
            (true, _) => "it is better than cubic too",
            (_, true) => "it equals cubic within the noise",
            _ => "it is not better than cubic",
        };
        why.push(format!("on the real scans, {place}, {stands}"));
    }
    why.push(NO_DATA.into());
    Verdict::Corrected(why.join("; "))
}

/// Checks that lattices gain as they did elsewhere, and BCC as much more than FCC.
pub(super) fn checks(rooms: &Group) -> Vec<Check> {
    let check = |what: &str, share: usize, elsewhere: f64, found: f64| {
        let what = format!("{what} of the {} in rooms", SHARE_NAMES[share]);
        Check::new(what, elsewhere.signum(), found.signum(), 0.0)
    };
    let found = |lattice: usize, share: usize| rooms.change[share][lattice].value;
    let sign = |lattice: usize, share: usize| {
        let what = format!("{}: sign of the change against cubic", name(lattice));
        let elsewhere = ELSEWHERE[lattice][share];
        check(&what, share, elsewhere, found(lattice, share))
    };
    let order = |share: usize| {
        let what = "BCC less FCC: sign of the difference of their changes";
        let elsewhere = ELSEWHERE[BCC][share] - ELSEWHERE[FCC][share];
        check(
            what,
            share,
            elsewhere,
            found(BCC, share) - found(FCC, share),
        )
    };
    let both = [BCC, FCC, MCC].map(|lattice| [sign(lattice, 0), sign(lattice, 1)]);
    let mut checks: Vec<Check> = both.into_iter().flatten().collect();
    // The tails of the prisms are not told apart from cubic's.
    checks.extend([HEX, BEST_HEX].map(|lattice| sign(lattice, 0)));
    checks.extend([0, 1].map(order));
    checks
}

#[cfg(test)]
mod tests {
    use super::super::compare::Estimate;
    use super::super::scenes::{OFFICE, ROOMS, STREET};
    use super::*;

    /// A group whose lattices all differ from cubic by so much, with intervals of `half` to either side.
    fn group(percent: [f64; 6], half: f64) -> Group {
        let estimate = |value: f64| Estimate {
            value,
            low: value - half,
            high: value + half,
        };
        Group {
            change: [percent.map(estimate), percent.map(estimate)],
            evaluations: [0.0; 6],
        }
    }

    #[test]
    fn the_verdict_follows_from_the_intervals() {
        let gain = [0.0, -14.0, -12.0, -10.0, -5.0, -3.0];
        let none = [0.0, 2.0, 1.0, 1.0, 1.0, 1.0];
        let rooms = (ROOMS, group(gain, 4.0));
        for (place, percent, half, words) in [
            (STREET, none, 4.0, ["BCC is at least", "equals cubic"]),
            (
                OFFICE,
                gain,
                4.0,
                ["FCC has lower", "better than cubic too"],
            ),
            (OFFICE, none, 0.1, ["FCC has lower", "not better"]),
        ] {
            let found = verdict(&[rooms.clone(), (place, group(percent, half))]);
            assert!(matches!(found, Verdict::Corrected(_)), "{found:?}");
            let why = found.why();
            assert!(words.iter().all(|word| why.contains(word)), "{why}");
        }
        let unsure = verdict(&[(ROOMS, group(gain, 20.0))]);
        assert!(matches!(unsure, Verdict::DependsOnData(_)), "{unsure:?}");
        let few = verdict(&[(ROOMS, group(none, 20.0))]);
        assert!(few.why().contains("not told apart"), "{few:?}");
        let worse = verdict(&[(ROOMS, group(none, 0.1))]);
        assert!(matches!(worse, Verdict::NotReproduced(_)), "{worse:?}");
    }

    #[test]
    fn checks_fail_for_a_change_of_sign() {
        let holding = |percent| {
            let checks = checks(&group(percent, 1.0));
            checks.iter().filter(|check| check.holds()).count()
        };
        assert_eq!(holding([0.0, -3.0, -2.0, -1.0, -1.0, -1.0]), 10);
        assert_eq!(holding([0.0, 1.0, -2.0, 3.0, -1.0, 1.0]), 3);
        assert_eq!(holding([f64::NAN; 6]), 0);
    }
}
