//! The methods that are compared on laser scans.

use crate::evaluate::methods::START;
use crate::evaluate::trial::OURS;
use lattice_core::registration::NamedMethod;

/// Gates of the methods for which none is published, metres.
const GATES_M: [f64; 2] = [1.0, 2.0];

/// A way to register two scans.
#[derive(Clone, Copy, Debug)]
pub enum KittiMethod {
    /// The start as it is.
    Start,
    /// One registration from the start, with a gate in metres.
    Single(&'static NamedMethod, f64),
    /// A calibration, the start being known or not.
    Ours {
        /// True to thin the moved scan before, as for all others; the calibration thins it in any case.
        thinned: bool,
    },
}

impl KittiMethod {
    /// All methods in the order of the table; `thinned` is whether ours gets a thinned scan.
    pub fn all(thinned: bool) -> Vec<KittiMethod> {
        let mut all = vec![KittiMethod::Start];
        for method in &NamedMethod::ALL {
            all.extend(GATES_M.into_iter().filter_map(|gate_m| match method.name {
                "class_wise_cauchy" => None,
                // Normalised weights are for wide gates.
                "em_hard" if gate_m < 2.0 => None,
                _ if !method.takes_gate && gate_m > GATES_M[0] => None,
                _ => Some(KittiMethod::Single(method, gate_m)),
            }));
        }
        all.push(KittiMethod::Ours { thinned });
        all
    }

    /// Name in results.
    pub fn name(&self) -> String {
        match self {
            KittiMethod::Start => START.to_owned(),
            KittiMethod::Single(method, gate_m) if method.takes_gate => {
                format!("{}_{gate_m}", method.name)
            }
            KittiMethod::Single(method, _) => method.name.to_owned(),
            KittiMethod::Ours { .. } => OURS.to_owned(),
        }
    }

    /// Name in tables.
    pub fn title(&self) -> String {
        match self {
            KittiMethod::Start => "the start itself".to_owned(),
            KittiMethod::Single(method, gate_m) => {
                let gate_m = method.options(*gate_m).gate_m;
                format!("{}, {} m", method.title, (10.0 * gate_m).round() / 10.0)
            }
            KittiMethod::Ours { .. } => "**ours**".to_owned(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn methods_without_a_published_gate_have_one_in_their_names() {
        let all = KittiMethod::all(false);
        let names: Vec<String> = all.iter().map(KittiMethod::name).collect();
        assert_eq!(
            names.join(" "),
            "start icp_1 icp_2 gicp_1 gicp_2 gicp_se3 semantic_hard semantic_soft as_printed em_hard_2 \
             class_wise ours"
        );
    }
}
