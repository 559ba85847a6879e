//! Options of a registration: method, robust kernel, labels and termination.

use super::Lift;

/// Cost that a registration minimizes.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Method {
    /// Squared distance to the nearest point (Besl and McKay 1992).
    PointToPoint,
    /// Mahalanobis distance to the nearest point (Segal et al. 2009).
    Gicp,
    /// Mahalanobis distance to the nearest point under a Cauchy kernel, on SE(3) (Nakamura et al. 2019, eq. 3).
    GicpSe3,
    /// Mahalanobis distances to several near points, weighted by their labels (Nakamura et al. 2019, eqs. 5 to 8).
    Semantic(SemanticVariant),
    /// Mahalanobis distance to the nearest point of the same class, with a tree and covariances per class
    /// (Semantic-ICP of 2017).
    ClassWise,
}

/// Variant of Semantic-ICP.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum SemanticVariant {
    /// As printed in the paper: density times label likelihood, not normalized, inside the kernel.
    AsPrinted,
    /// As in the authors' code: label likelihood alone, not normalized, outside the kernel.
    Published,
    /// EM responsibilities, normalized over the candidates and an outlier class.
    Em,
}

/// Use of the labels.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum LabelUse {
    /// The most probable class of each point.
    Hard,
    /// The distribution of each point; for [`SemanticVariant::Published`] the fractions of the most probable classes
    /// of the nearest 20 points of its own cloud.
    Soft,
}

/// Options of a registration.
///
/// Both tolerances must hold for the step of one iteration.
#[derive(Clone, Copy, Debug)]
pub struct RegisterOptions<'a> {
    /// Method: the cost that is minimised.
    pub method: Method,
    /// Maximum distance of a correspondence (gate), metres.
    pub gate_m: f64,
    /// Candidate correspondences per source point, at most [`MAX_CANDIDATES`]; one except for [`Method::Semantic`].
    pub neighbors: usize,
    /// Scale of the Cauchy kernel in Mahalanobis distances; `INFINITY` for no kernel.
    pub cauchy_alpha: f64,
    /// Maximum number of correspondence searches.
    pub max_iterations: usize,
    /// Maximum number of optimizer steps per search.
    pub inner_iterations: usize,
    /// Rotation of a step below which the registration has converged, radians.
    pub rotation_tolerance_rad: f64,
    /// Translation of a step below which the registration has converged, metres.
    pub translation_tolerance_m: f64,
    /// Stride over the source points, in the order of the tree, which samples them evenly.
    pub source_stride: usize,
    /// Hard or soft labels.
    pub labels: LabelUse,
    /// Weight of a correspondence by its labels, instead of their equality, for [`Method::Semantic`].
    pub pair_weight: Option<&'a Lift>,
    /// Annealing factor of the variances per search, from a third of the gate across planes down to the true ones,
    /// for [`SemanticVariant::Em`]; 1 or more disables it.
    pub anneal: f64,
    /// Applies the kernel of [`Method::ClassWise`] to the square of the squared distance, as the code of 2017 does.
    pub kernel_of_square: bool,
    /// Minimum number of source points per class for [`Method::ClassWise`].
    pub min_class_points: usize,
}

/// Maximum number of candidate correspondences per source point.
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

    /// GICP with the defaults of small_gicp 1.0.1: 20 iterations, 0.1 degrees, 1 mm.
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

    /// GICP-SE(3) as published with Semantic-ICP (gicp.hpp), with its squared gate of 250 m^2.
    pub fn gicp_se3() -> Self {
        // The published tolerance is ||log||^2 < 1e-5.
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

    /// Semantic-ICP as published by its authors (em_icp.hpp), or as printed in the paper.
    pub fn semantic(variant: SemanticVariant, labels: LabelUse) -> Self {
        RegisterOptions {
            method: Method::Semantic(variant),
            neighbors: 4,
            labels,
            ..Self::gicp_se3()
        }
    }

    /// Normalized Semantic-ICP with annealed variances.
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

    /// Class-wise Semantic-ICP with the kernel and the tolerances of GICP-SE(3), for sparse clouds.
    pub fn class_wise_cauchy() -> Self {
        RegisterOptions {
            method: Method::ClassWise,
            min_class_points: 30,
            ..Self::gicp_se3()
        }
    }

    /// Class-wise Semantic-ICP as published in 2017 (semantic_icp.hpp).
    pub fn class_wise() -> Self {
        // The published tolerance is ||log||^2 < 1e-3.
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
