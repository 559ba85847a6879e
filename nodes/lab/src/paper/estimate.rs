//! Means with their intervals.

use crate::report::Cell;

/// A mean and half of its 95 % interval.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Estimate {
    pub mean: f64,
    /// The truth is this near in 95 of 100 cases; infinite of fewer than two values.
    pub half: f64,
}

impl Estimate {
    /// The estimate from independent values, by Student's t.
    pub fn of(values: impl IntoIterator<Item = f64>) -> Estimate {
        let values: Vec<f64> = values.into_iter().collect();
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let squares: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
        let half = match values.len() {
            0 | 1 => f64::INFINITY,
            _ => student(n - 1.0) * (squares / (n - 1.0) / n).sqrt(),
        };
        Estimate { mean, half }
    }

    /// The standard deviation of independent values; the interval is that of large numbers of them,
    /// whatever their distribution.
    pub fn deviation_of(values: &[f64]) -> Estimate {
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let moment = |power| values.iter().map(|v| (v - mean).powi(power)).sum::<f64>() / n;
        let (square, fourth) = (moment(2), moment(4));
        let deviation = (square * n / (n - 1.0)).sqrt();
        let error = ((fourth - square * square).max(0.0) / n).sqrt() / (2.0 * deviation);
        Estimate {
            mean: deviation,
            half: student(n - 1.0) * error,
        }
    }

    /// The ratio to another estimate, for errors that are small against both.
    pub fn over(&self, other: &Estimate) -> Estimate {
        let mean = self.mean / other.mean;
        let share = (self.half / self.mean).hypot(other.half / other.mean);
        Estimate {
            mean,
            half: mean.abs() * share,
        }
    }

    pub fn is_negative(&self) -> bool {
        self.mean + self.half < 0.0
    }

    pub fn is_positive(&self) -> bool {
        self.mean - self.half > 0.0
    }

    /// The mean and half of the interval as two cells of a table.
    pub fn cells(&self, scale: f64, digits: usize) -> [Cell; 2] {
        [self.mean, self.half].map(|value| Cell::Number(scale * value, digits))
    }
}

/// Quantile of a two-sided 95 % interval for a number of degrees of freedom (Cornish & Fisher's
/// expansion: within 0.2 % from five degrees on, below it a few percent).
fn student(freedom: f64) -> f64 {
    let z: f64 = 1.959_963_984_540_054;
    let terms = [
        z,
        (z.powi(3) + z) / 4.0,
        (5.0 * z.powi(5) + 16.0 * z.powi(3) + 3.0 * z) / 96.0,
        (3.0 * z.powi(7) + 19.0 * z.powi(5) + 17.0 * z.powi(3) - 15.0 * z) / 384.0,
    ];
    let add = |sum: f64, term: &f64| sum / freedom + term;
    terms.iter().rev().fold(0.0, add)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_the_tables() {
        for (freedom, t) in [
            (5.0, 2.5706),
            (7.0, 2.3646),
            (23.0, 2.0687),
            (199.0, 1.9720),
        ] {
            let found = student(freedom);
            assert!((found / t - 1.0_f64).abs() < 0.002, "{freedom}: {found}");
        }
    }

    #[test]
    fn an_interval_holds_the_mean_as_often_as_it_says() {
        let mut stream = crate::random::Stream::numbered(4, 0);
        let mut held = 0;
        for _ in 0..2000 {
            let found = Estimate::of((0..8).map(|_| 1.0 + stream.normal()));
            held += usize::from((found.mean - 1.0).abs() <= found.half);
        }
        assert!((1860..1940).contains(&held), "{held}");
        let deviation = |_| Estimate::deviation_of(&[(); 200].map(|()| stream.normal()));
        let holds = |d: &Estimate| (d.mean - 1.0).abs() <= d.half;
        let held = (0..1000).map(deviation).filter(holds).count();
        assert!((920..970).contains(&held), "{held}");
        assert_eq!(Estimate::of([3.0]).half, f64::INFINITY);
        assert!(!Estimate::of([]).is_negative());
    }
}
