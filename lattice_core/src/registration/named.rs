//! Table of the registration methods and their names in commands, result files and reports.

use super::{LabelUse, RegisterOptions, SemanticVariant};

/// Registration method with its names.
#[derive(Clone, Copy, Debug)]
pub struct NamedMethod {
    /// Name in result files.
    pub name: &'static str,
    /// Value of `--method`.
    pub option: &'static str,
    /// Name in tables and figure legends.
    pub title: &'static str,
    /// One line of help.
    pub help: &'static str,
    /// True if the gate is a parameter; the other methods have a published gate.
    pub takes_gate: bool,
    options: fn(f64) -> RegisterOptions<'static>,
}

impl NamedMethod {
    /// All methods, in the order of the tables.
    pub const ALL: [NamedMethod; 9] = [
        NamedMethod {
            name: "icp",
            option: "icp",
            title: "ICP",
            help: "Point-to-point ICP",
            takes_gate: true,
            options: RegisterOptions::point_to_point,
        },
        NamedMethod {
            name: "gicp",
            option: "gicp",
            title: "GICP",
            help: "Generalized ICP with the tolerances of small_gicp",
            takes_gate: true,
            options: RegisterOptions::gicp,
        },
        NamedMethod {
            name: "gicp_se3",
            option: "gicp-se3",
            title: "GICP-SE(3)",
            help: "GICP on SE(3) with a Cauchy kernel",
            takes_gate: false,
            options: |_| RegisterOptions::gicp_se3(),
        },
        NamedMethod {
            name: "semantic_hard",
            option: "semantic-published",
            title: "Semantic-ICP, hard",
            help: "Semantic-ICP as its authors' program runs, hard labels",
            takes_gate: false,
            options: |_| RegisterOptions::semantic(SemanticVariant::Published, LabelUse::Hard),
        },
        NamedMethod {
            name: "semantic_soft",
            option: "semantic-soft",
            title: "Semantic-ICP, soft",
            help: "Semantic-ICP as its authors' program runs, label distributions",
            takes_gate: false,
            options: |_| RegisterOptions::semantic(SemanticVariant::Published, LabelUse::Soft),
        },
        NamedMethod {
            name: "as_printed",
            option: "semantic-printed",
            title: "Semantic-ICP, as printed",
            help: "Semantic-ICP as the paper prints it, hard labels",
            takes_gate: false,
            options: |_| RegisterOptions::semantic(SemanticVariant::AsPrinted, LabelUse::Hard),
        },
        NamedMethod {
            name: "em_hard",
            option: "semantic-em",
            title: "Semantic-ICP, EM",
            help: "Semantic-ICP with normalised weights and outliers, hard labels",
            takes_gate: true,
            options: |gate_m| RegisterOptions::semantic_em(gate_m, LabelUse::Hard),
        },
        NamedMethod {
            name: "class_wise",
            option: "class-wise",
            title: "class-wise 2017",
            help: "Semantic-ICP of 2017, class by class",
            takes_gate: false,
            options: |_| RegisterOptions::class_wise(),
        },
        NamedMethod {
            name: "class_wise_cauchy",
            option: "class-wise-cauchy",
            title: "class-wise, Cauchy",
            help: "Class by class under the Cauchy kernel of GICP-SE(3)",
            takes_gate: false,
            options: |_| RegisterOptions::class_wise_cauchy(),
        },
    ];

    /// Method with the given name in result files.
    pub fn named(name: &str) -> Option<&'static NamedMethod> {
        Self::ALL.iter().find(|method| method.name == name)
    }

    /// Options of the method; `gate_m` applies if no gate is published.
    pub fn options(&self, gate_m: f64) -> RegisterOptions<'static> {
        (self.options)(gate_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_distinct_and_gates_are_taken_as_the_table_says() {
        for (i, method) in NamedMethod::ALL.iter().enumerate() {
            for other in NamedMethod::ALL.iter().skip(i + 1) {
                assert_ne!(method.name, other.name);
                assert_ne!(method.option, other.option);
                assert_ne!(method.title, other.title);
            }
            assert_eq!(method.options(0.37).gate_m == 0.37, method.takes_gate);
            let found = NamedMethod::named(method.name).unwrap();
            assert_eq!(found.option, method.option);
        }
    }
}
