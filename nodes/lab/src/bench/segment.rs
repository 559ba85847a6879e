//! Running a network on images.

use std::hint::black_box;

use super::timed;
use lattice_nodes::segmenter::Network;
use serde::Serialize;

/// Times of a network.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SegmentReport {
    /// Width and height of its input, pixels.
    pub input: [usize; 2],
    /// Width and height of its output, pixels.
    pub output: [usize; 2],
    /// Wall time of each round, s.
    pub wall: Vec<f64>,
    /// Processor time of all threads in each round, s.
    pub cpu: Vec<f64>,
}

/// Runs a network on a grey image, again and again; one run more goes before that is not counted.
///
/// Errors: the network fails.
pub fn segment(network: &dyn Network, rounds: usize) -> Result<SegmentReport, String> {
    let input = network.input();
    let image = vec![0.5; 3 * input.pixels()];
    let first = network.run(image.clone())?;
    let mut report = SegmentReport {
        input: [input.width, input.height],
        output: [first.size.width, first.size.height],
        wall: Vec::new(),
        cpu: Vec::new(),
    };
    for _ in 0..rounds.max(1) {
        let image = image.clone();
        let (scores, spent) = timed(|| network.run(image));
        black_box(scores?);
        report.wall.push(spent.wall_s);
        report.cpu.push(spent.cpu_s);
    }
    Ok(report)
}

#[cfg(test)]
mod tests {
    use super::*;
    use lattice_nodes::segmenter::{Scores, Size, Values};

    struct Zeros;

    impl Network for Zeros {
        fn input(&self) -> Size {
            Size {
                width: 4,
                height: 2,
            }
        }

        fn names(&self) -> &[String] {
            &[]
        }

        fn run(&self, planes: Vec<f32>) -> Result<Scores, String> {
            assert_eq!(planes.len(), 24);
            let size = Size {
                width: 2,
                height: 1,
            };
            let values = Values::Classes(vec![0; 2]);
            Ok(Scores { size, values })
        }
    }

    #[test]
    fn every_round_has_its_times() {
        let report = segment(&Zeros, 3).unwrap();
        assert_eq!((report.wall.len(), report.cpu.len()), (3, 3));
        assert_eq!((report.input, report.output), ([4, 2], [2, 1]));
    }
}
