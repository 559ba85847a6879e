//! Lens distortion models of OpenCV and ROS, and their inverse.

use super::camera_error::CameraError;

/// Iteration limit of the inverse; a ray that does not converge is outside the model.
const MAX_STEPS: usize = 50;
/// Convergence threshold of the inverse on the normalised image plane: a ten thousandth of a pixel.
const ACCURACY: f64 = 1e-7;

/// Distortion model; image coordinates are x / z and y / z.
#[derive(Clone, Debug, PartialEq)]
pub enum Distortion {
    /// No distortion.
    None,
    /// plumb_bob and rational_polynomial: k1, k2, p1, p2, k3, k4, k5, k6.
    Rational([f64; 8]),
    /// equidistant (fisheye): k1 to k4.
    Equidistant([f64; 4]),
}

impl Distortion {
    /// Model by its name. A model with zero parameters is `None`, except equidistant.
    pub fn new(model: &str, d: &[f64]) -> Result<Self, CameraError> {
        let parameters = |model, expected| CameraError::Parameters {
            model,
            found: d.len(),
            expected,
        };
        let padded = || -> [f64; 8] { std::array::from_fn(|i| d.get(i).copied().unwrap_or(0.0)) };
        let found = match model {
            "plumb_bob" if matches!(d.len(), 0 | 4 | 5) => Self::Rational(padded()),
            "plumb_bob" => return Err(parameters("plumb_bob", "none, 4 or 5")),
            // OpenCV appends thin prism and tilt parameters, zero if unused.
            "rational_polynomial"
                if matches!(d.len(), 8 | 12 | 14) && d.iter().skip(8).all(|v| *v == 0.0) =>
            {
                Self::Rational(padded())
            }
            "rational_polynomial" => {
                let expected = "8, and only zeros behind them";
                return Err(parameters("rational_polynomial", expected));
            }
            "equidistant" => {
                let four = <[f64; 4]>::try_from(d).map_err(|_| parameters("equidistant", "4"))?;
                return Ok(Self::Equidistant(four));
            }
            // Drivers of rectified cameras leave the name empty.
            "" if d.iter().all(|v| *v == 0.0) => Self::None,
            other => return Err(CameraError::Model(other.chars().take(32).collect())),
        };
        Ok(match found {
            Self::Rational(zeros) if zeros == [0.0; 8] => Self::None,
            found => found,
        })
    }

    /// Distorted image point of a ray.
    pub fn distort(&self, ray: [f64; 2]) -> [f64; 2] {
        let [x, y] = ray;
        match self {
            Self::None => ray,
            Self::Rational([k1, k2, p1, p2, k3, k4, k5, k6]) => {
                let r2 = x * x + y * y;
                let above = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
                let below = 1.0 + r2 * (k4 + r2 * (k5 + r2 * k6));
                let radial = above / below;
                [
                    x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
                    y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
                ]
            }
            Self::Equidistant(k) => {
                let r = x.hypot(y);
                let scale = if r > 0.0 {
                    bent_angle(k, r.atan()) / r
                } else {
                    1.0
                };
                [x * scale, y * scale]
            }
        }
    }

    /// Ray of a distorted image point; `None` outside the model.
    pub fn undistort(&self, seen: [f64; 2]) -> Option<[f64; 2]> {
        match self {
            Self::None => Some(seen),
            Self::Rational(_) => self.newton(seen),
            Self::Equidistant(k) => {
                let r = seen[0].hypot(seen[1]);
                if r == 0.0 {
                    return Some(seen);
                }
                let scale = angle_from_bent(k, r)?.tan() / r;
                Some(seen.map(|v| v * scale))
            }
        }
    }

    /// Newton's method from the point itself, with step halving. Solutions behind the
    /// fold of the polynomial, where the image is inverted, are rejected.
    fn newton(&self, seen: [f64; 2]) -> Option<[f64; 2]> {
        let off = |ray: [f64; 2]| {
            let bent = self.distort(ray);
            let off = [bent[0] - seen[0], bent[1] - seen[1]];
            (off, off[0].hypot(off[1]))
        };
        let mut ray = seen;
        let (mut error, mut distance) = off(ray);
        for _ in 0..MAX_STEPS {
            let [a, b, c, d] = self.jacobian(ray);
            let determinant = a * d - b * c;
            if determinant.is_nan() || determinant <= 0.0 {
                return None;
            }
            if distance < ACCURACY * 1e-3 {
                return Some(ray);
            }
            let step = [
                (d * error[0] - b * error[1]) / determinant,
                (a * error[1] - c * error[0]) / determinant,
            ];
            let mut length = 1.0;
            loop {
                let next = [ray[0] - length * step[0], ray[1] - length * step[1]];
                let (next_error, next_distance) = off(next);
                if next_distance < distance {
                    (ray, error, distance) = (next, next_error, next_distance);
                    break;
                }
                length *= 0.5;
                if length < 1e-4 {
                    return (distance < ACCURACY).then_some(ray);
                }
            }
        }
        (distance < ACCURACY).then_some(ray)
    }

    /// Jacobian of `distort`, row by row, by central differences.
    fn jacobian(&self, [x, y]: [f64; 2]) -> [f64; 4] {
        let h = 1e-6;
        let slope = |from: [f64; 2], to: [f64; 2]| {
            let (from, to) = (self.distort(from), self.distort(to));
            [0, 1].map(|i| (to[i] - from[i]) / (2.0 * h))
        };
        let along_x = slope([x - h, y], [x + h, y]);
        let along_y = slope([x, y - h], [x, y + h]);
        [along_x[0], along_y[0], along_x[1], along_y[1]]
    }
}

/// Distorted angle of a fisheye for a ray at `angle_rad` from the axis, rad.
fn bent_angle(k: &[f64; 4], angle_rad: f64) -> f64 {
    let a2 = angle_rad * angle_rad;
    angle_rad * (1.0 + a2 * (k[0] + a2 * (k[1] + a2 * (k[2] + a2 * k[3]))))
}

/// Inverse of [`bent_angle`] on its rising part, by Newton's method; `None` from a right angle on, where
/// a distance along the axis is undefined.
fn angle_from_bent(k: &[f64; 4], bent_rad: f64) -> Option<f64> {
    let slope = |a: f64| {
        let a2 = a * a;
        1.0 + a2 * (3.0 * k[0] + a2 * (5.0 * k[1] + a2 * (7.0 * k[2] + a2 * 9.0 * k[3])))
    };
    let mut angle_rad = bent_rad.min(1.5);
    for _ in 0..MAX_STEPS {
        let rise = slope(angle_rad);
        if rise.is_nan() || rise <= 0.0 {
            return None;
        }
        let step = (bent_angle(k, angle_rad) - bent_rad) / rise;
        angle_rad = (angle_rad - step).clamp(0.0, std::f64::consts::FRAC_PI_2);
        if step.abs() < 1e-12 {
            break;
        }
    }
    let is_found = (bent_angle(k, angle_rad) - bent_rad).abs() < ACCURACY;
    (is_found && angle_rad < 1.55).then_some(angle_rad)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn small(limit: f64) -> impl Strategy<Value = f64> {
        -limit..limit
    }

    proptest! {
        #[test]
        fn rays_come_back_from_where_they_are_seen(
            k in [small(0.3), small(0.1), small(0.003), small(0.003), small(0.03)],
            fisheye in [small(0.03), small(0.01), small(0.003), small(0.001)],
            ray in [small(0.7), small(0.5)],
        ) {
            let mut rational = [0.0; 8];
            rational[..5].copy_from_slice(&k);
            rational[5..].copy_from_slice(&fisheye[..3]);
            for (model, d) in [
                ("plumb_bob", &k[..]),
                ("rational_polynomial", &rational[..]),
                ("equidistant", &fisheye[..]),
            ] {
                let model = Distortion::new(model, d).unwrap();
                let [a, b, c, d] = model.jacobian(ray);
                // Near its fold a model shows two rays at one place.
                prop_assume!(a * d - b * c > 0.3);
                let back = model.undistort(model.distort(ray)).unwrap();
                for i in 0..2 {
                    prop_assert!((back[i] - ray[i]).abs() < 1e-6, "{model:?} {ray:?} {back:?}");
                }
            }
        }

        #[test]
        fn any_numbers_end(d in [any::<f64>(); 8], seen in [any::<f64>(), any::<f64>()]) {
            for (model, n) in [("plumb_bob", 5), ("rational_polynomial", 8), ("equidistant", 4)] {
                let model = Distortion::new(model, &d[..n]).unwrap();
                if let Some(ray) = model.undistort(seen) {
                    let back = model.distort(ray);
                    let near = 1e-5 * seen[0].hypot(seen[1]).max(1.0);
                    prop_assert!((0..2).all(|i| (back[i] - seen[i]).abs() < near), "{model:?}");
                }
            }
        }
    }

    #[test]
    fn models_are_refused_by_name_and_number() {
        for (model, d, problem) in [
            (
                "thin_prism",
                &[0.0; 4][..],
                "'thin_prism', expected plumb_bob",
            ),
            (
                "plumb_bob",
                &[0.0; 8],
                "8 parameters of plumb_bob, expected none, 4 or 5",
            ),
            ("equidistant", &[0.0; 5], "5 parameters of equidistant"),
            ("rational_polynomial", &[1.0; 14], "only zeros behind"),
            ("", &[1.0], "model ''"),
        ] {
            let error = Distortion::new(model, d).unwrap_err().to_string();
            assert!(error.contains(problem), "{error}");
        }
        let straight = Distortion::new("plumb_bob", &[0.0; 5]);
        assert_eq!(straight, Ok(Distortion::None));
    }
}
