//! Medians with their intervals.

use crate::evaluate::{LEAST_FOR_INTERVAL, median, median_interval};
use crate::report::{Cell, numbers};

/// A median with its 95 % interval.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Median {
    pub n: usize,
    pub value: f64,
    /// None of too few values.
    pub interval: Option<[f64; 2]>,
}

impl Median {
    pub fn of(values: impl Iterator<Item = f64>) -> Option<Median> {
        let values: Vec<f64> = values.collect();
        let interval = median_interval(values.iter().copied());
        Some(Median {
            n: values.len(),
            interval: interval.filter(|_| values.len() >= LEAST_FOR_INTERVAL),
            value: median(values)?,
        })
    }

    /// Ends of the interval as cells.
    pub fn ends(&self, digits: usize) -> [Cell; 2] {
        let ends = self.interval.map(|ends| numbers(digits, ends));
        ends.unwrap_or([Cell::Empty, Cell::Empty])
    }

    /// "0.06 [0.05, 0.08]".
    pub fn text(&self) -> String {
        match self.interval {
            Some(ends) => {
                let [low, high] = ends.map(short);
                format!("{} [{low}, {high}]", short(self.value))
            }
            None => short(self.value),
        }
    }
}

/// Two digits that count, no more than three after the point.
fn short(value: f64) -> String {
    match value.abs() {
        size if size >= 10.0 => format!("{value:.0}"),
        size if size >= 1.0 => format!("{value:.1}"),
        size if size >= 0.1 => format!("{value:.2}"),
        _ => format!("{value:.3}"),
    }
}
