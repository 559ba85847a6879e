//! Options of a registration: method, kernel, labels, and when to stop.

use super::Lift;

/// Cost that a registration minimises.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Method {
    /// Squared distance to the nearest point (Besl and McKay 1992).
    PointToPoint,
    /// Mahalanobis distance to the nearest point (Segal et al. 2009).
    Gicp,
    /// The same under a Cauchy kernel, on SE(3) (Nakamura et al. 2019, eq. 3).
    GicpSe3,
    /// Several near points, weighed by their labels (Nakamura et al. 2019, eqs. 5 to 8).
    Semantic(SemanticVariant),
    /// The nearest point of the same class, with trees and covariances of each class (Semantic-ICP of 2017).
    ClassWise,
}

/// Variant of Semantic-ICP.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum SemanticVariant {
    /// As printed: density times label likelihood, not normalised, inside the kernel.
    AsPrinted,
    /// As the authors' program runs: label likelihood alone, not normalised, outside the kernel.
    Published,
    /// Responsibilities, normalised over the candidates and an outlier class.
    Em,
}

/// Use of the labels.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum LabelUse {
    /// The most probable class of each point.
    Hard,
    /// The distribution of each point; for [`SemanticVariant::Published`] the shares of the most
    /// probable classes of the nearest 20 points of its own cloud.
    Soft,
}

/// Options of a registration.
///
/// Tolerances are for the step of one iteration; both must hold.
#[derive(Clone, Copy, Debug)]
pub struct RegisterOptions<'a> {
    /// Method: the cost that is minimised.
    pub method: Method,
    /// Longest distance between the points of a pair, metres.
    pub gate_m: f64,
    /// Candidates of each source point, at most [`MAX_CANDIDATES`]; one but for [`Method::Semantic`].
    pub neighbors: usize,
    /// Scale of the Cauchy kernel in Mahalanobis distances; infinite for none.
    pub cauchy_alpha: f64,
    /// Most searches for pairs.
    pub max_iterations: usize,
    /// Most steps between two searches.
    pub inner_iterations: usize,
    /// Rotation below which a step is none, radians.
    pub rotation_tolerance_rad: f64,
    /// Translation below which a step is none, metres.
    pub translation_tolerance_m: f64,
    /// Every how manieth source point is used; in the order of the tree, so spread evenly.
    pub source_stride: usize,
    /// Hard or soft labels.
    pub labels: LabelUse,
    /// Weight of a pair by its labels in place of their equality, for [`Method::Semantic`].
    pub pair_weight: Option<&'a Lift>,
    /// Factor a search on the variances, from a third of the gate across planes down to the true ones, for
    /// [`SemanticVariant::Em`]; 1 or more for none.
    pub anneal: f64,
    /// True if the kernel of [`Method::ClassWise`] takes the square of the squared distance, as the program
    /// of 2017 does.
    pub kernel_of_square: bool,
    /// Fewest source points of a class for [`Method::ClassWise`].
    pub min_class_points: usize,
}

/// Most candidates of a source point.
pub const MAX_CANDIDATES: usize = 16;

impl RegisterOptions<'_> {
    /// Point-to-point ICP.
    pub fn point_to_point(gate_m: f64) -> Self {
        RegisterOptions {
            method: Method::PointToPoint,
            max_iterations: 100,
            ..Self::gicp(gate_m)
        }
    }

    /// GICP as small_gicp 1.0.1 runs it: 20 iterations, 0.1 degrees, 1 mm.
    pub fn gicp(gate_m: f64) -> Self {
        RegisterOptions {
            method: Method::Gicp,
            gate_m,
            neighbors: 1,
            cauchy_alpha: f64::INFINITY,
            max_iterations: 20,
            inner_iterations: 1,
            rotation_tolerance_rad: 0.1_f64.to_radians(),
            translation_tolerance_m: 1e-3,
            source_stride: 1,
            labels: LabelUse::Hard,
            pair_weight: None,
            anneal: 1.0,
            kernel_of_square: false,
            min_class_points: 0,
        }
    }

    /// GICP-SE(3) as the authors of Semantic-ICP publish it (gicp.hpp), with their squared gate of 250 m^2.
    pub fn gicp_se3() -> Self {
        // They stop at ||log||^2 < 1e-5.
        let tolerance = (0.5e-5_f64).sqrt();
        RegisterOptions {
            method: Method::GicpSe3,
            cauchy_alpha: 3.0,
            max_iterations: 50,
            inner_iterations: 50,
            rotation_tolerance_rad: tolerance,
            translation_tolerance_m: tolerance,
            ..Self::gicp(250.0_f64.sqrt())
        }
    }

    /// Semantic-ICP as the authors publish it (em_icp.hpp), or their printed form.
    pub fn semantic(variant: SemanticVariant, labels: LabelUse) -> Self {
        RegisterOptions {
            method: Method::Semantic(variant),
            neighbors: 4,
            labels,
            ..Self::gicp_se3()
        }
    }

    /// Normalised Semantic-ICP that starts with wide variances.
    pub fn semantic_em(gate_m: f64, labels: LabelUse) -> Self {
        RegisterOptions {
            gate_m,
            inner_iterations: 2,
            rotation_tolerance_rad: 1e-4,
            translation_tolerance_m: 1e-4,
            anneal: 0.5,
            ..Self::semantic(SemanticVariant::Em, labels)
        }
    }

    /// Class-wise Semantic-ICP with the kernel and the stop of GICP-SE(3), for sparse clouds.
    pub fn class_wise_cauchy() -> Self {
        RegisterOptions {
            method: Method::ClassWise,
            min_class_points: 30,
            ..Self::gicp_se3()
        }
    }

    /// Class-wise Semantic-ICP as published in 2017 (semantic_icp.hpp).
    pub fn class_wise() -> Self {
        // They stop at ||log||^2 < 1e-3.
        let tolerance = (0.5e-3_f64).sqrt();
        RegisterOptions {
            method: Method::ClassWise,
            cauchy_alpha: 1.5,
            max_iterations: 35,
            rotation_tolerance_rad: tolerance,
            translation_tolerance_m: tolerance,
            kernel_of_square: true,
            min_class_points: 400,
            ..Self::gicp_se3()
        }
    }
}
