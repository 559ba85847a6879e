//! Grid of surface facets, for lines of sight.

use nalgebra::{Point3, Vector3};

use super::grid::Grid;

/// Minimum number of points of a facet.
const MIN_POINTS: u32 = 3;
/// Length of the mean normal below which a cell contains an edge or clutter.
const FLAT: f32 = 0.8;
/// Cosine between ray and normal below which a ray is parallel to a facet.
const STEEP: f64 = 0.4;
/// Largest distance of a crossing from the centroid of a facet, in cells.
const REACH: f64 = 0.75;
/// Distance from an edge within which crossings are uncertain because of errors of the pose, metres.
const EDGE_M: f64 = 0.1;

/// Grid cells of a map with their surface facets.
#[derive(Clone, Debug)]
pub struct OccupiedGrid {
    grid: Grid,
    /// Index of the facet of each cell, from 1; 0 for none.
    cells: Vec<u32>,
    facets: Vec<Facet>,
}

/// Planar facet in a cell.
#[derive(Clone, Copy, Debug)]
struct Facet {
    centroid_m: Point3<f32>,
    /// Mean of the normals, oriented to one side.
    normal: Vector3<f32>,
    points: u32,
}

impl OccupiedGrid {
    /// Builds the grid from points with unit normals; cells grow if the map exceeds the maximum number of cells.
    /// `None` without points.
    pub fn new(
        points_m: &[Point3<f64>],
        normals: &[Vector3<f64>],
        cell_m: f64,
    ) -> Option<OccupiedGrid> {
        let grid = Grid::around(points_m, cell_m, 0)?;
        let mut cells = vec![0_u32; grid.len()];
        let mut facets: Vec<Facet> = Vec::new();
        for (point, normal) in points_m.iter().zip(normals) {
            let at = grid.index(grid.cell_of(&point.coords));
            let Some(cell) = at.and_then(|at| cells.get_mut(at)) else {
                continue;
            };
            let (point, normal) = (point.cast::<f32>(), normal.cast::<f32>());
            match facets.get_mut((*cell as usize).wrapping_sub(1)) {
                Some(facet) => facet.add(&point, &normal),
                None => {
                    facets.push(Facet {
                        centroid_m: point,
                        normal,
                        points: 1,
                    });
                    *cell = facets.len() as u32;
                }
            }
        }
        Some(OccupiedGrid {
            grid,
            cells,
            facets,
        })
    }

    /// Side of a cell, metres.
    pub fn cell_m(&self) -> f64 {
        self.grid.cell_m
    }

    /// Distance along a ray, metres, at which it crosses the facet in the cell of `place_m`.
    ///
    /// Rays parallel to a surface, near an edge or through clutter do not cross.
    pub fn crossing_m(
        &self,
        place_m: &Point3<f64>,
        from_m: &Point3<f64>,
        direction: &Vector3<f64>,
    ) -> Option<f64> {
        let at = self.grid.index(self.grid.cell_of(&place_m.coords))?;
        let number = self.cells.get(at).copied()? as usize;
        let facet = self.facets.get(number.checked_sub(1)?)?;
        let flatness = facet.normal.norm();
        if facet.points < MIN_POINTS || flatness < FLAT {
            return None;
        }
        let normal = (facet.normal / flatness).cast::<f64>();
        let centroid_m = facet.centroid_m.cast::<f64>();
        let steepness = normal.dot(direction);
        if steepness.abs() < STEEP {
            return None;
        }
        let along_m = normal.dot(&(centroid_m - from_m)) / steepness;
        let crossing_m = from_m + direction * along_m;
        let is_near = (crossing_m - centroid_m).norm() < REACH * self.grid.cell_m;
        (is_near && self.is_surrounded(&crossing_m, &normal)).then_some(along_m)
    }

    /// Tests whether the surface extends to all sides of a place; small errors of the pose move rays past edges.
    fn is_surrounded(&self, place_m: &Point3<f64>, normal: &Vector3<f64>) -> bool {
        let axis = Vector3::ith(normal.iamin(), 1.0);
        let along = normal.cross(&axis).normalize() * EDGE_M.min(self.grid.cell_m);
        let other = normal.cross(&along);
        let across = normal * (0.5 * self.grid.cell_m);
        [along, -along, other, -other].into_iter().all(|side| {
            let beside = place_m + side;
            [beside, beside + across, beside - across]
                .iter()
                .any(|place| self.is_occupied(place))
        })
    }

    /// Distance of the first occupied cell in a direction (a unit vector) from a place, within `way_m`, metres.
    pub fn distance_m(
        &self,
        from_m: &Point3<f64>,
        direction: &Vector3<f64>,
        way_m: std::ops::Range<f64>,
    ) -> Option<f64> {
        let steps = ((way_m.end - way_m.start) / self.grid.cell_m) as u32;
        let mut distances_m = (0..=steps).map(|i| way_m.start + f64::from(i) * self.grid.cell_m);
        distances_m.find(|distance_m| self.is_occupied(&(from_m + direction * *distance_m)))
    }

    fn is_occupied(&self, place_m: &Point3<f64>) -> bool {
        let at = self.grid.index(self.grid.cell_of(&place_m.coords));
        at.and_then(|at| self.cells.get(at))
            .is_some_and(|cell| *cell > 0)
    }
}

impl Facet {
    fn add(&mut self, point: &Point3<f32>, normal: &Vector3<f32>) {
        self.points = self.points.saturating_add(1);
        let share = 1.0 / self.points as f32;
        let side = normal.dot(&self.normal).signum();
        self.centroid_m += (point - self.centroid_m) * share;
        self.normal += (normal * side - self.normal) * share;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square wall at x = 2 m, 5 cm between its points.
    fn wall() -> OccupiedGrid {
        let places = (-20..=20).flat_map(|y| (-20..=20).map(move |z| (y, z)));
        let points: Vec<_> = places
            .map(|(y, z)| Point3::new(2.0, 0.05 * f64::from(y), 0.05 * f64::from(z)))
            .collect();
        // Normals have no side of their own.
        let normals: Vec<_> = (0..points.len())
            .map(|i| Vector3::x() * if i % 2 == 0 { 1.0 } else { -1.0 })
            .collect();
        OccupiedGrid::new(&points, &normals, 0.1).unwrap()
    }

    #[test]
    fn a_ray_through_a_wall_crosses_it_and_one_along_it_does_not() {
        let (wall, from) = (wall(), Point3::origin());
        let through = Vector3::new(0.9, 0.2, 0.1).normalize();
        let at = from + through * (2.0 / through.x);
        let along = wall.crossing_m(&at, &from, &through).unwrap();
        assert!((along - 2.0 / through.x).abs() < 1e-6);
        let beside = Point3::new(2.0, -0.6, 0.0);
        assert_eq!(
            wall.crossing_m(&Point3::new(2.0, 0.0, 0.0), &beside, &Vector3::y()),
            None
        );
        let elsewhere = Point3::new(1.0, 0.0, 0.0);
        assert_eq!(wall.crossing_m(&elsewhere, &from, &through), None);
    }

    #[test]
    fn a_ray_past_the_edge_of_a_wall_does_not_count() {
        let (wall, from) = (wall(), Point3::origin());
        let crosses = |y: f64| {
            let through = Vector3::new(2.0, y, 0.3);
            let place = from + through;
            wall.crossing_m(&place, &from, &through.normalize())
                .is_some()
        };
        assert!(crosses(0.55) && crosses(-0.65));
        // An edge is known to a cell.
        assert!(!crosses(1.0) && !crosses(-0.97));
    }

    #[test]
    fn a_few_points_or_an_edge_are_no_facet() {
        let few = [Point3::new(2.0, 0.0, 0.0); 2];
        let grid = OccupiedGrid::new(&few, &[Vector3::x(); 2], 0.1).unwrap();
        assert_eq!(
            grid.crossing_m(&few[0], &Point3::origin(), &Vector3::x()),
            None
        );
        let edge = [Point3::new(2.0, 0.0, 0.0); 4];
        let normals = [Vector3::x(), Vector3::y(), Vector3::x(), Vector3::y()];
        let grid = OccupiedGrid::new(&edge, &normals, 0.1).unwrap();
        assert_eq!(
            grid.crossing_m(&edge[0], &Point3::origin(), &Vector3::x()),
            None
        );
        assert!(OccupiedGrid::new(&[], &[], 0.1).is_none());
    }
}
