use super::*;

pub(super) fn check(found: f64) -> Check {
    Check::new("side of <cubic> (m)", 1.0, found, 0.01).with_printed(Some(1.0))
}

pub(super) fn section(verdict: Verdict, found: f64) -> Section {
    Section {
        id: "fig1".into(),
        title: "Fig. 1: cells & sides".into(),
        claim: "Cells are <b>cubes</b>.".into(),
        finding: "So they are.".into(),
        verdict,
        checks: vec![check(1.0), check(found)],
        tables: vec![Table::new(
            "sides",
            "Sides",
            "lattice|side (m)|cells|a, b",
            [
                ("cubic", 0.1234567, 6, Cell::Empty),
                ("a \"b\"", f64::NAN, 7, "<i>".into()),
            ]
            .map(|(a, b, c, d)| vec![a.into(), Cell::Number(b, 3), Cell::Count(c), d]),
        )],
        figures: vec![Figure::new(
            "sketch",
            "A \"sketch\"",
            "<svg width=\"9\" height=\"9\"></svg>\n".into(),
        )],
    }
}

pub(super) fn report() -> Report {
    report_of(vec![section(Verdict::Reproduced, 1.001)])
}

pub(super) fn report_of(sections: Vec<Section>) -> Report {
    Report::of_paper("A paper", "lattice paper".into(), true, sections)
}

#[test]
fn nothing_is_reproduced_while_a_check_fails() {
    let verdict = |verdict, found| {
        report_of(vec![section(verdict, found)]).sections()[0]
            .verdict
            .clone()
    };
    for found in [1.02, 0.98, f64::NAN, f64::INFINITY] {
        for claimed in [Verdict::Reproduced, Verdict::Corrected("c".into())] {
            let settled = verdict(claimed.clone(), found);
            assert!(
                matches!(&settled, Verdict::NotReproduced(why) if why.contains("side of <cubic>"))
            );
            assert_eq!(verdict(claimed.clone(), 1.009), claimed);
        }
        let data = Verdict::DependsOnData("d".into());
        assert_eq!(verdict(data.clone(), found), data);
        let report = report_of(vec![section(data, found)]);
        assert_eq!(report.failing().count(), 1);
    }
}
