//! Counters of the projector.

use lattice_msgs::geometry_msgs::TransformStamped;
use lattice_msgs::map_msgs::OccupancyGridUpdate;
use lattice_msgs::nav_msgs::OccupancyGrid;
use lattice_msgs::std_msgs::Empty;
use lattice_msgs::tf2_msgs::TFMessage;

use super::*;

#[test]
fn a_projector_counts_messages_grids_and_updates() {
    let node = Driven::start("map_projector", "grid", &["update_period_s:=0.05"]);
    // Nobody subscribes to the grid, so the map is not followed.
    node.shows(&[("messages_in", 0)]);
    let (grid, grids) = channel();
    let (update, updates) = channel();
    let shared = SubscriptionExecutor::Shared;
    let _outputs = (
        node.world.subscribe(
            "projected_map",
            Qos::LATCHED,
            shared,
            move |found: Arc<OccupancyGrid>| {
                let _ = grid.send(found);
            },
        ),
        node.world.subscribe(
            "projected_map_updates",
            Qos::DEFAULT,
            shared,
            move |found: Arc<OccupancyGridUpdate>| {
                let _ = update.send(found);
            },
        ),
    );
    let side = |i: u16| 0.25 * f32::from(i);
    let floor = |z: f32| -> Vec<[f32; 3]> {
        (0..40)
            .flat_map(|x| (0..40).map(move |y| [side(x), side(y), z]))
            .collect()
    };
    let mut mapper = mapper([0.0; 3], &floor(0.0));
    mapper.take_update();
    let keyframe = mapper.keyframe();
    // The subscriptions of the node are there once it asks for a keyframe.
    let (request, asked) = channel();
    let _asked = node.world.subscribe(
        "lattice_mapper/request_keyframe",
        Qos::DEFAULT,
        shared,
        move |_: Arc<Empty>| {
            let _ = request.send(());
        },
    );
    while grids.try_recv().is_err() {
        node.map("voxel_map", &keyframe);
        let _ = asked.recv_timeout(Duration::from_millis(100));
    }
    let taken = |key: &str| {
        let status = loop {
            let status = node.stated.recv_timeout(PATIENCE).unwrap();
            if status.name.ends_with("grid") {
                break status;
            }
        };
        let found = status.values.iter().find(|value| value.key == key);
        found.unwrap().value.parse::<u64>().unwrap()
    };
    // The keyframe came as often as it took.
    node.shows(&[("grids_out", 1), ("updates_out", 0)]);
    let before = taken("messages_in");
    insert(&mut mapper, &floor(1.0)[..400]);
    let changed = mapper.take_update();
    node.update("voxel_map_updates", &changed);
    node.map("voxel_map", &[malformed(&keyframe[0])]);
    insert(&mut mapper, &[[1.0; 3]]);
    mapper.take_update();
    insert(&mut mapper, &[[2.0; 3]]);
    node.update("voxel_map_updates", &mapper.take_update());
    let mut tf = TransformStamped::default();
    tf.transform.translation.x = f64::NAN;
    let message = TFMessage {
        transforms: vec![tf],
    };
    node.publish("/tf", Qos::TF, &[message]);
    let expected = [
        ("messages_in", before + changed.len() as u64 + 2),
        ("messages_refused", 1),
        ("gaps", 1),
        ("grids_refused", 0),
        ("elevations_out", 0),
        ("elevations_refused", 0),
        ("grids_not_published", 0),
        ("transforms_refused", 1),
        ("inbox_full", 0),
    ];
    node.shows(&expected);
    updates.recv_timeout(PATIENCE).unwrap();
    node.ends_with(&expected);
}
