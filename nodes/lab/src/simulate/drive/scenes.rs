//! Scenes of drives.

use nalgebra::{Point3, Vector3};

use super::route::{Form as Way, Route};
use super::scans::{Drive, Moving, SpinningLidar};
use crate::random::Stream;
use crate::simulate::town::solid::{Form, Solid};

/// Scene of a drive.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum DriveScene {
    /// A circuit of streets with parked and moving cars.
    Town,
    /// A circuit through a hall with partitions and furniture.
    Indoor,
    /// A corridor with doors and closed ends.
    Corridor,
    /// A street, a tunnel without features, and a street.
    Tunnel,
    /// An empty plane.
    Yard,
    /// The indoor circuit, with scans without returns for a while.
    Blank,
    /// The indoor circuit, without scans for two seconds.
    Gap,
    /// The circuit of streets, and half of it again.
    TownAgain,
    /// The indoor circuit, and half of it again.
    IndoorAgain,
}

impl DriveScene {
    /// All scenes.
    pub const ALL: [DriveScene; 9] = [
        DriveScene::Town,
        DriveScene::Indoor,
        DriveScene::Corridor,
        DriveScene::Tunnel,
        DriveScene::Yard,
        DriveScene::Blank,
        DriveScene::Gap,
        DriveScene::TownAgain,
        DriveScene::IndoorAgain,
    ];

    /// Name of the scene.
    pub fn name(self) -> &'static str {
        match self {
            DriveScene::Town => "town",
            DriveScene::Indoor => "indoor",
            DriveScene::Corridor => "corridor",
            DriveScene::Tunnel => "tunnel",
            DriveScene::Yard => "yard",
            DriveScene::Blank => "blank",
            DriveScene::Gap => "gap",
            DriveScene::TownAgain => "town_again",
            DriveScene::IndoorAgain => "indoor_again",
        }
    }
}

/// Class of all solids: odometry has no classes.
const LABEL: u16 = 0;

/// Rounds of a drive that comes back.
const AGAIN: f64 = 1.5;

const ROOF: SpinningLidar = SpinningLidar {
    beams: 32,
    shots: 900,
    elevations_deg: [-25.0, 15.0],
    range_m: 100.0,
    noise_m: 0.02,
    height_m: 1.8,
};
const ROBOT: SpinningLidar = SpinningLidar {
    beams: 16,
    shots: 900,
    elevations_deg: [-15.0, 15.0],
    range_m: 60.0,
    noise_m: 0.02,
    height_m: 1.0,
};

impl Drive {
    /// Creates the drive of a scene and a seed.
    pub fn new(scene: DriveScene, seed: u64) -> Drive {
        drive(scene, seed)
    }

    /// Creates the drive through the town with persons who walk by, and the same drive without anything that moves:
    /// what both hit has the same points.
    pub fn passers(seed: u64) -> [Drive; 2] {
        passers(seed)
    }
}

fn drive(scene: DriveScene, seed: u64) -> Drive {
    let random = &mut Stream::numbered(seed, 3);
    let mut drive = match scene {
        DriveScene::Town | DriveScene::TownAgain => town(random),
        DriveScene::Corridor => corridor(random),
        DriveScene::Tunnel => tunnel(random),
        DriveScene::Yard => yard(),
        DriveScene::Indoor | DriveScene::IndoorAgain | DriveScene::Blank | DriveScene::Gap => {
            indoor(random)
        }
    };
    drive.seed = seed;
    // Anywhere along the way.
    let from = 60 + (200.0 * random.uniform()) as i64;
    match scene {
        DriveScene::Blank => drive.blank = from..from + 8,
        DriveScene::Gap => drive.missing = from..from + 20,
        DriveScene::TownAgain | DriveScene::IndoorAgain => drive.route.length_m *= AGAIN,
        _ => {}
    }
    drive
}

fn block(low: [f64; 3], high: [f64; 3], windows: bool) -> Solid {
    let [low, high] = [low, high].map(Point3::from);
    let (low, high) = low.coords.inf_sup(&high.coords);
    let form = Form::Block {
        low: low.into(),
        high: high.into(),
        windows,
    };
    Solid { form, label: LABEL }
}

fn pillar(x: f64, y: f64, radius: f64, height: f64) -> Solid {
    let form = Form::Pillar {
        foot: Point3::new(x, y, 0.0),
        radius,
        height,
    };
    Solid { form, label: LABEL }
}

fn still(lidar: SpinningLidar, solids: Vec<Solid>, route: Route) -> Drive {
    Drive {
        seed: 0,
        lidar,
        solids,
        moving: Vec::new(),
        route,
        blank: 0..0,
        missing: 0..0,
    }
}

/// Houses, parked cars and poles along a line of x, on the side `side` of y.
fn street_side(solids: &mut Vec<Solid>, line: Line, random: &mut Stream) {
    let mut at_m = line.from_m;
    while at_m < line.to_m {
        let width_m = (7.0 + 9.0 * random.uniform()).min(line.to_m - at_m);
        let back_m = 8.0 + 2.0 * random.uniform();
        let height_m = 5.0 + 6.0 * random.uniform();
        line.block(
            solids,
            [at_m, back_m, 0.0],
            [at_m + width_m, back_m + 8.0, height_m],
            true,
        );
        at_m += width_m
            + if random.uniform() < 0.4 {
                4.0 * random.uniform()
            } else {
                0.0
            };
    }
    let mut at_m = line.from_m + 3.0;
    while at_m < line.to_m {
        if random.uniform() < 0.5 {
            line.block(solids, [at_m, 4.6, 0.2], [at_m + 4.2, 6.4, 1.5], false);
        }
        if random.uniform() < 0.3 {
            let (x, y) = line.place(at_m + 5.0, 7.0);
            solids.push(pillar(x, y, 0.1 + 0.2 * random.uniform(), 5.0));
        }
        at_m += 7.0;
    }
}

/// A side of a street: along x or y, at a distance from a middle line.
#[derive(Clone, Copy)]
struct Line {
    from_m: f64,
    to_m: f64,
    middle_m: f64,
    side: f64,
    along_y: bool,
}

impl Line {
    fn place(&self, along_m: f64, off_m: f64) -> (f64, f64) {
        let across_m = self.middle_m + self.side * off_m;
        match self.along_y {
            true => (across_m, along_m),
            false => (along_m, across_m),
        }
    }

    fn block(&self, solids: &mut Vec<Solid>, low: [f64; 3], high: [f64; 3], windows: bool) {
        let corner = |[along, off, z]: [f64; 3]| {
            let (x, y) = self.place(along, off);
            [x, y, z]
        };
        solids.push(block(corner(low), corner(high), windows));
    }
}

fn town(random: &mut Stream) -> Drive {
    let (half_m, corner_m) = ([80.0, 50.0], 9.0);
    let mut solids = Vec::new();
    for sign in [-1.0, 1.0] {
        for (along_y, half, other) in [(false, half_m[0], half_m[1]), (true, half_m[1], half_m[0])]
        {
            for (side, to_m) in [(sign, half + 12.0), (-sign, half - 20.0)] {
                let line = Line {
                    from_m: -to_m,
                    to_m,
                    middle_m: sign * other,
                    side,
                    along_y,
                };
                street_side(&mut solids, line, random);
            }
        }
    }
    let car = |from_m: f64, middle_m: f64, speed: f64| Moving {
        solid: block(
            [from_m, middle_m - 0.9, 0.2],
            [from_m + 4.2, middle_m + 0.9, 1.5],
            false,
        ),
        velocity: Vector3::new(speed, 0.0, 0.0),
    };
    // In the lanes against and ahead of the lidar.
    let mut place = |range: f64| range * (random.uniform() - 0.5);
    let moving = vec![
        car(60.0 + place(40.0), -half_m[1] + 3.2, -9.0),
        car(12.0 + place(8.0), -half_m[1], 9.0),
        car(-350.0 + place(60.0), half_m[1] - 3.2, 9.0),
        car(300.0 + place(60.0), half_m[1], -7.5),
    ];
    let form = Way::Around { half_m, corner_m };
    let length_m = Route::round_m(half_m, corner_m);
    let route = Route::new(form, 8.0, length_m);
    Drive {
        moving,
        ..still(ROOF, solids, route)
    }
}

/// The town with three persons, and without them and the moving cars.
fn passers(seed: u64) -> [Drive; 2] {
    let still = || Drive {
        moving: Vec::new(),
        ..drive(DriveScene::Town, seed)
    };
    let mut passers = drive(DriveScene::Town, seed);
    let walk = |x: f64, y: f64, velocity: [f64; 2]| Moving {
        solid: pillar(x, y, 0.25, 1.75),
        velocity: Vector3::new(velocity[0], velocity[1], 0.0),
    };
    // Over the street ahead, along the houses with the lidar, and towards it on the other side.
    passers.moving.extend([
        walk(62.0, -58.0, [0.0, 1.3]),
        walk(8.0, -43.0, [1.3, 0.0]),
        walk(45.0, -57.0, [-1.3, 0.0]),
    ]);
    [passers, still()]
}

fn indoor(random: &mut Stream) -> Drive {
    let (half_m, corner_m) = ([11.0, 7.0], 1.5);
    let [x, y] = half_m.map(|half| half + 3.0);
    let mut solids = vec![
        block([-x - 0.3, -y, 0.0], [-x, y, 3.0], false),
        block([x, -y, 0.0], [x + 0.3, y, 3.0], false),
        block([-x, -y - 0.3, 0.0], [x, -y, 3.0], false),
        block([-x, y, 0.0], [x, y + 0.3, 3.0], false),
        block([-x, -y, 3.0], [x, y, 3.3], false),
        block([-8.0, -4.5, 0.0], [8.0, 4.5, 3.0], false),
    ];
    for side in [-1.0, 1.0] {
        let mut at_m = -x + 2.0 + 2.0 * random.uniform();
        while at_m < x - 2.0 {
            // Partitions, and cupboards between them.
            solids.push(block(
                [at_m, side * y, 0.0],
                [at_m + 0.15, side * (y - 1.6), 2.5],
                false,
            ));
            let depth_m = 0.4 + 0.5 * random.uniform();
            let wide_m = 0.6 + random.uniform();
            let from_m = at_m + 0.8;
            let high_m = 0.8 + 1.2 * random.uniform();
            let far = [from_m + wide_m, side * (y - depth_m), high_m];
            solids.push(block([from_m, side * y, 0.0], far, false));
            at_m += 3.0 + 2.0 * random.uniform();
        }
    }
    for _ in 0..6 {
        let at = [x - 0.3, -y + 2.0 * y * random.uniform()];
        let side = if random.uniform() < 0.5 { -1.0 } else { 1.0 };
        solids.push(pillar(side * at[0], at[1], 0.25, 2.0));
    }
    let length_m = Route::round_m(half_m, corner_m);
    let form = Way::Around { half_m, corner_m };
    let route = Route::new(form, 1.3, length_m);
    still(ROBOT, solids, route)
}

fn corridor(random: &mut Stream) -> Drive {
    let (length_m, half_m) = (50.0, 1.2);
    let mut solids = vec![
        block([-2.3, -3.0, 0.0], [-2.0, 3.0, 3.0], false),
        block(
            [length_m + 2.0, -3.0, 0.0],
            [length_m + 2.3, 3.0, 3.0],
            false,
        ),
        block([-2.0, -3.0, 2.8], [length_m + 2.0, 3.0, 3.1], false),
    ];
    for side in [-1.0, 1.0] {
        // Behind the doors, which are recessed.
        let back_m = half_m + 0.15;
        solids.push(block(
            [-2.0, side * back_m, 0.0],
            [length_m + 2.0, side * (back_m + 0.3), 2.8],
            false,
        ));
        let mut from_m = -2.0;
        while from_m < length_m + 2.0 {
            let to_m = (from_m + 3.0 + 3.0 * random.uniform()).min(length_m + 2.0);
            solids.push(block(
                [from_m, side * half_m, 0.0],
                [to_m, side * back_m, 2.8],
                false,
            ));
            from_m = to_m + 0.9;
        }
    }
    let form = Way::Straight { from: [0.0, 0.1] };
    let route = Route::new(form, 1.2, length_m);
    still(ROBOT, solids, route)
}

fn tunnel(random: &mut Stream) -> Drive {
    let (from_m, to_m) = (90.0, 310.0);
    let mut solids = vec![
        block([from_m, -5.5, 0.0], [to_m, -5.0, 6.0], false),
        block([from_m, 5.0, 0.0], [to_m, 5.5, 6.0], false),
        block([from_m, -5.5, 5.5], [to_m, 5.5, 6.0], false),
    ];
    for (from_m, to_m) in [(-60.0, from_m - 2.0), (to_m + 2.0, to_m + 150.0)] {
        for side in [-1.0, 1.0] {
            let line = Line {
                from_m,
                to_m,
                middle_m: 0.0,
                side,
                along_y: false,
            };
            street_side(&mut solids, line, random);
        }
    }
    let form = Way::Straight { from: [0.0, -1.5] };
    let route = Route::new(form, 12.0, 400.0);
    still(ROOF, solids, route)
}

fn yard() -> Drive {
    let (half_m, corner_m) = ([20.0, 15.0], 6.0);
    let form = Way::Around { half_m, corner_m };
    let route = Route::new(form, 4.0, 80.0);
    still(ROOF, Vec::new(), route)
}
