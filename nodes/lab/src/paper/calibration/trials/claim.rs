//! The conclusion of the paper: labels help where they agree, and harm where they do not.

use super::figures;
use super::methods::{GICP, SEMANTIC, methods};
use super::trials_of_methods::{Trials, in_words, right};
use crate::AnyError;
use crate::evaluate::{OURS, title};
use crate::report::{Cell, Section, Table, Verdict};

/// Judgement of a method in comparison with GICP-SE(3).
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Word {
    Better,
    Worse,
    /// The interval holds 1.
    Same,
    /// Too few trials.
    Unknown,
}

impl Word {
    fn text(self) -> &'static str {
        match self {
            Word::Better => "better",
            Word::Worse => "worse",
            Word::Same => "not told apart",
            Word::Unknown => "too few trials",
        }
    }
}

fn word(trials: &Trials, q: f64, start: &str, method: &str) -> Word {
    let ratio = trials.ratio(None, q, start, method);
    match ratio.and_then(|ratio| ratio.interval) {
        Some([_, high]) if high < 1.0 => Word::Better,
        Some([low, _]) if low > 1.0 => Word::Worse,
        Some(_) => Word::Same,
        None => Word::Unknown,
    }
}

/// Judgements with right labels from a bad start, and with wrong ones from a good one.
fn helps_and_harms(trials: &Trials, method: &str) -> [Word; 2] {
    let [good, poor] = &trials.starts;
    [
        word(trials, 0.0, poor, method),
        word(trials, trials.bad, good, method),
    ]
}

pub(super) fn section(trials: &Trials) -> Result<Section, AnyError> {
    Ok(Section {
        id: "claim".to_owned(),
        title: "Sections 4.5 to 6: when labels help".to_owned(),
        claim: "Calibration by Semantic-ICP is better than by GICP-SE(3) where the labels of both devices are right, and \
                worse where large regions have different labels; the larger the regions that agree, the better."
            .to_owned(),
        finding: finding(trials),
        verdict: verdict(trials),
        checks: Vec::new(),
        tables: vec![ratios(trials), shares(trials)],
        figures: vec![figures::by_flips(trials)?],
    })
}

fn verdict(trials: &Trials) -> Verdict {
    let judged = SEMANTIC.map(|method| (title(method), helps_and_harms(trials, method)));
    let of = |holds: &dyn Fn([Word; 2]) -> bool| {
        let named = judged.iter().filter(|(_, words)| holds(*words));
        named.map(|(name, _)| *name).collect::<Vec<_>>()
    };
    if !of(&|words| words.contains(&Word::Unknown)).is_empty() {
        return Verdict::DependsOnData(
            "more trials of each kind, as a run without --quick has them".to_owned(),
        );
    }
    let as_said = of(&|words| words == [Word::Better, Word::Worse]);
    let others = of(&|words| words != [Word::Better, Word::Worse]);
    match (as_said.is_empty(), others.is_empty()) {
        (false, true) => Verdict::Reproduced,
        (true, _) => Verdict::NotReproduced(
            "no form of Semantic-ICP is both better with right labels from the bad start and worse with wrong ones from the \
             good one"
                .to_owned(),
        ),
        (false, false) => Verdict::Corrected(format!(
            "with the form of Semantic-ICP and the start said: better with right labels from bad starts and worse with wrong ones from \
             good starts holds for {}, not for {}",
            as_said.join(" and "),
            others.join(" and ")
        )),
    }
}

fn finding(trials: &Trials) -> String {
    let [good, poor] = &trials.starts;
    let ratio = |q: f64, start: &str, method: &str| {
        let ratio = trials.ratio(None, q, start, method);
        ratio.map_or("-".to_owned(), |ratio| ratio.text())
    };
    let list = |q: f64, start: &str| {
        let each = SEMANTIC.map(|method| format!("{} {}", title(method), ratio(q, start, method)));
        each.join("; ")
    };
    format!(
        "d_SE(3) as a multiple of that of GICP-SE(3) in the same trial, median with 95 % interval, all scenes. Right labels, starts {}: \
         {}. Right labels, starts {}: {}. Objects over {:.0} % of the view labelled wrongly, starts {}: {}. Ours, which learns how far \
         labels can be trusted: {} with right labels and {} with wrong ones from the same bad starts, {} and {} from the good ones.",
        in_words(poor),
        list(0.0, poor),
        in_words(good),
        list(0.0, good),
        100.0 * trials.bad,
        in_words(good),
        list(trials.bad, good),
        ratio(0.0, poor, OURS),
        ratio(trials.bad, poor, OURS),
        ratio(0.0, good, OURS),
        ratio(trials.bad, good, OURS),
    )
}

/// Paired ratios of all methods.
fn ratios(trials: &Trials) -> Table {
    let mut rows = Vec::new();
    for start in &trials.starts {
        for q in [0.0, trials.bad] {
            for method in methods().into_iter().filter(|method| *method != GICP) {
                let Some(ratio) = trials.ratio(None, q, start, method) else {
                    continue;
                };
                let [low, high] = ratio.ends(3);
                rows.push(vec![
                    in_words(start).into(),
                    format!("{:.0} %", 100.0 * q).into(),
                    title(method).into(),
                    ratio.n.into(),
                    Cell::Number(ratio.value, 3),
                    low,
                    high,
                    word(trials, q, start, method).text().into(),
                ]);
            }
        }
    }
    let columns = "start|wrong labels|method|trials|d_SE(3) as a multiple of GICP-SE(3)'s, median|\
        95 % from|to|than GICP-SE(3)";
    Table::new(
        "claim_ratios",
        "Against GICP-SE(3) in the same trials, all scenes",
        columns,
        rows,
    )
}

/// Right poses.
fn shares(trials: &Trials) -> Table {
    let columns = methods().map(|method| format!("|{}", title(method)));
    let columns = format!("start|wrong labels{}", columns.concat());
    let starts = trials.starts.iter();
    let cells = starts.flat_map(|start| trials.flips().into_iter().map(move |q| (start, q)));
    let row = |(start, q): (&String, f64)| {
        let mut row = vec![in_words(start).into(), format!("{:.0} %", 100.0 * q).into()];
        row.extend(methods().into_iter().map(|method| {
            let share = right(trials.of_method(None, q, start, method));
            share.share.map_or(Cell::Empty, |_| share.text(0).into())
        }));
        row
    };
    Table::new(
        "claim_right",
        "Poses right within 0.15 m and 3 degrees, with 95 % intervals, all scenes",
        &columns,
        cells.map(row),
    )
}
